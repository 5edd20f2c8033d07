"""Disks that are full, folders that may not be written: one error for each verb, and what was there stays."""

from __future__ import annotations

import os
import re
import resource
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import folders
import numpy as np
import pytest
from extras import needs
from scenes import box_mesh, free_cube, give_up_privileges, write_scene

import env2mjcf
from env2mjcf.companions import write_path, write_query
from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.geometry.store import GeometryCache
from env2mjcf.system.files import replaced
from env2mjcf.view import offscreen, picture

pytestmark = pytest.mark.skipif(os.name != "posix", reason="POSIX limits, permissions and mounts")
GL = offscreen.backend() is not None
OLD = b"VIZMO_PATH_FILE   Path Version 2012\nwhat was there before\n"
# What may be replaced, by the end of the name.
OLD_FILES = {
    ".xml": b"<mujoco/>",
    ".npy": b"\x93NUMPY what was there before",
    ".env": b"1\nPassive\nbefore.g 0 0 0 0 0 0\n",
}

# Verb and all its words but the output, its name, the code of the error.
VERBS = {
    "convert": (["convert", "scene.env"], "scene.xml", "MJC42"),
    "batch": (["batch", "scene.env", "q.npy", "-o"], "v.npy", "CFG509"),
    "render": (["render", "scene.env", "--size", "160x120", "-o"], "a.png", "CFG552"),
    "play mp4": (["play", "scene.env", "a.path", "--fps", "4", "--size", "160x120", "-o"], "a.mp4", "CFG552"),
    "play gif": (["play", "scene.env", "a.path", "--fps", "4", "--size", "160x120", "-o"], "a.gif", "CFG552"),
    "plan": (["plan", "scene.env", "--query", "a.query", "--planner", "BatchEST", "-o"], "b.path", "CFG5[34]2"),
    "translate": (["translate", "scene.env", "--dialect", "E", "--query", "a.query", "-o"], "b.env", "ENV179"),
    "check": (["check", "scene.env", "a.path", "--picture"], "a.png", "CFG552"),
}
DRAWING = ("render", "play mp4", "play gif", "check")


def marks(verb: str) -> list[pytest.MarkDecorator]:
    """Return what skips a verb for which something is missing."""
    if verb in DRAWING:
        return [needs("view")] if GL else [pytest.mark.skip("no GL")]
    return [needs("planning")] if verb == "plan" else []


def of_verbs(*verbs: str) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("verb", [pytest.param(verb, marks=marks(verb)) for verb in verbs])


some_verbs = of_verbs(*VERBS)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene, a way, a query and configurations."""
    folder = tmp_path_factory.mktemp("inputs")
    scene = env2mjcf.load(write_scene(folder, free_cube("0 4 0 0 0 0")), engine="mujoco")
    way = np.array([[-3.0, -3, 0, 0, 0, 0], [-3, 2, 0, 0, 0, 1], [-2, 2, 1, 0, 0, 1]])
    write_path(scene, way, folder / "a.path")
    (folder / "a.query").write_text("0 -3 -3 0 0 0 0\n0 3 -2 0 0 0 0\n")
    write_scene(folder / "other", free_cube("bar.g 4 0 0 0 0 0"), bar=box_mesh(0.1, 0.2, 2.0))
    np.save(folder / "q.npy", scene.space.sample(20_000, seed=0))
    return folder


@pytest.fixture(scope="module")
def full_disk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A small disk; tests fill it."""
    folder = tmp_path_factory.mktemp("disk")
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "none", str(folder)], capture_output=True, text=True, check=False
    ) if sys.platform == "linux" else None  # fmt: skip
    if mounted is None or mounted.returncode:
        pytest.skip(f"no disk can be mounted: {mounted.stderr.strip() if mounted else sys.platform}")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


def filled(disk: Path, name: str, inputs: Path) -> dict[str, bytes]:
    """Empty a disk, put an old output there, fill it, and return what it holds."""
    for path in sorted(disk.rglob("*"), reverse=True):
        path.rmdir() if path.is_dir() else path.unlink()
    if name.endswith(".xml"):
        # A conversion of something else, whose assets go when it is replaced.
        env2mjcf.convert(inputs / "other" / "scene.env", disk / name)
    else:
        (disk / name).write_bytes(older(name))
    with (disk / "filler").open("wb", buffering=0) as file, suppress(OSError):
        while file.write(bytes(1024)):
            pass
    return content(disk)


def older(name: str) -> bytes:
    """Return what an output of this name may replace."""
    return OLD_FILES.get(Path(name).suffix, OLD)


