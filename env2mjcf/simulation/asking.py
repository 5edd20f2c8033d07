"""What all queries of a scene share: rows in, one answer for each row out."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..contact.batch import Question, ask
from ..contact.queries import ContactQueries
from ..space import ConfigurationSpace
from ..transforms import Array


class Asking:
    """Passes rows to who answers, wherever that is done.

    Args:
        queries: Who answers.
        space: The configuration space.
    """

    def __init__(self, queries: ContactQueries, space: ConfigurationSpace) -> None:
        self._queries = queries
        self.space: ConfigurationSpace = space

    def _rows(
        self,
        function: Callable[..., Any],
        columns: tuple[Array, ...],
        threads: int | None,
        executor: Executor | None,
        progress: bool,
        extras: tuple[Any, ...] = (),
        *,
        kind: type[np.generic] = np.bool_,
        shape: tuple[int, ...] | None = None,
        row_bytes: int | None = None,
    ) -> NDArray[Any]:
        """Return one answer for each row, each a `kind`, or an array of floats of this shape."""
        count = len(columns[0])
        answers = np.empty((count, *shape) if shape else count, dtype=np.float64 if shape else kind)

        def store(where: slice, some: NDArray[Any]) -> None:
            answers[where] = some

        question = Question(function, columns, extras, row_bytes or self._queries.row_bytes())
        ask(self._queries, question, store, threads, executor, progress)
        return answers

    def _row(self, q: ArrayLike) -> Array:
        row = self.space.check(q)
        if row.ndim != 1:
            raise ValueError(f"configurations of shape {row.shape}; expected one of shape ({self.space.dim},)")
        return row
