"""Write the tables of converted scenes: `python benchmarks/table.py [--check] [models] [corpus]`.

`models` is the table between two comments in README.md: every scene of `models/`. `corpus` is `benchmarks/corpus.md`:
every real scene of the folder that ENV2MJCF_CORPUS names. Without a name, both are written, the second one where the
corpus is present. `--check` writes nothing, and compares all but the times; its exit status is 1 where they differ.
"""

from __future__ import annotations

import argparse
import collections
import csv
import difflib
import os
import re
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import env2mjcf

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / "README.md"
CORPUS_TABLE = ROOT / "benchmarks" / "corpus.md"
BEGIN, END = "<!-- models table begin -->", "<!-- models table end -->"

HEADER = ("scene", "dialect", "bodies", "DOF", "geoms", "conversion", "diagnostics")
ALIGNMENT = ("---", "---", "---:", "---:", "---:", "---:", "---")
TIME = HEADER.index("conversion")
LEGEND = (
    "Bodies: links of robots + obstacles. Geoms: those that collide, with `collision=\"auto\"`. Conversion: reading, "
    "geometry, MJCF and the check by MuJoCo, without the geometry cache."
)  # fmt: skip
RUNS = 3


@dataclass(frozen=True, slots=True)
class Case:
    """One scene of a table.

    Attributes:
        name: What the table calls it.
        path: The file to convert.
        options: What the conversion needs to be told.
    """

    name: str
    path: Path
    options: dict[str, Any] = field(default_factory=dict)


def model_cases() -> Iterator[Case]:
    """Yield the scenes of `models/`: the problem file where there is one, else the env file and its query."""
    for folder in sorted((ROOT / "models").iterdir()):
        problem, env = (folder / f"{folder.name}{suffix}" for suffix in (".xml", ".env"))
        if problem.exists():
            yield Case(folder.name, problem)
        elif env.exists():
            yield Case(folder.name, env, {"query": env.with_suffix(".query")})


def corpus_cases(corpus: Path) -> Iterator[Case]:
    """Yield the scenes that `scenes.tsv` lists."""
    with (corpus / "scenes.tsv").open(newline="") as file:
        for row in csv.DictReader(file, delimiter="\t"):
            folder = corpus / "scenes" / row["name"]
            options: dict[str, Any] = {}
            if row["robot"] != "-":
                options["robots"] = [folder / name for name in row["robot"].split(",")]
            # The meshes of this one lie in a folder beside its own.
            if row["name"].startswith("ros2-inlet"):
                options["allow_outside"] = True
            yield Case(row["name"], folder / row["env"], options)


def row(case: Case, runs: int) -> tuple[str, ...]:
    """Convert a scene and return its line of the table; the time is the best of several runs."""
    seconds: list[float] = []
    try:
        for _ in range(runs):
            with tempfile.TemporaryDirectory() as out:
                start = time.perf_counter()
                result = env2mjcf.convert(case.path, out, cache=False, **case.options)
                seconds.append(time.perf_counter() - start)
    except env2mjcf.Env2MjcfError as error:
        dialect, bodies = _read(case)
        return (case.name, dialect, bodies, "", "", "", f"does not convert: {_reason(error)}")
    report = result.report
    bodies = f"{report.links} + {report.obstacles}"
    found = _codes(result.diagnostics)
    return (case.name, report.dialect, bodies, str(report.dof), str(report.geoms), _duration(min(seconds)), found)


def _read(case: Case) -> tuple[str, str]:
    """Return dialect and bodies of a scene that reads and does not convert."""
    options = {k: v for k, v in case.options.items() if k in ("robots", "allow_outside")}
    try:
        environment = env2mjcf.read(case.path, **options)
    except env2mjcf.Env2MjcfError:
        return "", ""
    links = sum(len(m.bodies) for m in environment.robots)
    return environment.dialect.value, f"{links} + {sum(len(m.bodies) for m in environment.obstacles)}"


