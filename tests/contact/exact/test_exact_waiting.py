"""Whoever waits for the compiler is told so: once, on a terminal and in a notebook, and only where it compiles."""

from __future__ import annotations

import json
import os
import pty
import shutil
import subprocess
import sys
import termios
from importlib.metadata import version
from pathlib import Path

import pytest
from scenes import MODELS

import env2mjcf
from env2mjcf.cli.main import main
from env2mjcf.contact.exact import engine

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


def environment(folder: Path, package: Path = PACKAGE) -> dict[str, str]:
    return {**os.environ, "NUMBA_CACHE_DIR": str(folder), "PYTHONPATH": str(package)}


def said(code: str, folder: Path, package: Path = PACKAGE) -> str:
    command = [sys.executable, "-P", "-c", code]
    done = subprocess.run(command, env=environment(folder, package), check=True, capture_output=True, text=True)
    return done.stderr


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


@pytest.mark.slow
def test_a_new_container_takes_what_ci_has_kept(tmp_path: Path) -> None:
    if tuple(map(int, version("numba").split(".")[:2])) < (0, 68):
        pytest.skip("older ones look at the times of the package's files")

    def installed() -> Path:
        # With new times, as installing does.
        shutil.rmtree(tmp_path / "site", ignore_errors=True)
        leave_out = shutil.ignore_patterns("__pycache__")
        source, target = PACKAGE / "env2mjcf", tmp_path / "site" / "env2mjcf"
        shutil.copytree(source, target, copy_function=shutil.copyfile, ignore=leave_out)
        return target.parent

    assert said(ASK, tmp_path / "kept", installed()).count(LINE) == 1
    assert said(ASK, tmp_path / "kept", installed()) == ""
    # Other sources of any function are noticed, of those too that numba does not look at.
    kernel = installed() / "env2mjcf/contact/exact/kernels/boxes.py"
    kernel.write_text(kernel.read_text() + "# changed\n")
    assert said(ASK, tmp_path / "kept", kernel.parents[4]).count(LINE) == 1


@pytest.mark.slow
def test_who_compiles_everything_is_told_how_long_that_takes(tmp_path: Path) -> None:
    assert said("from env2mjcf.contact.exact.engine import compile_all; compile_all()", tmp_path) == f"{LINE}15 s\n"


def test_the_program_knows_what_is_compiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code = Path(engine.entries().collisions.stats.cache_path)
    engine.compile_all()
    folder, files = engine.kept_files()
    assert folder == code
    # What numba has written, found without its names: an index of each entry, and machine code.
    assert set(files) == {f for f in code.iterdir() if f.suffix in (".nbi", ".nbc")}
    for name in ("collisions", "validities", "distances", "edges_collide", "edges_are_free"):
        assert any(f".{name}-" in f.name for f in files)
    functions = sum(f.suffix == ".nbi" for f in files)  # more than five where older sources were compiled, too
    # Removed is a copy, so that no other test has to compile; beside it is what is not ours.
    copy = tmp_path / "copy"
    copy.mkdir()
    copies = [Path(shutil.copy(f, copy)) for f in files]
    (copy / "boxes.cpython-311.pyc").touch()
    monkeypatch.setattr(engine, "kept_files", lambda: (copy, [f for f in copies if f.exists()]))
    monkeypatch.setenv("ENV2MJCF_CACHE_DIR", str(tmp_path / "geometry"))
    size = sum(f.stat().st_size for f in files)
    assert main(["cache", "info"]) == 0
    held = f"{functions} compiled functions, {size / 2**20:.1f} MiB"
    assert f"engine  {held}\nkept    {copy}\n" in capsys.readouterr().out
    assert main(["cache", "info", "--json"]) == 0
    compiled = json.loads(capsys.readouterr().out)["compiled"]
    assert compiled == {"folder": str(copy), "functions": functions, "bytes": size}
    assert main(["cache", "clear"]) == 0
    assert f"removed {held} from {copy}\n" in capsys.readouterr().out
    assert [f.name for f in copy.iterdir()] == ["boxes.cpython-311.pyc"]
    assert main(["cache", "info", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["compiled"]["functions"] == 0
