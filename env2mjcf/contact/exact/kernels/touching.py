"""Whether anything touches in one configuration.

First links with obstacles, down a tree over those, then the pairs of links. Of two bodies the boxes are tested first,
then their trees, then whether one is inside the other: how often a ray from a point of it leaves the other.
"""

from __future__ import annotations

from typing import Any

from ..tables import (
    BLOCK,
    ENCLOSING,
    FIRST_POINT,
    IS_BOX,
    IS_SOLID,
    LANES,
    LAST_POINT,
    ROOT,
    SHAPE,
    START,
    STEP,
    TOP,
    Tables,
)
from .boxes import boxes_apart, lanes_about, lanes_near
from .compiling import Room, compiled, compiled_strictly, inlined
from .poses import Pose, Vector, inverted, larger, moved, relative, smaller
from .triangles import box_meets, corners, placed, triangle_meets

_ORIENTED = 1

# The ray goes up along z and leans by this much, so that it meets no edge of a mesh whose edges run along its axes.
_LEAN_X, _LEAN_Y = 0.0123917, 0.0271813
_TINY = 1e-290


@inlined
def touch(tables: Tables, s: int, pose_s: Any, t: int, pose_t: Any, stack: Any) -> bool:
    """Return whether shapes s and t at world poses, (12,), touch."""
    m = relative(pose_s, pose_t)
    a, b = tables.halves[s], tables.halves[t]
    if boxes_apart(m, a[0], a[1], a[2], b[0], b[1], b[2]):
        return False
    first, second = tables.shapes[s], tables.shapes[t]
    if first[IS_BOX] == 1 and second[IS_BOX] == 1:
        # The boxes are the bodies.
        return (first[IS_SOLID] > 0 or not _box_in_box(m, a, b)) and (
            second[IS_SOLID] > 0 or not _box_in_box(inverted(m), b, a)
        )
    if first[IS_BOX] == 1 and _counts_as_solid(first, a, b):
        crosses = box_crosses(tables, a[0], a[1], a[2], t, m, stack)
    elif second[IS_BOX] == 1 and _counts_as_solid(second, b, a):
        crosses = box_crosses(tables, b[0], b[1], b[2], s, inverted(m), stack)
    else:
        crosses = _trees_cross(tables, s, t, m, stack)
    if crosses:
        return True
    return (second[IS_SOLID] > 0 and _holds_any(tables, t, s, inverted(m), stack)) or (
        first[IS_SOLID] > 0 and _holds_any(tables, s, t, m, stack)
    )


