"""Whether anything touches in one configuration: a tree over the obstacles, then pairs of links."""

from __future__ import annotations

from .boxes import lanes_about
from .compiling import inlined
from .opening import Room, Tables
from .touching import touch

_STEP, _SHAPE, _TOP = 0, 1, 2


@inlined
def collides(tables: Tables, room: Room) -> bool:
    """Return whether any tested pair touches, with the robots placed in the room's frames, and measured."""
    frames, spans = room.frames, room.spans
    for link in range(len(tables.links)):
        if tables.links[link, _TOP] >= 0 and _meets_obstacle(tables, link, room):
            return True
    for i in range(len(tables.pairs)):
        a, b = tables.pairs[i, 0], tables.pairs[i, 1]
        p, q = frames[tables.links[a, _STEP]], frames[tables.links[b, _STEP]]
        if (
            abs(p[3] - q[3]) <= spans[a, 0] + spans[b, 0]
            and abs(p[7] - q[7]) <= spans[a, 1] + spans[b, 1]
            and abs(p[11] - q[11]) <= spans[a, 2] + spans[b, 2]
            and touch(tables, tables.links[a, _SHAPE], p, tables.links[b, _SHAPE], q, room.stack)
        ):
            return True
    return False


@inlined
def measure(tables: Tables, room: Room) -> None:
    """Fill the room's spans from its frames."""
    for link in range(len(tables.links)):
        pose, half = room.frames[tables.links[link, _STEP]], tables.halves[tables.links[link, _SHAPE]]
        for k in range(3):
            room.spans[link, k] = (
                abs(pose[4 * k]) * half[0] + abs(pose[4 * k + 1]) * half[1] + abs(pose[4 * k + 2]) * half[2]
            )


@inlined
def _meets_obstacle(tables: Tables, link: int, room: Room) -> bool:
    pose, shape = room.frames[tables.links[link, _STEP]], tables.links[link, _SHAPE]
    span, stack = room.spans[link], room.top
    stack[0] = tables.links[link, _TOP]
    count = 1
    while count > 0:
        count -= 1
        node = stack[count]
        lanes = lanes_about(tables.top_boxes[node], pose[3], pose[7], pose[11], span[0], span[1], span[2])
        k = 0
        while lanes > 0:
            if lanes & 1:
                child = tables.top_children[node, k]
                if child >= 0:
                    stack[count] = child
                    count += 1
                elif touch(tables, shape, pose, tables.obstacles[~child, 0], tables.poses[~child], room.stack):
                    return True
            lanes >>= 1
            k += 1
    return False
