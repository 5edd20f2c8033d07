"""How near bodies are to each other that do not touch: branch and bound down pairs of trees, nearest boxes first."""

from __future__ import annotations

from typing import Any

from ..tables import BLOCK, LANES, ROOT, SHAPE, STEP, TOP, Tables
from .boxes import lanes_about
from .compiling import Room, compiled
from .poses import Pose, inverted, larger, relative, smaller
from .separations import box_gap, lane_gaps, triangle_distance, triangle_gap
from .touching import box_size, lane_box
from .triangles import corners, placed

# Beyond everything, and nearer than the boxes of unused lanes.
_FAR = 1e250


@compiled
def distance(
    tables: Tables, s: int, pose_s: Any, t: int, pose_t: Any, bound: float, enough: float, room: Room
) -> float:
    """Return the squared distance of shapes s and t at world poses, (12,), or the bound where that is less.

    The shapes do not touch. Where something is nearer than `enough`, squared too, how near does not matter.
    """
    m = relative(pose_s, pose_t)
    if box_gap(m, tables.halves[s], tables.halves[t]) >= bound:
        return bound
    return _search(tables, s, t, m, bound, enough, room)


@compiled
def _search(tables: Tables, s: int, t: int, m: Pose, bound: float, enough: float, room: Room) -> float:
    stack, gaps = room.stack, room.gaps
    back = inverted(m)
    stack[0], stack[1] = tables.shapes[s, ROOT] * LANES, tables.shapes[t, ROOT] * LANES
    gaps[LANES] = 0.0
    count = 1
    while count > 0 and bound >= enough:
        count -= 1
        if gaps[LANES + count] >= bound:
            continue
        p, q = stack[2 * count], stack[2 * count + 1]
        child_p, child_q = tables.children[p // LANES, p % LANES], tables.children[q // LANES, q % LANES]
        if child_p < 0 and child_q < 0:
            bound = _between_leaves(tables.blocks[~child_p], tables.blocks[~child_q], back, bound)
            continue
        row_p, row_q = tables.boxes[p // LANES], tables.boxes[q // LANES]
        i, j = p % LANES, q % LANES
        if child_q < 0 or (child_p >= 0 and box_size(row_p, i) > box_size(row_q, j)):
            x, y, z, a, b, c = lane_box(row_q, j)
            lane_gaps(tables.boxes[child_p], back, x, y, z, a, b, c, gaps)
            count = _push(child_p * LANES, -1, q, bound, stack, gaps, count)
        else:
            x, y, z, a, b, c = lane_box(row_p, i)
            lane_gaps(tables.boxes[child_q], m, x, y, z, a, b, c, gaps)
            count = _push(child_q * LANES, p, -1, bound, stack, gaps, count)
    return bound


@compiled
def _push(first: int, p: int, q: int, bound: float, stack: Any, gaps: Any, count: int) -> int:
    """Push the lanes of a node whose gaps, in gaps[:8], are below the bound, so that the nearest is on top.

    Of p and q the one that is negative stands for the lane.
    """
    base = count
    for k in range(LANES):
        gap = gaps[k]
        if gap >= bound:
            continue
        # Insertion: lanes are few.
        i = count
        while i > base and gaps[LANES + i - 1] < gap:
            gaps[LANES + i] = gaps[LANES + i - 1]
            stack[2 * i], stack[2 * i + 1] = stack[2 * i - 2], stack[2 * i - 1]
            i -= 1
        gaps[LANES + i] = gap
        stack[2 * i] = first + k if p < 0 else p
        stack[2 * i + 1] = first + k if q < 0 else q
        count += 1
    return count


@compiled
def _between_leaves(first: Any, second: Any, back: Pose, bound: float) -> float:
    """Return the least squared distance of two leaves' triangles, or the bound; `back` is the pose of the first."""
    for k in range(BLOCK):
        triangle = placed(back, corners(first, k))
        if triangle_gap(triangle, second) < bound:
            bound = smaller(bound, triangle_distance(triangle, second))
    return bound


@compiled
def least_distance(tables: Tables, room: Room, most: float) -> float:
    """Return the least distance of any pair, or `most` if that is less.

    The robots are placed in the room's frames, and measured; nothing touches.
    """
    least = most
    for link in range(len(tables.links)):
        if tables.links[link, TOP] >= 0:
            # Something near first: the nearer that is, the less else is looked at.
            least = _to_obstacle(tables, link, room, _nearest_box(tables, link, room), least)
    for link in range(len(tables.links)):
        if tables.links[link, TOP] >= 0:
            least = _to_others(tables, link, room, _nearest_box(tables, link, room), least)
    frames = room.frames
    for i in range(len(tables.pairs)):
        a, b = tables.links[tables.pairs[i, 0]], tables.links[tables.pairs[i, 1]]
        bound = least * least
        d = distance(tables, a[SHAPE], frames[a[STEP]], b[SHAPE], frames[b[STEP]], bound, 0.0, room)
        if d < bound:
            least = d**0.5
    return least


@compiled
def _to_others(tables: Tables, link: int, room: Room, known: int, least: float) -> float:
    """Return the least distance of a link from all obstacles but one, or `least` if that is less."""
    pose = room.frames[tables.links[link, STEP]]
    span, stack = room.spans[link], room.top
    stack[0] = tables.links[link, TOP]
    count = 1
    while count > 0:
        count -= 1
        node = stack[count]
        lanes = lanes_about(
            tables.top_boxes[node], pose[3], pose[7], pose[11], span[0] + least, span[1] + least, span[2] + least
        )
        for k in range(LANES):
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
    pose, shape = room.frames[tables.links[link, STEP]], tables.links[link, SHAPE]
    bound, other = least * least, tables.obstacles[obstacle, 0]
    d = distance(tables, shape, pose, other, tables.poses[obstacle], bound, 0.0, room)
    return d**0.5 if d < bound else least


@compiled
def _nearest_box(tables: Tables, link: int, room: Room) -> int:
    """Return an obstacle that is found by going to the nearest box at each level of the tree."""
    pose, span = room.frames[tables.links[link, STEP]], room.spans[link]
    child = tables.links[link, TOP]
    while child >= 0:
        row, node, least = tables.top_boxes[child], child, _FAR
        for k in range(LANES):
            gap = 0.0
            for i in range(3):
                away = larger(abs(row[8 * i + k] - pose[4 * i + 3]) - row[24 + 8 * i + k] - span[i], 0.0)
                gap += away * away
            if gap < least:
                least, child = gap, tables.top_children[node, k]
    return ~child
