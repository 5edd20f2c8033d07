"""MOVIE.BYU meshes (`.g`, `.byu`), also for trimesh, and GMS `.dat` meshes, the oldest (docs/format/meshes.md)."""

from __future__ import annotations

from itertools import islice
from types import ModuleType
from typing import IO, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ...diagnostics import DiagnosticLog
from ...errors import GeometryError
from ...limits import Limits
from .numbers import Numbers, column_layouts, find_numbers
from .text import MeshArrays, NumberFile, text_of

_HEADER = ("the number of parts", "the number of vertices", "the number of polygons", "the number of edges")

# Faults that numbers without a blank between them may cause.
_FAULTS_OF_COLUMNS = ("GEO209", "GEO211", "GEO213", "GEO214", "GEO215", "GEO216")

# Guesses of columns that are tried: of a file as Fortran prints it, one of the first is right.
_TRIALS = 4


class TriangleMesh(Protocol):
    """What can be exported: a `trimesh.Trimesh` or a `geometry.mesh.Mesh`."""

    @property
    def vertices(self) -> NDArray[np.float64]:
        """(n, 3) coordinates."""
        ...

    @property
    def faces(self) -> NDArray[np.int64]:
        """(m, 3) indices from 0."""
        ...


def read_byu(text: str | bytes, path: str, log: DiagnosticLog, limits: Limits) -> MeshArrays:
    """Read a `.g` or `.byu` file strictly: every number in its place, every index in range.

    Accepts Fortran's fixed columns without blanks, exponents with `D`, any line end and any line layout. Polygons
    with more than three corners are triangulated.

    Args:
        text: The content of the file.
        path: The file, for messages.
        log: Where findings go.
        limits: Bounds on hostile input.

    Returns:
        All (n, 3) vertices in file order, and (m, 3) triangles.

    Raises:
        GeometryError: The file is not a BYU mesh, is cut off, has numbers left over or an index out of range.
    """
    numbers = find_numbers(text_of(text, path, log), fortran=True)
    try:
        return _read(NumberFile(numbers, path, log, limits))
    except GeometryError as error:
        if error.code not in _FAULTS_OF_COLUMNS:
            raise
        arrays = _read_columns(numbers, path, log, limits)
        if arrays is None:
            raise
        return arrays


def _read_columns(numbers: Numbers, path: str, log: DiagnosticLog, limits: Limits) -> MeshArrays | None:
    """Read a file whose numbers touch; None where that is not what is wrong with it."""
    for layout in islice(column_layouts(numbers.data), _TRIALS):
        trial = DiagnosticLog(log.strict)
        file = NumberFile.of(layout, path, trial, limits)
        try:
            arrays = _read(file)
        except GeometryError:
            continue
        log.info("GEO223", path, f"{path} has numbers that touch; read as columns of fixed width")
        log.extend(trial)
        return arrays
    return None


def _read(file: NumberFile) -> MeshArrays:
    if len(file.numbers.starts) == 0:
        file.fail("GEO210", 0, f"{file.path} is empty; expected a BYU header", hint="parts, vertices, polygons, edges")
    parts, n_edges = (int(file.integers(k, k + 1, _HEADER.__getitem__)[0]) for k in (0, 3))
    n_vertices, n_polygons = (file.count(k, _HEADER[k]) for k in (1, 2))
    if not 0 <= parts <= n_polygons:
        file.fail("GEO216", 0, f"the number of parts is {parts}; expected 1 to {n_polygons}, the number of polygons")
    ranges = file.integers(4, 4 + 2 * parts, lambda k: f"the {('first', 'last')[k % 2]} polygon of part {k // 2 - 1}")
    vertices = file.points(4 + 2 * parts, n_vertices)
    corners, counts, first = _polygons(file, 4 + 2 * parts + 3 * n_vertices, n_vertices, n_polygons)
    _check_header(file, n_edges, ranges.reshape(-1, 2), n_polygons, len(corners))
    starts = np.cumsum(counts) - counts
    return vertices, file.faces(vertices, corners, counts, lambda k: file.span(first + int(starts[k])))


