"""Parts of pages that are made when the site is built: the table of options, and what every verb says of itself."""

from __future__ import annotations

import dataclasses
import os
import re
import subprocess
import sys
from collections.abc import Callable
from inspect import getdoc
from pathlib import Path

from env2mjcf.cli.main import VERBS
from env2mjcf.options import Limits, Options

ROOT = Path(__file__).resolve().parent.parent
WIDTH = 100


def options() -> str:
    """Return the table of options."""
    return _table(Options, "option")


def limits() -> str:
    """Return the table of limits."""
    return _table(Limits, "limit")


def verbs() -> str:
    """Return a section for every verb: its summary, and its `--help`."""
    sections = [f"## env2mjcf\n\n```text\n{_help()}\n```\n"]
    for verb, (_, _, summary) in VERBS.items():
        sections.append(f"## {verb}\n\n{summary[0].upper()}{summary[1:]}.\n\n```text\n{_help(verb)}\n```\n")
    return "\n".join(sections)


def _table(described: type, head: str) -> str:
    meanings = _attributes(described)
    values = described()
    rows = [
        f"| `{f.name}` | {_code(f.type)} | {_code(_default(getattr(values, f.name)))} | {meanings[f.name]} |"
        for f in dataclasses.fields(described)
    ]
    return "\n".join([f"| {head} | type | default | meaning |", "|---|---|---|---|", *rows])


def _attributes(described: type) -> dict[str, str]:
    """Return what a class's docstring says of its attributes."""
    text = (getdoc(described) or "").split("Attributes:\n")[1]
    return {
        name: " ".join(meaning.split())
        for name, meaning in re.findall(r"^ +(\w+): (.+(?:\n {8,}.+)*)", text, re.MULTILINE)
    }


def _default(value: object) -> str:
    return "Limits()" if isinstance(value, Limits) else repr(value)


def _code(value: object) -> str:
    text = str(value).replace("|", "\\|")
    return f"`{text}`"


def _help(*verb: str) -> str:
    environment = {
        **os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": str(WIDTH), "NO_COLOR": "1", "TERM": "dumb"
    }  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-m", "env2mjcf", *verb, "--help"], env=environment, capture_output=True, text=True, check=True
    )
    return "\n".join(line.rstrip() for line in done.stdout.strip().splitlines())


PARTS: dict[str, Callable[[], str]] = {"options": options, "limits": limits, "verbs": verbs}
