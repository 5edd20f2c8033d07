"""Makes paths shorter: first without detours over single configurations, then by random short cuts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..transforms import Array
from .space import PlanningSpace

Good = Callable[[Array, Array], bool]

# A short cut that saves less than this part of what it replaces is not worth its proof.
_WORTH = 1e-3


def shortened(
    path: Array, space: PlanningSpace, good: Good, rng: np.random.Generator, rounds: int, stop: Callable[[], bool]
) -> Array:
    """Return a path, (j, d), with the same ends, that is no longer.

    Args:
        path: (k, d).
        space: Whose distance counts.
        good: Whether an edge may be part of the path.
        rng: Where short cuts are drawn from.
        rounds: How many short cuts are tried.
        stop: Whether to leave it at what there is.
    """
    path = _straightened(path, space, good, stop)
    for _ in range(rounds):
        if len(path) < 3 or stop():
            break
        path = _cut(path, space, good, rng)
    return _straightened(path, space, good, stop)


def _straightened(path: Array, space: PlanningSpace, good: Good, stop: Callable[[], bool]) -> Array:
    """Go from each configuration straight to the farthest one that halving finds within reach."""
    kept, at, last = [path[0]], 0, len(path) - 1
    while at < last:
        to = last
        while to > at + 1 and not (_worth(path, at, to, space) and good(path[at], path[to])):
            to = at + 1 if stop() else at + max(1, (to - at) // 2)
        kept.append(path[to])
        at = to
    return np.array(kept)


def _cut(path: Array, space: PlanningSpace, good: Good, rng: np.random.Generator) -> Array:
    """Try to join two random places of the path."""
    ways = space.difference(path[:-1], path[1:])
    along = np.concatenate([[0.0], np.cumsum(space.lengths(ways))])
    low, high = np.sort(rng.uniform(0.0, along[-1], size=2))
    first, second = (min(int(np.searchsorted(along, x, side="right")) - 1, len(ways) - 1) for x in (low, high))
    if first == second:
        return path
    a = path[first] + ways[first] * (low - along[first]) / (along[first + 1] - along[first])
    b = path[second] + ways[second] * (high - along[second]) / (along[second + 1] - along[second])
    if space.distance(a, b) > (1 - _WORTH) * (high - low) or not good(a, b):
        return path
    # What is left of the two edges that are cut is part of edges that are good.
    return np.concatenate([path[: first + 1], a[None], b[None], path[second + 1 :]])


def _worth(path: Array, first: int, last: int, space: PlanningSpace) -> bool:
    # A straight way on circles may be the other way round than the path, and longer.
    return space.distance(path[first], path[last]) <= space.path_length(path[first : last + 1]) * (1 + 1e-9)
