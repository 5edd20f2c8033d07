"""Distances of points from triangles, and points spread over triangles."""

from __future__ import annotations

import numpy as np

from .topology import Floats, Ints, face_areas

_BLOCK = 2_000_000  # pairs of points and triangles held in memory at once
_FINEST = 64


def distances(points: Floats, vertices: Floats, faces: Ints) -> Floats:
    """Return the distance of each point from the nearest triangle, (k,).

    Only triangles whose bounding sphere may hold the nearest point are looked at closely.

    Args:
        points: (k, 3).
        vertices: (n, 3).
        faces: (m, 3), at least one.
    """
    corners = vertices[faces]
    centers = (corners.min(axis=1) + corners.max(axis=1)) / 2
    radii = np.linalg.norm(corners - centers[:, None], axis=2).max(axis=1)
    slack = 1e-6 * float(np.abs(np.concatenate([points, vertices])).max(initial=0.0))
    out = np.empty(len(points))
    step = max(1, _BLOCK // len(faces))
    for i in range(0, len(points), step):
        some = points[i : i + step]
        square = (some**2).sum(axis=1)[:, None] + (centers**2).sum(axis=1) - 2 * some @ centers.T
        apart = np.sqrt(np.maximum(square, 0.0))
        point, face = np.nonzero(apart - radii <= (apart + radii).min(axis=1)[:, None] + slack)
        exact = _to_triangles(some[point], corners[face])
        out[i : i + step] = np.minimum.reduceat(exact, np.searchsorted(point, np.arange(len(some))))
    return out


def _to_triangles(points: Floats, corners: Floats) -> Floats:
    """Return the distance of each point (k, 3) from its triangle (k, 3, 3)."""
    best = np.full(len(points), np.inf)
    inside = np.ones(len(points), dtype=np.bool_)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    for i in range(3):
        start, along = corners[:, i], corners[:, (i + 1) % 3] - corners[:, i]
        to = points - start
        length = np.einsum("ij,ij->i", along, along)
        part = np.divide(np.einsum("ij,ij->i", to, along), length, out=np.zeros(len(to)), where=length > 0)
        best = np.minimum(best, np.linalg.norm(to - np.clip(part, 0.0, 1.0)[:, None] * along, axis=1))
        inside &= np.einsum("ij,ij->i", np.cross(along, to), normal) >= 0
    size = np.linalg.norm(normal, axis=1)
    height = np.abs(np.einsum("ij,ij->i", points - corners[:, 0], normal))
    over = inside & (size > 0)
    best[over] = np.minimum(best[over], height[over] / size[over])
    return best


def spread(vertices: Floats, faces: Ints, count: int) -> tuple[Floats, float]:
    """Spread points over triangles: their corners, and points on their edges and inside of them.

    Args:
        vertices: (n, 3).
        faces: (m, 3).
        count: How many points to make at most; more if there are three for each triangle already.

    Returns:
        The points, (k, 3), and the greatest distance of a point of the surface from the nearest of them.
    """
    corners = vertices[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    width = np.sqrt(2 * float(face_areas(vertices, faces).sum()) / count)
    while True:
        cuts = np.clip(np.ceil(longest / width), 1, _FINEST).astype(np.int64)
        if (cuts == 1).all() or ((cuts + 1) * (cuts + 2) // 2).sum() <= count:
            break
        width *= 1.25  # long thin triangles take more points than their area suggests
    points: list[Floats] = []
    for n in np.unique(cuts):
        i, j = (x.ravel() for x in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
        i, j = i[i + j <= n], j[i + j <= n]
        weights = np.stack([n - i - j, i, j], axis=1) / n
        points.append(np.einsum("sk,fkx->fsx", weights, corners[cuts == n]).reshape(-1, 3))
    # The cut triangles are similar to the whole; no point of one is farther from its corners than this.
    gap = float((longest / cuts).max() / np.sqrt(3.0))
    return np.concatenate(points), gap
