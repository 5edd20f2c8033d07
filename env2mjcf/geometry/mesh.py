"""A triangle mesh in its body's frame."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..model import Recentring


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Triangles over the vertex list of a file.

    Attributes:
        name: Stem of the file.
        vertices: (n, 3) float64, read-only; every vertex of the file in its order, used or not.
        faces: (m, 3) int64, read-only; indices into `vertices`, counter-clockwise from outside.
        path: The file that it was read from.
    """

    name: str
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    path: Path

    @classmethod
    def from_arrays(cls, name: str, vertices: object, faces: object, path: Path = Path()) -> Mesh:
        """Build a mesh from anything array-like; the arrays are copied and made read-only."""
        v = np.array(vertices, dtype=np.float64).reshape(-1, 3)
        f = np.array(faces, dtype=np.int64).reshape(-1, 3)
        v.setflags(write=False)
        f.setflags(write=False)
        return cls(name, v, f, path)

    @property
    def diagonal(self) -> float:
        """Diagonal of the bounding box of the vertices that faces use."""
        used = self.vertices[self.faces.reshape(-1)]
        return float(np.linalg.norm(used.max(axis=0) - used.min(axis=0)))

    @property
    def digest(self) -> str:
        """Hash of vertices and faces: equal for equal geometry, whatever the file is called."""
        h = hashlib.sha256()
        # Adding 0.0 turns -0.0 into 0.0, so that equal numbers give equal bytes.
        h.update((self.vertices + 0.0).tobytes())
        h.update(b"|")
        h.update(self.faces.tobytes())
        return h.hexdigest()

    def recentred(self, recentring: Recentring) -> Mesh:
        """Return the mesh as the planner places it (env-format section 10.3).

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
