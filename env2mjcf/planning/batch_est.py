"""A planner that checks motions in batches: two trees that grow by changes of a few degrees of freedom at a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..transforms import Array
from .planner_space import PlanningSpace, Validity
from .planners import BATCH

# Changes that are tried at once; their lengths, in extents, are spread evenly over all orders of magnitude.
_BATCH = 256
_SHORTEST, _LONGEST = 1e-3, 0.5
# Size of the cells that count as one place, in extents.
_CELL = 0.05
# So many of the other tree are looked at for a connection, and so many connections tried, in every round.
_LOOKED_AT, _TRIED = 2000, 16


class _Tree:
    """Configurations, each with the one that it was reached from, sorted into cells."""

    def __init__(self, root: Array, space: PlanningSpace) -> None:
        self._space = space
        self._scale = space.weights / (_CELL * space.extent)
        self.q = np.empty((1024, len(root)))
        self.parent: NDArray[np.int64] = np.empty(1024, dtype=np.int64)
        self.size = 0
        self._cells: dict[bytes, list[int]] = {}
        self._members: list[list[int]] = []
        self.add(root[None], np.array([-1]))

    def add(self, rows: Array, parents: NDArray[np.int64]) -> None:
        """Add configurations, (n, d)."""
        end = self.size + len(rows)
        while end > len(self.q):
            self.q = np.concatenate([self.q, np.empty_like(self.q)])
            self.parent = np.concatenate([self.parent, np.empty_like(self.parent)])
        self.q[self.size : end], self.parent[self.size : end] = rows, parents
        keys = np.floor(rows * self._scale).astype(np.int64)
        for i, key in enumerate(keys, self.size):
            members = self._cells.get(key.tobytes())
            if members is None:
                members = self._cells[key.tobytes()] = []
                self._members.append(members)
            members.append(i)
        self.size = end

    def pick(self, n: int, rng: np.random.Generator) -> NDArray[np.int64]:
        """Pick configurations, from every cell as often: where few have been, most is new."""
        cells, within = rng.integers(len(self._members), size=n), rng.random(n)
        chosen = [self._members[c] for c in cells]
        return np.array([members[int(w * len(members))] for members, w in zip(chosen, within, strict=True)])

    def way(self, index: int) -> Array:
        """Return the way from the root to a configuration, (k, d)."""
        indices = [index]
        while (before := int(self.parent[indices[-1]])) >= 0:
            indices.append(before)
        return self.q[indices[::-1]]


class ExpandingRun:
    """Two trees, from start and goal, at work.

    A change moves a random choice of degrees of freedom, by anything from a thousandth of the extent to half of it. In
    a narrow place most changes of everything at once hit something, and yet one degree of freedom may be free to go.

    Args:
        space: What moves.
        validity: What tells which motions are valid.
        start: (d,).
        goal: (d,).
        seed: Of the random numbers.
    """

    def __init__(self, space: PlanningSpace, validity: Validity, start: Array, goal: Array, seed: int) -> None:
        self.name, self.validity = BATCH, validity
        self._space, self._goal = space, goal
        self._rng = np.random.default_rng(seed)
        self._trees = (_Tree(start, space), _Tree(goal, space))
        self._round = 0
        self._solution: Array | None = None

    def solve(self, stop: Callable[[], bool]) -> bool:
        """Plan until the trees meet, or until it is to stop; return whether they have met."""
        while self._solution is None and not stop():
            one, other = self._trees if self._round % 2 == 0 else self._trees[::-1]
            first = one.size
            self._grow(one)
            if one.size > first:
                self._connect(one, np.arange(first, one.size), other)
            self._round += 1
        return self._solution is not None

    def path(self) -> Array | None:
        """Return the solution, or else the way to what came nearest to the goal, (k, d)."""
        if self._solution is not None:
            return self._solution
        tree = self._trees[0]
        ways = self._space.difference(tree.q[: tree.size], self._goal)
        return tree.way(int(np.argmin(self._space.lengths(ways))))

    def _grow(self, tree: _Tree) -> None:
        space, rng = self._space, self._rng
        chosen = tree.pick(_BATCH, rng)
        # From all degrees of freedom to hardly one.
        moved = rng.random((_BATCH, space.dim)) < rng.random((_BATCH, 1))
        moved[np.arange(_BATCH), rng.integers(space.dim, size=_BATCH)] = True
        change = rng.normal(size=(_BATCH, space.dim)) * moved / space.weights
        length = _SHORTEST * (_LONGEST / _SHORTEST) ** rng.random(_BATCH) * space.extent
        change *= (length / space.lengths(change))[:, None]
        rows = space.enforced(tree.q[chosen] + change)
        free = self.validity.free(tree.q[chosen], rows)
        tree.add(rows[free], chosen[free])

    def _connect(self, one: _Tree, new: NDArray[np.int64], other: _Tree) -> None:
        """Try to join the new configurations of a tree to the nearest of the other."""
        some = np.arange(other.size)
        if other.size > _LOOKED_AT:
            some = other.pick(_LOOKED_AT, self._rng)
        if len(new) > _TRIED:
            new = self._rng.choice(new, _TRIED, replace=False)
        gaps = [self._space.lengths(self._space.difference(one.q[i], other.q[some])) for i in new]
        nearest = some[np.argmin(gaps, axis=1)]
        free = self.validity.free(one.q[new], other.q[nearest])
        if free.any():
            k = int(np.argmax(free))
            halves = one.way(int(new[k])), other.way(int(nearest[k]))
            head, tail = halves if one is self._trees[0] else halves[::-1]
            self._solution = np.concatenate([head, tail[::-1]])
