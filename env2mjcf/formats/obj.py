"""Wavefront `.obj` meshes: the raw vertex list, and all faces as one mesh (env-format section 10.2).

trimesh drops vertices that no face uses and splits others at texture seams. The planner's origin is the mean of the
raw list (section 10.3), so that the list has to be read as it stands.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..errors import DiagnosticLog, GeometryError
from ..options import Limits
from .mesh_text import MeshArrays, NumberFile, as_bytes, faces_of
from .numbers import Numbers, find_numbers

_CONTINUATION = re.compile(rb"\\(?:\r\n|\r|\n)")
_LINE = re.compile(rb"^[ \t]*([^\s#]+)([^\n#]*)", re.MULTILINE)
# Texture and normal of a corner.
_REFERENCES = re.compile(rb"(?<=\d)/\S*")

# Names, groups, materials, drawing and texture: none of it is geometry.
_NO_GEOMETRY = frozenset(
    "vt vn vp g o s mg usemtl mtllib usemap maplib bevel c_interp d_interp lod shadow_obj trace_obj call csh".split()
)


@dataclass(slots=True)
class _Rows:
    """The lines of one keyword: where their numbers stand in the file."""

    extents: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])

    def numbers(self, text: bytes, whole: bytes) -> tuple[Numbers, NDArray[np.int64]]:
        """Return the numbers of all rows, placed in `whole`, and how many each row has."""
        pieces = [text[a:b] for a, b in self.extents]
        found = find_numbers(b"\n".join(pieces))
        begins = np.cumsum([0] + [len(p) + 1 for p in pieces])[:-1].astype(np.int64)
        row = np.searchsorted(begins, found.starts, side="right") - 1
        offsets = np.array([a for a, _ in self.extents], dtype=np.int64)
        placed = Numbers(whole, found.starts - begins[row] + offsets[row], found.values)
        return placed, np.bincount(row, minlength=len(pieces)).astype(np.int64)


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
    whole = as_bytes(text)
    # Blanks take the place of continued and foreign line ends, so that every offset stays what it is in the file.
    plain = _CONTINUATION.sub(lambda m: b" " * len(m[0]), whole).replace(b"\r\n", b" \n").replace(b"\r", b"\n")
    rows = {b"v": _Rows(), b"f": _Rows()}
    vertices_before: list[int] = []
    unknown: tuple[int, int] | None = None
    for line in _LINE.finditer(plain):
        keyword = line[1]
        if keyword in rows:
            rows[keyword].extents.append(line.span(2))
            if keyword == b"f":
                vertices_before.append(len(rows[b"v"].extents))
        elif unknown is None and keyword.decode("latin-1") not in _NO_GEOMETRY:
            unknown = line.span(1)
    if unknown is not None:
        _report_unknown(whole, unknown, path, log, limits)
    vertices = _vertices(rows[b"v"], plain, whole, path, log, limits)
    return vertices, _faces(rows[b"f"], np.array(vertices_before, np.int64), plain, whole, vertices, path, log, limits)
