"""Conversions that are killed, that fail, and that race: what is in the folder stays whole."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import folders
import pytest
from folders import Content
from killing import kill_randomly

import env2mjcf

pytestmark = pytest.mark.skipif(os.name != "posix", reason="POSIX signals, limits and locks")


@pytest.fixture
def scenes(tmp_path: Path) -> tuple[Path, Path]:
    """Two scenes of the same name."""
    return folders.two_scenes(tmp_path)


@pytest.fixture
def references(scenes: tuple[Path, Path], tmp_path: Path) -> list[Content]:
    """What each of them is converted to, with all that it names."""
    return [folders.content(env2mjcf.convert(s, tmp_path / f"reference{i}").xml) for i, s in enumerate(scenes)]


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """An output folder that holds files of somebody else."""
    folder = tmp_path.resolve() / "out"
    folders.add_foreign(folder)
    return folder


def counted(work: Callable[[], object], counter: Callable[[], Callable[[], int]], where: Path) -> int:
    """Return how many moments to be killed at a piece of work has."""

    def count() -> None:
        result = counter()
        work()
        sys.setprofile(None)
        where.write_text(str(result()))

    assert folders.in_child(count) == 0
    return int(where.read_text())


class TestKilled:
    """SIGKILL leaves no chance to tidy up."""

    @pytest.mark.slow_but("before")
    @pytest.mark.parametrize("at", ["before each call that changes the folder", "around each call of the code"])
    def test_a_conversion_killed_at_any_moment_leaves_the_old_scene_or_the_new_one(
        self, at: str, scenes: tuple[Path, Path], references: list[Content], out: Path, tmp_path: Path
    ) -> None:
        def killer(number: int) -> Callable[[], int]:
            if at.startswith("before"):
                return folders.kill_at(number, out)
            return folders.kill_in(number, ("mjcf/folder.py", "system/files.py", "system/locks.py"))

        env2mjcf.convert(scenes[0], out)
        clean = folders.files(out)
        moments = counted(lambda: env2mjcf.convert(scenes[1], out), lambda: killer(0), tmp_path / "count")
        assert moments > 12
        env2mjcf.convert(scenes[0], out)
        seen: list[int] = []
        for number in range(1, moments + 1):

            def work(number: int = number) -> None:
                killer(number)
                env2mjcf.convert(scenes[1], out)

            assert folders.in_child(work) == -9
            found = folders.content(out / "scene.xml")
            assert found in references
            seen.append(references.index(found))
            assert folders.loads(out / "scene.xml") == folders.loads(tmp_path / f"reference{seen[-1]}/scene.xml")
            # Once it is an hour old, the next conversion removes whatever is left, and nothing else.
            folders.age(out)
            env2mjcf.convert(scenes[0], out)
            assert folders.files(out) == clean
            assert folders.foreign_untouched(out)
        # One rename is the commit: before it all is old, after it all is new.
        assert seen == sorted(seen)
        assert set(seen) == {0, 1}

    def test_what_a_live_process_has_staged_is_never_stale(
        self, scenes: tuple[Path, Path], references: list[Content], out: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        load_file = env2mjcf.conversion.load_file

        def long(path: Path, *rest: object) -> object:
            """Take so long that another process would clean up."""
            folders.age(out)
            monkeypatch.undo()
            assert folders.in_child(lambda: env2mjcf.convert(scenes[1], out / "other.xml")) == 0
            assert path.exists()
            return load_file(path, *rest)

        monkeypatch.setattr(env2mjcf.conversion, "load_file", long)
        env2mjcf.convert(scenes[0], out)
        assert folders.content(out / "scene.xml") == references[0]
        assert not folders.staged(out)

    def test_what_is_left_is_left_for_an_hour(self, scenes: tuple[Path, Path], out: Path) -> None:
        assert folders.in_child(lambda: folders.kill_at(12, out) and env2mjcf.convert(scenes[0], out)) == -9
        left = folders.staged(out)
        assert left
        env2mjcf.convert(scenes[1], out)
        assert folders.staged(out) == left
        folders.age(out)
        env2mjcf.convert(scenes[1], out)
        assert not folders.staged(out)

    def test_a_file_of_somebody_else_is_not_taken_for_what_a_process_has_left(
        self, scenes: tuple[Path, Path], out: Path
    ) -> None:
        mine = [".hidden.xml", ".scene-0123.xml", "assets/.0123456789abcdef-cube.stl", "assets/.cube-0123456789ab.stl"]
        for name in mine:
            (out / name).write_text("mine")
        folders.age(out)
        env2mjcf.convert(scenes[0], out)
        assert {n for n in mine if (out / n).read_text() == "mine"} == set(mine)

    @pytest.mark.slow
    def test_the_whole_program_killed_at_random_moments(
        self, scenes: tuple[Path, Path], references: list[Content], out: Path
    ) -> None:
        env2mjcf.convert(scenes[0], out)
        tally = kill_randomly(scenes, references, out, kills=4, seed=0)
        assert tally.killed == tally.old + tally.new - tally.finished == 4
        assert tally.wrong == []


class TestFailing:
    @pytest.mark.slow
    def test_whatever_fails_the_old_scene_stays_or_the_new_one_is_there(
        self, scenes: tuple[Path, Path], references: list[Content], out: Path, tmp_path: Path
    ) -> None:
        env2mjcf.convert(scenes[0], out)
        clean = folders.files(out)
        moments = counted(lambda: env2mjcf.convert(scenes[1], out), lambda: folders.fail_at(0, out), tmp_path / "count")
        assert moments > 12
        env2mjcf.convert(scenes[0], out)
        refused = 0
        for number in range(1, moments + 1):

            def work(number: int = number) -> None:
                folders.fail_at(number, out)
                try:
                    env2mjcf.convert(scenes[1], out)
                except env2mjcf.ConversionError as error:
                    os._exit(3 if "No space left on device" in error.diagnostic.message else 4)

            failed = folders.in_child(work)
            found = folders.content(out / "scene.xml")
            if failed:
                assert failed == 3
                assert (found, folders.files(out)) == (references[0], clean)
                refused += 1
            else:
                # What could not be tidied up goes once it is an hour old.
                assert found == references[1]
                folders.age(out)
                env2mjcf.convert(scenes[0], out)
                assert folders.files(out) == clean
            assert folders.foreign_untouched(out)
        assert 3 < refused < moments


class TestRaces:
    @pytest.mark.slow
    def test_another_process_may_convert_at_any_moment(
        self, scenes: tuple[Path, Path], references: list[Content], out: Path, tmp_path: Path
    ) -> None:
        """Between any two steps of one conversion another one runs, or waits until it may."""

        def beside(number: int) -> Callable[[], int]:
            own, count, others = threading.get_ident(), 0, []

            def hook(event: str, arguments: tuple[object, ...]) -> None:
                nonlocal count
                if threading.get_ident() != own or event not in ("open", "os.rename", "os.remove", "os.scandir"):
                    return
                if isinstance(arguments[0], str | os.PathLike) and Path(arguments[0]).is_relative_to(out):
                    count += 1
                    if count == number:
                        others.append(threading.Thread(target=env2mjcf.convert, args=(scenes[1], out)))
                        others[0].start()
                        others[0].join(0.25)

            sys.addaudithook(hook)

            def finished() -> int:
                for thread in others:
                    thread.join()
                return count

            return finished

        def work() -> object:
            return env2mjcf.convert(scenes[0], out)

        work()
        moments = counted(work, lambda: beside(0), tmp_path / "count")
        assert moments >= 4
        for number in range(1, moments + 1):
            work()
            assert counted(work, lambda number=number: beside(number), tmp_path / "count") >= moments
            found = folders.content(out / "scene.xml")
            assert found in references
            assert folders.loads(out / "scene.xml") > 0
            assert folders.files(out) == {
                *folders.FOREIGN, "scene.xml", *(f"assets/{n}" for n in found if n != "scene.xml")
            }  # fmt: skip
            assert folders.foreign_untouched(out)

    @pytest.mark.slow_but("share")
    @pytest.mark.parametrize("what", ["one scene", "two scenes of one name", "two names that share assets"])
    def test_processes_that_write_at_once_never_break_what_is_there(
        self, what: str, scenes: tuple[Path, Path], out: Path, tmp_path: Path
    ) -> None:
        first, second = scenes
        writers = {
            "one scene": [([first], out)] * 4,
            "two scenes of one name": [([first, second], out), ([second, first], out)] * 2,
            "two names that share assets": [
                ([first, second], out / "a.xml"), ([second, first], out / "b.xml"), ([second], out / "a.xml"),
            ],
        }[what]  # fmt: skip
        readings, wrong = folders.race(writers, 12, tmp_path / "stop")
        assert wrong == []
        assert readings > 3
        named = {n for xml in out.glob("*.xml") for n in folders.content(xml)}
        assert {Path(n).name for n in folders.files(out)} == named | {Path(n).name for n in folders.FOREIGN}

    def test_a_folder_that_stays_locked_is_an_error_and_not_a_hang(
        self, scenes: tuple[Path, Path], out: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        import fcntl

        handle = os.open(out, os.O_RDONLY)
        fcntl.flock(handle, fcntl.LOCK_EX)
        monkeypatch.setattr(env2mjcf.system.locks, "PATIENCE", 0.2)
        with pytest.raises(env2mjcf.ConversionError, match="locked") as caught:
            env2mjcf.convert(scenes[0], out)
        os.close(handle)
        assert caught.value.code == "MJC424"
        assert folders.files(out) == set(folders.FOREIGN)
        env2mjcf.convert(scenes[0], out)

    def test_an_asset_that_was_altered_is_written_again(
        self, scenes: tuple[Path, Path], references: list[Content], out: Path
    ) -> None:
        result = env2mjcf.convert(scenes[0], out)
        data = bytearray(result.assets[0].read_bytes())
        data[100] ^= 1
        result.assets[0].write_bytes(data)
        env2mjcf.convert(scenes[0], out)
        assert folders.content(out / "scene.xml") == references[0]
