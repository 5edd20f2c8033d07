"""The least distance over all tested pairs."""

from __future__ import annotations

from .boxes import lanes_about
from .compiling import compiled
from .nearness import distance
from .opening import Room, Tables
from .poses import larger

_LANES = 8
_STEP, _SHAPE, _TOP = 0, 1, 2
# Beyond everything, and nearer than the boxes of unused lanes.
_FAR = 1e250


@compiled
def least_distance(tables: Tables, room: Room, most: float) -> float:
    """Return the least distance of any pair, or `most` if that is less.

    Args:
        tables: The scene.
        room: With the robots placed in its frames, and measured; nothing touches.
        most: What is more does not matter.
    """
    least = most
    for link in range(len(tables.links)):
        if tables.links[link, _TOP] >= 0:
            # Something near first: the nearer that is, the less else is looked at.
            least = _to_obstacle(tables, link, room, _nearest_box(tables, link, room), least)
    for link in range(len(tables.links)):
        if tables.links[link, _TOP] >= 0:
            least = _to_others(tables, link, room, _nearest_box(tables, link, room), least)
    frames = room.frames
    for i in range(len(tables.pairs)):
        a, b = tables.links[tables.pairs[i, 0]], tables.links[tables.pairs[i, 1]]
        bound = least * least
        d = distance(tables, a[_SHAPE], frames[a[_STEP]], b[_SHAPE], frames[b[_STEP]], bound, 0.0, room)
        if d < bound:
            least = d**0.5
    return least


@compiled
def _to_others(tables: Tables, link: int, room: Room, known: int, least: float) -> float:
    """Return the least distance of a link from all obstacles but one, or `least` if that is less."""
    pose = room.frames[tables.links[link, _STEP]]
    span, stack = room.spans[link], room.top
    stack[0] = tables.links[link, _TOP]
    count = 1
    while count > 0:
        count -= 1
        node = stack[count]
        lanes = lanes_about(
            tables.top_boxes[node], pose[3], pose[7], pose[11], span[0] + least, span[1] + least, span[2] + least
        )
        for k in range(_LANES):
            if lanes >> k & 1:
                child = tables.top_children[node, k]
                if child >= 0:
                    stack[count] = child
                    count += 1
                elif ~child != known:
                    least = _to_obstacle(tables, link, room, ~child, least)
    return least


@compiled
def _to_obstacle(tables: Tables, link: int, room: Room, obstacle: int, least: float) -> float:
    pose, shape = room.frames[tables.links[link, _STEP]], tables.links[link, _SHAPE]
    bound, other = least * least, tables.obstacles[obstacle, 0]
    d = distance(tables, shape, pose, other, tables.poses[obstacle], bound, 0.0, room)
    return d**0.5 if d < bound else least


@compiled
def _nearest_box(tables: Tables, link: int, room: Room) -> int:
    """Return an obstacle that is found by going to the nearest box at each level of the tree."""
    pose, span = room.frames[tables.links[link, _STEP]], room.spans[link]
    child = tables.links[link, _TOP]
    while child >= 0:
        row, node, least = tables.top_boxes[child], child, _FAR
        for k in range(_LANES):
            gap = 0.0
            for i in range(3):
                away = larger(abs(row[8 * i + k] - pose[4 * i + 3]) - row[24 + 8 * i + k] - span[i], 0.0)
                gap += away * away
            if gap < least:
                least, child = gap, tables.top_children[node, k]
    return ~child
