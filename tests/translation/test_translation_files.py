"""What a translation names, what it replaces, and what it leaves when it cannot be written."""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Callable
from pathlib import Path

import folders
import pytest
from hypothesis import given, settings
from scenes import box_mesh, without_privileges, write_scene
from strategies import rich_environments
from texts import PROBLEM, ROBOT, E, write

import env2mjcf
from env2mjcf.cli.main import main
from env2mjcf.model.environment import Environment
from env2mjcf.system import files as writing
from env2mjcf.translation import Written, write_environment

CAR = "1\nPassive\n{} 0 2 0 0 0 90\n"
OLDER_ROBOT = "1\nold.g Planar Rotational\nConnections\n0\n"
OLDER = {"new.env": CAR.format("old.g"), "new.robot": OLDER_ROBOT, "new.query": "1 2 3\n4 5 6\n"}


def run(*words: object) -> int:
    return main(["translate", *map(str, words)])


def content(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def names(scene: Environment) -> list[str]:
    return [b.filename for m in scene.multibodies for b in m.bodies]


def codes(written: Written) -> list[str]:
    return [d.code for d in written.notes]


# Meshes.


@pytest.mark.parametrize(
    ("name", "code"), [("Meshes\\CAR.G", "GEO205"), ("meshes\\car.g", "GEO206"), ("MESHES/car.g", "GEO205")]
)
def test_meshes_that_are_called_otherwise_are_named_as_they_are_found(
    name: str, code: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a" / "meshes").mkdir(parents=True)
    (tmp_path / "b").mkdir()
    write(tmp_path / "a" / "meshes", box_mesh(1, 1, 1), "car.g")
    scene = write(tmp_path / "a", CAR.format(name), "scene.env")
    assert run(scene, "-o", tmp_path / "b" / "new.env", "--dialect", "D") == 0
    out, err = capsys.readouterr()
    assert f"warning {code}: " in err
    folder = out.strip().rpartition("--mesh-dirs ")[2]
    assert Path(folder).samefile(tmp_path / "a" / "meshes")
    new = env2mjcf.load(tmp_path / "b" / "new.env", mesh_dirs=folder, engine="mujoco", strict=True)
    assert names(new.environment) == ["../a/meshes/car.g"]


def test_meshes_that_are_missing_keep_their_names_with_a_warning(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    write(tmp_path / "a", "", "car.g")
    scene = env2mjcf.read(write(tmp_path / "a", CAR.format("sub/care.g"), "scene.env"))
    written = write_environment(scene, tmp_path / "b" / "new.env")
    assert names(env2mjcf.read(written.environment)) == ["sub/care.g"]
    assert codes(written) == ["GEO201"]
    assert written.notes[0].message.endswith("care.g'; its name stays")
    assert str(written.notes[0].span).endswith("scene.env:3:1")
    assert written.mesh_dirs == ()


@pytest.mark.parametrize("out", ["a", "b"])
def test_a_reader_is_told_which_folders_it_needs(out: str, tmp_path: Path) -> None:
    for folder in ("a", "b", "more"):
        (tmp_path / folder).mkdir()
    write(tmp_path / "more", box_mesh(1, 1, 1), "car.g")
    scene = env2mjcf.read(write(tmp_path / "a", CAR.format("car.g"), "scene.env"))
    written = write_environment(scene, tmp_path / out / "new.env", mesh_dirs=[tmp_path / "more"])
    assert [d.samefile(tmp_path / "more") for d in written.mesh_dirs] == [True]
    assert codes(written) == ["ENV171"]
    env2mjcf.load(written.environment, mesh_dirs=written.mesh_dirs, engine="mujoco")


def test_no_folder_is_needed_for_one_within_the_new_one(tmp_path: Path) -> None:
    (tmp_path / "more").mkdir()
    write(tmp_path / "more", box_mesh(1, 1, 1), "car.g")
    scene = env2mjcf.read(write(tmp_path, CAR.format("car.g"), "scene.env"))
    written = write_environment(scene, tmp_path / "new.env", mesh_dirs=[tmp_path / "more"])
    assert (written.mesh_dirs, written.notes) == ((), ())
    assert names(env2mjcf.load(written.environment, engine="mujoco").environment) == ["more/car.g"]


@pytest.mark.parametrize("name", ["./car.g", "sub/../car.g", "link.g", "{}/car.g"])
def test_names_that_lead_to_their_meshes_stay(name: str, tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    write(tmp_path, box_mesh(1, 1, 1), "car.g")
    (tmp_path / "link.g").symlink_to("car.g")
    scene = env2mjcf.read(write(tmp_path, CAR.format(name.format(tmp_path)), "scene.env"))
    written = write_environment(scene, tmp_path / "new.env")
    assert env2mjcf.read(written.environment).multibodies == scene.multibodies
    assert (written.mesh_dirs, written.notes) == ((), ())


def test_meshes_that_the_scene_may_not_read_are_named_all_the_same(tmp_path: Path) -> None:
    for folder in ("a", "deep/b", "secret"):
        (tmp_path / folder).mkdir(parents=True)
    write(tmp_path / "secret", box_mesh(1, 1, 1), "car.g")
    scene = env2mjcf.read(write(tmp_path / "a", CAR.format("../secret/car.g"), "scene.env"))
    written = write_environment(scene, tmp_path / "deep" / "b" / "new.env")
    assert names(env2mjcf.read(written.environment)) == ["../../secret/car.g"]
    assert codes(written) == ["ENV171"]
    with pytest.raises(env2mjcf.GeometryError, match="GEO202"):
        env2mjcf.load(written.environment, engine="mujoco")


@pytest.mark.parametrize(("allowed", "holder"), [(False, "more"), (True, "secret")])
def test_the_mesh_is_the_one_that_the_scene_is_read_with(allowed: bool, holder: str, tmp_path: Path) -> None:
    for folder in ("a", "b", "more", "secret"):
        (tmp_path / folder).mkdir()
    for folder in ("more", "secret"):
        write(tmp_path / folder, box_mesh(1, 1, 1), "car.g")
    (tmp_path / "a" / "car.g").symlink_to(tmp_path / "secret" / "car.g")
    scene = env2mjcf.read(write(tmp_path / "a", CAR.format("car.g"), "scene.env"))
    written = write_environment(scene, tmp_path / "b" / "new.env", mesh_dirs=[tmp_path / "more"], allow_outside=allowed)
    assert names(env2mjcf.read(written.environment)) == [f"../{holder}/car.g"]


# What is replaced.


@pytest.fixture
def problem(tmp_path: Path) -> Path:
    """A problem file with the environment, the robot and the task that it names."""
    write_scene(tmp_path, E.replace("wall.g", "cube.g").replace("pillar.g", "cube.g"), "maze.env")
    write(tmp_path, ROBOT, "other.robot")
    text = PROBLEM.replace("scene.env", "maze.env").replace("rob.robot", "other.robot")
    return write(tmp_path, text, "maze.xml")


@pytest.mark.parametrize(("out", "input_"), [("maze.env", "maze.env"), ("other.env", "other.robot")])
def test_files_that_a_problem_names_are_inputs(
    out: str, input_: str, problem: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = content(problem.parent)
    assert run(problem, "-o", problem.with_name(out), "--dialect", "E") == 3
    assert f"{input_} is an input; expected a file to write" in capsys.readouterr().err
    assert content(problem.parent) == before


def test_files_that_an_environment_was_read_from_are_its_sources(problem: Path, tmp_path: Path) -> None:
    found = [Path(s).name for s in env2mjcf.read(problem).sources]
    assert found == ["maze.xml", "maze.env", "other.robot"]
    query = write(tmp_path, "1 2 0.1 0.2 0.3\n1 2 0.1 0.2 0.4\n", "b.query")
    scene = env2mjcf.read(tmp_path / "maze.env", robots=[tmp_path / "other.robot"], query=query)
    assert [Path(s).name for s in scene.sources] == ["maze.env", "other.robot", "b.query"]
    before = content(tmp_path)
    for out, input_ in (("b.env", "b.query"), ("other.env", "other.robot"), ("maze.env", "maze.env")):
        with pytest.raises(env2mjcf.ConversionError, match=f"ENV179.*{input_} is an input"):
            write_environment(env2mjcf.translate(scene, "E").environment, tmp_path / out)
    assert content(tmp_path) == before


@pytest.fixture
def scene(problem: Path) -> Environment:
    """A scene of dialect E with a robot and a query."""
    return env2mjcf.translate(env2mjcf.read(problem), "E").environment


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """An empty folder."""
    folder = tmp_path.resolve() / "out"
    folder.mkdir()
    return folder


def older(folder: Path) -> dict[str, bytes]:
    """Put an older translation into a folder."""
    for name, text in OLDER.items():
        (folder / name).write_text(text)
    return content(folder)


def test_an_older_translation_is_replaced(scene: Environment, out: Path) -> None:
    before = older(out)
    write_environment(scene, out / "new.env")
    after = content(out)
    assert after.keys() == before.keys()
    assert all(after[name] != before[name] for name in after)


@pytest.mark.parametrize("name", OLDER)
@pytest.mark.parametrize(
    "text", ["my notes\n", "# my notes\n", "\0\1\2", "VIZMO_PATH_FILE Path Version 2012\n", "2 0.5 0.25\n1 a b\n"]
)
def test_what_is_no_such_file_is_kept(name: str, text: str, scene: Environment, out: Path) -> None:
    older(out)
    (out / name).write_text(text)
    before = content(out)
    with pytest.raises(env2mjcf.ConversionError) as caught:
        write_environment(scene, out / "new.env")
    assert caught.value.code == "ENV190"
    assert re.search(
        rf"{re.escape(name)} is not (an env file|a robot file|a query), and is not replaced", str(caught.value)
    )
    assert caught.value.diagnostic.hint
    assert content(out) == before


@pytest.mark.parametrize("name", ["new.robot", "new.query"])
def test_robots_and_queries_without_an_env_file_belong_to_something_else(
    name: str, scene: Environment, out: Path
) -> None:
    (out / name).write_text(OLDER[name])
    before = content(out)
    with pytest.raises(env2mjcf.ConversionError, match=rf"{name} is there without .*new\.env, and is not replaced"):
        write_environment(scene, out / "new.env")
    assert content(out) == before


@pytest.mark.parametrize("name", OLDER)
def test_an_empty_file_is_replaced(name: str, scene: Environment, out: Path) -> None:
    (out / name).write_text("\n")
    write_environment(scene, out / "new.env")
    assert (out / name).read_text().strip()


@pytest.mark.parametrize("name", ["new.robot", "new.query"])
def test_an_env_file_is_not_called_as_its_robot_or_query_is(name: str, scene: Environment, out: Path) -> None:
    with pytest.raises(env2mjcf.ConversionError, match="ENV179"):
        write_environment(scene, out / name)
    assert not content(out)


@settings(max_examples=60, deadline=None)
@given(first=rich_environments(), second=rich_environments())
def test_every_translation_may_be_replaced_by_another(
    tmp_path_factory: pytest.TempPathFactory, first: Environment, second: Environment
) -> None:
    folder = tmp_path_factory.mktemp("scene")
    write_environment(first, folder / "scene.env")
    written = write_environment(second, folder / "scene.env")
    assert len(env2mjcf.read(written.environment, robots=written.robots).multibodies) == len(second.multibodies)


# Writing that fails.


@pytest.mark.parametrize("begin", [older, content])
def test_wherever_a_file_cannot_be_renamed_all_is_as_it_was(
    begin: Callable[[Path], dict[str, bytes]], scene: Environment, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = begin(out)
    replace = os.replace
    for number in (1, 2, 3):
        calls: list[Path] = []

        def failing(source: Path, target: Path, number: int = number, calls: list[Path] = calls) -> None:
            calls.append(target)
            if len(calls) == number:
                raise PermissionError(1, "Operation not permitted")
            replace(source, target)

        monkeypatch.setattr(writing.os, "replace", failing)
        with pytest.raises(env2mjcf.ConversionError, match=r"ENV179.* cannot be written: Operation not permitted"):
            write_environment(scene, out / "new.env")
        assert content(out) == before
        assert calls[number - 1].name == ["new.robot", "new.query", "new.env"][number - 1], "the env file comes last"
    monkeypatch.undo()
    write_environment(scene, out / "new.env")
    assert content(out).keys() == OLDER.keys()


@pytest.mark.parametrize("begin", [older, content])
def test_an_interrupt_just_after_a_rename_takes_it_back(
    begin: Callable[[Path], dict[str, bytes]], scene: Environment, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = begin(out)
    replace = os.replace

    def interrupted(source: Path, target: Path) -> None:
        replace(source, target)
        if target.name == "new.query":
            monkeypatch.undo()
            raise KeyboardInterrupt

    monkeypatch.setattr(writing.os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_environment(scene, out / "new.env")
    assert content(out) == before


def test_what_was_there_comes_back_as_it_was(
    scene: Environment, out: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    older(out)
    (out / "new.query").chmod(0o640)
    (out / "new.robot").rename(tmp_path / "kept.robot")
    (out / "new.robot").symlink_to("../kept.robot")
    monkeypatch.setattr(writing._Replacement, "rename", _not_the_last(writing._Replacement.rename))
    with pytest.raises(env2mjcf.ConversionError):
        write_environment(scene, out / "new.env")
    assert (out / "new.robot").readlink() == Path("../kept.robot")
    assert (out / "new.query").stat().st_mode & 0o777 == 0o640
    assert content(out).keys() == OLDER.keys()


def _not_the_last(rename: Callable[..., None]) -> Callable[..., None]:
    def failing(replacement: writing._Replacement) -> None:
        if replacement.path.suffix == ".env":
            raise PermissionError(1, "Operation not permitted")
        rename(replacement)

    return failing


@pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root can become somebody else")
def test_a_file_that_somebody_else_owns_stops_all_of_them(scene: Environment, out: Path) -> None:
    (out / "new.env").write_text(OLDER["new.env"])
    out.chmod(0o1777)
    before = content(out)
    found = without_privileges(out, lambda: write_environment(scene, out / "new.env"), somebody_else=True)
    assert found.startswith("ENV179")
    assert "Operation not permitted" in found
    assert content(out) == before


@pytest.mark.skipif(os.name != "posix", reason="POSIX signals")
@pytest.mark.parametrize("begin", [older, content])
def test_a_translation_that_is_killed_leaves_whole_files_the_env_file_last(
    begin: Callable[[Path], dict[str, bytes]], scene: Environment, out: Path
) -> None:
    write_environment(scene, out / "new.env")
    after = content(out)
    seen: list[int] = []
    number = 0
    while True:
        number += 1
        for path in out.iterdir():
            path.unlink()
        before = begin(out)

        def work(number: int = number) -> None:
            folders.kill_at(number, out)
            write_environment(scene, out / "new.env")

        status = folders.in_child(work)
        found = {name: data for name, data in content(out).items() if not name.startswith(".")}
        assert all(data in (before.get(name), after[name]) for name, data in found.items())
        seen.append(sum(found.get(name) == after[name] for name in after))
        if found.get("new.env") == after["new.env"]:
            assert found == after
        write_environment(scene, out / "new.env")
        assert {n: d for n, d in content(out).items() if not n.startswith(".")} == after, "once more puts it right"
        if status == 0:
            break
        assert status == -signal.SIGKILL
    assert seen == sorted(seen)
    assert set(seen) == {0, 1, 2, 3}
