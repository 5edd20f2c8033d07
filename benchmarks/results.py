"""Measure ratios to MuJoCo and to other collision checkers in one run: `python benchmarks/results.py [--quick]`.

Prints tables, and writes them into `benchmarks/RESULTS.md` when everything was measured; what is written there by hand,
between two comments, stays. ENV2MJCF_CORPUS names the folder of real scenes. Needs the extra `dev`.
"""

# ruff: noqa: E402
from __future__ import annotations

import os

# Libraries read these when they are first loaded, so that all other imports come after: one thread is to be one thread.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import dataclasses
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import distances
import edges
import memory
import per_query
import scaling
import threads
from machine import ForeignLoad, machine
from pages import Check, by_hand, summary
from subjects import Subject, subjects
from truth import BAND

OUTPUT = Path(__file__).with_name("RESULTS.md")
SECTIONS = ("queries", "threads", "scaling", "clearance", "edges", "memory")
MEMORY_SCENES = ("Maze.maze", "Box.box", "alpha1.6.alpha")

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Size:
    """How much is measured.

    Attributes:
        count: Configurations of each half.
        rounds: Of queries and scaling.
        slow_rounds: Of all others.
        batch: Rows of a batch for two threads.
        batch_seconds: How long one thread may work on these.
        distances: Free configurations of each half for clearance.
        edges: Edges of a scene that are timed.
        edges_seconds: How long one pass over these may take.
        certified: Certified edges that are looked at, of all scenes together.
        certified_seconds: How long one scene may take over these.
        memory: Queries of one process.
        memory_seconds: How long it may take over these.
    """

    count: int
    rounds: int
    slow_rounds: int
    batch: int
    batch_seconds: float
    distances: int
    edges: int
    edges_seconds: float
    certified: int
    certified_seconds: float
    memory: int
    memory_seconds: float


FULL = Size(3000, 5, 5, 1_000_000, 8.0, 500, 300, 6.0, 100_000, 60.0, 10_000_000, 100.0)
QUICK = Size(500, 3, 3, 20_000, 0.5, 60, 40, 2.0, 200, 5.0, 300_000, 5.0)


