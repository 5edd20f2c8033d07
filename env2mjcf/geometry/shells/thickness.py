"""How thick a cell may be: no other triangle of the surface may reach into it."""

from __future__ import annotations

import numpy as np

from ..topology import Bools, Floats, Ints
from .clipping import clipped
from .neighbours import near
from .walls import Group

_NUMBERS = 3_000_000  # heights held in memory at once
_ROUNDS = 200


def fit(group: Group, triangles: Floats, blocking: Ints, kind: Ints, margin: float) -> None:
    """Lower cells, or tilt their sides, until no triangle is left in them.

    All sides lean inward or go straight down, so a point of a cell can leave the solid only through a face within
    the cell: a cell that no face reaches lies in the solid.

    Args:
        group: Its slopes, heights and `tilted` are changed.
        triangles: (m, 3, 3).
        blocking: (m,) number of the solid that a triangle bounds; -1 for a cavity, which blocks every cell.
        kind: (g,) number of the solid that each cell is of; -1 for cells of a cavity, which every triangle blocks.
        margin: Length by which a triangle may reach through a cell's top or bottom without being there.
    """
    low, high = group.boxes()
    cell, other = near(low, high, triangles.min(axis=1), triangles.max(axis=1))
    matters = (kind[cell] < 0) | (blocking[other] < 0) | (kind[cell] == blocking[other])
    cell, other = cell[matters], other[matters]
    for _ in range(_ROUNDS):
        if len(cell) == 0:
            return
        cell, other, start, ratio = _left_over(group, triangles, cell, other, margin)
        if len(cell):
            _give_way(group, cell, start, ratio)
    group.height[np.unique(cell)] = 0.0


def _left_over(
    group: Group, triangles: Floats, cell: Ints, other: Ints, margin: float
) -> tuple[Ints, Ints, Floats, Floats]:
    """Return the pairs of which a piece of the triangle lies in the cell.

    With them the least depth of the piece, and for each side the greatest distance inside of its edge's line per
    unit of depth.
    """
    corners = group.corners.shape[1]
    step = max(1, _NUMBERS // (3 * (corners + 2)))
    out: list[tuple[Ints, Ints, Floats, Floats]] = []
    for i in range(0, len(cell), step):
        c, t = cell[i : i + step], other[i : i + step]
        local = triangles[t] - group.centers[c, None]
        planes = group.planes(c, margin)
        chosen = np.flatnonzero(~_behind_a_plane(local, planes))
        c, t, local, planes = c[chosen], t[chosen], local[chosen], planes[chosen]
        points, count = clipped(local, planes)
        chosen = np.flatnonzero(count)
        c, t, points, count = c[chosen], t[chosen], points[chosen], count[chosen]
        used = np.arange(points.shape[1]) < count[:, None]
        depth = np.where(used, -np.einsum("nkj,nj->nk", points, group.normals[c]), np.inf)
        inside = np.einsum("nkj,nij->nki", points, group.inward[c]) + group.reach[c, None]
        ratio = np.where(used[:, :, None], inside / depth[:, :, None], 0.0)
        out.append((c, t, depth.min(axis=1, initial=np.inf), ratio.max(axis=1, initial=0.0)))
    joined = [np.concatenate(parts) for parts in zip(*out, strict=True)]
    return joined[0], joined[1], joined[2], joined[3]


def _behind_a_plane(local: Floats, planes: Floats) -> Bools:
    heights = np.einsum("ncj,npj->npc", local, planes[:, :, :3]) + planes[:, :, 3:]
    return np.asarray((heights.max(axis=2) <= 0).any(axis=1))


def _give_way(group: Group, cell: Ints, start: Floats, ratio: Floats) -> None:
    """Change each cell that has triangles in it by what its most awkward one asks for.

    Either the cell ends halfway above the piece, or one side leans to halfway past it: whichever leaves more depth
    below the centre.
    """
    reach, slopes = group.reach[cell], group.slopes[cell]
    limits = np.divide(reach, slopes, out=np.full(slopes.shape, np.inf), where=slopes > 0)
    limits = np.minimum(limits, group.height[cell, None])
    lowered = np.minimum(start / 2, limits.min(axis=1))
    leaning = np.minimum(reach / (2 * ratio), _least_of_others(limits))
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
