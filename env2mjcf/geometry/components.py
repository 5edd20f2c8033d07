"""The triangles of a mesh that count, which of them are one piece, and which pieces are closed.

A piece is judged by its own edges: what merely touches it neither opens nor closes it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..limits import Work
from .topology import (
    Bools,
    Edges,
    Floats,
    Ints,
    apart,
    area_vectors,
    connected,
    edges,
    face_areas,
    face_components,
    face_volumes,
    facing,
    weld,
)


@dataclass(frozen=True, slots=True, eq=False)
class Cleaned:
    """Triangles without degenerate and duplicate ones, in pieces.

    Attributes:
        faces: (k, 3) indices into the given points, welded ones replaced by the first of their kind.
        source: (k,) rows of the given faces.
        component: (k,) piece of each face, in order of each one's first face.
        closed: (c,) each edge of the piece has an even number of its faces, and the points are not flat.
        edges: Of `faces`; an edge that two pieces share is one of each.
        deciding: Edges of the faces that decide which pieces are closed: `faces`, and perhaps some of no height.
        deciding_component: Pieces of those.
        crowded: Number of edges with more than two faces of all pieces together.
        degenerate: Number of faces of no height.
        duplicates: Number of copies that were dropped.
    """

    faces: Ints
    source: Ints
    component: Ints
    closed: Bools
    edges: Edges
    deciding: Edges
    deciding_component: Ints
    crowded: int
    degenerate: int
    duplicates: int


@dataclass(slots=True, eq=False)
class _Judged:
    """Pieces, (m,) and -1 for none; the faces that stay, and that decide, (m,); and which pieces are closed, (c,)."""

    piece: Ints
    keep: Bools
    counted: Bools
    closed: Bools


def cleaned(points: Floats, faces: Ints, tolerance: float, dimension: int, work: Work | None = None) -> Cleaned:
    """Weld and clean triangles, and tell the pieces apart.

    Faces that hang together by welded edges are one piece, unless more than two meet at some edge. There, pieces that
    are closed by themselves are taken out, as linked first by the file's own indices, then by the wedges of solid that
    faces bound; what they leave is a piece again where it is closed, and open where it is not.

    Args:
        points: (n, 3).
        faces: (m, 3) indices into `points`.
        tolerance: Length that counts as nothing.
        dimension: Of the point set; below 3 nothing is closed.
        work: What may be done; None sets no bound.

    Raises:
        TooMuchWorkError: So many faces meet at edges that it takes more.
    """
    own, faces = faces, weld(points, tolerance)[faces].reshape(-1, 3)
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    high = _heights(points, faces) > tolerance
    rows = np.flatnonzero(whole)
    table = edges(faces[rows])
    cluster = np.full(len(faces), -1)
    cluster[rows] = face_components(table)
    found = _judged(points, faces, high, cluster, tolerance)
    if dimension < 3:
        found.closed[:] = False
    elif (crowded := (table.faces > 2)[table.of_corner].any(axis=1)).any():
        contested = np.isin(cluster, cluster[rows[crowded]]) & whole
        _take_apart(points, own, faces, high, np.flatnonzero(contested), found, tolerance, work or Work())
    one = _without_copies(faces)[0]
    degenerate = int((~whole | (one & ~high)).sum())
    source = np.flatnonzero(found.keep & high)
    first, component = np.unique(found.piece[source], return_inverse=True)
    order = np.argsort(np.unique(component, return_index=True)[1], kind="stable") if len(source) else first
    rank = np.empty(len(first), dtype=np.int64)
    rank[order] = np.arange(len(first))
    counted = np.flatnonzero(found.counted & np.isin(found.piece, first))
    decided = rank[np.searchsorted(first, found.piece[counted])]
    component = rank[component.reshape(-1)]
    split = edges(apart(faces[source], component))
    same = np.array_equal(counted, source)
    return Cleaned(
        faces=faces[source],
        source=source,
        component=component,
        closed=found.closed[first[order]],
        edges=split,
        deciding=split if same else edges(apart(faces[counted], decided)),
        deciding_component=decided,
        crowded=int((edges(faces[counted]).faces > 2).sum()),
        degenerate=degenerate,
        duplicates=int((whole & ~found.keep).sum()),
    )


def _heights(points: Floats, faces: Ints) -> Floats:
    """Return the smallest height of each face, (m,)."""
    corners = points[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    return np.divide(2 * face_areas(points, faces), longest, out=np.zeros(len(faces)), where=longest > 0)


def _without_copies(faces: Ints, piece: Ints | None = None) -> tuple[Bools, Bools]:
    """Return two masks (m,): one copy of each triangle, and one copy of each triangle and winding, of each piece."""
    corner = np.argsort(faces, axis=1)
    turned = (np.diff(corner, axis=1) % 3 == 1).all(axis=1)
    keys = np.sort(faces, axis=1)
    if piece is not None:
        keys = np.column_stack([keys, piece])
    one, both = np.zeros((2, len(faces)), dtype=np.bool_)
    if len(faces):
        one[np.unique(keys, axis=0, return_index=True)[1]] = True
        both[np.unique(np.column_stack([keys, turned]), axis=0, return_index=True)[1]] = True
    return one, both


def _judged(
    points: Floats, faces: Ints, high: Bools, piece: Ints, tolerance: float, signs: tuple[int, ...] = ()
) -> _Judged:
    """Pick the faces that close each piece: which copies count, and whether faces of no height do.

    A wall that two solids share is a pair of opposite copies: both must stay for its edges to be even (their
    volumes cancel). A face of no height may bridge a T-junction: then it counts for the topology, though not as area.

    Args:
        points: (n, 3).
        faces: (m, 3) welded.
        high: (m,) which of them have a height.
        piece: (m,) -1 for faces that are of none.
        tolerance: Length that counts as nothing.
        signs: Those that the volume of a closed piece may have; without any, it may be nothing, if there are no copies.
    """
    some = piece >= 0
    one, both = (mask & some for mask in _without_copies(faces, piece))
    closed = np.zeros(int(piece.max(initial=-1)) + 1, dtype=np.bool_)
    keep, counted = one.copy(), one & high
    volumes = face_volumes(points, faces)
    noise = tolerance * face_areas(points, faces)
    for mask in (one, both) if (one != both).any() else (one,):
        for chosen in (mask & high, mask) if (mask & ~high).any() else (mask,):
            rows = np.flatnonzero(chosen)
            rows = rows[~closed[piece[rows]]]
            if not len(rows):
                continue
            label = piece[rows]
            table = edges(apart(faces[rows], label))
            even = np.zeros(len(closed), dtype=np.bool_)
            even[label] = True
            even[label[(table.faces % 2 == 1)[table.of_corner].any(axis=1)]] = False
            if mask is both or signs:
                # A sheet with two sides encloses nothing.
                volume, nothing = (np.bincount(label, x[rows], minlength=len(closed)) for x in (volumes, noise))
                even &= np.logical_or.reduce([sign * volume > nothing for sign in signs or (1, -1)])
            changed = some & even[piece]
            keep[changed], counted[changed] = mask[changed], chosen[changed]
            closed |= even
    return _Judged(piece, keep, counted, closed)


def _take_apart(
    points: Floats, own: Ints, faces: Ints, high: Bools, left: Ints, found: _Judged, tolerance: float, work: Work
) -> None:
    """Take closed pieces out of what hangs together, and change `found`.

    Args:
        points: (n, 3).
        own: (m, 3) faces by the file's own indices.
        faces: (m, 3) welded faces.
        high: (m,) which of them have a height.
        left: Rows of the faces in question.
        found: How they were judged together.
        tolerance: Length that counts as nothing.
        work: What may be done.
    """
    cluster, before = found.piece.copy(), _Judged(found.piece, found.keep.copy(), found.counted.copy(), found.closed)
    closed = [found.closed]
    made = len(found.closed)
    taken: list[Ints] = []
    for links, signs in _LINKS:
        if not len(left):
            break
        label = connected(len(left), *links(points, own[left], faces[left], work))
        judged = _judged(points, faces[left], high[left], label, tolerance, signs)
        found.piece[left], found.keep[left], found.counted[left] = label + made, judged.keep, judged.counted
        closed.append(judged.closed)
        made += len(judged.closed)
        done = judged.closed[label]
        taken.append(left[done])
        left = left[~done]
    found.closed = np.concatenate(closed)
    # Nothing that is closed as a whole is opened.
    back = np.isin(cluster, cluster[left][before.closed[cluster[left]]]) & (cluster >= 0)
    found.piece[back], found.keep[back], found.counted[back] = cluster[back], before.keep[back], before.counted[back]
    rows = np.concatenate(taken) if taken else left
    rows = rows[~back[rows]]
    twice = np.isin(found.piece, _repeated(faces[rows], found.piece[rows]))
    found.keep[twice] = found.counted[twice] = False


def _by_file(points: Floats, own: Ints, faces: Ints, work: Work) -> tuple[Ints, Ints]:
    """Link faces at edges that exactly two of them share by the file's indices; at all others, by welded ones."""
    first, a, b = _of_copies(own)
    by_index = edges(own[first])
    here, there, edge = by_index.neighbours()
    two = by_index.faces[edge] == 2
    lone = np.flatnonzero((by_index.faces != 2)[by_index.of_corner].ravel())
    edge = edges(faces[first]).of_corner.ravel()[lone]
    order = np.argsort(edge, kind="stable")
    edge, lone = edge[order], lone[order]
    pair = np.flatnonzero(np.bincount(edge)[edge] == 2)[::2]
    mates = lone[pair], lone[np.minimum(pair + 1, len(lone) - 1)]
    return (
        np.concatenate([a, first[here[two] // 3], first[mates[0] // 3]]),
        np.concatenate([b, first[there[two] // 3], first[mates[1] // 3]]),
    )


def _by_wedges(points: Floats, own: Ints, faces: Ints, work: Work) -> tuple[Ints, Ints]:
    """Link faces that bound the same wedge of solid at a welded edge, or alone share it."""
    first, a, b = _of_copies(faces)
    faces = faces[first]
    table = edges(faces)
    work.spend(int((table.faces**2).sum()))
    normals = area_vectors(points[faces])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    here, there, _, _ = facing(points, faces, table, normals)
    partner = np.full(faces.size, -1)
    partner[here] = there
    mutual = partner[there] == here
    x, y, edge = table.neighbours()
    two = table.faces[edge] == 2
    return (
        np.concatenate([a, first[here[mutual] // 3], first[x[two] // 3]]),
        np.concatenate([b, first[there[mutual] // 3], first[y[two] // 3]]),
    )


def _by_wedges_outside(points: Floats, own: Ints, faces: Ints, work: Work) -> tuple[Ints, Ints]:
    """The same, for pieces that are wound inside out."""
    return _by_wedges(points, own, faces[:, ::-1], work)


def _by_edges(points: Floats, own: Ints, faces: Ints, work: Work) -> tuple[Ints, Ints]:
    """Link faces that share a welded edge."""
    here, there, _ = edges(faces).neighbours()
    return here // 3, there // 3


_LINKS = (
    (_by_file, (1, -1)),
    # Taken for the outside of solids that touch, it would leave their walls behind, which bound nothing.
    (_by_wedges, (1,)),
    (_by_wedges_outside, (-1,)),
    (_by_edges, (1, -1)),
)
"""How faces are linked, one way after the other, and the signs of the volumes of what is closed then."""


def _of_copies(faces: Ints) -> tuple[Ints, Ints, Ints]:
    """Return the first rows of triangles of equal corners and winding, and links from all to those."""
    least = np.argmin(faces, axis=1)
    turned = np.take_along_axis(faces, (least[:, None] + np.arange(3)) % 3, axis=1)
    _, first, of = np.unique(turned, axis=0, return_index=True, return_inverse=True)
    return np.sort(first), np.arange(len(faces)), first[of.reshape(-1)]


def _repeated(faces: Ints, piece: Ints) -> list[int]:
    """Return the pieces that have the same triangles as an earlier one."""
    if not len(faces):
        return []
    _, triangle, count = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True)
    triangle = triangle.reshape(-1)
    single = np.unique(piece[count[triangle] == 1])
    doubtful = np.flatnonzero(~np.isin(piece, single))
    order = doubtful[np.argsort(piece[doubtful], kind="stable")]
    groups = np.split(triangle[order], np.flatnonzero(np.diff(piece[order])) + 1) if len(order) else []
    seen: set[tuple[int, ...]] = set()
    out: list[int] = []
    for label, own in zip(np.unique(piece[order]).tolist(), groups, strict=True):
        key = tuple(np.unique(own).tolist())
        if key in seen:
            out.append(label)
        seen.add(key)
    return out
