"""Path files of all ages: configurations, or world poses of every link (docs/format/companions.md)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..diagnostics import DiagnosticLog
from ..errors import Span
from ..transforms import Array
from .lexer import parse_number
from .rows import Extra, Line, Row, fitting, judge_rows, number_lines, parse_row, regrouped, row_text
from .source import Source

ALL_ROBOTS = -1
"""Index of a row that holds the configurations of all robots, one after the other."""

CURRENT, TURNS = 2012, 20001125
"""Versions that are written: the newest planner's, and dialect A's."""

# The last is what dialect A's source calls legacy; rows of both may be poses of links.
_LINK_POSES, _LEGACY = 20001022, 20001025
OF_TURNS = (_LINK_POSES, _LEGACY, TURNS)
"""Versions of dialect A's time, which counts angles in turns."""
_KNOWN = (*OF_TURNS, CURRENT)
_HEADER = "VIZMO_PATH_FILE   Path Version"
_HEADER_WORDS = re.compile(r"\s*VIZMO_PATH_FILE\s+Path\s+Version\s+([0-9]{1,9})\s*", re.IGNORECASE)
_WORD = re.compile(r"\S+")
_POSE = 6


@dataclass(frozen=True, slots=True, eq=False)
class PathFile:
    """A path file in its own numbers.

    Attributes:
        version: What its header says.
        rows: Its configurations; none where it holds poses.
        poses: (k, links, 6) poses `x y z rx ry rz`, angles about fixed axes in turns; None where it holds
            configurations.
        lines: The line that each configuration begins on.
    """

    version: int
    rows: tuple[Row, ...]
    poses: Array | None
    lines: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class _Head:
    version: int
    links: int
    count: int
    links_span: Span
    count_span: Span
    end: int


def begins_as_path(text: str) -> bool:
    """Whether a text begins as path files do."""
    return text.lstrip("\ufeff").lstrip()[:15].upper() == "VIZMO_PATH_FILE"


def is_path(source: Source) -> bool:
    """Whether a file is meant as a path."""
    return begins_as_path(source.text)


def read_path(source: Source, dofs: Sequence[int], links: Sequence[int], log: DiagnosticLog) -> PathFile:
    """Read a path file of any version.

    Rows decide what they are: the version and the second line only settle what could be either. A declared number of
    configurations is compared with the rows, not believed.

    Args:
        source: The file.
        dofs: Number of degrees of freedom of each robot.
        links: How many poses a configuration may have: links of robot 0, with and without a fixed base.
        log: Where findings go.

    Raises:
        FormatError: It is not a path file, is cut off, or belongs to another robot.
    """
    head = _read_head(source, log)
    lines = number_lines(source, log, head.end)
    if not lines and head.count:
        message = f"line 3 declares {head.count} configurations, and none follows"
        log.fail("CFG514", source.path, message, hint="is the file cut off?", span=head.count_span)
    found = _poses(source, head, lines, links, log) if _holds_poses(head, lines, dofs, links) else None
    if found is None:
        found = _configurations(source, head, lines, dofs, log)
    if len(found.lines) != head.count:
        message = f"line 3 declares {head.count} configurations, and {len(found.lines)} follow"
        log.warn("CFG514", source.path, message, hint="is the file cut off?", span=head.count_span)
    return found


def path_text(rows: Iterable[Sequence[float]], version: int = CURRENT, index: int | None = None) -> str:
    """Return a path file, in the exact words that the planner reads, with 17 digits.

    Args:
        rows: Configurations in the file's own numbers.
        version: 2012, or 20001125 for dialect A, whose angles are turns.
        index: The robot's index, written in front of each configuration; None writes none.
    """
    lines = [row_text(row, index) for row in rows]
    return "\n".join([f"{_HEADER} {version}", "1", str(len(lines)), *lines]) + "\n"


def _read_head(source: Source, log: DiagnosticLog) -> _Head:
    lines = iter((start, text) for start, text in source.lines() if text.strip())
    start, text = next(lines, (0, ""))
    match = _HEADER_WORDS.fullmatch(text)
    if match is None:
        message = f"found {text.strip()[:60]!r}; expected '{_HEADER} {CURRENT}'"
        hint = "is it a path file, and whole?"
        log.fail("CFG510", source.path, message, hint=hint, span=source.span(start, start + len(text)))
    version = int(match[1])
    if text.rstrip() != f"{_HEADER} {version}":
        message = f"the newest planner reads nothing but the exact line '{_HEADER} {CURRENT}'"
        hint = "write three blanks behind VIZMO_PATH_FILE, and nothing in front"
        log.warn("CFG511", source.path, message, hint=hint, span=source.span(start))
    if version not in _KNOWN:
        known = ", ".join(map(str, _KNOWN))
        message = f"path version {version}; known are {known}"
        span = source.span(start + match.start(1), start + match.end(1))
        log.warn("CFG512", source.path, message, hint="it is read as its rows suggest", span=span)
    words = _words_behind(source, start + len(text))
    links, links_span, end = _count(source, words, "number of links of a pose, or 1", log)
    count, count_span, end = _count(source, words, "number of configurations", log)
    return _Head(version, links, count, links_span, count_span, end)


