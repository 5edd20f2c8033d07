"""Triangulates regions of a plane that are given by their boundary edges."""

from __future__ import annotations

import numpy as np

from .topology import Bools, Floats, Ints

_BLOCK = 200_000  # pairs of edges held in memory at once


def triangulated(points: Floats, boundary: Ints, tolerance: float) -> Ints | None:
    """Cut a region into triangles over the ends of its boundary edges, without new vertices.

    Adds diagonals that cross nothing, the shortest first, until none is left: in a polygon with holes that leaves
    triangles, whatever the order ("greedy triangulation"). Short ones first keep the triangles from being slivers.
    The answer is proved, not trusted: the triangles have exactly the given boundary, each is counter-clockwise, and
    no two of them overlap. So they cover what the boundary winds around once, and it winds around nothing else.

    Args:
        points: (n, 2).
        boundary: (e, 2) indices into `points`; the region is to the left of each edge. Holes and several parts are
            allowed.
        tolerance: Length that counts as nothing.

    Returns:
        (m, 3) indices into `points`, or None where edges cross, where the boundary winds around something more than
        once or clockwise, or where rounding leaves the question open.
    """
    inner = _diagonals(points, boundary, tolerance)
    loops = chained(points, np.concatenate([boundary, inner, inner[:, ::-1]]))
    if loops is None or any(len(loop) != 3 for loop in loops):
        return None
    triangles = np.array(loops, dtype=np.int64).reshape(-1, 3)
    corners = points[triangles]
    if len(triangles) == 0 or (_heights(corners) <= tolerance).any() or _overlap(corners, tolerance):
        return None
    return triangles


def chained(points: Floats, boundary: Ints) -> list[list[int]] | None:
    """Chain directed edges (e, 2) to loops that go round one part of the plane each, on their left.

    At a vertex where several loops meet, a loop goes on along the first edge clockwise from the one it came on: all
    between the two is its own.

    Returns:
        Vertices of each loop, or None if some edge has none to follow it.
    """
    leaving: dict[int, list[int]] = {}
    for edge, start in enumerate(boundary[:, 0].tolist()):
        leaving.setdefault(start, []).append(edge)
    steps = points[boundary[:, 1]] - points[boundary[:, 0]]
    angle = np.arctan2(steps[:, 1], steps[:, 0])
    unused = dict.fromkeys(range(len(boundary)))
    loops: list[list[int]] = []
    while unused:
        first = edge = next(iter(unused))
        loop: list[int] = []
        while True:
            if edge not in unused:
                return None
            del unused[edge]
            loop.append(int(boundary[edge, 0]))
            there = leaving.get(int(boundary[edge, 1]), [])
            if not there:
                return None
            # The edge that leads straight back comes last.
            turn = (angle[edge] + np.pi - angle[there]) % (2 * np.pi)
            back = boundary[there, 1] == boundary[edge, 0]
            edge = there[int(np.argmin(np.where(back, np.inf, turn)))]
            if edge == first:
                break
        loops.append(loop)
    return loops


