"""Paths and roadmaps as configurations to be checked, with the edges between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..companions.local_planners import ways_between
from ..companions.paths import path_record
from ..companions.roadmaps import roadmap_record
from ..errors import DiagnosticLog
from ..formats.source import Source
from ..simulation.edge_verdicts import Edges
from ..simulation.scene import Scene
from .rows import Configurations, Graph, Poses

Indices = NDArray[np.int64]


def of_path(scene: Scene, source: Source, log: DiagnosticLog) -> Configurations:
    """Read a path: its configurations, and the straight ways from each to the next one of the same robot.

    Raises:
        FormatError: It cannot be read, or is the path of another robot.
    """
    path = path_record(scene, source, log)
    several = len(scene.space.robot_slices) > 1
    robots, lines = path.robots.tolist(), path.lines.tolist()
    labels = tuple(
        f"{_robot(robots[i]) if several else ''}configuration {i + 1} of {len(path)} ({source.path}:{lines[i]})"
        for i in range(len(path))
    )
    ends = _steps(path.robots)
    names = [f"edge from configuration {i + 1} to {j + 1} ({source.path}:{lines[i]})" for i, j in ends.tolist()]
    edges = Edges(path.q, ends, (), names)
    poses = None if path.poses is None else Poses(path.poses, path.fits, path.pose_error)
    return Configurations(path.q, labels, Graph("path", str(path.version), path.lines, edges, poses))


def of_roadmap(scene: Scene, source: Source, log: DiagnosticLog) -> Configurations:
    """Read a roadmap: its nodes, and its edges the way that their local planner went.

    Raises:
        FormatError: It cannot be read, or is the roadmap of another robot.
    """
    roadmap = roadmap_record(scene, source, log)
    vids, lines = roadmap.vids.tolist(), roadmap.lines.tolist()
    labels = tuple(f"node {vid} ({source.path}:{line})" for vid, line in zip(vids, lines, strict=True))
    names = [f"edge from node {vids[i]} to {vids[j]} ({source.path}:{lines[i]})" for i, j in roadmap.edges.tolist()]
    edges = Edges(roadmap.q, roadmap.edges, ways_between(scene, roadmap, log), names)
    return Configurations(
        roadmap.q, labels, Graph("roadmap", roadmap.header.version, roadmap.lines, edges, ids=roadmap.vids)
    )


def _steps(robots: Indices) -> Indices:
    """Return the indices of rows of one robot that follow each other, (m, 2), in the order of the first."""
    last: dict[int, int] = {}
    steps: list[tuple[int, int]] = []
    for i, robot in enumerate(robots.tolist()):
        if robot in last:
            steps.append((last[robot], i))
        last[robot] = i
    return np.array(sorted(steps), dtype=np.int64).reshape(-1, 2)


def _robot(robot: int) -> str:
    return "all robots, " if robot < 0 else f"robot {robot}, "
