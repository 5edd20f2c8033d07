"""What planning ends with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..transforms import Array


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """A way from start to goal, or how near one came.

    Attributes:
        solved: Whether the path leads to the goal and all of it is valid.
        path: (k, dim) configurations of all robots, to be joined by straight edges, the short way round on periodic
            degrees of freedom. Not solved: the best approach, from the start to what came nearest to the goal.
        certified: (k - 1,) for each edge, whether it is proved that nothing touches on it (`Scene.edge_is_free`).
        dense: (k - 1,) for each edge, whether everything on it is valid at steps of `fine_step`.
        planner: Who found it, or looked for it; several where legs differ.
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
