"""Distances of triangles, and lower bounds of the distances of boxes; all squared."""

from __future__ import annotations

from typing import Any

from .compiling import compiled
from .poses import Pose, larger, sizes, smaller
from .triangles import Triangle

_LANES, _BLOCK = 8, 4
_FAR = 1e300
# Divides by what may be nothing; below any area or length that counts.
_TINY = 1e-280


@compiled
def lane_gaps(row: Any, m: Pose, c0: float, c1: float, c2: float, a0: float, a1: float, a2: float, out: Any) -> None:
    """Fill out, (8,), with lower bounds of the squared distances of a node's boxes from another box.

    Along the sides of either box: what its gaps add up to. Arguments are those of `boxes.lanes_near`.
    """
    r00, r01, r02, t0, r10, r11, r12, t1, r20, r21, r22, t2 = m
    s00, s01, s02, s10, s11, s12, s20, s21, s22 = sizes(m)
    t0, t1, t2 = t0 - c0, t1 - c1, t2 - c2
    u0, u1, u2 = s00 * a0 + s10 * a1 + s20 * a2, s01 * a0 + s11 * a1 + s21 * a2, s02 * a0 + s12 * a1 + s22 * a2
    for k in range(_LANES):
        p0, p1, p2, b0, b1, b2 = row[k], row[8 + k], row[16 + k], row[24 + k], row[32 + k], row[40 + k]
        x = r00 * p0 + r01 * p1 + r02 * p2 + t0
        y = r10 * p0 + r11 * p1 + r12 * p2 + t1
        z = r20 * p0 + r21 * p1 + r22 * p2 + t2
        g0 = larger(abs(x) - (a0 + s00 * b0 + s01 * b1 + s02 * b2), 0.0)
        g1 = larger(abs(y) - (a1 + s10 * b0 + s11 * b1 + s12 * b2), 0.0)
        g2 = larger(abs(z) - (a2 + s20 * b0 + s21 * b1 + s22 * b2), 0.0)
        h0 = larger(abs(r00 * x + r10 * y + r20 * z) - (b0 + u0), 0.0)
        h1 = larger(abs(r01 * x + r11 * y + r21 * z) - (b1 + u1), 0.0)
        h2 = larger(abs(r02 * x + r12 * y + r22 * z) - (b2 + u2), 0.0)
        out[k] = larger(g0 * g0 + g1 * g1 + g2 * g2, h0 * h0 + h1 * h1 + h2 * h2)


@compiled
def box_gap(m: Pose, a: Any, b: Any) -> float:
    """Return a lower bound of the squared distance of boxes with half sizes a and b, b at pose m in a's frame."""
    s00, s01, s02, s10, s11, s12, s20, s21, s22 = sizes(m)
    x, y, z = m[3], m[7], m[11]
    g0 = larger(abs(x) - (a[0] + s00 * b[0] + s01 * b[1] + s02 * b[2]), 0.0)
    g1 = larger(abs(y) - (a[1] + s10 * b[0] + s11 * b[1] + s12 * b[2]), 0.0)
    g2 = larger(abs(z) - (a[2] + s20 * b[0] + s21 * b[1] + s22 * b[2]), 0.0)
    h0 = larger(abs(m[0] * x + m[4] * y + m[8] * z) - (b[0] + s00 * a[0] + s10 * a[1] + s20 * a[2]), 0.0)
    h1 = larger(abs(m[1] * x + m[5] * y + m[9] * z) - (b[1] + s01 * a[0] + s11 * a[1] + s21 * a[2]), 0.0)
    h2 = larger(abs(m[2] * x + m[6] * y + m[10] * z) - (b[2] + s02 * a[0] + s12 * a[1] + s22 * a[2]), 0.0)
    return larger(g0 * g0 + g1 * g1 + g2 * g2, h0 * h0 + h1 * h1 + h2 * h2)


@compiled
def triangle_gap(a: Triangle, row: Any) -> float:
    """Return a lower bound of the squared distance of a triangle from those of a leaf: that of their boxes."""
    low0, high0 = smaller(smaller(a[0], a[3]), a[6]), larger(larger(a[0], a[3]), a[6])
    low1, high1 = smaller(smaller(a[1], a[4]), a[7]), larger(larger(a[1], a[4]), a[7])
    low2, high2 = smaller(smaller(a[2], a[5]), a[8]), larger(larger(a[2], a[5]), a[8])
    least = _FAR
    for k in range(_BLOCK):
        g0 = _interval_gap(low0, high0, row[k], row[12 + k], row[24 + k])
        g1 = _interval_gap(low1, high1, row[4 + k], row[16 + k], row[28 + k])
        g2 = _interval_gap(low2, high2, row[8 + k], row[20 + k], row[32 + k])
        least = smaller(least, g0 * g0 + g1 * g1 + g2 * g2)
    return least


@compiled
def _interval_gap(low: float, high: float, p: float, q: float, r: float) -> float:
    gap = larger(low - larger(larger(p, q), r), smaller(smaller(p, q), r) - high)
    return larger(gap, 0.0)


