"""One or many rows of numbers as configurations, whatever they stand in."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..diagnostics import DiagnosticLog
from ..formats.rows import check_rows, coordinate, coordinate_hint, split_row
from ..formats.source import Source, read_source
from ..kinematics.space import listed
from ..limits import Limits
from ..simulation.edge_verdicts import Edges
from ..simulation.scene import Scene
from ..transforms import Array
from .arrays import coordinates, map_array
from .query_files import dofs_of, standing

_WORD = re.compile(r"[^,;\s]+")


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """Where a file puts the links of each row.

    Attributes:
        links: (n, nlinks, 4, 4) world poses.
        fits: (n,) whether the row's configuration puts them there.
        error: How far off the links are with the worst configuration, in metres.
    """

    links: Array
    fits: NDArray[np.bool_]
    error: float


@dataclass(frozen=True, slots=True, eq=False)
class Graph:
    """What a path or a roadmap says about its rows.

    Attributes:
        kind: "path" or "roadmap".
        version: Of the format; empty where the file has none.
        lines: (n,) line that each row stands on.
        edges: The ways between rows.
        poses: Where the file puts the links, if it does not hold configurations.
        ids: (n,) what a roadmap calls its nodes.
    """

    kind: str
    version: str
    lines: NDArray[np.int64]
    edges: Edges
    poses: Poses | None = None
    ids: NDArray[np.int64] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Configurations:
    """Rows to be checked.

    Attributes:
        q: (n, dim) radians and metres.
        labels: What each row is called in reports.
        graph: The rest of a path or roadmap.
    """

    q: Array
    labels: tuple[str, ...]
    graph: Graph | None = None


def joined(scene: Scene, rows: Sequence[tuple[str, Array]]) -> Configurations:
    """Put labelled rows together."""
    q = np.array([row for _, row in rows], dtype=np.float64).reshape(-1, scene.space.dim)
    return Configurations(q, tuple(label for label, _ in rows))


def row_of(scene: Scene, numbers: Sequence[float], radians: bool, rest: Array) -> Array | None:
    """Return the configuration that some numbers mean: a full row of all robots first, else one robot's.

    The others stand as in `rest`, (dim,).
    """
    space = scene.space
    if len(numbers) == space.dim:
        return np.array(numbers) if radians else space.decode(numbers)
    taken = split_row(numbers, dofs_of(scene))
    if taken is None:
        return None
    robot, values = taken
    columns = space.robot_slices[robot]
    given = np.zeros(space.dim)
    given[columns] = values
    q = rest.copy()
    q[columns] = (given if radians else space.decode(given))[columns]
    return q


def expected(scene: Scene) -> str:
    """Say which rows would have been right."""
    space = scene.space
    if not space.dim:
        return "none: the scene has no robot that moves"
    names, dofs = listed(space.names), dofs_of(scene)
    if len(dofs) == 1:
        return f"{space.dim} ({names})"
    each = ", ".join(f"{d} for robot {i}" for i, d in enumerate(dofs))
    return f"{space.dim} for all robots ({names}), or a robot index and {each}"


def of_array(scene: Scene, path: str, radians: bool, limits: Limits, log: DiagnosticLog) -> Configurations:
    """Read a NumPy file of rows.

    Raises:
        FormatError: It is not one, or a row fits no robot.
    """
    if not os.path.isfile(path) or os.path.getsize(path) > limits.file_bytes:
        read_source(path, log, limits, regular=True)  # says what is wrong
    array = map_array(path, log)
    rows = np.atleast_2d(array)
    if rows.ndim != 2 or not rows.size:
        what = f"an array of shape {array.shape}"
        log.fail("CFG505", path, f"{path} holds {what}; expected rows of {expected(scene)}")
    rows = coordinates(rows, path, log, names=scene.space.names)
    if rows.shape[1] == scene.space.dim:
        q = rows if radians else scene.space.decode(rows)
        return Configurations(q, tuple(f"row {i}" for i in range(len(rows))))
    rest, found = standing(scene), list[tuple[str, Array]]()
    for i, numbers in enumerate(rows.tolist()):
        row = row_of(scene, numbers, radians, rest)
        if row is None:
            log.fail("CFG504", path, f"row {i} has {len(numbers)} numbers; expected {expected(scene)}")
        found.append((f"row {i}", row))
    return joined(scene, found)


def of_text(scene: Scene, source: Source, radians: bool, log: DiagnosticLog) -> Configurations:
    """Read a text of rows, numbers between commas or blanks; a first line without numbers names columns.

    Raises:
        FormatError: A word is not a finite number, or a row fits no robot.
    """
    rest, found = standing(scene), list[tuple[str, Array]]()
    rows = (
        (line, start, list(_WORD.finditer(text.split("#", maxsplit=1)[0])))
        for line, (start, text) in enumerate(source.lines(), 1)
    )
    for n, (line, start, words) in enumerate(row for row in rows if row[2]):
        numbers = [coordinate(w.group()) for w in words]
        if n == 0 and not any(is_number(w.group()) for w in words):
            continue  # names of columns
        wrong = next((w for w, x in zip(words, numbers, strict=True) if x is None), None)
        if wrong is not None:
            message = f"expected a row of finite numbers, found {wrong.group()[:60]!r}"
            span = source.span(start + wrong.start(), start + wrong.end())
            log.fail("CFG502", source.path, message, hint=coordinate_hint(wrong.group()), span=span)
        row = row_of(scene, [x for x in numbers if x is not None], radians, rest)
        if row is None:
            message = f"a row of {len(words)} numbers; expected {expected(scene)}"
            log.fail("CFG504", source.path, message, span=source.line_span(line))
        found.append((f"line {line}", row))
        check_rows(source, len(found), log, source.line_span(line))
    if not found:
        message = f"{source.path} holds no configuration; expected rows of numbers"
        log.fail("CFG503", source.path, message, span=source.line_span(1))
    return joined(scene, found)


def is_number(word: str) -> bool:
    """Return whether Python reads a word as a number, such as `1e-3` or `nan`."""
    try:
        float(word)
    except ValueError:
        return False
    return True
