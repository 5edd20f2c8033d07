"""Separating-axis tests of boxes: of two, and of one against the eight of a node.

The fifteen axes are the sides of both boxes and the cross products of those (Gottschalk et al., OBBTree: A Hierarchical
Structure for Rapid Interference Detection, SIGGRAPH 1996).
"""

from __future__ import annotations

from typing import Any

from ..tables import LANES
from .compiling import compiled
from .poses import Pose, larger, sizes


@compiled
def boxes_apart(m: Pose, a0: float, a1: float, a2: float, b0: float, b1: float, b2: float) -> bool:
    """Return whether boxes with these half sizes about their origins are apart, with b at pose m in the frame of a."""
    r00, r01, r02, x, r10, r11, r12, y, r20, r21, r22, z = m
    s00, s01, s02, s10, s11, s12, s20, s21, s22 = sizes(m)
    return (
        abs(x) > a0 + s00 * b0 + s01 * b1 + s02 * b2
        or abs(y) > a1 + s10 * b0 + s11 * b1 + s12 * b2
        or abs(z) > a2 + s20 * b0 + s21 * b1 + s22 * b2
        or abs(r00 * x + r10 * y + r20 * z) > b0 + s00 * a0 + s10 * a1 + s20 * a2
        or abs(r01 * x + r11 * y + r21 * z) > b1 + s01 * a0 + s11 * a1 + s21 * a2
        or abs(r02 * x + r12 * y + r22 * z) > b2 + s02 * a0 + s12 * a1 + s22 * a2
        or abs(z * r10 - y * r20) > a1 * s20 + a2 * s10 + b1 * s02 + b2 * s01
        or abs(z * r11 - y * r21) > a1 * s21 + a2 * s11 + b0 * s02 + b2 * s00
        or abs(z * r12 - y * r22) > a1 * s22 + a2 * s12 + b0 * s01 + b1 * s00
        or abs(x * r20 - z * r00) > a0 * s20 + a2 * s00 + b1 * s12 + b2 * s11
        or abs(x * r21 - z * r01) > a0 * s21 + a2 * s01 + b0 * s12 + b2 * s10
        or abs(x * r22 - z * r02) > a0 * s22 + a2 * s02 + b0 * s11 + b1 * s10
        or abs(y * r00 - x * r10) > a0 * s10 + a1 * s00 + b1 * s22 + b2 * s21
        or abs(y * r01 - x * r11) > a0 * s11 + a1 * s01 + b0 * s22 + b2 * s20
        or abs(y * r02 - x * r12) > a0 * s12 + a1 * s02 + b0 * s21 + b1 * s20
    )


@compiled
def lanes_near(row: Any, m: Pose, c0: float, c1: float, c2: float, a0: float, a1: float, a2: float) -> int:
    """Return the lanes of a node, (48,), whose boxes overlap a box with centre c and half sizes a, as bits.

    The pose m is that of the node's frame in the box's.
    """
    r00, r01, r02, t0, r10, r11, r12, t1, r20, r21, r22, t2 = m
    s00, s01, s02, s10, s11, s12, s20, s21, s22 = sizes(m)
    t0, t1, t2 = t0 - c0, t1 - c1, t2 - c2
    # What the other box measures along the axes; the same for all lanes.
    u0, u1, u2 = s00 * a0 + s10 * a1 + s20 * a2, s01 * a0 + s11 * a1 + s21 * a2, s02 * a0 + s12 * a1 + s22 * a2
    v00, v01, v02 = a1 * s20 + a2 * s10, a1 * s21 + a2 * s11, a1 * s22 + a2 * s12
    v10, v11, v12 = a0 * s20 + a2 * s00, a0 * s21 + a2 * s01, a0 * s22 + a2 * s02
    v20, v21, v22 = a0 * s10 + a1 * s00, a0 * s11 + a1 * s01, a0 * s12 + a1 * s02
    near = 0
    for k in range(LANES):
        p0, p1, p2, b0, b1, b2 = row[k], row[8 + k], row[16 + k], row[24 + k], row[32 + k], row[40 + k]
        x = r00 * p0 + r01 * p1 + r02 * p2 + t0
        y = r10 * p0 + r11 * p1 + r12 * p2 + t1
        z = r20 * p0 + r21 * p1 + r22 * p2 + t2
        gap = abs(x) - (a0 + s00 * b0 + s01 * b1 + s02 * b2)
        gap = larger(gap, abs(y) - (a1 + s10 * b0 + s11 * b1 + s12 * b2))
        gap = larger(gap, abs(z) - (a2 + s20 * b0 + s21 * b1 + s22 * b2))
        gap = larger(gap, abs(r00 * x + r10 * y + r20 * z) - (b0 + u0))
        gap = larger(gap, abs(r01 * x + r11 * y + r21 * z) - (b1 + u1))
        gap = larger(gap, abs(r02 * x + r12 * y + r22 * z) - (b2 + u2))
        gap = larger(gap, abs(z * r10 - y * r20) - (v00 + b1 * s02 + b2 * s01))
        gap = larger(gap, abs(z * r11 - y * r21) - (v01 + b0 * s02 + b2 * s00))
        gap = larger(gap, abs(z * r12 - y * r22) - (v02 + b0 * s01 + b1 * s00))
        gap = larger(gap, abs(x * r20 - z * r00) - (v10 + b1 * s12 + b2 * s11))
        gap = larger(gap, abs(x * r21 - z * r01) - (v11 + b0 * s12 + b2 * s10))
        gap = larger(gap, abs(x * r22 - z * r02) - (v12 + b0 * s11 + b1 * s10))
        gap = larger(gap, abs(y * r00 - x * r10) - (v20 + b1 * s22 + b2 * s21))
        gap = larger(gap, abs(y * r01 - x * r11) - (v21 + b0 * s22 + b2 * s20))
        gap = larger(gap, abs(y * r02 - x * r12) - (v22 + b0 * s21 + b1 * s20))
        near |= (1 << k) if gap <= 0 else 0
    return near


@compiled
def lanes_about(row: Any, x: float, y: float, z: float, a0: float, a1: float, a2: float) -> int:
    """Return the lanes whose boxes overlap a box of the same frame, as bits."""
    near = 0
    for k in range(LANES):
        gap = abs(row[k] - x) - (row[24 + k] + a0)
        gap = larger(gap, abs(row[8 + k] - y) - (row[32 + k] + a1))
        gap = larger(gap, abs(row[16 + k] - z) - (row[40 + k] + a2))
        near |= (1 << k) if gap <= 0 else 0
    return near
