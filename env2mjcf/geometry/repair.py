"""Repairs surfaces without moving them: cuts edges in whose middle others end, and unfolds flat parts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..diagnostics import DiagnosticLog
from ..errors import Span
from ..limits import COSTLY, Work
from .analysis import Analysis, analyse, mesh_diagnostics
from .folds import unfolded
from .mesh import Mesh
from .topology import Floats, Ints, edges
from .triangle_search import Jobs, Search
from .triangle_tree import forest

_PASSES = 10


@dataclass(frozen=True, slots=True, eq=False)
class Repaired:
    """A mesh as the later stages take it.

    Welding, dropping of copies and turning of faces are part of the analysis; cuts and unfolding are added here.

    Attributes:
        analysis: Of the repaired surface; `source` still leads to the faces of the file, from an unfolded part to one
            near by in that part.
        cut_faces: Faces of the file that were cut, because vertices lie on their edges (T-junctions).
        left_open: Edges of the file's surface that border an odd number of faces, before cutting.
        folded_faces: Faces in flat parts that were folded over themselves and are triangulated anew.
        sheets: Of those the ones that reach beyond the solid, and stay as sheets with two sides.
    """

    analysis: Analysis
    cut_faces: int = 0
    left_open: int = 0
    folded_faces: int = 0
    sheets: int = 0


def repaired(mesh: Mesh, work: Work | None = None, concave: float = 0.0) -> Repaired:
    """Analyse a mesh; where open edges run along each other with different vertices, cut the faces there.

    Then unfold what is folded, if the surface is that of a solid. The arguments are those of `analyse`.

    Raises:
        TooMuchWorkError: It takes more than `work` has left.
    """
    work = work or Work()
    return _without_folds(mesh, _without_t_junctions(mesh, work, concave), work, concave)


def _without_t_junctions(mesh: Mesh, work: Work, concave: float) -> Repaired:
    before = analyse(mesh, work, concave)
    # What is closed by itself stays as it is, whatever touches it.
    loose = ~before.closed_components[before.component]
    source, shut = np.flatnonzero(loose), np.flatnonzero(~loose)
    faces = before.faces[source]
    open_before = _open_edges(faces)
    if before.dimension < 3 or not open_before:
        return Repaired(before)
    for _ in range(_PASSES):
        faces, source, found = _cut(before.vertices, faces, source, before.tolerance, work)
        if not found:
            break
    if _open_edges(faces) >= open_before:
        return Repaired(before)
    faces, source = np.concatenate([before.faces[shut], faces]), np.concatenate([shut, source])
    after = _again(mesh, before, faces, source, work, concave)
    return Repaired(after, int((np.bincount(source) > 1).sum()), open_before)


def _without_folds(mesh: Mesh, result: Repaired, work: Work, concave: float) -> Repaired:
    before = result.analysis
    # A convex mesh collides as its hull, whatever its faces are.
    new = unfolded(before) if before.solids.any() and not before.convex else None
    if new is None:
        return result
    # What is told about the file's winding and edges is known already: the new faces agree, and sheets crowd edges.
    after = replace(
        _again(mesh, before, new.faces, new.source, work, concave),
        consistent=before.consistent,
        inverted=before.inverted,
        signed_volume=before.signed_volume,
        crowded_edges=before.crowded_edges,
    )
    noise = before.tolerance * before.area
    open_faces = [int((~a.solids[a.component]).sum()) for a in (before, after)]
    same = open_faces[0] == open_faces[1] and len(after.faces) == len(new.faces)
    if not same or abs(after.volume - before.volume) > noise:
        return result
    return replace(result, analysis=after, folded_faces=new.rebuilt, sheets=new.sheets)


def _again(mesh: Mesh, before: Analysis, faces: Ints, source: Ints, work: Work, concave: float) -> Analysis:
    """Analyse faces over the vertices of an earlier analysis, made of its faces `source`; counts add up.

    Each closed piece gets vertices of its own, so that it is told again from what touches it.
    """
    shut = before.closed_components[before.component]
    group = np.where(shut, before.component + 1, 0)[source]
    places, faces = np.unique(faces * (before.components + 1) + group[:, None], return_inverse=True)
    vertex = places // (before.components + 1)
    again = np.concatenate([np.zeros(1, dtype=np.bool_), vertex[1:] == vertex[:-1]])[: len(vertex)]
    number = np.where(again, len(before.vertices) + np.cumsum(again) - 1, vertex)
    vertices = np.concatenate([before.vertices, before.vertices[vertex[again]]])
    separate = Mesh.from_arrays(mesh.name, vertices, number[faces.reshape(-1, 3)], mesh.path)
    after = analyse(separate, work, concave)
    return replace(
        after,
        source=before.source[source[after.source]],
        degenerate_faces=before.degenerate_faces + after.degenerate_faces,
        duplicate_faces=before.duplicate_faces + after.duplicate_faces,
        unused_vertices=before.unused_vertices,
    )


def repair_diagnostics(
    mesh: Mesh, result: Repaired, log: DiagnosticLog, subject: str = "", span: Span | None = None
) -> None:
    """Record what is unusual about a mesh, and what was done about it.

    Raises:
        GeometryError: See `mesh_diagnostics`.
    """
    if result.cut_faces:
        outcome = "the surface is closed now" if result.analysis.closed else "other edges are open still"
        message = (
            f"{result.left_open} open edges, because vertices lie in the middle of other edges (T-junctions); "
            f"{result.cut_faces} faces were cut there, and {outcome}"
        )
        log.warn("GEO242", subject or mesh.name, message, span=span)
    if result.folded_faces:
        sheets = f"; {result.sheets} of them reach beyond the solid and stay as sheets" if result.sheets else ""
        message = (
            f"flat parts of {result.folded_faces} faces in all are folded over themselves: "
            f"they were triangulated anew{sheets}"
        )
        log.warn("GEO244", subject or mesh.name, message, span=span)
    mesh_diagnostics(mesh, result.analysis, log, subject, span)


def _open_edges(faces: Ints) -> int:
    return int((edges(faces).faces % 2).sum())


def _cut(vertices: Floats, faces: Ints, source: Ints, tolerance: float, work: Work) -> tuple[Ints, Ints, bool]:
    """Cut each face that has vertices on one of its open edges into a fan; one edge of a face at a time."""
    table = edges(faces)
    lone = np.flatnonzero((table.faces == 1)[table.of_corner].ravel())
    start, end = faces[lone // 3, lone % 3], faces[lone // 3, (lone % 3 + 1) % 3]
    candidates = np.unique(table.ends[table.faces % 2 == 1])
    edge, vertex = _between(vertices, start, end, candidates, tolerance, work)
    work.spend(COSTLY * len(edge))
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


def _between(
    vertices: Floats, start: Ints, end: Ints, candidates: Ints, tolerance: float, work: Work
) -> tuple[Ints, Ints]:
    """Return (edge, vertex) for all vertices within edges, ordered along each edge."""
    points = vertices[candidates]
    e, v = _near(np.stack([vertices[start], vertices[end], vertices[end]], axis=1), points, tolerance, work)
    origin = vertices[start[e]]
    along = vertices[end[e]] - origin
    length = np.linalg.norm(along, axis=1)
    along /= length[:, None]
    offset = points[v] - origin
    at = np.einsum("ij,ij->i", offset, along)
    beside = np.linalg.norm(offset - at[:, None] * along, axis=1)
    found = (at > tolerance) & (at < length - tolerance) & (beside <= tolerance)
    order = np.flatnonzero(found)[np.lexsort((v[found], at[found], e[found]))]
    return e[order], candidates[v[order]]


def _near(segments: Floats, points: Floats, tolerance: float, work: Work) -> tuple[Ints, Ints]:
    """Return (segment, point) for all that may be within the tolerance: both are triangles without area."""
    if not len(segments):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    trees = forest([segments, np.repeat(points[:, None], 3, axis=1)])
    first = np.zeros(1, dtype=np.int64)
    jobs = Jobs(first, first + 1, np.eye(3)[None], np.zeros((1, 3)), first)
    _, segment, point = Search(trees, jobs, np.array([np.inf]), tolerance).within(tolerance, work).T
    return segment, point - len(segments)
