"""Markdown: tables, marks, and a part of a page that is written by hand."""

from __future__ import annotations

import collections
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

BEGIN, END = "<!-- written by hand: begin -->", "<!-- written by hand: end -->"
_EMPTY = "\n\n## Where the time goes\n\n"


@dataclass(frozen=True, slots=True)
class Check:
    """A figure that has a mark: what is asked for, of which scene, what it is, and the most that it may be."""

    what: str
    scene: str
    value: float
    most: float

    @property
    def met(self) -> bool:
        """Whether it is."""
        return self.value <= self.most


def summary(checks: Sequence[Check]) -> list[str]:
    """Return a table of what is met: a line for each kind of mark, with all the scenes that miss it."""
    kinds: dict[str, list[Check]] = collections.defaultdict(list)
    for check in checks:
        kinds[check.what].append(check)
    rows = []
    for what, found in kinds.items():
        missed = sorted((c for c in found if not c.met), key=_by_how_much, reverse=True)
        names = ", ".join(f"{c.scene} ({c.value:.3g}, mark {c.most:g})" for c in missed)
        rows.append((what, f"{len(found) - len(missed)} of {len(found)}", names))
    return table(("mark", "met", "missed by"), rows)


def _by_how_much(check: Check) -> float:
    return check.value / check.most if check.most else check.value


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a Markdown table; all columns but the first one are aligned to the right."""
    cells = [header, ["---", *["---:"] * (len(header) - 1)], *rows]
    return ["| " + " | ".join(c.replace("_", "\\_") for c in row) + " |" for row in cells]


def mark(ratio: float, most: float) -> str:
    """Return a mark, and whether it is met or by how much it is missed."""
    return f"{most:g}, " + ("met" if ratio <= most else f"**missed by {100 * (ratio / most - 1):.0f} %**")


def micro(seconds: float) -> str:
    """Return microseconds of three digits."""
    value = 1e6 * seconds
    return f"{value:.2f}" if value < 10 else f"{value:.1f}" if value < 100 else f"{value:.0f}"


def by_hand(path: Path) -> str:
    """Return what stands between the markers of a page, markers included; an empty section if there is none.

    Raises:
        SystemExit: The page has lost one of its markers.
    """
    text = path.read_text(encoding="utf-8") if path.exists() else f"{BEGIN}{_EMPTY}{END}"
    if text.count(BEGIN) != 1 or text.count(END) != 1:
        raise SystemExit(f"{path.name} needs the lines {BEGIN} and {END}, once each: what is between them is kept")
    return BEGIN + text.split(BEGIN)[1].split(END)[0] + END
