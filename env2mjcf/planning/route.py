"""From start to goal: a planner finds a way, every edge of it is proved, and it is made shorter."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterable
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..diagnostics import DiagnosticLog
from ..errors import robots_named
from ..options import positive, whole
from ..simulation.scene import Query, Scene
from ..system.locks import Lock
from ..transforms import Array
from .planner_space import PlanningSpace
from .planners import checked_planner
from .result import Plan, Progress, Timekeeper
from .segment import Segment, SegmentPlanner

# OMPL draws the seeds of all its random numbers from one generator of the process: what two threads plan at once would
# depend on which of them is quicker.
_one_at_a_time = Lock()
# Extents; finer steps find nothing that the proofs would not, and their number has no end.
_FINEST = 1e-5


def plan(
    scene: Scene,
    start: ArrayLike,
    goal: ArrayLike,
    *,
    planner: str = "auto",
    robot: int | Iterable[int] | None = None,
    time: float = 60.0,
    seed: int = 0,
    resolution: float | None = None,
    shorten: bool = True,
    progress: Callable[[Progress], None] | None = None,
) -> Plan:
    """Plan a way from start to goal.

    Every edge of a solution is checked at steps much finer than the planner's, and proved to be free where it keeps
    1e-5 of the extent away from everything (`Scene.edge_is_free`). Equal seeds give equal paths, unless time runs out.
    A process plans one way at a time: a call in another thread waits, and its time begins afterwards.

    Args:
        scene: The scene.
        start: (dim,) all robots.
        goal: (dim,). With `robot`, its numbers for the other robots count for nothing.
        planner: One of `PLANNERS`, in any case.
        robot: Index of the robot that moves, or several of robots that move together (`query.robots`), the others
            staying as they are in `start`; None moves all.
        time: Seconds after which to give up.
        seed: Of the random numbers, zero or more.
        resolution: Greatest distance in metres that any point of a robot moves between two checks of the planner; None
            takes the file's PositionRes, else 0.01 extent. Where a solution turns out to pass over something, it is
            planned anew with finer steps.
        shorten: Make the path shorter.
        progress: Called with a `Progress` a few times a second.

    Raises:
        TypeError: planner is not a name, or robot, time, seed or resolution not a number of the right kind.
        FormatError: The file's PositionRes is too small to plan with.
        ValueError: Start or goal is not a configuration, or not valid with the other robots as they are in `start` (the
            message says who touches); there is no such planner or robot, or OMPL is not installed; time, seed or
            resolution is out of range.
    """
    rows = np.stack([scene.space.check_row(start), scene.space.check_row(goal)])
    return plan_through(
        scene, rows, planner=planner, robot=robot, time=time, seed=seed, resolution=resolution, shorten=shorten,
        progress=progress,
    )  # fmt: skip


def plan_through(
    scene: Scene,
    q: ArrayLike,
    *,
    planner: str = "auto",
    robot: int | Iterable[int] | None = None,
    time: float = 60.0,
    seed: int = 0,
    resolution: float | None = None,
    shorten: bool = True,
    progress: Callable[[Progress], None] | None = None,
) -> Plan:
    """Plan a way through configurations, (k, dim), one leg after the other; see `plan`.

    With `robot`, the others stay as they are in the first configuration.
    """
    rows, name = scene.space.check(q), checked_planner(planner)
    _refuse(scene, rows, time, seed)
    columns = _columns(scene, robot)
    step = _step(scene, resolution)
    # What does not move is in every row as in the first.
    moved, rows = rows, np.repeat(rows[:1], len(rows), axis=0)
    rows[:, columns] = moved[:, columns]
    _refuse_invalid(scene, rows)
    scene.warm_up()
    space = PlanningSpace(scene, rows, columns)
    with _one_at_a_time:
        watch = Timekeeper(time, len(rows) - 1, progress)
        began, results = clock.perf_counter(), list[Segment]()
        for number, (start, goal) in enumerate(pairwise(rows[:, space.columns]), 1):
            watch.leg = number
            seeds = np.random.SeedSequence((seed, number))
            segment = SegmentPlanner(scene, space, name, step, seeds, watch, shorten)
            results.append(segment.plan(start, goal))
            if not results[-1].solved:
                break
        return _joined(space, results, clock.perf_counter() - began, watch.checks, seed)


def _joined(space: PlanningSpace, legs: list[Segment], seconds: float, checks: int, seed: int) -> Plan:
    path = np.concatenate([legs[0].path[:1], *(leg.path[1:] for leg in legs)])
    return Plan(
        solved=legs[-1].solved,
        path=space.full(path),
        certified=np.concatenate([leg.certified for leg in legs]),
        dense=np.concatenate([leg.dense for leg in legs]),
        planner=", ".join(dict.fromkeys(leg.planner for leg in legs)),
        seconds=seconds,
        checks=checks,
        length=space.path_length(path),
        left=legs[-1].left,
        resolution=min(leg.resolution for leg in legs),
        fine_step=max(leg.fine_step for leg in legs),
        seed=seed,
    )


def _columns(scene: Scene, robot: int | Iterable[int] | None) -> NDArray[np.int64]:
    """Return the columns of what moves, in ascending order.

    Raises:
        TypeError, ValueError: There is no such robot, or it has nothing to move.
    """
    if robot is None:
        return np.arange(scene.space.dim)
    robots = len(scene.space.robot_slices)
    moving = sorted({whole("robot", r, 0) for r in (robot if isinstance(robot, Iterable) else (robot,))})
    if not moving or moving[-1] >= robots:
        raise ValueError(f"there is no robot {moving[-1] if moving else robot}; the scene has {robots}, counted from 0")
    columns = scene.space.columns(moving)
    if not len(columns):
        raise ValueError(f"nothing can move: {robots_named(moving)} without degrees of freedom")
    return columns


def _step(scene: Scene, resolution: float | None) -> float:
    """Return the planner's step in metres."""
    step = scene.resolution(resolution)
    least = _FINEST * scene.extent
    if step >= least:
        return step
    if resolution is not None:
        raise ValueError(f"resolution is {resolution}; expected at least {least:.3g} m, 1e-5 of the extent")
    of_file = scene.environment.resolution
    message = f"PositionRes {of_file.position:g}: planning takes steps of at least {least:.3g} m, 1e-5 of the extent"
    hint = "correct PositionRes, or give --resolution"
    DiagnosticLog().fail("CFG536", "PositionRes", message, hint=hint, span=of_file.span)


