"""Whoever waits for the compiler is told so: once, on a terminal and in a notebook, and only where it compiles."""

from __future__ import annotations

import os
import pty
import shutil
import subprocess
import sys
import termios
from pathlib import Path

import pytest
from scenes import MODELS

import env2mjcf

pytest.importorskip("numba", reason="no numba: pip install 'env2mjcf[fast]'")

PACKAGE = Path(env2mjcf.__file__).parents[1]
LINE = "env2mjcf: compiling the collision engine, once on this machine, about "
ASK = f"""
import env2mjcf
scene = env2mjcf.load({str(MODELS / "maze/maze.env")!r})
q = scene.space.sample(2, seed=1)
scene.is_valid(q), scene.in_collision(q)
"""
# Asks in a worker first.
WORKER = f"""
import multiprocessing
def ask():
    exec({ASK!r})
if __name__ == "__main__":
    from env2mjcf.contact.exact.engine import entries
    entries()  # what the parent has made ready is forked, too
    worker = multiprocessing.get_context("fork").Process(target=ask)
    worker.start()
    worker.join()
    assert worker.exitcode == 0
"""


def environment(folder: Path) -> dict[str, str]:
    return {**os.environ, "NUMBA_CACHE_DIR": str(folder), "PYTHONPATH": str(PACKAGE)}


def said(code: str, folder: Path) -> str:
    command = [sys.executable, "-c", code]
    return subprocess.run(command, env=environment(folder), check=True, capture_output=True, text=True).stderr


def said_on_terminal(code: str, folder: Path) -> str:
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(ours, (24, 80))
    with subprocess.Popen([sys.executable, "-c", code], env=environment(folder), stderr=theirs) as process:
        os.close(theirs)
        text = b""
        try:
            while block := os.read(ours, 4096):
                text += block
        except OSError:  # Linux says so at the end.
            pass
    os.close(ours)
    assert process.returncode == 0
    return text.decode()


@pytest.mark.slow
def test_a_terminal_is_told_once_and_shows_a_bar(tmp_path: Path) -> None:
    text = said_on_terminal(ASK, tmp_path / "first")
    assert text.count(LINE) == 1
    assert "compiling: " in text
    # As CI keeps the folder: it comes back as a copy.
    shutil.copytree(tmp_path / "first", tmp_path / "copy")
    assert said_on_terminal(ASK, tmp_path / "copy") == ""


@pytest.mark.slow
def test_a_worker_says_nothing(tmp_path: Path) -> None:
    assert said(WORKER, tmp_path) == ""
    assert list(tmp_path.rglob("entries.*.nbc"))


@pytest.mark.slow
def test_a_notebook_is_told_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    for name, value in environment(tmp_path).items():
        monkeypatch.setenv(name, value)
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(ASK) for _ in range(2)])
    nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    texts = [o.text for cell in notebook.cells for o in cell.outputs if o.output_type == "stream"]
    assert "".join(texts).count(LINE) == 1
