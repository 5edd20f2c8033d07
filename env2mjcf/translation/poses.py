"""Poses as six numbers that a file can hold."""

from __future__ import annotations

import math

import numpy as np

from ..dialects import RULES
from ..formats.writers.decimals import settled
from ..model import Dialect, Pose
from ..transforms import Array

# All dialects have degrees in poses.
_DEGREE = RULES[Dialect.A].pose_angle
# Noise of a few products of matrices; it would spoil numbers such as 90.
_ANGLE_NOISE_DEGREES = 2e-13
_LENGTH_NOISE = 2e-15


def six_numbers(transform: Array) -> Pose:
    """Return the pose of a rigid transform (4, 4), angles to the last digit also where ry is a quarter turn.

    The angle about z comes first, then that about x is read from what is left when it is taken back, so that the
    product of all three is the rotation again however near a quarter turn ry is.
    """
    r = transform[:3, :3]
    level = math.hypot(r[0, 0], r[1, 0])
    rz = math.atan2(r[1, 0], r[0, 0]) if level > 1e-12 else 0.0
    s, c = math.sin(rz), math.cos(rz)
    rx = math.atan2(s * r[0, 2] - c * r[1, 2], c * r[1, 1] - s * r[0, 1])
    ry = math.atan2(-r[2, 0], level)
    x, y, z = transform[:3, 3]
    noise = _LENGTH_NOISE * (1 + float(np.abs(transform[:3, 3]).max()))
    return Pose((_length(x, noise), _length(y, noise), _length(z, noise)), (_angle(rx), _angle(ry), _angle(rz)))


def _length(value: float, noise: float) -> float:
    near = round(float(value), 12)
    return (near if abs(near - value) <= noise else float(value)) + 0.0


def _angle(value: float) -> float:
    degrees = value / _DEGREE
    near = round(degrees, 10)
    if abs(near - degrees) <= _ANGLE_NOISE_DEGREES:
        return near * _DEGREE + 0.0
    return settled(value, _DEGREE)
