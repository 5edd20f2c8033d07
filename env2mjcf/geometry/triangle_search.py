"""The least distance between triangle meshes: branch and bound down pairs of trees, breadth first, in numpy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..limits import COSTLY, Work
from .distance import nearest
from .topology import Bools, Floats, Ints
from .triangle_tree import Forest

# Pairs of triangles whose exact distance is taken at once: the first ones tighten the bound for the others.
_BLOCK = 512
# Where more pairs of nodes than this are left, a few triangles of each group are looked at before going deeper.
_MANY = 256
# Pairs of nodes whose boxes are held in memory at once.
_PAIRS = 1 << 17
_PROBES = 4


@dataclass(frozen=True, slots=True, eq=False)
class Jobs:
    """Pairs of meshes at relative poses.

    Attributes:
        a, b: (j,) trees.
        rotation, translation: (j, 3, 3) and (j, 3), the pose of b in the frame of a.
        group: (j,) jobs of one group share one least distance.
    """

    a: Ints
    b: Ints
    rotation: Floats
    translation: Floats
    group: Ints

    def only(self, chosen: Ints | Bools) -> Jobs:
        """Return some of the jobs."""
        return Jobs(self.a[chosen], self.b[chosen], self.rotation[chosen], self.translation[chosen], self.group[chosen])


@dataclass(frozen=True, slots=True, eq=False)
class Closest:
    """What a search found.

    Attributes:
        distance: (g,) of each group; the bound that the search began with where nothing is nearer.
        job, triangle_a, triangle_b: (g,) where, -1 where nothing is nearer than that bound.
        touching: (t, 3) job and triangles of pairs at no distance: at least one for each job that has any.
    """

    distance: Floats
    job: Ints
    triangle_a: Ints
    triangle_b: Ints
    touching: Ints


class Search:
    """One descent: keeps the pairs of nodes that may hold something nearer than what is known.

    Args:
        trees: The meshes.
        jobs: What to compare.
        bound: (g,) distances beyond which nothing matters, of each group.
        touch: What counts as no distance.
    """

    def __init__(self, trees: Forest, jobs: Jobs, bound: Floats, touch: float) -> None:
        self._trees, self._jobs, self._touch = trees, jobs, touch
        # Upper bounds for pruning, and distances of pairs of triangles that were really looked at.
        self._bound, self._distance = bound.copy(), bound.copy()
        self._where = np.full((len(bound), 3), -1, dtype=np.int64)
        self._hit = np.zeros(len(jobs.a), dtype=np.bool_)
        self._touching: list[Ints] = []

    def run(self) -> Closest:
        """Walk down to the triangles."""
        trees, jobs = self._trees, self._jobs
        job = np.arange(len(jobs.a), dtype=np.int64)
        a, b = trees.roots[jobs.a], trees.roots[jobs.b]
        while True:
            low, high = self._bounds(job, a, b)
            np.minimum.at(self._bound, jobs.group[job], high)
            kept = low <= self._bound[jobs.group[job]]
            job, a, b, low = job[kept], a[kept], b[kept], low[kept]
            if len(job) > _MANY:
                first = self._promising(job, low)
                self._look(job[first], trees.triangle[a[first]], trees.triangle[b[first]])
                kept = (low <= self._bound[jobs.group[job]]) & ~self._hit[job]
                job, a, b, low = job[kept], a[kept], b[kept], low[kept]
            if not (trees.children[a].any() or trees.children[b].any()):
                break
            job, a, b = _opened(trees, job, a, b)
        self._exactly(job, trees.triangle[a], trees.triangle[b], low)
        touching = np.concatenate(self._touching) if self._touching else np.zeros((0, 3), dtype=np.int64)
        job, a, b = self._where.T
        return Closest(self._distance, job, a, b, touching)

    def within(self, reach: float, work: Work | None = None) -> Ints:
        """Return job and triangles, (k, 3), of all pairs of triangles that may be within reach; not pruned further.

        Raises:
            TooMuchWorkError: More nodes must be looked at than `work` has left.
        """

        def near(job: Ints, a: Ints, b: Ints) -> Bools:
            return self._bounds(job, a, b)[0] <= reach

        return np.stack(leaves(self._trees, self._jobs, near, _PAIRS, work), axis=1)

    def _bounds(self, job: Ints, a: Ints, b: Ints) -> tuple[Floats, Floats]:
        """Return lower and upper bounds of the distance of nodes.

        Lower: the gap along the axes of one box, or of the other.
        """
        trees = self._trees
        rotation, translation = self._jobs.rotation[job], self._jobs.translation[job]
        points = np.stack([trees.center[b], trees.point[b]], axis=-1)
        moved = rotation @ points + translation[..., None]
        apart = (moved[..., 0] - trees.center[a])[:, None]
        frame_a, frame_b = trees.frame[a], rotation @ trees.frame[b]
        half_a, half_b = trees.half[a], trees.half[b]
        turn = np.abs(frame_a.transpose(0, 2, 1) @ frame_b)
        gap_a = np.abs((apart @ frame_a)[:, 0]) - half_a - (turn @ half_b[..., None])[..., 0]
        gap_b = np.abs((apart @ frame_b)[:, 0]) - half_b - (half_a[:, None] @ turn)[:, 0]
        gap_a, gap_b = np.maximum(gap_a, 0), np.maximum(gap_b, 0)
        low = np.maximum(np.einsum("ki,ki->k", gap_a, gap_a), np.einsum("ki,ki->k", gap_b, gap_b))
        between = moved[..., 1] - trees.point[a]
        # Rounding of the boxes must not cut off what touches.
        return np.sqrt(low) * (1 - 1e-12) - self._touch, np.linalg.norm(between, axis=1)

    def _promising(self, job: Ints, low: Floats) -> Ints:
        """Return the rows of the least bounds of each group."""
        order = np.argsort(low, kind="stable")
        return order[_rank(self._jobs.group[job[order]]) < _PROBES]

    def _exactly(self, job: Ints, a: Ints, b: Ints, low: Floats) -> None:
        """Take the distance of pairs of triangles, the most promising first, until the rest cannot matter."""
        group = self._jobs.group
        order = np.argsort(low, kind="stable")
        job, a, b, low = job[order], a[order], b[order], low[order]
        while len(job):
            self._look(job[:_BLOCK], a[:_BLOCK], b[:_BLOCK])
            job, a, b, low = job[_BLOCK:], a[_BLOCK:], b[_BLOCK:], low[_BLOCK:]
            kept = (low <= self._bound[group[job]]) & ~self._hit[job]
            job, a, b, low = job[kept], a[kept], b[kept], low[kept]

    def _look(self, job: Ints, a: Ints, b: Ints) -> None:
        triangles, group = self._trees.triangles, self._jobs.group[job]
        moved = triangles[b] @ self._jobs.rotation[job].transpose(0, 2, 1) + self._jobs.translation[job][:, None]
        distance = nearest(triangles[a], moved).distance
        where = np.stack([job, a, b], axis=1)
        touches = distance <= self._touch
        distance[touches] = 0.0
        self._hit[job[touches]] = True
        self._touching.append(where[touches])
        # Of each group the nearest comes last, so that it is what stays.
        order = np.argsort(-distance, kind="stable")
        order = order[distance[order] < self._distance[group[order]]]
        self._distance[group[order]] = distance[order]
        self._where[group[order]] = where[order]
        self._bound = np.minimum(self._bound, self._distance)


def leaves(
    trees: Forest, jobs: Jobs, meet: Callable[[Ints, Ints, Ints], Bools], block: int, work: Work | None = None
) -> tuple[Ints, Ints, Ints]:
    """Walk down all pairs of trees at once, and return job and triangles, (k,) each, of the leaves that meet.

    Args:
        trees: The meshes.
        jobs: What to compare.
        meet: Tells of jobs and pairs of nodes which may have triangles that matter.
        block: How many it is given at a time.
        work: What may be done; None sets no bound.
    """
    job = np.arange(len(jobs.a), dtype=np.int64)
    a, b = trees.roots[jobs.a], trees.roots[jobs.b]
    while True:
        parts = [meet(job[i : i + block], a[i : i + block], b[i : i + block]) for i in range(0, len(job), block)]
        kept = np.concatenate([np.zeros(0, dtype=np.bool_), *parts])
        job, a, b = job[kept], a[kept], b[kept]
        many_a, many_b = trees.children[a], trees.children[b]
        if not (many_a.any() or many_b.any()):
            return job, trees.triangle[a], trees.triangle[b]
        if work is not None:
            work.spend(COSTLY * int((np.maximum(many_a, 1) * np.maximum(many_b, 1)).sum()))
        job, a, b = _opened(trees, job, a, b)


def _opened(trees: Forest, job: Ints, a: Ints, b: Ints) -> tuple[Ints, Ints, Ints]:
    """Replace pairs of nodes by the pairs of their children; a leaf stands for itself."""
    many_a, many_b = np.maximum(trees.children[a], 1), np.maximum(trees.children[b], 1)
    count = many_a * many_b
    of = np.repeat(np.arange(len(job)), count)
    nth = np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)
    step_a, step_b = np.divmod(nth, many_b[of])
    start_a = np.where(trees.children[a] > 0, trees.first[a], a)
    start_b = np.where(trees.children[b] > 0, trees.first[b], b)
    return job[of], start_a[of] + step_a, start_b[of] + step_b


def _rank(values: Ints) -> Ints:
    """Return for each value how many equal ones stand before it."""
    order = np.argsort(values, kind="stable")
    runs = values[order]
    new = np.r_[True, runs[1:] != runs[:-1]] if len(runs) else np.zeros(0, dtype=np.bool_)
    start = np.maximum.accumulate(np.where(new, np.arange(len(runs)), 0))
    out = np.empty(len(values), dtype=np.int64)
    out[order] = np.arange(len(runs)) - start
    return out
