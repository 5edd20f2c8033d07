"""How far bodies are from each other, or how deep in each other, on triangles."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..geometry.topology import Bools, Floats, Ints
from ..geometry.triangle_search import Jobs, Search
from ..pairs import Pair
from ..transforms import Array
from .separation import separations
from .surfaces import Surfaces

# Pairs of bodies that are looked at together: enough for numpy to be busy, few enough to stay in memory.
_JOBS = 4096

BAND = 1e-5
"""Bodies nearer than this, in extents, may touch by the verdicts: cells and triangles differ by no more."""

# What counts as no distance, in extents: far below the band, far above rounding.
_TOUCH_PER_EXTENT = 1e-13


class Clearance:
    """Signed distances over the tested pairs."""

    def __init__(self, pairs: tuple[Pair, ...], surfaces: Surfaces, extent: float) -> None:
        self._surfaces = surfaces
        self._names = list(surfaces.index)
        self._first = np.array([surfaces.index[p.link] for p in pairs], dtype=np.int64)
        self._second = np.array([surfaces.index[p.other] for p in pairs], dtype=np.int64)
        self.touch = _TOUCH_PER_EXTENT * extent

    def signed(self, poses: Mapping[str, Array], n: int) -> Array:
        """Return the least signed distance of any pair, (n,), for world poses by name, (n, 4, 4); inf without pairs."""
        out = np.full(n, np.inf)
        if not len(self._first) or not n:
            return out
        stacked = np.stack([poses[name] for name in self._names], axis=1)
        step = max(1, _JOBS // len(self._first))
        for i in range(0, n, step):
            out[i : i + step] = self._block(stacked[i : i + step])
        return out

    def nearest_pairs(self, poses: Mapping[str, Array]) -> list[int]:
        """Return the pairs at no distance, or else at the least; poses are (1, 4, 4)."""
        jobs = self.pair_jobs(poses, np.arange(len(self._first)))
        distance = Search(self._surfaces.trees, jobs, np.full(len(self._first), np.inf), self.touch).run().distance
        return np.flatnonzero(distance <= distance.min(initial=np.inf)).tolist()

    def pair_jobs(self, poses: Mapping[str, Array], pairs: Ints) -> Jobs:
        """Return the relative poses of some pairs, each a group of its own; poses are (1, 4, 4)."""
        stacked = np.stack([poses[name] for name in self._names], axis=1)
        jobs = self._jobs(stacked, np.zeros(len(pairs), dtype=np.int64), pairs)
        return Jobs(jobs.a, jobs.b, jobs.rotation, jobs.translation, np.arange(len(pairs)))

    def _block(self, poses: Array) -> Array:
        row, pair, apart = self._near(poses)
        jobs = self._jobs(poses, row, pair)
        found = Search(self._surfaces.trees, jobs, np.full(len(poses), np.inf), self.touch).run()
        touches = np.zeros(len(row), dtype=np.bool_)
        touches[found.touching[:, 0]] = True
        deep = touches.copy()
        held = np.flatnonzero(~touches & (apart <= 0))
        deep[held] = self._surfaces.contained(jobs.only(held))
        out = found.distance
        if deep.any():
            out[row[deep]] = 0.0
            np.minimum.at(out, row[deep], -separations(self._surfaces, jobs.only(deep), self.touch)[0])
        return out

    def _near(self, poses: Array) -> tuple[Ints, Ints, Floats]:
        """Return row, pair and distance of bounding spheres, of all pairs that may be the nearest of their row."""
        trees = self._surfaces.trees
        roots = trees.roots[self._surfaces.tree]
        radii = np.linalg.norm(trees.half[roots], axis=1)
        centers = (poses[..., :3, :3] @ trees.center[roots][..., None])[..., 0] + poses[..., :3, 3]
        away = np.linalg.norm(centers[:, self._first] - centers[:, self._second], axis=2)
        reach = radii[self._first] + radii[self._second]
        kept: Bools = away - reach <= (away + reach).min(axis=1, keepdims=True)
        row, pair = np.nonzero(kept)
        return row, pair, (away - reach)[kept]

    def _jobs(self, poses: Array, row: Ints, pair: Ints) -> Jobs:
        first, second = self._first[pair], self._second[pair]
        a, b = poses[row, first], poses[row, second]
        back = a[:, :3, :3].transpose(0, 2, 1)
        apart = (back @ (b[:, :3, 3] - a[:, :3, 3])[..., None])[..., 0]
        return Jobs(self._surfaces.tree[first], self._surfaces.tree[second], back @ b[:, :3, :3], apart, row)
