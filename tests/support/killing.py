"""Kills the program at random moments of a conversion, and looks at what it leaves."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import folders


@dataclass(slots=True)
class Tally:
    """What came of kills.

    Attributes:
        killed: Processes that were killed before they ended.
        finished: Processes that were quicker.
        writing: Processes that were killed after their first change of the folder and before their end.
        old, new: What was found afterwards.
        wrong: What should not have been.
    """

    killed: int = 0
    finished: int = 0
    writing: int = 0
    old: int = 0
    new: int = 0
    wrong: list[str] = field(default_factory=list)


def kill_randomly(
    scenes: tuple[Path, Path], references: list[folders.Content], out: Path, kills: int, seed: int
) -> Tally:
    """Convert the two scenes in turns, and kill every conversion.

    A quarter is killed at any moment; the others within a few milliseconds of their first change of the folder.

    Args:
        scenes: Two env files.
        references: What they are converted to, under the name "scene".
        out: A folder that holds one of them.
        kills: How many processes are killed before they have ended.
        seed: Of the moments.
    """
    chance, tally = random.Random(seed), Tally()
    life, writing = _durations(scenes[0], out)
    while tally.killed < kills:
        before = folders.content(out / "scene.xml")
        wanted = 1 - references.index(before)
        known = set(folders.files(out))
        child = _start(scenes[wanted], out)
        if (tally.killed + tally.finished) % 4 == 0:
            time.sleep(chance.uniform(0, life))
        else:
            while child.poll() is None and folders.files(out) <= known:
                time.sleep(0.0002)
            time.sleep(chance.uniform(0, writing))
        child.send_signal(signal.SIGKILL)
        ended = child.wait()
        if ended == -signal.SIGKILL:
            tally.killed += 1
            tally.writing += folders.files(out) != known or folders.content(out / "scene.xml") != before
        else:
            tally.finished += 1
            if ended:
                tally.wrong.append(f"status {ended}")
        _look(references, wanted, out, tally)
    return tally


def _look(references: list[folders.Content], wanted: int, out: Path, tally: Tally) -> None:
    try:
        found = folders.content(out / "scene.xml")
        folders.loads(out / "scene.xml")
    except (AssertionError, OSError, ValueError) as error:
        tally.wrong.append(repr(error))
        return
    if found == references[wanted]:
        tally.new += 1
    elif found == references[1 - wanted]:
        tally.old += 1
    else:
        tally.wrong.append("a scene that is neither the old nor the new one")
    if not folders.foreign_untouched(out):
        tally.wrong.append("a file of somebody else was touched")


def _start(scene: Path, out: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "env2mjcf", "convert", str(scene), str(out / "scene.xml")]
    return subprocess.Popen(
        command, env=folders.ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )


def _durations(scene: Path, out: Path) -> tuple[float, float]:
    """Return the seconds that a conversion takes, and somewhat more than those that it writes for."""
    empty = out.with_name("timed")
    began = time.monotonic()
    child = _start(scene, empty)
    while child.poll() is None and not empty.exists():
        time.sleep(0.0005)
    wrote = time.monotonic()
    while child.poll() is None and not (empty / "scene.xml").exists():
        time.sleep(0.0005)
    renamed = time.monotonic()
    child.wait()
    return time.monotonic() - began, 1.25 * (renamed - wrote)
