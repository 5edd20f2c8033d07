"""Query files of all ages: configurations to be visited in turn (env-format sections 9.6 and 13.1)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby

from ..errors import DiagnosticLog, FormatError, Span
from ..model import Task
from .rows import Row, fitting, judge_rows, number_lines, regrouped, row_text
from .source import Source


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
    lines = regrouped(number_lines(source, log), dofs)
    if not lines:
        log.fail(
            FormatError, "CFG503", source.path, f"{source.path} holds no configuration; expected rows of numbers",
            hint="write one configuration a line", span=source.line_span(1),
        )  # fmt: skip
    rows = [(fitting(source, line, dofs, log, "query"), line.span) for line in lines]
    judge_rows(source, rows, log)
    if len(rows) == 1:
        log.warn(
            FormatError, "CFG508", source.path, "one configuration; expected a start and a goal",
            hint="is the file cut off?", span=rows[0][1],
        )  # fmt: skip
    tasks: list[Task] = []
    for robot, group in groupby(sorted(rows, key=_robot), _robot):
        own = list(group)
        tasks.append(Task(robot, tuple(row.configuration for row, _ in own), span=own[0][1]))
    return tuple(tasks)


def _robot(placed: tuple[Row, Span]) -> int:
    return placed[0].robot


def query_text(tasks: Iterable[Task], *, index: bool) -> str:
    """Return a query file with the configurations of some tasks, one a line, with 17 digits.

    Args:
        tasks: What is to be visited, in the file's own numbers.
        index: Whether the robot's index stands in front of each configuration.
    """
    rows = (row_text(c, task.robot if index else None) for task in tasks for c in task.configurations)
    return "".join(f"{row}\n" for row in rows)
