"""Queries of a scene: starts, goals, and what is between."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..errors import DiagnosticLog
from ..formats import query as text
from ..formats.source import read_source
from ..model import Task
from ..options import Limits, PathArgument
from ..simulation.scene import Query, Scene
from .numbers import dofs_of, file_numbers, write, written_index


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
        One query for each robot that has configurations, the other robots at home.

    Raises:
        FormatError: The file cannot be read, or a row fits no robot.
    """
    log = DiagnosticLog(strict)
    tasks = text.read_query(read_source(file, log, limits or Limits()), dofs_of(scene), log)
    return tuple(Query(t.robot, scene.space.of_task(t), t.label) for t in tasks)


def write_query(scene: Scene, queries: Query | Sequence[Query], file: PathArgument) -> Path:
    """Write a query file, each query's own robot only, in the dialect of the scene, whole or not at all.

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
    tasks = [Task(q.robot, tuple(map(tuple, file_numbers(scene, q.q, q.robot)))) for q in listed]
    return write(file, text.query_text(tasks, index=written_index(scene, 0) is not None))
