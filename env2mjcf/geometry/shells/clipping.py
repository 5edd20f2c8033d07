"""Many small convex polygons cut by planes at once."""

from __future__ import annotations

import numpy as np

from ..topology import Floats, Ints


def clipped(triangles: Floats, planes: Floats) -> tuple[Floats, Ints]:
    """Cut each triangle to the half-spaces `x . plane[:3] + plane[3] >= 0` (Sutherland and Hodgman, 1974).

    Args:
        triangles: (n, 3, 3).
        planes: (n, p, 4).

    Returns:
        Corners (n, k, 3), of which those from the count on are without meaning, and counts (n,): 0 for nothing left.
    """
    points, count = triangles, np.full(len(triangles), 3, dtype=np.int64)
    for i in range(planes.shape[1]):
        points, count = _cut(points, count, planes[:, i])
    return points, count


def _cut(points: Floats, count: Ints, plane: Floats) -> tuple[Floats, Ints]:
    size = points.shape[1]
    slot = np.arange(size)
    used = slot < count[:, None]
    height = np.einsum("nkj,nj->nk", points, plane[:, :3]) + plane[:, 3:]
    after = np.where(slot + 1 < count[:, None], slot + 1, 0)
    beyond = np.take_along_axis(height, after, axis=1)
    inside = used & (height >= 0)
    crosses = used & ((height >= 0) != (beyond >= 0))
    drop = np.where(crosses, height - beyond, 1.0)
    share = np.where(crosses, height / drop, 0.0)
    following = np.take_along_axis(points, after[:, :, None], axis=1)
    between = points + share[:, :, None] * (following - points)
    kept = np.stack([inside, crosses], axis=2).reshape(len(points), 2 * size)
    both = np.stack([points, between], axis=2).reshape(len(points), 2 * size, 3)
    left = kept.sum(axis=1).astype(np.int64)
    order = np.argsort(~kept, axis=1, kind="stable")[:, : max(1, int(left.max(initial=0)))]
    return np.take_along_axis(both, order[:, :, None], axis=1), left