def _refuse(scene: Scene, rows: Array, time: float, seed: int) -> None:
    """Raise a TypeError or ValueError for arguments that nothing can be planned with."""
    if not scene.space.dim:
        raise ValueError("nothing can move: the scene has no degrees of freedom")
    if rows.ndim != 2 or len(rows) < 2:
        raise ValueError(f"configurations of shape {rows.shape}; expected a start and a goal, (k, {scene.space.dim})")
    positive("time", time)
    whole("seed", seed, 0)


def _refuse_invalid(scene: Scene, rows: Array) -> None:
    """Raise a ValueError that says who touches in the first configuration that is not valid."""
    for name, row in zip(names_of(len(rows)), rows, strict=True):
        if not scene.is_valid(row):
            raise ValueError(f"the {name} is not valid: {'; '.join(map(str, scene.explain(row).reasons))}")


def alone(scene: Scene, query: Query) -> bool:
    """Whether a path of the first robot's numbers says all about a way of a query: the other robots are at home."""
    others = np.setdiff1d(np.arange(scene.space.dim), scene.space.columns(query.robots[:1]))
    return len(query.robots) == 1 and bool((query.q[:, others] == scene.space.home[others]).all())


def names_of(count: int) -> list[str]:
    """Return what the configurations of a query are called: start, via points, goal."""
    vias = ["via point"] if count == 3 else [f"via point {i}" for i in range(1, count - 1)]
    return ["start", *vias, "goal"]