def _diagonals(points: Floats, boundary: Ints, tolerance: float) -> Ints:
    """Return (d, 2) diagonals within the region that cross neither the boundary nor each other, as many as fit."""
    used = np.unique(boundary)
    a, b = (used[side] for side in np.triu_indices(len(used), 1))
    known = {(min(u, v), max(u, v)) for u, v in boundary.tolist()}
    fresh = np.array([pair not in known for pair in zip(a.tolist(), b.tolist(), strict=True)], dtype=np.bool_)
    wanted = np.stack([a, b], axis=1)[fresh].reshape(-1, 2)
    step = max(1, _BLOCK // max(1, len(boundary)))
    blocks = [wanted[i : i + step] for i in range(0, len(wanted), step)]
    free = [d[~_meet(points, d, boundary, tolerance).any(axis=1) & _within(points, d, boundary)] for d in blocks]
    wanted = np.concatenate([np.zeros((0, 2), dtype=np.int64), *free])
    length = np.linalg.norm(points[wanted[:, 0]] - points[wanted[:, 1]], axis=1)
    wanted = wanted[np.lexsort((wanted[:, 1], wanted[:, 0], length))]
    chosen: list[Ints] = []
    while len(wanted):
        chosen.append(wanted[0])
        wanted = wanted[1:][~_meet(points, wanted[1:], wanted[:1], tolerance)[:, 0]]
    return np.array(chosen, dtype=np.int64).reshape(-1, 2)


def _meet(points: Floats, one: Ints, other: Ints, tolerance: float) -> Bools:
    """Tell which of two sets of edges meet elsewhere than at a common end, (len(one), len(other)).

    Edges that lie upon each other, or on whose middle an end of the other lies, meet as well.
    """
    first, second = _sides(points, one, other), _sides(points, other, one).transpose(1, 0, 2)
    same = one[:, None, :, None] == other[None, :, None, :]
    # A common end lies on no side; the other ends decide whether the edges lie upon each other.
    first[same.any(axis=2)] = second[same.any(axis=3)] = 0.0
    apart = [(s > tolerance).all(axis=2) | (s < -tolerance).all(axis=2) for s in (first, second)]
    shared = same.any(axis=(2, 3))
    level = (np.abs(first) <= tolerance).all(axis=2) | (np.abs(second) <= tolerance).all(axis=2)
    u, v = points[one[:, 1]] - points[one[:, 0]], points[other[:, 1]] - points[other[:, 0]]
    # From a common end both the same way; or disjoint in a row, which only their extents along the line tell.
    sign = np.where(same[:, :, 0, 0] | same[:, :, 1, 1], 1.0, -1.0)
    upon = level & ((u @ v.T) * sign > 0)
    return np.where(shared, upon, ~(apart[0] | apart[1] | _in_a_row(points, one, other, tolerance)))


def _in_a_row(points: Floats, one: Ints, other: Ints, tolerance: float) -> Bools:
    """Tell which edges lie apart along the direction of the first ones, (len(one), len(other))."""
    along = points[one[:, 1]] - points[one[:, 0]]
    length = np.linalg.norm(along, axis=1)[:, None]
    at = np.einsum("aj,abkj->abk", along, points[other][None] - points[one[:, 0]][:, None, None]) / length[:, :, None]
    return (at.max(axis=2) < -tolerance) | (at.min(axis=2) > length + tolerance)


def _sides(points: Floats, one: Ints, other: Ints) -> Floats:
    """Return how far the ends of the other edges lie to the left of the first edges' lines, (a, b, 2)."""
    start, along = points[one[:, 0]], points[one[:, 1]] - points[one[:, 0]]
    left = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1, keepdims=True)
    return np.einsum("aj,abkj->abk", left, points[other][None] - start[:, None, None])


def _within(points: Floats, diagonals: Ints, boundary: Ints) -> Bools:
    """Tell around the middle of which edges the boundary winds, (len(diagonals),)."""
    middle = points[diagonals].mean(axis=1)
    low, high = points[boundary[:, 0]], points[boundary[:, 1]]
    rises = (low[:, 1] <= middle[:, None, 1]) & (high[:, 1] > middle[:, None, 1])
    falls = (high[:, 1] <= middle[:, None, 1]) & (low[:, 1] > middle[:, None, 1])
    along, to = high - low, middle[:, None] - low
    left = along[:, 0] * to[:, :, 1] - along[:, 1] * to[:, :, 0]
    winding = (rises & (left > 0)).sum(axis=1) - (falls & (left < 0)).sum(axis=1)
    return np.asarray(winding != 0)


def _heights(corners: Floats) -> Floats:
    """Return the least height of triangles (m, 3, 2), negative for clockwise ones."""
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / longest


def _overlap(corners: Floats, tolerance: float) -> bool:
    """Tell whether any two of the counter-clockwise triangles (m, 3, 2) overlap: no edge has the other outside."""
    along = np.roll(corners, -1, axis=1) - corners
    left = np.stack([-along[:, :, 1], along[:, :, 0]], axis=2) / np.linalg.norm(along, axis=2, keepdims=True)
    for i in range(len(corners) - 1):
        rest = corners[i + 1 :]
        own = np.einsum("ej,mvej->mve", left[i], rest[:, :, None] - corners[i]).max(axis=1)
        theirs = np.einsum("mej,mevj->mev", left[i + 1 :], corners[i] - rest[:, :, None]).max(axis=2)
        if ((own > tolerance).all(axis=1) & (theirs > tolerance).all(axis=1)).any():
            return True
    return False
