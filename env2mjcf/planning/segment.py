"""One segment of a path, which reports call a leg: found, mended where it passes over something, shortened, proved."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import import_module
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..simulation.scene import Scene
from ..transforms import Array
from .batch_est import ExpandingRun
from .planner_space import PlanningSpace, Validity
from .planners import AUTO, BATCH, OPTIMISING, CountedRun, RoundRobin, Run
from .result import Timekeeper

# How much finer than the planner's steps those are that a solution is checked at.
_FINER = 50
# A solution that passes over something is mended with steps this much finer, for this long; else planned anew.
_MENDING, _MENDING_SECONDS = 8, 3.0
# Before that it is tried to nudge it, from this far to that far, in extents, and so many times.
_NUDGES = (1e-4, 5e-2, 150)
# Short cuts that are tried, and for how long at most.
_CUTS, _CUTTING_SECONDS = 300, 5.0
# The part of what time is left that planners get which always take all.
_OPTIMISING = 0.7


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """What was found for one segment, its path (k, d), in the words of `Plan`."""

    solved: bool
    planner: str
    path: Array
    certified: NDArray[np.bool_]
    dense: NDArray[np.bool_]
    left: float
    resolution: float
    fine_step: float


@dataclass(slots=True)
class SegmentPlanner:
    """Plans one segment.

    Attributes:
        scene: The scene.
        space: What moves.
        planner: Name of the planner.
        resolution: Of its checks, in metres.
        seeds: Where random numbers come from.
        watch: When to stop.
        shorten: Whether to make paths shorter.
    """

    scene: Scene
    space: PlanningSpace
    planner: str
    resolution: float
    seeds: np.random.SeedSequence
    watch: Timekeeper
    shorten: bool
    # The planner that has found, or looked for, the path; not the one that mended a detail of it.
    _by: str = field(init=False)
    _fine: Validity = field(init=False)

    def __post_init__(self) -> None:
        self._by = self.planner
        self._fine = self.watch.counted(Validity(self.scene, self.space, self.resolution / _FINER))

    def plan(self, start: Array, goal: Array) -> Segment:
        """Return a way from start to goal, (d,) each, both valid; or the best approach."""
        resolution, best = self.resolution, np.stack([start])
        while not self.watch.stop():
            self.watch.doing = "planning"
            run = self._run(self.planner, start, goal, resolution)
            # A planner that never stops by itself leaves time for the rest.
            optimising = self.planner in OPTIMISING
            stop = self.watch.stop_within(_OPTIMISING * self.watch.left) if optimising else self.watch.stop
            found, way = _searched(run, start, goal, stop)
            self._by = run.name
            if found is None:
                best = min(best, way, key=lambda p: self.space.distance(p[-1], goal))
                break
            good = self._mended(found, resolution)
            if good is not None:
                return self._finished(good, goal, resolution)
            resolution /= 4
        return self._result(best, goal, resolution, solved=False)

    def _run(self, planner: str, start: Array, goal: Array, resolution: float) -> Run:
        seed = int(self.seeds.spawn(1)[0].generate_state(1)[0] >> 1)
        runs: list[CountedRun] = []
        for name in AUTO if planner == "auto" else (planner,):
            validity = self.watch.counted(Validity(self.scene, self.space, resolution))
            runs.append(_begun(name, self.space, validity, start, goal, seed))
        return runs[0] if len(runs) == 1 else RoundRobin(runs, self.space, goal)

    def _mended(self, path: Array, resolution: float) -> Array | None:
        """Return the path with detours where edges are not good; None where there is no quick one."""
        self.watch.doing = "proving"
        good = [self._good(a, b) for a, b in pairwise(path)]
        pieces, first = [path[:1]], 0
        while first < len(good):
            last = first + 1
            while not good[first] and last < len(good) and not good[last]:
                last += 1
            stretch = path[first : last + 1] if good[first] else self._detour(path[first : last + 1], resolution)
            if stretch is None:
                return None
            pieces.append(stretch[1:])
            first = last
        return np.concatenate(pieces)

    def _detour(self, stretch: Array, resolution: float) -> Array | None:
        """Return a way between the ends of edges that are not good; the edges where they are valid, yet not proved."""
        nudged = self._nudged(stretch)
        if nudged is not None:
            return nudged
        start, goal = stretch[0], stretch[-1]
        run = self._run("RRTConnect", start, goal, resolution / _MENDING)
        found, _ = _searched(run, start, goal, self.watch.stop_within(_MENDING_SECONDS))
        if found is not None and all(self._good(a, b) for a, b in pairwise(found)):
            return found
        return stretch if all(self._fine.motion(a, b) for a, b in pairwise(stretch)) else None

    def _nudged(self, stretch: Array) -> Array | None:
        """Return a way through one point near what lies between the ends, farther and farther from it."""
        rng, space = np.random.default_rng(self.seeds.spawn(1)[0]), self.space
        start, goal = stretch[0], stretch[-1]
        for size in np.geomspace(*_NUDGES) * space.extent:
            if self.watch.stop():
                break
            if len(stretch) == 2:
                point = start + rng.random() * space.difference(start, goal)
            else:
                point = stretch[rng.integers(1, len(stretch) - 1)]
            point = space.enforced((point + rng.normal(size=space.dim) * size / space.weights)[None])[0]
            if self._good(start, point) and self._good(point, goal):
                return np.stack([start, point, goal])
        return None

    def _good(self, start: Array, end: Array) -> bool:
        """Return whether an edge is valid at fine steps, and proved to be free."""
        return self._fine.motion(start, end) and bool(self._certified(np.stack([start, end]))[0])

    def _certified(self, path: Array) -> NDArray[np.bool_]:
        rows = self.space.full(path)
        return np.asarray(self.scene.edge_is_free(rows[:-1], rows[1:], threads=1))

    def _finished(self, path: Array, goal: Array, resolution: float) -> Segment:
        if self.shorten:
            self.watch.doing = "shortening"
            rng = np.random.default_rng(self.seeds.spawn(1)[0])
            stop = self.watch.stop_within(_CUTTING_SECONDS)
            path = shortened(path, self.space, self._good, rng, _CUTS, stop)
        return self._result(path, goal, resolution, solved=True)

    def _result(self, path: Array, goal: Array, resolution: float, *, solved: bool) -> Segment:
        # An approach is worth no more than a look in the planner's own steps.
        look = self._fine if solved else self.watch.counted(Validity(self.scene, self.space, resolution))
        dense = np.array([look.motion(a, b) for a, b in pairwise(path)], dtype=bool)
        certified = self._certified(path) & dense
        left = 0.0 if solved else self.space.distance(path[-1], goal)
        return Segment(
            solved and bool(dense.all()), self._by, path, certified, dense, left, resolution, look.resolution
        )


def _searched(run: Run, start: Array, goal: Array, stop: Callable[[], bool]) -> tuple[Array | None, Array]:
    """Let a planner plan; return a path or None, and the way to what came nearest."""
    found, path = run.solve(stop), run.path()
    if path is None:
        return None, np.stack([start])
    # The very numbers of start and goal, which on circles may be whole turns away.
    path[0] = start
    if found:
        path[-1] = goal
    return (path if found else None), path


def _begun(planner: str, space: PlanningSpace, validity: Validity, start: Array, goal: Array, seed: int) -> CountedRun:
    if planner == BATCH:
        return ExpandingRun(space, validity, start, goal, seed)
    # Imported here, because OMPL is an extra.
    bridge = import_module(".ompl_bridge", __package__)
    return bridge.OmplRun(space, validity, planner, start, goal, seed)


Good = Callable[[Array, Array], bool]

# A short cut that saves less than this part of what it replaces is not worth its proof.
_WORTH = 1e-3


def shortened(
    path: Array, space: PlanningSpace, good: Good, rng: np.random.Generator, rounds: int, stop: Callable[[], bool]
) -> Array:
    """Return a path, (j, d), with the same ends, that is no longer.

    Args:
        path: (k, d).
        space: Whose distance counts.
        good: Whether an edge may be part of the path.
        rng: Where short cuts are drawn from.
        rounds: How many short cuts are tried.
        stop: Whether to leave it at what there is.
    """
    path = _straightened(path, space, good, stop)
    for _ in range(rounds):
        if len(path) < 3 or stop():
            break
        path = _cut(path, space, good, rng)
    return _straightened(path, space, good, stop)


def _straightened(path: Array, space: PlanningSpace, good: Good, stop: Callable[[], bool]) -> Array:
    """Go from each configuration straight to the farthest one that halving finds within reach."""
    kept, at, last = [path[0]], 0, len(path) - 1
    while at < last:
        to = last
        while to > at + 1 and not (_worth(path, at, to, space) and good(path[at], path[to])):
            to = at + 1 if stop() else at + max(1, (to - at) // 2)
        kept.append(path[to])
        at = to
    return np.array(kept)


def _cut(path: Array, space: PlanningSpace, good: Good, rng: np.random.Generator) -> Array:
    """Try to join two random places of the path."""
    ways = space.difference(path[:-1], path[1:])
    along = np.concatenate([[0.0], np.cumsum(space.lengths(ways))])
    low, high = np.sort(rng.uniform(0.0, along[-1], size=2))
    first, second = (min(int(np.searchsorted(along, x, side="right")) - 1, len(ways) - 1) for x in (low, high))
    if first == second:
        return path
    a = path[first] + ways[first] * (low - along[first]) / (along[first + 1] - along[first])
    b = path[second] + ways[second] * (high - along[second]) / (along[second + 1] - along[second])
    if space.distance(a, b) > (1 - _WORTH) * (high - low) or not good(a, b):
        return path
    # What is left of the two edges that are cut is part of edges that are good.
    return np.concatenate([path[: first + 1], a[None], b[None], path[second + 1 :]])


def _worth(path: Array, first: int, last: int, space: PlanningSpace) -> bool:
    # A straight way on circles may be the other way round than the path, and longer.
    return space.distance(path[first], path[last]) <= space.path_length(path[first : last + 1]) * (1 + 1e-9)
