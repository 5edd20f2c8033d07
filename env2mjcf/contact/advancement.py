"""Proof that an edge is free: distances along it, each of which clears a stretch of the way."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..transforms import Array


def certified(clearance: Callable[[Array], Array], start: Array, delta: Array, motion: float, band: float) -> bool:
    """Return whether bodies provably stay apart on the straight way from `start` to `start + delta`.

    Where bodies are d apart, they cannot meet before they have come d nearer (conservative advancement: Mirtich,
    Impulse-based Dynamic Simulation of Rigid Body Systems, 1996). So each distance clears a stretch on both sides of
    where it was taken; what it leaves is halved, and looked at again.

    Args:
        clearance: Least distances of rows, (n, dim) to (n,).
        start: Where the way begins, (dim,).
        delta: Where it leads from there, (dim,).
        motion: Bound of how much nearer any two bodies can come on the whole way.
        band: Where bodies are as near as this, nothing is proved.
    """
    # Both ends first: most edges that hit, hit there. Then stretches of the way from 0 to 1, as middle and half length.
    ends = clearance(np.stack([start, start + delta]))
    if (ends <= band).any():
        return False
    middle, half = np.array([0.5]), np.array([0.5])
    while len(middle):
        distance = clearance(start + middle[:, None] * delta)
        if (distance <= band).any():
            return False
        open_ = half * motion >= distance
        # Halves of what was not cleared; their sum is the stretch again.
        middle = np.concatenate([middle[open_] - half[open_] / 2, middle[open_] + half[open_] / 2])
        half = np.tile(half[open_] / 2, 2)
    return True
