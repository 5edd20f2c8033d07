"""The notebooks run top to bottom, hold what they say, show pictures, and keep no outputs in git."""

from __future__ import annotations

import os
import re
import shutil
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from env2mjcf.contact.exact import engine
from env2mjcf.view import offscreen

nbformat = pytest.importorskip("nbformat", reason="notebooks need nbformat")
PROJECT = Path(__file__).resolve().parent.parent
NOTEBOOKS = sorted((PROJECT / "notebooks").glob("*.ipynb"))
NEEDED = ("nbclient", "ipykernel", "matplotlib", "PIL")
MISSING = [name for name in NEEDED if find_spec(name) is None]
SECONDS = 300

each = pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda f: f.stem)


def read(file: Path) -> Any:
    notebook = nbformat.read(file, as_version=4)
    nbformat.validate(notebook)
    return notebook


def code_cells(notebook: Any) -> list[Any]:
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def outputs_of(notebook: Any, kind: str) -> list[Any]:
    """Return all outputs that have a form of this kind, such as `image/`."""
    outputs = [o for cell in code_cells(notebook) for o in cell.outputs]
    return [o for o in outputs if any(key.startswith(kind) for key in o.get("data", {}))]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of all that notebooks may need: they must not depend on, or change, anything else."""
    for name in ("notebooks", "models"):
        shutil.copytree(PROJECT / name, tmp_path / name, ignore=shutil.ignore_patterns(".*", "__pycache__"))
    return tmp_path / "notebooks"


def executed(file: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Run a notebook in the copied folder with the package of this checkout, and return it with its outputs."""
    from jupyter_client.kernelspec import KernelSpecManager
    from jupyter_client.manager import AsyncKernelManager
    from nbclient import NotebookClient

    # Else the first notebook that asks would show that it waits for the compiler.
    if engine.available():
        engine.compile_all()
    paths = [str(PROJECT), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(p for p in paths if p))
    # As a server sets it: pictures of plots go into the notebook.
    monkeypatch.delenv("MPLBACKEND", raising=False)
    # The interpreter that runs the tests, whatever kernels are installed for the user.
    manager = AsyncKernelManager(kernel_name="python3", kernel_spec_manager=KernelSpecManager(kernel_dirs=[]))
    notebook = read(file)
    client = NotebookClient(notebook, km=manager, timeout=SECONDS, resources={"metadata": {"path": str(folder)}})
    client.execute(cleanup_kc=True)  # a kernel that the client has not made itself is otherwise left running
    return notebook


def test_there_are_four() -> None:
    assert [file.stem[0] for file in NOTEBOOKS] == ["1", "2", "3", "4"]


@each
def test_git_holds_no_outputs(file: Path) -> None:
    notebook = read(file)
    assert all(cell.outputs == [] and cell.execution_count is None for cell in code_cells(notebook))
    assert set(notebook.metadata) == {"kernelspec", "language_info"}
    assert notebook.metadata.kernelspec.name == "python3"
    assert all(cell.metadata == {} for cell in notebook.cells)


@each
def test_it_opens_with_what_the_reader_will_have(file: Path) -> None:
    first = read(file).cells[0]
    assert first.cell_type == "markdown"
    assert re.match(rf"# {file.stem[0]} \w", first.source)
    assert "What you will have at the end:" in first.source


@each
def test_it_is_told_in_small_steps(file: Path) -> None:
    notebook = read(file)
    ids = [cell.id for cell in notebook.cells]
    assert len(set(ids)) == len(ids)
    kinds = [cell.cell_type for cell in notebook.cells]
    assert kinds.count("markdown") >= kinds.count("code") / 2
    assert max(len(cell.source.splitlines()) for cell in notebook.cells) <= 40
    assert sum(len(re.findall(r"^\s*assert ", cell.source, re.MULTILINE)) for cell in code_cells(notebook)) >= 5


@each
def test_links_lead_to_notebooks(file: Path) -> None:
    for cell in read(file).cells:
        for target in re.findall(r"\]\(([^)#:]+)\)", cell.source) if cell.cell_type == "markdown" else ():
            assert (file.parent / target).is_file()


@pytest.mark.slow
@pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}")
@each
def test_it_runs_and_shows_pictures(file: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if file.stem.startswith("4") and find_spec("ompl") is None:
        pytest.skip("planning needs OMPL")
    before = {p: p.read_bytes() for p in folder.parent.rglob("*") if p.is_file()}
    notebook = executed(file, folder, monkeypatch)
    assert all(cell.execution_count for cell in code_cells(notebook))
    assert not [o for cell in code_cells(notebook) for o in cell.outputs if o.get("name") == "stderr"]
    pictures, films = outputs_of(notebook, "image/"), outputs_of(notebook, "text/html")
    if offscreen.backend():
        assert len(pictures) >= 3
        assert not outputs_of(notebook, "text/markdown")
        assert len(films) == (1 if file.stem.startswith("4") else 0)
    assert {p: p.read_bytes() for p in folder.parent.rglob("*") if p.is_file()} == before


@pytest.mark.slow
@pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}")
def test_without_gl_it_says_so_and_runs_on(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")
    notebook = executed(NOTEBOOKS[0], folder, monkeypatch)
    notes = [o.data["text/markdown"] for o in outputs_of(notebook, "text/markdown")]
    assert len(notes) >= 3
    assert all(note.startswith("*No picture: ") for note in notes)
    assert not outputs_of(notebook, "image/")
