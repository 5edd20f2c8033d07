"""Where queries are worked on changes nothing but the time they take."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import shutil
import signal
import subprocess
import sys
import textwrap
import time
import zlib
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from extras import skip_without
from scenes import free_cube, write_scene

import env2mjcf
from env2mjcf.contact import executors as remote
from env2mjcf.contact.tasks import Chunks
from env2mjcf.contact.threads import thread_count

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def cubes(tmp_path_factory: pytest.TempPathFactory) -> env2mjcf.Scene:
    """A unit cube that flies between two others; its files are gone."""
    folder = tmp_path_factory.mktemp("cubes")
    scene = env2mjcf.load(write_scene(folder, free_cube("2 0 0 0 0 0", "-2 0 0 0 0 0")), engine="mujoco")
    shutil.rmtree(folder)
    return scene


@pytest.fixture(scope="module", params=["threads", "spawn", "fork"])
def executor(request: pytest.FixtureRequest) -> Iterator[Executor]:
    """Two workers of each kind."""
    if request.param == "threads":
        with ThreadPoolExecutor(2) as pool:
            yield pool
    else:
        with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context(request.param)) as pool:
            yield pool


def near(scene: env2mjcf.Scene, n: int, seed: int = 0) -> np.ndarray:
    """Configurations of which a good part touches."""
    q = scene.space.sample(n, seed=seed)
    q[:, :3] *= 0.2, 0.08, 0.08
    return q


@pytest.mark.slow_but("spawn")
def test_verdicts_are_those_of_this_thread(cubes: env2mjcf.Scene, executor: Executor) -> None:
    q = near(cubes, 5000)
    touching = cubes.in_collision(q, threads=1)
    assert 1000 < touching.sum() < 4000
    np.testing.assert_array_equal(cubes.in_collision(q, executor=executor), touching)
    np.testing.assert_array_equal(cubes.is_valid(q, executor=executor), cubes.is_valid(q, threads=1))
    assert cubes.in_collision(q[0], executor=executor) is bool(touching[0])
    assert cubes.in_collision(q[:0], executor=executor).shape == (0,)


@pytest.mark.slow_but("fork")
def test_clearances_edges_and_contacts_are_the_same_numbers(cubes: env2mjcf.Scene, executor: Executor) -> None:
    q, to = near(cubes, 60), near(cubes, 60, seed=1)
    np.testing.assert_array_equal(cubes.clearance(q, executor=executor), cubes.clearance(q))
    swept = cubes.edge_in_collision(q, to)
    assert 0 < swept.sum() < 60
    np.testing.assert_array_equal(cubes.edge_in_collision(q, to, executor=executor), swept)
    over, under = np.array([2.0, 0, 4, 0, 0, 0]), np.array([2.0, 0, -4, 0, 0, 0])
    assert cubes.edge_in_collision(over, under, executor=executor) is True
    # At this resolution the ends alone are looked at.
    assert cubes.edge_in_collision(over, under, 100.0, executor=executor) is False
    np.testing.assert_array_equal(cubes.edge_is_free(q, to, executor=executor), cubes.edge_is_free(q, to))
    there, here = cubes.packed_contacts(q, executor=executor), cubes.packed_contacts(q)
    for name in ("offsets", "pair", "position", "normal", "distance"):
        np.testing.assert_array_equal(getattr(there, name), getattr(here, name))


@pytest.mark.slow_but("3")
@pytest.mark.parametrize("threads", [1, 2, 3])
def test_the_number_of_threads_changes_nothing(cubes: env2mjcf.Scene, threads: int) -> None:
    q, to = near(cubes, 100), near(cubes, 100, seed=1)
    np.testing.assert_array_equal(cubes.clearance(q, threads=threads), cubes.clearance(q))
    np.testing.assert_array_equal(cubes.edge_in_collision(q, to, threads=threads), cubes.edge_in_collision(q, to))
    np.testing.assert_array_equal(cubes.edge_is_free(q, to, threads=threads), cubes.edge_is_free(q, to))
    np.testing.assert_array_equal(cubes.link_poses(q, threads=threads), cubes.link_poses(q))


def test_packed_contacts_are_the_contacts_of_each_row(cubes: env2mjcf.Scene) -> None:
    q = near(cubes, 200)
    packed = cubes.packed_contacts(q, threads=2)
    each = [cubes.contacts(row) for row in q]
    assert [len(c) for c in each] == np.diff(packed.offsets).tolist()
    assert len(packed) == packed.offsets[-1] > 100
    for k, contact in enumerate(c for contacts in each for c in contacts):
        assert cubes.pairs[packed.pair[k]] == (contact.link, contact.other)
        np.testing.assert_array_equal(packed.position[k], contact.position)
        np.testing.assert_array_equal(packed.normal[k], contact.normal)
        assert packed.distance[k] == contact.distance
    none = cubes.packed_contacts(np.zeros((0, 6)))
    assert (none.offsets.tolist(), none.position.shape, len(none)) == ([0], (0, 3), 0)
    with pytest.raises(ValueError, match="expected many"):
        cubes.packed_contacts(q[0])


def test_the_exact_engine_answers_alike_in_another_process(tmp_path: Path) -> None:
    skip_without("fast")
    scene = env2mjcf.load(write_scene(tmp_path, free_cube("2 0 0 0 0 0", "-2 0 0 0 0 0")))
    q = near(scene, 20_000)
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        np.testing.assert_array_equal(scene.in_collision(q, executor=pool), scene.in_collision(q, threads=2))


def test_a_scene_travels_without_its_files(cubes: env2mjcf.Scene) -> None:
    text = pickle.dumps(cubes)
    assert not Path(cubes.environment.path).exists()
    again = pickle.loads(text)
    q = near(cubes, 500)
    np.testing.assert_array_equal(again.in_collision(q), cubes.in_collision(q))
    parcel = remote.parcel(again._solver)
    assert len(parcel.content) < len(text) / 5


class Recorder(Executor):
    """Does what it is told at once, as another process would: with copies; remembers what was sent."""

    def __init__(self) -> None:
        self.sent: list[remote.Task] = []
        self.waiting = self.most = 0

    def submit(self, function: Callable, /, *arguments, **_) -> Future:
        self.sent.append(arguments[0])
        future: Future = Future()
        try:
            future.set_result(pickle.loads(pickle.dumps(function))(pickle.loads(pickle.dumps(arguments[0]))))
        except Exception as error:
            future.set_exception(error)
        return future


def test_a_scene_is_sent_where_it_is_asked_for_and_not_again(cubes: env2mjcf.Scene) -> None:
    remote._memory.clear()
    recorder = Recorder()
    q = near(cubes, 3000)
    expected = cubes.in_collision(q)
    np.testing.assert_array_equal(cubes.in_collision(q, executor=recorder), expected)
    first = len(recorder.sent)
    assert sum(t.content is not None for t in recorder.sent) >= 1
    np.testing.assert_array_equal(cubes.in_collision(q, executor=recorder), expected)
    assert all(t.content is None for t in recorder.sent[first:])
    # A worker that has forgotten, because it is a new process or has had many scenes, is sent the scene again.
    remote._memory.clear()
    np.testing.assert_array_equal(cubes.in_collision(q, executor=recorder), expected)


def test_a_worker_keeps_the_scenes_that_it_used_last() -> None:
    memory = remote._Memory()

    def scene(k: int) -> bytes:
        return zlib.compress(pickle.dumps(f"scene {k}"))

    for k in range(4):
        assert memory.find(str(k), scene(k)) == f"scene {k}"
    assert memory.find("0", None) == "scene 0"
    # The fifth takes the place of the one that was used longest ago.
    assert memory.find("4", scene(4)) == "scene 4"
    assert [memory.find(str(k), None) for k in range(5)] == ["scene 0", None, "scene 2", "scene 3", "scene 4"]


def test_two_scenes_are_never_taken_for_each_other(tmp_path: Path) -> None:
    near_wall = env2mjcf.load(write_scene(tmp_path, free_cube("0.9 0 0 0 0 0")), engine="mujoco")
    far_wall = env2mjcf.load(write_scene(tmp_path, free_cube("1.1 0 0 0 0 0")), engine="mujoco")
    recorder = Recorder()
    for _ in range(2):
        assert near_wall.in_collision(np.zeros(6), executor=recorder) is True
        assert far_wall.in_collision(np.zeros(6), executor=recorder) is False


class Slow(Executor):
    """Has many workers, and counts how much is on its way at a time."""

    def __init__(self) -> None:
        self.pool = ThreadPoolExecutor(1)
        self._max_workers = 3
        self.unfinished = self.most = 0

    def submit(self, function: Callable, /, *arguments, **_) -> Future:
        self.unfinished += 1
        self.most = max(self.most, self.unfinished)
        future = self.pool.submit(function, *arguments)
        future.add_done_callback(lambda _: setattr(self, "unfinished", self.unfinished - 1))
        return future


def test_only_a_few_tasks_are_on_their_way_at_a_time(cubes: env2mjcf.Scene) -> None:
    slow = Slow()
    cubes.in_collision(near(cubes, 30_000), executor=slow)
    assert 3 <= slow.most <= 7


def test_chunks_grow_until_they_take_long_enough_and_cover_all_rows_once() -> None:
    chunks, taken = Chunks(10_000_000, 1, 8, 0.0), []
    while (rows := chunks.take()) is not None:
        taken.append(rows)
        chunks.took(rows.stop - rows.start, (rows.stop - rows.start) * 1e-6)
    sizes = [r.stop - r.start for r in taken]
    assert sizes[0] <= 64
    assert max(sizes) == pytest.approx(200_000, rel=0.01)
    assert [r.start for r in taken[1:]] == [r.stop for r in taken[:-1]]
    assert taken[-1].stop == 10_000_000


def test_a_slow_first_chunk_is_forgotten() -> None:
    """It may have compiled something for half a minute."""
    chunks = Chunks(10_000_000, 1, 8, 0.0)
    chunks.take()
    chunks.took(64, 30.0)
    for _ in range(10):
        rows = chunks.take()
        assert rows is not None
        chunks.took(rows.stop - rows.start, (rows.stop - rows.start) * 1e-6)
    assert rows.stop - rows.start > 100_000


def test_many_rows_have_every_core_and_few_have_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "cpu_count", lambda: 7)
    assert [thread_count(None, 10_000_000), thread_count(None, 1), thread_count(3, 1)] == [7, 1, 3]
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert thread_count(None, 10_000_000) == 1


def test_wide_rows_make_small_chunks() -> None:
    chunks = Chunks(1000, 1, 10_000_000, 0.0)
    assert chunks.take() == slice(0, 3)


def die(*_: object) -> np.ndarray:
    os._exit(1)


def test_a_dead_worker_process_is_a_clear_error(cubes: env2mjcf.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("env2mjcf.contact.queries.ContactQueries.collisions", die)
    with (
        ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("fork")) as pool,
        pytest.raises(BrokenExecutor, match="make a new one and ask again"),
    ):
        cubes.in_collision(near(cubes, 100), executor=pool)


def test_an_error_in_a_worker_is_raised_here(cubes: env2mjcf.Scene, executor: Executor) -> None:
    with pytest.raises(ValueError, match="at least 1"):
        cubes.in_collision(near(cubes, 10), executor=executor, threads=0)


@pytest.mark.slow
def test_ctrl_c_stops_threads_within_a_second(tmp_path: Path) -> None:
    path = write_scene(tmp_path, free_cube("2 0 0 0 0 0", "-2 0 0 0 0 0"))
    program = textwrap.dedent(
        """
        import signal, sys, threading, env2mjcf
        signal.signal(signal.SIGINT, signal.default_int_handler)  # jobs in the background inherit that it is ignored
        scene = env2mjcf.load(sys.argv[1], engine="mujoco")
        q = scene.space.sample(2_000_000, seed=0)
        scene.in_collision(q[:1000])
        print("asked", flush=True)
        try:
            scene.clearance(q, threads=2)
        except KeyboardInterrupt:
            print("stopped", threading.active_count(), flush=True)
        """
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    child = subprocess.Popen(
        [sys.executable, "-c", program, str(path)], stdout=subprocess.PIPE, text=True, env=environment
    )
    try:
        assert child.stdout is not None
        assert child.stdout.readline() == "asked\n"
        time.sleep(1)
        child.send_signal(signal.SIGINT)
        began = time.monotonic()
        assert child.stdout.readline() == "stopped 1\n"
        # One second is promised; the rest is for a machine that is busy with other things.
        assert time.monotonic() - began < 2
        assert child.wait(timeout=10) == 0
    finally:
        child.kill()
        child.wait()
