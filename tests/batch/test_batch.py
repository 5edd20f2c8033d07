"""Files of configurations in, files of verdicts out: whole or absent, and resumed where the work stopped."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from batches import CUBES, Stop, left, saved, stopped, wait_for_progress
from scenes import free_cube, write_scene

import env2mjcf
from env2mjcf.batch import run
from env2mjcf.batch import runner as running_module
from env2mjcf.cli.main import main

ROOT = Path(__file__).parents[2]


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> env2mjcf.Scene:
    """A cube between two others; the current folder is that of its files."""
    monkeypatch.chdir(tmp_path)
    return env2mjcf.load(write_scene(tmp_path, CUBES), engine="mujoco")


@pytest.mark.parametrize(
    ("what", "method", "kind"),
    [("collision", "in_collision", bool), ("valid", "is_valid", bool), ("clearance", "clearance", float)],
)
def test_answers_are_those_of_the_scene(scene, tmp_path, what, method, kind) -> None:
    q = saved(scene, 120)
    result = run(scene, "q.npy", "v.npy", what, threads=2)
    answers, expected = np.load("v.npy"), getattr(scene, method)(q)
    assert answers.dtype == kind
    np.testing.assert_array_equal(answers, expected)
    assert left(tmp_path) == {"v.npy"}
    first = int((expected <= 0).sum() if kind is float else expected.sum())
    assert 0 < first < 120
    assert list(result.counts.values()) == [first, 120 - first]
    assert result.least == (expected.min() if kind is float else None)


def test_no_rows_give_no_verdicts(scene) -> None:
    saved(scene, 0)
    assert run(scene, "q.npy", "v.npy").rows == 0
    assert np.load("v.npy").shape == (0,)


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64, ">f8"])
def test_any_layout_of_floats_will_do(scene, dtype, order) -> None:
    q = saved(scene, 500).astype(dtype)
    np.save("q.npy", np.asarray(q, order=order))
    run(scene, "q.npy", "v.npy")
    np.testing.assert_array_equal(np.load("v.npy"), scene.in_collision(q.astype(float)))


def test_numbers_of_the_file_are_decoded(scene) -> None:
    q = saved(scene, 500)
    np.save("cfg.npy", scene.space.encode(q))
    run(scene, "cfg.npy", "v.npy", file_units=True)
    np.testing.assert_array_equal(np.load("v.npy"), scene.in_collision(q))


@pytest.fixture
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running_module, "_FIRST", 100)
    monkeypatch.setattr(running_module, "_GROWTH", 1)


@pytest.mark.usefixtures("small_blocks")
class TestResuming:
    def test_goes_on_where_it_stopped(self, scene, tmp_path) -> None:
        q = saved(scene, 1000)
        stopped(scene, 400)
        assert left(tmp_path) == {"v.npy.partial", "v.npy.journal"}
        said: list[str] = []
        result = run(scene, "q.npy", "v.npy", say=said.append)
        assert result.resumed == 400
        assert "after 400 of 1000" in said[0]
        np.testing.assert_array_equal(np.load("v.npy"), scene.in_collision(q))
        assert left(tmp_path) == {"v.npy"}

    def test_a_scene_that_is_loaded_again_is_the_same(self, scene, tmp_path) -> None:
        saved(scene, 1000)
        stopped(scene, 400)
        again = env2mjcf.load(tmp_path / "scene.env", engine="mujoco")
        assert run(again, "q.npy", "v.npy").resumed == 400

    @pytest.mark.parametrize("change", ["scene", "question", "done rows", "number of rows", "option"])
    def test_what_has_changed_is_begun_anew(self, scene, tmp_path, change) -> None:
        q, what = saved(scene, 1000), "collision"
        stopped(scene, 400)
        if change == "scene":
            scene = env2mjcf.load(write_scene(tmp_path, free_cube("2.2 0 0 0 0 0", "-2 0 0 0 0 0")), engine="mujoco")
        elif change == "option":
            scene = env2mjcf.load(tmp_path / "scene.env", engine="mujoco", collision="surface")
        elif change == "question":
            what = "valid"
        else:
            q = q[::-1].copy() if change == "done rows" else q[:900]
            np.save("q.npy", q)
        said: list[str] = []
        assert run(scene, "q.npy", "v.npy", what, say=said.append).resumed == 0
        assert "beginning anew" in said[0]
        np.testing.assert_array_equal(
            np.load("v.npy"), getattr(scene, "is_valid" if what == "valid" else "in_collision")(q)
        )

    @pytest.mark.parametrize("damage", ["journal cut off", "partial cut off", "answers cut off", "partial gone"])
    def test_damage_is_begun_anew(self, scene, tmp_path, damage) -> None:
        q = saved(scene, 1000)
        stopped(scene, 400)
        path = tmp_path / ("v.npy.journal" if "journal" in damage else "v.npy.partial")
        if "gone" in damage:
            path.unlink()
        else:
            path.write_bytes(path.read_bytes()[: 200 if "answers" in damage else 40])
        assert run(scene, "q.npy", "v.npy").resumed == 0
        np.testing.assert_array_equal(np.load("v.npy"), scene.in_collision(q))

    def test_a_mended_row_costs_nothing_that_was_done_before_it(self, scene, tmp_path) -> None:
        q = saved(scene, 1000)
        broken = q.copy()
        broken[437, 4] = np.nan
        np.save("q.npy", broken)
        with pytest.raises(env2mjcf.FormatError, match=r"row 437 of q.npy: cube.ry is nan"):
            run(scene, "q.npy", "v.npy")
        assert "v.npy" not in left(tmp_path)
        np.save("q.npy", q)
        assert run(scene, "q.npy", "v.npy").resumed == 400
        np.testing.assert_array_equal(np.load("v.npy"), scene.in_collision(q))

    def test_an_output_that_is_there_stays_until_the_new_one_is_whole(self, scene) -> None:
        saved(scene, 1000)
        np.save("v.npy", np.arange(3))
        stopped(scene, 400)
        assert np.load("v.npy").tolist() == [0, 1, 2]
        run(scene, "q.npy", "v.npy")
        assert len(np.load("v.npy")) == 1000

    def test_two_do_not_write_the_same_output(self, scene) -> None:
        saved(scene, 1000)

        def another(done: int, _rows: int) -> None:
            if done:
                with pytest.raises(env2mjcf.ConversionError, match="another process"):
                    run(scene, "q.npy", "v.npy")
                raise Stop

        with pytest.raises(Stop):
            run(scene, "q.npy", "v.npy", advance=another)


@pytest.mark.slow
def test_a_killed_run_is_resumed_and_every_verdict_right(scene, tmp_path) -> None:
    """SIGKILL leaves no chance to tidy up."""
    q = saved(scene, 1_000_000).astype(np.float32)
    np.save("q.npy", q)
    words = [
        sys.executable,
        "-m",
        "env2mjcf",
        "batch",
        "scene.env",
        "q.npy",
        "-o",
        "v.npy",
        "--engine",
        "mujoco",
        "--threads",
        "1",
    ]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    child = subprocess.Popen(words, env=environment, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    try:
        wait_for_progress(child)
        child.send_signal(signal.SIGKILL)
    finally:
        child.kill()
        child.wait()
    assert left(tmp_path) >= {"v.npy.partial", "v.npy.journal"}
    assert "v.npy" not in left(tmp_path)
    done = json.loads(Path("v.npy.journal").read_text())["done"]
    assert 0 < done < len(q)
    again = subprocess.run([*words, "--json"], env=environment, capture_output=True, text=True, check=False)
    assert again.returncode == 0
    assert f"going on after {done} of 1000000" in again.stderr
    assert "a second" in again.stderr
    assert json.loads(again.stdout)["resumed"] == done
    np.testing.assert_array_equal(np.load("v.npy"), scene.in_collision(q, threads=2))


def test_ctrl_c_keeps_what_is_done(scene, tmp_path) -> None:
    saved(scene, 200_000)
    program = (
        "import signal, sys; from env2mjcf.batch import runner; from env2mjcf.cli.main import main\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "runner._FIRST = 200; runner._GROWTH = 1\n"
        "sys.exit(main(['batch', 'scene.env', 'q.npy', '-o', 'v.npy', '--engine', 'mujoco', '--what', 'clearance']))\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    child = subprocess.Popen([sys.executable, "-c", program], env=environment, stderr=subprocess.DEVNULL)
    try:
        wait_for_progress(child)
        child.send_signal(signal.SIGINT)
        assert child.wait(timeout=20) == 130
    finally:
        child.kill()
        child.wait()
    assert left(tmp_path) == {"v.npy.partial", "v.npy.journal"}
    done = json.loads(Path("v.npy.journal").read_text())["done"]
    q = np.load("q.npy")[: min(done, 100)]
    assert 0 < done < 200_000
    np.testing.assert_array_equal(np.load("v.npy.partial", mmap_mode="r")[: len(q)], scene.clearance(q))


class TestProgram:
    def run(self, capsys, *words: str) -> tuple[int, str, str]:
        capsys.readouterr()
        status = main(["batch", "scene.env", *words])
        return status, *capsys.readouterr()

    def test_prints_counts_and_writes_the_file(self, scene, capsys) -> None:
        touching = int(scene.in_collision(saved(scene, 300)).sum())
        status, out, err = self.run(capsys, "q.npy", "-o", "v.npy", "--engine", "mujoco")
        assert status == 0
        assert out == f"300 configurations: {touching} in collision, {300 - touching} free; written to v.npy\n"
        assert "300 of 300 rows" in err
        assert np.load("v.npy").sum() == touching

    def test_prints_json(self, scene, capsys) -> None:
        saved(scene, 50)
        status, out, _ = self.run(capsys, "q.npy", "-o", "v.npy", "--what", "clearance", "--json", "--threads", "2")
        result = json.loads(out)
        assert status == 0
        assert result["rows"] == 50
        assert sum(result["counts"].values()) == 50
        assert result["least"] == np.load("v.npy").min()

    @pytest.mark.parametrize(
        ("array", "words"),
        [
            (np.zeros(6), "reshape(1, -1)"),
            (np.zeros((4, 5)), "cube.x, cube.y"),
            (np.zeros((2, 4, 6)), "(n, 6)"),
            (np.full((4, 6), "a"), "expected floats"),
            (np.zeros((4, 6), complex), "expected floats"),
            (np.array([[0, 0, 0, 0, 0, 0], [0, np.inf, 0, 0, 0, 0]]), "row 1 of q.npy: cube.y is inf"),
        ],
    )
    def test_a_wrong_array_is_bad_input(self, scene, tmp_path, capsys, array, words) -> None:
        np.save("q.npy", array)
        status, out, err = self.run(capsys, "q.npy", "-o", "v.npy")
        assert (status, out) == (3, "")
        assert words in err
        assert "hint:" in err
        assert left(tmp_path) == set()

    @pytest.mark.parametrize("content", [b"", b"1 2 3\n", b"\x93NUMPY", None])
    def test_what_is_no_array_is_bad_input(self, scene, capsys, content) -> None:
        if content is not None:
            Path("q.npy").write_bytes(content)
        status, _, err = self.run(capsys, "q.npy", "-o", "v.npy")
        assert status == 3
        assert "q.npy" in err
        assert ("numpy.save" if content is not None else "there is no file q.npy") in err

    def test_a_file_that_is_cut_off_is_bad_input(self, scene, capsys) -> None:
        saved(scene, 1000)
        Path("q.npy").write_bytes(Path("q.npy").read_bytes()[:-8])
        status, _, err = self.run(capsys, "q.npy", "-o", "v.npy")
        assert status == 3
        assert "cut off" in err

    def test_objects_are_not_unpickled(self, scene, capsys) -> None:
        np.save("q.npy", np.array([[print]]), allow_pickle=True)
        assert self.run(capsys, "q.npy", "-o", "v.npy")[0] == 3

    @pytest.mark.parametrize("output", ["q.npy", "no/folder/v.npy", "."])
    def test_an_output_that_cannot_be_is_refused(self, scene, capsys, output) -> None:
        q = saved(scene, 10)
        status, _, err = self.run(capsys, "q.npy", "-o", output)
        assert status == 3
        assert "CFG509" in err
        np.testing.assert_array_equal(np.load("q.npy"), q)

    def test_wrong_words_are_wrong_usage(self, scene, capsys) -> None:
        saved(scene, 10)
        assert self.run(capsys, "q.npy")[0] == 2
        assert self.run(capsys, "q.npy", "-o", "v.npy", "--threads", "0")[0] == 2
        assert self.run(capsys, "q.npy", "-o", "v.npy", "--what", "else")[0] == 2

    def test_without_dask_says_what_to_install(self, scene, capsys, monkeypatch) -> None:
        saved(scene, 10)
        monkeypatch.setitem(sys.modules, "distributed", None)
        status, _, err = self.run(capsys, "q.npy", "-o", "v.npy", "--dask", "tcp://127.0.0.1:1")
        assert status == 2
        assert "pip install 'env2mjcf[dask]'" in err