class Run:
    """One run over chosen scenes; a scene that fails is reported and the others go on."""

    def __init__(self, scenes: dict[str, Subject], size: Size, chosen: Iterable[str] | None) -> None:
        self.scenes, self.size = scenes, size
        self.chosen = [s for name, s in scenes.items() if chosen is None or name in chosen]
        self.checks: list[Check] = []
        self.failures: list[str] = []

    def queries(self) -> list[str]:
        """Return the section on queries of a batch."""
        size = self.size
        found = self._each("queries", self.chosen, lambda s: per_query.measure(s, size.rounds))
        for result in found:
            print(per_query.log(result), file=sys.stderr, flush=True)
        return self._kept(per_query.text(found, size.rounds, size.count, BAND)) if found else []

    def threads(self) -> list[str]:
        """Return the section on two threads and on single queries."""
        size = self.size
        found = self._each(
            "threads", self.chosen, lambda s: threads.measure(s, size.slow_rounds, size.batch_seconds, size.batch)
        )
        return self._kept(threads.text(found, size.slow_rounds, size.batch_seconds)) if found else []

    def scaling(self) -> list[str]:
        """Return the section on many obstacles: of groups all of whose scenes are chosen."""
        names = {s.name for s in self.chosen}
        groups = [g for g, (scenes, _, _) in scaling.GROUPS.items() if names.issuperset(scenes)]
        found = self._each("scaling", groups, lambda g: scaling.measure(g, self.scenes, self.size.rounds))
        return self._kept(scaling.text(found, self.size.rounds)) if found else []

    def clearance(self) -> list[str]:
        """Return the section on clearance."""
        size = self.size
        found = self._each("clearance", self.chosen, lambda s: distances.measure(s, size.slow_rounds, size.distances))
        return self._kept(distances.text(found, size.slow_rounds, size.distances)) if found else []

    def edges(self) -> list[str]:
        """Return the section on edges."""
        size = self.size
        found = self._each(
            "edges", self.chosen, lambda s: edges.measure(s, size.slow_rounds, size.edges, size.edges_seconds)
        )
        wanted = -(-size.certified // max(1, len(found)))
        names = {r.name for r in found}
        provable = [s for s in self.chosen if s.name in names]
        proofs = self._each("certificates", provable, lambda s: edges.prove(s, wanted, size.certified_seconds))
        return self._kept(edges.text(found, proofs, size.slow_rounds, size.certified)) if found else []

    def memory(self) -> list[str]:
        """Return the section on memory."""
        size = self.size
        cases = [s.case for s in self.chosen if s.name in MEMORY_SCENES]
        found = self._each("memory", cases, lambda c: memory.measure(c, size.memory, size.memory_seconds))
        return self._kept(memory.text(found, size.memory_seconds)) if found else []

    def _each(self, section: str, things: Iterable[object], measure: Callable[..., Result | None]) -> list[Result]:
        found = []
        for thing in things:
            name = getattr(thing, "name", thing)
            start = time.perf_counter()
            try:
                result = measure(thing)
            except Exception as error:  # A run of an hour is not to be lost by one scene; the page says what failed.
                traceback.print_exc()
                self.failures.append(f"{section}, {name}: {type(error).__name__}: {error}")
                continue
            if result is not None:
                found.append(result)
            print(f"{section}: {name}, {time.perf_counter() - start:.1f} s", file=sys.stderr, flush=True)
        return found

    def _kept(self, section: tuple[list[str], list[Check]]) -> list[str]:
        lines, checks = section
        self.checks += checks
        return lines


def page(run: Run, sections: Sequence[str], command: str) -> str:
    """Measure, and return the whole page."""
    start, load = time.perf_counter(), ForeignLoad()
    parts = [line for section in sections for line in getattr(run, section)() or ()]
    failures = ["## Failures", "", *(f"- {f}" for f in run.failures), ""] if run.failures else []
    return "\n".join(
        [
            "# Verdicts by the million: ratios of one run",
            "",
            f"Made by `{command}`, with `ENV2MJCF_CORPUS` naming the folder of real scenes. "
            "Every ratio is of this run: all ways of a scene take turns in one process, beginning with "
            "another one in every round and going backwards every other time. One thread is one thread: the pools of "
            "BLAS and OpenMP are off. CPU time is the process's.",
            "",
            f"Machine: {machine()}",
            "",
            f"Configurations: {run.size.count:,} uniform in the boundary and the joints' limits, and as many by "
            "bisection between a random free and a random colliding one (by `collision=\"surface\"`), 4 to 20 "
            "halvings, the last free or the last colliding one by a coin; fewer for robots of very many links. Slow "
            "ways answer the first ones of each half, 300 at least. Both halves are timed apart; together is their "
            "mean. maze4 and maze16 are the maze with its walls side by side 4 and 16 times; boxes50 to boxes5000 a "
            "free cube among random boxes; snake64 a free chain of 64 links, all tested against each other but for "
            "neighbours, among 50 boxes; arm7 seven round links of 576 triangles among 15 boxes and 15 balls "
            "(`benchmarks/generated.py`).",
            "",
            "## What is met",
            "",
            *summary(run.checks),
            "",
            by_hand(OUTPUT),
            "",
            *parts,
            *failures,
            f"The run took {duration(time.perf_counter() - start)}; other processes took {100 * load.share():.0f} % of "
            "the machine meanwhile.",
            "",
        ]
    )  # fmt: skip


def duration(seconds: float) -> str:
    """Return a duration."""
    return f"{seconds / 60:.0f} minutes" if seconds > 120 else f"{seconds:.0f} seconds"


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print and write the page; the exit status is 1 if something failed to be measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few configurations and rounds; only print")
    parser.add_argument("--scenes", nargs="+", metavar="NAME", help="only these; only print")
    parser.add_argument("--sections", nargs="+", choices=SECTIONS, default=SECTIONS, help="only these; only print")
    parser.add_argument("--output", type=Path, help="write the page there, whatever was measured")
    parser.add_argument("--certified", type=int, help="how many certified edges are looked at, all scenes together")
    chosen = parser.parse_args(arguments)
    corpus = os.environ.get("ENV2MJCF_CORPUS")
    if not corpus:
        parser.error("ENV2MJCF_CORPUS must name the folder of real scenes")
    size = QUICK if chosen.quick else FULL
    if chosen.certified is not None:
        size = dataclasses.replace(size, certified=chosen.certified)
    with tempfile.TemporaryDirectory() as folder:
        scenes = subjects(Path(corpus), Path(folder), size.count)
        unknown = sorted(set(chosen.scenes or ()) - set(scenes))
        if unknown:
            parser.error(f"no such scene: {', '.join(unknown)}; choose from {', '.join(scenes)}")
        run = Run(scenes, size, chosen.scenes)
        words = ["python benchmarks/results.py", *(sys.argv[1:] if arguments is None else arguments)]
        text = page(run, chosen.sections, " ".join(words))
    print(text)
    whole = not chosen.quick and not chosen.scenes and set(chosen.sections) == set(SECTIONS)
    output = chosen.output or (OUTPUT if whole else None)
    if output:
        output.write_text(text, encoding="utf-8")
    return int(bool(run.failures))


if __name__ == "__main__":
    sys.exit(main())
