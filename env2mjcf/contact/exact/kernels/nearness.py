"""How near bodies are to each other that do not touch: branch and bound down pairs of trees, nearest boxes first."""

from __future__ import annotations

from typing import Any

from .compiling import compiled
from .opening import Room, Tables
from .poses import Pose, inverted, relative, smaller
from .separations import box_gap, lane_gaps, triangle_distance, triangle_gap
from .touching import box_size
from .triangles import corners, placed

_LANES, _BLOCK = 8, 4
_ROOT = 0


@compiled
def distance(
    tables: Tables, s: int, pose_s: Any, t: int, pose_t: Any, bound: float, enough: float, room: Room
) -> float:
    """Return the squared distance of shapes s and t at world poses, (12,), or the bound where that is less.

    Args:
        tables: The scene.
        s, t: Shapes that do not touch.
        pose_s, pose_t: Their poses.
        bound: What is farther does not matter; squared.
        enough: Where something is nearer than this, how near does not matter; squared.
        room: To work in.
    """
    m = relative(pose_s, pose_t)
    if box_gap(m, tables.halves[s], tables.halves[t]) >= bound:
        return bound
    return _search(tables, s, t, m, bound, enough, room)


@compiled
def _search(tables: Tables, s: int, t: int, m: Pose, bound: float, enough: float, room: Room) -> float:
    stack, gaps = room.stack, room.gaps
    back = inverted(m)
    stack[0], stack[1] = tables.shapes[s, _ROOT] * _LANES, tables.shapes[t, _ROOT] * _LANES
    gaps[_LANES] = 0.0
    count = 1
    while count > 0 and bound >= enough:
        count -= 1
        if gaps[_LANES + count] >= bound:
            continue
        p, q = stack[2 * count], stack[2 * count + 1]
        child_p, child_q = tables.children[p // _LANES, p % _LANES], tables.children[q // _LANES, q % _LANES]
        if child_p < 0 and child_q < 0:
            bound = _between_leaves(tables.blocks[~child_p], tables.blocks[~child_q], back, bound)
            continue
        row_p, row_q = tables.boxes[p // _LANES], tables.boxes[q // _LANES]
        i, j = p % _LANES, q % _LANES
        if child_q < 0 or (child_p >= 0 and box_size(row_p, i) > box_size(row_q, j)):
            lane_gaps(
                tables.boxes[child_p], back,
                row_q[j], row_q[8 + j], row_q[16 + j], row_q[24 + j], row_q[32 + j], row_q[40 + j], gaps,
            )  # fmt: skip
            count = _push(child_p * _LANES, -1, q, bound, stack, gaps, count)
        else:
            lane_gaps(
                tables.boxes[child_q], m,
                row_p[i], row_p[8 + i], row_p[16 + i], row_p[24 + i], row_p[32 + i], row_p[40 + i], gaps,
            )  # fmt: skip
            count = _push(child_q * _LANES, p, -1, bound, stack, gaps, count)
    return bound


@compiled
def _push(first: int, p: int, q: int, bound: float, stack: Any, gaps: Any, count: int) -> int:
    """Push the lanes of a node whose gaps, in gaps[:8], are below the bound, so that the nearest is on top.

    Of p and q the one that is negative stands for the lane.
    """
    base = count
    for k in range(_LANES):
        gap = gaps[k]
        if gap >= bound:
            continue
        # Insertion: lanes are few.
        i = count
        while i > base and gaps[_LANES + i - 1] < gap:
            gaps[_LANES + i] = gaps[_LANES + i - 1]
            stack[2 * i], stack[2 * i + 1] = stack[2 * i - 2], stack[2 * i - 1]
            i -= 1
        gaps[_LANES + i] = gap
        stack[2 * i] = first + k if p < 0 else p
        stack[2 * i + 1] = first + k if q < 0 else q
        count += 1
    return count


@compiled
def _between_leaves(first: Any, second: Any, back: Pose, bound: float) -> float:
    """Return the least squared distance of two leaves' triangles, or the bound; `back` is the pose of the first."""
    for k in range(_BLOCK):
        triangle = placed(back, corners(first, k))
        if triangle_gap(triangle, second) < bound:
            bound = smaller(bound, triangle_distance(triangle, second))
    return bound
