"""Query files of all ages: configurations to be visited in turn (env-format sections 9.6 and 13.1)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from ..errors import DiagnosticLog, FormatError, Span
from ..model import Task
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
class _Line:
    numbers: tuple[float, ...]
    span: Span


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
        FormatError: A row fits no robot, or there is none.
    """
    lines = _lines(source, log)
    if not lines:
        log.fail(
            FormatError, "CFG503", source.path, f"{source.path} holds no configuration; expected rows of numbers",
            hint="write one configuration a line", span=source.line_span(1),
        )  # fmt: skip
    if parse_row(lines[0].numbers, dofs) is None:
        lines = _regrouped(lines, dofs) or lines
    rows = [(_fitting(source, line, dofs, log), line.span) for line in lines]
    _judge(source, rows, log)
    tasks: list[Task] = []
    for robot in sorted({row.robot for row, _ in rows}):
        own = [(row, span) for row, span in rows if row.robot == robot]
        tasks.append(Task(robot, tuple(row.configuration for row, _ in own), span=own[0][1]))
    return tuple(tasks)


def split_row(numbers: Sequence[float], dofs: Sequence[int]) -> tuple[int, tuple[float, ...]] | None:
    """Return (robot, configuration) of one row, or None where the row fits no robot."""
    row = parse_row(numbers, dofs)
    return None if row is None else (row.robot, row.configuration)


def parse_row(numbers: Sequence[float], dofs: Sequence[int]) -> Row | None:
    """Tell what the numbers of one row are, or None where they fit no robot."""
    if not dofs or not numbers:
        return None
    plain = _extra(len(numbers), dofs[0], legacy=True)
    # A lone robot's exact width needs no index; several robots always have one (env-format section 9.6).
    if plain is Extra.NOTHING and len(dofs) == 1:
        return Row(0, tuple(numbers), False, plain)
    first = numbers[0]
    if first.is_integer() and 0 <= first < len(dofs):
        robot = int(first)
        extra = _extra(len(numbers) - 1, dofs[robot], legacy=False)
        if extra is not None:
            return Row(robot, tuple(numbers[1 : 1 + dofs[robot]]), True, extra)
    return None if plain is None else Row(0, tuple(numbers[: dofs[0]]), False, plain)


def _extra(width: int, dof: int, *, legacy: bool) -> Extra | None:
    known = {dof: Extra.NOTHING, 2 * dof: Extra.VELOCITIES}
    if legacy:
        known.setdefault(dof + _LEGACY_INFO_FIELDS, Extra.INFO_FIELDS)
    return known.get(width)


def _lines(source: Source, log: DiagnosticLog) -> list[_Line]:
    """Split the text into rows of numbers; a word ends the list, as it ends the planner's stream extraction."""
    lines: list[_Line] = []
    for start, text in source.lines():
        numbers: list[float] = []
        span = source.span(start)
        for match in _WORD.finditer(_COMMENT.split(text, maxsplit=1)[0]):
            place = source.span(start + match.start(), start + match.end())
            value = parse_number(match.group())
            if value is None:
                _end_list(source, match.group(), place, log, empty=not lines and not numbers)
                return [*lines, _Line(tuple(numbers), span)] if numbers else lines
            span = span if numbers else place
            numbers.append(value)
        if numbers:
            lines.append(_Line(tuple(numbers), span))
    return lines


def _end_list(source: Source, word: str, place: Span, log: DiagnosticLog, *, empty: bool) -> None:
    # What looks like a number is one that went wrong, not text behind the list.
    hint = number_hint(word)
    if empty or hint or word[0] in "+-.0123456789":
        log.fail(
            FormatError, "CFG502", source.path, f"expected a number, found {word[:60]!r}",
            hint=hint or "write one configuration a line, '#' before comments", span=place,
        )  # fmt: skip
    log.warn(
        FormatError, "CFG501", source.path, "text ends the list of configurations here",
        hint="begin comment lines with '#'", span=place,
    )  # fmt: skip


def _regrouped(lines: Sequence[_Line], dofs: Sequence[int]) -> list[_Line] | None:
    """Read numbers that run over lines, all configurations of one width, as the planner's stream extraction does."""
    d = dofs[0] if dofs else 0
    # A first line that is too long belongs to another robot; only one that is too short goes on in the next.
    if len(lines[0].numbers) > d:
        return None
    flat = [(x, line.span) for line in lines for x in line.numbers]
    for width in (d, d + 1, 2 * d + 1, 2 * d):
        if len(flat) < 2 * width or len(flat) % width:
            continue
        cut = [flat[i : i + width] for i in range(0, len(flat), width)]
        found = [_Line(tuple(x for x, _ in piece), piece[0][1]) for piece in cut]
        if all(parse_row(line.numbers, dofs) is not None for line in found):
            return found
    return None


def _fitting(source: Source, line: _Line, dofs: Sequence[int], log: DiagnosticLog) -> Row:
    row = parse_row(line.numbers, dofs)
    if row is None:
        expected = " or ".join(f"{d} (robot {i})" for i, d in enumerate(dofs)) or "none: the scene has no robot"
        log.fail(
            FormatError, "CFG504", source.path,
            f"a row of {len(line.numbers)} numbers; expected as many as a robot has degrees of freedom, {expected}, "
            "behind the robot's index or, for robot 0, without",
            hint="is it the query of another scene, or cut off?", span=line.span,
        )  # fmt: skip
    return row


def _judge(source: Source, rows: Sequence[tuple[Row, Span]], log: DiagnosticLog) -> None:
    """Report what is doubtful about rows that each fit."""
    first = rows[0][0]
    odd = next((span for row, span in rows if (row.indexed, row.extra) != (first.indexed, first.extra)), None)
    if odd is not None:
        log.warn(
            FormatError, "CFG506", source.path, "a row that is built otherwise than the first one",
            hint="give every row, or none, a robot index and velocities", span=odd,
        )  # fmt: skip
    dropped = next(((row, span) for row, span in rows if row.extra is not Extra.NOTHING), None)
    if dropped is not None:
        row, span = dropped
        log.info("CFG507", source.path, f"{row.extra} behind the configurations are not used", span=span)
    if len(rows) == 1:
        log.warn(
            FormatError, "CFG508", source.path, "one configuration; expected a start and a goal",
            hint="is the file cut off?", span=rows[0][1],
        )  # fmt: skip
