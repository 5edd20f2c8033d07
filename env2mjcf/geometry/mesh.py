"""A triangle mesh in its body's frame, and how it is loaded from a file of any format that is known."""

from __future__ import annotations

import hashlib
import io
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..diagnostics import DiagnosticLog
from ..formats.meshes.byu import read_byu, read_gms
from ..formats.meshes.obj import read_obj
from ..formats.meshes.text import MeshArrays, text_of
from ..formats.source import read_at_most, wide_encoding
from ..limits import LARGEST, Limits
from ..model.environment import Recentring
from ..system.files import open_regular

FAR = 1e3
"""What is farther from the origin than this, in its own sizes, is computed with about an origin of its own."""


# Without slots, so that what is computed of the arrays is kept.
@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles over the vertex list of a file.

    Attributes:
        name: Stem of the file.
        vertices: (n, 3) float64, read-only; every vertex of the file in its order, used or not.
        faces: (m, 3) int64, read-only; indices into `vertices`, counter-clockwise from outside.
        path: The file that it was read from.
        center: Where the origin of the vertices lies in the body's frame; elsewhere than there if they are far from it.
        rounding: How far apart numbers are that single precision can tell, at these vertices before they are centred.
    """

    name: str
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    path: Path
    center: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rounding: float = 0.0

    @classmethod
    def from_arrays(
        cls,
        name: str,
        vertices: object,
        faces: object,
        path: Path = Path(),
        center: tuple[float, float, float] = (0.0, 0.0, 0.0),
        rounding: float = 0.0,
    ) -> Mesh:
        """Build a mesh from anything array-like; the arrays are copied and made read-only."""
        v = np.array(vertices, dtype=np.float64).reshape(-1, 3)
        f = np.array(faces, dtype=np.int64).reshape(-1, 3)
        v.setflags(write=False)
        f.setflags(write=False)
        return cls(name, v, f, path, center, rounding)

    @cached_property
    def used_vertices(self) -> NDArray[np.float64]:
        """The vertices that faces use, (k, 3), in the order of the file; read-only."""
        used = np.unique(self.faces)
        if len(used) == len(self.vertices):
            return self.vertices
        vertices = self.vertices[used]
        vertices.setflags(write=False)
        return vertices

    @property
    def diagonal(self) -> float:
        """Diagonal of the bounding box of the vertices that faces use."""
        return float(np.linalg.norm(np.ptp(self.used_vertices, axis=0)))

    @cached_property
    def digest(self) -> str:
        """Hash of vertices and faces: equal for equal geometry, whatever the file is called."""
        h = hashlib.sha256()
        # Adding 0.0 turns -0.0 into 0.0, so that equal numbers give equal bytes.
        h.update((self.vertices + 0.0).tobytes())
        h.update(b"|")
        h.update(self.faces.tobytes())
        return h.hexdigest()

    def recentred(self, recentring: Recentring) -> Mesh:
        """Return the mesh as the planner places it (docs/format/meshes.md).

        `COM` subtracts the unweighted mean of the whole vertex list, `Surface` its x and z only.
        """
        if recentring is Recentring.NONE or len(self.vertices) == 0:
            return self
        offset = self.vertices.mean(axis=0)
        if recentring is Recentring.SURFACE:
            offset = offset * (1.0, 0.0, 1.0)
        return Mesh.from_arrays(self.name, self.vertices - offset, self.faces, self.path)

    def scaled(self, factor: float) -> Mesh:
        """Return the mesh with every coordinate multiplied by `factor`."""
        if factor == 1.0:
            return self
        return Mesh.from_arrays(self.name, self.vertices * factor, self.faces, self.path)

    def centred(self) -> Mesh:
        """Return the mesh about a round point amid it, if it is far from its frame's origin: see `round_point`."""
        used = self.used_vertices
        lower, upper = used.min(axis=0), used.max(axis=0)
        center = round_point((lower + upper) / 2, self.diagonal, lower, upper)
        if not any(center):
            return self
        rounding = float(np.spacing(np.abs(used).max().astype(np.float32)))
        return Mesh.from_arrays(self.name, self.vertices - center, self.faces, self.path, center, rounding)


