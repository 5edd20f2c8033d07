"""The planners: their names, what each can do, and several of them in turn until one is done."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from typing import Protocol

from ..errors import did_you_mean
from ..transforms import Array
from .planner_space import PlanningSpace, Validity

# Their names here, and OMPL's classes. Planners that need a space of their own kind (BIT*, AORRTC, informed
# RRT*) cannot have one with circles for angles.
OMPL_PLANNERS = {
    "RRTConnect": "RRTConnect",
    "RRT": "RRT",
    "RRTstar": "RRTstar",
    "KPIECE": "KPIECE1",
    "BKPIECE": "BKPIECE1",
    "LBKPIECE": "LBKPIECE1",
    "PRM": "PRM",
    "PRMstar": "PRMstar",
    "FMT": "FMT",
    "BFMT": "BFMT",
}
BATCH = "BatchEST"
"""Our own planner, which checks motions in batches."""

AUTO = ("RRTConnect", BATCH)
"""The planners that `auto` lets take turns: the quick one, and one for narrow places."""

OPTIMISING = ("RRTstar", "PRMstar")
"""Planners that go on improving what they have found for as long as they may."""

PLANNERS = ("auto", *OMPL_PLANNERS, BATCH)


def checked_planner(name: str) -> str:
    """Return the name of a planner that can be used, as it is listed; any case, and OMPL's own names, will do.

    Raises:
        TypeError: It is not a word.
        ValueError: There is no such planner (the message lists all), or OMPL is not installed.
    """
    if not isinstance(name, str):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise TypeError(f"planner is {name!r}; expected one of {', '.join(PLANNERS)}")
    spelled = {n.lower(): n for n in PLANNERS} | {c.lower(): n for n, c in OMPL_PLANNERS.items()}
    if name.lower() not in spelled:
        guess = _guess(name)
        raise ValueError(
            f"there is no planner {name!r}{f'; {guess}' if guess else ''} (planners: {', '.join(PLANNERS)})"
        )
    if find_spec("ompl") is None:
        raise ValueError(f"planner {spelled[name.lower()]} needs one more package: pip install 'env2mjcf[planning]'")
    return spelled[name.lower()]


def _guess(name: str) -> str:
    """Return which planner a name may be meant for: short forms such as RRTC, and stars, are common."""
    short = re.sub(r"[^a-z0-9]", "", name[:60].lower().replace("*", "star"))
    longer = [n for n in PLANNERS if len(short) > 1 and short in n.lower()]
    longer.sort(key=lambda n: not n.lower().startswith(short))
    return did_you_mean([*longer, short][0], PLANNERS)


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


class CountedRun(Run, Protocol):
    """A planner that tells how much it has looked at."""

    validity: Validity


class RoundRobin:
    """Planners that take turns.

    Attributes:
        name: The planner that has found the solution; before that, all of them.

    Args:
        runs: Planners for the same start and goal.
        space: What they move.
        goal: (d,).
    """

    def __init__(self, runs: Sequence[CountedRun], space: PlanningSpace, goal: Array) -> None:
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
