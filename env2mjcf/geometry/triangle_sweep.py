"""How far a mesh must be pushed in a given direction until it no longer crosses another one."""

from __future__ import annotations

import numpy as np

from .topology import Bools, Floats, Ints
from .triangle_search import Jobs, leaves
from .triangle_tree import Forest

# Pairs of nodes or triangles looked at at once: for each push there is all that two meshes have.
_BLOCK = 20_000
# Parameters this far outside of an edge or a triangle still count: what meets edge on must not slip through.
_SLACK = 1e-9


def escapes(trees: Forest, jobs: Jobs, directions: Floats, window: Floats, few: int = 0) -> Floats:
    """Return how far to push mesh a until no triangles cross, (j,): exact; if beyond the window, at least how far.

    While it is pushed, a triangle crosses another during one interval, because both are convex. The answer is the
    first place, from the start, that no interval covers of those that begin in the window.

    Args:
        trees: The meshes.
        jobs: Meshes at relative poses, which may cross.
        directions: (j, 3) unit vectors in the frame of a.
        window: (j,) greatest way.
        few: Of how many pairs of nodes on a level, about, each answer is made, if not of all: it is then at least how
            far.
    """

    def meet(job: Ints, a: Ints, b: Ints) -> Bools:
        kept = _boxes_meet(trees, jobs, directions, window, job, a, b)
        return _thinned(job, kept, few) if few else kept

    job, a, b = leaves(trees, jobs, meet, _BLOCK)
    starts, ends = np.empty(len(job)), np.empty(len(job))
    for i in range(0, len(job), _BLOCK):
        part = slice(i, i + _BLOCK)
        k = job[part]
        moved = trees.triangles[b[part]] @ jobs.rotation[k].transpose(0, 2, 1) + jobs.translation[k][:, None]
        starts[part], ends[part] = _crossing(trees.triangles[a[part]], moved, directions[k])
    met = ends >= 0
    job, starts, ends = job[met], starts[met], ends[met]
    out = np.empty(len(jobs.a))
    order = np.lexsort((starts, job))
    cuts = np.searchsorted(job[order], np.arange(len(jobs.a) + 1))
    for k in range(len(jobs.a)):
        mine = order[cuts[k] : cuts[k + 1]]
        covered = np.maximum.accumulate(np.append(0.0, ends[mine]))
        gap = np.append(starts[mine], np.inf) > covered
        out[k] = covered[int(np.argmax(gap))]
    return out


def _thinned(job: Ints, kept: Bools, few: int) -> Bools:
    """Return so many at most of those that are kept of each job, evenly spread; the jobs are sorted."""
    rows = np.flatnonzero(kept)
    _, first, of, count = np.unique(job[rows], return_index=True, return_inverse=True, return_counts=True)
    rank, share = np.arange(len(rows)) - first[of], np.minimum(few / count, 1.0)[of]
    out = np.zeros_like(kept)
    out[rows[np.floor((rank + 1) * share) > np.floor(rank * share)]] = True
    return out


def _boxes_meet(trees: Forest, jobs: Jobs, directions: Floats, window: Floats, job: Ints, a: Ints, b: Ints) -> Bools:
    """Intersect the intervals in which the boxes overlap along each axis of both."""
    rotation = jobs.rotation[job]
    apart = (rotation @ trees.center[b][..., None])[..., 0] + jobs.translation[job] - trees.center[a]
    frame_a, frame_b = trees.frame[a], rotation @ trees.frame[b]
    turn = np.abs(frame_a.transpose(0, 2, 1) @ frame_b)
    half_a = trees.half[a] + (turn @ trees.half[b][..., None])[..., 0]
    half_b = trees.half[b] + (trees.half[a][:, None] @ turn)[:, 0]
    axes, half = np.concatenate([frame_a, frame_b], axis=2), np.concatenate([half_a, half_b], axis=1)
    half = half * (1 + 1e-9) + 1e-12 * np.abs(apart).max(axis=1, keepdims=True, initial=0)
    offset, speed = (apart[:, None] @ axes)[:, 0], (directions[job][:, None] @ axes)[:, 0]
    # Along an axis that the push does not move on, the boxes overlap all the way or not at all.
    speed = np.where(np.abs(speed) < 1e-14, 1e-14, speed)
    ends = np.stack([(offset - half) / speed, (offset + half) / speed])
    start, end = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
    return (start <= end) & (end >= 0) & (start <= window[job])


def _crossing(a: Floats, b: Floats, direction: Floats) -> tuple[Floats, Floats]:
    """Return between which ways a crosses b, (k,) each; inf and -inf if it never does."""
    ways = np.concatenate([_onto(a, b, direction), _onto(b, a, -direction), _past(a, b, direction)], axis=1)
    met = np.isfinite(ways)
    return np.where(met, ways, np.inf).min(axis=1), np.where(met, ways, -np.inf).max(axis=1)


def _onto(a: Floats, b: Floats, direction: Floats) -> Floats:
    """Return how far each corner of a goes until it is on b, (k, 3); nan if it never is."""
    first, second = b[:, 1] - b[:, 0], b[:, 2] - b[:, 0]
    away = a - b[:, None, 0]
    inverse = _inverse(np.stack([first, second, -direction], axis=2))
    v, w, way = np.moveaxis(away @ inverse.transpose(0, 2, 1), 2, 0)
    return np.where((v >= -_SLACK) & (w >= -_SLACK) & (v + w <= 1 + _SLACK), way, np.nan)


def _past(a: Floats, b: Floats, direction: Floats) -> Floats:
    """Return how far each edge of a goes until it meets each edge of b, (k, 9); nan if it never does."""
    along_a, along_b = (np.roll(t, -1, axis=1) - t for t in (a, b))
    shape = (len(a), 3, 3, 3)
    columns = [
        np.broadcast_to(along_b[:, None], shape),
        np.broadcast_to(-along_a[:, :, None], shape),
        np.broadcast_to(-direction[:, None, None], shape),
    ]
    apart = a[:, :, None] - b[:, None]
    t, s, way = np.moveaxis((_inverse(np.stack(columns, axis=-1)) @ apart[..., None])[..., 0], -1, 0)
    met = (s >= -_SLACK) & (s <= 1 + _SLACK) & (t >= -_SLACK) & (t <= 1 + _SLACK)
    return np.where(met, way, np.nan).reshape(len(a), 9)


def _inverse(matrix: Floats) -> Floats:
    """Invert matrices of three columns, (..., 3, 3); nan where the columns are as good as coplanar."""
    x, y, z = np.moveaxis(matrix, -1, 0)
    rows = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=-2)
    volume = (x * rows[..., 0, :]).sum(axis=-1)
    size = np.linalg.norm(x, axis=-1) * np.linalg.norm(y, axis=-1) * np.linalg.norm(z, axis=-1)
    sound = np.abs(volume) > 1e-12 * size
    return rows / np.where(sound, volume, np.nan)[..., None, None]
