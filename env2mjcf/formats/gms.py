"""GMS `.dat` meshes of the oldest planner (env-format section 10.1, last line)."""

from __future__ import annotations

import numpy as np

from ..errors import DiagnosticLog
from ..options import Limits
from .mesh_text import MeshArrays, NumberFile, as_bytes, faces_of


def read_gms(text: str | bytes, path: str, log: DiagnosticLog, limits: Limits) -> MeshArrays:
    """Read a `.dat` file: vertices, then polygons as a count and that many indices from 0.

    Raises:
        GeometryError: The file is cut off, has numbers left over or an index out of range.
    """
    file = NumberFile.of(as_bytes(text), path, log, limits)
    n_vertices = file.count(0, "the number of vertices")
    vertices = file.points(1, n_vertices)
    first = 2 + 3 * n_vertices
    n_polygons = file.count(first - 1, "the number of polygons")
    corners: list[int] = []
    starts: list[int] = []
    values = file.integers(first, len(file.numbers), lambda _: "a corner").tolist()
    at = 0
    for k in range(n_polygons):
        what = f"polygon {k + 1} of {n_polygons}"
        file.need(first + at + 1, lambda _, w=what: f"the number of corners of {w}")
        n = values[at]
        if n < 1:
            file.fail("GEO216", first + at, f"{what} has {n} corners; expected a positive number")
        file.need(first + at + 1 + n, lambda _, w=what: f"a corner of {w}")
        starts.append(first + at)
        for j in range(at + 1, at + 1 + n):
            if not 0 <= values[j] < n_vertices:
                message = f"a corner of {what} is vertex {values[j]}; expected 0 to {n_vertices - 1}"
                file.fail("GEO214", first + j, message)
        corners += values[at + 1 : at + 1 + n]
        at += 1 + n
    file.nothing_after(first + at, f"the last of {n_polygons} polygons")
    counts = np.diff(np.array([*starts, first + at], dtype=np.int64)) - 1
    indices = np.array(corners, dtype=np.int64)
    return vertices, faces_of(vertices, indices, counts, path, log, limits=limits, place=lambda k: file.span(starts[k]))
