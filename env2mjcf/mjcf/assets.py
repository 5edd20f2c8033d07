"""Mesh assets: visual meshes as binary STL or OBJ, convex cells as inline meshes in one included file per mesh."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field

import numpy as np
import trimesh
from lxml import etree
from trimesh.exchange.obj import export_obj
from trimesh.exchange.stl import export_stl

from ..geometry.mesh import Mesh
from ..geometry.shapes import CollisionShape
from ..model.names import file_stem, mesh_stem, unique
from ..transforms import Array
from .markup import ASSET_FOLDER, Element, add, to_text

# More faces than this in an STL file is an error of MuJoCo's loader.
_MAX_STL_FACES = 200_000
_HASH_LENGTH = 12


@dataclass(slots=True)
class AssetBook:
    """Collects the assets of a scene; equal geometry is written once.

    Attributes:
        files: Contents by path relative to the MJCF file.
    """

    files: dict[str, bytes] = field(default_factory=dict[str, bytes])
    _names: dict[Mesh, str] = field(default_factory=dict[Mesh, str])
    _cells: dict[Mesh, CollisionShape] = field(default_factory=dict[Mesh, CollisionShape])

    def plan(self, meshes: list[Mesh]) -> None:
        """Give every mesh a unique name, in order; meshes of equal geometry and stem share one."""
        first: dict[tuple[str, str], Mesh] = {}
        for mesh in meshes:
            first.setdefault((mesh_stem(mesh.name), mesh.digest), mesh)
        names = dict(zip(first, unique([stem for stem, _ in first]), strict=True))
        self._names = {m: names[mesh_stem(m.name), m.digest] for m in meshes}

    def visual_name(self, mesh: Mesh) -> str:
        """Return the name of a mesh's visual asset."""
        return self._names[mesh]

    def cell_name(self, mesh: Mesh, index: int) -> str:
        """Return the name of one convex cell's asset."""
        return f"{self._names[mesh]}:{index}"

    def use_cells(self, mesh: Mesh, shape: CollisionShape) -> None:
        """Write the cells of a mesh."""
        self._cells.setdefault(mesh, shape)

    def write(self, asset: Element) -> None:
        """Append all meshes to `<asset>`, and fill `files`."""
        written: set[str] = set()
        for mesh, name in self._names.items():
            if name in written:
                continue
            written.add(name)
            data, extension = _visual_file(mesh)
            add(asset, "mesh", name=name, file=self._keep(name, extension, data))
        for mesh, shape in self._cells.items():
            name = self._names[mesh]
            if f"{name}:" in written:
                continue
            written.add(f"{name}:")
            file = self._keep(f"{name}-cells", "xml", _cell_file(name, shape))
            add(asset, "include", file=f"{ASSET_FOLDER}/{file}")

    def _keep(self, name: str, extension: str, data: bytes) -> str:
        digest = hashlib.sha256(data).hexdigest()[:_HASH_LENGTH]
        file = f"{_file_stem(name)}-{digest}.{extension}"
        self.files[f"{ASSET_FOLDER}/{file}"] = data
        return file


def _file_stem(name: str) -> str:
    return file_stem("".join(c if c.isalnum() or c in "-_." else "_" for c in name)[:80])


def _visual_file(mesh: Mesh) -> tuple[bytes, str]:
    vertices, faces = _drawable(mesh)
    drawn = trimesh.Trimesh(vertices, faces, process=False)
    if len(faces) > _MAX_STL_FACES:
        return export_obj(drawn, include_normals=False, include_color=False, header="", digits=9).encode(), "obj"
    return export_stl(drawn), "stl"


def _drawable(mesh: Mesh) -> tuple[Array, np.ndarray]:
    """MuJoCo wants four vertices: a lone triangle is drawn as three about its centre."""
    faces = mesh.faces
    if len(np.unique(mesh.used_vertices, axis=0)) >= 4:
        return mesh.vertices, faces
    centers = mesh.vertices[faces].mean(axis=1)
    n = len(mesh.vertices) + np.arange(len(faces))
    a, b, c = faces.T
    return np.vstack([mesh.vertices, centers]), np.vstack(
        [np.stack(t, axis=1) for t in ((a, b, n), (b, c, n), (c, a, n))]
    )


def _cell_file(name: str, shape: CollisionShape) -> bytes:
    root = etree.Element("mujocoinclude")
    for i, piece in enumerate(shape.pieces):
        # MuJoCo keeps them as float32, which nine digits tell apart.
        corners = (piece.vertices.astype(np.float32) + 0.0).ravel().tolist()
        add(root, "mesh", name=f"{name}:{i}", vertex=" ".join(["%.9g"] * len(corners)) % tuple(corners))
    return to_text(root).encode("ascii", "xmlcharrefreplace")
