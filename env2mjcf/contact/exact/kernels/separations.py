"""Distances of triangles, and lower bounds of the distances of boxes; all squared."""

from __future__ import annotations

from typing import Any

from ..tables import BLOCK, LANES
from .compiling import compiled
from .poses import Pose, cross, larger, sizes, smaller
from .triangles import Triangle

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
    for k in range(LANES):
        p0, p1, p2, b0, b1, b2 = row[k], row[8 + k], row[16 + k], row[24 + k], row[32 + k], row[40 + k]
        x = r00 * p0 + r01 * p1 + r02 * p2 + t0
        y = r10 * p0 + r11 * p1 + r12 * p2 + t1
        z = r20 * p0 + r21 * p1 + r22 * p2 + t2
        g0 = larger(abs(x) - (a0 + s00 * b0 + s01 * b1 + s02 * b2), 0.0)
        g1 = larger(abs(y) - (a1 + s10 * b0 + s11 * b1 + s12 * b2), 0.0)
        g2 = larger(abs(z) - (a2 + s20 * b0 + s21 * b1 + s22 * b2), 0.0)
        u, v, w = abs(r00 * x + r10 * y + r20 * z), abs(r01 * x + r11 * y + r21 * z), abs(r02 * x + r12 * y + r22 * z)
        h0, h1, h2 = larger(u - (b0 + u0), 0.0), larger(v - (b1 + u1), 0.0), larger(w - (b2 + u2), 0.0)
        # Along the line between the middles.
        away = x * x + y * y + z * z + _TINY
        gap = larger(away - (a0 * abs(x) + a1 * abs(y) + a2 * abs(z) + b0 * u + b1 * v + b2 * w), 0.0)
        out[k] = larger(larger(g0 * g0 + g1 * g1 + g2 * g2, h0 * h0 + h1 * h1 + h2 * h2), gap * gap / away)


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
    """Return a lower bound of the squared distance of a triangle from those of a leaf.

    That of their boxes, or the gap along the line between their middles.
    """
    c0, c1, c2 = a[0] + a[3] + a[6], a[1] + a[4] + a[7], a[2] + a[5] + a[8]
    low0, high0 = smaller(smaller(a[0], a[3]), a[6]), larger(larger(a[0], a[3]), a[6])
    low1, high1 = smaller(smaller(a[1], a[4]), a[7]), larger(larger(a[1], a[4]), a[7])
    low2, high2 = smaller(smaller(a[2], a[5]), a[8]), larger(larger(a[2], a[5]), a[8])
    least = _FAR
    for k in range(BLOCK):
        p0, p1, p2 = row[k], row[4 + k], row[8 + k]
        q0, q1, q2 = row[12 + k], row[16 + k], row[20 + k]
        r0, r1, r2 = row[24 + k], row[28 + k], row[32 + k]
        g0 = _interval_gap(low0, high0, p0, q0, r0)
        g1 = _interval_gap(low1, high1, p1, q1, r1)
        g2 = _interval_gap(low2, high2, p2, q2, r2)
        x, y, z = p0 + q0 + r0 - c0, p1 + q1 + r1 - c1, p2 + q2 + r2 - c2
        near = smaller(smaller(x * p0 + y * p1 + z * p2, x * q0 + y * q1 + z * q2), x * r0 + y * r1 + z * r2)
        u, v, w = x * a[0] + y * a[1] + z * a[2], x * a[3] + y * a[4] + z * a[5], x * a[6] + y * a[7] + z * a[8]
        gap = larger(near - larger(larger(u, v), w), 0.0)
        least = smaller(least, larger(g0 * g0 + g1 * g1 + g2 * g2, gap * gap / _square(x, y, z)))
    return least


@compiled
def _interval_gap(low: float, high: float, p: float, q: float, r: float) -> float:
    gap = larger(low - larger(larger(p, q), r), smaller(smaller(p, q), r) - high)
    return larger(gap, 0.0)


