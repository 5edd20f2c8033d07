"""Splits many rows into chunks, and works on them in one thread or several."""

from __future__ import annotations

import operator
import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from ..transforms import Array

# Below this many rows threads cost more than they bring.
_ROWS_FOR_THREADS = 10_000
_CHUNK = 2_000

_Answer = TypeVar("_Answer", np.bool_, np.float64)


def thread_count(threads: int | None, rows: int) -> int:
    """Return how many threads to use: as many as asked for, else 1 for few rows and all cores for many.

    Raises:
        ValueError: Fewer than one thread was asked for.
    """
    if threads is None:
        return 1 if rows < _ROWS_FOR_THREADS else os.cpu_count() or 1
    if operator.index(threads) < 1:
        raise ValueError(f"threads is {threads}; expected at least 1")
    return threads


def in_chunks(
    rows: Array,
    work: Callable[[Array], NDArray[_Answer]],
    threads: int | None,
    progress: bool,
    kind: type[_Answer] = np.bool_,
) -> NDArray[_Answer]:
    """Apply `work` to chunks of rows and join the answers; the same answers at any number of threads.

    Args:
        rows: (n, dim).
        work: Takes (k, dim), returns (k,).
        threads: See `thread_count`.
        progress: Whether to show a progress bar on a terminal.
        kind: What the answers are.
    """
    answers = np.zeros(len(rows), dtype=kind)
    starts = range(0, len(rows), _CHUNK)
    count = thread_count(threads, len(rows))
    bar = tqdm(total=len(rows), unit="q", disable=not (progress and sys.stderr.isatty()), delay=1, leave=False)

    def one(start: int) -> None:
        answers[start : start + _CHUNK] = work(rows[start : start + _CHUNK])
        bar.update(min(_CHUNK, len(rows) - start))

    with bar:
        if count == 1 or len(starts) <= 1:
            for start in starts:
                one(start)
            return answers
        pool = ThreadPoolExecutor(min(count, len(starts)), thread_name_prefix="env2mjcf")
        try:
            for future in [pool.submit(one, start) for start in starts]:
                future.result()
        finally:
            # Ctrl-C and errors leave nothing running behind.
            pool.shutdown(wait=True, cancel_futures=True)
    return answers
