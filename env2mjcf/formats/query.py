"""Query files of all ages: configurations to be visited in turn (env-format sections 9.6 and 13.1)."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ..errors import DiagnosticLog, FormatError
from ..model import Task
from .source import Source

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_LEGACY_INFO_FIELDS = 3


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
        FormatError: A row fits no robot, or there are fewer than two configurations.
    """
    rows = _rows(source, log)
    parsed: list[tuple[int, tuple[float, ...], int]] = []
    for line, numbers in rows:
        taken = split_row(numbers, dofs)
        if taken is None:
            parsed = _running(source, rows, dofs, log, line, len(numbers))
            break
        parsed.append((*taken, line))
    if not parsed:
        log.fail(
            FormatError, "CFG503", source.path, f"{source.path} holds no configuration; expected rows of numbers",
            span=source.line_span(1),
        )  # fmt: skip
    return tuple(
        Task(robot, tuple(q for r, q, _ in parsed if r == robot), span=source.line_span(line))
        for robot, line in _first_lines(parsed).items()
    )


def split_row(numbers: Sequence[float], dofs: Sequence[int]) -> tuple[int, tuple[float, ...]] | None:
    """Return (robot, configuration) of one row, or None where the row fits no robot."""
    n = len(numbers)
    if not dofs or not n:
        return None
    plain = (0, tuple(numbers[: dofs[0]])) if n in (dofs[0], 2 * dofs[0], dofs[0] + _LEGACY_INFO_FIELDS) else None
    indexed = None
    robot = int(numbers[0]) if numbers[0].is_integer() and 0 <= numbers[0] < len(dofs) else None
    if robot is not None and n - 1 in (dofs[robot], 2 * dofs[robot]):
        indexed = (robot, tuple(numbers[1 : 1 + dofs[robot]]))
    # A lone robot's exact width needs no index; several robots always have one (env-format section 9.6).
    if n == dofs[0] and len(dofs) == 1:
        return plain
    return indexed or plain


def _first_lines(parsed: Sequence[tuple[int, tuple[float, ...], int]]) -> dict[int, int]:
    lines: dict[int, int] = {}
    for robot, _, line in parsed:
        lines.setdefault(robot, line)
    return dict(sorted(lines.items()))


def _rows(source: Source, log: DiagnosticLog) -> list[tuple[int, list[float]]]:
    """Split the text into rows of numbers; a row that is no number ends the list, as for the planner."""
    rows: list[tuple[int, list[float]]] = []
    ended = False
    for line, text in enumerate(source.text.splitlines(), 1):
        words = re.split(r"#|//", text)[0].split()
        if not words:
            continue
        if ended or not all(_NUMBER.fullmatch(w) for w in words):
            if not ended and rows:
                log.warn(
                    FormatError, "CFG501", source.path, "text ends the list of configurations here",
                    hint="begin comment lines with '#'", span=source.line_span(line),
                )  # fmt: skip
            elif not rows:
                bad = next(w for w in words if not _NUMBER.fullmatch(w))
                log.fail(
                    FormatError, "CFG502", source.path, f"expected a row of numbers, found {bad!r}",
                    span=source.line_span(line, bad),
                )  # fmt: skip
            ended = True
            continue
        rows.append((line, [float(w) for w in words]))
    return rows


def _running(
    source: Source,
    rows: Sequence[tuple[int, list[float]]],
    dofs: Sequence[int],
    log: DiagnosticLog,
    line: int,
    length: int,
) -> list[tuple[int, tuple[float, ...], int]]:
    """Read numbers that run over lines, all rows of one width, as the planner's stream extraction does."""
    flat = [x for _, numbers in rows for x in numbers]
    for width in (dofs[0], dofs[0] + 1, 2 * dofs[0] + 1, 2 * dofs[0]) if dofs else ():
        if width and len(flat) >= 2 * width and len(flat) % width == 0:
            cut = [split_row(flat[i : i + width], dofs) for i in range(0, len(flat), width)]
            if all(c is not None for c in cut):
                return [(*c, rows[0][0]) for c in cut if c is not None]
    expected = " or ".join(f"{d} (robot {i})" for i, d in enumerate(dofs)) or "none: the scene has no robot"
    log.fail(
        FormatError, "CFG504", source.path,
        f"a row of {length} numbers; expected as many as a robot has degrees of freedom, {expected}, "
        "with or without a leading robot index",
        span=source.line_span(line),
    )  # fmt: skip
