"""Separating-axis tests of triangles: one against those of a leaf, and a box against those of a leaf.

Two triangles that no plane crosses are apart along a normal of one of them or along the cross product of two edges; in
one plane, along a normal of an edge in that plane (Ericson, Real-Time Collision Detection, 2005, sections 5.2.9-10).
"""

from __future__ import annotations

from typing import Any

from ..tables import BLOCK
from .compiling import compiled
from .poses import Pose, cross, larger, moved, smaller

Triangle = tuple[float, float, float, float, float, float, float, float, float]


@compiled
def corners(row: Any, k: int) -> Triangle:
    """Return triangle k of a leaf, (36,)."""
    return row[k], row[4 + k], row[8 + k], row[12 + k], row[16 + k], row[20 + k], row[24 + k], row[28 + k], row[32 + k]


@compiled
def placed(m: Pose, t: Triangle) -> Triangle:
    """Return a triangle of a frame in the frame that the pose is in."""
    a = moved(m, t[0], t[1], t[2])
    b = moved(m, t[3], t[4], t[5])
    c = moved(m, t[6], t[7], t[8])
    return a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]


@compiled
def _gap(p: float, p2: float, p3: float, q: float, q2: float, q3: float) -> float:
    """Return the gap between the interval of three numbers and that of three others; negative where they overlap."""
    low_p, high_p = smaller(smaller(p, p2), p3), larger(larger(p, p2), p3)
    low_q, high_q = smaller(smaller(q, q2), q3), larger(larger(q, q2), q3)
    return larger(low_p - high_q, low_q - high_p)


@compiled
def _edge_gap(
    e0: float, e1: float, e2: float, f0: float, f1: float, f2: float,
    p0: float, p1: float, p2: float, o0: float, o1: float, o2: float,
    q0: float, q1: float, q2: float, w0: float, w1: float, w2: float,
) -> float:  # fmt: skip
    """Return the gap along the cross product of edges e, from p with o opposite, and f, from q with w opposite."""
    x, y, z = e1 * f2 - e2 * f1, e2 * f0 - e0 * f2, e0 * f1 - e1 * f0
    p = p0 * x + p1 * y + p2 * z
    o = o0 * x + o1 * y + o2 * z
    q = q0 * x + q1 * y + q2 * z
    w = w0 * x + w1 * y + w2 * z
    return larger(smaller(p, o) - larger(q, w), smaller(q, w) - larger(p, o))


@compiled
def triangle_meets(a: Triangle, row: Any) -> bool:
    """Return whether a triangle meets any of a leaf's, (36,), in the same frame."""
    a0, a1, a2, b0, b1, b2, c0, c1, c2 = a
    # Edges from a, b and c on, each with the corner opposite.
    d0, d1, d2 = b0 - a0, b1 - a1, b2 - a2
    e0, e1, e2 = c0 - b0, c1 - b1, c2 - b2
    f0, f1, f2 = a0 - c0, a1 - c1, a2 - c2
    n0, n1, n2 = cross(d0, d1, d2, e0, e1, e2)
    height = a0 * n0 + a1 * n1 + a2 * n2
    crossing = 0
    for k in range(BLOCK):
        p = row[k] * n0 + row[4 + k] * n1 + row[8 + k] * n2 - height
        q = row[12 + k] * n0 + row[16 + k] * n1 + row[20 + k] * n2 - height
        r = row[24 + k] * n0 + row[28 + k] * n1 + row[32 + k] * n2 - height
        gap = larger(smaller(smaller(p, q), r), -larger(larger(p, q), r))
        crossing |= (1 << k) if gap <= 0 else 0
    if crossing == 0:
        return False
    meeting = 0
    for k in range(BLOCK):
        p0, p1, p2 = row[k], row[4 + k], row[8 + k]
        q0, q1, q2 = row[12 + k], row[16 + k], row[20 + k]
        r0, r1, r2 = row[24 + k], row[28 + k], row[32 + k]
        g0, g1, g2 = q0 - p0, q1 - p1, q2 - p2
        h0, h1, h2 = r0 - q0, r1 - q1, r2 - q2
        i0, i1, i2 = p0 - r0, p1 - r1, p2 - r2
        m0, m1, m2 = g1 * h2 - g2 * h1, g2 * h0 - g0 * h2, g0 * h1 - g1 * h0
        level = p0 * m0 + p1 * m1 + p2 * m2
        u = a0 * m0 + a1 * m1 + a2 * m2 - level
        v = b0 * m0 + b1 * m1 + b2 * m2 - level
        w = c0 * m0 + c1 * m1 + c2 * m2 - level
        gap = larger(smaller(smaller(u, v), w), -larger(larger(u, v), w))
        gap = larger(gap, _edge_gap(d0, d1, d2, g0, g1, g2, a0, a1, a2, c0, c1, c2, p0, p1, p2, r0, r1, r2))
        gap = larger(gap, _edge_gap(d0, d1, d2, h0, h1, h2, a0, a1, a2, c0, c1, c2, q0, q1, q2, p0, p1, p2))
        gap = larger(gap, _edge_gap(d0, d1, d2, i0, i1, i2, a0, a1, a2, c0, c1, c2, r0, r1, r2, q0, q1, q2))
        gap = larger(gap, _edge_gap(e0, e1, e2, g0, g1, g2, b0, b1, b2, a0, a1, a2, p0, p1, p2, r0, r1, r2))
        gap = larger(gap, _edge_gap(e0, e1, e2, h0, h1, h2, b0, b1, b2, a0, a1, a2, q0, q1, q2, p0, p1, p2))
        gap = larger(gap, _edge_gap(e0, e1, e2, i0, i1, i2, b0, b1, b2, a0, a1, a2, r0, r1, r2, q0, q1, q2))
        gap = larger(gap, _edge_gap(f0, f1, f2, g0, g1, g2, c0, c1, c2, b0, b1, b2, p0, p1, p2, r0, r1, r2))
        gap = larger(gap, _edge_gap(f0, f1, f2, h0, h1, h2, c0, c1, c2, b0, b1, b2, q0, q1, q2, p0, p1, p2))
        gap = larger(gap, _edge_gap(f0, f1, f2, i0, i1, i2, c0, c1, c2, b0, b1, b2, r0, r1, r2, q0, q1, q2))
        meeting |= (1 << k) if gap <= 0 else 0
    meeting &= crossing
    if meeting == 0:
        return False
    for k in range(BLOCK):
        if meeting >> k & 1:
            b = corners(row, k)
            if not (_beside(a, b) or _beside(b, a)):
                return True
    return False


