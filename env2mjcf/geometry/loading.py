"""Loads a mesh file of any format that is known."""

from __future__ import annotations

import io
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import DiagnosticLog, GeometryError
from ..formats.byu import read_byu
from ..formats.gms import read_gms
from ..formats.mesh_text import MeshArrays
from ..formats.obj import read_obj
from ..formats.source import read_at_most, wide_encoding
from ..opening import open_regular
from ..options import LARGEST, Limits
from .mesh import Mesh

_READERS: dict[str, Callable[[bytes, str, DiagnosticLog, Limits], MeshArrays]] = {
    ".g": read_byu,
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
            GeometryError,
            "GEO207",
            str(path),
            f"{path} has the extension {path.suffix!r}; meshes that can be read: {', '.join(READABLE)}",
        )
    data = _content(path, log, limits)
    if extension in _READERS:
        wide = wide_encoding(data)
        if wide:
            message = f"{path} is {wide} text; expected ASCII, UTF-8 or Latin-1"
            log.fail(GeometryError, "GEO274", str(path), message, hint="save it as UTF-8")
        vertices, faces = _READERS[extension](data, str(path), log, limits)
    else:
        log.info("GEO208", str(path), f"{path} is no format of the original planner; read through trimesh")
        vertices, faces = _through_trimesh(data, extension, path, log, limits)
    largest = float(np.abs(vertices).max())
    if largest > LARGEST:
        message = f"{path} has a coordinate of {largest:.3g}; at most {LARGEST:g} can be computed with"
        log.fail(GeometryError, "GEO276", str(path), message, hint="is the file damaged, or in another format?")
    return Mesh.from_arrays(path.stem, vertices, faces, path)


def _content(path: Path, log: DiagnosticLog, limits: Limits) -> bytes:
    try:
        with open_regular(path) as file:
            # One byte more than allowed tells a large file without reading it.
            data = read_at_most(file, limits.file_bytes + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        log.fail(GeometryError, "GEO204", str(path), f"{path} cannot be read: {reason}")
    if len(data) > limits.file_bytes:
        log.fail(
            GeometryError,
            "GEO209",
            str(path),
            f"{path} has more than {limits.file_bytes} bytes",
            hint=Limits.hint("file_bytes"),
        )
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
        log.fail(GeometryError, "GEO226", str(path), message)
    if not len(vertices) or not len(faces):
        log.fail(GeometryError, "GEO210", str(path), f"{path} has no triangle", hint="expected at least one triangle")
    if not np.isfinite(vertices).all():
        log.fail(GeometryError, "GEO212", str(path), f"{path} has vertices that are not finite")
    if faces.min() < 0 or faces.max() >= len(vertices):
        message = f"{path} has a triangle with vertex {faces.max()}; expected 0 to {len(vertices) - 1}"
        log.fail(GeometryError, "GEO214", str(path), message)
    if max(len(vertices), faces.size) > limits.mesh_elements:
        message = (
            f"{path} has {len(vertices)} vertices and {faces.size} corners; at most {limits.mesh_elements} are read"
        )
        log.fail(GeometryError, "GEO209", str(path), message, hint=Limits.hint("mesh_elements"))
    return vertices, faces