def _words_behind(source: Source, start: int) -> list[re.Match[str]]:
    """Return the next two words."""
    first = _WORD.search(source.text, start)
    second = _WORD.search(source.text, first.end()) if first else None
    return [m for m in (first, second) if m]


def _count(source: Source, words: list[re.Match[str]], what: str, log: DiagnosticLog) -> tuple[int, Span, int]:
    if not words:
        place = source.span(max(0, len(source.text.rstrip()) - 1))
        hint = "is the file cut off?"
        log.fail("CFG515", source.path, f"the file ends where the {what} was expected", hint=hint, span=place)
    match = words.pop(0)
    span = source.span(match.start(), match.end())
    value = parse_number(match.group())
    if value is None or value < 0 or not value.is_integer():
        hint = "line 2 holds a number of links, line 3 a number of configurations"
        log.fail("CFG515", source.path, f"expected the {what}, found {match.group()[:60]!r}", hint=hint, span=span)
    return int(value), span, match.end()


def _holds_poses(head: _Head, lines: Sequence[Line], dofs: Sequence[int], links: Sequence[int]) -> bool:
    if not lines or any(len(line.numbers) != _POSE for line in lines):
        return False
    if head.links > 1 and head.version in (_LINK_POSES, _LEGACY):
        return True
    # A rigid body's pose is its configuration.
    return all(parse_row(line.numbers, dofs) is None for line in lines) and any(
        len(lines) % n == 0 for n in links if n > 1
    )


def _poses(source: Source, head: _Head, lines: Sequence[Line], links: Sequence[int], log: DiagnosticLog) -> PathFile:
    n = head.links if head.links in links else next((n for n in links if n > 1 and len(lines) % n == 0), 0)
    if head.links not in links:
        listed = " or ".join(map(str, sorted({n for n in links if n})))
        if head.links > 1 or not n:
            message = f"poses of {head.links} links; expected {listed or 'none'}, the links of the scene's robot"
            log.fail("CFG517", source.path, message, hint="is it the path of another scene?", span=head.links_span)
        message = f"line 2 says {head.links}, but each configuration is {n} poses"
        log.warn("CFG513", source.path, message, hint=f"write {n}", span=head.links_span)
    if len(lines) % n:
        message = f"the last configuration has {len(lines) % n} poses; expected {n}, one for each link"
        log.fail("CFG516", source.path, message, hint="is the file cut off?", span=lines[-1].span)
    poses = np.array([line.numbers for line in lines], dtype=np.float64).reshape(-1, n, _POSE)
    return PathFile(head.version, (), poses, tuple(line.span.line for line in lines[::n]))


def _configurations(
    source: Source, head: _Head, lines: Sequence[Line], dofs: Sequence[int], log: DiagnosticLog
) -> PathFile:
    if head.links != 1 and lines:
        message = f"line 2 says {head.links}, but each row is a configuration"
        log.warn("CFG513", source.path, message, hint="write 1", span=head.links_span)
    if not _all_at_once(lines, dofs):
        lines = regrouped(lines, dofs)
        rows = [fitting(source, line, dofs, log, "path") for line in lines]
    else:
        total = sum(dofs)
        behind_index = [line.numbers[len(line.numbers) - total :] for line in lines]
        rows = [
            Row(ALL_ROBOTS, numbers, len(line.numbers) > total, Extra.NOTHING)
            for line, numbers in zip(lines, behind_index, strict=True)
        ]
    judge_rows(source, zip(rows, (line.span for line in lines), strict=True), log)
    return PathFile(head.version, tuple(rows), None, tuple(line.span.line for line in lines))


def _all_at_once(lines: Sequence[Line], dofs: Sequence[int]) -> bool:
    """Whether rows hold the numbers of several robots one after the other, behind a 0 or not.

    Those of two equal robots could be positions and velocities of one; only nonholonomic robots have these.
    """
    total = sum(dofs)
    return len(dofs) > 1 and all(
        len(line.numbers) == total or (len(line.numbers) == total + 1 and line.numbers[0] == 0) for line in lines
    )