def round_point(
    middle: NDArray[np.float64], size: float, lower: NDArray[np.float64], upper: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Return the middle of something, rounded to its size; zero unless it reaches a thousand sizes from the origin."""
    if not size or max(np.abs(lower).max(), np.abs(upper).max()) <= FAR * size:
        return 0.0, 0.0, 0.0
    digits = -math.floor(math.log10(size))
    x, y, z = (round(float(c), digits) + 0.0 for c in middle)
    return x, y, z


_READERS: dict[str, Callable[[bytes, str, DiagnosticLog, Limits], MeshArrays]] = {
    ".g": read_byu,
    ".byu": read_byu,
    ".dat": read_gms,
    ".obj": read_obj,
}

# Of what trimesh reads: formats that are one self-contained file of triangles.
_THROUGH_TRIMESH = (".stl", ".ply", ".off", ".glb")

READABLE = (*_READERS, *_THROUGH_TRIMESH)


def load_mesh(path: Path, log: DiagnosticLog, limits: Limits) -> Mesh:
    """Load a mesh by the extension of its file.

    `.stl`, `.ply`, `.off` and `.glb`, which the original planner did not read, go through trimesh; the corners of
    an STL's triangles are merged, since that format has no vertex list.

    Raises:
        GeometryError: An unknown extension, a file that cannot be read or is too large, a malformed or empty mesh.
    """
    extension = path.suffix.lower()
    if extension not in READABLE:
        log.fail(
            "GEO207",
            str(path),
            f"{path} has the extension {path.suffix!r}; meshes that can be read: {', '.join(READABLE)}",
        )
    data = _content(path, log, limits)
    if extension in _READERS:
        wide = wide_encoding(data)
        if wide:
            message = f"{path} is {wide} text; expected ASCII, UTF-8 or Latin-1"
            log.fail("GEO274", str(path), message, hint="save it as UTF-8")
        vertices, faces = _READERS[extension](data, str(path), log, limits)
    else:
        log.info("GEO208", str(path), f"{path} is read through trimesh: the original planner did not read this format")
        # Of these formats each but `.glb` may be a text.
        if data.isascii() and b"\0" not in data.rstrip(b"\0\x1a\r\n"):
            data = text_of(data, str(path), log)
        vertices, faces = _through_trimesh(data, extension, path, log, limits)
    largest = float(np.abs(vertices).max())
    if largest > LARGEST:
        message = f"{path} has a coordinate of {largest:.3g}; at most {LARGEST:g} can be computed with"
        log.fail("GEO276", str(path), message, hint="is the file damaged, or in another format?")
    return Mesh.from_arrays(path.stem, vertices, faces, path)


def _content(path: Path, log: DiagnosticLog, limits: Limits) -> bytes:
    try:
        with open_regular(path) as file:
            # One byte more than allowed tells a large file without reading it.
            data = read_at_most(file, limits.file_bytes + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        log.fail("GEO204", str(path), f"{path} cannot be read: {reason}")
    if len(data) > limits.file_bytes:
        log.fail("GEO209", str(path), f"{path} has more than {limits.file_bytes} bytes", hint=Limits.hint("file_bytes"))
    return data


def _through_trimesh(data: bytes, extension: str, path: Path, log: DiagnosticLog, limits: Limits) -> MeshArrays:
    # Imported here because it is slow, and by name because it has type hints only in part.
    trimesh: Any = import_module("trimesh")
    try:
        mesh = trimesh.load_mesh(io.BytesIO(data), file_type=extension[1:], process=False)
        if extension == ".stl":
            mesh.merge_vertices()
        vertices, faces = np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.int64)
    except Exception as error:  # trimesh's loaders raise whatever they stumble over
        message = f"{path} cannot be read as {extension}: {type(error).__name__}: {error}"
        log.fail("GEO226", str(path), message)
    if not len(vertices) or not len(faces):
        log.fail("GEO210", str(path), f"{path} has no triangle", hint="expected at least one triangle")
    if not np.isfinite(vertices).all():
        log.fail("GEO212", str(path), f"{path} has vertices that are not finite")
    if faces.min() < 0 or faces.max() >= len(vertices):
        message = f"{path} has a triangle with vertex {faces.max()}; expected 0 to {len(vertices) - 1}"
        log.fail("GEO214", str(path), message)
    if max(len(vertices), faces.size) > limits.mesh_elements:
        message = (
            f"{path} has {len(vertices)} vertices and {faces.size} corners; at most {limits.mesh_elements} are read"
        )
        log.fail("GEO209", str(path), message, hint=Limits.hint("mesh_elements"))
    return vertices, faces
