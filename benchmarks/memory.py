"""Whether millions of queries leave a process's memory where it was."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pages import Check, table
from subjects import has_exact, warm
from table import Case

import env2mjcf

# Megabytes that an allocator may hold on to between two looks.
NOISE = 2.0
_BATCH = 100_000
LEGEND = """
A process of its own asks `in_collision` with two threads, `collision="auto"`, over and over about batches of 100,000
new configurations, then about 20,000 single ones. Resident memory in megabytes after the first batch, halfway, and at
the end, least of the looks of the last tenth; a growth of {noise:g} MB is the allocator's. A slow engine does no more
than it can in {seconds:g} s.
"""


@dataclass(frozen=True, slots=True)
class Result:
    """What one scene came to, in megabytes."""

    name: str
    engine: str
    queries: int
    first: float
    halfway: float
    end: float


def measure(case: Case, total: int, seconds: float) -> Result:
    """Watch a process that asks so many times, or for so long."""
    # Not a fork: what this process has allocated must not be in the other one's account.
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(_watched, case, total, seconds).result()


def _watched(case: Case, total: int, seconds: float) -> Result:
    scene = warm(env2mjcf.load(case.path, **case.options))
    engine = "exact" if has_exact(scene) else "mujoco"
    looks: list[float] = []
    start, queries = time.perf_counter(), 0
    while queries < total and (not looks or time.perf_counter() - start < seconds):
        batch = min(_BATCH, total - queries)
        scene.in_collision(scene.space.sample(batch, queries), threads=2, engine=engine)
        queries += batch
        looks.append(_resident())
    for row in scene.space.sample(20_000, 1):
        scene.in_collision(row, engine=engine)
    looks.append(_resident())
    last = min(looks[-max(1, len(looks) // 10) :])
    return Result(case.name, engine, queries, looks[0], looks[len(looks) // 2], last)


def _resident() -> float:
    """Return resident memory in megabytes."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def text(results: Sequence[Result], seconds: float) -> tuple[list[str], list[Check]]:
    """Return the section of the page, and what is met."""
    header = ("scene", "engine", "queries", "first 100,000, MB", "halfway, MB", "end, MB", "growth, MB")
    rows = [
        (
            r.name,
            r.engine,
            f"{r.queries:,}",
            *(f"{x:.1f}" for x in (r.first, r.halfway, r.end)),
            f"{r.end - r.first:+.1f}",
        )
        for r in results
    ]
    checks = [Check("growth of memory, MB", r.name, float(np.round(r.end - r.first, 1)), NOISE) for r in results]
    legend = LEGEND.format(noise=NOISE, seconds=seconds).strip().splitlines()
    return ["## Memory", "", *legend, "", *table(header, rows), ""], checks
