"""What Python calls: each entry takes the tables, and rows, and fills an answer for each row."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .clearances import least_distance
from .collisions import collides, measure
from .compiling import SOURCES, compiled, entry
from .edges import edge_collides
from .frames import place
from .opening import Room, Tables, opened, room, room_for_verdicts
from .proofs import LEVELS, edge_is_free
from .validity import within_boundary, within_limits

Entry = Callable[..., None]

# Farther than anything that is near, and nearer than the boxes of unused lanes.
_FAR = 1e100


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
        out[i] = edge_is_free(
            tables, room, start[i], delta[i], speeds[i], drifts[i], turns[i], pair_speeds[i],
            band, stretches, runs, pending,
        )  # fmt: skip


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
