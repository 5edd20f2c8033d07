"""Forward kinematics of compiled code: the steps of `motions.Motions`."""

from __future__ import annotations

import math
from typing import Any

from ..motions import Motion
from .compiling import compiled, inlined
from .opening import Tables

_TURN_Z, _TURN_X, _SLIDE_Z, _BASE = int(Motion.TURN_Z), int(Motion.TURN_X), int(Motion.SLIDE_Z), int(Motion.BASE)


@inlined
def place(tables: Tables, q: Any, frames: Any) -> None:
    """Fill frames, (s, 12), with the world poses of all steps at a configuration, (dim,)."""
    for i in range(len(tables.steps)):
        step = tables.steps[i]
        frame = frames[i]
        motion = step[1]
        if motion == _BASE:
            _place_base(step, q, frame)
            continue
        constant = tables.constants[i]
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
def _place_base(step: Any, q: Any, frame: Any) -> None:
    """Translate and turn by Rz Ry Rx (env-format section 9.2)."""
    for k in range(3):
        frame[4 * k + 3] = q[step[2 + k]] if step[2 + k] >= 0 else 0.0
    sx, cx = _sine_and_cosine(q, step[5])
    sy, cy = _sine_and_cosine(q, step[6])
    sz, cz = _sine_and_cosine(q, step[7])
    frame[0], frame[1], frame[2] = cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx
    frame[4], frame[5], frame[6] = sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx
    frame[8], frame[9], frame[10] = -sy, cy * sx, cy * cx


@compiled
def _sine_and_cosine(q: Any, column: int) -> tuple[float, float]:
    return (math.sin(q[column]), math.cos(q[column])) if column >= 0 else (0.0, 1.0)
