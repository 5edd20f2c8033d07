"""What Python calls: each entry takes the tables, and rows, and fills an answer for each row.

Limits of joints and the boundary are tested here, too: every vertex of a link, the boundary itself belongs to it, and
axes that it does not have are unbounded.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..tables import FIRST_VERTEX, LAST_VERTEX, STEP, BoundaryKind, Tables
from .compiling import SOURCES, Room, compiled, entry, floats_of_room, integers_of_room, room_in
from .distances import least_distance
from .edge_proofs import LEVELS, edge_collides, edge_is_free
from .pointers import grid, opened, row
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
def _collisions(tables: Tables, floats: Any, integers: Any, q: Any, out: Any) -> None:
    room, dim = room_in(tables, floats, integers), len(tables.limits)
    for i in range(len(q)):
        place(tables, row(q, i * dim), room.frames)
        measure(tables, room)
        out[i] = collides(tables, room)


@compiled
def _validities(tables: Tables, floats: Any, integers: Any, q: Any, out: Any) -> None:
    room, dim = room_in(tables, floats, integers), len(tables.limits)
    for i in range(len(q)):
        at = row(q, i * dim)
        out[i] = within_limits(tables, at)
        if out[i]:
            place(tables, at, room.frames)
            measure(tables, room)
            out[i] = within_boundary(tables, room) and not collides(tables, room)


@compiled
def _distances(tables: Tables, floats: Any, integers: Any, q: Any, out: Any) -> None:
    room, dim = room_in(tables, floats, integers), len(tables.limits)
    for i in range(len(q)):
        place(tables, row(q, i * dim), room.frames)
        measure(tables, room)
        out[i] = -1.0
        if not collides(tables, room):
            distance = least_distance(tables, room, _FAR)
            out[i] = distance if distance < _FAR else np.inf


@compiled
def _edges_collide(tables: Tables, floats: Any, integers: Any, start: Any, delta: Any, steps: Any, out: Any) -> None:
    room, dim = room_in(tables, floats, integers), len(tables.limits)
    for i in range(len(start)):
        out[i] = edge_collides(tables, room, row(start, i * dim), row(delta, i * dim), steps[i])


@compiled
def _edges_are_free(
    tables: Tables, floats: Any, integers: Any, start: Any, delta: Any, speeds: Any, drifts: Any, turns: Any,
    pair_speeds: Any, band: float, stretches: Any, runs: Any, pending: Any, out: Any,
) -> None:  # fmt: skip
    room, dim = room_in(tables, floats, integers), len(tables.limits)
    links, pairs = len(tables.links), len(tables.pairs)
    for i in range(len(start)):
        out[i] = edge_is_free(
            tables, room, row(start, i * dim), row(delta, i * dim),
            row(speeds, i * links), grid(drifts, i * 3 * links, links, 3), row(turns, i * links),
            row(pair_speeds, i * pairs), band,
            grid(stretches, 0, 2 * LEVELS, 2), grid(runs, 0, 2 * LEVELS, 2), row(pending, 0),
        )  # fmt: skip


def _entries(sources: int) -> tuple[Entry, Entry, Entry, Entry, Entry]:
    # Each makes its room itself: what is behind a pointer must be an argument where it is used.
    @entry
    def collisions(integers: Any, floats: Any, q: Any, out: Any) -> None:
        _ = sources
        tables = opened(integers, floats)
        f, i = np.empty(floats_of_room(tables)), np.empty(integers_of_room(tables), np.int64)
        _collisions(tables, f, i, q, out)

    @entry
    def validities(integers: Any, floats: Any, q: Any, out: Any) -> None:
        _ = sources
        tables = opened(integers, floats)
        f, i = np.empty(floats_of_room(tables)), np.empty(integers_of_room(tables), np.int64)
        _validities(tables, f, i, q, out)

    @entry
    def distances(integers: Any, floats: Any, q: Any, out: Any) -> None:
        _ = sources
        tables = opened(integers, floats)
        f, i = np.empty(floats_of_room(tables) + tables.counts[0, 2]), np.empty(integers_of_room(tables), np.int64)
        _distances(tables, f, i, q, out)

    @entry
    def edges_collide(integers: Any, floats: Any, start: Any, delta: Any, steps: Any, out: Any) -> None:
        _ = sources
        tables = opened(integers, floats)
        f, i = np.empty(floats_of_room(tables)), np.empty(integers_of_room(tables), np.int64)
        _edges_collide(tables, f, i, start, delta, steps, out)

    @entry
    def edges_are_free(
        integers: Any, floats: Any, start: Any, delta: Any, speeds: Any, drifts: Any, turns: Any, pair_speeds: Any,
        band: float, out: Any,
    ) -> None:  # fmt: skip
        _ = sources
        tables = opened(integers, floats)
        f, i = np.empty(floats_of_room(tables) + tables.counts[0, 2]), np.empty(integers_of_room(tables), np.int64)
        stretches, runs = np.empty(4 * LEVELS), np.empty(4 * LEVELS, dtype=np.int64)
        # As many lists as levels, each of all pairs at the most.
        pending = np.empty((LEVELS + 1) * (len(tables.links) * len(tables.obstacles) + len(tables.pairs)), np.int64)
        _edges_are_free(
            tables, f, i, start, delta, speeds, drifts, turns, pair_speeds, band, stretches, runs, pending, out
        )

    return collisions, validities, distances, edges_collide, edges_are_free


collisions, validities, distances, edges_collide, edges_are_free = _entries(SOURCES)


@compiled
def within_limits(tables: Tables, q: Any) -> bool:
    """Return whether a configuration, (dim,), keeps the limits of its joints."""
    for i in range(len(tables.limits)):
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
