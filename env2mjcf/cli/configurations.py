"""Configurations to be checked: from numbers, from query files, from tables of rows."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import DiagnosticLog, FormatError
from ..formats.query import read_query, split_row
from ..formats.source import Source, read_source
from ..model import Task
from ..options import Limits
from ..simulation.scene import Query, Scene
from ..transforms import Array


@dataclass(frozen=True, slots=True, eq=False)
class Configurations:
    """Rows to be checked.

    Attributes:
        q: (n, dim) radians and metres.
        labels: What each row is called in reports.
    """

    q: Array
    labels: tuple[str, ...]


def of_scene(scene: Scene) -> Configurations:
    """Return the scene's own tasks, else home."""
    if not scene.queries:
        return Configurations(scene.space.home[None], ("home",))
    return _joined(scene, list(_task_rows(scene, scene.queries)))


def of_numbers(scene: Scene, words: Sequence[str], radians: bool) -> Configurations:
    """Return the one configuration that stands on the command line.

    Raises:
        ValueError: A word is no number, or there are too few or too many.
    """
    numbers: list[float] = []
    for word in words:
        try:
            numbers.append(float(word))
        except ValueError:
            raise ValueError(f"{word!r} is not a number; expected numbers, or one file") from None
    q = _row(scene, numbers, radians)
    if q is None:
        raise ValueError(f"{len(numbers)} numbers; expected {_expected(scene)}")
    return Configurations(q[None], ("configuration",))


def of_file(scene: Scene, path: str, radians: bool, limits: Limits, log: DiagnosticLog) -> Configurations:
    """Read a NumPy file (.npy), a text file of rows (.csv, .txt), or else a query file.

    Raises:
        FormatError: The file cannot be read, or a row fits no robot.
    """
    extension = Path(path).suffix.lower()
    if extension == ".npy":
        return _of_array(scene, path, radians, log)
    source = read_source(path, log, limits)
    if extension in (".csv", ".txt"):
        return _of_text(scene, source, radians, log)
    tasks = read_query(source, [s.stop - s.start for s in scene.space.robot_slices], log)
    rows = [Query(t.robot, _task_q(scene, t, radians), t.label) for t in tasks]
    return _joined(scene, list(_task_rows(scene, rows)))


def _task_q(scene: Scene, task: Task, radians: bool) -> Array:
    q = scene.space.of_task(task)
    if radians:
        q[:, scene.space.robot_slices[task.robot]] = task.configurations
    return q


def _task_rows(scene: Scene, queries: Sequence[Query]) -> Iterator[tuple[str, Array]]:
    several = len(scene.space.robot_slices) > 1
    for query in queries:
        task = f"{query.label}, " if query.label else ""
        robot = f"robot {query.robot}, " if several else ""
        for n, row in enumerate(query.q, 1):
            yield f"{task}{robot}configuration {n} of {len(query.q)}", row


def _of_array(scene: Scene, path: str, radians: bool, log: DiagnosticLog) -> Configurations:
    if not os.path.isfile(path):
        read_source(path, log, Limits())  # says what is wrong
    try:
        array: Any = np.load(path, allow_pickle=False)
        rows = np.atleast_2d(np.asarray(array, dtype=np.float64))
    except (OSError, ValueError, EOFError) as error:
        log.fail(FormatError, "CFG505", path, f"{path} is no NumPy file of numbers: {error}")
    if rows.ndim != 2 or not np.isfinite(rows).all():
        what = f"an array of shape {array.shape}" if rows.ndim != 2 else "numbers that are not finite"
        log.fail(FormatError, "CFG505", path, f"{path} holds {what}; expected finite rows of {_expected(scene)}")
    if rows.shape[1] == scene.space.dim:
        q = rows if radians else scene.space.decode(rows)
        return Configurations(q, tuple(f"row {i}" for i in range(len(rows))))
    found: list[tuple[str, Array]] = []
    for i, numbers in enumerate(rows.tolist()):
        row = _row(scene, numbers, radians)
        if row is None:
            log.fail(FormatError, "CFG504", path, f"row {i} has {len(numbers)} numbers; expected {_expected(scene)}")
        found.append((f"row {i}", row))
    return _joined(scene, found)


def _of_text(scene: Scene, source: Source, radians: bool, log: DiagnosticLog) -> Configurations:
    found: list[tuple[str, Array]] = []
    lines = enumerate(source.text.splitlines(), 1)
    rows = ((line, _words(content)) for line, content in lines)
    for n, (line, words) in enumerate((line, words) for line, words in rows if words):
        numbers = [_finite(w) for w in words]
        if n == 0 and all(x is None for x in numbers):
            continue  # names of columns
        wrong = next((w for w, x in zip(words, numbers, strict=True) if x is None), None)
        if wrong is not None:
            log.fail(
                FormatError, "CFG502", source.path, f"expected a row of finite numbers, found {wrong!r}",
                span=source.line_span(line, wrong),
            )  # fmt: skip
        row = _row(scene, [x for x in numbers if x is not None], radians)
        if row is None:
            log.fail(
                FormatError, "CFG504", source.path, f"a row of {len(words)} numbers; expected {_expected(scene)}",
                span=source.line_span(line),
            )  # fmt: skip
        found.append((f"line {line}", row))
    if not found:
        log.fail(
            FormatError, "CFG503", source.path, f"{source.path} holds no configuration; expected rows of numbers",
            span=source.line_span(1),
        )  # fmt: skip
    return _joined(scene, found)


def _words(line: str) -> list[str]:
    return [w for w in re.split(r"[,;\s]+", line.split("#")[0]) if w]


def _finite(word: str) -> float | None:
    try:
        number = float(word)
    except ValueError:
        return None
    return number if np.isfinite(number) else None


def _row(scene: Scene, numbers: Sequence[float], radians: bool) -> Array | None:
    """Return the configuration that some numbers mean: a full row of all robots first, else one robot's."""
    space = scene.space
    if len(numbers) == space.dim:
        return np.array(numbers) if radians else space.decode(numbers)
    taken = split_row(numbers, [s.stop - s.start for s in space.robot_slices])
    if taken is None:
        return None
    robot, values = taken
    q = (space.home if radians else space.encode(space.home)).copy()
    q[space.robot_slices[robot]] = values
    return q if radians else space.decode(q)


def _joined(scene: Scene, rows: Sequence[tuple[str, Array]]) -> Configurations:
    q = np.array([row for _, row in rows], dtype=np.float64).reshape(-1, scene.space.dim)
    return Configurations(q, tuple(label for label, _ in rows))


def _expected(scene: Scene) -> str:
    space = scene.space
    if not space.dim:
        return "none: the scene has no robot that moves"
    names = ", ".join(space.names[:12]) + (", ..." if space.dim > 12 else "")
    dofs = [s.stop - s.start for s in space.robot_slices]
    if len(dofs) == 1:
        return f"{space.dim} ({names})"
    each = ", ".join(f"{d} for robot {i}" for i, d in enumerate(dofs))
    return f"{space.dim} for all robots ({names}), or a robot index and {each}"


