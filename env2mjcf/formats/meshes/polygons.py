"""Polygons in space, cut into triangles without new vertices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...limits import Work

Vectors = NDArray[np.float64]
Indices = NDArray[np.int64]

# Below this fraction of a polygon's squared size an area counts as zero.
_FLAT = 1e-12


def triangulate(
    vertices: Vectors, corners: Indices, counts: Indices, work: Work | None = None
) -> tuple[Indices, list[int]]:
    """Cut polygons into triangles that keep every edge and the orientation of their polygon.

    A convex polygon becomes a fan around its first corner. Others are cut by ear clipping (Meisters, "Polygons
    have ears", 1975) in the plane of their vector area.

    Args:
        vertices: (n, 3) points.
        corners: Indices into `vertices`, polygon after polygon.
        counts: Number of corners of each polygon, at least 3.
        work: How many points may be looked at in search of ears; None sets no bound.

    Returns:
        (m, 3) triangles in the order of the polygons, and the polygons found to cross themselves, what was left of
        each cut as a fan.

    Raises:
        TooMuchWorkError: More points would have to be looked at; its part is the polygon.
    """
    work = work or Work()
    first_corner = np.cumsum(counts) - counts
    first_face = np.cumsum(counts - 2) - (counts - 2)
    faces = np.empty((int((counts - 2).sum()), 3), dtype=np.int64)
    crossing: list[int] = []
    for n in np.unique(counts).tolist():
        which = np.flatnonzero(counts == n)
        polygons = corners[first_corner[which, None] + np.arange(n)]
        faces[first_face[which, None] + np.arange(n - 2)] = polygons[:, _fan(n)]
        if n == 3:
            continue
        flat = _flattened(vertices[polygons])
        for row in np.flatnonzero(~_convex(flat)).tolist():
            polygon = int(which[row])
            triples, whole = _clip_ears(flat[row], work, polygon)
            start = int(first_face[polygon])
            faces[start : start + n - 2] = polygons[row][triples]
            if not whole:
                crossing.append(polygon)
    return faces, sorted(crossing)


def _fan(n: int) -> Indices:
    k = np.arange(1, n - 1, dtype=np.int64)
    return np.stack([np.zeros_like(k), k, k + 1], axis=1)


def _flattened(points: Vectors) -> Vectors:
    """Project (k, n, 3) polygons onto their planes, scaled to size 1 and counter-clockwise: (k, n, 2)."""
    # A power of two, which rounds nothing, so that the largest doubles do not overflow.
    _, exponent = np.frexp(np.abs(points).max(axis=(1, 2), keepdims=True))
    points = np.ldexp(points, -exponent)
    points = points - points[:, :1]
    size = np.abs(points).max(axis=(1, 2), keepdims=True)
    points = points / np.where(size > 0, size, 1.0)
    area = np.cross(points, np.roll(points, -1, axis=1)).sum(axis=1)
    # A polygon without area (a line, or a figure of eight) is looked at along the smallest side of its box.
    extent = np.ptp(points, axis=1)
    no_area = np.linalg.norm(area, axis=1) <= _FLAT
    area[no_area] = np.eye(3)[extent[no_area].argmin(axis=1)]
    normal = area / np.linalg.norm(area, axis=1, keepdims=True)
    side = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    return np.stack(
        [np.einsum("kni,ki->kn", points, side), np.einsum("kni,ki->kn", points, np.cross(normal, side))], axis=2
    )


def _convex(flat: Vectors) -> NDArray[np.bool_]:
    """Tell which (k, n, 2) polygons turn left at every corner, and once around in all."""
    ahead = np.roll(flat, -1, axis=1) - flat
    behind = np.roll(ahead, 1, axis=1)
    cross = behind[..., 0] * ahead[..., 1] - behind[..., 1] * ahead[..., 0]
    turn = np.arctan2(cross, (behind * ahead).sum(axis=2)).sum(axis=1)
    return (cross > _FLAT).all(axis=1) & (turn < 3 * np.pi)


def _clip_ears(points: Vectors, work: Work, polygon: int) -> tuple[Indices, bool]:
    """Cut one (n, 2) polygon, of this index; return (n - 2, 3) positions, and False where it crosses itself."""
    ring = list(range(len(points)))
    triples: list[tuple[int, int, int]] = []
    at, misses = 0, 0
    while len(ring) > 3 and misses < len(ring):
        work.spend(len(ring), polygon)
        ear = (ring[at - 1], ring[at], ring[(at + 1) % len(ring)])
        if _is_ear(points, ear, ring):
            triples.append(ear)
            del ring[at]
            # The corner before is the likeliest to have become an ear.
            at, misses = (at - 1) % len(ring), 0
        else:
            at, misses = (at + 1) % len(ring), misses + 1
    rest = np.array(ring, dtype=np.int64)
    fan = rest[_fan(len(ring))]
    areas = _doubled_areas(points[fan])
    # What is left of a polygon that does not cross itself is a triangle, or has no area.
    whole = bool((areas >= -_FLAT).all()) and (len(ring) == 3 or bool((areas <= _FLAT).all()))
    return np.concatenate([np.array(triples, dtype=np.int64).reshape(-1, 3), fan]), whole


def _is_ear(points: Vectors, ear: tuple[int, int, int], ring: list[int]) -> bool:
    triangle = points[list(ear)]
    if _doubled_areas(triangle[None])[0] <= _FLAT:
        return False
    others = points[ring]
    others = others[~(others[:, None] == triangle[None]).all(axis=2).any(axis=1)]
    sides = np.roll(triangle, -1, axis=0) - triangle
    offsets = others[:, None] - triangle[None]
    left = sides[:, 0] * offsets[..., 1] - sides[:, 1] * offsets[..., 0]
    # A corner on the border blocks the ear, too; one at the same place does not, or polygons with holes had no ears.
    return not bool((left >= -_FLAT).all(axis=1).any())


def _doubled_areas(triangles: Vectors) -> Vectors:
    a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
