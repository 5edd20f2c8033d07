"""Edges: steps that pass over nothing, bounds of how far bodies move, and the proof that an edge is free."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..geometry.assembly import Assembly
from ..kinematics.space import ConfigurationSpace
from ..kinematics.tree import POSITIONS, ROTATIONS, DofKind
from ..options import positive
from ..pairs import Pair
from ..transforms import Array

# Without a resolution in the file, a step is this fraction of the extent.
_DEFAULT_RESOLUTION = 0.01
_MOST_STEPS = 1e15
# Of one edge, whose configurations are made at once.
_MOST_ROWS = 10_000_000


class EdgeSteps:
    """Cuts straight edges so that no point of a robot moves further than the resolution between two checks."""

    def __init__(self, assembly: Assembly, space: ConfigurationSpace) -> None:
        self._assembly = assembly
        self._space = space
        self._motion = MotionBounds(assembly, space)

    @property
    def default_resolution(self) -> float:
        """The step in metres where neither the caller nor the file gives one: 0.01 extent."""
        return _DEFAULT_RESOLUTION * self._assembly.extent

    def resolution(self, resolution: float | None) -> float:
        """Return the step in metres: the one given, else the file's PositionRes, else 0.01 extent.

        Raises:
            TypeError: The resolution is not a number.
            ValueError: It is not positive, or not finite.
        """
        if resolution is None:
            of_file = self._assembly.environment.resolution.position
            return of_file if of_file else self.default_resolution
        return positive("resolution", resolution)

    def counts(self, start: Array, delta: Array, resolution: float | None) -> NDArray[np.int64]:
        """Return how many configurations are checked on ways from (n, dim) by (n, dim), ends included, (n,)."""
        moved = self._motion.links(start, delta).max(axis=1, initial=0.0)
        # What fits into no integer would come out negative, and pass for a short way.
        with np.errstate(over="ignore"):
            steps = np.minimum(np.ceil(moved / self.resolution(resolution)), _MOST_STEPS)
        return np.maximum(2, steps.astype(np.int64) + 1)

    def bounded_counts(self, start: Array, delta: Array, resolution: float | None) -> NDArray[np.int64]:
        """Return `counts` of edges that can be checked.

        Raises:
            ValueError: An edge has more than ten million configurations.
        """
        counts = self.counts(start, delta, resolution)
        most = int(counts.max(initial=0))
        if most > _MOST_ROWS:
            step = self.resolution(resolution)
            raise ValueError(
                f"resolution is {step:g}; in such steps an edge has {most:g} configurations, more than {_MOST_ROWS:g}"
            )
        return counts

    def rows(self, q0: ArrayLike, q1: ArrayLike, resolution: float | None) -> Array:
        """Return the configurations to be checked on an edge, both ends included, (n, dim)."""
        start, end = self._space.check_row(q0), self._space.check_row(q1)
        delta = self._space.difference(start, end)
        count = self.bounded_counts(start[None], delta[None], resolution)
        return even_rows(start, delta, count, np.arange(count[0]))


def even_rows(start: Array, delta: Array, counts: NDArray[np.int64], at: NDArray[np.int64]) -> Array:
    """Return some of the configurations on ways, (r, dim): of `counts` even ones, ends included, those numbered `at`.

    They are the same to the last bit as those that `numpy.linspace` gives for a whole way.
    """
    last = counts - 1
    return start + np.where(at == last, 1.0, at * (1.0 / last))[:, None] * delta


class MotionBounds:
    """Bounds how far links move on straight ways: a point moves no further than its chain is long, for each radian.

    Args:
        assembly: The scene.
        space: Its configuration space.
        pairs: Pairs of links that `pairs` tells about.
    """

    def __init__(self, assembly: Assembly, space: ConfigurationSpace, pairs: Sequence[Pair] = ()) -> None:
        self._robots = assembly.robots
        self._slices = space.robot_slices
        names = {n: i for i, n in enumerate(n for r in assembly.robots for n in r.names)}
        self._shape = (space.dim, len(names))
        first = [names[p.link] for p in pairs]
        second = [names[p.other] for p in pairs]
        self._first, self._second = np.array(first, dtype=np.int64), np.array(second, dtype=np.int64)
        dofs = [d for r in assembly.robots for d in r.kinematics.dofs]
        self._slides = np.array([d.kind is DofKind.D for d in dofs], dtype=np.bool_)
        self._bases = [
            columns.start + np.array(list(r.kinematics.base_columns(body).values()))
            for r, columns in zip(assembly.robots, space.robot_slices, strict=True)
            for body in sorted(r.kinematics.tree.bases)
        ]
        self._kinds = [d.kind for d in dofs]
        self._fixed = None if self._slides.any() else self._levers(np.zeros(space.dim))

    def links(self, start: Array, delta: Array) -> Array:
        """Bound how far any point of each link moves, (n, nlinks), on the ways from (n, dim) by (n, dim)."""
        return self._bound(start, delta, lambda levers: levers)

    def split(self, start: Array, delta: Array) -> tuple[Array, Array]:
        """Part the motion of links on ways from (n, dim) by (n, dim) in two.

        Returns:
            The straight translation of each link's base in the world, (n, nlinks, 3); and bounds of how far any point
            of each link moves besides, (n, nlinks).
        """
        drifts = np.zeros((len(start), self._shape[1], 3))
        rest, link = delta.copy(), 0
        for robot, columns in zip(self._robots, self._slices, strict=True):
            # Links of robots with several bases have no translation in common.
            if len(robot.kinematics.tree.bases) == 1:
                for i, kind in enumerate(self._kinds[columns]):
                    if kind in POSITIONS and robot.kinematics.dofs[i].connection is None:
                        moved = delta[:, columns.start + i]
                        drifts[:, link : link + len(robot.links), POSITIONS.index(kind)] = moved[:, None]
                        rest[:, columns.start + i] = 0.0
            link += len(robot.links)
        return drifts, self.links(start, rest)

    def pairs(self, start: Array, delta: Array) -> Array:
        """Bound how much nearer the links of each pair can come to each other, (n, npairs).

        What moves both of them as one does not count.
        """
        return self._bound(start, delta, self._between)

    def _bound(self, start: Array, delta: Array, chosen: Callable[[Array], Array]) -> Array:
        turns = self._turns(delta)
        if self._fixed is not None:
            return turns @ chosen(self._fixed)
        # How far a slide reaches out depends on the way.
        farthest = np.maximum(np.abs(start), np.abs(start + delta))
        out = np.empty((len(start), chosen(np.zeros(self._shape)).shape[1]))
        for i, (turn, far) in enumerate(zip(turns, farthest, strict=True)):
            out[i] = turn @ chosen(self._levers(far))
        return out

    def _between(self, levers: Array) -> Array:
        first, second = levers[:, self._first], levers[:, self._second]
        return np.where((first > 0) & (second > 0), 0.0, first + second)

    def _levers(self, slide: Array) -> Array:
        levers = np.zeros(self._shape)
        link = 0
        for robot, columns in zip(self._robots, self._slices, strict=True):
            of_robot = robot.kinematics.levers([p.radius for p in robot.links], list(slide[columns]))
            levers[columns, link : link + len(robot.links)] = of_robot
            link += len(robot.links)
        return levers

    def _turns(self, delta: Array) -> Array:
        """Return how far each degree of freedom goes, (n, dim), those of a base taken together.

        The translations of a base make one straight line. Its angular velocity is at most the root of
        (|rx'| + |rz'|)^2 + ry'^2, since the axis of ry is square to the two others (docs/format/kinematics.md).
        """
        turns = np.abs(delta)
        for columns in self._bases:
            by_kind = {self._kinds[c]: c for c in columns}
            along = [by_kind[k] for k in POSITIONS if k in by_kind]
            about = [by_kind[k] for k in ROTATIONS if k in by_kind]
            if along:
                turns[:, along[0]], turns[:, along[1:]] = np.linalg.norm(turns[:, along], axis=1), 0.0
            if len(about) == 3:
                x, y, z = about
                turns[:, x], turns[:, about[1:]] = np.hypot(turns[:, x] + turns[:, z], turns[:, y]), 0.0
        return turns


def certified(clearance: Callable[[Array], Array], start: Array, delta: Array, motion: float, band: float) -> bool:
    """Return whether bodies provably stay apart on the straight way from `start` to `start + delta`.

    Where bodies are d apart, they cannot meet before they have come d nearer (conservative advancement: Mirtich,
    Impulse-based Dynamic Simulation of Rigid Body Systems, 1996). So each distance clears a stretch on both sides of
    where it was taken; what it leaves is halved, and looked at again.

    Args:
        clearance: Least distances of rows, (n, dim) to (n,).
        start: Where the way begins, (dim,).
        delta: Where it leads from there, (dim,).
        motion: Bound of how much nearer any two bodies can come on the whole way.
        band: Where bodies are as near as this, nothing is proved.
    """
    # Both ends first: most edges that hit, hit there. Then stretches of the way from 0 to 1, as middle and half length.
    ends = clearance(np.stack([start, start + delta]))
    if (ends <= band).any():
        return False
    middle, half = np.array([0.5]), np.array([0.5])
    while len(middle):
        distance = clearance(start + middle[:, None] * delta)
        if (distance <= band).any():
            return False
        open_ = half * motion >= distance
        # Halves of what was not cleared; their sum is the stretch again.
        middle = np.concatenate([middle[open_] - half[open_] / 2, middle[open_] + half[open_] / 2])
        half = np.tile(half[open_] / 2, 2)
    return True
