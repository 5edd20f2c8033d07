"""What planning ends with, how far it is, and how long it may take."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..simulation.scene import Scene
from ..transforms import Array
from .planner_space import Validity


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """A way from start to goal, or how near one came.

    Attributes:
        solved: Whether the path leads to the goal and all of it is valid.
        path: (k, dim) configurations of all robots, to be joined by straight edges, the short way round on periodic
            degrees of freedom. Not solved: the best approach, from the start to what came nearest to the goal.
        certified: (k - 1,) for each edge, whether it is proved that nothing touches on it (`Scene.edge_is_free`).
        dense: (k - 1,) for each edge, whether everything on it is valid at steps of `fine_step`.
        planner: The planner that found it, or looked for it; several where legs differ.
        seconds: How long it took, shortening and proofs included.
        checks: How many configurations were looked at; proofs, which look at distances, are not counted.
        length: Of the path: metres of a base, and how far a point of a robot moves, at most, by every other degree of
            freedom.
        left: The distance from the end of the path to the goal, likewise; zero where it is solved.
        resolution: Greatest distance in metres that a point of a robot moved between two checks of the planner.
        fine_step: The same for the checks of `dense`.
        seed: Of the random numbers.
    """

    solved: bool
    path: Array
    certified: NDArray[np.bool_]
    dense: NDArray[np.bool_]
    planner: str
    seconds: float
    checks: int
    length: float
    left: float
    resolution: float
    fine_step: float
    seed: int

    @property
    def checks_per_second(self) -> float:
        """How many configurations were looked at in a second."""
        return self.checks / max(self.seconds, 1e-9)

    def steps(self, scene: Scene) -> Array:
        """Return configurations on the path no farther apart than `resolution`, corners included, (n, dim)."""
        edges = [scene.edge_rows(a, b, self.resolution)[1:] for a, b in pairwise(self.path)]
        for rows, corner in zip(edges, self.path[1:], strict=True):
            rows[-1] = corner
        return np.concatenate([self.path[:1], *edges])


@dataclass(frozen=True, slots=True)
class Progress:
    """How far planning is.

    Attributes:
        leg: Which leg is planned, from 1.
        legs: How many there are.
        doing: What is being done.
        seconds: Since planning began.
        checks: Configurations looked at so far.
        motions: Motions asked about so far.
    """

    leg: int
    legs: int
    doing: str
    seconds: float
    checks: int
    motions: int


# Seconds between two reports.
_INTERVAL = 0.2


class Timekeeper:
    """Tells planners when to stop, reports now and then, and adds up what was checked.

    Args:
        seconds: When time is up, counted from now.
        legs: Number of legs.
        report: Called now and then.

    Attributes:
        leg: Which leg is being planned.
        doing: What is being done.
    """

    def __init__(self, seconds: float, legs: int, report: Callable[[Progress], None] | None) -> None:
        self._began = time.perf_counter()
        self._end = self._began + seconds
        self._legs, self._report = legs, report
        self._next = self._began
        self._counted: list[Validity] = []
        self.leg, self.doing = 1, "planning"

    def counted(self, validity: Validity) -> Validity:
        """Count what is checked there, too, and return it."""
        self._counted.append(validity)
        return validity

    @property
    def checks(self) -> int:
        """How many configurations were looked at."""
        return sum(v.checks for v in self._counted)

    @property
    def left(self) -> float:
        """Seconds that are left."""
        return self._end - time.perf_counter()

    def stop(self) -> bool:
        """Return whether time is up; report, if it is time for that."""
        now = time.perf_counter()
        if self._report is not None and now >= self._next:
            self._next = now + _INTERVAL
            motions = sum(v.motions for v in self._counted)
            self._report(Progress(self.leg, self._legs, self.doing, now - self._began, self.checks, motions))
        return now >= self._end

    def stop_within(self, seconds: float) -> Callable[[], bool]:
        """Return a condition that holds after so many seconds, or when time is up."""
        end = time.perf_counter() + seconds
        return lambda: self.stop() or time.perf_counter() >= end