@compiled
def triangle_distance(a: Triangle, row: Any) -> float:
    """Return the least squared distance of a triangle from those of a leaf, (36,), given that they do not cross.

    It is attained between two edges, or between a corner and the inside of the other triangle.
    """
    a0, a1, a2, b0, b1, b2, c0, c1, c2 = a
    least = _FAR
    for k in range(_BLOCK):
        p0, p1, p2 = row[k], row[4 + k], row[8 + k]
        q0, q1, q2 = row[12 + k], row[16 + k], row[20 + k]
        r0, r1, r2 = row[24 + k], row[28 + k], row[32 + k]
        d = _edges(a0, a1, a2, b0, b1, b2, p0, p1, p2, q0, q1, q2)
        d = smaller(d, _edges(a0, a1, a2, b0, b1, b2, q0, q1, q2, r0, r1, r2))
        d = smaller(d, _edges(a0, a1, a2, b0, b1, b2, r0, r1, r2, p0, p1, p2))
        d = smaller(d, _edges(b0, b1, b2, c0, c1, c2, p0, p1, p2, q0, q1, q2))
        d = smaller(d, _edges(b0, b1, b2, c0, c1, c2, q0, q1, q2, r0, r1, r2))
        d = smaller(d, _edges(b0, b1, b2, c0, c1, c2, r0, r1, r2, p0, p1, p2))
        d = smaller(d, _edges(c0, c1, c2, a0, a1, a2, p0, p1, p2, q0, q1, q2))
        d = smaller(d, _edges(c0, c1, c2, a0, a1, a2, q0, q1, q2, r0, r1, r2))
        d = smaller(d, _edges(c0, c1, c2, a0, a1, a2, r0, r1, r2, p0, p1, p2))
        d = smaller(d, _corner(a0, a1, a2, p0, p1, p2, q0, q1, q2, r0, r1, r2))
        d = smaller(d, _corner(b0, b1, b2, p0, p1, p2, q0, q1, q2, r0, r1, r2))
        d = smaller(d, _corner(c0, c1, c2, p0, p1, p2, q0, q1, q2, r0, r1, r2))
        d = smaller(d, _corner(p0, p1, p2, a0, a1, a2, b0, b1, b2, c0, c1, c2))
        d = smaller(d, _corner(q0, q1, q2, a0, a1, a2, b0, b1, b2, c0, c1, c2))
        d = smaller(d, _corner(r0, r1, r2, a0, a1, a2, b0, b1, b2, c0, c1, c2))
        least = smaller(least, d)
    return least


@compiled
def _unit_interval(x: float) -> float:
    return smaller(larger(x, 0.0), 1.0)


@compiled
def _edges(
    a0: float, a1: float, a2: float, b0: float, b1: float, b2: float,
    p0: float, p1: float, p2: float, q0: float, q1: float, q2: float,
) -> float:  # fmt: skip
    """Return the squared distance of the edges from a to b and from p to q (Ericson, section 5.1.9)."""
    d0, d1, d2 = b0 - a0, b1 - a1, b2 - a2
    e0, e1, e2 = q0 - p0, q1 - p1, q2 - p2
    w0, w1, w2 = a0 - p0, a1 - p1, a2 - p2
    dd, ee = d0 * d0 + d1 * d1 + d2 * d2 + _TINY, e0 * e0 + e1 * e1 + e2 * e2 + _TINY
    de = d0 * e0 + d1 * e1 + d2 * e2
    dw, ew = d0 * w0 + d1 * w1 + d2 * w2, e0 * w0 + e1 * w1 + e2 * w2
    area = dd * ee - de * de
    # Of nearly parallel edges any point will do: the other one is chosen to suit it, and then this one again.
    s = _unit_interval((de * ew - dw * ee) / area) if area > 1e-16 * dd * ee else 0.0
    t = _unit_interval((de * s + ew) / ee)
    s = _unit_interval((de * t - dw) / dd)
    x, y, z = w0 + s * d0 - t * e0, w1 + s * d1 - t * e1, w2 + s * d2 - t * e2
    return x * x + y * y + z * z


@compiled
def _corner(
    x0: float, x1: float, x2: float, a0: float, a1: float, a2: float,
    b0: float, b1: float, b2: float, c0: float, c1: float, c2: float,
) -> float:  # fmt: skip
    """Return the squared distance of a point from the plane of a triangle if its foot is in it, else a large number."""
    d0, d1, d2 = b0 - a0, b1 - a1, b2 - a2
    e0, e1, e2 = c0 - a0, c1 - a1, c2 - a2
    w0, w1, w2 = x0 - a0, x1 - a1, x2 - a2
    n0, n1, n2 = d1 * e2 - d2 * e1, d2 * e0 - d0 * e2, d0 * e1 - d1 * e0
    area = n0 * n0 + n1 * n1 + n2 * n2
    # Parts of the triangle's area on either side of the foot.
    v = (w1 * e2 - w2 * e1) * n0 + (w2 * e0 - w0 * e2) * n1 + (w0 * e1 - w1 * e0) * n2
    u = (d1 * w2 - d2 * w1) * n0 + (d2 * w0 - d0 * w2) * n1 + (d0 * w1 - d1 * w0) * n2
    height = w0 * n0 + w1 * n1 + w2 * n2
    inside = (v >= 0) & (u >= 0) & (u + v <= area) & (area > _TINY)
    return height * height / (area + _TINY) if inside else _FAR
