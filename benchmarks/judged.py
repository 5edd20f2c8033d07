"""Verdicts held against the triangles: how many differ, and how many of these by more than the band."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from truth import BAND, Truth

import env2mjcf

# Poses that are held at once.
_BODIES_TIMES_ROWS = 300_000


@dataclass(frozen=True, slots=True)
class Disagreements:
    """Verdicts unlike the triangles'.

    Attributes:
        asked: Number of verdicts compared.
        differ: Number of those that differ.
        looked_at: Of how many of these it was found out how far off they are.
        outside: Number of those looked at that are off by more than the band.
    """

    asked: int
    differ: int
    looked_at: int
    outside: int

    def __str__(self) -> str:
        if not self.differ:
            return "0"
        some = "" if self.looked_at == self.differ else f" of {self.looked_at}"
        return f"{self.differ} (**{self.outside}**{some} out)" if self.outside else f"{self.differ} (0{some} out)"


class Judged:
    """What the triangles say of some configurations, and whether verdicts agree.

    Args:
        scene: The scene, with solids.
        rows: (n, dim) configurations of each half: the first ones of its slice.
        halves: Where each half begins among all configurations.
    """

    def __init__(self, scene: env2mjcf.Scene, rows: Mapping[str, np.ndarray], halves: Mapping[str, slice]) -> None:
        self.truth = Truth(scene)
        self._begin = {half: halves[half].start for half in rows}
        self._rows = rows
        self._surface: dict[str, np.ndarray] = {}
        self._solid: dict[str, np.ndarray] = {}
        self._shares: dict[tuple[bytes, bool, str], float] = {}
        step = max(1, _BODIES_TIMES_ROWS // len(self.truth.names))
        for half, q in rows.items():
            found = [self.truth.verdicts(q[i : i + step]) for i in range(0, len(q), step)]
            self._surface[half], self._solid[half] = (np.concatenate(x) for x in zip(*found, strict=True))

    def part(self, half: str, most: int) -> slice:
        """Return the rows of a half on which verdicts can be judged, `most` at most."""
        return slice(self._begin[half], self._begin[half] + min(most, len(self._rows[half])))

    def share(self, half: str, mode: str) -> float:
        """Return the share of configurations in collision."""
        return float((self._surface if mode == "surface" else self._solid)[half].mean())

    def compare(self, verdicts: Mapping[str, np.ndarray], mode: str, most: int) -> Disagreements:
        """Compare verdicts on the first rows of each half.

        Args:
            verdicts: By half.
            mode: "surface" or "solid"; "either" where surfaces and solids may disagree and neither is wrong.
            most: Of how many disagreements it is found out how far off they are, which takes long.
        """
        asked, wrong = 0, []
        for half, answers in verdicts.items():
            surface, solid = self._surface[half][: len(answers)], self._solid[half][: len(answers)]
            expected = surface if mode == "surface" else solid
            counted = surface == solid if mode == "either" else np.ones(len(answers), dtype=bool)
            asked += int(counted.sum())
            wrong += [(self._rows[half][i], bool(answers[i])) for i in np.flatnonzero(counted & (answers != expected))]
        chosen = np.random.default_rng(0).permutation(len(wrong))[:most]
        kind = "surface" if mode == "surface" else "auto"
        outside = sum(self._share(*wrong[i], kind) > BAND for i in chosen)
        return Disagreements(asked, len(wrong), len(chosen), outside)

    def _share(self, row: np.ndarray, verdict: bool, mode: str) -> float:
        key = (row.tobytes(), verdict, mode)
        if key not in self._shares:
            found, _ = self.truth.distance(row) if verdict else self.truth.depth(row, mode)
            self._shares[key] = found / self.truth.scene.extent
        return self._shares[key]
