"""Queries of a scene (starts, goals, and what is between), and the numbers of all such files as configurations."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..diagnostics import DiagnosticLog
from ..errors import Span, counted
from ..formats import rows as text
from ..formats.path import ALL_ROBOTS
from ..formats.source import read_source
from ..kinematics.space import ConfigurationSpace
from ..limits import LARGEST, Limits
from ..model.dialects import begins_with_robot
from ..model.environment import Dialect, Task
from ..options import PathArgument, whole
from ..simulation.scene import Query, Scene, queries_of
from ..system.files import output
from ..transforms import Array


def read_query(
    scene: Scene, file: PathArgument, *, limits: Limits | None = None, strict: bool = False
) -> tuple[Query, ...]:
    """Read a query file for a scene.

    Args:
        scene: Whose configurations they are.
        file: A query file of any dialect.
        limits: Bounds on hostile input.
        strict: Whether warnings are errors.

    Returns:
        One query for each robot that has configurations. Other robots stand at the start of their own, or at that of
        the scene's own queries, else at home.

    Raises:
        FormatError: The file cannot be read, or a row fits no robot.
    """
    log = DiagnosticLog(strict)
    tasks = text.read_query(read_source(file, log, limits or Limits()), dofs_of(scene), log)
    return queries_of(scene.space, tasks, standing(scene))


def write_query(scene: Scene, queries: Query | Sequence[Query], file: PathArgument) -> Path:
    """Write a query file, each query's own robots only, in the dialect of the scene, whole or not at all.

    The file has a row for each robot: it does not say which robots move together.

    Args:
        scene: Whose configurations they are.
        queries: What is to be visited.
        file: The file to write; replaced if it exists.

    Raises:
        ConversionError: The file cannot be written.
        ValueError: A query has a wrong shape, a value that is not finite, or a robot that does not exist; or there is
            no configuration.
    """
    listed = [queries] if isinstance(queries, Query) else list(queries)
    if not any(len(q.q) for q in listed):
        raise ValueError("queries hold no configuration; expected a start and a goal")
    tasks = [Task((r,), tuple(map(tuple, file_numbers(scene, q.q, r)))) for q in listed for r in q.robots]
    return write(file, text.query_text(tasks, index=begins_with_robot(scene.environment)))


def standing(scene: Scene) -> Array:
    """Return where robots stand of which a file says nothing, (dim,): at the start of their query, or at home."""
    return scene.space.standing(scene.environment.tasks)


def dofs_of(scene: Scene) -> list[int]:
    """Return the number of degrees of freedom of each robot."""
    return [s.stop - s.start for s in scene.space.robot_slices]


def configurations(scene: Scene, rows: Sequence[tuple[int, Sequence[float]]]) -> Array:
    """Return rows (robot, its numbers in the file) as (n, dim), with the other robots `standing`."""
    space = scene.space
    q = np.tile(standing(scene), (len(rows), 1))
    for robot in {r for r, _ in rows}:
        columns = slice(0, space.dim) if robot == ALL_ROBOTS else space.robot_slices[robot]
        own = [i for i, (r, _) in enumerate(rows) if r == robot]
        numbers = np.zeros((len(own), space.dim))
        numbers[:, columns] = [rows[i][1] for i in own]
        q[own, columns] = space.decode(numbers)[:, columns]
    return q


def from_turns(
    scene: Scene, rows: Sequence[tuple[int, Sequence[float]]], file: str, span: Span, log: DiagnosticLog
) -> list[tuple[int, Sequence[float]]]:
    """Return rows of dialect A's time, whose angles are turns, in the units of the scene's dialect.

    Rows are (robot, its numbers in the file); `span` is where the file tells its age.
    """
    if scene.environment.dialect is Dialect.A or not rows:
        return list(rows)
    message = "a file of this version counts angles in turns, the scene's dialect in fractions of pi; read as turns"
    log.warn("CFG535", file, message, hint="is it the file of an older version of the scene?", span=span)
    robots = scene.compiled.assembly.robots
    factors = {i: [1.0 if d.kind.is_length else 2.0 for d in r.kinematics.dofs] for i, r in enumerate(robots)}
    factors[ALL_ROBOTS] = [f for i in range(len(robots)) for f in factors[i]]
    return [(r, [x * f for x, f in zip(row, factors[r], strict=True)]) for r, row in rows]


def file_numbers(scene: Scene, q: ArrayLike, robot: int | None) -> list[list[float]]:
    """Return one robot's numbers of configurations (n, dim) as they are written; for None those of all robots.

    Decoding them gives q again to the last bit wherever some number does; else it is one unit of the last digit off,
    because not every double is a multiple of pi.

    Raises:
        TypeError: The robot is not a whole number.
        ValueError: q has a wrong shape, a value that is not finite or too large, or there is no such robot.
    """
    space = scene.space
    count = len(space.robot_slices)
    if robot is not None and not 0 <= whole("robot", robot, 0) < count:
        raise ValueError(f"robot={robot}; the scene has {counted(count, 'robot')}, counted from 0")
    columns = slice(None) if robot is None else space.robot_slices[robot]
    numbers = _exactly(space, np.atleast_2d(space.check(q)))[:, columns]
    if (np.abs(numbers) > LARGEST).any():
        raise ValueError(f"q holds {np.abs(numbers).max():g} in the file's units; files hold numbers up to {LARGEST:g}")
    return numbers.tolist()


def write(file: PathArgument, text: str) -> Path:
    """Write a text, whole or not at all; where it cannot be written, fail with a ConversionError."""
    path = Path(os.fspath(file))
    with output(path, "CFG532") as staged:
        staged.write_bytes(text.encode("utf-8"))
    return path


def _exactly(space: ConfigurationSpace, q: Array) -> Array:
    numbers = space.encode(q)
    best = numbers.copy()
    wrong = space.decode(best) != q
    for neighbour in (np.nextafter(numbers, -np.inf), np.nextafter(numbers, np.inf)):
        better = wrong & (space.decode(neighbour) == q)
        best[better] = neighbour[better]
    return best
