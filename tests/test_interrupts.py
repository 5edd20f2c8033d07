"""Ctrl-C at any time: status 130, no traceback, nothing half-written, nothing that goes on."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import folders
import interrupting
import pytest

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")


@pytest.mark.parametrize("verb", ["convert", "batch", "play", "plan"])
def test_a_verb_that_is_interrupted_leaves_nothing(verb: str, tmp_path: Path) -> None:
    interrupting.prepare(tmp_path)
    tally = interrupting.interrupt_randomly(verb, tmp_path, count=2, seed=0)
    assert tally.wrong == []
    assert tally.interrupted > 0


# Numpy makes another error of Ctrl-C, and Python a traceback.
TURNED_INTO_ANOTHER = """
import os, signal
try:
    os.kill(os.getpid(), signal.SIGINT)
    for _ in range(10**9): pass
except KeyboardInterrupt:
    raise ImportError('initialization failed')
"""
# From callbacks out of compiled code, as numba has them, nothing can be raised.
SWALLOWED = """
import ctypes, os, signal, time
@ctypes.CFUNCTYPE(None)
def callback():
    os.kill(os.getpid(), signal.SIGINT)
    for _ in range(10**9): pass
callback()
time.sleep(60)
"""


@pytest.mark.parametrize(
    ("module", "code"),
    [
        ("numpy", TURNED_INTO_ANOTHER), ("trimesh", TURNED_INTO_ANOTHER), ("mujoco", TURNED_INTO_ANOTHER),
        ("mujoco", SWALLOWED),
    ],
)  # fmt: skip
def test_it_ends_the_program_while_it_is_imported(module: str, code: str, tmp_path: Path) -> None:
    interrupting.prepare(tmp_path)
    # Found before the real one; it is interrupted in the middle of its import.
    (tmp_path / "first").mkdir()
    (tmp_path / "first" / f"{module}.py").write_text(code)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path / "first"), str(folders.ROOT)])}
    done = subprocess.run(
        [sys.executable, "-m", "env2mjcf", "convert", "scene.env", "out"], cwd=tmp_path, env=environment,
        capture_output=True, text=True, check=False, timeout=60, preexec_fn=interrupting.heed,
    )  # fmt: skip
    assert done.returncode in (130, -signal.SIGINT)
    assert (done.stdout, done.stderr) == ("", "")
    assert not (tmp_path / "out").exists()


def test_a_library_leaves_ctrl_c_alone() -> None:
    code = "import signal, env2mjcf, env2mjcf.cli.main as m; before = signal.getsignal(2); m.main(['--version'])\n"
    check = "assert before is signal.getsignal(2) is signal.default_int_handler"
    subprocess.run(
        [sys.executable, "-c", code + check], env=folders.ENVIRONMENT, check=True, capture_output=True,
        preexec_fn=interrupting.heed,
    )  # fmt: skip
