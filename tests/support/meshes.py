"""Meshes made by hand, whose sizes, volumes and verdicts are known by algebra."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from env2mjcf.diagnostics import CATALOGUE, DiagnosticLog
from env2mjcf.errors import GeometryError
from env2mjcf.geometry.mesh import Mesh, load_mesh
from env2mjcf.geometry.repair import repair_diagnostics, repaired
from env2mjcf.limits import Limits

Floats = NDArray[np.float64]

_BOX_SIDES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
_BOX_FACES = np.array([corners for a, b, c, d in _BOX_SIDES for corners in ([a, c, d], [a, b, c])])


def box(size: ArrayLike = (1.0, 1.0, 1.0), center: ArrayLike = (0.0, 0.0, 0.0)) -> Mesh:
    """Two triangles to a side, counter-clockwise from outside."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    return Mesh.from_arrays("box", corners * np.asarray(size) + np.asarray(center), _BOX_FACES)


def tetrahedron() -> Mesh:
    """The corner of the unit cube: volume 1/6."""
    return Mesh.from_arrays(
        "tetrahedron", np.vstack([np.zeros(3), np.eye(3)]), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    )


def channel(length: float = 4.0) -> Mesh:
    """A U of 3 x 3 along x, its walls and floor 1 thick: area of the section 7, of its hull 9."""
    section = np.array([[0, 0], [3, 0], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]], dtype=float)  # y, z
    n = len(section)
    ends = [np.column_stack([np.full(n, x), section]) for x in (0.0, length)]
    cap = np.array([[0, 1, 4], [0, 4, 5], [1, 2, 3], [1, 3, 4], [0, 5, 6], [0, 6, 7]])
    sides = [[[i, n + (i + 1) % n, (i + 1) % n], [i, n + i, n + (i + 1) % n]] for i in range(n)]
    faces = np.concatenate([cap[:, ::-1], cap + n, np.array(sides).reshape(-1, 3)[:, ::-1]])
    return Mesh.from_arrays("channel", np.vstack(ends), faces)


def grid(n: int, height: float = 0.0) -> Mesh:
    """A flat square sheet of n x n unit squares, normals up."""
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij")
    i = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate([np.stack([i, i + n + 1, i + n + 2], 1), np.stack([i, i + n + 2, i + 1], 1)])
    return Mesh.from_arrays("grid", np.column_stack([x.ravel(), y.ravel(), np.full(x.size, height)]), faces)


def joined(*meshes: Mesh) -> Mesh:
    """All in one mesh, as separate components."""
    offsets = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    faces = [m.faces + offset for m, offset in zip(meshes, offsets, strict=False)]
    return Mesh.from_arrays("joined", np.vstack([m.vertices for m in meshes]), np.vstack(faces))


def turned(mesh: Mesh, which: object = slice(None)) -> Mesh:
    """The winding of some or all faces reversed."""
    faces = mesh.faces.copy()
    faces[which] = faces[which][:, ::-1]  # type: ignore[index]
    return Mesh.from_arrays(mesh.name, mesh.vertices, faces)


def moved(mesh: Mesh, rotation: ArrayLike, offset: ArrayLike = (0.0, 0.0, 0.0)) -> Mesh:
    """Rotated, then shifted."""
    return Mesh.from_arrays(mesh.name, mesh.vertices @ np.asarray(rotation).T + np.asarray(offset), mesh.faces)


def soup(mesh: Mesh) -> Mesh:
    """Every triangle with vertices of its own."""
    return Mesh.from_arrays(mesh.name, mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size))


def rotation(seed: int) -> Floats:
    """A random rotation matrix."""
    q = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return q * np.sign(np.linalg.det(q))


def corpus_meshes(corpus: Path) -> list[Mesh]:
    """Every readable mesh of the corpus, equal ones once, in the order of their paths."""
    found: dict[str, Mesh] = {}
    for path in sorted(p for p in corpus.rglob("*") if p.suffix.lower() in {".g", ".obj"} and p.is_file()):
        try:
            mesh = load_mesh(path, DiagnosticLog(), Limits())
        except GeometryError:
            continue
        found.setdefault(mesh.digest, mesh)
    return list(found.values())


def voxels(planes: list[np.ndarray], filled: np.ndarray) -> trimesh.Trimesh:
    """Return the boundary of the filled cells of a grid, with the mean of its vertices at the origin."""
    solid = np.pad(filled, 1)
    corners, faces = [], []
    for cell in np.argwhere(filled):
        for axis, side in itertools.product(range(3), (0, 1)):
            beyond = cell + 1
            beyond[axis] += 2 * side - 1
            if solid[tuple(beyond)]:
                continue
            square = []
            for u, v in ((0, 0), (1, 0), (1, 1), (0, 1))[:: 1 if side else -1]:
                corner = cell.copy()
                corner[axis] += side
                corner[(axis + 1) % 3] += u
                corner[(axis + 2) % 3] += v
                square.append([p[i] for p, i in zip(planes, corner, strict=True)])
            n = len(corners)
            corners += square
            faces += [[n, n + 1, n + 2], [n, n + 2, n + 3]]
    mesh = trimesh.Trimesh(corners, faces)
    mesh.merge_vertices()
    mesh.vertices -= mesh.vertices.mean(axis=0)
    return mesh


def table(width: float, depth: float, height: float, thickness: float) -> trimesh.Trimesh:
    """A top and four legs in one closed mesh."""

    def across(side: float) -> np.ndarray:
        return np.array([-side / 2, -side / 2 + thickness, side / 2 - thickness, side / 2])

    filled = np.zeros((3, 3, 2), dtype=bool)
    filled[:, :, 1] = True
    filled[::2, ::2, 0] = True
    return voxels([across(width), across(depth), np.array([0, height - thickness, height])], filled)


def codes(mesh: Mesh) -> set[str]:
    log = DiagnosticLog()
    repair_diagnostics(mesh, repaired(mesh), log)
    assert all(d.code in CATALOGUE for d in log)
    return {d.code for d in log}


def assert_surface_stays(mesh: Mesh) -> None:
    a = repaired(mesh).analysis
    whole = mesh.faces[(np.diff(np.sort(mesh.faces, axis=1), axis=1) > 0).all(axis=1)]
    areas = np.cross(*(mesh.vertices[whole[:, i]] - mesh.vertices[whole[:, 0]] for i in (1, 2)))
    whole = whole[np.linalg.norm(areas, axis=1) > 1e-7 * mesh.diagonal**2]
    assert farthest(samples(mesh.vertices, whole), a.vertices, a.faces) <= 2e-9 * mesh.diagonal
    assert farthest(samples(a.vertices, a.faces), mesh.vertices, whole) <= 2e-9 * mesh.diagonal


def farthest(points: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> float:
    """Greatest distance of points from a surface, by trimesh."""
    surface = trimesh.Trimesh(vertices, faces, process=False)
    return float(np.abs(trimesh.proximity.closest_point_naive(surface, points)[1]).max())


def samples(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    weights = np.random.default_rng(0).dirichlet(np.ones(3), size=(len(faces), 3))
    return np.concatenate(
        [vertices[np.unique(faces)], np.einsum("fsk,fkj->fsj", weights, vertices[faces]).reshape(-1, 3)]
    )
