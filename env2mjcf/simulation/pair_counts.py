"""Which pairs of bodies never touch, and which always do: what need not, or must not, be tested."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from .scene import Scene

SEED = 0


@dataclass(frozen=True, slots=True)
class PairCount:
    """How often two bodies touched.

    Attributes:
        link, other: Their names.
        constant: Neither can move against the other, so that one look decides.
        touches: Number of configurations in which they touched.
        samples: Number of configurations that were looked at.
    """

    link: str
    other: str
    constant: bool
    touches: int
    samples: int

    @property
    def verdict(self) -> Literal["always", "never", "sometimes"]:
        """What the samples suggest; certain only if `constant`."""
        return "always" if self.touches == self.samples else "sometimes" if self.touches else "never"


def count_touching(scene: Scene, samples: int) -> tuple[PairCount, ...]:
    """Count in how many configurations each tested pair touches.

    Args:
        scene: The scene.
        samples: Number of configurations: home, then uniform ones within limits, valid or not, the same on every run.

    Returns:
        A count for each pair, in the order of `scene.pairs`.

    Raises:
        ValueError: Fewer than one sample was asked for.
    """
    if samples < 1:
        raise ValueError(f"samples is {samples}; expected at least 1")
    counts = dict.fromkeys(scene.pairs, 0)
    if counts:
        for q in np.vstack([scene.space.home, scene.space.sample(samples - 1, SEED)]):
            for pair in {(c.link, c.other) for c in scene.contacts(q)}:
                counts[pair] += 1
    constant = {(p.link, p.other) for p in scene.compiled.pairs.tested if p.constant}
    return tuple(PairCount(*pair, pair in constant, n, samples) for pair, n in counts.items())
