"""Change the program in small ways at random, and count the changes that its tests notice.

    python tests/mutants/run.py                          # 120 changes, and results.md anew
    python tests/mutants/run.py --minutes 30             # as many as fit; the next run goes on from there
    python tests/mutants/run.py --again                  # what no test had noticed, with the tests of today
    python tests/mutants/run.py --fresh                  # everything anew, also which test runs what

Every test is run once, traced, to learn which functions it enters. A change is then made in a copy of the repository
and run against those tests: first those of the mirrored folder, the quickest first, until one fails; then, if it is
still there, the whole files that enter the function. Limits are of processor time: a busy machine kills nothing.
`equivalent.tsv` lists the changes that no test can notice, and why.
"""

from __future__ import annotations

import argparse
import csv
import datetime
import hashlib
import json
import os
import re
import resource
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path

from changes import Mutant, mutants

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
ROOMS = ("formats", "kinematics", "pairs.py", "mjcf", "contact", "planning")
# Of which tests the functions that they enter are learnt.
SUITES = ("formats", "kinematics", "test_pairs.py", "mjcf", "contact", "planning", "simulation", "companions",
          "translation", "test_conversion.py", "test_bad_input.py", "test_real_scenes.py")  # fmt: skip
# Whose slow tests take seconds, and are tried too; as plain Python they are quicker than their compilation.
_OF_KERNELS = "tests/contact/exact/test_exact_kernels.py"
_KERNELS = "env2mjcf/contact/exact/kernels/"
# What all compiled code is made of.
_COMPILED = (_KERNELS, "env2mjcf/contact/exact/tables.py", "env2mjcf/contact/exact/motions.py")
# What plain Python raises where compiled code goes on.
_PLAIN_ONLY = ("ZeroDivisionError", "IndexError", "OverflowError", "RuntimeWarning")
_ENGINE = "env2mjcf/contact/exact/engine.py:"
# Seconds that a run may take more, to begin with: imports, and for kernels their compilation.
_START, _COMPILING = 60.0, 300.0
# A test that takes so many times as long as it did is ended, and has noticed; but not before so many seconds.
_LONGER, _AT_LEAST = 20.0, 45.0
_MEMORY = 8 << 30
_SURVIVED = "survived"


@dataclass(frozen=True)
class Test:
    """A test that was traced.

    Attributes:
        name: Its id.
        seconds: How long it took, traced.
        functions: What it enters, `module:qualified name`.
    """

    name: str
    seconds: float
    functions: frozenset[str]

    @property
    def file(self) -> str:
        """Its file below the repository."""
        return self.name.split("::")[0]