@compiled
def _counts_as_solid(shape: Any, half: Any, other: Any) -> bool:
    """Return whether a triangle in a box means contact: it is solid, or no component of the other fits into it."""
    return shape[IS_SOLID] > 0 or 2 * (half[0] ** 2 + half[1] ** 2 + half[2] ** 2) ** 0.5 < other[3]


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
    stack[0] = tables.shapes[t, START]
    count = 1
    while count > 0:
        count -= 1
        node = stack[count]
        lanes = lanes_near(tables.boxes[node], m, 0.0, 0.0, 0.0, h0, h1, h2)
        children = tables.children[node]
        for k in range(LANES):
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
    stack[0], stack[1] = tables.shapes[s, ROOT] * LANES, tables.shapes[t, ROOT] * LANES
    count = 2
    while count > 0:
        count -= 2
        p, q = stack[count], stack[count + 1]
        child_p, child_q = tables.children[p // LANES, p % LANES], tables.children[q // LANES, q % LANES]
        if child_p < 0 and child_q < 0:
            if _leaves_cross(tables.blocks[~child_p], tables.blocks[~child_q], back):
                return True
            continue
        row_p, row_q = tables.boxes[p // LANES], tables.boxes[q // LANES]
        i, j = p % LANES, q % LANES
        if child_q < 0 or (child_p >= 0 and box_size(row_p, i) > box_size(row_q, j)):
            x, y, z, a, b, c = lane_box(row_q, j)
            lanes = lanes_near(tables.boxes[child_p], back, x, y, z, a, b, c)
            for k in range(LANES):
                if lanes >> k & 1:
                    stack[count], stack[count + 1] = child_p * LANES + k, q
                    count += 2
        else:
            x, y, z, a, b, c = lane_box(row_p, i)
            lanes = lanes_near(tables.boxes[child_q], m, x, y, z, a, b, c)
            for k in range(LANES):
                if lanes >> k & 1:
                    stack[count], stack[count + 1] = p, child_q * LANES + k
                    count += 2
    return False


@compiled
def lane_box(row: Any, k: int) -> tuple[float, float, float, float, float, float]:
    """Return the centre and the half sizes of box k of a node."""
    return row[k], row[8 + k], row[16 + k], row[24 + k], row[32 + k], row[40 + k]


@compiled
def box_size(row: Any, k: int) -> float:
    """Return what tells large boxes of a node from small ones."""
    return row[24 + k] + row[32 + k] + row[40 + k]


@compiled
def _leaves_cross(first: Any, second: Any, back: Pose) -> bool:
    """Return whether any triangle of a leaf meets one of another; `back` is the pose of the first's frame."""
    for k in range(BLOCK):
        if triangle_meets(placed(back, corners(first, k)), second):
            return True
    return False


@compiled
def _holds_any(tables: Tables, s: int, t: int, m: Pose, stack: Any) -> bool:
    """Return whether a component of shape t, at pose m in the frame of s, lies inside s, given that none crosses."""
    for i in range(tables.shapes[t, FIRST_POINT], tables.shapes[t, LAST_POINT]):
        x, y, z = moved(m, tables.points[i, 0], tables.points[i, 1], tables.points[i, 2])
        if holds(tables, s, x, y, z, stack):
            return True
    return False


@compiled
def holds(tables: Tables, shape: int, x: float, y: float, z: float, stack: Any) -> bool:
    """Return whether a point of a shape's frame lies inside of it: the surface of its closed pieces winds around it.

    Counts what a ray passes, outwards minus inwards, which is the winding number of a closed surface. Which side of an
    edge the ray passes is decided from the same numbers for both of its triangles, so that it passes one of the two.
    """
    half = tables.halves[shape]
    if abs(x) >= half[0] or abs(y) >= half[1] or abs(z) >= half[2]:
        return False
    # The ray's foot in the plane z = 0, along its lean.
    u, v = x - _LEAN_X * z, y - _LEAN_Y * z
    winding = 0
    stack[0] = tables.shapes[shape, ENCLOSING]
    count = 1
    while count > 0:
        count -= 1
        node = stack[count]
        lanes = _lanes_above(tables.boxes[node], u, v, z)
        children = tables.children[node]
        for k in range(LANES):
            if lanes >> k & 1:
                if children[k] >= 0:
                    stack[count] = children[k]
                    count += 1
                else:
                    winding += _crossings(tables.blocks[~children[k]], u, v, z)
    # Where the triangles are not wound alike, only whether they are an even number is known.
    return winding != 0 if tables.shapes[shape, IS_SOLID] == _ORIENTED else winding % 2 != 0


@compiled
def _lanes_above(row: Any, u: float, v: float, z: float) -> int:
    """Return the lanes whose boxes a ray from height z up may meet, as bits."""
    lanes = 0
    for k in range(LANES):
        gap = abs(row[k] - _LEAN_X * row[16 + k] - u) - (row[24 + k] + _LEAN_X * row[40 + k])
        gap = larger(gap, abs(row[8 + k] - _LEAN_Y * row[16 + k] - v) - (row[32 + k] + _LEAN_Y * row[40 + k]))
        gap = larger(gap, z - (row[16 + k] + row[40 + k]))
        lanes |= (1 << k) if gap <= 0 else 0
    return lanes


@compiled
def _crossings(row: Any, u: float, v: float, z: float) -> int:
    """Return how many triangles of a leaf the ray's line leaves through above z, minus those it enters through."""
    around = 0
    for k in range(BLOCK):
        p, q, r = _sides(row, k, u, v)
        around |= (1 << k) if larger(smaller(smaller(p, q), r), -larger(larger(p, q), r)) > 0 else 0
    total = 0
    for k in range(BLOCK):
        # A leaf that is not full has its last triangle several times.
        if around >> k & 1 and not (k > 0 and _same(row, k)):
            p, q, r = _sides(row, k, u, v)
            # Barycentric: each corner weighs as much as the part of the area opposite to it.
            height = (q * row[8 + k] + r * row[20 + k] + p * row[32 + k]) / (p + q + r)
            if height > z:
                total += 1 if p > 0 else -1
    return total


@compiled
def _sides(row: Any, k: int, u: float, v: float) -> Vector:
    """Return on which side of the ray's line the edges of a triangle pass, all alike if it is around the line."""
    ax, ay = _foot(row[k], row[8 + k], _LEAN_X, u), _foot(row[4 + k], row[8 + k], _LEAN_Y, v)
    bx, by = _foot(row[12 + k], row[20 + k], _LEAN_X, u), _foot(row[16 + k], row[20 + k], _LEAN_Y, v)
    cx, cy = _foot(row[24 + k], row[32 + k], _LEAN_X, u), _foot(row[28 + k], row[32 + k], _LEAN_Y, v)
    return _side(ax, ay, bx, by), _side(bx, by, cx, cy), _side(cx, cy, ax, ay)


@compiled
def _same(row: Any, k: int) -> bool:
    """Return whether triangle k of a leaf is the one before it again."""
    for i in range(9):
        if row[4 * i + k] != row[4 * i + k - 1]:
            return False
    return True


@compiled_strictly
def _foot(x: float, z: float, lean: float, origin: float) -> float:
    """Return how far a corner is from the ray, along the lean."""
    return (x - lean * z) - origin


@compiled_strictly
def _side(ax: float, ay: float, bx: float, by: float) -> float:
    """Return twice the area between an edge and the ray: opposite numbers for opposite directions, and never zero."""
    swapped = (ax > bx) | ((ax == bx) & (ay > by))
    low_x, low_y = (bx, by) if swapped else (ax, ay)
    high_x, high_y = (ax, ay) if swapped else (bx, by)
    area = low_x * high_y - high_x * low_y
    area = _TINY if area == 0.0 else area
    return -area if swapped else area


@inlined
def collides(tables: Tables, room: Room) -> bool:
    """Return whether any tested pair touches, with the robots placed in the room's frames, and measured."""
    frames, spans = room.frames, room.spans
    for link in range(len(tables.links)):
        if tables.links[link, TOP] >= 0 and _meets_obstacle(tables, link, room):
            return True
    for i in range(len(tables.pairs)):
        a, b = tables.pairs[i, 0], tables.pairs[i, 1]
        p, q = frames[tables.links[a, STEP]], frames[tables.links[b, STEP]]
        if (
            abs(p[3] - q[3]) <= spans[a, 0] + spans[b, 0]
            and abs(p[7] - q[7]) <= spans[a, 1] + spans[b, 1]
            and abs(p[11] - q[11]) <= spans[a, 2] + spans[b, 2]
            and touch(tables, tables.links[a, SHAPE], p, tables.links[b, SHAPE], q, room.stack)
        ):
            return True
    return False


@inlined
def measure(tables: Tables, room: Room) -> None:
    """Fill the room's spans from its frames."""
    for link in range(len(tables.links)):
        pose, half = room.frames[tables.links[link, STEP]], tables.halves[tables.links[link, SHAPE]]
        for k in range(3):
            room.spans[link, k] = (
                abs(pose[4 * k]) * half[0] + abs(pose[4 * k + 1]) * half[1] + abs(pose[4 * k + 2]) * half[2]
            )


@inlined
def _meets_obstacle(tables: Tables, link: int, room: Room) -> bool:
    pose, shape = room.frames[tables.links[link, STEP]], tables.links[link, SHAPE]
    span, stack = room.spans[link], room.top
    stack[0] = tables.links[link, TOP]
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
