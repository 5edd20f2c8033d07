"""Which configurations and motions are valid, and how many configurations were looked at to know it."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..simulation.scene import Scene
from ..transforms import Array
from .space import PlanningSpace

# A motion is looked at in rounds: most invalid ones show in the first few configurations, and a round costs as much
# as some ten of them.
_ROUND, _GROWTH = 2, 4
# Times of motions of at most so many steps are kept. Longer motions are each of a length of their own: what was kept of
# them would fill the memory.
_SHORT = 512


class Validity:
    """Answers a planner's questions, in batches, and counts.

    Args:
        scene: The scene.
        space: What moves.
        resolution: Greatest distance that any point of a robot moves between two configurations that are looked at.

    Attributes:
        checks: How many configurations were looked at.
        motions: How many motions were asked about.
        resolution: As above, in metres.
    """

    def __init__(self, scene: Scene, space: PlanningSpace, resolution: float) -> None:
        self._scene, self._space = scene, space
        self.resolution = resolution
        self.checks = self.motions = 0

    def states(self, values: Array) -> NDArray[np.bool_]:
        """Return whether configurations, (n, d), are valid, (n,)."""
        self.checks += len(values)
        return self._scene.valid_rows(self._space.full(values))

    def motion(self, start: Array, end: Array) -> bool:
        """Return whether the straight way from one configuration, (d,), known to be valid, to another is."""
        self.motions += 1
        delta = self._space.difference(start, end)
        steps = max(1, math.ceil(self._space.lengths(delta[None])[0] / self.resolution))
        times = _bisecting(steps)
        first, count = 0, _ROUND
        while first < steps:
            if not self.states(start + times[first : first + count] * delta).all():
                return False
            first, count = first + count, count * _GROWTH
        return True

    def free(self, starts: Array, ends: Array) -> NDArray[np.bool_]:
        """Return which of many motions, (n, d) to (n, d), are valid, (n,): first by their ends, then all the rest."""
        self.motions += len(starts)
        good = self.states(ends)
        left = np.flatnonzero(good)
        deltas = self._space.difference(starts[left], ends[left])
        steps = np.maximum(1, np.ceil(self._space.lengths(deltas) / self.resolution)).astype(np.int64)
        # The time of every step between the ends of each motion, one after the other.
        which = np.repeat(np.arange(len(left)), steps - 1)
        first = np.cumsum(steps - 1) - (steps - 1)
        times = (np.arange(len(which)) - np.repeat(first, steps - 1) + 1) / np.repeat(steps, steps - 1)
        # Every eighth first: most of what hits something does so there.
        for part in (np.arange(len(which)) % 8 == 0, np.arange(len(which)) % 8 != 0):
            here = np.flatnonzero(part & good[left[which]])
            hit = ~self.states(starts[left[which[here]]] + times[here, None] * deltas[which[here]])
            good[left[which[here[hit]]]] = False
        return good


def _bisecting(steps: int) -> Array:
    """Return the times 1/n to 1, (n, 1): the last, then halves, quarters, and so on: each once."""
    return _remembered(steps) if steps <= _SHORT else _times(steps)


@lru_cache(maxsize=_SHORT)
def _remembered(steps: int) -> Array:
    return _times(steps)


def _times(steps: int) -> Array:
    strides = [1 << k for k in range((steps - 1).bit_length(), 0, -1)]
    indices = np.concatenate([[steps], *(np.arange(stride // 2, steps, stride) for stride in strides)])
    times = indices[:, None] / steps
    times.setflags(write=False)
    return times
