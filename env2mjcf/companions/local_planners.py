"""Ways between the nodes of a roadmap, as the local planners made them that its header names."""

from __future__ import annotations

import re

import numpy as np

from ..diagnostics import DiagnosticLog
from ..formats.lexer import parse_number
from ..kinematics.transforms import Array
from ..simulation.scene import Scene
from .roadmaps import Roadmap

_STRAIGHT = re.compile(r"straight\w*", re.IGNORECASE)
_ROTATES = re.compile(r"rotate_?at_?s", re.IGNORECASE)


def ways_between(scene: Scene, roadmap: Roadmap, log: DiagnosticLog) -> tuple[Array, ...]:
    """Return the configurations on each edge's way, (k, dim), both ends left out.

    Those of the file, and the corners of `rotate_at_s`, which moves the base without turning anything for a fraction s
    of the way, turns there, and moves on. What other local planners did is not known: their edges are taken as
    straight.

    Args:
        scene: Whose roadmap it is.
        roadmap: The roadmap.
        log: Where findings go.
    """
    names = roadmap.header.local_planners
    between = list(roadmap.intermediates)
    unknown: dict[str, int] = {}
    for edge, planner in enumerate(roadmap.planners.tolist()):
        # Planners are counted from 1.
        name = names[planner - 1] if 0 < planner <= len(names) else ""
        if planner < 0 or len(between[edge]) or _STRAIGHT.match(name):
            continue
        fraction = _turning_point(name)
        if fraction is None:
            unknown[name or str(planner)] = unknown.get(name or str(planner), 0) + 1
        else:
            between[edge] = _rotating_at(scene, roadmap, edge, fraction)
    for name, count in unknown.items():
        message = (
            f"{count} edge{'' if count == 1 else 's'} made by the local planner '{name}', which may have left the "
            "straight way; checked as straight"
        )
        log.info("CFG534", roadmap.file, message)
    return tuple(between)


def _turning_point(name: str) -> float | None:
    """Return s of `rotate_at_s`; None for other planners, and where several are named."""
    if not _ROTATES.match(name):
        return None
    numbers = [n for n in map(parse_number, name.split()) if n is not None]
    return numbers[0] if len(numbers) == 1 else None


def _rotating_at(scene: Scene, roadmap: Roadmap, edge: int, fraction: float) -> Array:
    i, j = roadmap.edges[edge].tolist()
    robot = int(roadmap.robots[i])
    dofs = scene.compiled.assembly.robots[robot].kinematics.dofs
    columns = np.arange(scene.space.dim)[scene.space.robot_slices[robot]]
    moves = columns[[d.connection is None and d.kind.is_length for d in dofs]]
    corners = roadmap.q[[i, j]].copy()
    # The file lists the edge from both ends, and s counts from the one that it was made from: one half is the same.
    corners[:, moves] = (1 - fraction) * roadmap.q[i, moves] + fraction * roadmap.q[j, moves]
    return corners
