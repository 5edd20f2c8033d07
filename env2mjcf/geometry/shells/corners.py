"""The corners of cells: the polygons shrink, or grow, with depth, and lose edges on the way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..topology import Bools, Floats, Ints
from .cells import Group, corner_speed, corner_speeds

_NUMBERS = 3_000_000  # distances between corners held in memory at once

# An edge keeps its length if that changes by less than this per unit of depth, and vanishes at the floor if it does so
# within this part of its depth.
_STEADY, _AT_ONCE = 1e-12, 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """Corners of g cells, about the cells' centres.

    Attributes:
        points: (g, c, 3); the first k are the polygon's own.
        used: (g, c) which of them count.
        depths: (g,) of the deepest one.
        volumes: (g,).
        spoiled: (g,) cells of which rounding spoils a corner.
    """

    points: Floats
    used: Bools
    depths: Floats
    volumes: Floats
    spoiled: Bools


def cell_corners(group: Group, tolerance: float) -> Corners:
    """Find the corners of all cells.

    A spoiled cell without bends becomes a frustum between its polygon and a smaller copy of that.

    Args:
        group: The cells.
        tolerance: Length by which a corner may lie outside of its cell's planes.
    """
    shrinking = _Shrinking(group)
    if group.bend is not None and group.walls is not None:
        shrinking.run(group.bend)
        shrinking.turn(group.walls)
    shrinking.run(group.height)
    points, used = shrinking.points()
    planes = group.planes(np.arange(len(group)), 0.0)
    with np.errstate(invalid="ignore"):
        heights = np.einsum("gcj,gpj->gcp", points, planes[:, :, :3]) + planes[:, None, :, 3]
    spoiled = np.asarray((~(heights >= -tolerance).all(axis=2) & used).any(axis=1))
    depths = np.where(used, -np.einsum("gcj,gj->gc", np.nan_to_num(points), group.normals), 0.0).max(axis=1)
    volumes = shrinking.volumes
    if group.bend is not None:
        used &= ~_repeated(points, used, tolerance)
    elif spoiled.any():
        _replace_by_frustums(group, spoiled, points, used, depths, volumes)
    return Corners(points, used, depths, volumes, spoiled)


def _repeated(points: Floats, used: Bools, tolerance: float) -> Bools:
    """Tell which points (g, c, 3) lie at an earlier one that is used, (g, c)."""
    out = np.zeros(used.shape, dtype=np.bool_)
    earlier = np.tri(used.shape[1], k=-1, dtype=np.bool_)
    step = max(1, _NUMBERS // (3 * used.shape[1] ** 2))
    for i in range(0, len(points), step):
        some = points[i : i + step]
        near = (np.abs(some[:, :, None] - some[:, None]) <= tolerance).all(axis=3)
        out[i : i + step] = (near & earlier & used[i : i + step, None]).any(axis=2)
    return out


class _Shrinking:
    """The polygons at the depth of their next events; each corner moves along a line, `at + depth * speed`."""

    def __init__(self, group: Group) -> None:
        g, k = group.slopes.shape
        self._group = group
        self._slopes = group.slopes
        self._rows = np.arange(g)
        self._along = np.cross(group.inward, group.normals[:, None])
        self._before = np.tile(np.roll(np.arange(k), 1), (g, 1))
        self._after = np.tile(np.roll(np.arange(k), -1), (g, 1))
        self._left = np.ones((g, k), dtype=np.bool_)
        self._at = group.corners.copy()
        self._speed = corner_speeds(group.slopes, group.inward, group.normals)
        self._depth, self._floor = np.zeros(g), np.zeros(g)
        self._busy = np.zeros(g, dtype=np.bool_)
        self._ended = np.zeros(g, dtype=np.bool_)
        self._events: list[Floats] = []
        self._happened: list[Bools] = []
        self.volumes = np.zeros(g)

    def run(self, floor: Floats) -> None:
        """Move every polygon down to a depth, (g,)."""
        self._floor = floor
        self._busy = (floor > self._depth) & ~self._ended
        while self._step():
            pass

    def turn(self, slopes: Floats) -> None:
        """Let the sides recede by other slopes (g, k) from here on; corners between those that do become points."""
        bends = slopes != self._slopes
        here = self._at + self._speed * self._depth[:, None, None]
        self._events.append(here - (self._group.normals * self._depth[:, None])[:, None])
        turns = bends | np.take_along_axis(bends, self._before, axis=1)
        self._happened.append(self._left & ~self._ended[:, None] & turns)
        self._slopes = slopes
        inward, normals = self._group.inward, self._group.normals[:, None]
        before = np.take_along_axis(slopes, self._before, axis=1)
        speed = corner_speed(
            before, slopes, _take(inward, self._before), inward, np.broadcast_to(normals, inward.shape)
        )
        self._speed = np.where(self._left[:, :, None], speed, 0.0)
        self._at = here - self._speed * self._depth[:, None, None]

    def _step(self) -> bool:
        """Move every polygon on to its next event: an edge that vanishes, or the floor."""
        rows = self._rows[self._busy]
        if len(rows) == 0:
            return False
        after = self._after[rows]
        side = self._along[rows]
        length = np.einsum("gkj,gkj->gk", _take(self._at[rows], after) - self._at[rows], side)
        rate = np.einsum("gkj,gkj->gk", _take(self._speed[rows], after) - self._speed[rows], side)
        shrinks = self._left[rows] & (rate < -_STEADY)
        end = np.divide(length, -rate, out=np.full(rate.shape, np.inf), where=shrinks)
        end = np.maximum(end, self._depth[rows, None])
        edge = end.argmin(axis=1)
        depth = end[np.arange(len(rows)), edge]
        floor = self._floor[rows]
        self._sweep(rows, np.minimum(depth, floor))
        vanishes = depth < (1 - _AT_ONCE) * floor
        self._busy[rows[~vanishes]] = False
        self._vanish(rows[vanishes], edge[vanishes], depth[vanishes])
        return True

    def points(self) -> tuple[Floats, Bools]:
        """Return all corners (g, c, 3) and which of them count (g, c)."""
        group = self._group
        bottom = self._at + group.height[:, None, None] * (self._speed - group.normals[:, None])
        stays = self._left & ~self._ended[:, None]
        parts = [group.corners, *self._events, bottom]
        used = [np.ones(stays.shape, dtype=np.bool_), *self._happened, stays]
        return np.concatenate(parts, axis=1), np.concatenate(used, axis=1)

    def _vanish(self, rows: Ints, edge: Ints, depth: Floats) -> None:
        event, happened = np.zeros((len(self._rows), 3)), np.zeros(len(self._rows), dtype=np.bool_)
        flat = self._at[rows, edge] + self._speed[rows, edge] * depth[:, None]
        event[rows] = flat - self._group.normals[rows] * depth[:, None]
        happened[rows] = True
        self._events.append(event[:, None])
        self._happened.append(happened[:, None])
        before, after = self._before[rows, edge], self._after[rows, edge]
        self._left[rows, edge] = False
        self._after[rows, before], self._before[rows, after] = after, before
        self._speed[rows, after] = self._meeting(rows, before, after)
        self._at[rows, after] = flat - self._speed[rows, after] * depth[:, None]
        over = self._left[rows].sum(axis=1) < 3
        self._busy[rows[over]] = False
        self._ended[rows[over]] = True

    def _meeting(self, rows: Ints, first: Ints, second: Ints) -> Floats:
        """Return how the corner between two edges moves per unit of depth, (r, 3)."""
        slopes, inward, normals = self._slopes, self._group.inward, self._group.normals[rows]
        return corner_speed(
            slopes[rows, first], slopes[rows, second], inward[rows, first], inward[rows, second], normals
        )

    def _sweep(self, rows: Ints, depth: Floats) -> None:
        """Add the volume between the last depth and this one; areas are quadratic in depth, so Simpson is exact."""
        start = self._depth[rows]
        areas = [self._area(rows, start + f * (depth - start)) for f in (0.0, 0.5, 1.0)]
        self.volumes[rows] += (depth - start) * (areas[0] + 4 * areas[1] + areas[2]) / 6
        self._depth[rows] = depth

    def _area(self, rows: Ints, depth: Floats) -> Floats:
        here = self._at[rows] + self._speed[rows] * depth[:, None, None]
        turned = np.where(self._left[rows][:, :, None], np.cross(here, _take(here, self._after[rows])), 0.0)
        return np.einsum("gkj,gj->g", turned, self._group.normals[rows]) / 2


def _take(points: Floats, index: Ints) -> Floats:
    return np.take_along_axis(points, index[:, :, None], axis=1)


def _replace_by_frustums(
    group: Group, spoiled: Bools, points: Floats, used: Bools, depths: Floats, volumes: Floats
) -> None:
    k = group.corners.shape[1]
    rows = np.flatnonzero(spoiled)
    limit = group.limits(rows).min(axis=1)
    depth = np.minimum(group.height[rows], limit / 2)
    scale = 1 - np.divide(depth, limit, out=np.ones_like(limit), where=limit > 0)
    top = group.corners[rows]
    points[rows], used[rows] = 0.0, False
    points[rows, :k] = top
    points[rows, k : 2 * k] = top * scale[:, None, None] - (group.normals[rows] * depth[:, None])[:, None]
    used[rows, : 2 * k] = True
    depths[rows] = depth
    area = np.einsum("gkj,gj->g", np.cross(top, np.roll(top, -1, axis=1)), group.normals[rows]) / 2
    volumes[rows] = area * depth * (1 + scale + scale**2) / 3
