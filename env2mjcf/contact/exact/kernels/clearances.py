"""The least distance over all tested pairs, each divided by how fast its bodies may come nearer."""

from __future__ import annotations

from typing import Any

from .boxes import lanes_about
from .compiling import compiled
from .nearness import distance
from .opening import Room, Tables

_LANES = 8
_STEP, _SHAPE, _TOP = 0, 1, 2


@compiled
def least_time(tables: Tables, room: Room, speeds: Any, pair_speeds: Any, most: float) -> float:
    """Return the least time in which bodies may meet that do not touch now, or `most` if that is less.

    With speeds of one it is the least distance. Pairs of no speed never meet.

    Args:
        tables: The scene.
        room: With the robots placed in its frames, and measured.
        speeds: (l,) of each link, against obstacles.
        pair_speeds: (p,) of each pair of links, against each other.
        most: What is more does not matter.
    """
    time = most
    for link in range(len(tables.links)):
        if tables.links[link, _TOP] >= 0 and speeds[link] > 0:
            time = _to_obstacles(tables, link, room, speeds[link], time)
    frames = room.frames
    for i in range(len(tables.pairs)):
        if pair_speeds[i] > 0:
            a, b = tables.links[tables.pairs[i, 0]], tables.links[tables.pairs[i, 1]]
            reach = time * pair_speeds[i]
            d = distance(tables, a[_SHAPE], frames[a[_STEP]], b[_SHAPE], frames[b[_STEP]], reach * reach, room)
            if d < reach * reach:
                time = d**0.5 / pair_speeds[i]
    return time


@compiled
def _to_obstacles(tables: Tables, link: int, room: Room, speed: float, time: float) -> float:
    pose, shape = room.frames[tables.links[link, _STEP]], tables.links[link, _SHAPE]
    span, stack = room.spans[link], room.top
    stack[0] = tables.links[link, _TOP]
    count = 1
    while count > 0:
        count -= 1
        node = stack[count]
        reach = time * speed
        lanes = lanes_about(
            tables.top_boxes[node], pose[3], pose[7], pose[11], span[0] + reach, span[1] + reach, span[2] + reach
        )
        for k in range(_LANES):
            if lanes >> k & 1:
                child = tables.top_children[node, k]
                if child >= 0:
                    stack[count] = child
                    count += 1
                    continue
                reach = time * speed
                other = tables.obstacles[~child, 0]
                d = distance(tables, shape, pose, other, tables.poses[~child], reach * reach, room)
                if d < reach * reach:
                    time = d**0.5 / speed
    return time
