"""Which configurations are to be checked: numbers of the command line, files, or the scene's own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from ..errors import DiagnosticLog, FormatError
from ..formats.path import is_path
from ..formats.query import read_query
from ..formats.roadmap import is_roadmap
from ..formats.source import Source, read_source
from ..model import Task
from ..options import Limits
from ..simulation.scene import Query, Scene
from ..transforms import Array
from .rows import Configurations, expected, joined, of_array, of_text, row_of
from .rows_of_files import of_path, of_roadmap


def of_scene(scene: Scene) -> Configurations:
    """Return the scene's own tasks, else home."""
    if not scene.queries:
        return Configurations(scene.space.home[None], ("home",))
    return joined(scene, list(_task_rows(scene, scene.queries)))


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
    q = row_of(scene, numbers, radians)
    if q is None:
        raise ValueError(f"{len(numbers)} numbers; expected {expected(scene)}")
    return Configurations(q[None], ("configuration",))


def of_file(scene: Scene, path: str, radians: bool, limits: Limits, log: DiagnosticLog) -> Configurations:
    """Read a NumPy file (.npy), a text file of rows (.csv, .txt), a path, a roadmap, or else a query.

    Paths (.path) and roadmaps (.map) are known by their text, too, whatever their names are.

    Raises:
        FormatError: The file cannot be read, a row fits no robot, or there is none: nothing is neither valid nor seen.
        ValueError: A path or roadmap is to be in radians.
    """
    refuse_without_freedom(scene, scene.environment.path, log)
    found = _of_file(scene, path, radians, limits, log)
    if not found.labels:
        log.fail(
            FormatError, "CFG503", path, f"{path} holds no configuration; expected one at least",
            hint="has what wrote it found nothing?",
        )  # fmt: skip
    return found


def refuse_without_freedom(scene: Scene, path: str, log: DiagnosticLog) -> None:
    """Refuse a scene in which nothing can move.

    Raises:
        FormatError: It is one.
    """
    if not scene.space.dim:
        what = "has no robot" if not scene.environment.robots else "has no robot that moves"
        log.fail(
            FormatError, "CFG543", path, f"{path} {what}: there are no configurations of it",
            hint="is a robot file missing? Give it with --robots FILE",
        )  # fmt: skip


def _of_file(scene: Scene, path: str, radians: bool, limits: Limits, log: DiagnosticLog) -> Configurations:
    extension = Path(path).suffix.lower()
    if extension == ".npy":
        return of_array(scene, path, radians, limits, log)
    source = read_source(path, log, limits)
    if extension in (".csv", ".txt"):
        return of_text(scene, source, radians, log)
    reader = _graph_reader(source, extension)
    if reader is not None:
        if radians:
            raise ValueError("--radians is for plain numbers; paths and roadmaps are in units of their own")
        return reader(scene, source, log)
    tasks = read_query(source, [s.stop - s.start for s in scene.space.robot_slices], log)
    rows = [Query(t.robot, _task_q(scene, t, radians), t.label) for t in tasks]
    return joined(scene, list(_task_rows(scene, rows)))


def _graph_reader(source: Source, extension: str) -> Callable[[Scene, Source, DiagnosticLog], Configurations] | None:
    # What a file says counts for more than its name.
    if is_path(source):
        return of_path
    if is_roadmap(source):
        return of_roadmap
    return {".path": of_path, ".map": of_roadmap}.get(extension)


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
