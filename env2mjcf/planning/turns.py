"""Several planners that take turns, until one of them is done."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from ..transforms import Array
from .space import PlanningSpace
from .validity import Validity

# The first turn of each planner, in checks; every round doubles it. Counted in checks and not in seconds, turns are the
# same in every run.
_FIRST_TURN = 100_000


class Run(Protocol):
    """A planner at work, which can be stopped and go on."""

    name: str

    def solve(self, stop: Callable[[], bool]) -> bool:
        """Plan until there is a solution, or until it is to stop; return whether there is one."""
        ...

    def path(self) -> Array | None:
        """Return the solution, or else the way to what came nearest to the goal, (k, d); None without any."""
        ...


class Counted(Run, Protocol):
    """One that tells how much it has looked at."""

    validity: Validity


class Turns:
    """Planners that take turns.

    Attributes:
        name: Who has found the solution; before that, who takes turns.

    Args:
        runs: Planners for the same start and goal.
        space: What they move.
        goal: (d,).
    """

    def __init__(self, runs: Sequence[Counted], space: PlanningSpace, goal: Array) -> None:
        self._runs, self._space, self._goal = runs, space, goal
        self._solved: Run | None = None
        self.name = " and ".join(run.name for run in runs)
        self._turn = _FIRST_TURN

    def solve(self, stop: Callable[[], bool]) -> bool:
        """Let them plan until one has a solution, or until they are to stop."""
        while not stop():
            for run in self._runs:
                end = run.validity.checks + self._turn
                if run.solve(lambda run=run, end=end: stop() or run.validity.checks >= end):
                    self._solved, self.name = run, run.name
                    return True
            self._turn *= 2
        return False

    def path(self) -> Array | None:
        """Return the solution, or else the best approach of all."""
        if self._solved is not None:
            return self._solved.path()
        paths = [path for run in self._runs if (path := run.path()) is not None]
        return min(paths, key=lambda p: self._space.distance(p[-1], self._goal), default=None)
