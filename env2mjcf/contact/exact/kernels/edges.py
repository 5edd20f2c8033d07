"""Straight ways between configurations, looked at step by step."""

from __future__ import annotations

from typing import Any

from .collisions import collides, measure
from .compiling import compiled
from .frames import place
from .opening import Room, Tables


@compiled
def edge_collides(tables: Tables, room: Room, start: Any, delta: Any, steps: int) -> bool:
    """Return whether anything touches at one of the steps, both ends included, from the coarse to the fine.

    Args:
        tables: The scene.
        room: To work in.
        start, delta: (dim,) where the way begins, and where it leads from there.
        steps: Number of configurations, at least 2, evenly spaced.
    """
    last = steps - 1
    if collides_at(tables, room, start, delta, 0.0):
        return True
    if collides_at(tables, room, start, delta, 1.0):
        return True
    stride = 1
    while 2 * stride < last:
        stride *= 2
    # All odd multiples of a stride, then of its half: each step once.
    while stride > 0:
        for i in range(stride, last, 2 * stride):
            if collides_at(tables, room, start, delta, i / last):
                return True
        stride //= 2
    return False


@compiled
def collides_at(tables: Tables, room: Room, start: Any, delta: Any, t: float) -> bool:
    """Place the robots at a time of a way, from 0 to 1, and return whether anything touches."""
    place_at(tables, room, start, delta, t)
    return collides(tables, room)


@compiled
def place_at(tables: Tables, room: Room, start: Any, delta: Any, t: float) -> None:
    """Place the robots at a time of a way."""
    q = room.q
    for i in range(len(q)):
        q[i] = start[i] + t * delta[i]
    place(tables, q, room.frames)
    measure(tables, room)
