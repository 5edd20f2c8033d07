"""OMPL's view of a scene: its state space, its validators and its planners. Imports OMPL."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any

import numpy as np
from ompl import base, geometric, util

from ..transforms import Array, wrap
from .planner_space import PlanningSpace, Validity
from .planners import OMPL_PLANNERS

# The longest motion that trees grow by, in extents. OMPL's own is a fifth of the space: where the boundary is far
# away, nearly every such motion would hit something, and the tree would not grow at all.
_RANGE = 0.2


class _Layout:
    """Where each degree of freedom stands in a state of OMPL."""

    def __init__(self, space: PlanningSpace) -> None:
        self._dim = space.dim
        self.reals = [(i, p.columns) for i, p in enumerate(space.pieces) if not p.turns]
        self._circles = [(i, p.columns[0]) for i, p in enumerate(space.pieces) if p.turns]

    def read(self, state: Any) -> Array:
        """Return the configuration of a state, (d,)."""
        values = np.empty(self._dim)
        for i, columns in self.reals:
            part = state[i]
            for k, column in enumerate(columns):
                values[column] = part[k]
        for i, column in self._circles:
            values[column] = state[i].value
        return values

    def write(self, state: Any, values: Array) -> None:
        """Put a configuration, (d,), into a state."""
        for i, columns in self.reals:
            for k, column in enumerate(columns):
                state[i][k] = float(values[column])
        for i, column in self._circles:
            state[i].value = float(wrap(values[column]))


class _First(base.ProjectionEvaluator):
    """Projects onto the first degrees of freedom, three at the most, each by its lever."""

    def __init__(self, states: Any, layout: _Layout, weights: Array) -> None:
        super().__init__(states)
        # No reference to the space itself, which holds this one: OMPL's objects would never be freed.
        self._read, self._weights = layout.read, weights[:3]

    def getDimension(self) -> int:
        """Return the number of dimensions of the projection."""
        return len(self._weights)

    def defaultCellSizes(self) -> None:
        """Leave it to OMPL to find them from samples."""

    def project(self, state: Any, projection: Any) -> None:
        """Project a state."""
        projection[:] = self._read(state)[: len(self._weights)] * self._weights


def state_space(space: PlanningSpace) -> tuple[Any, _Layout]:
    """Return a state space of OMPL with the topology of a scene, and where its states hold what.

    The position of a base, and every joint with limits, is a real vector space with bounds; every angle without limits
    is a circle (SO2). The distance is that of `PlanningSpace`.
    """
    states = base.CompoundStateSpace()
    for piece in space.pieces:
        states.addSubspace(base.SO2StateSpace() if piece.turns else _interval(space, piece.columns), piece.weight)
    states.lock()
    layout = _Layout(space)
    # The cells that KPIECE fills: of the position of a base, else of the first joints.
    bases = [i for i, columns in layout.reals if len(columns) > 1]
    projection = base.SubspaceProjectionEvaluator(states, bases[0]) if bases else _First(states, layout, space.weights)
    states.registerDefaultProjection(projection)
    return states, layout


class _Motions(base.MotionValidator):
    """Tells whether motions and states are valid, until there is a reason to stop.

    Nothing is raised through OMPL, whose PRM could not clean up behind it (Ctrl-C would end in an abort): an error is
    kept for later, and planning stopped.
    """

    def __init__(self, information: Any, read: Callable[[Any], Array], validity: Validity) -> None:
        super().__init__(information)
        self._read, self._validity = read, validity
        self._stop: Callable[[], bool] = _never
        self._terminate: Callable[[], None] | None = None
        self._error: BaseException | None = None

    def checkMotion(self, start: Any, end: Any, *_: Any) -> bool:
        """Return whether a motion is valid."""
        return self._answer(lambda: self._validity.motion(self._read(start), self._read(end)))

    def is_valid(self, state: Any) -> bool:
        """Return whether a state is valid."""
        return self._answer(lambda: bool(self._validity.states(self._read(state)[None])[0]))

    @contextmanager
    def until(self, stop: Callable[[], bool], terminate: Callable[[], None]) -> Generator[None]:
        """Call `terminate` when `stop` says so, or when something is wrong; raise then what is wrong."""
        self._stop, self._terminate = stop, terminate
        try:
            yield
        finally:
            self._stop, self._terminate = _never, None
        if self._error is not None:
            error, self._error = self._error, None
            raise error

    def _answer(self, question: Callable[[], bool]) -> bool:
        try:
            if self._stop() and self._terminate is not None:
                self._terminate()
            return self._error is None and question()
        except BaseException as error:
            if self._terminate is None:
                raise
            self._error = self._error or error
            self._terminate()
            return False


def _never() -> bool:
    return False


class _States(base.StateValidityChecker):
    """Tells whether states are valid.

    Python's collector crashes on a `SpaceInformation` of OMPL 2.0.1 whose checker is a function, or OMPL's own.
    """

    def __init__(self, information: Any, is_valid: Callable[[Any], bool]) -> None:
        super().__init__(information)
        self._is_valid = is_valid

    def isValid(self, state: Any) -> bool:
        """Return whether a state is valid."""
        return self._is_valid(state)


class OmplRun:
    """One planner at work on one pair of configurations.

    Args:
        space: What moves.
        validity: What tells which motions are valid.
        planner: One of `OMPL_PLANNERS`.
        start: (d,).
        goal: (d,).
        seed: Of OMPL's random numbers.
    """

    def __init__(
        self, space: PlanningSpace, validity: Validity, planner: str, start: Array, goal: Array, seed: int
    ) -> None:
        self.name, self.validity = planner, validity
        util.setLogLevel(util.LOG_NONE)
        # OMPL does not take zero.
        util.RNG.setSeed(seed + 1)
        self._space, self._goal = space, goal
        states, self._layout = state_space(space)
        self._information = base.SpaceInformation(states)
        self._motions = _Motions(self._information, self._layout.read, validity)
        self._states = _States(self._information, self._motions.is_valid)
        self._information.setStateValidityChecker(self._states)
        self._information.setMotionValidator(self._motions)
        self._information.setup()
        self._problem = base.ProblemDefinition(self._information)
        ends = [self._information.allocState() for _ in range(2)]
        for state, q in zip(ends, (start, goal), strict=True):
            self._layout.write(state, q)
        self._problem.setStartAndGoalStates(ends[0], ends[1])
        self._planner = getattr(geometric, OMPL_PLANNERS[planner])(self._information)
        self._planner.setProblemDefinition(self._problem)
        self._planner.setup()
        if hasattr(self._planner, "setRange"):
            self._planner.setRange(min(self._planner.getRange(), _RANGE * space.extent))

    def solve(self, stop: Callable[[], bool]) -> bool:
        """Plan until there is a solution, or until it is to stop; return whether there is one."""
        # The condition itself must not be Python code: PRM asks it in a thread of its own, and would wait forever for
        # the one that is in here. The validators, which it calls all the time, look at the clock instead.
        condition = base.plannerNonTerminatingCondition()
        with self._motions.until(stop, condition.terminate):
            self._planner.solve(condition)
        return self._problem.hasExactSolution()

    def path(self) -> Array | None:
        """Return the solution, or else the way to what came nearest to the goal, (k, d); None without any."""
        path: Any = self._problem.getSolutionPath()
        if path is not None and path.getStateCount():
            return np.array([self._layout.read(path.getState(i)) for i in range(path.getStateCount())])
        return self._approach()

    def _approach(self) -> Array | None:
        """Return the way to what came nearest to the goal, of all that is joined to the start."""
        data = base.PlannerData(self._information)
        self._planner.getPlannerData(data)
        if not data.numStartVertices():
            return None
        first = data.getStartIndex(0)
        before: dict[int, int] = {first: first}
        waiting = [first]
        while waiting:
            at = waiting.pop()
            for to in data.getEdges(at):
                if to not in before:
                    before[to] = at
                    waiting.append(to)
        rows = {i: self._layout.read(data.getVertex(i).getState()) for i in before}
        at = min(rows, key=lambda i: self._space.distance(rows[i], self._goal))
        way = [at]
        while at != first:
            at = before[at]
            way.append(at)
        return np.array([rows[i] for i in reversed(way)])


def _interval(space: PlanningSpace, columns: tuple[int, ...]) -> Any:
    bounds = base.RealVectorBounds(len(columns))
    for k, column in enumerate(columns):
        bounds.setLow(k, float(space.lower[column]))
        bounds.setHigh(k, float(space.upper[column]))
    reals = base.RealVectorStateSpace(len(columns))
    reals.setBounds(bounds)
    return reals
