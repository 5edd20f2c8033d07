"""What can be asked about straight edges and paths."""

from __future__ import annotations

from concurrent.futures import Executor
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..contact.paths import check_path
from ..contact.queries import ContactQueries
from ..contact.types import PathReport
from ..transforms import Array
from .asking import Asking


class EdgeAnswers(Asking):
    """The queries of a `Scene` about edges and paths."""

    def edge_in_collision(
        self,
        q0: ArrayLike,
        q1: ArrayLike,
        resolution: float | None = None,
        *,
        threads: int | None = None,
        executor: Executor | None = None,
        progress: bool = False,
    ) -> Any:
        """Return whether anything touches on the straight way between two configurations, ends included.

        Args:
            q0: Where the edges begin, (dim,) or (n, dim).
            q1: Where they end, of the same shape.
            resolution: Greatest distance in metres that any point of a robot moves between two checks; None takes
                the file's PositionRes, else 0.01 extent.
            threads: As for `in_collision`; edges count as rows.
            executor: As for `in_collision`.
            progress: Show a progress bar on a terminal.

        Raises:
            ValueError: q0 and q1 differ in shape, or the resolution is not positive, or too small for such edges.
        """
        start, delta = self._way(q0, q1)
        extras = (self._queries.steps.resolution(resolution),)
        columns = np.atleast_2d(start), np.atleast_2d(delta)
        hits = self._rows(ContactQueries.edges_collide, columns, threads, executor, progress, extras)
        return hits if start.ndim == 2 else hits[0].item()

    def edge_is_free(
        self,
        q0: ArrayLike,
        q1: ArrayLike,
        *,
        threads: int | None = None,
        executor: Executor | None = None,
        progress: bool = False,
    ) -> Any:
        """Return whether nothing touches anywhere on the straight way between two configurations, proved.

        True is a proof: distances along the way are compared with how far bodies can move (bounded as for
        `edge_in_collision`), so nothing is passed over. False means that bodies touch, or come nearer to each other
        than 1e-5 of the extent. Joint values in between are not rounded to any step.

        Args:
            q0: Where the edges begin, (dim,) or (n, dim).
            q1: Where they end, of the same shape.
            threads: As for `in_collision`; edges count as rows.
            executor: As for `in_collision`.
            progress: Show a progress bar on a terminal.

        Raises:
            ValueError: q0 and q1 differ in shape.
        """
        start, delta = self._way(q0, q1)
        columns = np.atleast_2d(start), np.atleast_2d(delta)
        free = self._rows(ContactQueries.edges_are_free, columns, threads, executor, progress)
        return free if start.ndim == 2 else free[0].item()

    def check_path(self, path: ArrayLike, resolution: float | None = None) -> PathReport:
        """Check the validity of a path's configurations and of the straight edges between them.

        Args:
            path: (k, dim).
            resolution: As for `edge_in_collision`.

        Raises:
            ValueError: The path has a wrong shape, or the resolution is not positive, or too small for such edges.
        """
        queries = self._queries
        return check_path(path, queries.steps, queries.validities, queries.contacts, self.space, resolution)

    def step(self, resolution: float | None = None) -> float:
        """Return the step in metres that a resolution means: itself, else the file's PositionRes, else 0.01 extent.

        Raises:
            ValueError: The resolution is not positive.
        """
        return self._queries.steps.resolution(resolution)

    def edge_rows(self, q0: ArrayLike, q1: ArrayLike, resolution: float | None = None) -> Array:
        """Return the configurations that `edge_in_collision` looks at on one edge, both ends included, (n, dim).

        Raises:
            ValueError: q0 or q1 is no configuration, or the resolution is not positive, or too small for such an edge.
        """
        return self._queries.steps.rows(q0, q1, resolution)

    def _way(self, q0: ArrayLike, q1: ArrayLike) -> tuple[Array, Array]:
        """Return where ways begin, and where they lead from there."""
        start, end = self.space.check(q0), self.space.check(q1)
        if start.shape != end.shape:
            raise ValueError(f"q0 has shape {start.shape} and q1 {end.shape}; expected equal shapes")
        return start, self.space.difference(start, end)
