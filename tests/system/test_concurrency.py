"""A scene is shared by threads, travels to processes and lives through forks; nothing but caches is shared."""

from __future__ import annotations

import asyncio
import copy
import gc
import multiprocessing
import os
import pickle
import select
import signal
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from extras import needs, skip_without
from scenes import MODELS, free_cube, write_scene

import env2mjcf
from env2mjcf.planning import plan
from env2mjcf.view import offscreen, picture

ALPHA = MODELS / "alpha" / "alpha.env"
ARM = MODELS / "spherical-arm" / "spherical-arm.env"
CAR = MODELS / "two-robots" / "two-robots.env"
needs_gl = pytest.mark.skipif(offscreen.backend() is None, reason=f"no GL: {offscreen.missing()}")


def packed(scene: env2mjcf.Scene, q: np.ndarray, **how: Any) -> bytes:
    found = scene.packed_contacts(q, **how)
    arrays = (found.offsets, found.pair, found.position, found.normal, found.distance)
    return b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)


def deepest(scene: env2mjcf.Scene, q: np.ndarray) -> list[tuple[str, str, float]]:
    return [(c.link, c.other, c.distance) for row in q[:4] for c in scene.contacts(row)]


def report(scene: env2mjcf.Scene, q: np.ndarray) -> bytes:
    found = scene.check_path(q[:4])
    return found.configurations.tobytes() + found.edges.tobytes()


QUESTIONS: dict[str, Callable[[env2mjcf.Scene, np.ndarray], Any]] = {
    "collisions by exact": lambda s, q: s.in_collision(q, engine="exact").tobytes(),
    "collisions by mujoco": lambda s, q: s.in_collision(q, engine="mujoco").tobytes(),
    "collisions in threads": lambda s, q: s.in_collision(q, threads=3).tobytes(),
    "one verdict": lambda s, q: [s.in_collision(row) for row in q],
    "validity by exact": lambda s, q: s.is_valid(q, engine="exact").tobytes(),
    "validity by mujoco": lambda s, q: s.is_valid(q, engine="mujoco").tobytes(),
    "clearance": lambda s, q: s.clearance(q[:4]).tobytes(),
    "contacts": deepest,
    "packed contacts": lambda s, q: packed(s, q[:4]),
    "edges": lambda s, q: s.edge_in_collision(q[:4], q[1:5]).tobytes(),
    "proofs": lambda s, q: s.edge_is_free(q[:2], q[1:3]).tobytes(),
    "a path": report,
    "poses": lambda s, q: s.link_poses(q).tobytes(),
    "samples": lambda s, q: s.space.sample(5, seed=7).tobytes(),
    "loops": lambda s, q: s.loop_error(q).tobytes(),
    "a report": lambda s, q: repr((s.report, s.pairs, s.xml)),
    "a copy": lambda s, q: copy.deepcopy(s).in_collision(q).tobytes(),
}


def rows(scene: env2mjcf.Scene, count: int = 10) -> np.ndarray:
    return scene.space.sample(count, seed=3)


def answers(scene: env2mjcf.Scene, q: np.ndarray) -> dict[str, Any]:
    """Return the answers to every question, asked in this thread one after the other."""
    return {name: ask(scene, q) for name, ask in QUESTIONS.items()}


def said_in_child(call: Callable[[], object], seconds: float = 60) -> str:
    """Return what a call says in a forked child; "stuck" if it takes too long."""
    read_end, write_end = os.pipe()
    child = os.fork()
    if child == 0:
        said = "nothing"
        try:
            said = str(call())
        except BaseException as error:
            said = f"{type(error).__name__}: {error}"
        finally:
            os.write(write_end, said.encode())
            os._exit(0)
    os.close(write_end)
    try:
        ready = select.select([read_end], [], [], seconds)[0]
        return os.read(read_end, 10_000).decode() if ready else "stuck"
    finally:
        os.close(read_end)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


