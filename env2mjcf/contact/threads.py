"""Asks a question about many rows: at once, in threads, or on an executor; the same answers in the same order."""

from __future__ import annotations

import os
import sys
import threading
import time
from concurrent.futures import Executor
from typing import Any

from tqdm import tqdm

from ..options import whole
from ..system.locks import delayed_exit
from .executors import on_executor, worker_count
from .queries import ContactQueries
from .tasks import Chunks, Question, Store

# Below this many rows threads cost more than they bring.
_ROWS_FOR_THREADS = 10_000
# Seconds of work below which it is not worth handing out rows, in this process and beyond it.
_LEAST_HERE, _LEAST_THERE = 0.002, 0.02


def thread_count(threads: int | None, rows: int) -> int:
    """Return how many threads to use: as many as given, else 1 for few rows and all cores for many.

    Raises:
        TypeError: The number of threads is not a whole number.
        ValueError: It is below 1.
    """
    if threads is None:
        return 1 if rows < _ROWS_FOR_THREADS else os.cpu_count() or 1
    return whole("threads", threads, 1)


def ask(
    queries: ContactQueries,
    question: Question,
    store: Store,
    threads: int | None,
    executor: Executor | None,
    progress: bool,
) -> None:
    """Store the answers to a question.

    Args:
        queries: What answers it.
        question: What is asked.
        store: Gets the answers of each chunk, chunks in any order, and may be called in several threads.
        threads: See `thread_count`; with an executor, how many of its workers to keep busy, None: all of them.
        executor: Where to work.
        progress: Whether to show a progress bar on a terminal.

    Raises:
        ValueError: The number of threads is below 1.
        TypeError: It is not a whole number, or the executor is not an Executor.
    """
    rows = question.rows
    count = thread_count(threads, rows)
    bar = tqdm(total=rows, unit="q", delay=1, leave=False) if progress and sys.stderr.isatty() else None

    def noted(rows: slice, answers: Any) -> None:
        store(rows, answers)
        if bar is not None:
            bar.update(rows.stop - rows.start)

    try:
        if executor is not None:
            workers = worker_count(executor) if threads is None else count
            chunks = Chunks(rows, workers, question.row_bytes, _LEAST_THERE)
            on_executor(executor, queries, question, chunks, noted, workers)
        elif rows:
            _in_threads(queries, question, noted, count)
    finally:
        if bar is not None:
            bar.close()


def _in_threads(queries: ContactQueries, question: Question, store: Store, count: int) -> None:
    """Work in this thread and in others beside it, which end before this returns, whatever happens."""
    errors: list[BaseException] = []
    chunks = Chunks(question.rows, count, question.row_bytes, _LEAST_HERE)

    def work() -> None:
        try:
            while (rows := chunks.take()) is not None:
                began = time.perf_counter()
                with delayed_exit():
                    store(rows, question.answers(queries, rows))
                chunks.took(rows.stop - rows.start, time.perf_counter() - began)
        finally:
            # After an error, or Ctrl-C in this thread, the others end with the chunk that they are at.
            chunks.close()

    def help_out() -> None:
        try:
            work()
        except BaseException as error:
            errors.append(error)

    # Not those of an executor, which the interpreter waits for at its end: these are daemons if the calling thread is.
    started: list[threading.Thread] = []
    try:
        for number in range(1, count):
            other = threading.Thread(target=help_out, name=f"env2mjcf-{number}")
            try:
                other.start()
            except RuntimeError:
                break  # the system has no more of them, or the interpreter ends: those that are there do all
            started.append(other)
        work()
    finally:
        chunks.close()
        for other in started:
            other.join()
    if errors:
        raise errors[0]
