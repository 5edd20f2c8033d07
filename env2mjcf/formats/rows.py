"""Rows of numbers that are configurations, as path files hold them, and query files of all ages, which hold no more.

What the files look like: docs/format/companions.md.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from ..diagnostics import DiagnosticLog
from ..errors import Span
from ..limits import LARGEST, Limits
from ..model.environment import Task
from .lexer import number_hint, parse_number
from .source import Source

_WORD = re.compile(r"\S+")
_COMMENT = re.compile(r"#|//")
# Dialect A's InfoCfg wrote three numbers behind some configurations.
_LEGACY_INFO_FIELDS = 3


class Extra(StrEnum):
    """What follows a configuration and is not used."""

    NOTHING = "nothing"
    VELOCITIES = "velocities"
    INFO_FIELDS = "info fields"


@dataclass(frozen=True, slots=True)
class Row:
    """One configuration as it was written.

    Attributes:
        robot: Index of the robot.
        configuration: As long as the robot has degrees of freedom.
        indexed: Whether the robot's index stands in front.
        extra: What stands behind.
    """

    robot: int
    configuration: tuple[float, ...]
    indexed: bool
    extra: Extra


@dataclass(frozen=True, slots=True)
class Line:
    """The numbers of a line, and its place."""

    numbers: tuple[float, ...]
    span: Span


def coordinate(word: str) -> float | None:
    """Return the number that a word is; None where it is not one, or too large to be computed with."""
    value = parse_number(word)
    return value if value is not None and abs(value) <= LARGEST else None


def coordinate_hint(word: str) -> str:
    """Return what to do about a word that is not a coordinate; empty where it does not look like a number."""
    too_large = parse_number(word) is not None and coordinate(word) is None
    return f"numbers must not be larger than {LARGEST:g}" if too_large else number_hint(word)


def split_row(numbers: Sequence[float], dofs: Sequence[int]) -> tuple[int, tuple[float, ...]] | None:
    """Return (robot, configuration) of one row, or None where the row fits no robot."""
    row = parse_row(numbers, dofs)
    return None if row is None else (row.robot, row.configuration)


def parse_row(numbers: Sequence[float], dofs: Sequence[int]) -> Row | None:
    """Tell what the numbers of one row are, or None where they fit no robot."""
    if not dofs or not numbers:
        return None
    plain = _extra(len(numbers), dofs[0], legacy=True)
    # A lone robot's exact width needs no index; several robots always have one.
    if plain is Extra.NOTHING and len(dofs) == 1:
        return Row(0, tuple(numbers), False, plain)
    first = numbers[0]
    if first.is_integer() and 0 <= first < len(dofs):
        robot = int(first)
        extra = _extra(len(numbers) - 1, dofs[robot], legacy=False)
        if extra is not None:
            return Row(robot, tuple(numbers[1 : 1 + dofs[robot]]), True, extra)
    return None if plain is None else Row(0, tuple(numbers[: dofs[0]]), False, plain)


def number_lines(source: Source, log: DiagnosticLog, start: int = 0) -> list[Line]:
    """Split the text from `start` on into rows of numbers.

    A word ends the list, as it ends the planner's stream extraction.

    Raises:
        FormatError: A word looks like a number that went wrong, or the text begins with a word.
    """
    lines: list[Line] = []
    for begin, text in source.lines():
        skipped = max(0, min(start - begin, len(text)))
        numbers: list[float] = []
        first = begin, begin
        for match in _WORD.finditer(_COMMENT.split(text, maxsplit=1)[0], skipped):
            value = coordinate(match.group())
            if value is None:
                place = source.span(begin + match.start(), begin + match.end())
                _end_list(source, match.group(), place, log, empty=not lines and not numbers)
                return [*lines, Line(tuple(numbers), source.span(*first))] if numbers else lines
            if not numbers:
                first = begin + match.start(), begin + match.end()
            numbers.append(value)
        if numbers:
            lines.append(Line(tuple(numbers), source.span(*first)))
            check_rows(source, len(lines), log, source.span(begin))
    return lines


def check_rows(source: Source, count: int, log: DiagnosticLog, span: Span) -> None:
    """Refuse a file with more configurations or nodes than its limits allow."""
    if count > source.limits.rows:
        message = f"{source.path} has more than {source.limits.rows} configurations; no more are read"
        log.fail("ENV182", source.path, message, hint=Limits.hint("rows"), span=span)


def _extra(width: int, dof: int, *, legacy: bool) -> Extra | None:
    # Nothing behind a robot without degrees of freedom is nothing, not its velocities.
    known = {2 * dof: Extra.VELOCITIES, dof: Extra.NOTHING}
    if legacy:
        known.setdefault(dof + _LEGACY_INFO_FIELDS, Extra.INFO_FIELDS)
    return known.get(width)


def _end_list(source: Source, word: str, place: Span, log: DiagnosticLog, *, empty: bool) -> None:
    # What looks like a number is one that went wrong, not text behind the list.
    hint = coordinate_hint(word)
    if empty or hint or word[0] in "+-.0123456789":
        hint = hint or "write one configuration a line, '#' before comments"
        log.fail("CFG502", source.path, f"expected a number, found {word[:60]!r}", hint=hint, span=place)
    hint = "begin comment lines with '#'"
    log.warn("CFG501", source.path, "text ends the list of configurations here", hint=hint, span=place)


def regrouped(lines: Sequence[Line], dofs: Sequence[int]) -> Sequence[Line]:
    """Read numbers that run over lines, all configurations of one width, as the planner's stream extraction does.

    Lines whose first fits a robot, or that cannot be cut so, are returned as they are.
    """
    d = dofs[0] if dofs else 0
    # A first line that is too long belongs to another robot; only one that is too short goes on in the next.
    if not lines or parse_row(lines[0].numbers, dofs) is not None or len(lines[0].numbers) > d:
        return lines
    flat = [(x, line.span) for line in lines for x in line.numbers]
    for width in (d, d + 1, 2 * d + 1, 2 * d):
        if len(flat) < 2 * width or len(flat) % width:
            continue
        cut = [flat[i : i + width] for i in range(0, len(flat), width)]
        found = [Line(tuple(x for x, _ in piece), piece[0][1]) for piece in cut]
        if all(parse_row(line.numbers, dofs) is not None for line in found):
            return found
    return lines


def fitting(source: Source, line: Line, dofs: Sequence[int], log: DiagnosticLog, what: str) -> Row:
    """Return the configuration of a line, or fail where it fits no robot; the message calls the file `what`."""
    row = parse_row(line.numbers, dofs)
    if row is None:
        expected = " or ".join(f"{d} (robot {i})" for i, d in enumerate(dofs)) or "none: the scene has no robot"
        message = (
            f"a row of {len(line.numbers)} numbers; expected as many as a robot has degrees of freedom, {expected}, "
            "behind the robot's index or, for robot 0, without"
        )
        log.fail("CFG504", source.path, message, hint=f"is it the {what} of another scene, or cut off?", span=line.span)
    return row


def judge_rows(source: Source, rows: Iterable[tuple[Row, Span]], log: DiagnosticLog) -> None:
    """Report what is doubtful about rows that each fit: different forms, and numbers that are dropped."""
    listed = list(rows)
    if not listed:
        return
    first = listed[0][0]
    odd = next((span for row, span in listed if (row.indexed, row.extra) != (first.indexed, first.extra)), None)
    if odd is not None:
        hint = "give every row, or none, a robot index and velocities"
        log.warn("CFG506", source.path, "this row is not built like the first one", hint=hint, span=odd)
    dropped = next(((row, span) for row, span in listed if row.extra is not Extra.NOTHING), None)
    if dropped is not None:
        row, span = dropped
        log.info("CFG507", source.path, f"{row.extra} behind the configurations are not used", span=span)


def row_text(configuration: Iterable[float], index: int | None = None) -> str:
    """Return a configuration as the planner writes it: 17 digits, so that it reads back as the same doubles.

    Args:
        configuration: The file's own numbers.
        index: The robot's index, written in front; None writes none.
    """
    numbers = " ".join(f"{value:25.16e}" for value in configuration)
    return numbers if index is None else f"{index} {numbers}"


def read_query(source: Source, dofs: Sequence[int], log: DiagnosticLog) -> tuple[Task, ...]:
    """Read a query file.

    One configuration a line, or numbers running over lines; a leading robot index is accepted in every dialect,
    velocities (as many numbers again) and dialect A's three info fields are dropped. Text ends the list.

    Args:
        source: The file.
        dofs: Number of degrees of freedom of each robot.
        log: Where findings go.

    Returns:
        One task for each robot that has configurations, in the order of the robots.

    Raises:
        FormatError: A row fits no robot, or the file has no row.
    """
    lines = regrouped(number_lines(source, log), dofs)
    if not lines:
        message = f"{source.path} holds no configuration; expected rows of numbers"
        log.fail("CFG503", source.path, message, hint="write one configuration a line", span=source.line_span(1))
    rows = [(fitting(source, line, dofs, log, "query"), line.span) for line in lines]
    judge_rows(source, rows, log)
    if len(rows) == 1:
        hint = "is the file cut off?"
        log.warn("CFG508", source.path, "one configuration; expected a start and a goal", hint=hint, span=rows[0][1])
    groups: dict[int, list[tuple[Row, Span]]] = {}
    for row, span in rows:
        groups.setdefault(row.robot, []).append((row, span))
    return tuple(
        Task((robot,), tuple(row.configuration for row, _ in own), span=own[0][1])
        for robot, own in sorted(groups.items())
    )


def tasks_alone(task: Task, dofs: Sequence[int]) -> Iterator[Task]:
    """Yield what each robot of a task does alone; `dofs` are the numbers of degrees of freedom of all robots."""
    at = 0
    for robot in task.robots:
        columns = slice(at, at + dofs[robot])
        yield replace(task, robots=(robot,), configurations=tuple(c[columns] for c in task.configurations))
        at += dofs[robot]


def query_text(tasks: Iterable[Task], *, index: bool) -> str:
    """Return a query file with the configurations of some tasks, one a line, with 17 digits.

    Args:
        tasks: What is to be visited, by one robot each, in the file's own numbers.
        index: Whether the robot's index stands in front of each configuration.
    """
    rows = (row_text(c, task.robot if index else None) for task in tasks for c in task.configurations)
    return "".join(f"{row}\n" for row in rows)
