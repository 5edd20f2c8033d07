"""The interpreter ends although daemon threads ask."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import folders
import pytest
from scenes import free_cube, write_scene

# More rows than anybody waits for, in blocks of 64.
ENDLESS = """
import sys, threading, time
import numpy as np
from env2mjcf.contact.tasks import Question
from env2mjcf.contact.threads import ask

def slow(queries, rows):
    began.set()
    time.sleep(0.02)
    return rows

began = threading.Event()
question = Question(slow, (np.broadcast_to(0.0, 10**9),), (), 500_000)
threading.Thread(target=ask, args=(None, question, lambda *_: None, int(sys.argv[1]), None, False), daemon=True).start()
began.wait()
"""
# Compiled code is at work when the main thread ends.
COMPILED = """
import sys, threading
import env2mjcf
from env2mjcf.contact.tasks import Chunks

began, took = threading.Event(), Chunks.took
def tell(*words):
    took(*words)
    began.set()
Chunks.took = tell
scene = env2mjcf.load(sys.argv[2], engine="mujoco")
rows = scene.space.sample(400_000, seed=0)
threading.Thread(target=scene.in_collision, args=(rows,), kwargs={"threads": int(sys.argv[1])}, daemon=True).start()
began.wait()
"""
# Who comes last may still ask.
AT_EXIT = """
import atexit, sys
@atexit.register
def last():
    print(scene.in_collision(scene.space.sample(2000, seed=0), threads=int(sys.argv[1])).any())
import env2mjcf
scene = env2mjcf.load(sys.argv[2], engine="mujoco")
"""


@pytest.mark.slow_but("compiled-1", "exit-2")
@pytest.mark.parametrize("threads", ["1", "2"])
@pytest.mark.parametrize("code", [ENDLESS, COMPILED, AT_EXIT], ids=["endless", "compiled", "at exit"])
def test_the_interpreter_ends_while_a_daemon_thread_asks(code: str, threads: str, tmp_path: Path) -> None:
    scene = write_scene(tmp_path, free_cube("4 0 0 0 0 0", "0 2 0 0 0 0", "-3 0 1 0 0 0"))
    done = subprocess.run(
        [sys.executable, "-c", code, threads, str(scene)], env=folders.ENVIRONMENT, capture_output=True, text=True,
        check=False, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == ("True\n" if code is AT_EXIT else "")
