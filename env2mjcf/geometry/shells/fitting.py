"""How thick a cell may be: no other triangle of the surface may reach into it.

Boxes tell which triangles come near which cells; those are cut by the planes of the cell, many at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ...limits import COSTLY, Work
from ..topology import Bools, Floats, Ints
from .cells import Group

_BLOCK = 64
_NUMBERS = 3_000_000  # heights held in memory at once
_ROUNDS = 200


def _overlapping(low: Floats, high: Floats, lows: Floats, highs: Floats, work: Work) -> tuple[Ints, Ints]:
    """Return the index pairs of boxes (g, 3) and other boxes (m, 3) that overlap, ordered by the former.

    Raises:
        TooMuchWorkError: There are more than `work` has left.
    """
    if len(low) == 0 or len(lows) == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    order = np.argsort(_morton((low + high) / 2), kind="stable")
    found: list[Ints] = []
    others: list[Ints] = []
    for i in range(0, len(order), _BLOCK):
        block = order[i : i + _BLOCK]
        # Few of the others come near any box of a block, because its boxes lie together.
        some = np.flatnonzero(((lows <= high[block].max(axis=0)) & (highs >= low[block].min(axis=0))).all(axis=1))
        work.spend(len(lows) // _BLOCK + len(block) * len(some) // _BLOCK)
        meets = np.ones((len(block), len(some)), dtype=np.bool_)
        for axis in range(3):
            meets &= lows[some, axis] <= high[block, axis, None]
            meets &= highs[some, axis] >= low[block, axis, None]
        a, b = np.nonzero(meets)
        work.spend(len(a))
        found.append(block[a])
        others.append(some[b])
    first, second = np.concatenate(found), np.concatenate(others)
    sort = np.lexsort((second, first))
    return first[sort], second[sort]


def _morton(points: Floats) -> Ints:
    """Return positions along a curve that keeps near points together, (n,)."""
    span = np.ptp(points, axis=0)
    cell = ((points - points.min(axis=0)) / np.where(span > 0, span, 1.0) * 1023).astype(np.int64)
    out = np.zeros(len(points), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            out |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    return out


def _clipped(triangles: Floats, planes: Floats) -> tuple[Floats, Ints]:
    """Cut each triangle to the half-spaces `x . plane[:3] + plane[3] >= 0` (Sutherland and Hodgman, 1974).

    Args:
        triangles: (n, 3, 3).
        planes: (n, p, 4).

    Returns:
        Corners (n, k, 3), of which those from the count on are without meaning, and counts (n,): 0 for nothing left.
    """
    points, count = triangles, np.full(len(triangles), 3, dtype=np.int64)
    for i in range(planes.shape[1]):
        height = np.einsum("nkj,nj->nk", points, planes[:, i, :3]) + planes[:, i, 3:]
        used = np.arange(points.shape[1]) < count[:, None]
        if (used & (height < 0)).any():
            points, count = _cut(points, count, height, used)
    return points, count


def _cut(points: Floats, count: Ints, height: Floats, used: Bools) -> tuple[Floats, Ints]:
    size = points.shape[1]
    slot = np.arange(size)
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


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """What may reach into cells.

    Attributes:
        triangles: (m, 3, 3).
        blocking: (m,) number of the solid that a triangle bounds; -1 for a cavity, which blocks every cell.
        kind: (p,) number of the solid that each polygon is of; -1 for cavities, whose cells every triangle blocks.
        margin: Length by which a triangle may reach through a cell's top or bottom without being there.
        work: What may be done to find it out.
    """

    triangles: Floats
    blocking: Ints
    kind: Ints
    margin: float
    work: Work


def fit(group: Group, around: Surroundings) -> None:
    """Lower cells, or tilt their sides, until no triangle is left in them.

    Sides are tilted for the sake of a shallow cell only, because tilted ones catch bodies: where a face slides, those
    of the faces next to it stand on the ground with an edge. Deeper cells keep the sides that they have.

    A cell has its outer face in common with the solid, so that its points near there are inside, and it is convex: a
    path to any other of its points would leave the solid through a face within the cell. So a cell that no face
    reaches lies in the solid.

    Args:
        group: Its slopes, heights and `tilted` are changed.
        around: The surface.
    """
    caps = group.height
    group.height = np.minimum(caps, group.shallow)
    _make_room(group, around, _give_way)
    deep = np.flatnonzero((group.height >= group.shallow) & (caps > group.shallow))
    cells = group.some(deep)
    cells.height = caps[deep]
    _make_room(cells, around, _end_above)
    group.height[deep] = np.maximum(cells.height, group.shallow)


def _make_room(group: Group, around: Surroundings, change: Callable[[Group, Ints, Floats, Floats], None]) -> None:
    """Change cells until no triangle is left in them; those of which one never leaves get the height 0."""
    cell, other = may_meet(group, around)
    for _ in range(_ROUNDS):
        if len(cell) == 0:
            return
        found = [_extent(group, *block) for block in within(group, around, cell, other)]
        cell, other, start, ratio = (np.concatenate(parts) for parts in zip(*found, strict=True))
        if len(cell):
            change(group, cell, start, ratio)
    group.height[np.unique(cell)] = 0.0


def reached(group: Group, around: Surroundings) -> Bools:
    """Tell into which cells any triangle reaches, (g,)."""
    out = np.zeros(len(group), dtype=np.bool_)
    for cell, *_ in within(group, around, *may_meet(group, around)):
        out[cell] = True
    return out


def corners_within(group: Group, around: Surroundings) -> Floats:
    """Return the corners (n, 3), about the cell's centre, of all that reaches into a group of one cell."""
    blocks = within(group, around, *may_meet(group, around))
    return np.concatenate(
        [np.zeros((0, 3)), *(points[np.arange(points.shape[1]) < count[:, None]] for _, _, points, count in blocks)]
    )


