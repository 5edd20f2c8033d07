"""Streams that are closed or full, and machines that lack something: an exit status that means what it says."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import folders
import pytest
from scenes import free_cube, write_scene

from env2mjcf.cli.program import BAD_INPUT, DONE, FAULT, FINDING, WRONG_USAGE

pytestmark = pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
VALID, COLLIDING = "4 0 0 0 0 0", "0.5 0 0 0 0 0"


def run(words: str, folder: Path, before: Callable[[], object] = bool) -> tuple[int, str, str]:
    """Run the program; return its status, and what it says on stdout and stderr.

    Args:
        words: Its arguments.
        folder: Where.
        before: What to do in its process first.
    """
    done = subprocess.run(
        [sys.executable, "-m", "env2mjcf", *words.split()], cwd=folder, env=folders.ENVIRONMENT, capture_output=True,
        text=True, check=False, timeout=120, preexec_fn=before,
    )  # fmt: skip
    return done.returncode, done.stdout, done.stderr


def full(number: int) -> Callable[[], object]:
    return lambda: os.dup2(os.open("/dev/full", os.O_WRONLY), number)


def closed(*numbers: int) -> Callable[[], object]:
    return lambda: [os.close(number) for number in numbers]


# Each with diagnostics: what is said of them is what cannot be said.
CASES = {
    "info scene.env": DONE, "check colliding.env": FINDING, "check": WRONG_USAGE, "check nothing.env": BAD_INPUT,
}  # fmt: skip


@pytest.fixture
def scenes(tmp_path: Path) -> Path:
    write_scene(tmp_path, free_cube(VALID))
    write_scene(tmp_path / "colliding", free_cube(COLLIDING)).rename(tmp_path / "colliding.env")
    return tmp_path


@pytest.mark.slow_but("check nothing")
@pytest.mark.parametrize("words", CASES)
def test_without_stderr_a_verb_works_and_keeps_its_status(words: str, scenes: Path) -> None:
    for before in (full(2), closed(2)):
        status, out, said = run(words, scenes, before)
        assert (status, said) == (CASES[words], "")
        assert bool(out) == (CASES[words] in (DONE, FINDING))


@pytest.mark.slow_but("info")
@pytest.mark.parametrize("words", CASES)
def test_with_stdout_closed_a_verb_works_and_keeps_its_status(words: str, scenes: Path) -> None:
    assert run(words, scenes, closed(1))[:2] == (CASES[words], "")


@pytest.mark.slow
def test_what_is_written_does_not_go_into_the_place_of_a_closed_stream(scenes: Path) -> None:
    run("convert scene.env out", scenes)
    whole = {p.name: p.read_bytes() for p in (scenes / "out").rglob("*.*")}
    assert run("convert scene.env closed", scenes, closed(0, 1, 2)) == (DONE, "", "")
    assert {p.name: p.read_bytes() for p in (scenes / "closed").rglob("*.*")} == whole


@pytest.mark.slow_but("info", "version")
@pytest.mark.parametrize("words", ["check colliding.env", "info scene.env --json", "--version", "check --help"])
def test_results_that_cannot_be_written_are_one_sentence(words: str, scenes: Path) -> None:
    status, _, said = run(words, scenes, full(1))
    assert status == BAD_INPUT
    assert said.splitlines()[-1].startswith("env2mjcf: the results cannot be written to standard output: No space")
    assert "report" not in said
    assert "Traceback" not in said


# Bytes: the interpreter starts with them, the program does not.
def test_too_little_memory_is_no_finding(scenes: Path) -> None:
    limit = 320_000_000
    status, out, said = run("check scene.env", scenes, lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)))
    if status == DONE:
        pytest.skip("without extras, so much memory is enough")
    assert (status, out) == (FAULT, "")
    assert "Traceback" not in said


@pytest.mark.parametrize("raised", ["MemoryError", "OSError(12, 'no room')", "ImportError('broken')"])
def test_what_goes_wrong_while_the_program_is_imported_is_no_finding(raised: str, scenes: Path) -> None:
    # Found before the real one.
    (scenes / "numpy.py").write_text(f"raise {raised}")
    status, out, said = run("check scene.env", scenes)
    expected = "a fault of env2mjcf, please report it: ImportError: broken (--debug shows where)"
    expected = expected if "broken" in raised else "there is not enough memory"
    assert (status, out, said) == (FAULT, "", f"env2mjcf: {expected}\n")
    assert "Traceback" in run("check scene.env --debug", scenes)[2]


def test_too_many_open_files_are_one_sentence(scenes: Path) -> None:
    # As many as importing takes; drawing needs pipes beside them.
    few = lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (6, 6))  # noqa: E731
    status, out, said = run("render scene.env -o a.png", scenes, few)
    assert (status, out) == (FAULT, "")
    assert said.splitlines()[-1] == "env2mjcf: Too many open files: ask for more of them (ulimit -n)"
    assert not (scenes / "a.png").exists()
