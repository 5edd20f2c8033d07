"""What Python calls: each entry takes the tables, and rows, and fills an answer for each row.

Limits of joints and the boundary are tested here, too: every vertex of a link, the boundary itself belongs to it, and
axes that it does not have are unbounded.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..tables import FIRST_VERTEX, LAST_VERTEX, STEP, BoundaryKind, Tables
from .compiling import SOURCES, Room, compiled, entry, opened, room, room_for_verdicts
from .distances import least_distance
from .edge_proofs import LEVELS, edge_collides, edge_is_free
from .poses import place
from .touching import collides, measure

Entry = Callable[..., None]

# Farther than anything that is near, and nearer than the boxes of unused lanes.
_FAR = 1e100
# Boxes hold their meshes but for rounding; vertices are looked at where a box is nearer to the boundary than this part
# of its size.
_SLACK = 1e-6

_NONE, _BOX = int(BoundaryKind.NONE), int(BoundaryKind.BOX)


@compiled
def _collisions(tables: Tables, room: Room, q: Any, out: Any) -> None:
    for i in range(len(q)):
        place(tables, q[i], room.frames)
        measure(tables, room)
        out[i] = collides(tables, room)


@compiled
def _validities(tables: Tables, room: Room, q: Any, out: Any) -> None:
    for i in range(len(q)):
        out[i] = within_limits(tables, q[i])
        if out[i]:
            place(tables, q[i], room.frames)
            measure(tables, room)
            out[i] = within_boundary(tables, room) and not collides(tables, room)


@compiled
def _distances(tables: Tables, room: Room, q: Any, out: Any) -> None:
    for i in range(len(q)):
        place(tables, q[i], room.frames)
        measure(tables, room)
        out[i] = -1.0
        if not collides(tables, room):
            distance = least_distance(tables, room, _FAR)
            out[i] = distance if distance < _FAR else np.inf


@compiled
def _edges_collide(tables: Tables, room: Room, start: Any, delta: Any, steps: Any, out: Any) -> None:
    for i in range(len(start)):
        out[i] = edge_collides(tables, room, start[i], delta[i], steps[i])


@compiled
def _edges_are_free(
    tables: Tables, room: Room, start: Any, delta: Any, speeds: Any, drifts: Any, turns: Any, pair_speeds: Any,
    band: float, stretches: Any, runs: Any, pending: Any, out: Any,
) -> None:  # fmt: skip
    for i in range(len(start)):
        a, d = start[i], delta[i]
        out[i] = edge_is_free(
            tables, room, a, d, speeds[i], drifts[i], turns[i], pair_speeds[i], band, stretches, runs, pending
        )


def _entries(sources: int) -> tuple[Entry, Entry, Entry, Entry, Entry]:
    @entry
    def collisions(integers: Any, floats: Any, q: Any, out: Any) -> None:
        _ = sources
        tables = opened(integers, floats)
        _collisions(tables, room_for_verdicts(tables), q, out)

    @entry
    def validities(integers: Any, floats: Any, q: Any, out: Any) -> None:
        _ = sources
        tables = opened(integers, floats)
        _validities(tables, room_for_verdicts(tables), q, out)

    @entry
    def distances(integers: Any, floats: Any, q: Any, out: Any) -> None:
        _ = sources
        tables = opened(integers, floats)
        _distances(tables, room(tables), q, out)

    @entry
    def edges_collide(integers: Any, floats: Any, start: Any, delta: Any, steps: Any, out: Any) -> None:
        _ = sources
        tables = opened(integers, floats)
        _edges_collide(tables, room(tables), start, delta, steps, out)

    @entry
    def edges_are_free(
        integers: Any, floats: Any, start: Any, delta: Any, speeds: Any, drifts: Any, turns: Any, pair_speeds: Any,
        band: float, out: Any,
    ) -> None:  # fmt: skip
        _ = sources
        tables = opened(integers, floats)
        stretches, runs = np.empty((2 * LEVELS, 2)), np.empty((2 * LEVELS, 2), dtype=np.int64)
        # As many lists as levels, each of all pairs at the most.
        pending = np.empty((LEVELS + 1) * (len(tables.links) * len(tables.obstacles) + len(tables.pairs)), np.int64)
        _edges_are_free(
            tables, room(tables), start, delta, speeds, drifts, turns, pair_speeds, band, stretches, runs, pending, out
        )

    return collisions, validities, distances, edges_collide, edges_are_free


collisions, validities, distances, edges_collide, edges_are_free = _entries(SOURCES)


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
        pose = room.frames[tables.links[link, STEP]]
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
    for i in range(tables.links[link, FIRST_VERTEX], tables.links[link, LAST_VERTEX]):
        v = tables.vertices[i]
        for k in range(3):
            x = pose[4 * k] * v[0] + pose[4 * k + 1] * v[1] + pose[4 * k + 2] * v[2] + pose[4 * k + 3]
            if x < tables.boundary[0, k] or x > tables.boundary[1, k]:
                return False
    return True


@compiled
def _vertices_within_ball(tables: Tables, link: int, pose: Any) -> bool:
    center, radius, axes = tables.boundary[0], tables.boundary[1, 0], int(tables.boundary[1, 1])
    for i in range(tables.links[link, FIRST_VERTEX], tables.links[link, LAST_VERTEX]):
        v = tables.vertices[i]
        away = 0.0
        for k in range(axes):
            x = pose[4 * k] * v[0] + pose[4 * k + 1] * v[1] + pose[4 * k + 2] * v[2] + pose[4 * k + 3] - center[k]
            away += x * x
        if away > radius * radius:
            return False
    return True
