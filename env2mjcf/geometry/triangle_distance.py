"""Exact distance of pairs of triangles, many pairs at once.

Every answer is the distance of two points that really lie on the two triangles, so rounding can only make it too
large, never too small; degenerate triangles need no case of their own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .topology import Bools, Floats

_TINY = np.finfo(np.float64).tiny


@dataclass(frozen=True, slots=True, eq=False)
class Nearest:
    """The nearest points of pairs of triangles.

    Attributes:
        distance: (k,) exactly 0 where an edge of one passes through the other.
        on_a, on_b: (k, 3) where.
    """

    distance: Floats
    on_a: Floats
    on_b: Floats


def nearest(a: Floats, b: Floats) -> Nearest:
    """Return the nearest points of triangles, (k, 3, 3) each, in one frame.

    Two triangles are nearest at two edges, or at a corner of one and the inside of the other, or an edge of one
    passes through the other (Ericson, Real-Time Collision Detection, 2005, section 5.1).
    """
    families = [_edges(a, b), _corners(a, b), _flipped(_corners(b, a)), _crossings(a, b), _flipped(_crossings(b, a))]
    squares = np.concatenate([f[0] for f in families], axis=1)
    best = np.argmin(squares, axis=1)[:, None]
    on_a, on_b = (np.concatenate([f[i] for f in families], axis=1) for i in (1, 2))
    on_a, on_b = (np.take_along_axis(p, best[..., None], axis=1)[:, 0] for p in (on_a, on_b))
    return Nearest(np.sqrt(np.take_along_axis(squares, best, axis=1)[:, 0]), on_a, on_b)


_Family = tuple[Floats, Floats, Floats]  # squared distances (k, c), points on a and on b (k, c, 3)


def _flipped(family: _Family) -> _Family:
    return family[0], family[2], family[1]


def _edges(a: Floats, b: Floats) -> _Family:
    """Pair each edge of a with each edge of b (Ericson, section 5.1.9)."""
    along_a, along_b = (np.roll(t, -1, axis=1) - t for t in (a, b))
    aa, bb = (np.maximum(np.einsum("kei,kei->ke", e, e), _TINY) for e in (along_a, along_b))
    aa, bb = aa[:, :, None], bb[:, None, :]
    ab = np.einsum("kei,kfi->kef", along_a, along_b)
    apart = a[:, :, None] - b[:, None, :]
    ar = np.einsum("kei,kefi->kef", along_a, apart)
    br = np.einsum("kfi,kefi->kef", along_b, apart)
    area = aa * bb - ab * ab
    s = np.divide(ab * br - ar * bb, area, out=np.zeros_like(ab), where=area > 1e-16 * aa * bb)
    t = np.clip((ab * np.clip(s, 0, 1) + br) / bb, 0, 1)
    s = np.clip((ab * t - ar) / aa, 0, 1)
    on_a = a[:, :, None] + s[..., None] * along_a[:, :, None]
    on_b = b[:, None, :] + t[..., None] * along_b[:, None, :]
    gap = on_a - on_b
    square = np.einsum("kefi,kefi->kef", gap, gap)
    count = len(a)
    return square.reshape(count, 9), on_a.reshape(count, 9, 3), on_b.reshape(count, 9, 3)


def _corners(a: Floats, b: Floats) -> _Family:
    """Drop each corner of a onto the inside of b; where it falls beside b, edges are nearer."""
    foot, within = _projected(a, b)
    gap = a - foot
    return np.where(within, np.einsum("kci,kci->kc", gap, gap), np.inf), a, foot


def _crossings(a: Floats, b: Floats) -> _Family:
    """Find where edges of a pass through b."""
    normal = np.cross(b[:, 1] - b[:, 0], b[:, 2] - b[:, 0])
    height = np.einsum("kci,ki->kc", a - b[:, None, 0], normal)
    other = np.roll(height, -1, axis=1)
    through = (np.minimum(height, other) <= 0) & (np.maximum(height, other) >= 0) & (height != other)
    t = np.divide(height, height - other, out=np.zeros_like(height), where=through)
    point = a + t[..., None] * (np.roll(a, -1, axis=1) - a)
    foot, within = _projected(point, b)
    return np.where(through & within, 0.0, np.inf), point, foot


def _projected(points: Floats, b: Floats) -> tuple[Floats, Bools]:
    """Return the feet of points, (k, c, 3), in the planes of triangles, and whether they lie within those."""
    first, second = b[:, None, 1] - b[:, None, 0], b[:, None, 2] - b[:, None, 0]
    away = points - b[:, None, 0]
    ff, fs, ss = ((x * y).sum(axis=-1) for x, y in ((first, first), (first, second), (second, second)))
    fp, sp = (first * away).sum(axis=-1), (second * away).sum(axis=-1)
    area = ff * ss - fs * fs
    sound = np.broadcast_to(area > 1e-16 * ff * ss, fp.shape)
    v = np.divide(ss * fp - fs * sp, area, out=np.full_like(fp, -1.0), where=sound)
    w = np.divide(ff * sp - fs * fp, area, out=np.full_like(fp, -1.0), where=sound)
    within = sound & (v >= 0) & (w >= 0) & (v + w <= 1)
    return b[:, None, 0] + v[..., None] * first + w[..., None] * second, within