@contextmanager
def elsewhere(held: Any) -> Iterator[None]:
    """Hold a lock in another thread."""
    taken, done = threading.Event(), threading.Event()

    def hold() -> None:
        with held:
            taken.set()
            done.wait(30)

    thread = threading.Thread(target=hold)
    thread.start()
    taken.wait(30)
    try:
        yield
    finally:
        done.set()
        thread.join()


class TestThreads:
    @pytest.mark.slow_but("alpha")
    @pytest.mark.parametrize(
        ("path", "engine"), [(ALPHA, "exact"), (CAR, "exact"), (ARM, "mujoco")], ids=["alpha", "cars", "arm"]
    )
    def test_that_ask_everything_at_once_are_answered_as_one_thread_is(self, path: Path, engine: str) -> None:
        skip_without("fast")
        q = rows(env2mjcf.load(path))
        expected = answers(env2mjcf.load(path, engine=engine), q)
        # Fresh: what queries need is not made yet, and is made by whoever comes first.
        scene, start = env2mjcf.load(path, engine=engine), threading.Barrier(12)

        def work(seed: int) -> list[str]:
            order = np.random.default_rng(seed).permutation(list(QUESTIONS))[:9]
            start.wait(30)
            return [name for name in order if QUESTIONS[name](scene, q) != expected[name]]

        with ThreadPoolExecutor(12) as pool:
            assert [wrong for found in pool.map(work, range(12)) for wrong in found] == []

    @pytest.mark.slow
    def test_that_read_convert_and_load_get_the_same(self, tmp_path: Path) -> None:
        def files(folder: Path) -> dict[str, bytes]:
            return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}

        def work(number: int) -> tuple[Any, ...]:
            path = (ALPHA, ARM)[number % 2]
            env2mjcf.convert(path, tmp_path / str(number))
            scene = env2mjcf.load(path, cache=bool(number % 4 < 2))
            return env2mjcf.read(path), scene.xml, scene.assets, files(tmp_path / str(number))

        alone = [work(0), work(1)]
        with ThreadPoolExecutor(8) as pool:
            for number, found in zip(range(2, 18), pool.map(work, range(2, 18)), strict=True):
                assert found == alone[number % 2]

    def test_where_no_more_can_be_had_those_that_are_there_do_all(self, monkeypatch: pytest.MonkeyPatch) -> None:
        scene = env2mjcf.load(ALPHA, engine="mujoco")
        q = rows(scene, 500)
        expected, start = scene.in_collision(q, threads=1), threading.Thread.start

        def refused(thread: threading.Thread) -> None:
            if thread.name == "env2mjcf-2":
                raise RuntimeError("can't start new thread")
            start(thread)

        monkeypatch.setattr(threading.Thread, "start", refused)
        assert (scene.in_collision(q, threads=4) == expected).all()

    def test_that_plan_get_the_ways_of_their_seeds(self, monkeypatch: pytest.MonkeyPatch) -> None:
        skip_without("planning")
        from env2mjcf.planning import ompl_bridge as bridge

        scene = env2mjcf.load(ALPHA)
        q = scene.space.sample(60, seed=0)
        q = q[scene.is_valid(q)]

        def way(seed: int) -> bytes:
            return plan(scene, q[0], q[-1], planner="RRTConnect", seed=seed, time=60, shorten=False).path.tobytes()

        alone = [way(seed) for seed in range(4)]
        assert len(set(alone)) > 1

        def slowly(seed: int) -> None:
            # The seed is the process's: whoever may set another one meanwhile does so.
            util.RNG.setSeed(seed)
            time.sleep(0.05)

        util = bridge.util
        slow = SimpleNamespace(
            setLogLevel=util.setLogLevel, LOG_NONE=util.LOG_NONE, RNG=SimpleNamespace(setSeed=slowly)
        )
        monkeypatch.setattr(bridge, "util", slow)
        with ThreadPoolExecutor(4) as pool:
            assert list(pool.map(way, range(4))) == alone

    @needs("fast")
    def test_of_asyncio_may_ask(self) -> None:
        scene = env2mjcf.load(ALPHA)
        q = rows(scene)
        expected = answers(scene, q)

        async def all_at_once() -> list[Any]:
            return await asyncio.gather(*(asyncio.to_thread(ask, scene, q) for ask in QUESTIONS.values()))

        assert asyncio.run(all_at_once()) == list(expected.values())

    def test_may_drop_the_scene_while_it_answers(self) -> None:
        """The last reference goes while the query runs; afterwards nothing is left of it."""
        scene = env2mjcf.load(ALPHA)
        q = np.tile(rows(scene), (50, 1))
        expected, gone = scene.in_collision(q).tobytes(), weakref.ref(scene)
        ask, found = scene.in_collision, []
        thread = threading.Thread(target=lambda ask=ask: found.append(ask(q, threads=2).tobytes()))
        thread.start()
        del scene, ask
        gc.collect()
        thread.join()
        del thread
        gc.collect()
        assert found == [expected]
        assert gone() is None

    @needs("fast")
    def test_with_scenes_of_the_same_names_do_not_mix_them(self, tmp_path: Path) -> None:
        """Names of files, bodies and meshes are the same; where things are is not."""
        scenes = [
            env2mjcf.load(write_scene(tmp_path / str(i), free_cube(f"{x} 0 0 0 0 0"))) for i, x in enumerate((0.9, 1.1))
        ]
        big = write_scene(tmp_path / "big", free_cube("1.1 0 0 0 0 0"), cube=(MODELS / "seed" / "cube.g").read_text())
        scenes.append(env2mjcf.load(big))

        def work(number: int) -> bool:
            engine = ("exact", "mujoco")[number // 3 % 2]
            return scenes[number % 3].in_collision(np.zeros(6), engine=engine)

        with ThreadPoolExecutor(8) as pool:
            assert list(pool.map(work, range(600))) == [True, False, False] * 200


class TestProcesses:
    @pytest.mark.slow_but("spawn")
    @pytest.mark.parametrize("method", ["spawn", "forkserver", "fork"])
    def test_of_every_kind_answer_alike(self, method: str) -> None:
        scenes = [env2mjcf.load(ALPHA), env2mjcf.load(ARM, engine="mujoco")]
        context = multiprocessing.get_context(method)
        with ProcessPoolExecutor(1, mp_context=context) as pool:
            for scene in scenes:
                q = rows(scene)
                for ask in (env2mjcf.Scene.in_collision, env2mjcf.Scene.clearance, env2mjcf.Scene.link_poses):
                    there, here = pool.submit(ask, scene, q).result(), ask(scene, q)
                    assert there.tobytes() == here.tobytes()
                np.testing.assert_array_equal(scene.is_valid(q, executor=pool), scene.is_valid(q))

    def test_of_multiprocessing_itself_answer_alike(self) -> None:
        scene = env2mjcf.load(ALPHA)
        q = rows(scene)
        with multiprocessing.get_context("forkserver").Pool(1) as pool:
            there = pool.starmap(env2mjcf.Scene.in_collision, [(scene, row) for row in q])
        assert there == scene.in_collision(q).tolist()

    @needs("fast")
    def test_a_copy_answers_alike_and_has_a_state_of_its_own(self) -> None:
        scene = env2mjcf.load(ARM)
        q = rows(scene)
        expected = answers(scene, q)
        scene.set(q[0])
        for other in (copy.deepcopy(scene), pickle.loads(pickle.dumps(scene))):
            assert answers(other, q) == expected
            other.set(q[1])
            np.testing.assert_allclose(scene.q(), q[0], atol=1e-12)


class TestForks:
    @needs("fast")
    def test_child_and_parent_answer_alike_whatever_ran_before(self) -> None:
        scene = env2mjcf.load(ALPHA)
        q = rows(scene)
        expected = answers(scene, q)
        scene.in_collision(np.tile(q, (1000, 1)), threads=4)
        assert said_in_child(lambda: answers(scene, q) == expected) == "True"
        assert answers(scene, q) == expected

    def test_a_child_does_not_wait_for_threads_that_it_has_not(self) -> None:
        """Other threads were making things ready when the process was forked, and held their locks."""
        scene = env2mjcf.load(ALPHA)
        q = rows(scene)
        expected = scene.clearance(q[:4]).tolist()
        fresh = env2mjcf.load(ALPHA)
        with elsewhere(fresh._queries._lock), elsewhere(fresh._lock):
            said = said_in_child(lambda: (fresh.clearance(q[:4]).tolist() == expected, fresh.data.time))
        assert said == "(True, 0.0)"

    def test_a_process_is_not_forked_while_the_engine_compiles(self) -> None:
        skip_without("fast")
        from numba.core.compiler_lock import global_compiler_lock

        class Compiling:
            def __enter__(self) -> None:
                global_compiler_lock.acquire()

            def __exit__(self, *_: object) -> None:
                global_compiler_lock.release()

        def free() -> bool:
            with Compiling():
                return True

        env2mjcf.load(ALPHA).warm_up()
        holding = elsewhere(Compiling())
        holding.__enter__()
        ended = threading.Event()

        def end() -> None:
            ended.set()
            holding.__exit__(None, None, None)

        # Long enough for a child that does not wait to be there before.
        threading.Timer(0.5, end).start()
        assert said_in_child(lambda: free() and ended.is_set(), 20) == "True"

    @pytest.mark.slow
    def test_a_child_that_is_forked_while_a_scene_warms_up_can_use_it(self) -> None:
        """In a process of its own, in which nothing has imported numba yet."""
        skip_without("fast")
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(1, mp_context=context) as pool:
            assert pool.submit(warm_and_fork).result() == ["True"] * 4

    def test_a_child_plans_what_its_parent_plans(self) -> None:
        skip_without("planning")
        scene = env2mjcf.load(ALPHA)
        q = scene.space.sample(60, seed=0)
        q = q[scene.is_valid(q)]
        way = plan(scene, q[0], q[-1], seed=1, shorten=False).path.tobytes()
        assert said_in_child(lambda: plan(scene, q[0], q[-1], seed=1, shorten=False).path.tobytes() == way) == "True"

    @needs_gl
    def test_a_picture_does_not_wait_for_children_that_were_forked_meanwhile(self) -> None:
        """Such a child has copies of the pipes to the process that draws."""
        scene = env2mjcf.load(MODELS / "seed" / "seed.env")
        with offscreen._child(offscreen.backend() or "", open(os.devnull, "r+b")) as child:
            sleeper = os.fork()
            if sleeper == 0:
                time.sleep(60)
                os._exit(0)
            try:
                assert child.stdin is not None
                child.stdin.write(b"null\n")
                child.stdin.close()
                assert child.wait(30) == 0
            finally:
                os.kill(sleeper, signal.SIGKILL)
                os.waitpid(sleeper, 0)
        here = picture(scene, size=(32, 24)).tobytes()
        assert said_in_child(lambda: picture(scene, size=(32, 24)).tobytes() == here) == "True"


def warm_and_fork() -> list[str]:
    """Fork at moments of a scene's warming up, and ask the children."""
    found = []
    for delay in (0, 0.02, 0.1, 0.3):
        scene = env2mjcf.load(ALPHA)
        scene.warm_up(wait=False)
        time.sleep(delay)
        found.append(said_in_child(lambda scene=scene: bool(scene.clearance(scene.space.home) > -1)))
    return found


def test_read_only_rows_do_not_compile_the_engine_again() -> None:
    """Home is read-only; to numba such an array is of another type, and compiling takes a minute."""
    skip_without("fast")
    from env2mjcf.contact.exact.kernels import entries

    scene = env2mjcf.load(ALPHA)
    q = rows(scene)
    frozen = q.copy()
    frozen.setflags(write=False)
    names = ("collisions", "validities", "distances", "edges_collide", "edges_are_free")
    answers(scene, q)
    before = [len(getattr(entries, name).signatures) for name in names]
    assert answers(scene, frozen) == answers(scene, q)
    assert [len(getattr(entries, name).signatures) for name in names] == before
