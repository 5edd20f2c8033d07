"""How far a closed surface is from the boundary of its own hull, and whether that hull is a box."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..limits import Work
from .extremes import PointTree
from .orientation import winding_numbers
from .pieces import hull_faces
from .topology import Edges, Floats, Ints, area_vectors, connected, edges

_BLOCK = 4_000_000  # numbers held in memory at once
_SAME_SIDE = 1e-3  # normals that differ by less on every axis may belong to one flat side
_RINGS = 8  # of neighbours whose planes a triangle tries
_SMOOTHINGS = 3
_HALVINGS = 5
_PROBES = 500
_LEAST_COSINE = 1e-12
_BEYOND = 5.0  # tolerances that the hull may reach beyond the surface: no more than other pieces do
_MOST = 200_000_000  # pairs of triangles and facets of the hull that are compared
# The corners of the four triangles that a triangle is cut into, from its corners.
_QUARTERS = (
    np.array(
        [
            [[2, 0, 0], [1, 1, 0], [1, 0, 1]],
            [[1, 1, 0], [0, 2, 0], [0, 1, 1]],
            [[1, 0, 1], [0, 1, 1], [0, 0, 2]],
            [[1, 1, 0], [0, 1, 1], [1, 0, 1]],
        ]
    )
    / 2
)


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """A box in the mesh's frame.

    Attributes:
        half_sizes: (3,) half of each side.
        center: (3,).
        rotation: (3, 3) columns are the directions of the sides; the identity for a box along the axes.
    """

    half_sizes: Floats
    center: Floats
    rotation: Floats


def is_convex(
    vertices: Floats, faces: Ints, tolerance: float, table: Edges | None = None, work: Work | None = None
) -> bool:
    """Tell whether no point of a closed surface lies farther than `tolerance` inside its hull; see `concavity`."""
    return concavity(vertices, faces, tolerance, table, work) <= tolerance


def concavity(
    vertices: Floats, faces: Ints, tolerance: float, table: Edges | None = None, work: Work | None = None
) -> float:
    """Return a length that no point of a closed surface lies farther inside its hull than; infinite beyond `tolerance`.

    It is about points, not vertices: a twisted prism has all its vertices on its hull. Where all vertices lie at most
    h above the lowest corner of a triangle, in any direction, each point of that triangle lies within h of the hull's
    boundary. The triangle's own normal is such a direction; those of slivers are noise, so that the normals of their
    neighbours are tried, too; what is left is compared with the hull itself, in ever smaller parts.

    Args:
        vertices: (n, 3), all used by `faces`.
        faces: (m, 3) without degenerate ones, wound alike.
        tolerance: Length.
        table: `edges(faces)`, where it is known.
        work: What may be done.

    Raises:
        TooMuchWorkError: It takes more than `work` has left.
    """
    if len(faces) < 4:
        return math.inf
    middle = vertices.mean(axis=0)
    # Two layers may lie near their hull and leave it hollow.
    winding = winding_numbers(middle[None], vertices, faces)[0]
    if not 0.5 < abs(winding) < 1.5:
        return math.inf
    cover = _Cover(vertices - middle, faces if winding > 0 else faces[:, ::-1], tolerance, work or Work())
    table = table or edges(faces)
    if cover.deep_beside_edges(table):
        return math.inf
    cover.try_sides(table)
    cover.try_own(np.flatnonzero(cover.heights > tolerance))
    cover.try_neighbours(table)
    smooth = cover.areas
    for k in range(_SMOOTHINGS):
        # Once also where a height is all right and yet may be only noise.
        rest = np.flatnonzero(cover.heights > (tolerance if k else tolerance / 10))
        if not len(rest):
            break
        smooth = _smoothed(smooth, cover.faces, len(vertices))
        cover.try_directions(rest, smooth[rest])
        cover.try_neighbours(table)
    height = cover.decided()
    return height if cover.beyond_edges(table) <= _BEYOND * tolerance else math.inf


class _Cover:
    """The triangles of a surface, each with the best plane found so far that no vertex is above.

    Attributes:
        heights: (m,) how far the lowest corner of each triangle lies below its plane.
        areas: (m, 3) normals, each as long as twice the area.
    """

    def __init__(self, points: Floats, faces: Ints, tolerance: float, work: Work) -> None:
        self.faces = faces
        self.heights = np.full(len(faces), np.inf)
        self.areas = area_vectors(points[faces])
        self._points = points
        self._tolerance = tolerance
        self._work = work
        self._normals = self.areas / np.linalg.norm(self.areas, axis=1, keepdims=True)
        self._offsets = np.full(len(faces), np.inf)
        self._tree = PointTree(points)

    def deep_beside_edges(self, table: Edges) -> bool:
        """Tell whether a triangle that a neighbour rises above is deep inside the hull, as of most concave meshes."""
        first, second, _ = table.neighbours()
        rising: list[Ints] = []
        for here, there in ((first, second), (second, first)):
            normal, opposite = self._normals[here // 3], self.faces[there // 3, (there % 3 + 2) % 3]
            apart = self._points[opposite] - self._points[self.faces[here // 3, 0]]
            rising.append(here[np.einsum("ij,ij->i", normal, apart) > self._tolerance] // 3)
        rows = np.unique(np.concatenate(rising))
        if not len(rows) or self._hull is None:
            return False
        normals, offsets = self._hull
        some = rows[:: -(-len(rows) // _PROBES)]
        points = self._points[self.faces[some]]
        points = np.concatenate([points.reshape(-1, 3), points.mean(axis=1)])
        step = max(1, _BLOCK // len(normals))
        return any(
            ((offsets - points[i : i + step] @ normals.T).min(axis=1) > self._tolerance).any()
            for i in range(0, len(points), step)
        )

    def try_sides(self, table: Edges) -> None:
        """Lay one plane on all triangles of a flat side, however finely it is cut: the mean of theirs."""
        first, second, _ = table.neighbours()
        here, there = first // 3, second // 3
        alike = (np.abs(self._normals[here] - self._normals[there]) < _SAME_SIDE).all(axis=1)
        side = connected(len(self.faces), here[alike], there[alike])
        sums = np.stack([np.bincount(side, self.areas[:, k]) for k in range(3)], axis=1)
        normals = sums / np.linalg.norm(sums, axis=1, keepdims=True)
        corners = self._corners(np.arange(len(side)), normals[side])
        lowest, highest = np.full(len(sums), np.inf), np.full(len(sums), -np.inf)
        np.minimum.at(lowest, side, corners.min(axis=1))
        np.maximum.at(highest, side, corners.max(axis=1))
        self._lay(np.arange(len(side)), normals[side], self._supports(normals, lowest, highest)[side])

    def try_own(self, rows: Ints) -> None:
        """Lay the plane of each of these triangles on it."""
        self.try_directions(rows, self.areas[rows])

    def try_directions(self, rows: Ints, directions: Floats) -> None:
        """Lay a plane square to a direction, (r, 3), on each of these triangles."""
        length = np.linalg.norm(directions, axis=1)
        rows, normals = rows[length > 0], directions[length > 0] / length[length > 0, None]
        corners = self._corners(rows, normals)
        self._lay(rows, normals, self._supports(normals, corners.min(axis=1), corners.max(axis=1)))

    def try_neighbours(self, table: Edges) -> None:
        """Lay the planes of neighbours on triangles that they fit better, from ring to ring."""
        first, second, _ = table.neighbours()
        here, there = np.concatenate([first, second]) // 3, np.concatenate([second, first]) // 3
        for _ in range(_RINGS):
            useful = (self.heights[here] > self._tolerance / 100) & (self._offsets[there] < np.inf)
            rows, others = here[useful], there[useful]
            heights = self._offsets[others] - self._corners(rows, self._normals[others]).min(axis=1)
            # The best of the three neighbours is laid last.
            order = np.argsort(-heights, kind="stable")
            better = order[heights[order] < self.heights[rows[order]]]
            if not len(better):
                break
            self._lay(rows[better], self._normals[others[better]], self._offsets[others[better]])

    def decided(self) -> float:
        """Return the greatest height, after what is left has been compared with the hull."""
        rest = np.flatnonzero(self.heights > self._tolerance)
        if not len(rest):
            return float(self.heights.max())
        hull = self._hull
        if hull is None:
            return math.inf
        # What is large is most likely to be deep inside, and one such triangle is enough.
        rest = rest[np.argsort(-np.linalg.norm(self.areas[rest], axis=1), kind="stable")]
        triangles = self._points[self.faces[rest]]
        left = _MOST
        greatest = float(self.heights[self.heights <= self._tolerance].max(initial=0.0))
        for _ in range(_HALVINGS + 1):
            undecided: list[Floats] = []
            step = max(1, _BLOCK // (4 * len(hull[0])))
            for i in range(0, len(triangles), step):
                some = triangles[i : i + step]
                heights, deep = self._against(some, *hull)
                left -= len(some) * len(hull[0])
                # To call a convex mesh concave costs time and no truth.
                if deep or left < 0:
                    return math.inf
                high = heights > self._tolerance
                greatest = max(greatest, float(heights[~high].max(initial=0.0)))
                undecided.append(some[high])
            triangles = np.einsum("qkc,pci->pqki", _QUARTERS, np.concatenate(undecided)).reshape(-1, 3, 3)
            if not len(triangles):
                return greatest
        return math.inf

    def _against(self, triangles: Floats, normals: Floats, offsets: Floats) -> tuple[Floats, bool]:
        """Return each triangle's height below the facet of the hull that fits best, and whether a point is too deep."""
        points = np.concatenate([triangles, triangles.mean(axis=1, keepdims=True)], axis=1)
        depths = offsets - points @ normals.T  # (p, 4, f)
        deep = bool((depths.min(axis=2) > self._tolerance).any())
        best = depths[:, :3].max(axis=1).argmin(axis=1)
        chosen, of_triangle = np.unique(best, return_inverse=True)
        exact = self._supports(normals[chosen], np.full(len(chosen), np.inf), offsets[chosen])[of_triangle.reshape(-1)]
        lowest = np.einsum("pki,pi->pk", triangles, normals[best]).min(axis=1)
        return exact - lowest, deep

    def beyond_edges(self, table: Edges) -> float:
        """Return how far the hull may reach beyond edges of the surface: far, where a sharp one is dented.

        What lies at most h above two planes at an angle a, and next to their edge, is at most h / cos(a / 2) from it.
        """
        first, second, _ = table.neighbours()
        here, there = first // 3, second // 3
        # No one plane fits those that were compared with the hull in parts.
        parted = (self.heights > self._tolerance)[:, None]
        own = self.areas / np.linalg.norm(self.areas, axis=1, keepdims=True)
        normals = np.where(parted, own, self._normals)
        heights = np.minimum(np.maximum(self.heights[here], self.heights[there]), self._tolerance)
        cosine = np.einsum("ij,ij->i", normals[here], normals[there])
        return float((heights * np.sqrt(2 / np.maximum(1 + cosine, _LEAST_COSINE))).max(initial=0.0))

    @cached_property
    def _hull(self) -> tuple[Floats, Floats] | None:
        """Normals, (f, 3), and offsets of the facets of the hull; None where the points are as good as coplanar."""
        try:
            corners = self._points[hull_faces([self._points])[0]]
        except ValueError:
            return None
        normals = area_vectors(corners)
        length = np.linalg.norm(normals, axis=1)
        normals = normals[length > 0] / length[length > 0, None]
        return normals, np.einsum("fki,fi->fk", corners[length > 0], normals).max(axis=1)

    def _corners(self, rows: Ints, normals: Floats) -> Floats:
        """Return the heights of the three corners of triangles along normals, (r, 3)."""
        return np.einsum("rki,ri->rk", self._points[self.faces[rows]], normals)

    def _lay(self, rows: Ints, normals: Floats, offsets: Floats) -> None:
        heights = offsets - self._corners(rows, normals).min(axis=1)
        better = heights < self.heights[rows]
        rows = rows[better]
        self.heights[rows], self._offsets[rows], self._normals[rows] = heights[better], offsets[better], normals[better]

    def _supports(self, normals: Floats, lowest: Floats, highest: Floats) -> Floats:
        """Return the height of the highest vertex along each normal; infinite where that is too far above `lowest`."""
        limits = lowest + self._tolerance
        heights = self._tree.highest(normals, highest, limits, self._work)
        return np.where(heights <= limits, heights, np.inf)


