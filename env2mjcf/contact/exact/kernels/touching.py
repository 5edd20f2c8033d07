"""Whether two bodies touch: boxes first, then their trees, then whether one is inside the other."""

from __future__ import annotations

from typing import Any

from .boxes import boxes_apart, lanes_near
from .compiling import compiled, inlined
from .insides import holds
from .opening import Tables
from .poses import Pose, inverted, moved, relative
from .triangles import box_meets, corners, placed, triangle_meets

_LANES, _BLOCK = 8, 4
_ROOT, _START, _IS_BOX, _IS_SOLID, _FIRST, _LAST = 0, 1, 2, 3, 4, 5


@inlined
def touch(tables: Tables, s: int, pose_s: Any, t: int, pose_t: Any, stack: Any) -> bool:
    """Return whether shapes s and t at world poses, (12,), touch."""
    m = relative(pose_s, pose_t)
    a, b = tables.halves[s], tables.halves[t]
    if boxes_apart(m, a[0], a[1], a[2], b[0], b[1], b[2]):
        return False
    first, second = tables.shapes[s], tables.shapes[t]
    if first[_IS_BOX] == 1 and second[_IS_BOX] == 1:
        # The boxes are the bodies.
        return (first[_IS_SOLID] > 0 or not _box_in_box(m, a, b)) and (
            second[_IS_SOLID] > 0 or not _box_in_box(inverted(m), b, a)
        )
    if first[_IS_BOX] == 1 and _counts_as_solid(first, a, b):
        crosses = box_crosses(tables, a[0], a[1], a[2], t, m, stack)
    elif second[_IS_BOX] == 1 and _counts_as_solid(second, b, a):
        crosses = box_crosses(tables, b[0], b[1], b[2], s, inverted(m), stack)
    else:
        crosses = _trees_cross(tables, s, t, m, stack)
    if crosses:
        return True
    return (second[_IS_SOLID] > 0 and _holds_any(tables, t, s, inverted(m), stack)) or (
        first[_IS_SOLID] > 0 and _holds_any(tables, s, t, m, stack)
    )


@compiled
def _counts_as_solid(shape: Any, half: Any, other: Any) -> bool:
    """Return whether a triangle in a box means contact: it is solid, or no component of the other fits into it."""
    return shape[_IS_SOLID] > 0 or 2 * (half[0] ** 2 + half[1] ** 2 + half[2] ** 2) ** 0.5 < other[3]


@compiled
def _box_in_box(m: Pose, a: Any, b: Any) -> bool:
    """Return whether box b, at pose m in the frame of box a, lies inside of a."""
    return (
        abs(m[3]) + abs(m[0]) * b[0] + abs(m[1]) * b[1] + abs(m[2]) * b[2] < a[0]
        and abs(m[7]) + abs(m[4]) * b[0] + abs(m[5]) * b[1] + abs(m[6]) * b[2] < a[1]
        and abs(m[11]) + abs(m[8]) * b[0] + abs(m[9]) * b[1] + abs(m[10]) * b[2] < a[2]
    )


@compiled
def box_crosses(tables: Tables, h0: float, h1: float, h2: float, t: int, m: Pose, stack: Any) -> bool:
    """Return whether a solid box with half sizes h meets any triangle of shape t, at pose m in the box's frame."""
    stack[0] = tables.shapes[t, _START]
    count = 1
    while count > 0:
        count -= 1
        node = stack[count]
        lanes = lanes_near(tables.boxes[node], m, 0.0, 0.0, 0.0, h0, h1, h2)
        children = tables.children[node]
        for k in range(_LANES):
            if lanes >> k & 1:
                if children[k] >= 0:
                    stack[count] = children[k]
                    count += 1
                elif box_meets(tables.blocks[~children[k]], m, h0, h1, h2):
                    return True
    return False


@compiled
def _trees_cross(tables: Tables, s: int, t: int, m: Pose, stack: Any) -> bool:
    """Return whether any triangle of shape s meets one of t, at pose m in the frame of s.

    The stack holds pairs of places, node and lane in one number, whose boxes overlap; the larger box is opened.
    """
    back = inverted(m)
    stack[0], stack[1] = tables.shapes[s, _ROOT] * _LANES, tables.shapes[t, _ROOT] * _LANES
    count = 2
    while count > 0:
        count -= 2
        p, q = stack[count], stack[count + 1]
        child_p, child_q = tables.children[p // _LANES, p % _LANES], tables.children[q // _LANES, q % _LANES]
        if child_p < 0 and child_q < 0:
            if _leaves_cross(tables.blocks[~child_p], tables.blocks[~child_q], back):
                return True
            continue
        row_p, row_q = tables.boxes[p // _LANES], tables.boxes[q // _LANES]
        i, j = p % _LANES, q % _LANES
        if child_q < 0 or (child_p >= 0 and box_size(row_p, i) > box_size(row_q, j)):
            lanes = lanes_near(
                tables.boxes[child_p], back,
                row_q[j], row_q[8 + j], row_q[16 + j], row_q[24 + j], row_q[32 + j], row_q[40 + j],
            )  # fmt: skip
            for k in range(_LANES):
                if lanes >> k & 1:
                    stack[count], stack[count + 1] = child_p * _LANES + k, q
                    count += 2
        else:
            lanes = lanes_near(
                tables.boxes[child_q], m,
                row_p[i], row_p[8 + i], row_p[16 + i], row_p[24 + i], row_p[32 + i], row_p[40 + i],
            )  # fmt: skip
            for k in range(_LANES):
                if lanes >> k & 1:
                    stack[count], stack[count + 1] = p, child_q * _LANES + k
                    count += 2
    return False


@compiled
def box_size(row: Any, k: int) -> float:
    """Return what tells large boxes of a node from small ones."""
    return row[24 + k] + row[32 + k] + row[40 + k]


@compiled
def _leaves_cross(first: Any, second: Any, back: Pose) -> bool:
    """Return whether any triangle of a leaf meets one of another; `back` is the pose of the first's frame."""
    for k in range(_BLOCK):
        if triangle_meets(placed(back, corners(first, k)), second):
            return True
    return False


@compiled
def _holds_any(tables: Tables, s: int, t: int, m: Pose, stack: Any) -> bool:
    """Return whether a component of shape t, at pose m in the frame of s, lies inside s, given that none crosses."""
    for i in range(tables.shapes[t, _FIRST], tables.shapes[t, _LAST]):
        x, y, z = moved(m, tables.points[i, 0], tables.points[i, 1], tables.points[i, 2])
        if holds(tables, s, x, y, z, stack):
            return True
    return False
