"""Configurations out of files of every kind, numbers or the scene's own tasks, with the edges between them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..diagnostics import DiagnosticLog
from ..errors import robots_named
from ..formats.path import is_path
from ..formats.roadmap import is_roadmap
from ..formats.rows import read_query
from ..formats.source import Source, read_source
from ..limits import Limits
from ..options import PathArgument
from ..simulation.edge_verdicts import Edges
from ..simulation.scene import Query, Scene, queries_of
from ..transforms import Array
from .paths import path_record
from .query_files import dofs_of, standing
from .records import Configurations, Graph, Poses, expected, joined, of_array, of_text, row_of
from .roadmaps import roadmap_record, ways_between

Indices = NDArray[np.int64]

# Files of plain numbers; all others are in units of their own.
_PLAIN = (".npy", ".csv", ".txt")


def read_configurations(
    path: PathArgument, scene: Scene, *, file_units: bool = False, limits: Limits | None = None, strict: bool = False
) -> Array:
    """Read the configurations that a file of any kind holds.

    A NumPy file (.npy) or a text of rows (.csv, .txt) holds metres and radians: a row of all robots, or of one behind
    its index, the others at the start of their query, else at home. A path (.path), the nodes of a roadmap (.map), or
    else a query, is in the units of its own format; they are known by their text, whatever their names are.

    Args:
        path: The file.
        scene: Whose configurations they are.
        file_units: The numbers of a NumPy file or a text of rows are the env file's own, as in a query.
        limits: Bounds on hostile input.
        strict: Whether warnings are errors.

    Returns:
        (n, dim) in metres and radians, in the order of the file; of a query, robot by robot.

    Raises:
        FormatError: The file cannot be read, a row fits no robot, it holds none, or nothing in the scene can move.
    """
    name, log = os.fsdecode(path), DiagnosticLog(strict)
    radians = not file_units and Path(name).suffix.lower() in _PLAIN
    return of_file(scene, name, radians, limits or Limits(), log).q


def of_scene(scene: Scene) -> Configurations:
    """Return the scene's own tasks, else home."""
    if not scene.queries:
        return Configurations(scene.space.home[None], ("home",))
    return joined(scene, list(_task_rows(scene, scene.queries)))


def of_numbers(scene: Scene, words: Sequence[str], radians: bool) -> Configurations:
    """Return the one configuration that stands on the command line.

    Raises:
        ValueError: A word is not a number, or there are too few or too many.
    """
    numbers: list[float] = []
    for word in words:
        try:
            numbers.append(float(word))
        except ValueError:
            raise ValueError(f"{word!r} is not a number; expected numbers, or one file") from None
    q = row_of(scene, numbers, radians, standing(scene))
    if q is None:
        raise ValueError(f"{len(numbers)} numbers; expected {expected(scene)}")
    return Configurations(q[None], ("configuration",))


def of_file(scene: Scene, path: str, radians: bool, limits: Limits, log: DiagnosticLog) -> Configurations:
    """Read a NumPy file (.npy), a text file of rows (.csv, .txt), a path, a roadmap, or else a query.

    Paths (.path) and roadmaps (.map) are known by their text, too, whatever their names are.

    Raises:
        FormatError: The file cannot be read, a row fits no robot, or it holds no row.
        ValueError: A path or roadmap is to be in radians.
    """
    refuse_without_freedom(scene, scene.environment.path, log)
    found = _of_file(scene, path, radians, limits, log)
    if not found.labels:
        hint = "has what wrote it found nothing?"
        log.fail("CFG503", path, f"{path} holds no configuration; expected one at least", hint=hint)
    return found


def refuse_without_freedom(scene: Scene, path: str, log: DiagnosticLog) -> None:
    """Refuse a scene in which nothing can move, with a FormatError."""
    if not scene.space.dim:
        what = "has no robot" if not scene.environment.robots else "has no robot that moves"
        hint = "is a robot file missing? Give it with --robots FILE"
        log.fail("CFG543", path, f"{path} {what}: there are no configurations of it", hint=hint)


def _of_file(scene: Scene, path: str, radians: bool, limits: Limits, log: DiagnosticLog) -> Configurations:
    extension = Path(path).suffix.lower()
    if extension == ".npy":
        return of_array(scene, path, radians, limits, log)
    source = read_source(path, log, limits)
    if extension in (".csv", ".txt"):
        return of_text(scene, source, radians, log)
    reader = _graph_reader(source, extension)
    if reader is not None:
        if radians:
            raise ValueError("--radians is for plain numbers; paths and roadmaps are in units of their own")
        return reader(scene, source, log)
    tasks = read_query(source, dofs_of(scene), log)
    queries = queries_of(scene.space, tasks, standing(scene), radians=radians)
    return joined(scene, list(_task_rows(scene, queries)))


def _graph_reader(source: Source, extension: str) -> Callable[[Scene, Source, DiagnosticLog], Configurations] | None:
    # What a file says counts for more than its name.
    if is_path(source):
        return of_path
    if is_roadmap(source):
        return of_roadmap
    return {".path": of_path, ".map": of_roadmap}.get(extension)


def _task_rows(scene: Scene, queries: Sequence[Query]) -> Iterator[tuple[str, Array]]:
    several = len(scene.space.robot_slices) > 1
    for query in queries:
        task = f"{query.label}, " if query.label else ""
        robot = f"{robots_named(query.robots)}, " if several else ""
        for n, row in enumerate(query.q, 1):
            yield f"{task}{robot}configuration {n} of {len(query.q)}", row


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
