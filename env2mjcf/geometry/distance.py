"""Exact distances of triangles from triangles and of points from triangles, many at once; points spread over triangles.

Every answer is the distance of two points that really lie on the two triangles, so rounding can only make it too
large, never too small; degenerate triangles need no case of their own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .topology import Bools, Floats, Ints, area_vectors, face_areas

_TINY = np.finfo(np.float64).tiny
_BLOCK = 2_000_000  # pairs of points and triangles held in memory at once
_FINEST = 64

_Family = tuple[Floats, Floats, Floats]  # squared distances (k, c), points on a and on b (k, c, 3)


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
    normal = area_vectors(b)
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


def distances(points: Floats, vertices: Floats, faces: Ints) -> Floats:
    """Return the distance of each point from the nearest triangle, (k,).

    Only triangles whose bounding sphere may hold the nearest point are looked at closely.

    Args:
        points: (k, 3).
        vertices: (n, 3).
        faces: (m, 3), at least one.
    """
    corners = vertices[faces]
    centers = (corners.min(axis=1) + corners.max(axis=1)) / 2
    radii = np.linalg.norm(corners - centers[:, None], axis=2).max(axis=1)
    slack = 1e-6 * float(np.abs(np.concatenate([points, vertices])).max(initial=0.0))
    out = np.empty(len(points))
    step = max(1, _BLOCK // len(faces))
    for i in range(0, len(points), step):
        some = points[i : i + step]
        square = (some**2).sum(axis=1)[:, None] + (centers**2).sum(axis=1) - 2 * some @ centers.T
        apart = np.sqrt(np.maximum(square, 0.0))
        point, face = np.nonzero(apart - radii <= (apart + radii).min(axis=1)[:, None] + slack)
        exact = _to_triangles(some[point], corners[face])
        out[i : i + step] = np.minimum.reduceat(exact, np.searchsorted(point, np.arange(len(some))))
    return out


def _to_triangles(points: Floats, corners: Floats) -> Floats:
    """Return the distance of each point (k, 3) from its triangle (k, 3, 3)."""
    best = np.full(len(points), np.inf)
    inside = np.ones(len(points), dtype=np.bool_)
    normal = area_vectors(corners)
    for i in range(3):
        start, along = corners[:, i], corners[:, (i + 1) % 3] - corners[:, i]
        to = points - start
        length = np.einsum("ij,ij->i", along, along)
        part = np.divide(np.einsum("ij,ij->i", to, along), length, out=np.zeros(len(to)), where=length > 0)
        best = np.minimum(best, np.linalg.norm(to - np.clip(part, 0.0, 1.0)[:, None] * along, axis=1))
        inside &= np.einsum("ij,ij->i", np.cross(along, to), normal) >= 0
    size = np.linalg.norm(normal, axis=1)
    height = np.abs(np.einsum("ij,ij->i", points - corners[:, 0], normal))
    over = inside & (size > 0)
    best[over] = np.minimum(best[over], height[over] / size[over])
    return best


def spread(vertices: Floats, faces: Ints, count: int) -> tuple[Floats, float]:
    """Spread points over triangles: their corners, and points on their edges and inside of them.

    Args:
        vertices: (n, 3).
        faces: (m, 3).
        count: How many points to make at most; more if there are three for each triangle already.

    Returns:
        The points, (k, 3), and the greatest distance of a point of the surface from the nearest of them.
    """
    corners = vertices[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    width = np.sqrt(2 * float(face_areas(vertices, faces).sum()) / count)
    while True:
        cuts = np.clip(np.ceil(longest / width), 1, _FINEST).astype(np.int64)
        if (cuts == 1).all() or ((cuts + 1) * (cuts + 2) // 2).sum() <= count:
            break
        width *= 1.25  # long thin triangles take more points than their area suggests
    points: list[Floats] = []
    for n in np.unique(cuts):
        i, j = (x.ravel() for x in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
        i, j = i[i + j <= n], j[i + j <= n]
        weights = np.stack([n - i - j, i, j], axis=1) / n
        points.append(np.einsum("sk,fkx->fsx", weights, corners[cuts == n]).reshape(-1, 3))
    # The cut triangles are similar to the whole; no point of one is farther from its corners than this.
    gap = float((longest / cuts).max() / np.sqrt(3.0))
    return np.concatenate(points), gap
