"""Without an extra: what it is for says so in one sentence, and everything else works.

The packages are hidden from a child process by `without/sitecustomize.py`. With ENV2MJCF_TEST_WITHOUT=numba,viser the
whole suite runs as if those were not installed.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from extras import PACKAGES
from scenes import MODELS

HIDING = Path(__file__).parent / "support" / "without"
EVERYTHING = tuple(name for names in PACKAGES.values() for name in names)
SEED, MAZE, BUG_TRAP = (str(MODELS / p) for p in ("seed/seed.env", "maze/maze.xml", "bug-trap/bug-trap.env"))
NEEDS = {
    ("check", MAZE, "--engine", "exact"): "fast",
    ("batch", SEED, "x.npy", "-o", "y.npy", "--engine", "exact"): "fast",
    ("convert", SEED, "x", "--engine", "exact"): "fast",
    ("cache", "warm"): "fast",
    ("render", SEED, "-o", "x.png"): "view",
    ("play", SEED, "x.path", "-o", "x.mp4"): "view",
    ("play", SEED, "x.path", "-o", "x.gif"): "view",
    ("view", SEED): "view",
    ("plan", MAZE): "planning",
    ("plan", MAZE, "--planner", "RRTConnect"): "planning",
    ("batch", SEED, "x.npy", "-o", "y.npy", "--dask", "tcp://127.0.0.1:1"): "dask",
    ("convert", BUG_TRAP, "x", "--collision", "coacd"): "decompose",
}
DOES_WITHOUT = [
    ("convert", SEED, "seed"),
    ("convert", BUG_TRAP, "bug-trap"),
    ("info", SEED),
    ("check", MAZE, "2", "2", "0"),
    ("check", MAZE, "--json"),
    ("lint", SEED),
    ("batch", SEED, "x.npy", "-o", "y.npy"),
    ("translate", str(MODELS / "alpha/alpha.env"), "-o", "x.env", "--dialect", "A"),
    ("cache", "info"),
    *((verb, "--help") for verb in ("convert", "info", "check", "lint", "batch", "render", "play", "view", "plan")),
]
# One process for all verbs: starting one takes longer than most of them.
RUN_ALL = """
import contextlib, io, json, sys
from env2mjcf.cli.main import main
told = []
for words in json.loads(sys.argv[1]):
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main(words)
    told.append((status, out.getvalue(), err.getvalue()))
json.dump(told, sys.stdout)
"""


def run(folder: Path, hidden: tuple[str, ...], *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python without these packages."""
    path = os.pathsep.join(p for p in (str(HIDING), os.environ.get("PYTHONPATH", "")) if p)
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path, "ENV2MJCF_TEST_WITHOUT": ",".join(hidden)},
        capture_output=True,
        text=True,
        check=False,
    )


def all_told(folder: Path, verbs: Iterable[tuple[str, ...]]) -> list[tuple[int, str, str]]:
    """Return status, stdout and stderr of each verb where no extra is installed."""
    np.save(folder / "x.npy", np.zeros((2, 9)))
    (folder / "x.path").write_text("VIZMO_PATH_FILE\n1\n2\n0 0 0 0 0 0 0 0 0\n0 0 0 0 0 0 0.1 0 0\n")
    done = run(folder, EVERYTHING, "-c", RUN_ALL, json.dumps(list(verbs)))
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_verb_that_needs_an_extra_says_in_one_sentence_how_to_get_it(tmp_path: Path) -> None:
    told = all_told(tmp_path, NEEDS)
    for (words, extra), (status, out, err) in zip(NEEDS.items(), told, strict=True):
        assert (status, out) == (2, ""), err
        last = err.splitlines()[-1]
        assert last.startswith(f"env2mjcf: {words[0]}: ")
        assert last.endswith(f": pip install 'env2mjcf[{extra}]'")
    assert {path.name for path in tmp_path.iterdir()} == {"x.npy", "x.path"}


def test_every_other_verb_does_without_all_of_them(tmp_path: Path) -> None:
    told = all_told(tmp_path, DOES_WITHOUT)
    for words, (status, out, err) in zip(DOES_WITHOUT, told, strict=True):
        assert status == 0, (words, err)
        assert out, words


def test_what_is_hidden_cannot_be_found_nor_imported(tmp_path: Path) -> None:
    code = (
        "from importlib.util import find_spec\n"
        f"names = {EVERYTHING!r}\n"
        "assert [find_spec(n) for n in names] == [None] * len(names)\n"
        "for n in names:\n"
        "    try: __import__(n)\n"
        "    except ModuleNotFoundError: continue\n"
        "    raise SystemExit(n)\n"
        "import numpy, env2mjcf\n"
    )
    done = run(tmp_path, EVERYTHING, "-c", code)
    assert done.returncode == 0, done.stderr
