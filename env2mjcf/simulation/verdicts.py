"""Verdicts on many configurations of a scene, and how often each pair of bodies touches in random ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..contact.containment import BoundaryTest
from ..contact.types import Contact, Reason, Verdict, deepest, moved
from ..options import whole
from ..transforms import Array, translated
from .scene import Scene


class Verdicts:
    """Verdicts on configurations.

    Args:
        scene: The scene.
        q: (n, dim) configurations.
        labels: What each is called.
        poses: (n, nlinks, 4, 4) where links stand instead, in rows that are not `fits`.
        fits: (n,) whether q puts the links where they stand; None for all.

    Attributes:
        labels: What each is called.
        in_limits, in_collision, inside, valid: (n,) what `is_valid` asks for, and whether all of it is so.
    """

    def __init__(
        self,
        scene: Scene,
        q: Array,
        labels: Sequence[str],
        poses: Array | None = None,
        fits: NDArray[np.bool_] | None = None,
    ) -> None:
        self._scene, self._q, self.labels = scene, q, labels
        self._placed = np.zeros(len(q), dtype=bool) if fits is None or poses is None else ~fits
        self._boundary = BoundaryTest(scene.compiled.assembly)
        self.in_limits = scene.space.within_limits(q)
        self.in_collision = np.asarray(scene.in_collision(q, progress=True))
        self._poses = scene.link_poses(q)
        if poses is not None and self._placed.any():
            self._poses[self._placed] = poses[self._placed]
            self.in_limits[self._placed] = True
            self.in_collision[self._placed] = [bool(scene.contacts_of_poses(p)) for p in poses[self._placed]]
        self.inside = self._boundary.inside(translated(self._poses, -scene.origin))
        self.valid = self.in_limits & self.inside & ~self.in_collision

    def verdict(self, index: int) -> Verdict:
        """Return all that is wrong with one configuration."""
        q, poses = self._q[index], self._poses[index]
        if self.valid[index]:
            return Verdict(q, ())
        if self._placed[index]:
            origin = self._scene.origin
            outside = moved(self._boundary.outside(translated(poses, -origin)), origin)
            return Verdict(q, (*deepest(self._scene.contacts_of_poses(poses)), *outside))
        return self._scene.explain(q)


def any_rough(scene: Scene, reasons: Sequence[Reason]) -> bool:
    """Return whether a contact's depth is that of a thin plate, not of a body."""
    if scene.report.collision == "hull":
        return False
    plates = {p.name for p in scene.compiled.assembly.parts() if not p.analysis.convex}
    return any(name in plates for c in reasons if isinstance(c, Contact) for name in (c.link, c.other))


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
    """Count in how many configurations each tested pair touches: what need not, or must not, be tested.

    Args:
        scene: The scene.
        samples: Number of configurations: home, then uniform ones within limits, valid or not, the same on every run.

    Returns:
        A count for each pair, in the order of `scene.pairs`.

    Raises:
        TypeError: samples is not a whole number.
        ValueError: It is below 1.
    """
    samples, counts = whole("samples", samples, 1), dict.fromkeys(scene.pairs, 0)
    if counts:
        for q in np.vstack([scene.space.home, scene.space.sample(samples - 1, seed=0)]):
            for pair in {(c.link, c.other) for c in scene.contacts(q)}:
                counts[pair] += 1
    constant = {(p.link, p.other) for p in scene.compiled.pairs.tested if p.constant}
    return tuple(PairCount(*pair, pair in constant, n, samples) for pair, n in counts.items())
