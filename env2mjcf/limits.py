"""Bounds on hostile input, and on the work that one mesh may take: its parts may lie so that each meets every other."""

from __future__ import annotations

import math
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass

from .diagnostics import DiagnosticLog
from .errors import Span


@dataclass(frozen=True, slots=True)
class Limits:
    """Bounds on hostile input. A file that passes one is refused with a diagnostic that names it.

    Attributes:
        file_bytes: Size of any one input file.
        bodies: Bodies in a scene. MuJoCo takes a time that grows with their square: about 20 s for 20,000.
        connections: Connections in a scene.
        mesh_elements: Vertices, and polygon corners, of one mesh.
        name_length: Characters in a file name or label.
        polygon_corners: Corners of one polygon of a mesh.
        polygon_work: Points looked at while polygons of one mesh are cut into triangles: a polygon that is not
            convex takes up to the square of its corners, or more.
        scene_elements: Triangles of all bodies of a scene, those of a mesh that several bodies have counted each time.
        scene_cells: Convex collision pieces of all bodies of a scene, counted in the same way: about 25 kB of memory
            each while MuJoCo compiles it, more where they have many corners.
        mesh_work: Comparisons of parts of one mesh while it is repaired and cut into convex pieces: about half a
            microsecond each.
        pairs: Pairs of bodies of a scene that may touch.
        rows: Configurations of one query, path or text of rows; nodes of one roadmap.
        nesting: Elements of an XML file within each other; those that are read need seven.
        elements: Elements of an XML file.
    """

    file_bytes: int = 512 * 1024 * 1024
    bodies: int = 20_000
    connections: int = 100_000
    mesh_elements: int = 50_000_000
    name_length: int = 4096
    polygon_corners: int = 10_000
    polygon_work: int = 20_000_000
    scene_elements: int = 500_000_000
    scene_cells: int = 200_000
    mesh_work: int = 500_000_000
    pairs: int = 2_000_000
    rows: int = 5_000_000
    nesting: int = 100
    elements: int = 1_000_000

    @staticmethod
    def hint(name: str) -> str:
        """Return what to do where an input that is trusted passes a limit."""
        return f"raise limits=Limits({name}=...), on the command line --limits.{name.replace('_', '-')}"


LARGEST = 1e30
"""Largest coordinate, in file units or metres, that is computed with: volumes and inertias of what is larger overflow,
MuJoCo's own numbers end at 3e38, and planners do not end in a wider space."""

COSTLY = 10
"""Steps that a comparison counts for which clips polygons."""


class TooMuchWorkError(Exception):
    """More steps were asked for than are allowed; `part` is the index of the part of the mesh, where it is one."""

    def __init__(self, part: int = 0) -> None:
        super().__init__(part)
        self.part = part


class Work:
    """Counts steps, each a comparison of two parts of a mesh: about half a microsecond.

    Args:
        most: How many are allowed.
    """

    def __init__(self, most: float = math.inf) -> None:
        self.most = most
        self.done = 0

    def spend(self, steps: int, part: int = 0) -> None:
        """Count steps that are about to be taken, for a part of the mesh where they are for one.

        Raises:
            TooMuchWorkError: They are more than are left.
        """
        self.done += steps
        if self.done > self.most:
            raise TooMuchWorkError(part)


@contextmanager
def bounded(limits: Limits, log: DiagnosticLog, subject: str, span: Span | None) -> Generator[None]:
    """Refuse a mesh, named at `span`, that takes more steps to work on than `limits.mesh_work`.

    Raises:
        GeometryError: It does.
    """
    try:
        yield
    except TooMuchWorkError:
        message = (
            f"{subject} takes too long to repair and cut into convex pieces: more than {limits.mesh_work} of its "
            "parts would have to be compared"
        )
        hint = f"remove parts that overlap, choose collision='hull' (--collision hull), or {Limits.hint('mesh_work')}"
        log.fail("GEO273", subject, message, hint=hint, span=span)
