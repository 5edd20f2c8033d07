"""What a batch leaves alone: files of others, a name that another batch has, names that are too long."""

from __future__ import annotations

import itertools
import os
import stat
from collections.abc import Callable
from pathlib import Path

import folders
import numpy as np
import pytest
from batches import CUBES, JOURNAL, PARTIAL, Stop, left, saved, stopped
from scenes import write_scene

import env2mjcf
from env2mjcf.batch import run
from env2mjcf.batch import runner as running_module
from env2mjcf.cli.main import main
from env2mjcf.system import locks as locking

OURS = '{"format": "env2mjcf batch 1", "job": "0", "rows": 100, "done": 0, "digest": "0"}'


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> env2mjcf.Scene:
    """A cube between two others; the current folder is that of its files. Every block of 100 rows is kept."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(running_module, "_FIRST", 100)
    monkeypatch.setattr(running_module, "_GROWTH", 1)
    return env2mjcf.load(write_scene(tmp_path, CUBES), engine="mujoco")


def content(folder: Path) -> dict[str, tuple[int, object]]:
    """Return what a folder holds, without opening what is not a file."""
    found: dict[str, tuple[int, object]] = {}
    for path in folder.rglob("*"):
        mode, said = path.lstat().st_mode, None
        if stat.S_ISREG(mode) and path.stat().st_size < 1e6:
            said = path.read_bytes()
        elif stat.S_ISLNK(mode):
            said = os.readlink(path)
        found[path.relative_to(folder).as_posix()] = (stat.S_IFMT(mode), said)
    return found


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """Run the verb, which must change nothing; return what it says."""
    before = content(Path())
    capsys.readouterr()
    status = main(["batch", "scene.env", *words, "--engine", "mujoco"])
    out, err = capsys.readouterr()
    assert (status, out) == (3, ""), err
    assert content(Path()) == before
    assert err.count("error CFG509") == 1
    assert "hint: " in err
    return err


MADE: dict[str, Callable[[Path], object]] = {
    "notes": lambda path: path.write_text("my notes\n"),
    "an array": lambda path: path.write_bytes(Path("q.npy").read_bytes()),
    "a link": lambda path: path.symlink_to("precious.txt"),
    "a link to an empty file": lambda path: path.symlink_to("empty.txt"),
    "a link to nothing": lambda path: path.symlink_to("missing.txt"),
    "a pipe": os.mkfifo,
    "a folder": Path.mkdir,
}


class TestForeignFiles:
    @pytest.mark.parametrize("what", MADE)
    @pytest.mark.parametrize("name", ["v.npy.partial", "v.npy.journal", "v.npy.journal.new"])
    def test_a_file_that_no_batch_has_left_is_kept(self, scene, capsys, name, what) -> None:
        saved(scene, 300)
        Path("precious.txt").write_text(OURS)
        Path("empty.txt").touch()
        MADE[what](Path(name))
        assert name in refused(capsys, "q.npy", "-o", "v.npy")

    @pytest.mark.parametrize("output", ["scene.env", "cube.g", "notes.txt"])
    def test_an_output_that_is_no_array_is_kept(self, scene, capsys, output) -> None:
        saved(scene, 10)
        Path("notes.txt").write_text("mine")
        assert "not a NumPy file, and is not replaced" in refused(capsys, "q.npy", "-o", output)

    def test_an_array_or_an_empty_file_is_replaced(self, scene) -> None:
        saved(scene, 10)
        Path("v.npy").touch()
        for _ in range(2):
            assert run(scene, "q.npy", "v.npy").rows == 10
            assert len(np.load("v.npy")) == 10

    def test_one_that_comes_while_it_runs_is_kept(self, scene, monkeypatch) -> None:
        saved(scene, 300)
        monkeypatch.setattr(running_module, "_COMMIT_SECONDS", -1.0)
        fresh = Path("v.npy.journal.new")

        def come(done: int, _rows: int) -> None:
            if done == 200:
                fresh.write_text("mine")

        with pytest.raises(env2mjcf.ConversionError, match="File exists"):
            run(scene, "q.npy", "v.npy", advance=come)
        assert fresh.read_text() == "mine"
        fresh.unlink()
        assert run(scene, "q.npy", "v.npy").resumed == 100

    @pytest.mark.parametrize("journal", [None, OURS])
    @pytest.mark.parametrize("ending", [".partial", ".journal.new"])
    def test_the_input_is_not_written_to(self, scene, capsys, ending, journal) -> None:
        saved(scene, 300)
        Path("q.npy").rename("x.npy" + ending)
        if journal:
            Path("x.npy.journal").write_text(journal)
        assert "is an input" in refused(capsys, "x.npy" + ending, "-o", "x.npy")


NO_JOURNALS = {
    "an older form": b'{"format":1,"job":"x","rows":Infinity,"done":0,"digest":""}',
    "deep": b"[" * 100_000,
    "no text": bytes(range(256)),
    "a list": b"[1, 2]",
}
DAMAGED = {
    "empty": "",
    "cut off in its beginning": OURS[:9],
    "cut off": OURS[:-9],
    "infinite": OURS.replace("100", "Infinity"),
    "negative": OURS.replace("100", "-1"),
    "many digits": OURS.replace("100", "1" * 600),
    "deep": OURS[:-1] + ', "more": ' + "[" * 100_000,
    "done more than there is": OURS.replace('"done": 0', '"done": 101'),
}


class TestJournals:
    @pytest.mark.parametrize("text", NO_JOURNALS.values(), ids=NO_JOURNALS)
    def test_what_is_no_journal_of_ours_is_kept(self, scene, capsys, text) -> None:
        saved(scene, 300)
        JOURNAL.write_bytes(text)
        PARTIAL.write_bytes(b"mine")
        assert "v.npy.journal was not left by" in refused(capsys, "q.npy", "-o", "v.npy")

    @pytest.mark.parametrize("text", DAMAGED.values(), ids=DAMAGED)
    @pytest.mark.parametrize("name", ["v.npy.journal", "v.npy.journal.new"])
    def test_after_one_that_is_damaged_the_work_begins_anew(self, scene, tmp_path, name, text) -> None:
        q = saved(scene, 300)
        stopped(scene, 100)
        Path(name).write_text(text)
        assert run(scene, "q.npy", "v.npy").resumed == (0 if name == JOURNAL.name else 100)
        np.testing.assert_array_equal(np.load("v.npy"), scene.in_collision(q))
        assert left(tmp_path) == {"v.npy"}

    @pytest.mark.parametrize("beginning", [OURS, ""])
    def test_a_huge_one_is_not_read_whole(self, scene, capsys, beginning) -> None:
        saved(scene, 300)
        JOURNAL.write_text(beginning)
        os.truncate(JOURNAL, 1 << 40)
        if beginning:
            assert run(scene, "q.npy", "v.npy").resumed == 0
        else:
            refused(capsys, "q.npy", "-o", "v.npy")


class TestReplacedWhileItRuns:
    @pytest.mark.parametrize("at", [200, 1000])
    @pytest.mark.parametrize("kept", [-1.0, 60.0])
    def test_the_file_of_another_batch_is_left_to_it(self, scene, tmp_path, monkeypatch, at, kept) -> None:
        """Whether it is noticed when answers are kept, or at the end."""
        q = saved(scene, 1000)
        monkeypatch.setattr(running_module, "_COMMIT_SECONDS", kept)

        def replace(done: int, _rows: int) -> None:
            if done == at:
                PARTIAL.unlink()
                stopped(scene, 400)

        with pytest.raises(env2mjcf.ConversionError, match=r"partial was removed or replaced") as caught:
            run(scene, "q.npy", "v.npy", advance=replace)
        assert caught.value.code == "CFG509"
        assert left(tmp_path) == {"v.npy.partial", "v.npy.journal"}
        assert run(scene, "q.npy", "v.npy").resumed == 400
        np.testing.assert_array_equal(np.load("v.npy"), scene.in_collision(q))

    def test_one_that_has_done_nothing_does_not_discard_it(self, scene, tmp_path) -> None:
        saved(scene, 1000)

        def replace(_done: int, _rows: int) -> None:
            PARTIAL.unlink()
            stopped(scene, 400)
            raise Stop

        with pytest.raises(Stop):
            run(scene, "q.npy", "v.npy", advance=replace)
        assert left(tmp_path) == {"v.npy.partial", "v.npy.journal"}
        assert run(scene, "q.npy", "v.npy").resumed == 400

    def test_nobody_begins_between_the_look_at_the_file_and_its_renaming(self, scene, tmp_path, monkeypatch) -> None:
        saved(scene, 300)
        monkeypatch.setattr(locking, "PATIENCE", 0.05)
        replace, said = Path.replace, []

        def late(path: Path, target: Path) -> Path:
            if path.name == PARTIAL.name:
                path.unlink()
                with pytest.raises(env2mjcf.ConversionError) as caught:
                    run(scene, "q.npy", "v.npy")
                said.append(str(caught.value))
            return replace(path, target)

        monkeypatch.setattr(Path, "replace", late)
        with pytest.raises(env2mjcf.ConversionError, match="cannot be written: No such file"):
            run(scene, "q.npy", "v.npy")
        assert "locked" in said[0]
        assert "v.npy" not in left(tmp_path)

    def test_a_child_that_lives_on_does_not_keep_it_locked(self, scene) -> None:
        saved(scene, 300)
        child = 0

        def fork(done: int, _rows: int) -> None:
            nonlocal child
            if done == 100:
                child = os.fork()
                if child == 0:
                    os.read(end[0], 1)
                    os._exit(0)
                raise Stop

        end = os.pipe()
        try:
            with pytest.raises(Stop):
                run(scene, "q.npy", "v.npy", advance=fork)
            assert run(scene, "q.npy", "v.npy").resumed == 100
        finally:
            os.write(end[1], b"x")
            os.waitpid(child, 0)
            os.close(end[0])
            os.close(end[1])


@pytest.mark.parametrize("length", [256, 255, 247, 244])
def test_a_name_that_is_too_long_is_said_before_anything_is_there(scene, capsys, length) -> None:
    saved(scene, 10)
    assert "too long" in refused(capsys, "q.npy", "-o", "v" * (length - 4) + ".npy")


def test_the_longest_name_will_do(scene) -> None:
    saved(scene, 10)
    name = "v" * 239 + ".npy"
    assert run(scene, "q.npy", name).rows == 10
    assert len(np.load(name)) == 10


@pytest.mark.slow_but("250")
@pytest.mark.parametrize("end", [folders.kill_at, folders.fail_at])
@pytest.mark.parametrize("row", [None, 0, 250])
def test_at_whatever_moment_it_ends_the_next_run_is_right(scene, tmp_path, monkeypatch, end, row) -> None:
    """It is killed, or the disk is full, at each call that looks at or changes a file; a row may be bad as well."""
    monkeypatch.setattr(running_module, "_COMMIT_SECONDS", -1.0)
    out = tmp_path / "out"
    out.mkdir()
    q = saved(scene, 300)
    expected, broken = scene.in_collision(q), q.copy()
    if row is not None:
        broken[row, 0] = np.nan
    np.save("broken.npy", broken)
    resumed: set[int] = set()
    for number in itertools.count(1):
        untouched = tmp_path / f"untouched{number}"

        def work(number: int = number, untouched: Path = untouched) -> None:
            count = end(number, out)
            try:
                run(scene, tmp_path / "broken.npy", out / "v.npy", threads=1)
            finally:
                if count() < number:
                    untouched.touch()

        status = folders.in_child(work)
        assert left(out) <= {"v.npy", "v.npy.partial", "v.npy.journal", "v.npy.journal.new"}
        resumed.add(run(scene, "q.npy", out / "v.npy").resumed)
        np.testing.assert_array_equal(np.load(out / "v.npy"), expected)
        assert left(out) == {"v.npy"}
        (out / "v.npy").unlink()
        if untouched.exists():
            break
    assert number > 10
    assert resumed == {None: {0, 100, 200, 300}, 0: {0}, 250: {0, 100, 200}}[row]
    assert status == (0 if row is None else 1)
