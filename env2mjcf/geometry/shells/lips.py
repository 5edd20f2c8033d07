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

_DEPTHS = (1e-4, 2e-5, 2.5e-6)
"""Depths of lips in units of the mesh's diagonal: the next one is tried where something of the surface is in the way.

A body that leans forward in friction sinks into the seam further than its weight alone presses it: beyond lips of 2e-5.
"""

_TURNS = (0.15, 0.5, 0.85)
"""Where the sides at a corner stand, in parts of its turn."""

_ROUNDS = 60
_ROUNDING = 1e-9

_NOTHING = 0.01
"""Length that counts as none, in units of the margin."""


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
    for depth in _DEPTHS:
        for rounded in (False, True):
            if len(todo) == 0:
                return
            cells = _bent(group, todo, depth * diagonal, rounded)
            free = _make_way(cells, around) if rounded else ~reached(cells, around)
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
        g = len(slopes)
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
    """Return the inward vectors of sides at the corners, (g, k, t, 3), from the edge before to the one after."""
    after = group.inward
    before, normal = np.roll(after, 1, axis=1), group.normals[:, None]
    sine = np.einsum("gkj,gkj->gk", np.cross(before, after), np.broadcast_to(normal, after.shape))
    turn = np.arctan2(sine, np.einsum("gkj,gkj->gk", before, after))[:, :, None] * _TURNS
    return before[:, :, None] * np.cos(turn)[..., None] + np.cross(normal, before)[:, :, None] * np.sin(turn)[..., None]


def _make_way(cells: Group, around: Surroundings) -> Bools:
    """Steepen lips until no triangle is left in the cells, those of corners first; tell in which none is, (g,)."""
    cell, other = may_meet(cells, around)
    lost = np.zeros(len(cells), dtype=np.bool_)
    for _ in range(_ROUNDS):
        if len(cell) == 0:
            break
        found = [_asked(cells, around, *block) for block in within(cells, around, cell, other)]
        cell, other, side, slope = (np.concatenate(parts) for parts in zip(*found, strict=True))
        order = np.lexsort((-slope, cell))
        first = order[np.concatenate([[True], np.diff(cell[order]) > 0])[: len(order)]]
        able = np.isfinite(slope[first])
        lost[cell[first[~able]]] = True
        cells.slopes[cell[first[able]], side[first[able]]] = slope[first[able]]
        cells.walls = _walls(cells)
        stays = ~lost[cell]
        cell, other = cell[stays], other[stays]
    lost[cell] = True
    return ~lost


def _asked(
    cells: Group, around: Surroundings, c: Ints, t: Ints, points: Floats, count: Ints
) -> tuple[Ints, Ints, Ints, Floats]:
    """Return cells, triangles, and which lip must lean how much to leave each piece out; infinite if none can."""
    assert cells.bend is not None
    used = (np.arange(points.shape[1]) < count[:, None])[:, :, None]
    depth = -np.einsum("nkj,nj->nk", points, cells.normals[c])[:, :, None]
    inside = np.einsum("nkj,nij->nki", points, cells.inward[c]) + cells.reach[c, None]
    bend, height, most = cells.bend[c, None, None], cells.height[c, None, None], cells.lips[c]
    # All of a piece must be beyond one plane of the side: that above its bend, or that below.
    share = (depth - bend) / (height - bend)
    asked: list[Floats] = []
    for over, per_slope in ((inside, depth), (inside - share * height * most[:, None], (1 - share) * bend)):
        over[np.abs(over) <= _NOTHING * around.margin] = 0.0
        needed = np.divide(over, per_slope, out=np.zeros_like(over), where=over != 0)
        asked.append(np.where(used, needed, -np.inf).max(axis=1))
    slope: Floats = np.minimum(asked[0], asked[1])
    slope += 1e-6 * np.abs(slope) + _ROUNDING
    slope = np.where(slope <= most + 2 * _ROUNDING, np.minimum(slope, most), np.inf)
    slope[slope <= cells.slopes[c]] = np.inf
    of_corner = np.arange(slope.shape[1]) % (len(_TURNS) + 1) < len(_TURNS)
    at_corner = np.where(of_corner, slope, np.inf)
    slope = np.where(np.isfinite(at_corner).any(axis=1, keepdims=True), at_corner, slope)
    side = slope.argmin(axis=1)
    return c, t, side, slope[np.arange(len(c)), side]
