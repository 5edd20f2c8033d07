"""Limits of joints, and whether links stay within the boundary: every vertex, closed, missing axes unbounded."""

from __future__ import annotations

from typing import Any

from ..tables import BoundaryKind
from .compiling import compiled
from .opening import Room, Tables

_NONE, _BOX = int(BoundaryKind.NONE), int(BoundaryKind.BOX)
_STEP, _SHAPE, _FIRST, _LAST = 0, 1, 3, 4

# Boxes hold their meshes but for rounding; vertices are looked at where a box is nearer to the boundary than this part
# of its size.
_SLACK = 1e-6


@compiled
def within_limits(tables: Tables, q: Any) -> bool:
    """Return whether a configuration, (dim,), keeps the limits of its joints."""
    for i in range(len(q)):
        if q[i] < tables.limits[i, 0] or q[i] > tables.limits[i, 1]:
            return False
    return True


@compiled
def within_boundary(tables: Tables, room: Room) -> bool:
    """Return whether every vertex of every link is within the boundary."""
    kind = tables.counts[0, 0]
    if kind == _NONE:
        return True
    for link in range(len(tables.links)):
        pose = room.frames[tables.links[link, _STEP]]
        if kind == _BOX:
            if not (_box_within(tables, pose, room.spans[link]) or _vertices_within(tables, link, pose)):
                return False
        elif not _vertices_within_ball(tables, link, pose):
            return False
    return True


@compiled
def _box_within(tables: Tables, pose: Any, span: Any) -> bool:
    for k in range(3):
        reach = span[k] * (1 + _SLACK)
        if pose[4 * k + 3] - reach < tables.boundary[0, k] or pose[4 * k + 3] + reach > tables.boundary[1, k]:
            return False
    return True


@compiled
def _vertices_within(tables: Tables, link: int, pose: Any) -> bool:
    for i in range(tables.links[link, _FIRST], tables.links[link, _LAST]):
        v = tables.vertices[i]
        for k in range(3):
            x = pose[4 * k] * v[0] + pose[4 * k + 1] * v[1] + pose[4 * k + 2] * v[2] + pose[4 * k + 3]
            if x < tables.boundary[0, k] or x > tables.boundary[1, k]:
                return False
    return True


@compiled
def _vertices_within_ball(tables: Tables, link: int, pose: Any) -> bool:
    center, radius, axes = tables.boundary[0], tables.boundary[1, 0], int(tables.boundary[1, 1])
    for i in range(tables.links[link, _FIRST], tables.links[link, _LAST]):
        v = tables.vertices[i]
        away = 0.0
        for k in range(axes):
            x = pose[4 * k] * v[0] + pose[4 * k + 1] * v[1] + pose[4 * k + 2] * v[2] + pose[4 * k + 3] - center[k]
            away += x * x
        if away > radius * radius:
            return False
    return True
