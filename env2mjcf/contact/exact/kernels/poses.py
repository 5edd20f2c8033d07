"""Poses as twelve numbers, the upper three rows of a transform one after the other; and small vectors."""

from __future__ import annotations

from typing import Any

from .compiling import compiled

Pose = tuple[float, float, float, float, float, float, float, float, float, float, float, float]
Vector = tuple[float, float, float]

# Added to the sizes of rotations: without it, axes made of two nearly parallel edges separate what overlaps
# (Gottschalk et al., OBBTree, SIGGRAPH 1996). It stands for rotations that are not quite square.
_SKEW = 1e-12


@compiled
def relative(a: Any, b: Any) -> Pose:
    """Return the pose of b in the frame of a, both (12,)."""
    x, y, z = b[3] - a[3], b[7] - a[7], b[11] - a[11]
    return (
        a[0] * b[0] + a[4] * b[4] + a[8] * b[8],
        a[0] * b[1] + a[4] * b[5] + a[8] * b[9],
        a[0] * b[2] + a[4] * b[6] + a[8] * b[10],
        a[0] * x + a[4] * y + a[8] * z,
        a[1] * b[0] + a[5] * b[4] + a[9] * b[8],
        a[1] * b[1] + a[5] * b[5] + a[9] * b[9],
        a[1] * b[2] + a[5] * b[6] + a[9] * b[10],
        a[1] * x + a[5] * y + a[9] * z,
        a[2] * b[0] + a[6] * b[4] + a[10] * b[8],
        a[2] * b[1] + a[6] * b[5] + a[10] * b[9],
        a[2] * b[2] + a[6] * b[6] + a[10] * b[10],
        a[2] * x + a[6] * y + a[10] * z,
    )


@compiled
def inverted(m: Pose) -> Pose:
    """Return the inverse of a pose."""
    r00, r01, r02, x, r10, r11, r12, y, r20, r21, r22, z = m
    return (
        r00, r10, r20, -(r00 * x + r10 * y + r20 * z),
        r01, r11, r21, -(r01 * x + r11 * y + r21 * z),
        r02, r12, r22, -(r02 * x + r12 * y + r22 * z),
    )  # fmt: skip


@compiled
def sizes(m: Pose) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Return the absolute values of a pose's rotation, a little enlarged."""
    return (
        abs(m[0]) + _SKEW, abs(m[1]) + _SKEW, abs(m[2]) + _SKEW,
        abs(m[4]) + _SKEW, abs(m[5]) + _SKEW, abs(m[6]) + _SKEW,
        abs(m[8]) + _SKEW, abs(m[9]) + _SKEW, abs(m[10]) + _SKEW,
    )  # fmt: skip


@compiled
def moved(m: Pose, x: float, y: float, z: float) -> Vector:
    """Return a point of a frame in the frame that the pose is in."""
    return (
        m[0] * x + m[1] * y + m[2] * z + m[3],
        m[4] * x + m[5] * y + m[6] * z + m[7],
        m[8] * x + m[9] * y + m[10] * z + m[11],
    )


@compiled
def cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> Vector:
    """Return the cross product of two vectors."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@compiled
def larger(a: float, b: float) -> float:
    """Return the larger of two numbers; unlike `max`, one instruction for many of them."""
    return a if a > b else b


@compiled
def smaller(a: float, b: float) -> float:
    """Return the smaller of two numbers."""
    return a if a < b else b
