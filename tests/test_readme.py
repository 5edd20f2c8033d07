"""The README tells the truth: its table is what conversions give, its examples run."""

from __future__ import annotations

import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
SCRIPT = ROOT / "benchmarks" / "table.py"


@pytest.fixture
def table() -> ModuleType:
    """The script that makes the tables, as a module of its own."""
    spec = importlib.util.spec_from_file_location("benchmark_table", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def checked(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the script's check as a user does."""
    command = [sys.executable, str(SCRIPT), "--check", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_table_of_models_is_up_to_date() -> None:
    finished = checked("models")
    assert finished.returncode == 0, f"{finished.stdout}\n{finished.stderr}\nto make it anew: make tables"


@pytest.mark.slow
@pytest.mark.usefixtures("corpus")
def test_the_table_of_the_corpus_is_up_to_date() -> None:
    finished = checked("corpus")
    assert finished.returncode == 0, f"{finished.stdout}\n{finished.stderr}\nto make it anew: make tables"


def test_every_scene_of_models_has_its_line(table: ModuleType) -> None:
    part = README.read_text(encoding="utf-8").split(table.BEGIN)[1].split(table.END)[0]
    scenes = {p.name for p in (ROOT / "models").iterdir() if any(p.glob("*.g")) or any(p.glob("meshes/*.g"))}
    assert set(re.findall(r"^\| ([a-z][a-z0-9-]*) \|", part, flags=re.MULTILINE)) - {"scene"} == scenes


def test_the_check_sees_a_changed_number_and_not_a_changed_time(
    table: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    cases = [case for case in table.model_cases() if case.name == "seed"]
    monkeypatch.setattr(table, "model_cases", lambda: cases)
    monkeypatch.setattr(table, "README", tmp_path / "README.md")
    table.README.write_text(f"before\n{table.BEGIN}\n{table.END}\nafter\n")
    assert table.main(["--check", "models"]) == 1
    assert table.main(["models"]) == 0
    text = table.README.read_text()
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert table.main(["--check", "models"]) == 0
    slower, count = re.subn(r"[0-9.]+ m?s \|", "77 s |", text)
    assert count == 1
    table.README.write_text(slower)
    assert table.main(["--check", "models"]) == 0
    table.README.write_text(text.replace("| 9 |", "| 8 |"))
    capsys.readouterr()
    assert table.main(["--check", "models"]) == 1
    assert "| 8 |" in capsys.readouterr().out


def test_a_readme_without_a_place_for_the_table_is_an_error(
    table: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(table, "README", tmp_path / "README.md")
    table.README.write_text(f"{table.END}\n{table.BEGIN}\n")
    with pytest.raises(SystemExit, match="models table begin"):
        table.models_text()


def test_a_scene_that_cannot_be_converted_says_why(table: ModuleType, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "models" / "seed", tmp_path / "seed")
    (tmp_path / "seed" / "link2.g").unlink()
    row = table.row(table.Case("seed", tmp_path / "seed" / "seed.env"), 1)
    assert row == ("seed", "A", "4 + 2", "", "", "", "does not convert: GEO201, missing link2.g")
    assert len(row) == len(table.HEADER)


def test_the_python_examples_run(tmp_path: Path) -> None:
    blocks = re.findall(r"^```python\n(.*?)^```", README.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    if not blocks:
        pytest.skip("README.md has no Python example")
    # As a reader in the checkout would run them, one after the other; what they write stays in the copy.
    shutil.copytree(ROOT / "models", tmp_path / "models")
    finished = subprocess.run(
        [sys.executable, "-c", "\n".join(blocks)], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert finished.returncode == 0, finished.stderr


def test_the_commands_from_a_clone_to_a_film_are_those_of_the_tutorial() -> None:
    """The tutorial's commands are run by tests/test_docs.py."""
    readme = README.read_text(encoding="utf-8")
    commands = [line for line in readme.splitlines() if line.startswith("env2mjcf ") and "models/maze" in line]
    assert [c.split()[1] for c in commands] == ["plan", "check", "play", "view"]
    tutorial = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
    for command in commands:
        assert command in tutorial