@compiled
def triangle_distance(a: Triangle, row: Any) -> float:
    """Return the least squared distance of a triangle from those of a leaf, (36,), given that they do not cross.

    It is attained between two edges, or between a corner and the inside of the other triangle. Divisions take longest,
    so that lengths and areas are inverted once.
    """
    a0, a1, a2, b0, b1, b2, c0, c1, c2 = a
    d0, d1, d2 = b0 - a0, b1 - a1, b2 - a2
    e0, e1, e2 = c0 - b0, c1 - b1, c2 - b2
    f0, f1, f2 = a0 - c0, a1 - c1, a2 - c2
    dd, ee, ff = _square(d0, d1, d2), _square(e0, e1, e2), _square(f0, f1, f2)
    per_d, per_e, per_f = 1 / dd, 1 / ee, 1 / ff
    m0, m1, m2 = cross(d0, d1, d2, e0, e1, e2)
    per_m = 1 / _square(m0, m1, m2)
    least = _FAR
    for k in range(BLOCK):
        p0, p1, p2 = row[k], row[4 + k], row[8 + k]
        q0, q1, q2 = row[12 + k], row[16 + k], row[20 + k]
        r0, r1, r2 = row[24 + k], row[28 + k], row[32 + k]
        g0, g1, g2 = q0 - p0, q1 - p1, q2 - p2
        h0, h1, h2 = r0 - q0, r1 - q1, r2 - q2
        i0, i1, i2 = p0 - r0, p1 - r1, p2 - r2
        gg, hh, ii = _square(g0, g1, g2), _square(h0, h1, h2), _square(i0, i1, i2)
        per_g, per_h, per_i = 1 / gg, 1 / hh, 1 / ii
        d = _edges(a0 - p0, a1 - p1, a2 - p2, d0, d1, d2, g0, g1, g2, dd, gg, per_d, per_g)
        d = smaller(d, _edges(a0 - q0, a1 - q1, a2 - q2, d0, d1, d2, h0, h1, h2, dd, hh, per_d, per_h))
        d = smaller(d, _edges(a0 - r0, a1 - r1, a2 - r2, d0, d1, d2, i0, i1, i2, dd, ii, per_d, per_i))
        d = smaller(d, _edges(b0 - p0, b1 - p1, b2 - p2, e0, e1, e2, g0, g1, g2, ee, gg, per_e, per_g))
        d = smaller(d, _edges(b0 - q0, b1 - q1, b2 - q2, e0, e1, e2, h0, h1, h2, ee, hh, per_e, per_h))
        d = smaller(d, _edges(b0 - r0, b1 - r1, b2 - r2, e0, e1, e2, i0, i1, i2, ee, ii, per_e, per_i))
        d = smaller(d, _edges(c0 - p0, c1 - p1, c2 - p2, f0, f1, f2, g0, g1, g2, ff, gg, per_f, per_g))
        d = smaller(d, _edges(c0 - q0, c1 - q1, c2 - q2, f0, f1, f2, h0, h1, h2, ff, hh, per_f, per_h))
        d = smaller(d, _edges(c0 - r0, c1 - r1, c2 - r2, f0, f1, f2, i0, i1, i2, ff, ii, per_f, per_i))
        d = smaller(d, _corner(p0 - a0, p1 - a1, p2 - a2, d0, d1, d2, f0, f1, f2, m0, m1, m2, per_m))
        d = smaller(d, _corner(q0 - a0, q1 - a1, q2 - a2, d0, d1, d2, f0, f1, f2, m0, m1, m2, per_m))
        d = smaller(d, _corner(r0 - a0, r1 - a1, r2 - a2, d0, d1, d2, f0, f1, f2, m0, m1, m2, per_m))
        n0, n1, n2 = g1 * h2 - g2 * h1, g2 * h0 - g0 * h2, g0 * h1 - g1 * h0
        per_n = 1 / _square(n0, n1, n2)
        d = smaller(d, _corner(a0 - p0, a1 - p1, a2 - p2, g0, g1, g2, i0, i1, i2, n0, n1, n2, per_n))
        d = smaller(d, _corner(b0 - p0, b1 - p1, b2 - p2, g0, g1, g2, i0, i1, i2, n0, n1, n2, per_n))
        d = smaller(d, _corner(c0 - p0, c1 - p1, c2 - p2, g0, g1, g2, i0, i1, i2, n0, n1, n2, per_n))
        least = smaller(least, d)
    return least


@compiled
def _square(x: float, y: float, z: float) -> float:
    """Return the squared length of a vector, which is not nothing."""
    return x * x + y * y + z * z + _TINY


@compiled
def _unit_interval(x: float) -> float:
    return smaller(larger(x, 0.0), 1.0)


@compiled
def _edges(
    w0: float, w1: float, w2: float, d0: float, d1: float, d2: float, e0: float, e1: float, e2: float,
    dd: float, ee: float, per_d: float, per_e: float,
) -> float:  # fmt: skip
    """Return the squared distance of edges d and e, the first of which begins at w from the second (Ericson, 5.1.9).

    Args: the vectors, their squared lengths, and the inverses of those.
    """
    de = d0 * e0 + d1 * e1 + d2 * e2
    dw, ew = d0 * w0 + d1 * w1 + d2 * w2, e0 * w0 + e1 * w1 + e2 * w2
    area = dd * ee - de * de
    # Of nearly parallel edges any point will do: the other one is chosen to suit it, and then this one again.
    s = _unit_interval((de * ew - dw * ee) / area) if area > 1e-16 * dd * ee else 0.0
    t = _unit_interval((de * s + ew) * per_e)
    s = _unit_interval((de * t - dw) * per_d)
    x, y, z = w0 + s * d0 - t * e0, w1 + s * d1 - t * e1, w2 + s * d2 - t * e2
    return x * x + y * y + z * z


@compiled
def _corner(
    w0: float, w1: float, w2: float, d0: float, d1: float, d2: float, f0: float, f1: float, f2: float,
    n0: float, n1: float, n2: float, per_n: float,
) -> float:  # fmt: skip
    """Return the squared distance of a point from a triangle's plane if its foot is in it, else a large number.

    Args: the point from the first corner, the edges from there and to there, their normal, and the inverse of its
    squared length.
    """
    # Parts of the triangle on either side of the foot.
    u = ((d1 * w2 - d2 * w1) * n0 + (d2 * w0 - d0 * w2) * n1 + (d0 * w1 - d1 * w0) * n2) * per_n
    v = ((f1 * w2 - f2 * w1) * n0 + (f2 * w0 - f0 * w2) * n1 + (f0 * w1 - f1 * w0) * n2) * per_n
    height = w0 * n0 + w1 * n1 + w2 * n2
    inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (per_n < 1 / _TINY)
    return height * height * per_n if inside else _FAR
