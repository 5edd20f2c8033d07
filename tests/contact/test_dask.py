"""A real Dask scheduler and two worker processes on the loopback interface; one of them dies."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import free_cube, write_scene

import env2mjcf
from env2mjcf.cli.main import main

distributed = pytest.importorskip("distributed", reason="no distributed: pip install 'env2mjcf[dask]'")


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        client.wait_for_workers(2, timeout=60)
        yield client


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cubes")
    write_scene(folder, free_cube("2 0 0 0 0 0", "-2 0 0 0 0 0"))
    return folder


@pytest.fixture(scope="module")
def scene(folder: Path) -> env2mjcf.Scene:
    # This engine needs no compilation, so the workers begin at once.
    return env2mjcf.load(folder / "scene.env", engine="mujoco")


def near(scene: env2mjcf.Scene, n: int) -> np.ndarray:
    q = scene.space.sample(n, seed=0)
    q[:, :3] *= 0.2, 0.08, 0.08
    return q


def pids(client: Any) -> set[int]:
    return set(client.run(os.getpid).values())


@pytest.mark.slow
def test_every_query_has_the_answers_of_one_thread(client: Any, scene: env2mjcf.Scene) -> None:
    executor, q = client.get_executor(), near(scene, 4000)
    few, to = q[:60], q[60:120]
    np.testing.assert_array_equal(scene.in_collision(q, executor=executor), scene.in_collision(q))
    np.testing.assert_array_equal(scene.is_valid(q, executor=executor), scene.is_valid(q))
    np.testing.assert_array_equal(scene.clearance(few, executor=executor), scene.clearance(few))
    np.testing.assert_array_equal(scene.edge_in_collision(few, to, executor=executor), scene.edge_in_collision(few, to))
    np.testing.assert_array_equal(scene.edge_is_free(few, to, executor=executor), scene.edge_is_free(few, to))
    np.testing.assert_array_equal(
        scene.packed_contacts(few, executor=executor).position, scene.packed_contacts(few).position
    )


@pytest.mark.slow
def test_a_worker_that_is_killed_costs_no_verdict(client: Any, scene: env2mjcf.Scene) -> None:
    before = pids(client)
    assert len(before) == 2
    # A second of work, many times over: whatever the machine, the run is long enough to be in its middle.
    q = np.tile(near(scene, 1000), (10, 1))
    found: dict[str, np.ndarray] = {}

    def ask() -> None:
        found["clearance"] = scene.clearance(q, executor=client.get_executor())

    thread = threading.Thread(target=ask)
    thread.start()
    deadline = time.monotonic() + 30
    while not any(client.processing().values()) and time.monotonic() < deadline:
        time.sleep(0.02)
    time.sleep(0.7)
    assert thread.is_alive()
    os.kill(min(before), signal.SIGKILL)
    thread.join(timeout=120)
    assert not thread.is_alive()
    expected = np.tile(scene.clearance(q[:1000]), 10)
    assert 0 < (expected <= 0).sum() < len(q)
    np.testing.assert_array_equal(found["clearance"], expected)
    client.wait_for_workers(2, timeout=60)
    assert pids(client) != before


def test_the_program_works_on_a_cluster(
    client: Any, scene: env2mjcf.Scene, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    q = near(scene, 30_000)
    np.save(tmp_path / "q.npy", q)
    address = client.scheduler.address
    words = [str(folder / "scene.env"), str(tmp_path / "q.npy"), "-o", str(tmp_path / "v.npy"), "--engine", "mujoco"]
    assert main(["batch", *words, "--dask", address]) == 0
    np.testing.assert_array_equal(np.load(tmp_path / "v.npy"), scene.in_collision(q))
    assert "30000 configurations" in capsys.readouterr().out


def test_ctrl_c_takes_tasks_back(client: Any, scene: env2mjcf.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    executor = client.get_executor()

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("env2mjcf.contact.tasks.Chunks.took", interrupted)
        with pytest.raises(KeyboardInterrupt):
            scene.clearance(near(scene, 20_000), executor=executor)
    deadline = time.monotonic() + 20
    while any(client.processing().values()) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(client.processing().values())


@pytest.mark.slow
def test_nobody_at_the_address_is_wrong_usage(
    scene: env2mjcf.Scene, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr("env2mjcf.cli.batch._DASK_PATIENCE", 1)
    np.save(tmp_path / "q.npy", near(scene, 10))
    words = [str(folder / "scene.env"), str(tmp_path / "q.npy"), "-o", str(tmp_path / "v.npy")]
    assert main(["batch", *words, "--dask", "tcp://127.0.0.1:9"]) == 2
    assert "no Dask scheduler answers at tcp://127.0.0.1:9" in capsys.readouterr().err
