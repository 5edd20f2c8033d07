"""Merge adjacent triangles that lie in one plane, to within a tolerance, into convex polygons."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .topology import Edges, Floats, Ints, area_vectors, edges

PARALLEL = 1.0 - 1e-12
"""Cosine of the angle from which on two normals are one."""

# Cosine of the angle (5 degrees) from which on MuJoCo takes two faces for one when it looks where they touch.
_SMOOTH = 0.996

# How far reflex a corner may be, in units of the tolerance: rounding only, since many in a row add up.
_STRAIGHT = 1e-3
# To join larger polygons, and to take hulls of them in MuJoCo, costs time with the square of their corners.
_MOST_CORNERS = 1000


@dataclass(frozen=True, slots=True, eq=False)
class Polygon:
    """A convex planar polygon over a vertex list.

    Attributes:
        loop: Vertex indices, counter-clockwise from outside; three in a row may be collinear.
        normal: (3,) unit normal of the plane that the corners are near, by area.
        faces: Indices of the triangles that it covers.
    """

    loop: tuple[int, ...]
    normal: Floats
    faces: tuple[int, ...]


def convex_polygons(vertices: Floats, faces: Ints, tolerance: float, table: Edges | None = None) -> tuple[Polygon, ...]:
    """Cover the surface with convex polygons made of whole triangles.

    Removes the longest edges between coplanar triangles first, as long as the result stays convex (Hertel and
    Mehlhorn, "Fast triangulation of simple polygons", FCT 1983; within four times the least number of pieces).

    Args:
        vertices: (n, 3).
        faces: (m, 3) without degenerate ones.
        tolerance: Length by which a corner may be off the polygon's plane through the mean of all.
        table: `edges(faces)`, where it is known.

    Returns:
        Polygons in the order of their first triangles.
    """
    if len(faces) == 0:
        return ()
    areas = area_vectors(vertices[faces])
    merger = _Merger(vertices, faces, areas, tolerance)
    for left, right, a, b in _candidates(vertices, faces, table or edges(faces), areas, tolerance):
        merger.merge(left, right, a, b)
    return merger.polygons()


def bend(vertices: Floats, polygons: Sequence[Polygon]) -> float:
    """Return how far a corner of any polygon is off its plane, at most."""
    most = 0.0
    for polygon in polygons:
        if len(polygon.loop) > 3:
            heights = vertices[list(polygon.loop)] @ polygon.normal
            most = max(most, float(np.abs(heights - heights.mean()).max()))
    return most


def flat_neighbours(
    vertices: Floats, faces: Ints, table: Edges, normals: Floats, tolerance: float, parallel: float = PARALLEL
) -> tuple[Ints, Ints, Ints, Floats]:
    """Find the faces that lie in one plane with a neighbour, at an edge that only the two have and walk both ways.

    Args:
        vertices: (n, 3).
        faces: (m, 3).
        table: `edges(faces)`.
        normals: (m, 3) unit normals.
        tolerance: Length by which a corner may be off the neighbour's plane.
        parallel: Cosine of the angle from which on two normals may be of one plane.

    Returns:
        The corners of the two faces from which the edge leads, the edge, and the cosine of their normals, (p,) each.
    """
    here, there, edge = table.neighbours()
    own = ((table.faces == 2) & (table.balance == 0))[edge]
    here, there, edge = here[own], there[own], edge[own]
    left, right = here // 3, there // 3
    cosine = np.einsum("ij,ij->i", normals[left], normals[right])
    apart = vertices[faces[right, (there + 2) % 3]] - vertices[faces[left, here % 3]]
    level = np.abs(np.einsum("ij,ij->i", normals[left], apart)) <= tolerance
    flat = (np.abs(cosine) > parallel) & level
    return here[flat], there[flat], edge[flat], cosine[flat]


def _candidates(
    vertices: Floats, faces: Ints, table: Edges, areas: Floats, tolerance: float
) -> list[tuple[int, int, int, int]]:
    """Return (left face, right face, a, b) of edges a-b between coplanar faces, the longest first."""
    normals = areas / np.linalg.norm(areas, axis=1, keepdims=True)
    here, there, edge, cosine = flat_neighbours(vertices, faces, table, normals, 2 * tolerance, _SMOOTH)
    here, there, edge = here[cosine > 0], there[cosine > 0], edge[cosine > 0]
    left, right = here // 3, there // 3
    a, b = faces[left, here % 3], faces[left, (here + 1) % 3]
    length = np.linalg.norm(vertices[a] - vertices[b], axis=1)
    # Lengths that differ by no more than the tolerance are one, so that noise does not decide the order.
    order = np.lexsort((edge, -np.round(length / max(tolerance, np.finfo(np.float64).tiny))))
    return np.column_stack([left, right, a, b])[order].tolist()


class _Merger:
    """The polygons so far; each is known by one of its triangles (union-find)."""

    def __init__(self, vertices: Floats, faces: Ints, areas: Floats, tolerance: float) -> None:
        self._vertices = vertices
        self._points: list[list[float]] = vertices.tolist()
        self._areas: list[list[float]] = areas.tolist()
        self._loops: list[list[int]] = faces.tolist()
        self._parent = list(range(len(faces)))
        self._tolerance = tolerance

    def merge(self, left: int, right: int, a: int, b: int) -> None:
        """Remove the edge a-b between the polygons of two triangles, if one convex polygon is left."""
        left, right = self._find(left), self._find(right)
        if left == right:
            return
        if len(self._loops[left]) + len(self._loops[right]) > _MOST_CORNERS:
            return
        joined = _joined(self._loops[left], self._loops[right], a, b)
        if joined is None:
            return
        loop, seam = joined
        area = [x + y for x, y in zip(self._areas[left], self._areas[right], strict=True)]
        size = _dot(area, area) ** 0.5
        if size == 0.0:
            return
        normal = [x / size for x in area]
        if not (self._is_corner(loop, 0, normal) and self._is_corner(loop, seam, normal)):
            return
        # Neighbours are coplanar in pairs; many pairs in a row may still bend away from a plane.
        heights = self._vertices[loop] @ np.array(normal)
        if np.abs(heights - heights.mean()).max() > self._tolerance:
            return
        first, second = min(left, right), max(left, right)
        self._parent[second] = first
        self._loops[first] = loop
        self._areas[first] = area

    def polygons(self) -> tuple[Polygon, ...]:
        members: dict[int, list[int]] = {}
        for face in range(len(self._parent)):
            members.setdefault(self._find(face), []).append(face)
        areas = np.array([self._areas[root] for root in members])
        normals = areas / np.linalg.norm(areas, axis=1, keepdims=True)
        normals.setflags(write=False)
        return tuple(
            Polygon(tuple(self._loops[root]), normal, tuple(faces))
            for (root, faces), normal in zip(members.items(), normals, strict=True)
        )

    def _find(self, face: int) -> int:
        parent = self._parent
        while parent[face] != face:
            parent[face] = parent[parent[face]]
            face = parent[face]
        return face

    def _is_corner(self, loop: list[int], i: int, normal: list[float]) -> bool:
        """Tell whether the loop turns left, or goes straight on, at its i-th vertex."""
        before, at, after = (self._points[loop[k % len(loop)]] for k in (i - 1, i, i + 1))
        u, v = _minus(at, before), _minus(after, at)
        turn = _dot(normal, _cross(u, v))
        # The height of the corner over the chord says how far it is from straight.
        straight = _STRAIGHT * self._tolerance * _dot(_minus(after, before), _minus(after, before)) ** 0.5
        return turn > straight or (turn >= -straight and _dot(u, v) > 0)


def _joined(left: list[int], right: list[int], a: int, b: int) -> tuple[list[int], int] | None:
    """Return the outline of two loops that share a-b (walked a to b by the left one), or None if it is not simple.

    The loops meet at its first vertex and at the vertex whose position is returned with it.
    """
    i, j = left.index(b), right.index(a)
    left, right = left[i:] + left[:i], right[j:] + right[:j]  # b ... a and a ... b
    if left[-1] != a or right[-1] != b:
        return None
    # A shared chain of collinear edges goes as a whole.
    while len(left) > 2 and len(right) > 2 and left[-2] == right[1]:
        left, right = left[:-1], right[1:]
    while len(left) > 2 and len(right) > 2 and left[1] == right[-2]:
        left, right = left[1:], right[:-1]
    loop = left + right[1:-1]
    return (loop, len(left) - 1) if len(loop) >= 3 and len(set(loop)) == len(loop) else None


def _dot(u: list[float], v: list[float]) -> float:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def _minus(u: list[float], v: list[float]) -> list[float]:
    return [u[0] - v[0], u[1] - v[1], u[2] - v[2]]


def _cross(u: list[float], v: list[float]) -> list[float]:
    return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
