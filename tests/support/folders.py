"""What a folder of converted scenes holds, looked at without the code that wrote it; and ways to end a conversion."""

from __future__ import annotations

import errno
import hashlib
import multiprocessing
import os
import re
import signal
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import mujoco
from lxml import etree
from scenes import box_mesh, free_cube, write_scene

import env2mjcf
from env2mjcf.cli.main import main

ROOT = Path(__file__).parents[2]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}
FOREIGN = {"notes.txt": b"mine", "assets/mine.stl": b"\0\1", "assets/cube-0123456789ab.stl": b"mine, too"}
_STAGED = re.compile(r"(assets/)?\.[^/]*[0-9a-f]{16}[^/]*")

Content = dict[str, bytes]


def two_scenes(folder: Path) -> tuple[Path, Path]:
    """Write two env files of the same name; they share one mesh, and each has one that the other has not."""
    bar, plate = box_mesh(0.1, 0.2, 2.0), box_mesh(1.0, 1.0, 0.05)
    first = write_scene(folder / "first", free_cube("4 0 0 0 0 0", "bar.g -3 0 0 0 0 0"), bar=bar)
    second = write_scene(folder / "second", free_cube("plate.g 0 3 0 0 0 0", "0 0 5 0 0 0"), plate=plate)
    return first, second


def add_foreign(folder: Path) -> None:
    """Put files into an output folder that are not of a conversion."""
    for name, content in FOREIGN.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)


def foreign_untouched(folder: Path) -> bool:
    return all((folder / name).read_bytes() == content for name, content in FOREIGN.items())


def files(folder: Path) -> set[str]:
    return {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()}


def staged(folder: Path) -> set[str]:
    """Return the files that are not meant to stay."""
    return {name for name in files(folder) if _STAGED.fullmatch(name)}


def age(folder: Path, seconds: float = 7200.0) -> None:
    """Make every file look older."""
    for path in folder.rglob("*"):
        os.utime(path, (time.time() - seconds,) * 2)


def content(xml: Path) -> Content:
    """Return an MJCF file and all that it names, after a look at whether each is what its name says.

    Raises:
        AssertionError: An asset is not whole.
        FileNotFoundError: One is not there.
    """
    found = {xml.name: xml.read_bytes()}
    root = etree.fromstring(found[xml.name])
    names = [e.get("file").removeprefix("assets/") for e in root.iter() if isinstance(e.tag, str) and e.get("file")]
    assert names
    for name in names:
        data = (xml.parent / "assets" / name).read_bytes()
        digest = name.rpartition("-")[2].partition(".")[0]
        assert hashlib.sha256(data).hexdigest().startswith(digest), f"{name} is not whole"
        found[name] = data
    return found


def loads(xml: Path) -> int:
    """Load an MJCF file with plain MuJoCo, and return its number of geoms."""
    return mujoco.MjModel.from_xml_path(str(xml)).ngeom


def in_child(work: Callable[[], object]) -> int:
    """Do something in a forked process; return how it ended, as `waitstatus_to_exitcode` does."""
    child = os.fork()
    if child == 0:
        status = 1
        try:
            work()
            status = 0
        finally:
            os._exit(status)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def kill_at(number: int, folder: Path) -> Callable[[], int]:
    """Kill this process just before its n-th call that looks at, makes, renames or removes something in a folder.

    Returns:
        A function that tells how many such calls there were.
    """
    return _at_call(number, folder, lambda: os.kill(os.getpid(), signal.SIGKILL))


def fail_at(number: int, folder: Path) -> Callable[[], int]:
    """Let that call fail, as on a full disk."""

    def fail() -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    return _at_call(number, folder, fail)


def _at_call(number: int, folder: Path, act: Callable[[], None]) -> Callable[[], int]:
    count = 0

    def hook(event: str, arguments: tuple[object, ...]) -> None:
        nonlocal count
        if event not in ("open", "os.rename", "os.remove", "os.mkdir", "os.scandir", "os.listdir"):
            return
        for path in arguments[:2]:
            if isinstance(path, str | bytes | os.PathLike) and Path(os.fsdecode(path)).is_relative_to(folder):
                count += 1
                if count == number:
                    act()
                return

    sys.addaudithook(hook)
    return lambda: count


def kill_in(number: int, sources: tuple[str, ...]) -> Callable[[], int]:
    """Kill this process just before or just after the n-th call of a compiled function out of some source files.

    Returns:
        A function that tells how many such moments there were.
    """
    count = 0

    def hook(frame: object, event: str, _: object) -> None:
        nonlocal count
        if event in ("c_call", "c_return") and frame.f_code.co_filename.endswith(sources):  # type: ignore[attr-defined]
            count += 1
            if count == number:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.setprofile(hook)
    return lambda: count


def write_rounds(scenes: list[Path], out: Path, rounds: int) -> list[str]:
    """Convert scenes in turns, and return what went wrong."""
    wrong: list[str] = []
    for i in range(rounds):
        try:
            env2mjcf.convert(scenes[i % len(scenes)], out)
        except Exception as error:
            wrong.append(f"writer: {error!r}")
    return wrong


def read_until(stop: Path, out: Path) -> tuple[int, list[str]]:
    """Read and load what is in a folder until a file appears; return how often, and what went wrong.

    A reader that finds an asset gone has read an MJCF that was replaced meanwhile, and reads again; as long as it is
    in its place, all that it names has to be there.
    """
    wrong: list[str] = []
    count = 0
    while not stop.exists():
        for xml in sorted(out.glob("[!.]*.xml")):
            before = xml.stat()
            try:
                content(xml)
                loads(xml)
            except (AssertionError, OSError, ValueError) as error:
                after = xml.stat()
                if (before.st_ino, before.st_mtime_ns) == (after.st_ino, after.st_mtime_ns):
                    wrong.append(f"reader: {error!r}")
            else:
                count += 1
    return count, wrong


def race(writers: list[tuple[list[Path], Path]], rounds: int, stop: Path) -> tuple[int, list[str]]:
    """Let processes write to a folder at once, and one read; return the number of readings, and what went wrong."""
    context = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(len(writers) + 1, mp_context=context) as pool:
        reader = pool.submit(read_until, stop, writers[0][1].parent if writers[0][1].suffix else writers[0][1])
        busy = [pool.submit(write_rounds, scenes, out, rounds) for scenes, out in writers]
        wrong = [message for b in busy for message in b.result()]
        stop.touch()
        count, seen = reader.result()
    return count, wrong + seen


def verb(words: list[str], before: Callable[[], object] = bool) -> tuple[int, str, str]:
    """Run the program in a forked process; return its exit status, and what it printed to stdout and stderr.

    Args:
        words: Its arguments.
        before: What to do in that process first.
    """
    # Pipes, because files may not grow in some of these processes; what is printed fits into them.
    (out, to_out), (err, to_err) = os.pipe(), os.pipe()
    child = os.fork()
    if child == 0:
        status = 99
        try:
            os.dup2(to_out, 1)
            os.dup2(to_err, 2)
            sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115
            before()
            status = main(words)
            sys.stdout.flush()
            sys.stderr.flush()
        finally:
            os._exit(status)
    os.close(to_out)
    os.close(to_err)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    texts: list[str] = []
    for end in (out, err):
        with open(end, encoding="utf-8") as stream:
            texts.append(stream.read())
    return status, texts[0], texts[1]
