"""Time ways that answer the same rows, all of them in every round, in one process.

CPU time of the process, so that foreign load costs little; every round begins with another way, and every other one
goes backwards. A ratio of one round is of one moment of the machine: ratios are medians of the rounds' ratios.
"""

from __future__ import annotations

import contextlib
import gc
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

# A way answers a slice of the rows that it was made for.
Way = Callable[[slice], object]

# Rows, at most, on which it is found out how long a way takes, and for about how many seconds.
_TRIAL, _TRIAL_SECONDS = 60, 0.3
# The fewest rows that a turn may have.
_LEAST = 300
# A turn lasts about this long, in seconds, unless its fewest rows last longer; one that lasts too long is left out.
_TURN, _LONGEST_TURN = 0.08, 3.0


@dataclass(frozen=True, slots=True)
class Turn:
    """How a way takes its turns: on which rows, and how often over."""

    part: slice
    repeats: int

    @property
    def rows(self) -> int:
        """Number of rows of one pass."""
        return self.part.stop - self.part.start


@dataclass(frozen=True, slots=True)
class Race:
    """Seconds a row: `times[half][way]` is (rounds,); `turns[half][way]` says of which rows."""

    times: Mapping[str, Mapping[str, np.ndarray]]
    turns: Mapping[str, Mapping[str, Turn]]
    left_out: Mapping[str, float]

    def rounds(self, way: str, half: str | None = None) -> np.ndarray:
        """Return seconds a row in every round, (rounds,); of both halves together without a half."""
        if half is not None:
            return self.times[half][way]
        return np.mean([times[way] for times in self.times.values()], axis=0)

    def median(self, way: str, half: str | None = None) -> float:
        """Return the median of seconds a row."""
        return float(np.median(self.rounds(way, half)))

    def ratio(self, way: str, other: str, half: str | None = None) -> Ratio:
        """Return how many times as long one way takes as another."""
        return Ratio.of(self.rounds(way, half) / self.rounds(other, half))

    def quickest(self, ways: Sequence[str], half: str | None = None) -> str | None:
        """Return the quickest of those that took part."""
        taking_part = [w for w in ways if w in next(iter(self.times.values()))]
        return min(taking_part, key=lambda way: self.median(way, half), default=None)


@dataclass(frozen=True, slots=True)
class Ratio:
    """Median and extremes of the rounds' ratios."""

    median: float
    least: float
    greatest: float

    @classmethod
    def of(cls, ratios: np.ndarray) -> Ratio:
        """Sum up the ratios of all rounds."""
        return cls(float(np.median(ratios)), float(ratios.min()), float(ratios.max()))

    def __str__(self) -> str:
        return f"{self.median:.3g} ({self.least:.2g}..{self.greatest:.2g})"


def trial(way: Way, part: slice) -> float:
    """Return about how many CPU seconds a row takes; the way is warm afterwards."""
    one = slice(part.start, part.start + 1)
    way(one)
    first = _seconds(way, Turn(one, 1))
    rows = int(np.clip(_TRIAL_SECONDS / max(first, 1e-9), 3, _TRIAL))
    return max(_seconds(way, Turn(slice(part.start, min(part.stop, part.start + rows)), 1)), 1e-9)


def quickest_kind(ways: Mapping[str, Way], halves: Mapping[str, slice]) -> str:
    """Return the name of the quickest way on the first rows of each half, the better of two passes."""

    def seconds(way: Way) -> float:
        return sum(min(trial(way, part) for _ in range(2)) for part in halves.values())

    return min(ways, key=lambda name: seconds(ways[name]))


def race(
    ways: Mapping[str, Way],
    halves: Mapping[str, slice],
    rounds: int,
    *,
    needed: Sequence[str] = (),
    least: int = _LEAST,
) -> Race:
    """Let all ways take turns on all halves.

    Args:
        ways: Each by its name.
        halves: Rows by the name of their kind.
        rounds: How often.
        needed: Ways that are never left out, however long they take.
        least: The fewest rows that a turn may have.
    """
    turns: dict[str, dict[str, Turn]] = {half: {} for half in halves}
    left_out: dict[str, float] = {}
    for name, way in ways.items():
        costs = {half: trial(way, part) for half, part in halves.items()}
        if max(costs.values()) * least > _LONGEST_TURN and name not in needed:
            left_out[name] = float(np.mean(list(costs.values())))
            continue
        for half, part in halves.items():
            turns[half][name] = _turn(costs[half], part, least)
    times: dict[str, dict[str, list[float]]] = {half: {name: [] for name in turns[half]} for half in halves}
    with no_collections():
        for number in range(rounds):
            for half in halves:
                for name in order(list(turns[half]), number):
                    times[half][name].append(_seconds(ways[name], turns[half][name]))
    arrays = {half: {name: np.array(t) for name, t in found.items()} for half, found in times.items()}
    return Race(arrays, turns, left_out)


def order(names: list[str], number: int) -> list[str]:
    """Return the order of a round: it begins with another way each time, and goes backwards every other time."""
    turned = names[number % len(names) :] + names[: number % len(names)] if names else []
    return turned[::-1] if number % 2 else turned


@contextlib.contextmanager
def no_collections() -> Iterator[None]:
    """Keep Python's garbage collector out of the timing, as timeit does."""
    gc.collect()
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def _turn(cost: float, part: slice, least: int) -> Turn:
    length = part.stop - part.start
    rows = int(np.clip(_TURN / cost, min(least, length), length))
    repeats = max(1, int(0.5 * _TURN / (cost * rows)))
    return Turn(slice(part.start, part.start + rows), repeats)


def _seconds(way: Way, turn: Turn) -> float:
    start = time.process_time()
    for _ in range(turn.repeats):
        way(turn.part)
    return (time.process_time() - start) / (turn.repeats * turn.rows)
