"""How the triangles of a mesh hang together: welded points, shared edges, components, and the triangles that count."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

RELATIVE_TOLERANCE = 1e-9
"""What counts as nothing, in units of a mesh's diagonal: far below float32, far above the rounding of coordinates."""


@dataclass(frozen=True, slots=True, eq=False)
class Edges:
    """The undirected edges of a triangle list.

    Attributes:
        ends: (e, 2) vertex indices, the smaller one first.
        of_corner: (m, 3) edge that leads from each corner of a face to the next one.
        forward: (m, 3) whether that corner walks its edge from `ends[0]` to `ends[1]`.
        faces: (e,) number of faces at each edge.
        balance: (e,) how many more faces walk it forward than backward; 0 where the winding agrees.
    """

    ends: Ints
    of_corner: Ints
    forward: Bools
    faces: Ints
    balance: Ints

    def neighbours(self) -> tuple[Ints, Ints, Ints]:
        """Return the corners of faces that share an edge, one pair after the other, and that edge, (p,) each."""
        corner = np.argsort(self.of_corner.ravel(), kind="stable")
        edge = self.of_corner.ravel()[corner]
        pair = np.flatnonzero(edge[1:] == edge[:-1])
        return corner[pair], corner[pair + 1], edge[pair]

    def turned(self, chosen: Bools) -> Edges:
        """Return the edges after some faces, a mask (m,), are turned round to `faces[:, ::-1]`."""
        of_corner = np.where(chosen[:, None], self.of_corner[:, (1, 0, 2)], self.of_corner)
        forward = np.where(chosen[:, None], ~self.forward[:, (1, 0, 2)], self.forward)
        return Edges(self.ends, of_corner, forward, self.faces, _balance(of_corner, forward, self.faces))


def _balance(of_corner: Ints, forward: Bools, count: Ints) -> Ints:
    return 2 * np.bincount(of_corner[forward], minlength=len(count)).astype(np.int64) - count


def edges(faces: Ints) -> Edges:
    """Tabulate the edges of `faces`, (m, 3) vertex indices."""
    start, end = faces, np.roll(faces, -1, axis=1)
    forward = start < end
    low, high = np.minimum(start, end), np.maximum(start, end)
    span = int(high.max()) + 1 if len(faces) else 1
    keys, of_corner = np.unique(low * span + high, return_inverse=True)
    of_corner = of_corner.reshape(-1, 3).astype(np.int64)
    count = np.bincount(of_corner.ravel(), minlength=len(keys)).astype(np.int64)
    ends = np.stack(np.divmod(keys, span), axis=1)
    return Edges(ends, of_corner, forward, count, _balance(of_corner, forward, count))


def face_components(table: Edges) -> Ints:
    """Label faces that are linked by shared edges, (m,) from 0 in order of each component's first face."""
    here, there, _ = table.neighbours()
    return connected(len(table.of_corner), here // 3, there // 3)


def by_component(faces: Ints, component: Ints) -> list[Ints]:
    """Return the faces of each component."""
    order = np.argsort(component, kind="stable")
    return np.split(faces[order], np.cumsum(np.bincount(component))[:-1])


def connected(count: int, a: Ints, b: Ints) -> Ints:
    """Label the connected components of the graph with `count` nodes and links `a[i]`-`b[i]`.

    Returns:
        (count,) labels from 0, in order of each component's first node.
    """
    labels = np.arange(count, dtype=np.int64)
    while len(a):
        # Hook the larger root of every link onto the smaller one, then let all nodes point at their roots.
        root_a, root_b = labels[a], labels[b]
        apart = root_a != root_b
        if not apart.any():
            break
        a, b, root_a, root_b = a[apart], b[apart], root_a[apart], root_b[apart]
        np.minimum.at(labels, np.maximum(root_a, root_b), np.minimum(root_a, root_b))
        while not np.array_equal(jumped := labels[labels], labels):
            labels = jumped
    return np.unique(labels, return_inverse=True)[1].reshape(-1).astype(np.int64)


def weld(points: Floats, tolerance: float) -> Ints:
    """Return for each point the lowest index of a point that it coincides with, (n,).

    Points within `tolerance` on every axis coincide, and so do chains of such points.
    """
    count = len(points)
    if count == 0:
        return np.zeros(0, dtype=np.int64)
    exact, label = np.unique(points + 0.0, axis=0, return_inverse=True)
    label = label.reshape(-1)
    if tolerance > 0:
        label = _near(exact, tolerance)[label]
    lowest = np.full(int(label.max()) + 1, count, dtype=np.int64)
    np.minimum.at(lowest, label, np.arange(count))
    return lowest[label]


def _near(points: Floats, tolerance: float) -> Ints:
    """Label clusters of near points.

    A gap below the tolerance holds at most one multiple of it, so of two grids with cells of twice the tolerance,
    one shifted by half a cell, at least one keeps the two points together on that axis; hence eight grids in space.
    """
    scaled = (points - points.min(axis=0)) / tolerance
    links: list[tuple[Ints, Ints]] = []
    for shift in product((0.0, 1.0), repeat=3):
        cell = np.floor((scaled + shift) / 2).astype(np.int64)
        order = np.lexsort(cell.T)
        same = (cell[order[1:]] == cell[order[:-1]]).all(axis=1)
        if same.any():
            links.append((order[:-1][same], order[1:][same]))
    if not links:
        return np.arange(len(points), dtype=np.int64)
    return connected(len(points), np.concatenate([x[0] for x in links]), np.concatenate([x[1] for x in links]))


def area_vectors(corners: Floats) -> Floats:
    """Return the normals of triangles (m, 3, 3), each as long as twice the triangle's area, (m, 3)."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def face_areas(vertices: Floats, faces: Ints) -> Floats:
    """Return the area of each face, (m,)."""
    return np.linalg.norm(area_vectors(vertices[faces]), axis=1) / 2


def face_volumes(vertices: Floats, faces: Ints) -> Floats:
    """Return six times the signed volume of the tetrahedron from the vertices' mean to each face, (m,)."""
    corners = vertices[faces] - (vertices.mean(axis=0) if len(vertices) else 0.0)
    return np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))


