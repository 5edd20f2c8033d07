"""What can be asked about configurations, one or a million at a time."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from math import isfinite
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..contact.batch import Question, ask
from ..contact.packed import joined, packed
from ..contact.queries import ContactQueries
from ..contact.types import Contact, PackedContacts
from ..options import Engine
from ..space import ConfigurationSpace
from ..transforms import Array
from .edges import EdgeAnswers

_ENGINES = get_args(Engine)
_FLOAT = np.dtype(np.float64)


class Answers(EdgeAnswers):
    """The queries of a `Scene`.

    Args:
        queries: Who answers.
        space: The configuration space.
    """

    def __init__(self, queries: ContactQueries, space: ConfigurationSpace) -> None:
        super().__init__(queries, space)
        self._one_row = (space.dim,)

    def link_poses(self, q: ArrayLike, *, threads: int | None = None) -> Array:
        """Return the world poses of all robot bodies out of MuJoCo's kinematics, (..., nlinks, 4, 4).

        Args:
            q: Configurations, (dim,) or (n, dim).
            threads: As for `in_collision`.
        """
        rows = self.space.check(q)
        shape = (len(self._queries.links), 4, 4)
        poses = self._rows(ContactQueries.link_poses, (np.atleast_2d(rows),), threads, None, False, shape=shape)
        return poses if rows.ndim == 2 else poses[0]

    # Verdicts.

    def in_collision(
        self,
        q: ArrayLike,
        *,
        threads: int | None = None,
        executor: Executor | None = None,
        progress: bool = False,
        engine: Engine | None = None,
    ) -> Any:
        """Return whether any tested pair touches.

        The answers are the same with every number of threads and with every executor.

        Args:
            q: Configurations, (dim,) or (n, dim).
            threads: Number of threads; None is 1 below 10,000 rows, else all cores. With an executor: how many of its
                workers to keep busy, None for all.
            executor: Where to work: any `concurrent.futures.Executor`, threads, processes, or
                `dask.distributed.Client(...).get_executor()`. It stays the caller's, who shuts it down.
            progress: Show a progress bar on a terminal.
            engine: Override the scene's engine.

        Returns:
            A bool, or (n,) bools.

        Raises:
            ValueError: q has a wrong shape or a value that is not finite, or the engine is unknown or not installed.
            TypeError: The executor is none.
            concurrent.futures.BrokenExecutor: A worker process died, and the executor does not replace it.
        """
        if engine is executor is threads is None and (one := self._at_once(q)) is not None:
            return self._queries.collisions(one).item()
        return self._verdicts(ContactQueries.collisions, q, threads, executor, progress, engine)

    def is_valid(
        self,
        q: ArrayLike,
        *,
        threads: int | None = None,
        executor: Executor | None = None,
        progress: bool = False,
        engine: Engine | None = None,
    ) -> Any:
        """Return whether q is within limits, every vertex is inside the boundary, and nothing collides.

        Arguments, result and errors are those of `in_collision`.
        """
        if engine is executor is threads is None and (one := self._at_once(q)) is not None:
            return self._queries.validities(one).item()
        return self._verdicts(ContactQueries.validities, q, threads, executor, progress, engine)

    def valid_rows(self, rows: Array) -> NDArray[np.bool_]:
        """Return `is_valid` of rows, (n, dim), that are known to be finite float64, in this thread.

        Nothing is checked or shared out, which for a few rows takes longer than the verdicts: for planners' loops.
        """
        return self._queries.validities(rows)

    def clearance(
        self,
        q: ArrayLike,
        *,
        threads: int | None = None,
        executor: Executor | None = None,
        progress: bool = False,
    ) -> Any:
        """Return the least distance over the tested pairs, in metres; the boundary is not counted.

        Free: the distance of the triangles, exact but for rounding; +inf without pairs.
        In collision: zero or less, minus the depth of the deepest pair. The depth is the length of the shortest push,
        of those tried, that takes one body clear of the other: it really separates them, so it never falls short of
        the shortest translation that does. For two convex bodies of few faces it is that translation (for many faces,
        not always). It fades to zero as bodies come free.

        What collides is what is measured: with `collision="hull"` (and "coacd") the hulls instead of the triangles,
        with "surface" the triangles alone (a body wholly inside another has a distance from it), else also the inside
        of closed meshes.

        Args:
            q: Configurations, (dim,) or (n, dim).
            threads: As for `in_collision`.
            executor: As for `in_collision`.
            progress: Show a progress bar on a terminal.

        Returns:
            A float, or (n,) floats.

        Raises:
            ValueError: q has a wrong shape or a value that is not finite.
        """
        rows = self.space.check(q)
        found = self._rows(
            ContactQueries.clearances, (np.atleast_2d(rows),), threads, executor, progress, kind=np.float64
        )
        return found if rows.ndim == 2 else found[0].item()

    # Contacts.

    def contacts(self, q: ArrayLike, *, engine: Engine | None = None) -> list[Contact]:
        """Return the contacts of one configuration, (dim,): a few for each pair that touches, the deepest first.

        There are some just where `in_collision` says so. Pairs that cannot move are included. Places, normals and
        depths come from MuJoCo and from triangles, whichever engine says that there are any.
        """
        return self._queries.contacts(self._row(q), engine)

    def contacts_of_poses(self, poses: ArrayLike) -> list[Contact]:
        """Return the contacts of links placed by hand, whether or not any configuration puts them there.

        Args:
            poses: World poses of all links in the order of `link_names`, (nlinks, 4, 4).

        Raises:
            ValueError: The shape is another.
        """
        placed = np.asarray(poses, dtype=np.float64)
        if placed.shape != (len(self._queries.links), 4, 4):
            raise ValueError(f"poses of shape {placed.shape}; expected ({len(self._queries.links)}, 4, 4)")
        return self._queries.contacts_of_poses(placed)

    def packed_contacts(
        self,
        q: ArrayLike,
        *,
        threads: int | None = None,
        executor: Executor | None = None,
        progress: bool = False,
        engine: Engine | None = None,
    ) -> PackedContacts:
        """Return the contacts of many configurations as arrays: those of `contacts`, row by row, in its order.

        Contacts are found by Python code, one row at a time: processes make them quicker, threads hardly do.

        Args:
            q: Configurations, (n, dim).
            threads: As for `in_collision`.
            executor: As for `in_collision`.
            progress: Show a progress bar on a terminal.
            engine: Override the scene's engine.

        Raises:
            ValueError: q has a wrong shape or a value that is not finite.
        """
        rows = self.space.check(q)
        if rows.ndim != 2:
            raise ValueError(f"configurations of shape {rows.shape}; expected many, (n, {self.space.dim})")
        parts: dict[int, PackedContacts] = {}

        def store(where: slice, answers: PackedContacts) -> None:
            parts[where.start] = answers

        question = Question(packed, (rows,), (engine,), self._queries.row_bytes())
        ask(self._queries, question, store, threads, executor, progress)
        return joined([parts[start] for start in sorted(parts)])

    def _at_once(self, q: ArrayLike) -> Array | None:
        """Return a single good row as (1, dim); None for anything else, which takes the long way.

        A verdict may take less than a microsecond: this check is what of it can be made quick.
        """
        # A sum is finite if its terms are; the few that are not although theirs are take the long way, too.
        if type(q) is np.ndarray and q.shape == self._one_row and q.dtype is _FLOAT and isfinite(sum(q.tolist())):
            return q[None]
        return None

    def _verdicts(
        self,
        function: Callable[..., Any],
        q: ArrayLike,
        threads: int | None,
        executor: Executor | None,
        progress: bool,
        engine: Engine | None,
    ) -> Any:
        if engine is not None and engine not in _ENGINES:
            raise ValueError(f"engine={engine!r} is not one of {', '.join(map(repr, _ENGINES))}")
        rows = self.space.check(q)
        row_bytes = self._queries.row_bytes(engine, verdicts=True)
        found = self._rows(
            function, (np.atleast_2d(rows),), threads, executor, progress, (engine,), row_bytes=row_bytes
        )
        return found if rows.ndim == 2 else found[0].item()
