"""Write scenes whose meshes are in many pieces, some of them open, and say which: the same at every run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from generated import SEED, Placed, scene, write_mesh
from table import Case

FORMATS = (".g", ".obj", ".stl")

_STEP = np.array([[1.0, 0, 0], [1.0, 1.0, 0], [1.0, 1.0, 1.0]])
"""Where a box must go to share a wall, an edge, a corner with another one, in sizes."""


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """What is known of a mesh, by the order of the faces in its file.

    Attributes:
        piece: (m,) piece of each face.
        sign: (m,) 1 and -1 of a closed piece: wound outwards, and the other way; 0 of an open one.
    """

    piece: np.ndarray
    sign: np.ndarray

    def enclosing(self, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
        """Return the triangles of the closed pieces, (k, 3, 3), as they should be wound."""
        faces = np.where(self.sign[:, None] < 0, faces[:, ::-1], faces)
        return vertices[faces[self.sign != 0]]

    def points(self, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
        """Return one corner of each piece, (c, 3)."""
        return vertices[faces[np.unique(self.piece, return_index=True)[1], 0]]


@dataclass(slots=True, eq=False)
class _Part:
    """A closed surface, whether it is a cavity in the part before it, and whether it is only a sheet."""

    vertices: np.ndarray
    faces: np.ndarray
    cavity: bool = False
    sheet: bool = False


def scene_of_pieces(folder: Path, seed: int, holes: float = 0.3) -> tuple[Case, dict[str, Pieces]]:
    """Return a free robot of up to three pieces among up to four obstacles of up to twelve, and what is known of them.

    Each closed piece loses a face or two with a probability of `holes`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([SEED, seed])
    scale = 10.0 ** rng.uniform(-2, 2)
    known: dict[str, Pieces] = {}
    placed = []
    for i in range(int(rng.integers(1, 5))):
        extension = FORMATS[int(rng.integers(len(FORMATS)))]
        name = f"walls{i}{extension}"
        groups = [_group(rng) for _ in range(int(rng.integers(1, 5)))]
        known[name] = _write(folder / name, groups, scale, holes, rng, spread=1.6)
        placed.append(Placed(name, scale * rng.uniform(-1, 1, 3) * (4.0 * (i > 0)), rng.uniform(-180, 180, 3)))
    small = [_group(rng) for _ in range(int(rng.integers(1, 3)))]
    known["robot.obj"] = _write(folder / "robot.obj", small, scale * rng.uniform(0.03, 0.3), holes, rng, spread=0.9)
    robot = ["1", "robot.obj Volumetric Rotational", "Connections", "0"]
    return scene(folder, f"pieces{seed}", 14.0 * scale, robot, placed), known


def _group(rng: np.random.Generator) -> list[_Part]:
    """Return surfaces that belong together, about the origin and about as large as 1."""
    size = rng.uniform(0.3, 1.0, 3)
    box = trimesh.creation.box(size)

    def part(mesh: trimesh.Trimesh, by: np.ndarray | float = 0.0, of: float = 1.0, cavity: bool = False) -> _Part:
        faces = np.array(mesh.faces)
        return _Part(np.array(mesh.vertices) * of + by, faces[:, ::-1] if cavity else faces, cavity)

    kind = int(rng.integers(10))
    if kind == 0:
        return [part(trimesh.creation.icosphere(1, 0.5))]
    if kind == 1:
        return [part(trimesh.creation.torus(0.4, 0.15, major_sections=8, minor_sections=6))]
    if kind == 2:
        return [part(trimesh.creation.annulus(0.2, 0.5, 0.4, sections=8))]
    if kind == 3:
        return [part(box), part(box, of=rng.uniform(0.4, 0.9), cavity=True)]
    if kind == 4:
        return [part(box), part(box, of=rng.uniform(0.4, 0.9))]
    if kind == 5:
        return [part(box), part(box, by=size * rng.uniform(0.2, 0.8, 3))]
    if kind == 6:
        low, high = np.array(box.vertices)[[0, -1]]
        fin = np.array([[high[0], high[1], low[2]], high, [high[0] + 0.3, high[1] + 0.3, 0.0]])
        return [part(box), _Part(fin, np.array([[0, 1, 2]]), sheet=True)]
    if kind == 7:
        return [part(box)]
    return [part(box), part(box, by=size * _STEP[int(rng.integers(3))])]


def _write(
    path: Path, groups: Sequence[list[_Part]], scale: float, holes: float, rng: np.random.Generator, spread: float
) -> Pieces:
    """Put groups beside each other, make holes in them, write them, and return what they are."""
    vertices, faces, piece, sign = [], [], [], []
    count = number = 0
    for k, group in enumerate(groups):
        turn = trimesh.transformations.random_rotation_matrix(rng.random(3))[:3, :3]
        inverted = rng.random() < 0.3
        open_before = False
        for part in group:
            own = part.faces
            lost = 0 if part.sheet or rng.random() >= holes else int(rng.integers(1, 3))
            own = np.delete(own, rng.choice(len(own), lost, replace=False), axis=0)
            # A hollow piece that is open has no cavity: what is in it is a solid of its own.
            outward = -1 if part.cavity and open_before else 1
            # Rounded as a binary STL rounds, so that all formats hold the same numbers.
            moved = (part.vertices @ turn.T + [spread * k, 0.0, 0.0]) * scale
            vertices.append(moved.astype(np.float32).astype(np.float64))
            faces.append((own[:, ::-1] if inverted else own) + count)
            sign.append(np.full(len(own), 0 if lost or part.sheet else outward * (-1 if inverted else 1)))
            piece.append(np.full(len(own), number))
            count, number = count + len(moved), number + 1
            open_before = open_before or lost > 0
    points, corners = np.vstack(vertices), np.vstack(faces)
    if path.suffix == ".stl" or rng.random() < 0.5:
        points, index = np.unique(points, axis=0, return_inverse=True)
        corners = index.reshape(-1)[corners]
    write_mesh(path, trimesh.Trimesh(points, corners, process=False))
    return Pieces(np.concatenate(piece), np.concatenate(sign))