@compiled
def _beside(a: Triangle, b: Triangle) -> bool:
    """Return whether triangles are apart along the normal of an edge of the first in its own plane."""
    a0, a1, a2, b0, b1, b2, c0, c1, c2 = a
    n0, n1, n2 = cross(b0 - a0, b1 - a1, b2 - a2, c0 - b0, c1 - b1, c2 - b2)
    for k in range(3):
        i, j = 3 * k, (3 * k + 3) % 9
        x, y, z = cross(n0, n1, n2, a[j] - a[i], a[j + 1] - a[i + 1], a[j + 2] - a[i + 2])
        p, p2, p3 = a0 * x + a1 * y + a2 * z, b0 * x + b1 * y + b2 * z, c0 * x + c1 * y + c2 * z
        q, q2 = b[0] * x + b[1] * y + b[2] * z, b[3] * x + b[4] * y + b[5] * z
        if _gap(p, p2, p3, q, q2, b[6] * x + b[7] * y + b[8] * z) > 0:
            return True
    return False


@compiled
def box_meets(row: Any, m: Pose, h0: float, h1: float, h2: float) -> bool:
    """Return whether a box about the origin, with half sizes h, meets any triangle of a leaf, (36,), at pose m.

    The box is solid: a triangle inside of it meets it. Axes: its sides, the triangle's normal, and the cross products
    of both (Akenine-Moeller, Fast 3D Triangle-Box Overlap Testing, 2001).
    """
    r00, r01, r02, t0, r10, r11, r12, t1, r20, r21, r22, t2 = m
    meeting = 0
    for k in range(BLOCK):
        x, y, z = row[k], row[4 + k], row[8 + k]
        p0 = r00 * x + r01 * y + r02 * z + t0
        p1 = r10 * x + r11 * y + r12 * z + t1
        p2 = r20 * x + r21 * y + r22 * z + t2
        x, y, z = row[12 + k], row[16 + k], row[20 + k]
        q0 = r00 * x + r01 * y + r02 * z + t0
        q1 = r10 * x + r11 * y + r12 * z + t1
        q2 = r20 * x + r21 * y + r22 * z + t2
        x, y, z = row[24 + k], row[28 + k], row[32 + k]
        s0 = r00 * x + r01 * y + r02 * z + t0
        s1 = r10 * x + r11 * y + r12 * z + t1
        s2 = r20 * x + r21 * y + r22 * z + t2
        gap = larger(smaller(smaller(p0, q0), s0), -larger(larger(p0, q0), s0)) - h0
        gap = larger(gap, larger(smaller(smaller(p1, q1), s1), -larger(larger(p1, q1), s1)) - h1)
        gap = larger(gap, larger(smaller(smaller(p2, q2), s2), -larger(larger(p2, q2), s2)) - h2)
        g0, g1, g2 = q0 - p0, q1 - p1, q2 - p2
        e0, e1, e2 = s0 - q0, s1 - q1, s2 - q2
        i0, i1, i2 = p0 - s0, p1 - s1, p2 - s2
        n0, n1, n2 = g1 * e2 - g2 * e1, g2 * e0 - g0 * e2, g0 * e1 - g1 * e0
        gap = larger(gap, abs(p0 * n0 + p1 * n1 + p2 * n2) - (h0 * abs(n0) + h1 * abs(n1) + h2 * abs(n2)))
        gap = larger(gap, _side_gap(g0, g1, g2, p0, p1, p2, s0, s1, s2, h0, h1, h2))
        gap = larger(gap, _side_gap(e0, e1, e2, q0, q1, q2, p0, p1, p2, h0, h1, h2))
        gap = larger(gap, _side_gap(i0, i1, i2, s0, s1, s2, q0, q1, q2, h0, h1, h2))
        meeting |= (1 << k) if gap <= 0 else 0
    return meeting != 0


@compiled
def _side_gap(
    e0: float, e1: float, e2: float, p0: float, p1: float, p2: float,
    o0: float, o1: float, o2: float, h0: float, h1: float, h2: float,
) -> float:  # fmt: skip
    """Return the largest gap along the cross products of an edge e, from p with o opposite, and a box's sides."""
    u, v = p2 * e1 - p1 * e2, o2 * e1 - o1 * e2
    gap = larger(smaller(u, v), -larger(u, v)) - (h1 * abs(e2) + h2 * abs(e1))
    u, v = p0 * e2 - p2 * e0, o0 * e2 - o2 * e0
    gap = larger(gap, larger(smaller(u, v), -larger(u, v)) - (h0 * abs(e2) + h2 * abs(e0)))
    u, v = p1 * e0 - p0 * e1, o1 * e0 - o0 * e1
    return larger(gap, larger(smaller(u, v), -larger(u, v)) - (h0 * abs(e1) + h1 * abs(e0)))
