"""Lips: the edges of cells reach a little under their neighbours, so that no body is caught by the seam between them.

MuJoCo takes two faces that are nearly parallel for one contact, with the normal of the second geom's face. A side that
leans so little from the face that it counts as parallel to what slides over it turns no normal; a steeper one does,
as soon as a body sinks into the seam by less than it has slid over it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..topology import Bools, Floats, Ints
from .cells import Group, corner_speeds
from .corners import cell_corners
from .fitting import Surroundings, may_meet, reached, within
from .pairing import FLAT

_DEPTH = 2e-5
"""Depth of a lip in units of the mesh's diagonal."""

_SHARES = (1.0, 1 / 8, 1 / 64)
"""Parts of that depth that are tried where something of the surface is in the way."""

_TURNS = (0.15, 0.5, 0.85)
"""Where the sides at a corner stand, in parts of its turn."""

_ROUNDS = 60
_ROUNDING = 1e-9


def lipped(
    group: Group, rows: Ints, around: Surroundings, diagonal: float, tolerance: float
) -> Iterator[tuple[int, Floats, float]]:
    """Yield row, corners (n, 3) about the centre, and volume of those cells that have room for lips.

    A lip leans from the edge to its depth; from there the side leads back to where it was at the bottom, so that the
    cell is still convex. It is tested like any other cell: no triangle may reach into it.

    Args:
        group: Fitted cells.
        rows: Those that are looked at.
        around: What may reach into cells.
        diagonal: Of the mesh.
        tolerance: As of `cell_corners`.
    """
    todo = rows[(group.lips < group.slopes)[rows].any(axis=1)]
    for share in _SHARES:
        for rounded in (False, True):
            if len(todo) == 0:
                return
            cells = _bent(group, todo, share * _DEPTH * diagonal, rounded)
            free = _make_way(cells, around) if rounded else np.ones(len(todo), dtype=np.bool_)
            free[free] = ~reached(cells.some(free), around)
            corners = cell_corners(cells.some(free), tolerance)
            left = np.ones(len(todo), dtype=np.bool_)
            for i, row in enumerate(np.flatnonzero(free).tolist()):
                if not corners.spoiled[i]:
                    left[row] = False
                    yield int(todo[row]), corners.points[i][corners.used[i]], float(corners.volumes[i])
            todo = todo[left]


def _bent(group: Group, rows: Ints, depth: float, rounded: bool) -> Group:
    """Return cells with lips down to a depth; with sides at the corners, too, if they are rounded."""
    old = group.some(rows)
    wants = old.lips < old.slopes
    slopes, inward, corners, ends = np.minimum(old.slopes, old.lips), old.inward, old.corners, old.slopes
    if rounded:
        speeds = corner_speeds(old.slopes, old.inward, old.normals)
        sides = _corner_sides(old)
        end = np.einsum("gktj,gkj->gkt", sides, speeds)
        near = (wants | np.roll(wants, 1, axis=1))[:, :, None]
        flat = np.where(near, np.minimum(FLAT, end), end)
        g, k = slopes.shape
        slopes = np.concatenate([flat, slopes[:, :, None]], axis=2).reshape(g, -1)
        ends = np.concatenate([end, ends[:, :, None]], axis=2).reshape(g, -1)
        inward = np.concatenate([sides, inward[:, :, None]], axis=2).reshape(g, -1, 3)
        corners = np.repeat(corners, len(_TURNS) + 1, axis=1)
    bend = np.minimum(depth, old.height / 2)
    out = replace(
        old,
        corners=corners,
        inward=inward,
        reach=-np.einsum("gkj,gkj->gk", inward, corners),
        slopes=slopes,
        lips=ends,
        bend=bend,
    )
    out.walls = _walls(out)
    return out


def _walls(cells: Group) -> Floats:
    """Return how sides recede below the bend to be at the bottom where those without lips would be, (g, k)."""
    assert cells.bend is not None
    bend, height = cells.bend[:, None], cells.height[:, None]
    walls = (cells.lips * height - cells.slopes * bend) / (height - bend)
    return np.where(cells.slopes < cells.lips, walls, cells.lips)


def _corner_sides(group: Group) -> Floats:
    """Return the inward vectors of sides at the corners, (g, k, t, 3), in turn from the edge before to the one after."""
    after = group.inward
    before, normal = np.roll(after, 1, axis=1), group.normals[:, None]
    sine = np.einsum("gkj,gkj->gk", np.cross(before, after), np.broadcast_to(normal, after.shape))
    turn = np.arctan2(sine, np.einsum("gkj,gkj->gk", before, after))[:, :, None] * _TURNS
    return before[:, :, None] * np.cos(turn)[..., None] + np.cross(normal, before)[:, :, None] * np.sin(turn)[..., None]


def _make_way(cells: Group, around: Surroundings) -> Bools:
    """Steepen lips until no triangle is left in them, those of corners first; tell of which cells none is, (g,)."""
    assert cells.bend is not None
    lips = replace(cells, height=cells.bend, bend=None, walls=None)
    cell, other = may_meet(lips, around)
    of_corner = np.arange(lips.slopes.shape[1]) % (len(_TURNS) + 1) < len(_TURNS)
    for _ in range(_ROUNDS):
        if len(cell) == 0:
            break
        found = [_asked(lips, cells.lips, of_corner, *block) for block in within(lips, around, cell, other)]
        cell, other, side, slope = (np.concatenate(parts) for parts in zip(*found, strict=True))
        if len(cell) == 0:
            break
        order = np.lexsort((-slope, cell))
        first = order[np.concatenate([[True], np.diff(cell[order]) > 0])]
        able = first[np.isfinite(slope[first])]
        lips.slopes[cell[able], side[able]] = slope[able]
        lost = np.isin(cell, cell[first[~np.isfinite(slope[first])]])
        lips.height[cell[lost]] = 0.0
        cell, other = cell[~lost], other[~lost]
    free = lips.height > 0
    free[cell] = False
    cells.slopes = lips.slopes
    cells.walls = _walls(cells)
    return free


def _asked(
    lips: Group, most: Floats, of_corner: Bools, c: Ints, t: Ints, points: Floats, count: Ints
) -> tuple[Ints, Ints, Ints, Floats]:
    """Return cells, triangles, and which side must recede how much to leave each piece out; infinite if none can.

    No side recedes more than it may at `most`, (g, k).
    """
    used = np.arange(points.shape[1]) < count[:, None]
    depth = np.where(used, -np.einsum("nkj,nj->nk", points, lips.normals[c]), 1.0)
    inside = np.einsum("nkj,nij->nki", points, lips.inward[c]) + lips.reach[c, None]
    slope = np.where(used[:, :, None], inside / depth[:, :, None], -np.inf).max(axis=1)
    slope += 1e-6 * np.abs(slope) + _ROUNDING
    slope[(slope > most[c]) | (slope <= lips.slopes[c])] = np.inf
    corner = np.where(of_corner, slope, np.inf)
    slope = np.where(np.isfinite(corner).any(axis=1)[:, None], corner, slope)
    side = slope.argmin(axis=1)
    return c, t, side, slope[np.arange(len(c)), side]
