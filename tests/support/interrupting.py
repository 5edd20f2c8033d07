"""Sends Ctrl-C to the program at random moments, and looks at what it says and leaves."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import folders
import numpy as np
from scenes import free_cube, write_scene

import env2mjcf
from env2mjcf.companions import write_path

# How each verb is asked to write into a folder.
VERBS = {
    "convert": "scene.env made",
    "batch": "scene.env q.npy -o made/v.npy --what clearance --threads 2 --engine mujoco",
    "render": "scene.env -o made/a.png --size 160x120",
    "play": "scene.env a.path -o made/a.mp4 --size 160x120",
    "play gif": "scene.env a.path -o made/a.gif --size 160x120",
    "plan": "scene.env --query a.query -o made/b.path --time 4",
    "translate": "scene.env -o made/b.env --dialect C",
    "check": "scene.env a.path --picture made/a.png",
    "info": "scene.env",
    "lint": "scene.env",
    "view": "scene.env --no-browser",
    "cache": "warm",
}
# `view` goes on until it is interrupted; what `cache` has compiled when it is, the next run finds.
_SECONDS = {"view": 4.0, "cache": 30.0}
# What a batch goes on from.
_RESUMABLE = (".partial", ".journal")


@dataclass(slots=True)
class Tally:
    """What came of interruptions.

    Attributes:
        interrupted: Processes that ended with status 130, or by the signal.
        finished: Processes that were done before.
        wrong: What should not have been.
    """

    interrupted: int = 0
    finished: int = 0
    wrong: list[str] = field(default_factory=list)


def prepare(folder: Path) -> None:
    """Write all that the verbs read."""
    scene = env2mjcf.load(write_scene(folder, free_cube("0 4 0 0 0 0", "2 -1 0 0 0 0")), engine="mujoco")
    write_path(scene, np.array([[-3.0, -3, 0, 0, 0, 0], [-3, 2, 0, 0, 0, 1]]), folder / "a.path")
    (folder / "a.query").write_text("0 -3 -3 0 0 0 0\n0 -3 3 -2 0 0 0\n")
    np.save(folder / "q.npy", scene.space.sample(4000, seed=0))
    (folder / "made").mkdir()


def uninterrupted(verb: str, folder: Path) -> tuple[dict[str, bytes], float]:
    """Run a verb; return the files that it makes, and the seconds that it takes."""
    began = time.monotonic()
    assert _start(verb, folder).wait() in (0, 1)
    return _made(folder), time.monotonic() - began


def interrupt(verb: str, folder: Path, after: float, whole: dict[str, bytes], tally: Tally) -> float:
    """Run a verb, interrupt it after some seconds, and look at what it says and leaves.

    The signal goes to the process alone, so that what it started is its own to stop.

    Args:
        verb: One of `VERBS`.
        folder: What `prepare` has prepared.
        after: The seconds.
        whole: The files that it makes.
        tally: What is added to.

    Returns:
        The seconds after which it was interrupted, or was done.
    """
    child, began = _start(verb, folder), time.monotonic()
    try:
        with suppress(subprocess.TimeoutExpired):
            child.wait(after)
        lived = time.monotonic() - began
        child.send_signal(signal.SIGINT)
        said = child.communicate(timeout=30)[1]
    except subprocess.TimeoutExpired:
        child.kill()
        child.wait()
        tally.wrong.append(f"{verb} after {after:.3f} s: still there after 30 seconds")
        return after
    finally:
        left = left_in_session(child.pid)
        for pid in left:
            os.kill(pid, signal.SIGKILL)
    what = f"{verb} after {after:.3f} s: status {child.returncode}"
    if child.returncode in (130, -signal.SIGINT):
        tally.interrupted += 1
    elif child.returncode in (0, 1):
        tally.finished += 1
    else:
        tally.wrong.append(f"{what}: {said[-300:]}")
    # Before `site` has run there is nothing of ours that could keep the interpreter from saying so.
    if "Traceback" in said and "env2mjcf" in said:
        tally.wrong.append(f"{what}: {said[-600:]}")
    if left:
        tally.wrong.append(f"{what}: left {len(left)} processes")
    made = {name: data for name, data in _made(folder).items() if verb != "batch" or not name.endswith(_RESUMABLE)}
    if not made.items() <= whole.items():
        tally.wrong.append(f"{what}: left {sorted(name for name in made if made[name] != whole.get(name))}")
    if child.returncode == 0 and made != whole:
        tally.wrong.append(f"{what}: did not write {sorted(whole.keys() - made.keys())}")
    return lived


def interrupt_randomly(verb: str, folder: Path, count: int, seed: int) -> Tally:
    """Interrupt a verb at random moments of its life, one in each part of it."""
    chance, tally = random.Random(f"{seed} {verb}"), Tally()
    whole, life = ({}, _SECONDS[verb]) if verb in _SECONDS else uninterrupted(verb, folder)
    for part in range(count):
        after = max(0.05, chance.uniform(part, part + 1) / count * life)
        lived = interrupt(verb, folder, after, whole, tally)
        if lived < after:
            # The first run may have compiled what later ones find.
            life = lived
    return tally


def _start(verb: str, folder: Path) -> subprocess.Popen[str]:
    shutil.rmtree(folder / "made", ignore_errors=True)
    (folder / "made").mkdir()
    command = [sys.executable, "-m", "env2mjcf", verb.partition(" ")[0], *VERBS[verb].split()]
    compiled = {"NUMBA_CACHE_DIR": str(folder / "compiled")} if verb == "cache" else {}
    return subprocess.Popen(
        command, cwd=folder, env={**folders.ENVIRONMENT, **compiled}, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        text=True, start_new_session=True, preexec_fn=heed,  # noqa: PLW1509
    )  # fmt: skip


def _made(folder: Path) -> dict[str, bytes]:
    made = folder / "made"
    return {p.relative_to(made).as_posix(): p.read_bytes() for p in made.rglob("*") if p.is_file()}


def heed() -> None:
    # Jobs in the background inherit that they are ignored, and so does what nohup starts.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def left_in_session(session: int) -> list[int]:
    """Return the processes of a session that are still there a second after its first one has ended."""
    deadline = time.monotonic() + 1.0
    while True:
        found = [int(p.name) for p in Path("/proc").glob("[0-9]*") if _session_of(p) == session]
        if not found or time.monotonic() > deadline:
            return found
        time.sleep(0.02)


def _session_of(process: Path) -> int | None:
    try:
        fields = (process / "stat").read_text().rpartition(")")[2].split()
    except OSError:
        return None
    # What has ended and only waits to be asked how does no harm.
    return None if fields[0] == "Z" else int(fields[3])
