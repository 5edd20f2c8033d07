"""Closes what only seems open, without moving the surface: edges that end in the middle of other edges are cut."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..errors import DiagnosticLog, GeometryError, Span
from .analysis import Analysis, analyse, mesh_diagnostics
from .mesh import Mesh
from .topology import Floats, Ints, edges

_BLOCK = 2_000_000  # distances held in memory at once
_PASSES = 10


@dataclass(frozen=True, slots=True, eq=False)
class Repaired:
    """A mesh as the later stages take it.

    Welding, dropping of copies and turning of faces are part of the analysis; only cuts are added here.

    Attributes:
        analysis: Of the repaired surface; `source` still leads to the faces of the file.
        cut_faces: Faces of the file that were cut, because vertices lie on their edges (T-junctions).
        left_open: Edges of the file's surface that border an odd number of faces, before cutting.
    """

    analysis: Analysis
    cut_faces: int = 0
    left_open: int = 0


def repaired(mesh: Mesh) -> Repaired:
    """Analyse a mesh; where open edges run along each other with different vertices, cut the faces there."""
    before = analyse(mesh)
    open_before = _open_edges(before.faces)
    if before.dimension < 3 or not open_before:
        return Repaired(before)
    faces, source = before.faces, np.arange(len(before.faces))
    for _ in range(_PASSES):
        faces, source, found = _cut(before.vertices, faces, source, before.tolerance)
        if not found:
            break
    if _open_edges(faces) >= open_before:
        return Repaired(before)
    after = analyse(Mesh.from_arrays(mesh.name, before.vertices, faces, mesh.path))
    merged = replace(
        after,
        source=before.source[source[after.source]],
        degenerate_faces=before.degenerate_faces + after.degenerate_faces,
        duplicate_faces=before.duplicate_faces + after.duplicate_faces,
        unused_vertices=before.unused_vertices,
    )
    return Repaired(merged, int((np.bincount(source) > 1).sum()), open_before)


def repair_diagnostics(
    mesh: Mesh, result: Repaired, log: DiagnosticLog, subject: str = "", span: Span | None = None
) -> None:
    """Record what is unusual about a mesh, and what was done about it.

    Raises:
        GeometryError: See `mesh_diagnostics`.
    """
    if result.cut_faces:
        outcome = "the surface is closed now" if result.analysis.closed else "other edges are open still"
        log.warn(
            GeometryError, "GEO242", subject or mesh.name,
            f"{result.left_open} open edges, because vertices lie in the middle of other edges (T-junctions); "
            f"{result.cut_faces} faces were cut there, and {outcome}",
            span=span,
        )  # fmt: skip
    mesh_diagnostics(mesh, result.analysis, log, subject, span)


def _open_edges(faces: Ints) -> int:
    return int((edges(faces).faces % 2).sum())


def _cut(vertices: Floats, faces: Ints, source: Ints, tolerance: float) -> tuple[Ints, Ints, bool]:
    """Cut each face that has vertices on one of its open edges into a fan; one edge of a face at a time."""
    table = edges(faces)
    lone = np.flatnonzero((table.faces == 1)[table.of_corner].ravel())
    start, end = faces[lone // 3, lone % 3], faces[lone // 3, (lone % 3 + 1) % 3]
    candidates = np.unique(table.ends[table.faces % 2 == 1])
    edge, vertex = _between(vertices, start, end, candidates, tolerance)
    if len(edge) == 0:
        return faces, source, False
    first = np.full(len(faces), faces.size)
    np.minimum.at(first, lone[edge] // 3, lone[edge])
    chosen = np.isin(lone[edge], first)
    cut: list[list[int]] = []
    cut_source: list[int] = []
    inserted: dict[int, list[int]] = {}
    for corner, v in zip(lone[edge[chosen]].tolist(), vertex[chosen].tolist(), strict=True):
        inserted.setdefault(corner, []).append(v)
    for corner, middle in inserted.items():
        face, k = divmod(corner, 3)
        a, b, c = np.roll(faces[face], -k).tolist()
        chain = [a, *middle, b]
        cut += [[u, v, c] for u, v in pairwise(chain)]
        cut_source += [int(source[face])] * (len(chain) - 1)
    whole = np.ones(len(faces), dtype=np.bool_)
    whole[[corner // 3 for corner in inserted]] = False
    return np.vstack([faces[whole], cut]), np.concatenate([source[whole], cut_source]), True


def _between(vertices: Floats, start: Ints, end: Ints, candidates: Ints, tolerance: float) -> tuple[Ints, Ints]:
    """Return (edge, vertex) for all vertices within edges, ordered along each edge."""
    points = vertices[candidates]
    found: list[tuple[Ints, Ints, Floats]] = []
    step = max(1, _BLOCK // max(1, len(candidates)))
    for i in range(0, max(1, len(start)), step):
        origin = vertices[start[i : i + step]]
        along = vertices[end[i : i + step]] - origin
        length = np.linalg.norm(along, axis=1, keepdims=True)
        along /= length
        offset = points[None] - origin[:, None]
        at = np.einsum("evj,ej->ev", offset, along)
        inside = (at > tolerance) & (at < length - tolerance)
        e, v = np.nonzero(inside)
        beside = offset[e, v] - at[e, v, None] * along[e]
        near = np.linalg.norm(beside, axis=1) <= tolerance
        e, v = e[near], v[near]
        found.append((e + i, candidates[v], at[e, v]))
    edge, vertex, at = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.lexsort((at, edge))
    return edge[order], vertex[order]
