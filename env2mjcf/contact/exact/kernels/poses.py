"""Poses as twelve numbers, the upper three rows of a transform; small vectors; forward kinematics."""

from __future__ import annotations

import math
from typing import Any

from ..motions import Motion
from ..tables import Tables
from .compiling import compiled, inlined

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


_TURN_Z, _TURN_X, _SLIDE_Z, _BASE = int(Motion.TURN_Z), int(Motion.TURN_X), int(Motion.SLIDE_Z), int(Motion.BASE)


@inlined
def place(tables: Tables, q: Any, frames: Any) -> None:
    """Fill frames, (s, 12), with the world poses of all steps of `motions.Motions` at a configuration, (dim,)."""
    for i in range(len(tables.steps)):
        step = tables.steps[i]
        frame = frames[i]
        motion = step[1]
        constant = tables.constants[i]
        if motion == _BASE:
            _place_base(step, constant, q, frame)
            continue
        if step[0] < 0:
            for k in range(12):
                frame[k] = constant[k]
        else:
            _chain(frames[step[0]], constant, frame)
        if motion == _TURN_Z:
            _turn(frame, 0, 1, q[step[2]])
        elif motion == _TURN_X:
            _turn(frame, 1, 2, q[step[2]])
        elif motion == _SLIDE_Z:
            for k in range(0, 12, 4):
                frame[k + 3] += q[step[2]] * frame[k + 2]


@compiled
def _chain(a: Any, b: Any, out: Any) -> None:
    for k in range(0, 12, 4):
        x, y, z = a[k], a[k + 1], a[k + 2]
        out[k] = x * b[0] + y * b[4] + z * b[8]
        out[k + 1] = x * b[1] + y * b[5] + z * b[9]
        out[k + 2] = x * b[2] + y * b[6] + z * b[10]
        out[k + 3] = x * b[3] + y * b[7] + z * b[11] + a[k + 3]


@compiled
def _turn(frame: Any, i: int, j: int, angle: float) -> None:
    """Turn columns i and j into each other."""
    sine, cosine = math.sin(angle), math.cos(angle)
    for k in range(0, 12, 4):
        x, y = frame[k + i], frame[k + j]
        frame[k + i] = cosine * x + sine * y
        frame[k + j] = cosine * y - sine * x


@compiled
def _place_base(step: Any, constant: Any, q: Any, frame: Any) -> None:
    """Translate and turn by Rz Ry Rx."""
    for k in range(3):
        frame[4 * k + 3] = constant[4 * k + 3] + (q[step[2 + k]] if step[2 + k] >= 0 else 0.0)
    sx, cx = _sine_and_cosine(q, step[5])
    sy, cy = _sine_and_cosine(q, step[6])
    sz, cz = _sine_and_cosine(q, step[7])
    frame[0], frame[1], frame[2] = cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx
    frame[4], frame[5], frame[6] = sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx
    frame[8], frame[9], frame[10] = -sy, cy * sx, cy * cx


@compiled
def _sine_and_cosine(q: Any, column: int) -> tuple[float, float]:
    return (math.sin(q[column]), math.cos(q[column])) if column >= 0 else (0.0, 1.0)
