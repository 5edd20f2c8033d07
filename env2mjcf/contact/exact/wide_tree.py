"""Trees of axis-aligned boxes over triangles, eight boxes to a node, so that one instruction tests several at once.

All boxes of a mesh share the axes of its frame: between two meshes the fifteen axes of a separating-axis test are then
the same for all pairs of boxes (van den Bergen, Efficient Collision Detection of Complex Deformable Models using AABB
Trees, 1997), and lanes differ by numbers alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...geometry.topology import Floats, Ints
from .tables import BLOCK, LANES

# Of an unused lane: no box is near it. Finite, because compiled code takes for granted that nothing is infinite.
_NOWHERE = -1e150
# Half sizes grow by this part of the tree's size, above rounding and far below the band of verdicts.
_ROUNDING = 1e-13


@dataclass(frozen=True, slots=True, eq=False)
class WideTree:
    """A tree whose node 0 holds the whole in lane 0.

    Attributes:
        boxes: (k, 6, LANES) centres and half sizes, x y z each, of the children of each node.
        child: (k, LANES) node of a child; ~block of a leaf; 0 where a lane is unused.
        blocks: (b, 9, BLOCK) corners of the triangles of each leaf, x y z of the first, second, third.
            Where there are fewer, the last is there several times.
        faces: (b, BLOCK) row of each triangle.
    """

    boxes: Floats
    child: Ints
    blocks: Floats
    faces: Ints


def wide_tree(triangles: Floats) -> WideTree:
    """Build a tree over triangles, (m, 3, 3) with m > 0."""
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    builder = _Builder(low, high, BLOCK)
    leaves = [builder.order[a:b] for a, b in builder.leaves]
    faces = np.array([np.pad(leaf, (0, BLOCK - len(leaf)), mode="edge") for leaf in leaves], dtype=np.int64)
    blocks = np.ascontiguousarray(triangles[faces].reshape(len(faces), BLOCK, 9).transpose(0, 2, 1))
    return WideTree(builder.boxes(), builder.children(), blocks, faces)


def box_tree(low: Floats, high: Floats) -> tuple[Floats, Ints]:
    """Build a tree over boxes with corners (m, 3); its leaves are ~rows of them, one each."""
    builder = _Builder(low, high, 1)
    child = builder.children()
    leaf = child < 0
    rows = np.array([builder.order[a] for a, _ in builder.leaves], dtype=np.int64)
    child[leaf] = ~rows[~child[leaf]]
    return builder.boxes(), child


def depth(child: Ints) -> int:
    """Return the number of levels of a tree whose children come after their parents."""
    levels = np.ones(len(child), dtype=np.int64)
    for node, lanes in enumerate(child):
        inner = lanes[lanes > 0]
        levels[inner] = levels[node] + 1
    return int(levels.max(initial=1))


@dataclass(slots=True, eq=False)
class _Branch:
    """A run of `order` with its box and, unless it is a leaf, its two halves."""

    start: int
    stop: int
    low: Floats
    high: Floats
    halves: tuple[int, int] | None = None


class _Builder:
    """Halves boxes where the surfaces of the halves, weighed by their numbers, are least; then widens the tree.

    The measure is the surface area heuristic (Goldsmith and Salmon, Automatic Creation of Object Hierarchies for Ray
    Tracing, 1987).
    """

    def __init__(self, low: Floats, high: Floats, leaf: int) -> None:
        self._low, self._high, self._leaf = low, high, leaf
        self.order: Ints = np.arange(len(low), dtype=np.int64)
        self._branches: list[_Branch] = []
        self.leaves: list[tuple[int, int]] = []
        self._nodes: list[list[tuple[int, int]]] = []
        self._halve()
        self._widen()
        size = float(np.linalg.norm(high.max(axis=0) - low.min(axis=0)))
        away = float(np.abs([low, high]).max())
        self._slack = _ROUNDING * (size + away)

    def boxes(self) -> Floats:
        """Return the boxes of all nodes, (k, 6, LANES)."""
        out = np.zeros((len(self._nodes), 6, LANES))
        out[:, 3:] = _NOWHERE
        for node, lanes in enumerate(self._nodes):
            for lane, (branch, _) in enumerate(lanes):
                b = self._branches[branch]
                out[node, :3, lane] = (b.low + b.high) / 2
                out[node, 3:, lane] = (b.high - b.low) / 2 + self._slack
        return out

    def children(self) -> Ints:
        """Return the children of all nodes, (k, LANES)."""
        out = np.zeros((len(self._nodes), LANES), dtype=np.int64)
        for node, lanes in enumerate(self._nodes):
            out[node, : len(lanes)] = [code for _, code in lanes]
        return out

    def _branch(self, start: int, stop: int) -> int:
        rows = self.order[start:stop]
        self._branches.append(_Branch(start, stop, self._low[rows].min(axis=0), self._high[rows].max(axis=0)))
        return len(self._branches) - 1

    def _halve(self) -> None:
        open_ = [self._branch(0, len(self.order))]
        while open_:
            branch = self._branches[open_.pop()]
            if branch.stop - branch.start <= self._leaf:
                continue
            middle = self._split(branch)
            branch.halves = self._branch(branch.start, middle), self._branch(middle, branch.stop)
            open_ += branch.halves

    def _split(self, branch: _Branch) -> int:
        """Order a run along the best axis and return where to cut it; halves are multiples of a full leaf."""
        rows = self.order[branch.start : branch.stop]
        low, high = self._low[rows], self._high[rows]
        order = np.argsort(low + high, axis=0, kind="stable")
        cuts = np.arange(self._leaf, len(rows), self._leaf)
        best: tuple[float, int, int] | None = None
        for axis in range(3):
            a, b = low[order[:, axis]], high[order[:, axis]]
            before = np.maximum.accumulate(b)[cuts - 1] - np.minimum.accumulate(a)[cuts - 1]
            after = np.maximum.accumulate(b[::-1])[::-1][cuts] - np.minimum.accumulate(a[::-1])[::-1][cuts]
            cost = _surface(before) * cuts + _surface(after) * (len(rows) - cuts)
            # Of equal costs the cut nearest the middle, so that heaps of equal boxes give no deep trees.
            least = float(cost.min())
            close = cuts[cost <= least * (1 + 1e-9)]
            cut = int(close[np.argmin(np.abs(close - len(rows) / 2))])
            if best is None or least < best[0]:
                best = least, axis, cut
        assert best is not None
        _, axis, cut = best
        self.order[branch.start : branch.stop] = rows[order[:, axis]]
        return branch.start + cut

    def _weight(self, branch: int) -> tuple[float, int]:
        b = self._branches[branch]
        return float(_surface(b.high - b.low)), b.stop - b.start

    def _widen(self) -> None:
        """Give each node the branches that are left when the widest of its branches are opened, until it is full."""
        self._nodes.append([(0, 0)])
        open_ = [(0, 0)]  # node and lane whose branch has no node of its own yet
        while open_:
            node, lane = open_.pop()
            branch = self._branches[self._nodes[node][lane][0]]
            if branch.halves is None:
                self.leaves.append((branch.start, branch.stop))
                self._nodes[node][lane] = (self._nodes[node][lane][0], ~(len(self.leaves) - 1))
                continue
            lanes = list(branch.halves)
            while len(lanes) < LANES:
                inner = [b for b in lanes if self._branches[b].halves is not None]
                if not inner:
                    break
                widest = max(inner, key=self._weight)
                halves = self._branches[widest].halves
                assert halves is not None
                at = lanes.index(widest)
                lanes[at : at + 1] = halves
            self._nodes.append([(b, 0) for b in lanes])
            number = len(self._nodes) - 1
            self._nodes[node][lane] = (self._nodes[node][lane][0], number)
            open_ += [(number, i) for i in range(len(lanes))]


def _surface(size: Floats) -> Floats:
    return (size * np.roll(size, 1, axis=-1)).sum(axis=-1)
