"""What pyproject.toml promises: the oldest versions, and what is imported."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from importlib.metadata import packages_distributions
from importlib.util import resolve_name
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
PYPROJECT = ROOT / "pyproject.toml"


@pytest.fixture(scope="module")
def pyproject() -> dict[str, Any]:
    return tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def project(pyproject: dict[str, Any]) -> dict[str, Any]:
    return pyproject["project"]


def bounds(requirements: list[str]) -> dict[str, str]:
    """Return the lower bounds of requirements."""
    found = (re.match(r"([\w-]+)(?:\[\w+\])?>=([\d.]+)", r) for r in requirements if not r.startswith("env2mjcf["))
    return {m[1]: m[2] for m in found if m}


def release(version: str) -> tuple[int, ...]:
    """Return the numbers of a version without zeros at its end."""
    return tuple(int(part) for part in re.sub(r"(\.0)+$", "", version).split("."))


def runtime(project: dict[str, Any]) -> list[str]:
    """Return what is required by the package and by its extras for users."""
    extras = project["optional-dependencies"]
    return project["dependencies"] + [
        r for name in extras if name not in ("notebooks", "test", "bench", "docs", "lint", "dev") for r in extras[name]
    ]


def test_the_oldest_versions_are_those_that_are_tested(project: dict[str, Any]) -> None:
    lines = (ROOT / "tests/lowest.txt").read_text().splitlines()
    pinned = dict(line.split("==") for line in lines if not line.startswith("#"))
    declared = bounds(runtime(project))
    assert {n: release(v) for n, v in pinned.items()} == {n: release(v) for n, v in declared.items()}


def test_everything_has_an_oldest_version(project: dict[str, Any]) -> None:
    for requirement in runtime(project):
        assert ">=" in requirement or requirement.startswith("env2mjcf["), requirement


def test_nothing_is_imported_that_is_not_required(project: dict[str, Any]) -> None:
    required = set(bounds(runtime(project)))
    # Dask's extra `distributed` is the package of that name; the plugin of pytest is imported by pytest alone; numba is
    # built on llvmlite, and asks for its version.
    required |= {"distributed", "pytest", "llvmlite"}
    owners = packages_distributions()
    for path in sorted((ROOT / "env2mjcf").rglob("*.py")):
        for name in imported(ast.parse(path.read_text(encoding="utf-8"))):
            if name not in sys.stdlib_module_names and name in owners and name != "env2mjcf":
                assert {o.lower() for o in owners[name]} & required, f"{path} imports {name}"


def test_modules_that_are_named_in_strings_lie_in_the_same_room_or_below(pyproject: dict[str, Any]) -> None:
    """`make lint` sees import statements alone."""
    (layers,) = (c["layers"] for c in pyproject["tool"]["importlinter"]["contracts"] if c["type"] == "layers")
    floors = {room: floor for floor, rooms in enumerate(layers) for room in rooms.split(" | ")}
    for path in sorted((ROOT / "env2mjcf").glob("*/**/*.py")):
        package = ".".join(path.relative_to(ROOT).parts[:-1])
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(call, ast.Call) and "import_module" in ast.dump(call.func):
                name = ast.literal_eval(call.args[0]) if isinstance(call.args[0], ast.Constant) else ""
                if name.startswith("."):
                    room, above = resolve_name(name, package).split(".")[1], package.split(".")[1]
                    assert room == above or floors[room] > floors[above], f"{path} imports {name}"


def imported(tree: ast.AST) -> set[str]:
    """Return the first words of all absolute imports of a module, wherever they stand."""
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            found.add(node.module.partition(".")[0])
        elif isinstance(node, ast.Call) and "import_module" in ast.dump(node.func):
            found |= {str(a.value).partition(".")[0] for a in node.args[:1] if isinstance(a, ast.Constant)}
    return found
