"""One leg, from a start to a goal: found, mended where it passes over something, shortened, proved."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..simulation.scene import Scene
from ..transforms import Array
from .expanding import ExpandingRun
from .names import AUTO, BATCH, OPTIMISING
from .shortening import shortened
from .space import PlanningSpace
from .turns import Run, Turns
from .validity import Validity
from .watch import Watch

# How much finer than the planner's steps those are that a solution is checked at.
_FINER = 50
# A solution that passes over something is mended with steps this much finer, for this long; else planned anew.
_MENDING, _MENDING_SECONDS = 8, 3.0
# Short cuts that are tried, and for how long at most.
_CUTS, _CUTTING_SECONDS = 300, 5.0
# The part of what time is left that planners get which always take all.
_OPTIMISING = 0.7


@dataclass(frozen=True, slots=True, eq=False)
class LegResult:
    """The way of one leg, (k, d), in the fields of `Plan`."""

    solved: bool
    path: Array
    certified: NDArray[np.bool_]
    dense: NDArray[np.bool_]
    left: float
    resolution: float
    fine_step: float


class Leg:
    """Plans one leg.

    Args:
        scene: The scene.
        space: What moves.
        planner: Name of the planner.
        resolution: Of its checks, in metres.
        seeds: Where random numbers come from.
        watch: When to stop.
        shorten: Whether to make paths shorter.
    """

    def __init__(
        self,
        scene: Scene,
        space: PlanningSpace,
        planner: str,
        resolution: float,
        seeds: np.random.SeedSequence,
        watch: Watch,
        shorten: bool,
    ) -> None:
        self._scene, self._space, self._planner = scene, space, planner
        self._resolution, self._seeds, self._watch, self._shorten = resolution, seeds, watch, shorten
        self._fine = watch.counts(Validity(scene, space, resolution / _FINER))

    def plan(self, start: Array, goal: Array) -> LegResult:
        """Return a way from start to goal, (d,) each, both valid; or the best approach."""
        resolution, best = self._resolution, np.stack([start])
        while not self._watch.stop():
            self._watch.doing = "planning"
            found, way = self._search(self._planner, start, goal, resolution, self._patience())
            if found is None:
                best = min(best, way, key=lambda p: self._space.distance(p[-1], goal))
                break
            good = self._mended(found, resolution)
            if good is not None:
                return self._finished(good, goal, resolution)
            resolution /= 4
        return self._result(best, goal, resolution, solved=False)

    def _patience(self) -> Callable[[], bool]:
        """Return when a planner is to stop: one that never would by itself leaves time for the rest."""
        if self._planner in OPTIMISING:
            return self._watch.stop_within(_OPTIMISING * self._watch.left)
        return self._watch.stop

    def _search(
        self, planner: str, start: Array, goal: Array, resolution: float, stop: Callable[[], bool]
    ) -> tuple[Array | None, Array]:
        """Return a path or None, and the way to what came nearest."""
        seed = int(self._seeds.spawn(1)[0].generate_state(1)[0] >> 1)
        runs: list[Run] = []
        for name in AUTO if planner == "auto" else (planner,):
            validity = self._watch.counts(Validity(self._scene, self._space, resolution))
            runs.append(_run(name, self._space, validity, start, goal, seed))
        run = runs[0] if len(runs) == 1 else Turns(runs, self._space, goal)
        found = run.solve(stop)
        path = run.path()
        if path is None:
            return None, np.stack([start])
        # The very numbers of start and goal, which on circles may be whole turns away.
        path[0] = start
        if found:
            path[-1] = goal
        return (path, path) if found else (None, path)

    def _mended(self, path: Array, resolution: float) -> Array | None:
        """Return the path with a detour where an edge is not good; None where there is no quick one."""
        self._watch.doing = "proving"
        pieces = [path[:1]]
        for a, b in pairwise(path):
            if self._good(a, b):
                pieces.append(b[None])
                continue
            stop = self._watch.stop_within(_MENDING_SECONDS)
            detour, _ = self._search("RRTConnect", a, b, resolution / _MENDING, stop)
            if detour is not None and all(map(self._good, detour[:-1], detour[1:])):
                pieces.append(detour[1:])
            elif self._fine.motion(a, b):
                pieces.append(b[None])
            else:
                return None
        return np.concatenate(pieces)

    def _good(self, start: Array, end: Array) -> bool:
        """Return whether an edge is valid at fine steps, and proved to be free."""
        return self._fine.motion(start, end) and bool(self._certified(np.stack([start, end]))[0])

    def _certified(self, path: Array) -> NDArray[np.bool_]:
        rows = self._space.full(path)
        return self._scene.edge_is_free(rows[:-1], rows[1:], threads=1)

    def _finished(self, path: Array, goal: Array, resolution: float) -> LegResult:
        if self._shorten:
            self._watch.doing = "shortening"
            rng = np.random.default_rng(self._seeds.spawn(1)[0])
            stop = self._watch.stop_within(_CUTTING_SECONDS)
            path = shortened(path, self._space, self._good, rng, _CUTS, stop)
        return self._result(path, goal, resolution, solved=True)

    def _result(self, path: Array, goal: Array, resolution: float, *, solved: bool) -> LegResult:
        # An approach is worth no more than a look in the planner's own steps.
        look = self._fine if solved else self._watch.counts(Validity(self._scene, self._space, resolution))
        dense = np.array([look.motion(a, b) for a, b in pairwise(path)], dtype=bool)
        certified = self._certified(path) & dense
        left = 0.0 if solved else self._space.distance(path[-1], goal)
        return LegResult(solved and bool(dense.all()), path, certified, dense, left, resolution, look.resolution)


def _run(planner: str, space: PlanningSpace, validity: Validity, start: Array, goal: Array, seed: int) -> Run:
    if planner == BATCH:
        return ExpandingRun(space, validity, start, goal, seed)
    # Imported here, because OMPL is an extra.
    bridge = import_module(".bridge", __package__)
    return bridge.OmplRun(space, validity, planner, start, goal, seed)
