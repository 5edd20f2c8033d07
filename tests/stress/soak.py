"""Does everything at random in one process for a long time; answers stay what they were, and nothing grows.

    python tests/stress/soak.py --seconds 900

Scenes are those of `models/`, and real ones where ENV2MJCF_CORPUS names their folder. Prints one line of figures; exit
status 1 if an answer changed, anything unexpected was raised, or descriptors, threads, children, temporary files or
memory grew.
"""

from __future__ import annotations

import argparse
import os
import random
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from gauges import Gauges, Reading, grown, slope, steady_slope, table
from known import Known, known_scenes
from operations import Operations

# Memory that an operation may add on average, in bytes: rounding of the measure, and what grows in a burst and stays.
# One scene that is never freed is a hundred thousand.
PER_OPERATION = 4_000
# Below this much growth in all, nothing is said.
LEAST = 8_000_000
# Scenes that everything is done with before anything is measured: what is loaded or made once does not count.
_WARMED = 3
# Readings that tell growth from chance, also of a short run on a machine that is busy.
_ENOUGH = 12

# An operation, and how often it comes.
Chosen = tuple[Callable[[Known], None], int]


@dataclass(eq=False)
class Soak:
    """A long run.

    Attributes:
        least: Growth in bytes that is not spoken of.
        readings: What the process held, from the end of the warm-up on.
        findings: What went wrong.
        done: How often each operation was done.
    """

    operations: Operations
    known: list[Known]
    gauges: Gauges
    rng: random.Random
    least: float = LEAST
    readings: list[Reading] = field(default_factory=list)
    findings: list[str] = field(default_factory=list)
    done: Counter[str] = field(default_factory=Counter)

    def run(self, seconds: float, every: float, only: tuple[str, ...] = ()) -> None:
        """Warm up, then work for so long, and take a reading from time to time."""
        self.work({n: o for n, o in self.operations.all().items() if not only or n in only}, seconds, every)

    def work(self, chosen: Mapping[str, Chosen], seconds: float, every: float) -> None:
        """Do the same with these operations."""
        for name, (operation, _) in chosen.items():
            for known in self.known[:_WARMED]:
                self._do(name, operation, known)
        self._work(chosen, seconds / 4, every)
        self.readings.clear()
        self._work(chosen, seconds, every, _ENOUGH)
        self.findings += grown(self.readings)
        steady = steady_slope(self.readings, "memory")
        if steady > PER_OPERATION and steady * self.span() > self.least:
            self.findings.append(f"memory grew by {steady:.0f} bytes an operation")

    def span(self) -> int:
        """Return how many operations lie between the first reading and the last."""
        return self.readings[-1].operations - self.readings[0].operations

    def growth(self) -> float:
        """Return by how many bytes memory grew between them, as the slope has it."""
        return slope(self.readings, "memory") * self.span()

    def line(self) -> str:
        """Return all figures in one line."""
        first, last = self.readings[0], self.readings[-1]
        checked, work = sum(k.checked for k in self.known), self.operations
        return (
            f"soak: {last.seconds - first.seconds:.0f} s, {sum(self.done.values())} operations of {len(self.done)} "
            f"kinds on {len(self.known)} scenes, {work.configurations} configurations, {work.expected_errors} bad "
            f"inputs refused, {work.pictures} pictures; {checked} verdicts compared with fcl or golden vectors; memory "
            f"{first.memory / 2**20:.0f} to {last.memory / 2**20:.0f} MiB, slope {slope(self.readings, 'memory'):+.0f} "
            f"bytes an operation ({self.growth() / 2**20:+.1f} MiB in all), MuJoCo's cache at most "
            f"{self.gauges.largest_cache / 2**20:.0f} MiB, children "
            f"{first.children_memory / 2**20:.0f} to {last.children_memory / 2**20:.0f} MiB; descriptors "
            f"{first.descriptors} to {last.descriptors}, threads {first.threads} to {last.threads}, children "
            f"{first.children} to {last.children}, temporary files {first.files} to {last.files}, objects "
            f"{first.objects} to {last.objects}; {len(self.findings)} findings"
        )

    def _work(self, chosen: Mapping[str, Chosen], seconds: float, every: float, readings: int = 0) -> None:
        names, weights = list(chosen), [weight for _, weight in chosen.values()]
        end, due = time.monotonic() + seconds, time.monotonic()
        while time.monotonic() < end or len(self.readings) < readings:
            (name,) = self.rng.choices(names, weights)
            self._do(name, chosen[name][0], self.rng.choice(self.known))
            if time.monotonic() >= due:
                self.readings.append(self.gauges.read(sum(self.done.values())))
                due = time.monotonic() + every

    def _do(self, name: str, operation: Callable[[Known], None], known: Known) -> None:
        self.done[name] += 1
        try:
            operation(known)
        except Exception as error:
            where = traceback.extract_tb(error.__traceback__)[-1]
            said = f"{type(error).__name__}: {error}"[:400]
            self.findings.append(f"{name} of {known.name}: {said} ({Path(where.filename).name}:{where.lineno})")


def main() -> int:
    """Run, and print what was found."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=900)
    parser.add_argument("--every", type=float, default=5, help="seconds between readings")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", action="append", default=[], help="an operation; may be given several times")
    parser.add_argument(
        "--model", action="append", help="a scene of models/, such as maze/maze.env; may be given again"
    )
    parser.add_argument("--real", type=int, default=None, help="how many real scenes")
    parser.add_argument("--table", type=Path, default=None, help="a file for all readings")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        home = Path(temporary).resolve()
        (home / "tmp").mkdir()
        tempfile.tempdir = os.environ["TMPDIR"] = str(home / "tmp")
        os.environ["ENV2MJCF_CACHE_DIR"] = str(home / "cache")
        known = known_scenes(arguments.seed, models=arguments.model, real=arguments.real)
        rng = random.Random(arguments.seed)
        operations = Operations(known, home / "tmp", rng)
        soak = Soak(operations, known, Gauges(home / "tmp"), rng, findings=[w for k in known for w in k.wrong])
        soak.run(arguments.seconds, arguments.every, tuple(arguments.only))
        operations.close()
    print(soak.line())
    for message in soak.findings[:40]:
        print(f"    {message}")
    if arguments.table is not None:
        arguments.table.write_text(table(soak.readings) + f"{dict(soak.done)}\n")
    return 1 if soak.findings else 0


if __name__ == "__main__":
    sys.exit(main())
