"""Pipes, where files are expected: refused where a file or a folder names them, read where the user does."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import folders
import numpy as np
import pytest
from scenes import free_cube, write_scene

from env2mjcf.system.files import NoRegularFileError, open_regular

pytestmark = pytest.mark.skipif(os.name != "posix", reason="POSIX pipes")
MODELS = folders.ROOT / "models"
# A hang is a failure, and takes no longer than this.
_SECONDS = 120


def run(*words: str | Path, data: bytes | None = None) -> tuple[int, str]:
    """Run the program; return its status, and what it says on both streams."""
    done = subprocess.run(
        [sys.executable, "-m", "env2mjcf", *map(str, words)], env=folders.ENVIRONMENT, input=data,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False, timeout=_SECONDS,
    )  # fmt: skip
    return done.returncode, done.stdout.decode()


def test_only_regular_files_are_opened(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"content")
    (tmp_path / "link").symlink_to("file")
    for name in ("file", "link"):
        with open_regular(tmp_path / name) as file:
            assert file.read() == b"content"
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", "/dev/zero"):
        with pytest.raises(NoRegularFileError):
            open_regular(path)
    with socket.socket(socket.AF_UNIX) as bound:
        bound.bind(os.path.relpath(tmp_path / "socket"))
        with pytest.raises(OSError, match="socket"):
            open_regular(tmp_path / "socket")
    with pytest.raises(IsADirectoryError):
        open_regular(tmp_path)


VIEWS = [
    path for path in ("/proc/kmsg", "/proc/self/mem", "/proc/self/maps", "/sys/kernel/notes") if os.path.exists(path)
]


@pytest.mark.parametrize("path", [*VIEWS, "/dev/zero", "/dev/null", "/dev/random"])
def test_views_of_the_system_and_devices_are_not_opened(
    path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To read /proc/kmsg waits for the kernel, and takes its messages from those who log them."""
    (tmp_path / "link.env").symlink_to(path)
    scene = write_scene(tmp_path, free_cube("4 0 0 0 0 0"))
    monkeypatch.setattr("builtins.open", lambda *_, **__: pytest.fail("it is opened"))
    monkeypatch.setattr(os, "fstat", lambda _: os.stat(scene))  # it is not the standard input
    for name in (path, tmp_path / "link.env"):
        for or_pipe in (False, True):
            with pytest.raises(NoRegularFileError):
                open_regular(name, or_pipe=or_pipe)


@pytest.mark.slow
@pytest.mark.parametrize("path", [*VIEWS[:1], "/dev/zero"])
def test_nobody_waits_for_them(path: str, tmp_path: Path) -> None:
    scene = write_scene(tmp_path, free_cube("4 0 0 0 0 0"))
    (tmp_path / "b.xml").symlink_to(path)
    (tmp_path / "q.npy").symlink_to(path)
    for words in (
        ["info", path],
        ["lint", path],
        ["lint", tmp_path, "--allow-outside"],
        ["check", scene, "--query", path],
        ["info", scene, "--robots", path],
        ["check", scene, tmp_path / "q.npy"],
    ):
        status, said = run(*words)
        assert status in (1, 3), words
        assert "it is not a regular file" in said, words


def test_what_the_scene_names_is_no_view_of_the_system(tmp_path: Path) -> None:
    scene = write_scene(tmp_path, free_cube("4 0 0 0 0 0"))
    (tmp_path / "cube.g").unlink()
    (tmp_path / "cube.g").symlink_to(VIEWS[0] if VIEWS else "/dev/zero")
    status, said = run("info", scene, "--allow-outside")
    assert (status, "GEO20" in said) == (3, True)


@pytest.mark.parametrize("name", ["maze.robot", "maze.env"])
def test_a_pipe_that_a_problem_names_is_refused(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "maze"
    shutil.copytree(MODELS / "maze", folder)
    (folder / name).unlink()
    os.mkfifo(folder / name)
    status, said = run("info", folder / "maze.xml")
    assert status == 3
    assert "ENV104" in said
    assert "not a regular file" in said
    assert f"{name}" in said.splitlines()[1]  # the line of the problem that names it


@pytest.mark.slow_but("b.env")
@pytest.mark.parametrize("name", ["b.env", "b.robot", "b.xml", "b.g"])
def test_lint_waits_for_no_pipe(name: str, tmp_path: Path) -> None:
    write_scene(tmp_path, free_cube("4 0 0 0 0 0"))
    os.mkfifo(tmp_path / name)
    status, said = run("lint", tmp_path / name, tmp_path)
    assert status == 1
    assert ("GEO204" if name == "b.g" else "ENV104") in said
    assert "not a regular file" in said
    assert "2 files" in said


def test_a_file_of_configurations_is_no_pipe(tmp_path: Path) -> None:
    scene = write_scene(tmp_path, free_cube("4 0 0 0 0 0"))
    os.mkfifo(tmp_path / "q.npy")
    status, said = run("check", scene, tmp_path / "q.npy")
    assert (status, "not a regular file" in said) == (3, True)


@pytest.mark.slow
def test_pipes_in_the_folder_that_is_written_to_are_not_waited_for(tmp_path: Path) -> None:
    scene = write_scene(tmp_path, free_cube("4 0 0 0 0 0"))
    out = tmp_path / "out"
    out.mkdir()
    os.mkfifo(out / "other.xml")
    os.mkfifo(out / "v.npy.journal")
    # The second conversion looks at which assets others use.
    other = write_scene(tmp_path / "second", free_cube("3 0 0 0 0 0", "cube.g 0 4 0 0 0 0"))
    for entry in (scene, other):
        assert run("convert", entry, out)[0] == 0
    np.save(tmp_path / "q.npy", np.zeros((2, 6)))
    status, said = run("batch", scene, tmp_path / "q.npy", "-o", out / "v.npy")
    assert status == 3
    assert "CFG509" in said
    assert "v.npy.journal is not a regular file" in said


@pytest.mark.slow
def test_the_user_may_name_a_pipe(tmp_path: Path) -> None:
    scene = write_scene(tmp_path, free_cube("4 0 0 0 0 0"))
    expected = run("check", scene)
    status, said = run("check", "/dev/stdin", "--mesh-dirs", tmp_path, data=scene.read_bytes())
    assert (status, said) == expected
    assert status == 0
    query = b"0 4 0 0 0 0 0\n"
    status, said = run("check", scene, "--query", "/dev/stdin", data=query)
    assert status == 1
    assert "1 in collision" in said


def test_info_reads_once_so_that_a_pipe_will_do(tmp_path: Path) -> None:
    scene = write_scene(tmp_path, free_cube("4 0 0 0 0 0"))
    assert run("info", "/dev/stdin", "--mesh-dirs", tmp_path, data=scene.read_bytes())[0] == 0