def _polygons(
    file: NumberFile, first: int, n_vertices: int, n_polygons: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """Return the corners (from 0) of all polygons, the corners of each, and the token of the first corner."""

    def what(token: int) -> str:
        done = int(np.count_nonzero(file.numbers.values[first:token] < 0))
        return f"a corner of polygon {min(done + 1, n_polygons)} of {n_polygons}"

    ends = np.flatnonzero(file.numbers.values[first:] < 0)
    missing = len(ends) < n_polygons
    last = len(file.numbers) if missing else first + int(ends[n_polygons - 1]) + 1
    indices = file.integers(first, last, what)
    bad = np.flatnonzero((indices == 0) | (np.abs(indices) > n_vertices))
    if bad.size:
        token = first + int(bad[0])
        found = f"{what(token)} is vertex {file.numbers.text(token)}"
        file.fail("GEO214", token, f"{found}; expected 1 to {n_vertices}, negative at the last corner")
    if missing:
        file.need(last + 1, what)
    if len(indices) > file.limits.mesh_elements:
        message = f"the polygons have {len(indices)} corners; at most {file.limits.mesh_elements} are read"
        file.fail("GEO209", first, message, Limits.hint("mesh_elements"))
    file.nothing_after(last, f"the last of {n_polygons} polygons")
    return np.abs(indices) - 1, np.diff(ends[:n_polygons], prepend=-1), first


def _check_header(file: NumberFile, n_edges: int, ranges: NDArray[np.int64], n_polygons: int, n_corners: int) -> None:
    """Report what no reader used and real files get wrong, and parts, which dialect A's reader gets wrong."""
    if len(ranges) != 1:
        # A fault in dialect A alone, whose reader is gone: later readers take any number of parts.
        message = (
            f"{len(ranges)} parts, read as one mesh; dialect A's planner reads one range whatever the header says, "
            "and so misreads this file"
        )
        file.log.info("GEO219", file.path, message, hint="write the mesh as a single part", span=file.span(0))
    if n_edges != n_corners:
        message = f"the header says {n_edges} edges; the polygons have {n_corners}"
        file.log.info("GEO217", file.path, message, span=file.span(3))
    covers = len(ranges) > 0 and ranges[0, 0] == 1 and ranges[-1, 1] == n_polygons
    if len(ranges) and not (covers and (ranges[1:, 0] == ranges[:-1, 1] + 1).all()):
        said = ", ".join([*(f"{a} to {b}" for a, b in ranges[:4].tolist()), *["..."][: len(ranges) > 4]])
        message = f"the parts are polygons {said}; the file has 1 to {n_polygons}"
        file.log.info("GEO218", file.path, message, span=file.span(4))


def load_byu(file_obj: IO[str] | IO[bytes], **kwargs: Any) -> dict[str, Any]:
    """Load a MOVIE.BYU file for trimesh.

    Args:
        file_obj: A text or binary file.
        kwargs: What else trimesh passes to a loader; not used.

    Returns:
        Keyword arguments of a `trimesh.Trimesh`: `vertices` and `faces`.
    """
    # Streams in memory have no name, those of file descriptors have a number.
    path = str(getattr(file_obj, "name", "<stream>"))
    vertices, faces = read_byu(file_obj.read(), path, DiagnosticLog(), Limits())
    return {"vertices": vertices, "faces": faces}


def export_byu(mesh: TriangleMesh) -> str:
    """Return a mesh as the text of a `.g` file: one part, numbers that read back to the same doubles."""
    faces = (np.asarray(mesh.faces, dtype=np.int64) + 1) * (1, 1, -1)
    lines = [f"1 {len(mesh.vertices)} {len(faces)} {3 * len(faces)}", f"1 {len(faces)}"]
    lines += [f"{x!r} {y!r} {z!r}" for x, y, z in np.asarray(mesh.vertices, dtype=np.float64).tolist()]
    lines += [f"{a} {b} {c}" for a, b, c in faces.tolist()]
    return "\n".join(lines) + "\n"


def teach(module: ModuleType) -> None:
    """Teach trimesh `.g` and `.byu`: its module of loaders, or that of exporters, which has no public table."""
    for table, function in (("mesh_loaders", load_byu), ("_mesh_exporters", export_byu)):
        if hasattr(module, table):
            getattr(module, table).update(dict.fromkeys(("g", "byu"), function))


def read_gms(text: str | bytes, path: str, log: DiagnosticLog, limits: Limits) -> MeshArrays:
    """Read a `.dat` file: vertices, then polygons as a count and that many indices from 0.

    Raises:
        GeometryError: The file is cut off, has numbers left over or an index out of range.
    """
    file = NumberFile.of(text_of(text, path, log), path, log, limits)
    n_vertices = file.count(0, "the number of vertices")
    vertices = file.points(1, n_vertices)
    first = 2 + 3 * n_vertices
    n_polygons = file.count(first - 1, "the number of polygons")
    corners: list[int] = []
    starts: list[int] = []
    values = file.integers(first, len(file.numbers), lambda _: "a corner").tolist()
    at = 0
    for k in range(n_polygons):
        what = f"polygon {k + 1} of {n_polygons}"
        file.need(first + at + 1, lambda _, w=what: f"the number of corners of {w}")
        n = values[at]
        if n < 1:
            file.fail("GEO216", first + at, f"{what} has {n} corners; expected a positive number")
        file.need(first + at + 1 + n, lambda _, w=what: f"a corner of {w}")
        starts.append(first + at)
        for j in range(at + 1, at + 1 + n):
            if not 0 <= values[j] < n_vertices:
                message = f"a corner of {what} is vertex {values[j]}; expected 0 to {n_vertices - 1}"
                file.fail("GEO214", first + j, message)
        corners += values[at + 1 : at + 1 + n]
        at += 1 + n
    file.nothing_after(first + at, f"the last of {n_polygons} polygons")
    counts = np.diff(np.array([*starts, first + at], dtype=np.int64)) - 1
    indices = np.array(corners, dtype=np.int64)
    return vertices, file.faces(vertices, indices, counts, lambda k: file.span(starts[k]))
