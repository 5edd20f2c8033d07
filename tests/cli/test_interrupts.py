"""Ctrl-C and other signals at any time: no traceback, nothing half-written, nothing that goes on."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import folders
import interrupting
import pytest
from extras import needs

from env2mjcf.view import offscreen

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")


@pytest.mark.slow_but("convert")
@pytest.mark.parametrize(
    "verb",
    [
        "convert", "batch", pytest.param("plan", marks=needs("planning")),
        pytest.param("play", marks=[needs("view"), pytest.mark.skipif(offscreen.backend() is None, reason="no GL")]),
    ],
)  # fmt: skip
def test_a_verb_that_is_interrupted_leaves_nothing(verb: str, tmp_path: Path) -> None:
    interrupting.prepare(tmp_path)
    tally = interrupting.interrupt_randomly(verb, tmp_path, count=3, seed=0)
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


@pytest.mark.slow_but("code0")
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


def wait_for(what: Callable[[], object], child: subprocess.Popen[bytes]) -> None:
    deadline = time.monotonic() + 60
    while not what() and child.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)


@pytest.mark.slow_but("15")
@needs("view")
@pytest.mark.skipif(offscreen.backend() is None, reason="no GL")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_other_signals_end_it_as_tidily(number: signal.Signals, tmp_path: Path) -> None:
    interrupting.prepare(tmp_path)
    (tmp_path / "temporary").mkdir()
    child = subprocess.Popen(
        [sys.executable, "-m", "env2mjcf", "play", "scene.env", "a.path", "-o", "made/a.mp4", "--seconds", "60"],
        cwd=tmp_path, env={**folders.ENVIRONMENT, "TMPDIR": str(tmp_path / "temporary")}, stderr=subprocess.PIPE,
        start_new_session=True, preexec_fn=interrupting.heed,  # noqa: PLW1509
    )  # fmt: skip
    try:
        wait_for(lambda: list((tmp_path / "temporary").glob("env2mjcf-*/scene.mjb")), child)
        for _ in range(3):  # a terminal, its shell, and others
            child.send_signal(number)
        said = child.communicate(timeout=60)[1]
    finally:
        left = interrupting.left_in_session(child.pid)
        for pid in left:
            os.kill(pid, signal.SIGKILL)
    assert (child.returncode, said, left) == (128 + number, b"", [])
    assert list((tmp_path / "temporary").iterdir()) == []
    assert list((tmp_path / "made").iterdir()) == []


@pytest.mark.slow
def test_what_nohup_ignores_stays_ignored(tmp_path: Path) -> None:
    interrupting.prepare(tmp_path)
    (tmp_path / "first").mkdir()
    # Sent while it is imported, and once more in the verb.
    (tmp_path / "first" / "mujoco.py").write_text(
        "import os, signal, sys\nos.kill(os.getpid(), signal.SIGHUP)\nsys.path.remove(os.path.dirname(__file__))\n"
        "del sys.modules['mujoco']\nimport mujoco\nos.kill(os.getpid(), signal.SIGHUP)\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path / "first"), str(folders.ROOT)])}
    command = [sys.executable, "-m", "env2mjcf", "info", "scene.env"]
    for ignored, status in ((True, 0), (False, -signal.SIGHUP)):
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, check=False, timeout=60,
            preexec_fn=lambda ignored=ignored: signal.signal(
                signal.SIGHUP, signal.SIG_IGN if ignored else signal.SIG_DFL
            ),
        )  # fmt: skip
        assert done.returncode in (status, 129) if not ignored else done.returncode == status