def content(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def run(verb: str, inputs: Path, out: Path, before=bool) -> tuple[int, str, str, str]:
    """Run a verb; return what `folders.verb` does, and the code that is expected."""
    words, name, code = VERBS[verb]
    named = [str(inputs / w) if (inputs / w).is_file() else w for w in words]
    engine = [] if verb == "translate" else ["--engine", "mujoco"]
    return *folders.verb([*named, str(out / name), *engine], before), code


def judged(found: tuple[int, str, str, str], verb: str, reason: str) -> None:
    """One error says what is wrong; results are there only if they do not depend on the file."""
    status, out, err, code = found
    assert status == 3, err
    errors = [line for line in err.splitlines() if ": " in line and not line.startswith(("    ", "env2mjcf: "))]
    assert len(errors) == 1
    assert re.search(rf"error {code}.*: .*{reason}", errors[0])
    assert "hint: " in err
    assert ("3 configurations: 3 valid" in out) if verb == "check" else out == "", (
        "a report does not wait for a picture"
    )


@pytest.mark.slow_but("convert", "batch", "render", "plan", "translate")
@some_verbs
def test_a_full_disk_is_said_and_what_was_there_stays(verb: str, inputs: Path, full_disk: Path) -> None:
    before = filled(full_disk, VERBS[verb][1], inputs)
    judged(run(verb, inputs, full_disk), verb, "No space left on device")
    assert content(full_disk) == before


@pytest.mark.parametrize("verb", ["convert", "translate", "batch"])
def test_wherever_the_disk_is_full_nothing_is_left(verb: str, inputs: Path, full_disk: Path) -> None:
    """A little more room each time, until all fits."""
    outcomes: list[int] = []
    for pages in range(30):
        before = filled(full_disk, VERBS[verb][1], inputs)
        os.truncate(full_disk / "filler", len(before["filler"]) - 4096 * pages)
        before = content(full_disk)
        outcomes.append(run(verb, inputs, full_disk)[0])
        if outcomes[-1] == 0:
            break
        assert content(full_disk) == before
    assert outcomes == [3] * (len(outcomes) - 1) + [0]
    assert len(outcomes) > 2


@some_verbs
def test_a_file_may_not_grow_beyond_the_limit_of_the_process(verb: str, inputs: Path, tmp_path: Path) -> None:
    (tmp_path / VERBS[verb][1]).write_bytes(older(VERBS[verb][1]))
    before = content(tmp_path)
    found = run(verb, inputs, tmp_path, lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (10, 10)))
    if verb in DRAWING:
        # What is drawn does not even reach the process that draws.
        assert found[0] == 2
        assert re.fullmatch(r"env2mjcf: \w+: cannot draw: .* cannot be written: File too large\n", found[2])
    else:
        judged(found, verb, "File too large")
    assert content(tmp_path) == before


@pytest.mark.skipif(sys.platform != "linux", reason="permissions as Linux has them")
@some_verbs
def test_a_folder_that_may_not_be_written_is_said(verb: str, inputs: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / VERBS[verb][1]).write_bytes(older(VERBS[verb][1]))
    out.chmod(0o555)
    before = content(tmp_path)
    judged(run(verb, inputs, out, give_up_privileges), verb if verb != "check" else "", "may not be written")
    assert content(tmp_path) == before


@of_verbs("convert", "batch", "plan", "translate")
def test_a_place_where_no_file_can_be_is_said(verb: str, inputs: Path) -> None:
    judged(run(verb, inputs, Path("/proc")), verb, "")


@of_verbs("plan", "batch")
def test_what_is_no_file_is_not_replaced_by_one(
    verb: str, inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pipe stands for devices such as /dev/null, which renaming would replace just so."""
    monkeypatch.setitem(VERBS, verb, (VERBS[verb][0], "pipe", VERBS[verb][2]))
    os.mkfifo(tmp_path / "pipe")
    judged(run(verb, inputs, tmp_path), verb, "is not a regular file")
    with pytest.raises(OSError, match="not a regular file"), replaced(tmp_path / "pipe") as beside:
        beside.write_text("")
    assert (tmp_path / "pipe").is_fifo()
    assert [p.name for p in tmp_path.iterdir()] == ["pipe"]


@needs("planning")
def test_a_plan_does_not_replace_what_is_no_path(inputs: Path, tmp_path: Path) -> None:
    for name, text in (("b.path", "my notes\n"), ("b.approach.path", "my other notes\n"), ("b.path", "\0\1\2")):
        (tmp_path / name).write_text(text)
        judged((*run("plan", inputs, tmp_path)[:3], "CFG553"), "plan", "is not a path file, and is not replaced")
        assert (tmp_path / name).read_text() == text
        (tmp_path / name).unlink()
    for text in ("", OLD.decode()):
        (tmp_path / "b.path").write_text(text)
        assert run("plan", inputs, tmp_path)[0] == 0
        assert (tmp_path / "b.path").read_text() != text


@needs("view")
def test_every_writer_says_that_the_disk_is_full(inputs: Path, full_disk: Path) -> None:
    scene = env2mjcf.load(inputs / "scene.env", engine="mujoco")
    writers = {
        "a.path": lambda file: write_path(scene, scene.space.home, file),
        "a.query": lambda file: write_query(scene, env2mjcf.Query(0, scene.space.home[None]), file),
        "a.png": lambda file: picture(scene, size=(64, 48), file=file),
    }
    for name, write in writers.items():
        if name == "a.png" and not GL:
            continue
        before = filled(full_disk, name, inputs)
        with pytest.raises(env2mjcf.ConversionError, match="No space left on device"):
            write(full_disk / name)
        assert content(full_disk) == before


def test_a_cache_on_a_full_disk_stops_nothing(inputs: Path, full_disk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = filled(full_disk, "old", inputs)
    log = DiagnosticLog()
    value = GeometryCache(full_disk).remember(("a",), lambda: (1.0, 2.0), kinds=(), known={}, log=log)
    assert value == (1.0, 2.0)
    assert [d.code for d in log] == ["GEO261"]
    assert "No space left on device" in next(iter(log)).message
    assert content(full_disk) == before