def _codes(diagnostics: Iterable[env2mjcf.Diagnostic]) -> str:
    """Return the codes of diagnostics and how often each occurs, what matters most first."""
    counts: dict[env2mjcf.Severity, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    for diagnostic in diagnostics:
        counts[diagnostic.severity][diagnostic.code] += 1
    parts = [
        f"{severity}: " + ", ".join(f"{code} ×{n}" if n > 1 else code for code, n in sorted(counts[severity].items()))
        for severity in (env2mjcf.Severity.WARNING, env2mjcf.Severity.INFO)
        if counts[severity]
    ]
    return "; ".join(parts)


def _reason(error: env2mjcf.Env2MjcfError) -> str:
    """Return code and gist of an error, without the folders of this machine."""
    missing = re.findall("no mesh file '([^']+)'", error.diagnostic.message)
    gist = f"missing {', '.join(Path(m).name for m in missing)}" if missing else error.diagnostic.message
    return f"{error.code}, {gist.splitlines()[0].split('; ')[0]}"


def _duration(seconds: float) -> str:
    return f"{seconds:.2g} s" if seconds >= 1 else f"{1000 * seconds:.0f} ms"


def table(rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a Markdown table."""
    cells = [HEADER, ALIGNMENT, *([_escaped(c) for c in r] for r in rows)]
    return [f"| {' | '.join(line)} |" for line in cells]


def _escaped(text: str) -> str:
    return "".join(f"\\{c}" if c in "|_*<" else c for c in text)


def progress(cases: Iterable[Case], runs: int) -> Iterator[tuple[str, ...]]:
    """Yield the rows of scenes, and tell a terminal which one it is."""
    from tqdm import tqdm

    for case in tqdm(list(cases), unit="scene", disable=None, leave=False):
        yield row(case, runs)


def models_text(runs: int = RUNS) -> str:
    """Return README.md with its table made anew.

    Raises:
        SystemExit: README.md has no place for it.
    """
    text = README.read_text(encoding="utf-8")
    if text.count(BEGIN) != 1 or text.count(END) != 1 or text.index(END) < text.index(BEGIN):
        raise SystemExit(f"README.md needs the lines {BEGIN} and {END}, once each, for the table to stand between")
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    lines = "\n".join(table(progress(model_cases(), runs)))
    return f"{before}{BEGIN}\n{lines}\n\n{LEGEND}\n{END}{after}"


def corpus_text(corpus: Path, runs: int = 1) -> str:
    """Return `benchmarks/corpus.md` made anew."""
    rows = list(progress(corpus_cases(corpus), runs))
    whole = sum(1 for r in rows if r[TIME])
    title = "# Real scenes\n\nMade by `benchmarks/table.py`; `tests/test_readme.py` compares all but the times."
    summary = f"{len(rows)} scenes as their authors published them; {whole} convert."
    return "\n".join([title, "", f"{summary} {LEGEND}", "", *table(rows), ""])


def without_times(text: str) -> list[str]:
    """Return the lines of a text, its tables without their times."""
    lines: list[str] = []
    for line in text.splitlines():
        cells = line.split(" | ")
        if line.startswith("| ") and len(cells) == len(HEADER):
            cells[TIME] = "time"
        lines.append(" | ".join(cells))
    return lines


def settle(path: Path, text: str, *, check: bool) -> bool:
    """Write a file, or compare it; return whether all is well."""
    old = path.read_text(encoding="utf-8") if path.exists() else ""
    if not check:
        path.write_text(text, encoding="utf-8")
        print(f"wrote {path.name}")
        return True
    difference = list(difflib.unified_diff(without_times(old), without_times(text), path.name, "now", lineterm="", n=0))
    print("\n".join(difference) if difference else f"{path.name} is up to date")
    return not difference


def main(arguments: Sequence[str] | None = None) -> int:
    """Write or check the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="*", metavar="TABLE", help="models or corpus; both by default")
    parser.add_argument("--check", action="store_true", help="compare and write nothing")
    chosen = parser.parse_args(arguments)
    unknown = set(chosen.tables) - {"models", "corpus"}
    if unknown:
        parser.error(f"no such table: {', '.join(sorted(unknown))}; choose models or corpus")
    folder = os.environ.get("ENV2MJCF_CORPUS")
    if "corpus" in chosen.tables and not folder:
        parser.error("the table of the corpus needs ENV2MJCF_CORPUS to name its folder")
    well = True
    if "models" in chosen.tables or not chosen.tables:
        well &= settle(README, models_text(1 if chosen.check else RUNS), check=chosen.check)
    if folder and ("corpus" in chosen.tables or not chosen.tables):
        well &= settle(CORPUS_TABLE, corpus_text(Path(folder)), check=chosen.check)
    return 0 if well else 1


if __name__ == "__main__":
    sys.exit(main())
