"""What a second thread brings, and what a query costs that is asked alone."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from machine import ForeignLoad
from pages import Check, mark, micro, table
from rounds import Ratio, no_collections
from subjects import Subject, has_exact

import env2mjcf

THREADS_MARK, SINGLE_MARK = 0.55, 3.0
# Rounds in which other processes took more than this share of the machine are not counted.
_QUIET = 0.08
_ALONE = 2000
LEGEND = """
Two threads: wall time of a batch of `rows` configurations of both halves (a million, or as many as {seconds:g} s are
enough for), `collision="auto"`, engine `{engine}`, `threads=2` against `threads=1`, by turns, {rounds} rounds; only
rounds count in which other processes took less than {quiet:.0f} % of the machine (quiet; all of them if there is none,
with a star). same: whether both give the same verdicts.

Alone: CPU time of `in_collision(q)` of one configuration after the other from Python, less what the same {alone:,}
configurations take as one batch on one thread, both with the engine that the scene takes by itself; medians over the
same number of rounds.
"""


@dataclass(frozen=True, slots=True)
class Result:
    """What one scene came to; seconds are of all rounds."""

    name: str
    engine: str
    rows: int
    one: np.ndarray
    two: np.ndarray
    foreign: np.ndarray
    same: bool
    alone: np.ndarray
    batch: np.ndarray

    @property
    def quiet(self) -> np.ndarray:
        """Which rounds count."""
        quiet = self.foreign < _QUIET
        return quiet if quiet.any() else np.ones(len(quiet), dtype=bool)


def measure(subject: Subject, rounds: int, seconds: float, most: int) -> Result:
    """Time one scene with one thread and with two, and one query after the other."""
    scene = subject.auto
    engine = "exact" if has_exact(scene) else "mujoco"
    rng = np.random.default_rng(7)
    start = time.perf_counter()
    scene.in_collision(subject.rows, threads=1, engine=engine)
    cost = (time.perf_counter() - start) / len(subject.rows)
    count = int(min(most, max(20_000, seconds / cost)))
    rows = subject.rows[rng.integers(len(subject.rows), size=count)]
    same = np.array_equal(*(scene.in_collision(rows, threads=n, engine=engine) for n in (1, 2)))
    times: dict[int, list[float]] = {1: [], 2: []}
    foreign = []
    with no_collections():
        for number in range(rounds):
            shares = []
            for n in (1, 2) if number % 2 else (2, 1):
                elapsed, share = _wall(lambda n=n: scene.in_collision(rows, threads=n, engine=engine))
                times[n].append(elapsed)
                shares.append(share)
            foreign.append(max(shares))
        alone, batch = _alone(scene, rows[:_ALONE], rounds)
    return Result(
        subject.name, engine, count, np.array(times[1]), np.array(times[2]), np.array(foreign), same, alone, batch
    )


def _wall(work: Callable[[], object]) -> tuple[float, float]:
    """Return seconds, and the share of the machine that other processes took meanwhile."""
    start, load = time.perf_counter(), ForeignLoad()
    work()
    return time.perf_counter() - start, load.share()


def _alone(scene: env2mjcf.Scene, rows: np.ndarray, rounds: int) -> tuple[np.ndarray, np.ndarray]:
    """Return seconds a query of all rounds, asked one by one and as a batch."""
    ask, single = scene.in_collision, list(rows)
    alone, batch = [], []
    for _ in range(rounds + 1):
        start = time.process_time()
        for row in single:
            ask(row)
        middle = time.process_time()
        ask(rows, threads=1)
        alone.append((middle - start) / len(rows))
        batch.append((time.process_time() - middle) / len(rows))
    # The first round warms.
    return np.array(alone[1:]), np.array(batch[1:])


def text(results: Sequence[Result], rounds: int, seconds: float) -> tuple[list[str], list[Check]]:
    """Return the section of the page, and what is met."""
    legend = LEGEND.format(seconds=seconds, engine=results[0].engine, rounds=rounds, quiet=100 * _QUIET, alone=_ALONE)
    header = (
        "scene", "rows", "1 thread, s", "2 threads, s", "2 / 1", "mark", "quiet", "same", "alone, µs", "batch, µs",
        "alone - batch, µs", "mark",
    )  # fmt: skip
    rows, checks = [], []
    for r in results:
        ratio = Ratio.of(r.two[r.quiet] / r.one[r.quiet])
        extra = 1e6 * float(np.median(r.alone - r.batch))
        checks += [
            Check("two threads / one", r.name, ratio.median, THREADS_MARK),
            Check("one query alone, µs above the batch", r.name, extra, SINGLE_MARK),
        ]
        calm = int((r.foreign < _QUIET).sum())
        rows.append(
            (
                r.name,
                f"{r.rows:,}",
                f"{np.median(r.one[r.quiet]):.3f}",
                f"{np.median(r.two[r.quiet]):.3f}",
                str(ratio),
                mark(ratio.median, THREADS_MARK),
                f"{calm} of {rounds}" if calm else f"0 of {rounds} \\*",
                "yes" if r.same else "**no**",
                micro(float(np.median(r.alone))),
                micro(float(np.median(r.batch))),
                f"{extra:.2f}",
                mark(extra, SINGLE_MARK),
            )
        )
    title = "## Two threads, and one query alone"
    return [title, "", *legend.strip().splitlines(), "", *table(header, rows), ""], checks
