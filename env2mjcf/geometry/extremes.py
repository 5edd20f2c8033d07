"""The highest of many points along many directions, without a table of all with all."""

from __future__ import annotations

import numpy as np

from ..limits import Work
from .topology import Floats

_LEAF = 8  # points of a box that is not split
_TOGETHER = 512  # directions that go down the tree together
_BLOCK = 1_000_000  # heights held in memory at once


class PointTree:
    """Points, (n, 3), in a tree of boxes that are split at medians.

    What lies below a point that is known is not opened, so that a direction costs little more than the depth of the
    tree where few points are high, and all points of a flat side that it is square to.
    """

    def __init__(self, points: Floats) -> None:
        count = 1 << max(0, int(np.ceil(np.log2(len(points) / _LEAF))))
        # Some points twice where the number does not divide.
        parts = np.resize(points, (-(-len(points) // count) * count, 3))[None]
        # Middles and half sides of the boxes of each depth, and a point of each.
        self._boxes: list[tuple[Floats, Floats, Floats]] = []
        while True:
            low, high = parts.min(axis=1), parts.max(axis=1)
            self._boxes.append(((low + high) / 2, (high - low) / 2, parts[:, 0]))
            if len(parts) == count:
                break
            along = np.take_along_axis(parts, (high - low).argmax(axis=1)[:, None, None], axis=2)[:, :, 0]
            order = np.argsort(along, axis=1, kind="stable")
            parts = np.take_along_axis(parts, order[:, :, None], axis=1).reshape(2 * len(parts), -1, 3)
        self._leaves = parts

    def highest(self, normals: Floats, known: Floats, limits: Floats | None = None, work: Work | None = None) -> Floats:
        """Return the greatest of `known` and the heights of all points, (d,).

        Args:
            normals: (d, 3) directions.
            known: (d,) heights of points that are high already; what is lower is not looked at.
            limits: (d,) heights above which any will do; none where None.
            work: What may be done.

        Raises:
            TooMuchWorkError: It takes more than `work` has left.
        """
        best = known.copy()
        limits = np.full(len(best), np.inf) if limits is None else limits
        for i in range(0, len(normals), _TOGETHER):
            part = slice(i, i + _TOGETHER)
            self._raise(best[part], normals[part], limits[part], work or Work())
        return best

    def _raise(self, best: Floats, normals: Floats, limits: Floats, work: Work) -> None:
        row, node = np.arange(len(normals)), np.zeros(len(normals), dtype=np.int64)
        for depth, (middle, half, sample) in enumerate(self._boxes):
            if depth:
                row, node = np.repeat(row, 2), (2 * node[:, None] + (0, 1)).ravel()
            work.spend(len(row) // _LEAF)
            normal = normals[row]
            np.maximum.at(best, row, (normal * sample[node]).sum(axis=1))
            reach = (normal * middle[node] + np.abs(normal) * half[node]).sum(axis=1)
            opened = (reach > best[row]) & (best[row] <= limits[row])
            row, node = row[opened], node[opened]
        step = max(1, _BLOCK // self._leaves.shape[1])
        for i in range(0, len(row), step):
            r = row[i : i + step]
            heights = (self._leaves[node[i : i + step]] @ normals[r][:, :, None])[:, :, 0]
            np.maximum.at(best, r, heights.max(axis=1))
