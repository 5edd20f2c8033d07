"""Edges and paths: configurations close enough together that nothing is passed over."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..geometry.assembly import Assembly
from ..space import ConfigurationSpace
from ..transforms import Array
from .types import Contact, PathReport

# Without a resolution in the file, a step is this fraction of the extent.
_DEFAULT_RESOLUTION = 0.01


class EdgeSteps:
    """Cuts straight edges so that no point of a robot moves further than the resolution between two checks.

    Args:
        assembly: The scene.
        space: Its configuration space.
    """

    def __init__(self, assembly: Assembly, space: ConfigurationSpace) -> None:
        self._assembly = assembly
        self._space = space

    def resolution(self, resolution: float | None) -> float:
        """Return the step in metres: what was asked for, else the file's PositionRes, else 0.01 extent.

        Raises:
            ValueError: The resolution is not a positive number.
        """
        if resolution is None:
            of_file = self._assembly.environment.resolution.position
            return of_file if of_file else _DEFAULT_RESOLUTION * self._assembly.extent
        if not 0 < resolution < float("inf"):
            raise ValueError(f"resolution is {resolution}; expected a positive length in metres")
        return resolution

    def motion(self, q0: Array, q1: Array) -> float:
        """Bound how far any point of any robot moves on the straight way from q0 to q1, in metres."""
        delta = np.abs(self._space.difference(q0, q1))
        slide = np.maximum(np.abs(q0), np.abs(q1))
        moved = [0.0]
        for robot, columns in zip(self._assembly.robots, self._space.robot_slices, strict=True):
            levers = robot.kinematics.levers([p.radius for p in robot.links], list(slide[columns]))
            moved.append(float(levers @ delta[columns]))
        return max(moved)

    def rows(self, q0: ArrayLike, q1: ArrayLike, resolution: float | None) -> Array:
        """Return the configurations to be checked on an edge, both ends included, (n, dim)."""
        start, end = self._space.check(q0), self._space.check(q1)
        steps = int(np.ceil(self.motion(start, end) / self.resolution(resolution)))
        return self._space.interpolate(start, end, max(2, steps + 1))


def check_path(
    path: ArrayLike,
    steps: EdgeSteps,
    is_valid: Callable[[Array], NDArray[np.bool_]],
    contacts: Callable[[Array], list[Contact]],
    space: ConfigurationSpace,
    resolution: float | None,
) -> PathReport:
    """Check the configurations of a path and the straight edges between them.

    Raises:
        ValueError: The path is no (k, dim) array of finite numbers.
    """
    rows = space.check(path)
    if rows.ndim != 2:
        raise ValueError(f"a path of shape {rows.shape}; expected (k, {space.dim})")
    good = is_valid(rows)
    edges = np.ones(max(0, len(rows) - 1), dtype=bool)
    first: tuple[int, Array] | None = None
    for i, row in enumerate(rows):
        if not good[i]:
            first = first or (i, row)
        if i + 1 == len(rows):
            break
        between = steps.rows(row, rows[i + 1], resolution)
        valid = is_valid(between)
        edges[i] = bool(valid.all())
        if not edges[i] and first is None:
            first = (i, between[int(np.argmin(valid))])
    index, q = first if first else (None, None)
    touching = tuple(contacts(q)) if q is not None else ()
    return PathReport(first is None, good, edges, index, q, touching)