def _smoothed(vectors: Floats, faces: Ints, count: int) -> Floats:
    """Return for each triangle the sum over its corners of what the triangles at them have."""
    at_vertex = np.stack(
        [np.bincount(faces.ravel(), np.repeat(vectors[:, k], 3), minlength=count) for k in range(3)], axis=1
    )
    return at_vertex[faces].sum(axis=1)


def exact_box(vertices: Floats, faces: Ints, tolerance: float) -> Box | None:
    """Return the box that a convex surface is, to within `tolerance`, or None.

    Args:
        vertices: (n, 3), all used by `faces`.
        faces: (m, 3) of a convex surface.
        tolerance: Length by which a corner may be off.
    """
    areas = area_vectors(vertices[faces])
    sizes = np.linalg.norm(areas, axis=1)
    normals = areas / sizes[:, None]
    first = normals[np.argmax(sizes)]
    # Sides that stand on the first: the largest of them gives the second direction.
    upright = np.abs(normals @ first) < 0.5
    if not upright.any():
        return None
    second = normals[upright][np.argmax(sizes[upright])]
    second = second - first * (first @ second)
    second /= np.linalg.norm(second)
    rotation = _nearest_to_identity(np.column_stack([first, second, np.cross(first, second)]))
    local = vertices @ rotation
    low, high = local.min(axis=0), local.max(axis=0)
    on_side = np.minimum(np.abs(local - low), np.abs(local - high)) <= tolerance
    # On a box each vertex lies on a side, and each corner is a vertex.
    at_corner = np.unique((local > (low + high) / 2)[on_side.all(axis=1)], axis=0)
    if not on_side.any(axis=1).all() or len(at_corner) != 8:
        return None
    return Box((high - low) / 2, rotation @ ((low + high) / 2), rotation)


def _nearest_to_identity(axes: Floats) -> Floats:
    """Reorder and turn round the columns so that the diagonal is large and positive and the frame right-handed."""
    columns = [0, 1, 2]
    chosen: list[int] = []
    for row in range(3):
        best = max(columns, key=lambda c: (round(abs(float(axes[row, c])), 9), -c))
        columns.remove(best)
        chosen.append(best)
    out = axes[:, chosen]
    out = out * np.where(np.diag(out) < 0, -1.0, 1.0)
    if np.linalg.det(out) < 0:
        out[:, 2] *= -1
    return np.asarray(out + 0.0, dtype=np.float64)
