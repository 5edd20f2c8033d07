"""What is asked about rows, and how many at a time: ranges of rows, cut by what the ones before them cost."""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

# A task of this length is long beside what it costs to hand out, and short for a user who presses Ctrl-C.
_SECONDS = 0.2
# Nothing is known about the first rows, so they are few; from one chunk to the next grows by no more than this.
_FIRST = 64
_GROWTH = 8
# What the arrays of a chunk may occupy.
_BYTES = 32_000_000


class Chunks:
    """Hands out ranges of rows in order; safe to share between threads.

    Args:
        rows: How many there are.
        workers: How many work on them at once.
        row_bytes: What working on a row needs while it is worked on.
        least: Seconds of work that a chunk is worth handing out for, although the end is near.
    """

    def __init__(self, rows: int, workers: int, row_bytes: int, least: float) -> None:
        self._rows = rows
        self._workers = workers
        self._most = max(1, _BYTES // row_bytes)
        self._size = self._floor = _FIRST
        self._least = least
        self._next = 0
        self._lock = threading.Lock()

    def take(self) -> slice | None:
        """Return the next rows; None when there are no more."""
        with self._lock:
            left = self._rows - self._next
            if left <= 0:
                return None
            size = min(self._size, self._most)
            if self._workers > 1:
                # Towards the end they become smaller, so that all workers end together.
                size = min(size, max(self._floor, left // (2 * self._workers)))
            start = self._next
            self._next += min(size, left)
            return slice(start, self._next)

    def took(self, rows: int, seconds: float) -> None:
        """Learn from what a chunk cost."""
        cost = max(seconds / rows, 1e-9)
        with self._lock:
            # The first chunk may have compiled something: what it says is corrected by the next ones.
            self._size = max(1, min(int(_SECONDS / cost), max(self._size, _GROWTH * rows)))
            self._floor = max(1, int(self._least / cost))

    def close(self) -> None:
        """Hand out nothing any more."""
        with self._lock:
            self._next = self._rows


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """What is asked about rows.

    Attributes:
        function: Takes the queries, a chunk of each column and the extras; returns the chunk's answers. It must be
            found by its name, because it may be called in another process.
        columns: Arrays with one entry for each row.
        extras: More arguments, the same for every row.
        row_bytes: What working on a row needs.
    """

    function: Callable[..., Any]
    columns: tuple[NDArray[Any], ...]
    extras: tuple[Any, ...]
    row_bytes: int

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return len(self.columns[0])

    def part(self, rows: slice) -> Question:
        """Return the question about some rows."""
        return dataclasses.replace(self, columns=tuple(c[rows] for c in self.columns))

    def answers(self, queries: Any, rows: slice) -> Any:
        """Return the answers of a scene's queries for some rows."""
        return self.function(queries, *(c[rows] for c in self.columns), *self.extras)


# Takes where a chunk lies, and its answers.
Store = Callable[[slice, Any], None]
