"""Edges and paths: configurations close enough together that nothing is passed over."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..geometry.assembly import Assembly
from ..space import ConfigurationSpace
from ..transforms import Array
from .motion import MotionBounds
from .types import Contact, PathReport

# Without a resolution in the file, a step is this fraction of the extent.
_DEFAULT_RESOLUTION = 0.01
_MOST_STEPS = 1e15
# Of one edge, whose configurations are made at once.
_MOST_ROWS = 10_000_000


class EdgeSteps:
    """Cuts straight edges so that no point of a robot moves further than the resolution between two checks.

    Args:
        assembly: The scene.
        space: Its configuration space.
    """

    def __init__(self, assembly: Assembly, space: ConfigurationSpace) -> None:
        self._assembly = assembly
        self._space = space
        self._motion = MotionBounds(assembly, space)

    @property
    def usual(self) -> float:
        """The step in metres where nothing is asked for, and the file has none: 0.01 extent."""
        return _DEFAULT_RESOLUTION * self._assembly.extent

    def resolution(self, resolution: float | None) -> float:
        """Return the step in metres: what was asked for, else the file's PositionRes, else 0.01 extent.

        Raises:
            ValueError: The resolution is not a positive number.
        """
        if resolution is None:
            of_file = self._assembly.environment.resolution.position
            return of_file if of_file else self.usual
        if not 0 < resolution < float("inf"):
            raise ValueError(f"resolution is {resolution}; expected a positive length in metres")
        return resolution

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
        start, delta = self._space.check(q0), self._space.difference(q0, q1)
        count = int(self.bounded_counts(start[None], delta[None], resolution)[0])
        return start + np.linspace(0.0, 1.0, count)[:, None] * delta


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
