"""Processes that this one has started are killed: one clear error, no hang, nothing half-written, no zombie."""

from __future__ import annotations

import multiprocessing
import os
import signal
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import free_cube, write_scene

import env2mjcf
from env2mjcf.view import film, offscreen

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
needs_gl = pytest.mark.skipif(offscreen.backend() is None, reason=f"no GL: {offscreen.missing()}")
WAY = np.array([[-3.0, -3, 0, 0, 0, 0], [-3, 2, 0, 0, 0, 1]])


@pytest.fixture(scope="module")
def cubes(tmp_path_factory: pytest.TempPathFactory) -> env2mjcf.Scene:
    return env2mjcf.load(write_scene(tmp_path_factory.mktemp("cubes"), free_cube("2 0 0 0 0 0")), engine="mujoco")


def children(word: str = "") -> list[int]:
    """Return the processes that this one has started and not yet taken leave of, those with a word in their command."""
    found: list[int] = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((process / "stat").read_text().rpartition(")")[2].split()[1])
            command = (process / "cmdline").read_bytes().decode(errors="replace")
        except OSError:
            continue
        if parent == os.getpid() and word in command:
            found.append(int(process.name))
    return found


@pytest.mark.slow_but("ffmpeg")
@needs_gl
@pytest.mark.parametrize(
    ("ending", "victim", "error", "message"),
    [
        ("mp4", "worker.py", offscreen.RenderError, "the process that draws ended too early"),
        ("gif", "worker.py", offscreen.RenderError, "the process that draws ended too early"),
        ("mp4", "ffmpeg", env2mjcf.ConversionError, "ffmpeg ended with signal 9"),
    ],
)
def test_a_film_whose_maker_is_killed_is_no_film(
    ending: str, victim: str, error: type[Exception], message: str, cubes: env2mjcf.Scene, tmp_path: Path
) -> None:
    pytest.importorskip("imageio_ffmpeg")
    before = children()

    def kill(done: int, _: int) -> None:
        if done == 10:
            (pid,) = children(victim)
            os.kill(pid, signal.SIGKILL)

    (tmp_path / f"a.{ending}").write_text("old")
    with pytest.raises(error, match=message):
        film(cubes, WAY, tmp_path / f"a.{ending}", seconds=3, fps=20, size=(320, 240), advance=kill)
    assert [p.name for p in tmp_path.iterdir()] == [f"a.{ending}"]
    assert (tmp_path / f"a.{ending}").read_text() == "old"
    assert children() == before


def test_a_worker_that_is_killed_ends_the_question(cubes: env2mjcf.Scene) -> None:
    class Killing(ProcessPoolExecutor):
        """Loses a worker when it is given its third piece of work."""

        def __init__(self) -> None:
            super().__init__(2, mp_context=multiprocessing.get_context("fork"))
            self._given = 0

        def submit(self, *arguments: Any, **keywords: Any) -> Any:
            before = {child.pid for child in multiprocessing.active_children()}
            future = super().submit(*arguments, **keywords)
            self._victim = getattr(self, "_victim", None) or next(
                child.pid for child in multiprocessing.active_children() if child.pid not in before
            )
            self._given += 1
            if self._given == 3:
                os.kill(self._victim, signal.SIGKILL)
            return future

    q = cubes.space.sample(20_000, seed=0)
    with Killing() as pool, pytest.raises(BrokenExecutor, match="make a new one and ask again"):
        cubes.clearance(q, executor=pool)
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("fork")) as pool:
        np.testing.assert_array_equal(cubes.in_collision(q[:500], executor=pool), cubes.in_collision(q[:500]))