class Copy:
    """A copy of the repository to change."""

    def __init__(self, folder: Path) -> None:
        self.root = folder / "copy"
        self._compiled = folder / "numba"
        shutil.rmtree(self.root, ignore_errors=True)
        command = ["git", "ls-files", "-co", "--exclude-standard"]
        for name in subprocess.check_output(command, cwd=ROOT, text=True).splitlines():
            if (ROOT / name).is_file():
                (self.root / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, self.root / name)
        (folder / "tmp").mkdir(exist_ok=True)
        self._environment = os.environ | {
            "TMPDIR": str(folder / "tmp"),
            "PYTHONDONTWRITEBYTECODE": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "PYTHONPATH": os.pathsep.join([str(self.root), str(self.root / "tests/mutants")]),
        }

    def pytest(
        self, arguments: Iterable[str], seconds: float, plugins: Iterable[str] = (), **variables: str
    ) -> tuple[int, str]:
        """Run pytest and return (its exit status, negative where it was ended for taking too long; what it printed)."""
        fresh = variables.pop("fresh", "")
        compiled = self._compiled.with_name("numba-changed") if fresh else self._compiled
        if fresh:
            shutil.rmtree(compiled, ignore_errors=True)
        shutil.rmtree(self.root / ".hypothesis", ignore_errors=True)
        chosen = self.root.parent / "arguments.txt"
        chosen.write_text("\n".join(arguments))
        # Plugins cannot be named in a file.
        common = [*(f"-p{p}" for p in ("no:cacheprovider", *plugins)), "--hypothesis-seed=0", "--tb=line", f"@{chosen}"]

        def limit() -> None:
            resource.setrlimit(resource.RLIMIT_CPU, (int(seconds), int(seconds) + 5))
            resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1]))

        try:
            done = subprocess.run(
                [sys.executable, "-m", "pytest", *common], cwd=self.root, capture_output=True, text=True, check=False,
                errors="replace", timeout=10 * seconds, preexec_fn=limit,
                env=self._environment | {"NUMBA_CACHE_DIR": str(compiled)} | variables,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return -1, ""
        return done.returncode, done.stdout + done.stderr


def traced(copy: Copy, folder: Path) -> list[Test]:
    """Return all tests and what they enter; files that are as they were traced before are not run again."""
    (folder / "traces").mkdir(exist_ok=True)
    files = [
        path
        for suite in SUITES
        for path in (
            [ROOT / "tests" / suite] if suite.endswith(".py") else sorted((ROOT / "tests" / suite).rglob("test_*.py"))
        )
    ]
    tests: list[Test] = []
    for file in files:
        name = str(file.relative_to(ROOT))
        digest = hashlib.sha256(file.read_bytes()).hexdigest()[:8]
        kept = folder / "traces" / f"{name.replace('/', '-')}-{digest}.json"
        if not kept.exists():
            status, printed = copy.pytest(
                ["-m", "" if name == _OF_KERNELS else "not slow", name], 1800, ["tracing"], MUTANTS_TRACE=str(kept)
            )
            print(f"{name}: {printed.strip().splitlines()[-1] if printed.strip() else status}", flush=True)
            if status not in (0, 5):
                # A test that fails by itself would notice everything.
                failing = [line.split()[1] for line in printed.splitlines() if line.startswith("FAILED ")]
                known = json.loads(kept.read_text()) if kept.exists() else {}
                kept.write_text(json.dumps({k: v for k, v in known.items() if k not in failing}))
        for test, (seconds, functions) in json.loads(kept.read_text()).items() if kept.exists() else ():
            tests.append(Test(test, seconds, frozenset(functions)))
    return tests


def _enters(mutant: Mutant) -> Callable[[str], bool]:
    """Return what tells whether entering a function runs what a mutant changes."""
    if mutant.module.startswith(_KERNELS):
        return lambda name: name.startswith(_ENGINE)
    if not mutant.function or (mutant.function[0].isupper() and "." not in mutant.function):
        return lambda name: name.startswith(f"{mutant.module}:")
    wanted = f"{mutant.module}:{mutant.function}"
    return lambda name: name.replace(".<locals>", "") == wanted


def chosen(mutant: Mutant, tests: list[Test], most: float) -> list[list[Test]]:
    """Return tests in the order in which they are tried: those that enter the function, then the others of their files.

    Either list takes about `most` seconds.
    """
    enters, below = _enters(mutant), mutant.module.removeprefix("env2mjcf/").replace("/kernels", "")
    folder = "tests/" + (below.rpartition("/")[0] if "/" in below else f"test_{below}")
    exact = [t for t in tests if any(map(enters, t.functions))]
    exact.sort(key=lambda t: (not t.file.startswith(folder), t.seconds))
    others = [t for file in dict.fromkeys(t.file for t in exact) for t in tests if t.file == file]
    stages: list[list[Test]] = []
    for some in (exact, [t for t in others if t not in set(exact)]):
        seconds = accumulate(t.seconds for t in some)
        stages.append([t for t, s in zip(some, seconds, strict=True) if s < most and "\n" not in t.name])
    return [s for s in stages if s]


def tried(mutant: Mutant, copy: Copy, tests: list[Test], most: float) -> tuple[str, str]:
    """Return (verdict, the test that noticed or why it ended) of one mutant."""
    target = copy.root / mutant.module
    original = target.read_text()
    target.write_text(mutant.source)
    compiled = mutant.module.startswith(_COMPILED)
    plan: list[tuple[list[str], float, dict[str, str]]] = []
    if compiled:
        plan.append(([_OF_KERNELS], 2 * _START, {"NUMBA_DISABLE_JIT": "1"}))
    for stage in chosen(mutant, tests, most):
        longest = max(_AT_LEAST, _LONGER * max(t.seconds for t in stage)) + _COMPILING * compiled
        arguments = [f"--timeout={longest:.0f}", *(t.name for t in stage)]
        allowed = _START + _COMPILING * compiled + 2 * sum(t.seconds for t in stage)
        plan.append((arguments, allowed, {"fresh": "1"} if compiled else {}))
    try:
        for arguments, allowed, variables in plan:
            by = _noticed(copy, arguments, allowed, variables)
            if by:
                return "killed", by
    finally:
        target.write_text(original)
    return _SURVIVED, ""


def _noticed(copy: Copy, arguments: list[str], allowed: float, variables: dict[str, str]) -> str:
    """Return which test fails, and fails again by itself; nothing if none does."""
    passed_again: list[str] = []
    while True:
        status, printed = copy.pytest(["-x", "-m", "", *arguments, *passed_again], allowed, **variables)
        if status < 0:
            return "took too long, or crashed"
        if status in (0, 5) or ("NUMBA_DISABLE_JIT" in variables and any(word in printed for word in _PLAIN_ONLY)):
            return ""
        failed = [
            x.split(" - ")[0].split(" ", 1)[1] for x in printed.splitlines() if x.startswith(("FAILED ", "ERROR "))
        ]
        if not failed or "::" not in failed[0]:
            return failed[0] if failed else f"pytest ended with {status}"
        # On a busy machine a test about time may fail once.
        alone = [a for a in arguments if a.startswith("--timeout")]
        if copy.pytest(["-m", "", *alone, failed[0]], allowed, **variables)[0] not in (0, 5):
            return failed[0]
        passed_again.append(f"--deselect={failed[0]}")


def _all_mutants() -> list[Mutant]:
    found: list[Mutant] = []
    for room in ROOMS:
        path = ROOT / "env2mjcf" / room
        for module in [path] if path.is_file() else sorted(path.rglob("*.py")):
            found += mutants(ROOT, module)
    return found


def _equivalent() -> dict[str, str]:
    with (HERE / "equivalent.tsv").open(newline="") as file:
        return {row[0]: row[1] for row in csv.reader(file, delimiter="\t", quoting=csv.QUOTE_NONE) if len(row) == 2}


def _room(mutant: Mutant) -> str:
    return mutant.module.removeprefix("env2mjcf/").split("/")[0].removesuffix(".py")


def written(sample: list[Mutant], verdicts: dict[str, dict[str, str]], seed: int, total: int) -> str:
    """Return the page of results."""
    equivalent = _equivalent()
    done = [m for m in sample if m.name in verdicts]
    lines = ["# Mutants", "", f"Made by `python tests/mutants/run.py --seed {seed}` on {datetime.date.today()}: "
             f"{len(done)} of {total:,} small changes of the program, at random.", "",
             "| room | changes | noticed | equivalent | left |", "|---|---|---|---|---|"]  # fmt: skip
    kinds: dict[str, Counter[str]] = {}
    for mutant in done:
        verdict = verdicts[mutant.name]["verdict"]
        kind = "equivalent" if verdict == _SURVIVED and mutant.name in equivalent else verdict
        for room in (_room(mutant), "all"):
            kinds.setdefault(room, Counter())[kind] += 1
    for room in [*sorted(k for k in kinds if k != "all"), "all"]:
        of = kinds.get(room, Counter())
        lines.append(f"| {room} | {of.total()} | {of['killed']} | {of['equivalent']} | {of[_SURVIVED]} |")
    of = kinds.get("all", Counter())
    counted = of.total() - of["equivalent"]
    lines += ["", f"Of those that are not equivalent, {100 * of['killed'] / max(counted, 1):.1f} % were noticed "
              f"({of['killed']} of {counted}).", "", "## Left", ""]  # fmt: skip
    left = [m for m in done if verdicts[m.name]["verdict"] == _SURVIVED]
    lines += [f"* `{m.name}` (line {m.line})" for m in left if m.name not in equivalent] or ["None."]
    lines += ["", "## Equivalent", ""]
    lines += [f"* `{m.name}`: {equivalent[m.name]}" for m in left if m.name in equivalent] or ["None."]
    return "\n".join(lines) + "\n"


def main() -> int:
    """Run, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=120, help="how many changes")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin no change after so long")
    parser.add_argument("--seed", type=int, default=17)
    parser.add_argument("--most", type=float, default=40.0, help="seconds of tests that are tried, and again of others")
    parser.add_argument("--only", type=re.compile, default=re.compile(""), help="try those of them whose names match")
    parser.add_argument("--again", action="store_true", help="try those again that no test had noticed")
    parser.add_argument("--fresh", action="store_true", help="forget what earlier runs have found")
    parser.add_argument("--list", action="store_true", help="show the sample and what is known of it, run nothing")
    parser.add_argument("--folder", type=Path, default=ROOT / "build/mutants", help="where a run is kept")
    parser.add_argument("--out", type=Path, default=HERE / "results.md")
    options = parser.parse_args()
    end = time.monotonic() + 60 * options.minutes
    if options.fresh:
        shutil.rmtree(options.folder, ignore_errors=True)
    options.folder.mkdir(parents=True, exist_ok=True)
    everything = _all_mutants()
    sample = sorted(everything, key=lambda m: m.rank(options.seed))[: options.count]
    kept = options.folder / "verdicts.jsonl"
    verdicts: dict[str, dict[str, str]] = {}
    for line in kept.read_text().splitlines() if kept.exists() else ():
        verdicts[json.loads(line)["name"]] = json.loads(line)
    if not options.list:
        copy = Copy(options.folder.resolve())
        tests = traced(copy, options.folder)
        for i, mutant in enumerate(sample):
            known = verdicts.get(mutant.name, {}).get("verdict")
            if known == "killed" or (known == _SURVIVED and not options.again) or not options.only.search(mutant.name):
                continue
            if time.monotonic() > end:
                break
            start = time.monotonic()
            verdict, by = tried(mutant, copy, tests, options.most)
            found = {"name": mutant.name, "verdict": verdict, "by": by}
            verdicts[mutant.name] = found
            with kept.open("a") as file:
                file.write(json.dumps(found) + "\n")
            print(
                f"{i + 1}/{len(sample)} {verdict} in {time.monotonic() - start:.0f} s: {mutant.name} {by}", flush=True
            )
        options.out.write_text(written(sample, verdicts, options.seed, len(everything)))
    for mutant in sample if options.list else ():
        found = verdicts.get(mutant.name, {})
        print(f"{found.get('verdict', 'open'):8} {mutant.name} (line {mutant.line}) {found.get('by', '')}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
