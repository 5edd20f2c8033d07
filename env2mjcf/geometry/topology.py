"""How the triangles of a mesh hang together: welded points, shared edges, and what is linked by them."""

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

COINCIDENT = 1e-6
"""Angle in radians below which two faces at an edge coincide: the solid that touches there is another one."""


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


def apart(faces: Ints, component: Ints) -> Ints:
    """Number the vertices of faces (m, 3) anew, so that no two components (m,) have one in common."""
    span = int(faces.max(initial=0)) + 1
    return np.unique(component[:, None] * span + faces, return_inverse=True)[1].reshape(-1, 3).astype(np.int64)


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


def facing(vertices: Floats, faces: Ints, table: Edges, normals: Floats) -> tuple[Ints, Ints, Floats, bool]:
    """Find the face that bounds the same wedge of the solid as each face at each of its edges.

    It is the first one of opposite direction that a rotation about the edge, from the face into the solid, finds.

    Args:
        vertices: (n, 3).
        faces: (m, 3) counter-clockwise from outside.
        table: `edges(faces)`.
        normals: (m, 3) unit normals.

    Returns:
        The corners of both from which the edge leads, and the angle of the wedge in radians, (p,) each; corners of
        open edges, and of those that are walked one way only, are missing. And whether any faces lie upon each other at
        an edge.
    """
    corner = np.argsort(table.of_corner.ravel(), kind="stable")
    start = np.concatenate([[0], np.cumsum(table.faces)[:-1]]).astype(np.int64)
    along = vertices[faces[:, (1, 2, 0)]] - vertices[faces]
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    inward = np.cross(normals[:, None], along)
    here, there = _pairs_at_edges(table.faces, start, corner)
    opposite = table.forward.ravel()[here] != table.forward.ravel()[there]
    here, there = here[opposite], there[opposite]
    normal, own, other = normals[here // 3], inward.reshape(-1, 3)[here], inward.reshape(-1, 3)[there]
    angle = np.arctan2(-np.einsum("ij,ij->i", normal, other), np.einsum("ij,ij->i", own, other)) % (2 * np.pi)
    angle[angle < COINCIDENT] = 2 * np.pi
    order = np.lexsort((there, angle, here))
    first = order[np.concatenate([[True], np.diff(here[order]) > 0])[: len(order)]]
    return here[first], there[first], angle[first], bool((angle > 2 * np.pi - COINCIDENT).any())


def _pairs_at_edges(count: Ints, start: Ints, corner: Ints) -> tuple[Ints, Ints]:
    """Return all ordered pairs of different corners at one edge."""
    here: list[Ints] = []
    there: list[Ints] = []
    for size in np.unique(count[count > 1]).tolist():
        members = corner[start[count == size][:, None] + np.arange(size)]
        a, b = np.nonzero(~np.eye(size, dtype=np.bool_))
        here.append(members[:, a].ravel())
        there.append(members[:, b].ravel())
    empty = np.zeros(0, dtype=np.int64)
    return np.concatenate([empty, *here]), np.concatenate([empty, *there])