@dataclass(frozen=True, slots=True, eq=False)
class Cleaned:
    """Triangles without degenerate and duplicate ones.

    Attributes:
        faces: (k, 3) indices into the given points, welded ones replaced by the first of their kind.
        source: (k,) rows of the given faces.
        edges: Of `faces`.
        deciding: Edges of the faces that decide whether the surface is closed: `faces`, and perhaps some of no height.
        closed: Each of the deciding edges has an even number of faces, and the points are not flat.
        degenerate: Number of faces of no height.
        duplicates: Number of copies that were dropped.
    """

    faces: Ints
    source: Ints
    edges: Edges
    deciding: Edges
    closed: bool
    degenerate: int
    duplicates: int


def cleaned(points: Floats, faces: Ints, tolerance: float, dimension: int) -> Cleaned:
    """Weld and clean triangles.

    Args:
        points: (n, 3).
        faces: (m, 3) indices into `points`.
        tolerance: Length that counts as nothing.
        dimension: Of the point set; below 3 nothing is closed.
    """
    faces = weld(points, tolerance)[faces].reshape(-1, 3)
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    high = _heights(points, faces) > tolerance
    one, both = _without_copies(faces)
    keep, deciding, closed = _choose(points, faces, (one & whole, both & whole), high, dimension)
    source = np.flatnonzero(keep & high)
    table = deciding if len(deciding.of_corner) == len(source) else edges(faces[source])
    degenerate = int((~whole | (one & ~high)).sum())
    return Cleaned(faces[source], source, table, deciding, closed, degenerate, int((whole & ~keep).sum()))


def _heights(points: Floats, faces: Ints) -> Floats:
    """Return the smallest height of each face, (m,)."""
    corners = points[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    return np.divide(2 * face_areas(points, faces), longest, out=np.zeros(len(faces)), where=longest > 0)


def _without_copies(faces: Ints) -> tuple[Bools, Bools]:
    """Return two masks (m,): one copy of each triangle, and one copy of each triangle and winding."""
    corner = np.argsort(faces, axis=1)
    turned = (np.diff(corner, axis=1) % 3 == 1).all(axis=1)
    keys = np.sort(faces, axis=1)
    one, both = np.zeros((2, len(faces)), dtype=np.bool_)
    if len(faces):
        one[np.unique(keys, axis=0, return_index=True)[1]] = True
        both[np.unique(np.column_stack([keys, turned]), axis=0, return_index=True)[1]] = True
    return one, both


def _choose(
    points: Floats, faces: Ints, masks: tuple[Bools, Bools], high: Bools, dimension: int
) -> tuple[Bools, Edges, bool]:
    """Pick the face set that closes the surface: which copies count, and whether faces of no height do.

    A wall that two solids share is a pair of opposite copies: both must stay for its edges to be even (their
    volumes cancel). A face of no height may bridge a T-junction: then it counts for the topology, though not as area.
    """
    one, both = masks
    fallback: tuple[Bools, Edges] | None = None
    for mask in (one, both) if (one != both).any() else (one,):
        for counted in (mask & high, mask) if (mask & ~high).any() else (mask,):
            table = edges(faces[counted])
            fallback = fallback or (mask, table)
            if dimension < 3 or not counted.any() or (table.faces % 2).any():
                continue
            if mask is both and abs(face_volumes(points, faces[counted]).sum()) <= _noise(points, faces[counted]):
                continue  # a sheet with two sides encloses nothing
            return mask, table, True
    assert fallback is not None
    return *fallback, False


def _noise(points: Floats, faces: Ints) -> float:
    return RELATIVE_TOLERANCE * float(face_areas(points, faces).sum() * np.linalg.norm(np.ptp(points, axis=0)))
