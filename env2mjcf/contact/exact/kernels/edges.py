"""Straight ways between configurations: looked at step by step, or proved free."""

from __future__ import annotations

from typing import Any

from .clearances import least_time
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
    if _collides_at(tables, room, start, delta, 0.0):
        return True
    if _collides_at(tables, room, start, delta, 1.0):
        return True
    stride = 1
    while 2 * stride < last:
        stride *= 2
    # All odd multiples of a stride, then of its half: each step once.
    while stride > 0:
        for i in range(stride, last, 2 * stride):
            if _collides_at(tables, room, start, delta, i / last):
                return True
        stride //= 2
    return False


@compiled
def _collides_at(tables: Tables, room: Room, start: Any, delta: Any, t: float) -> bool:
    q = room.q
    for i in range(len(q)):
        q[i] = start[i] + t * delta[i]
    place(tables, q, room.frames)
    measure(tables, room)
    return collides(tables, room)


@compiled
def edge_is_free(
    tables: Tables, room: Room, start: Any, delta: Any, speeds: Any, pair_speeds: Any, band: float
) -> bool:
    """Return whether bodies provably stay apart on the way from `start` by `delta`.

    Where bodies are d apart and come nearer by at most v a unit of time, they do not meet within d / v (conservative
    advancement: Mirtich, Impulse-based Dynamic Simulation of Rigid Body Systems, 1996). So one look clears a stretch
    on both sides of it; what is left on either side is looked at in its middle.

    Args:
        tables: The scene.
        room: To work in.
        start, delta: (dim,).
        speeds, pair_speeds: (l,) and (p,) bounds of how much nearer bodies come on the whole way.
        band: Bodies as near as this may touch.
    """
    fastest = 0.0
    for i in range(len(speeds)):
        fastest = max(fastest, speeds[i])
    for i in range(len(pair_speeds)):
        fastest = max(fastest, pair_speeds[i])
    if fastest == 0.0:
        # Nothing moves against anything else.
        return not _collides_at(tables, room, start, delta, 0.0)
    # Most ways that hit do so at an end.
    for t in range(2):
        if _collides_at(tables, room, start, delta, float(t)):
            return False
    stretches = room.stretches
    stretches[0, 0], stretches[0, 1] = 0.0, 1.0
    count = 1
    while count > 0:
        count -= 1
        low, high = stretches[count, 0], stretches[count, 1]
        middle, half = (low + high) / 2, (high - low) / 2
        if _collides_at(tables, room, start, delta, middle):
            return False
        # Distances are shortened by the band, whatever the speed of a pair: by the time that the fastest takes.
        clear = least_time(tables, room, speeds, pair_speeds, half + band / fastest)
        clear -= band / fastest
        if clear >= half:
            continue
        if clear <= 0 or count + 2 > len(stretches):
            return False
        stretches[count, 0], stretches[count, 1] = low, middle - clear
        stretches[count + 1, 0], stretches[count + 1, 1] = middle + clear, high
        count += 2
    return True
