"""Straight ways between configurations: looked at step by step, and proofs that bodies stay apart on them.

Bodies that are d apart and come nearer by at most v a unit of time do not meet within d / v (conservative advancement:
Mirtich, Impulse-based Dynamic Simulation of Rigid Body Systems, 1996). A look at the middle of a stretch of the way
clears the pairs that are farther apart than they can come nearer; for the others the stretch is halved.

What is apart at one time must touch before it crosses, edge to edge or corner to face, and before it gets inside. So
it is enough that these distances, of edges and of corners, are nowhere too small: no look asks for crossings.
"""

from __future__ import annotations

from typing import Any

from ..tables import IS_BOX, LANES, SHAPE, STEP, TOP, Tables
from .boxes import boxes_apart, lanes_about
from .compiling import Room, compiled
from .distances import distance
from .poses import Pose, Vector, inverted, place, relative
from .separations import box_gap
from .touching import box_crosses, collides, measure

_CLEAR, _OPEN, _TOO_NEAR = 0, 1, 2

LEVELS = 40
"""How often a stretch is halved at the most."""


@compiled
def edge_is_free(
    tables: Tables, room: Room, start: Any, delta: Any, speeds: Any, drifts: Any, turns: Any, pair_speeds: Any,
    band: float, stretches: Any, runs: Any, pending: Any,
) -> bool:  # fmt: skip
    """Return whether bodies provably stay apart on the way from `start` by `delta`.

    Args:
        start, delta: (dim,).
        speeds, pair_speeds: (l,) and (p,) bounds of how much nearer bodies come on the whole way.
        drifts, turns: (l, 3) and (l,) what of the links' motion is one translation, and bounds of the rest.
        band: Bodies as near as this may touch.
        stretches, runs: (2 LEVELS, 2) a stack of stretches, and of the pairs that are open on each: first and last.
        pending: Those pairs: link * obstacles + obstacle, or ~pair of links. Halves share the list of the whole.
    """
    # Most ways that hit do so at one of these. The last look leaves the robots in the middle of the way.
    for i in range(5):
        if collides_at(tables, room, start, delta, (3 * i % 5) / 4):
            return False
    fastest = 0.0
    for i in range(len(tables.links)):
        fastest = max(fastest, speeds[i])
    for i in range(len(tables.pairs)):
        fastest = max(fastest, pair_speeds[i])
    if fastest == 0.0:
        return True
    # Distances are shortened by what bodies move in this time, which is the band for the fastest.
    margin = band / fastest
    stretches[0, 0], stretches[0, 1] = 0.0, 1.0
    runs[0, 0], runs[0, 1] = 0, _gather(tables, room, speeds, pair_speeds, 0.5 + margin, pending)
    count = 1
    while count > 0:
        count -= 1
        low, high = stretches[count, 0], stretches[count, 1]
        first, last = runs[count, 0], runs[count, 1]
        middle, half = (low + high) / 2, (high - low) / 2
        place_at(tables, room, start, delta, middle)
        left = last
        for i in range(first, last):
            code = pending[i]
            speed = pair_speeds[~code] if code < 0 else speeds[code // len(tables.obstacles)]
            state = _look(tables, room, code, speed, drifts, turns, half, margin)
            if state == _TOO_NEAR:
                return False
            if state == _OPEN:
                pending[left] = code
                left += 1
        if left == last:
            continue
        if count + 2 > len(stretches):
            return False
        stretches[count, 0], stretches[count, 1] = middle, high
        stretches[count + 1, 0], stretches[count + 1, 1] = low, middle
        for i in range(count, count + 2):
            runs[i, 0], runs[i, 1] = last, left
        count += 2
    return True


@compiled
def _gather(tables: Tables, room: Room, speeds: Any, pair_speeds: Any, time: float, pending: Any) -> int:
    """List the pairs whose boxes may meet within a time, and return how many they are."""
    count = 0
    spans, frames, stack = room.spans, room.frames, room.top
    for link in range(len(tables.links)):
        if tables.links[link, TOP] < 0 or speeds[link] == 0:
            continue
        pose, span, reach = frames[tables.links[link, STEP]], spans[link], speeds[link] * time
        stack[0] = tables.links[link, TOP]
        height = 1
        while height > 0:
            height -= 1
            node = stack[height]
            lanes = lanes_about(
                tables.top_boxes[node], pose[3], pose[7], pose[11], span[0] + reach, span[1] + reach, span[2] + reach
            )
            for k in range(LANES):
                if lanes >> k & 1:
                    child = tables.top_children[node, k]
                    if child >= 0:
                        stack[height] = child
                        height += 1
                    else:
                        pending[count] = link * len(tables.obstacles) + ~child
                        count += 1
    for i in range(len(tables.pairs)):
        a, b, reach = tables.pairs[i, 0], tables.pairs[i, 1], pair_speeds[i] * time
        p, q = frames[tables.links[a, STEP]], frames[tables.links[b, STEP]]
        if reach > 0 and (
            abs(p[3] - q[3]) <= spans[a, 0] + spans[b, 0] + reach
            and abs(p[7] - q[7]) <= spans[a, 1] + spans[b, 1] + reach
            and abs(p[11] - q[11]) <= spans[a, 2] + spans[b, 2] + reach
        ):
            pending[count] = ~i
            count += 1
    return count


@compiled
def _look(
    tables: Tables, room: Room, code: int, speed: float, drifts: Any, turns: Any, half: float, margin: float
) -> int:
    """Return what is known of a pair on a stretch of some half length, with the robots placed in its middle."""
    if code < 0:
        a, b = tables.links[tables.pairs[~code, 0]], tables.links[tables.pairs[~code, 1]]
        p, q = room.frames[a[STEP]], room.frames[b[STEP]]
        return _look_at(tables, room, a[SHAPE], p, b[SHAPE], q, speed, (0.0, 0.0, 0.0), speed, half, margin)
    number, obstacle = code // len(tables.obstacles), code % len(tables.obstacles)
    link, drift = tables.links[number], (drifts[number, 0], drifts[number, 1], drifts[number, 2])
    pose, other = room.frames[link[STEP]], tables.poses[obstacle]
    shape = tables.obstacles[obstacle, 0]
    return _look_at(tables, room, link[SHAPE], pose, shape, other, speed, drift, turns[number], half, margin)


@compiled
def _look_at(
    tables: Tables, room: Room, s: int, pose_s: Any, t: int, pose_t: Any,
    speed: float, drift: Vector, turn: float, half: float, margin: float,
) -> int:  # fmt: skip
    reach = speed * (half + margin)
    m = relative(pose_s, pose_t)
    a, b = tables.halves[s], tables.halves[t]
    gap = box_gap(m, a, b)
    if gap >= reach * reach:
        return _CLEAR
    # While there is much to be halved, quick answers will do.
    fine = half <= 4 * margin
    if not fine:
        beyond = turn * half + speed * margin
        grown = _reaches(pose_s, drift, half, beyond)
        if boxes_apart(m, a[0] + grown[0], a[1] + grown[1], a[2] + grown[2], b[0], b[1], b[2]):
            return _CLEAR
        if tables.shapes[s, IS_BOX] == 1 and tables.shapes[t, IS_BOX] == 1:
            return _TOO_NEAR if not boxes_apart(m, a[0], a[1], a[2], b[0], b[1], b[2]) else _OPEN
        if tables.shapes[s, IS_BOX] == 1:
            return _beside_box(tables, room, a, grown, t, m)
        if tables.shapes[t, IS_BOX] == 1:
            return _beside_box(tables, room, b, _reaches(pose_t, drift, half, beyond), s, inverted(m))
        if 16 * gap >= reach * reach:
            return _OPEN
    apart = distance(tables, s, pose_s, t, pose_t, reach * reach, 0.0 if fine else reach * reach, room)
    if apart >= reach * reach:
        return _CLEAR
    return _TOO_NEAR if half <= margin or apart <= (speed * margin) ** 2 else _OPEN


@compiled
def _reaches(pose: Any, drift: Vector, half: float, beyond: float) -> Vector:
    """Return by how much a box must grow on each side to hold all that comes to it, by drifting and otherwise."""
    x, y, z = drift
    return (
        abs(pose[0] * x + pose[4] * y + pose[8] * z) * half + beyond,
        abs(pose[1] * x + pose[5] * y + pose[9] * z) * half + beyond,
        abs(pose[2] * x + pose[6] * y + pose[10] * z) * half + beyond,
    )


@compiled
def _beside_box(tables: Tables, room: Room, half: Any, grown: Vector, mesh: int, m: Pose) -> int:
    """Return what is known of a box and a mesh, at pose m in the box's frame, that reaches so far on a stretch."""
    if not box_crosses(tables, half[0] + grown[0], half[1] + grown[1], half[2] + grown[2], mesh, m, room.stack):
        return _CLEAR
    return _TOO_NEAR if box_crosses(tables, half[0], half[1], half[2], mesh, m, room.stack) else _OPEN


@compiled
def edge_collides(tables: Tables, room: Room, start: Any, delta: Any, steps: int) -> bool:
    """Return whether anything touches at one of the steps, both ends included, from the coarse to the fine.

    Args:
        start, delta: (dim,) where the way begins, and where it leads from there.
        steps: Number of configurations, at least 2, evenly spaced.
    """
    last = steps - 1
    if collides_at(tables, room, start, delta, 0.0) or collides_at(tables, room, start, delta, 1.0):
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
    for i in range(len(tables.limits)):
        q[i] = start[i] + t * delta[i]
    place(tables, q, room.frames)
    measure(tables, room)
