"""Which triangles come near which cells."""

from __future__ import annotations

import numpy as np

from ...work import Work
from ..topology import Floats, Ints

_BLOCK = 64


def near(low: Floats, high: Floats, lows: Floats, highs: Floats, work: Work) -> tuple[Ints, Ints]:
    """Return the index pairs of boxes (g, 3) and other boxes (m, 3) that overlap, ordered by the former.

    Raises:
        TooMuchWorkError: There are more than `work` has left.
    """
    if len(low) == 0 or len(lows) == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    order = np.argsort(_morton((low + high) / 2), kind="stable")
    found: list[Ints] = []
    others: list[Ints] = []
    for i in range(0, len(order), _BLOCK):
        block = order[i : i + _BLOCK]
        # Few of the others come near any box of a block, because its boxes lie together.
        some = np.flatnonzero(((lows <= high[block].max(axis=0)) & (highs >= low[block].min(axis=0))).all(axis=1))
        work.spend(len(lows) // _BLOCK + len(block) * len(some) // _BLOCK)
        meets = np.ones((len(block), len(some)), dtype=np.bool_)
        for axis in range(3):
            meets &= lows[some, axis] <= high[block, axis, None]
            meets &= highs[some, axis] >= low[block, axis, None]
        a, b = np.nonzero(meets)
        work.spend(len(a))
        found.append(block[a])
        others.append(some[b])
    first, second = np.concatenate(found), np.concatenate(others)
    sort = np.lexsort((second, first))
    return first[sort], second[sort]


def _morton(points: Floats) -> Ints:
    """Return positions along a curve that keeps near points together, (n,)."""
    span = np.ptp(points, axis=0)
    cell = ((points - points.min(axis=0)) / np.where(span > 0, span, 1.0) * 1023).astype(np.int64)
    out = np.zeros(len(points), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            out |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    return out
