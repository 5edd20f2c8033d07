"""The scenes in `models/`."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenes import SCENES

import env2mjcf

MODELS = Path(__file__).parents[1] / "models"
MESHES = sorted(MODELS.glob("*/**/*.g"))
DIALECTS_AND_DOFS = {
    "seed": ("A", [9]),
    "gantry": ("A", [4]),
    "bug-trap": ("B", [6]),
    "spherical-arm": ("C", [6]),
    "closed-chain": ("D", [4]),
    "alpha": ("D", [6]),
    "two-robots": ("D", [3, 3]),
    "maze": ("E", [3]),
    "xml-arm": ("E", [5]),
}


def built(*arguments: str, seed: str = "0") -> int:
    """Run the script in a process of its own; return its exit status."""
    environment = {**os.environ, "PYTHONHASHSEED": seed}
    command = [sys.executable, str(MODELS / "build.py"), *arguments]
    return subprocess.run(command, env=environment, check=False, capture_output=True).returncode


def contents(folder: Path) -> dict[str, bytes]:
    """Return the files of the scenes below a folder."""
    files = (p for scene in DIALECTS_AND_DOFS for p in (folder / scene).rglob("*") if p.is_file())
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in files}


def read_g(path: Path) -> tuple[np.ndarray, list[list[int]]]:
    """Read a `.g` file without the package: vertices and polygons from 0."""
    tokens = iter(path.read_text().split())
    parts, n_vertices, n_polygons, _ = (int(next(tokens)) for _ in range(4))
    sizes = [1 - int(next(tokens)) + int(next(tokens)) for _ in range(parts)]
    assert sum(sizes) == n_polygons
    vertices = np.array([float(next(tokens)) for _ in range(3 * n_vertices)]).reshape(-1, 3)
    polygons: list[list[int]] = [[] for _ in range(n_polygons)]
    for polygon in polygons:
        while not polygon or polygon[-1] > 0:
            polygon.append(int(next(tokens)))
    assert next(tokens, None) is None
    return vertices, [[abs(i) - 1 for i in p] for p in polygons]


def read(scene: str) -> env2mjcf.model.environment.Environment:
    """Read a scene with its robots and its query."""
    options = {
        k: [str(MODELS / v) for v in vs] if k == "robots" else str(MODELS / vs) for k, vs in SCENES[scene].items()
    }
    return env2mjcf.read(MODELS / scene, **options)


@pytest.mark.parametrize("seed", ["1", "4242"])
def test_the_script_writes_the_committed_bytes(tmp_path: Path, seed: str) -> None:
    assert built("--out", str(tmp_path), seed=seed) == 0
    assert contents(tmp_path) == contents(MODELS)


def test_check_finds_a_changed_a_missing_and_a_needless_file(tmp_path: Path) -> None:
    assert built("--check") == 0
    assert built("--out", str(tmp_path)) == 0
    cube = tmp_path / "seed" / "cube.g"
    text = cube.read_text()
    cube.write_text(text.replace("-0.2", "-0.3", 1))
    assert built("--check", "--out", str(tmp_path)) == 1
    cube.unlink()
    assert built("--check", "--out", str(tmp_path)) == 1
    cube.write_text(text)
    assert built("--check", "--out", str(tmp_path)) == 0
    (tmp_path / "seed" / "extra.g").write_text(text)
    assert built("--check", "--out", str(tmp_path)) == 1


@pytest.mark.parametrize("path", MESHES, ids=lambda p: p.relative_to(MODELS).as_posix())
def test_a_mesh_is_a_closed_surface_seen_from_outside(path: Path) -> None:
    vertices, polygons = read_g(path)
    faces = [(p[0], p[k], p[k + 1]) for p in polygons for k in range(1, len(p) - 1)]
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    pytest.importorskip("scipy", reason="no scipy, with which trimesh takes meshes apart")
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert all(part.volume > 0 for part in mesh.split())
    _, faces_of_edge = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    assert set(faces_of_edge.tolist()) == {2}
    assert np.degrees(mesh.face_angles.min()) > 3, "a sliver"


def test_quadrilaterals_and_parts_occur() -> None:
    assert {len(corners) for corners in read_g(MODELS / "gantry/frame.g")[1]} == {4}
    assert (MODELS / "two-robots/meshes/car.g").read_text().startswith("5 ")


def test_the_seed_is_the_pages_example() -> None:
    page = """3 MultiBody Active 4
        FreeBody 0 cube.g 0 0 0 0 0 0 FreeBody 1 link1.g FreeBody 2 link2.g FreeBody 3 link3.g
        Connection 3 0 1 Actuated 0.2 0 0 -90 0 0 90 0.2 0 30 Revolute 0 0 0 0 0 0
        1 2 Actuated 0.2 0 0 -90 0 0 90 0.2 0 30 Revolute 0 0 0 0 0 0
        2 3 Actuated 0.2 0 0 -90 0 0 90 0.2 0 30 Revolute 0 0 0 0 0 0
        MultiBody Passive 1 FixedBody 0 block.g 0 2.0 0 0 0 0 Connection 0
        MultiBody Passive 1 FixedBody 0 block.g 0 2.0 0 0 0 0 Connection 0"""
    assert (MODELS / "seed/seed.env").read_text().split() == page.split()


def test_the_closed_chain_is_closed_at_home_and_in_its_query() -> None:
    text = (MODELS / "closed-chain/closed-chain.env").read_text().split("Connections\n4\n")[1].split("\n")
    rows = [[float(v) for v in text[k].split()] for k in (1, 3, 5, 7)]
    home = [row[9] for row in rows]
    queries = (MODELS / "closed-chain/closed-chain.query").read_text().splitlines()
    for angles in [home, *([np.pi * float(v) for v in q.split()[1:]] for q in queries)]:
        crank, coupler, rocker, last = (_planar(row, angle) for row, angle in zip(rows, angles, strict=True))
        assert np.abs(crank @ coupler @ last - rocker).max() < 1e-12
    assert np.allclose([float(v) for v in queries[0].split()[1:]], np.array(home) / np.pi, atol=1e-13)


def _planar(row: list[float], theta: float) -> np.ndarray:
    """Return a connection's transform where rotations are about z only: T_toDH, Rz(theta) Tz(d), T_toBody."""
    (x, y, z), (d, (u, v, w)) = row[0:3], (row[8], row[10:13])
    assert not any([*row[3:8], *row[13:16]])
    c, s = np.cos(theta), np.sin(theta)
    return np.array([[c, -s, 0, x + c * u - s * v], [s, c, 0, y + s * u + c * v], [0, 0, 1, z + d + w], [0, 0, 0, 1.0]])


@pytest.mark.parametrize("scene", SCENES)
def test_a_scene_reads_without_warnings(scene: str) -> None:
    environment = read(scene)
    assert [d for d in environment.diagnostics if d.severity != "info"] == []
    dialect, dofs = DIALECTS_AND_DOFS[scene.split("/", maxsplit=1)[0]]
    assert environment.dialect == dialect
    assert len(environment.robots) == len(dofs)
    for task in environment.tasks:
        assert [len(c) for c in task.configurations] == [dofs[task.robot]] * 2
    assert all((environment.directory / b.filename).is_file() for m in environment.multibodies for b in m.bodies)
