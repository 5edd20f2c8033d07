"""Wavefront `.obj` meshes: the raw vertex list, and all faces as one mesh (docs/format/meshes.md).

trimesh drops vertices that no face uses and splits others at texture seams. The planner's origin is the mean of the
raw list, so that the list has to be read as it stands.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from ...diagnostics import DiagnosticLog
from ...errors import Span
from ...limits import Limits
from .numbers import find_numbers, span_of
from .text import MeshArrays, NumberFile, text_of

_CONTINUATION = re.compile(rb"\\(?:\r\n|\r|\n)")
_LINE = re.compile(rb"^[ \t]*([^\s#]+)([^\n#]*)", re.MULTILINE)
# Texture and normal of a corner.
_REFERENCES = re.compile(rb"(?<=\d)/\S*")

# Names, groups, materials, drawing and texture: none of it is geometry.
_NO_GEOMETRY = re.compile(
    rb"vt|vn|vp|g|o|s|mg|usemtl|mtllib|usemap|maplib|bevel|c_interp|d_interp|lod|shadow_obj|trace_obj"
)


class _Rows(NumberFile):
    """The lines of one keyword.

    Args:
        extents: Where each line's content stands, in both texts.
        plain: The text of the file as `_plain` returns it.
        whole: The text of the file.
        path: The file, for messages.
        log: Where findings go.
        limits: Bounds on hostile input.
    """

    def __init__(
        self, extents: list[tuple[int, int]], plain: bytes, whole: bytes, path: str, log: DiagnosticLog, limits: Limits
    ) -> None:
        text = b"\n".join(plain[a:b] for a, b in extents)
        super().__init__(find_numbers(_REFERENCES.sub(_blanks, text)), path, log, limits)
        self._whole = whole
        self._extents = extents
        lengths = np.array([b - a + 1 for a, b in extents], dtype=np.int64)
        self._begins = np.cumsum(lengths) - lengths
        self.row = np.searchsorted(self._begins, self.numbers.starts, side="right") - 1
        self.counts = np.bincount(self.row, minlength=len(extents)).astype(np.int64)
        if len(self.row) > 3 * limits.mesh_elements:
            message = f"{path} has {len(self.row)} numbers; at most {limits.mesh_elements} vertices or corners are read"
            log.fail("GEO209", path, message, hint=Limits.hint("mesh_elements"))

    def span(self, token: int) -> Span:
        """Return the place of a token in the file."""
        start, end = self.numbers.extent(token)
        row = int(self.row[token])
        shift = self._extents[row][0] - int(self._begins[row])
        return span_of(self.path, self._whole, start + shift, end + shift)

    def row_span(self, row: int) -> Span:
        """Return the place of the first line of a row, behind its keyword."""
        start, end = self._extents[row]
        content = self._whole[start:end].splitlines()[0] if end > start else b""
        start += len(content) - len(content.lstrip())
        return span_of(self.path, self._whole, start, start + len(content.strip()))


def read_obj(text: str | bytes, path: str, log: DiagnosticLog, limits: Limits) -> MeshArrays:
    """Read an `.obj` file; groups, objects and materials become one mesh, material files are not opened.

    Args:
        text: The content of the file.
        path: The file, for messages.
        log: Where findings go.
        limits: Bounds on hostile input.

    Returns:
        All (n, 3) vertices in file order, used or not, and (m, 3) triangles.

    Raises:
        GeometryError: No vertices, no faces, a word that is not a finite number, an index out of range.
    """
    whole = text_of(text, path, log)
    if b"\0" in whole:
        at = whole.index(b"\0")
        message = f"{path} is not a text file: it holds a NUL byte"
        log.fail("GEO211", path, message, span=span_of(path, whole, at, at + 1))
    plain = _plain(whole)
    extents: dict[bytes, list[tuple[int, int]]] = {b"v": [], b"f": []}
    vertices_before: list[int] = []
    unknown: tuple[int, int] | None = None
    for line in _LINE.finditer(plain):
        keyword = line[1]
        if keyword in extents:
            extents[keyword].append(line.span(2))
            if keyword == b"f":
                vertices_before.append(len(extents[b"v"]))
        elif unknown is None and not _NO_GEOMETRY.fullmatch(keyword):
            unknown = line.span(1)
    if unknown is not None:
        found = whole[unknown[0] : unknown[1]][:40].decode("utf-8", "replace")
        message = f"lines that begin with {found!r} are not read; only vertices `v` and faces `f` are"
        log.warn("GEO225", path, message, span=span_of(path, whole, *unknown))
    rows = {k: _Rows(x, plain, whole, path, log, limits) for k, x in extents.items()}
    vertices = _vertices(rows[b"v"])
    return vertices, _faces(rows[b"f"], np.array(vertices_before, dtype=np.int64), vertices)


def _blanks(match: re.Match[bytes]) -> bytes:
    return b" " * len(match[0])


def _plain(whole: bytes) -> bytes:
    """Join continued lines and make every line end alike, without moving anything."""
    return _CONTINUATION.sub(_blanks, whole).replace(b"\r\n", b" \n").replace(b"\r", b"\n")


def _vertices(rows: _Rows) -> NDArray[np.float64]:
    if not len(rows.counts):
        message = f"{rows.path} has no vertices; expected lines `v x y z`"
        rows.log.fail("GEO210", rows.path, message)
    rows.need(len(rows.row), lambda token: f"a coordinate of vertex {rows.row[token] + 1}")
    short = np.flatnonzero(rows.counts < 3)
    if short.size:
        row = int(short[0])
        message = f"vertex {row + 1} has {rows.counts[row]} coordinates; expected x y z"
        rows.log.fail("GEO213", rows.path, message, span=rows.row_span(row))
    # What follows x, y and z is a weight or a colour.
    first = np.cumsum(rows.counts) - rows.counts
    return rows.numbers.values[first[:, None] + np.arange(3)]


def _faces(rows: _Rows, vertices_before: NDArray[np.int64], vertices: NDArray[np.float64]) -> NDArray[np.int64]:
    if not len(rows.counts):
        rows.log.fail("GEO210", rows.path, f"{rows.path} has no faces; expected lines `f 1 2 3`")

    def what(token: int) -> str:
        return f"a corner of face {rows.row[token] + 1}"

    indices = rows.integers(0, len(rows.row), what)
    # A negative index counts back from the last vertex in front of the face.
    corners = np.where(indices < 0, indices + vertices_before[rows.row], indices - 1)
    bad = np.flatnonzero((indices == 0) | (corners < 0) | (corners >= len(vertices)))
    if bad.size:
        token = int(bad[0])
        message = f"{what(token)} is vertex {rows.numbers.text(token)}; expected 1 to {len(vertices)}"
        hint = "negative indices count back from the last vertex so far" if indices[token] < 0 else ""
        rows.fail("GEO214", token, message, hint)
    negative = np.flatnonzero(indices < 0)
    if negative.size:
        message = "negative indices count back from the last vertex; the original planner does not read them"
        rows.log.warn("GEO224", rows.path, message, span=rows.span(int(negative[0])))
    return rows.faces(vertices, corners, rows.counts, rows.row_span)
