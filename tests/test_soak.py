"""A short form of stress/soak.py: many operations at random, flat descriptors, threads, children, files and memory."""

from __future__ import annotations

import os
import random
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import env2mjcf

sys.path.insert(0, str(Path(__file__).parent / "stress"))

if not Path("/proc/self/fd").is_dir():
    pytest.skip("what a process holds is read from /proc", allow_module_level=True)
pytest.importorskip("fcl")
pytest.importorskip("numba")
pytest.importorskip("ompl")
pytest.importorskip("viser")

from gauges import Gauges, Reading, grown, slope, steady_slope
from known import Known, known_scenes
from operations import Operations
from soak import Soak

# Without pools of processes and pictures, which take seconds to start.
QUICK = (
    "verdicts", "clearance", "contacts", "edges", "poses", "read", "bad file", "load", "load otherwise", "convert",
    "translate", "companions", "check", "verbs", "plan", "travel", "simulate", "cache",
)  # fmt: skip
SCENES = ("maze/maze.env", "two-robots/two-robots.env")
# Bytes that a run of seconds may grow by: what is done for the first time in it stays. A scene that stays is about a
# million.
LEAST = 16_000_000


@pytest.fixture(scope="module")
def known() -> list[Known]:
    return known_scenes(0, models=SCENES, real=0, truth=False)


@pytest.fixture
def soak(known: list[Known], tmp_path: Path) -> Iterator[Soak]:
    (tmp_path / "tmp").mkdir()
    rng = random.Random(0)
    operations = Operations(known, tmp_path / "tmp", rng)
    yield Soak(operations, known, Gauges(tmp_path / "tmp"), rng, least=LEAST)
    operations.close()


@pytest.mark.slow
def test_everything_at_random_changes_no_answer_and_leaves_nothing(soak: Soak) -> None:
    soak.run(10, 0.5, QUICK)
    assert soak.findings == []
    assert soak.operations.configurations > 1000
    assert len(soak.done) == len(QUICK)


class Leaks:
    """Operations that keep what they should not."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.kept: list[object] = []
        self.stop = threading.Event()

    def scene(self, known: Known) -> None:
        for _ in range(3):
            scene = env2mjcf.load(known.path, **known.options)
            scene.clearance(scene.space.home)
            self.kept.append(scene)

    def descriptor(self, known: Known) -> None:
        self.kept.append(os.open(os.devnull, os.O_RDONLY))

    def thread(self, known: Known) -> None:
        time.sleep(0.01)
        thread = threading.Thread(target=self.stop.wait, daemon=True)
        thread.start()
        self.kept.append(thread)

    def file(self, known: Known) -> None:
        (self._folder / f"left-{len(self.kept)}").touch()
        self.kept.append(None)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("leak", "words"),
    [("scene", "memory grew"), ("descriptor", "descriptors grew"), ("thread", "threads grew"), ("file", "files grew")],
)
def test_a_real_leak_is_found(soak: Soak, tmp_path: Path, leak: str, words: str) -> None:
    leaks = Leaks(tmp_path / "tmp")
    operation: Callable[[Known], None] = getattr(leaks, leak)
    try:
        soak.work({leak: (operation, 5), "poses": (soak.operations.poses, 1)}, 4 if leak == "scene" else 0.5, 0.05)
    finally:
        leaks.stop.set()
        for kept in leaks.kept:
            if isinstance(kept, int):
                os.close(kept)
    assert any(words in finding for finding in soak.findings)


@pytest.mark.slow
def test_an_answer_that_changes_is_found(soak: Soak, known: list[Known]) -> None:
    kept = known[0].answers["poses", "exact"]
    known[0].answers["poses", "exact"] = kept + 1e-15
    try:
        soak.run(0.5, 0.2, ("poses",))
    finally:
        known[0].answers["poses", "exact"] = kept
    assert any("poses" in finding and "not what they were" in finding for finding in soak.findings)


def test_slopes_ignore_a_burst() -> None:
    def reading(operations: int, memory: int) -> Reading:
        return Reading(float(operations), operations, memory, 0, 10, 1, 0, 0, 0)

    flat = [reading(i, 1000 + (10**6 if i == 5 else 0)) for i in range(20)]
    assert slope(flat, "memory") == 0
    assert slope([reading(i, 1000 + 7 * i) for i in range(20)], "memory") == 7
    assert grown(flat) == []
    step = [reading(i, 1000 + (10**6 if i > 5 else 0)) for i in range(20)]
    assert steady_slope(step, "memory") == 0
