"""Whether a point lies inside a solid: how often a ray leaves it."""

from __future__ import annotations

from typing import Any

from .compiling import compiled, compiled_strictly
from .opening import Tables
from .poses import Vector, larger, smaller

_LANES, _BLOCK = 8, 4
_START, _IS_SOLID = 1, 3
_ORIENTED = 1

# The ray goes up along z and leans by this much, so that it meets no edge of a mesh whose edges run along its axes.
_LEAN_X, _LEAN_Y = 0.0123917, 0.0271813
_TINY = 1e-290


@compiled
def holds(tables: Tables, shape: int, x: float, y: float, z: float, stack: Any) -> bool:
    """Return whether a point of a shape's frame lies inside of it: its surface winds around it.

    Counts what a ray passes, outwards minus inwards, which is the winding number of a closed surface. Which side of an
    edge the ray passes is decided from the same numbers for both of its triangles, so that it passes one of the two.
    """
    half = tables.halves[shape]
    if abs(x) >= half[0] or abs(y) >= half[1] or abs(z) >= half[2]:
        return False
    # The ray's foot in the plane z = 0, along its lean.
    u, v = x - _LEAN_X * z, y - _LEAN_Y * z
    winding = 0
    stack[0] = tables.shapes[shape, _START]
    count = 1
    while count > 0:
        count -= 1
        node = stack[count]
        lanes = _lanes_above(tables.boxes[node], u, v, z)
        children = tables.children[node]
        for k in range(_LANES):
            if lanes >> k & 1:
                if children[k] >= 0:
                    stack[count] = children[k]
                    count += 1
                else:
                    winding += _crossings(tables.blocks[~children[k]], u, v, z)
    # Where the triangles are not wound alike, only whether they are an even number is known.
    return winding != 0 if tables.shapes[shape, _IS_SOLID] == _ORIENTED else winding % 2 != 0


@compiled
def _lanes_above(row: Any, u: float, v: float, z: float) -> int:
    """Return the lanes whose boxes a ray from height z up may meet, as bits."""
    lanes = 0
    for k in range(_LANES):
        gap = abs(row[k] - _LEAN_X * row[16 + k] - u) - (row[24 + k] + _LEAN_X * row[40 + k])
        gap = larger(gap, abs(row[8 + k] - _LEAN_Y * row[16 + k] - v) - (row[32 + k] + _LEAN_Y * row[40 + k]))
        gap = larger(gap, z - (row[16 + k] + row[40 + k]))
        lanes |= (1 << k) if gap <= 0 else 0
    return lanes


@compiled
def _crossings(row: Any, u: float, v: float, z: float) -> int:
    """Return how many triangles of a leaf the ray's line leaves through above z, minus those it enters through."""
    around = 0
    for k in range(_BLOCK):
        p, q, r = _sides(row, k, u, v)
        around |= (1 << k) if larger(smaller(smaller(p, q), r), -larger(larger(p, q), r)) > 0 else 0
    total = 0
    for k in range(_BLOCK):
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
