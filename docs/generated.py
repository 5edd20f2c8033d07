"""Parts of pages that are made when the site is built: the table of options, and what every verb says of itself."""

from __future__ import annotations

import dataclasses
import os
import re
import subprocess
import sys
from collections.abc import Callable
from inspect import getdoc
from os import PathLike
from pathlib import Path
from types import NoneType
from typing import Any, Literal, get_args, get_origin, get_type_hints

from env2mjcf.cli.main import VERBS
from env2mjcf.limits import Limits
from env2mjcf.options import Options

ROOT = Path(__file__).resolve().parent.parent
WIDTH = 90


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
    hints = get_type_hints(described)
    rows = [
        f"| `{f.name}` | {_kind(hints[f.name])} | {_code(_default(getattr(values, f.name)))} | {meanings[f.name]} |"
        for f in dataclasses.fields(described)
    ]
    return "\n".join([f"| {head} | type | default | meaning |", "|---|---|---|---|", *rows])


def _attributes(described: type) -> dict[str, str]:
    """Return what a class's docstring says of its attributes."""
    text = (getdoc(described) or "").split("Attributes:\n")[1]
    found = re.findall(r"^ +(\w+): (.+(?:\n {8,}.+)*)", text, re.MULTILINE)
    return {name: " ".join(meaning.split()) for name, meaning in found}


def _kind(hint: Any) -> str:
    """Return what an option can be, in words; alternatives by commas."""
    parts = get_args(hint)
    if get_origin(hint) is Literal:
        return ", ".join(_code(repr(value)) for value in parts)
    if PathLike in map(get_origin, parts):
        return "path" if NoneType not in parts else "path, `None`"
    if NoneType in parts:
        return f"{', '.join(_kind(part) for part in parts if part is not NoneType)}, `None`"
    if get_origin(hint) is tuple and Ellipsis in parts:
        return f"any number of: {_kind(parts[0])}"
    if get_origin(hint) is tuple:
        return ", ".join(_kind(part) for part in parts)
    return _code(hint.__name__)


def _default(value: object) -> str:
    return "Limits()" if isinstance(value, Limits) else repr(value)


def _code(value: object) -> str:
    text = str(value).replace("|", "\\|")
    return f"`{text}`"


def _help(*verb: str) -> str:
    plain = {"PYTHONPATH": str(ROOT), "COLUMNS": str(WIDTH), "NO_COLOR": "1", "TERM": "dumb"}
    environment = {**os.environ, **plain}
    done = subprocess.run(
        [sys.executable, "-m", "env2mjcf", *verb, "--help"], env=environment, capture_output=True, text=True, check=True
    )
    return "\n".join(line.rstrip() for line in done.stdout.strip().splitlines())


PARTS: dict[str, Callable[[], str]] = {"options": options, "limits": limits, "verbs": verbs}