def may_meet(group: Group, around: Surroundings) -> tuple[Ints, Ints]:
    """Return the pairs of cells and triangles that may meet and matter."""
    low, high = group.boxes()
    cell, other = _overlapping(low, high, around.triangles.min(axis=1), around.triangles.max(axis=1), around.work)
    kind, blocking = around.kind[group.members][cell], around.blocking[other]
    matters = (kind < 0) | (blocking < 0) | (kind == blocking)
    return cell[matters], other[matters]


def within(group: Group, around: Surroundings, cell: Ints, other: Ints) -> Iterator[tuple[Ints, Ints, Floats, Ints]]:
    """Yield blocks of cells, triangles, and what of each triangle lies in the cell: corners (n, k, 3), counts (n,)."""
    sides = group.corners.shape[1] * (1 if group.bend is None else 2)
    step = max(1, _NUMBERS // (3 * (sides + 2)))
    for i in range(0, len(cell), step):
        c, t = cell[i : i + step], other[i : i + step]
        around.work.spend(COSTLY * len(c))
        local = around.triangles[t] - group.centers[c, None]
        # Most of what is near a cell is the surface around its polygon.
        below = np.flatnonzero(np.einsum("nkj,nj->nk", local, group.normals[c]).min(axis=1) < -around.margin)
        c, t, local = c[below], t[below], local[below]
        planes = group.planes(c, around.margin)
        chosen = np.flatnonzero(~_behind_a_plane(local, planes))
        c, t, local, planes = c[chosen], t[chosen], local[chosen], planes[chosen]
        points, count = _clipped(local, planes)
        chosen = np.flatnonzero(count)
        yield c[chosen], t[chosen], points[chosen], count[chosen]


def _extent(group: Group, c: Ints, t: Ints, points: Floats, count: Ints) -> tuple[Ints, Ints, Floats, Floats]:
    """Return the pairs of cells and triangles, and the extents of their pieces.

    These are the least depth of the piece, and for each side the greatest distance inside of its edge's line per
    unit of depth.
    """
    used = np.arange(points.shape[1]) < count[:, None]
    depth = np.where(used, -np.einsum("nkj,nj->nk", points, group.normals[c]), np.inf)
    inside = np.einsum("nkj,nij->nki", points, group.inward[c]) + group.reach[c, None]
    ratio = np.where(used[:, :, None], inside / depth[:, :, None], 0.0)
    return c, t, depth.min(axis=1, initial=np.inf), ratio.max(axis=1, initial=0.0)


def _behind_a_plane(local: Floats, planes: Floats) -> Bools:
    heights = np.einsum("ncj,npj->npc", local, planes[:, :, :3]) + planes[:, :, 3:]
    return np.asarray((heights.max(axis=2) <= 0).any(axis=1))


def _end_above(group: Group, cell: Ints, start: Floats, ratio: Floats) -> None:
    """Let each cell that has triangles in it end halfway above them."""
    np.minimum.at(group.height, cell, start / 2)


def _give_way(group: Group, cell: Ints, start: Floats, ratio: Floats) -> None:
    """Change each cell that has triangles in it by what its most awkward one asks for.

    Either the cell ends halfway above the piece, or one side leans to halfway past it: whichever leaves more depth
    below the centre.
    """
    limits = np.minimum(group.limits(cell), group.height[cell, None])
    lowered = np.minimum(start / 2, limits.min(axis=1))
    room = np.divide(group.reach[cell], 2 * ratio, out=np.full(ratio.shape, np.inf), where=ratio > 0)
    leaning = np.minimum(room, _least_of_others(limits))
    side = leaning.argmax(axis=1)
    best = np.maximum(lowered, leaning.max(axis=1))
    order = np.lexsort((np.arange(len(cell)), best, cell))
    first = order[np.concatenate([[True], np.diff(cell[order]) > 0])]
    tilt = leaning[first, side[first]] > lowered[first]
    down, over = first[~tilt], first[tilt]
    group.height[cell[down]] = start[down] / 2
    group.slopes[cell[over], side[over]] = 2 * ratio[over, side[over]]
    group.tilted[cell[over]] = True


def _least_of_others(limits: Floats) -> Floats:
    """Return for each column the least of the other columns, (n, k)."""
    two = np.partition(limits, 1, axis=1)[:, :2]
    only = np.arange(limits.shape[1]) == limits.argmin(axis=1)[:, None]
    return np.where(only, two[:, 1:], two[:, :1])
