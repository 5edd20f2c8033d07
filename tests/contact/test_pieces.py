"""Verdicts of meshes in several pieces, some of them open: what is inside a closed one touches it."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from extras import missing, skip_without
from scenes import box_mesh, free_cube, write_scene

import env2mjcf

pytest.importorskip("fcl", reason="no python-fcl to compare with")

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

import verdicts
from generated import write_mesh
from pieces import Pieces, scene_of_pieces
from triangles import Truth

ENGINES = ["mujoco", *([] if missing("fast") else ["exact"])]
SMALL = box_mesh(0.1, 0.1, 0.1)


def nineteen_walls(folder: Path, extension: str, hole: int) -> tuple[env2mjcf.Scene, Pieces]:
    """Walls of 1 x 4 x 4 beside each other, every other pair of which touches; one has lost a triangle."""
    walls = [trimesh.creation.box((1, 4, 4)) for _ in range(19)]
    for i, wall in enumerate(walls):
        wall.apply_translation([3.0 * (i // 2) + (i % 2), 0, 0])
    faces = [w.faces if i != hole else w.faces[1:] for i, w in enumerate(walls)]
    sign = [np.full(len(f), int(i != hole)) for i, f in enumerate(faces)]
    piece = [np.full(len(f), i) for i, f in enumerate(faces)]
    mesh = trimesh.Trimesh(
        np.vstack([w.vertices for w in walls]), np.vstack([f + 8 * i for i, f in enumerate(faces)]), process=False
    )
    robot = "1\nsmall.g Volumetric Rotational\nConnections\n0\n"
    text = free_cube("0 0 0 0 0 0", robot=robot).replace("cube.g", f"walls.{extension}")
    path = write_scene(folder, text, small=SMALL)
    write_mesh(folder / f"walls.{extension}", mesh)
    return env2mjcf.load(path), Pieces(np.concatenate(piece), np.concatenate(sign))


@pytest.mark.parametrize("extension", ["g", "obj", "stl"])
@pytest.mark.parametrize("hole", [0, 7])
def test_one_open_wall_of_nineteen_leaves_the_others_solid(tmp_path: Path, extension: str, hole: int) -> None:
    scene, known = nineteen_walls(tmp_path, extension, hole)
    part = scene.compiled.assembly.obstacles[0]
    middles = np.array([part.mesh.vertices[part.mesh.faces[known.piece == i]].mean(axis=(0, 1)) for i in range(19)])
    q = np.zeros((19, 6))
    q[:, :3] = middles * (1, 0, 0) + (0, *part.mesh.vertices[:, 1:].mean(axis=0))
    q[:, 0] += 0.05
    expected = np.arange(19) != hole
    for engine in ENGINES:
        np.testing.assert_array_equal(scene.in_collision(q, engine=engine), expected)
    clearance = scene.clearance(q)
    assert (clearance[expected] < 0).all()
    assert clearance[hole] > 0
    surface = env2mjcf.load(tmp_path / "scene.env", collision="surface")
    for engine in ENGINES:
        assert not surface.in_collision(q, engine=engine).any()
    rows = np.random.default_rng(hole).uniform([-3, -3, -3, -3, -3, -3], [30, 3, 3, 3, 3, 3], (400, 6))
    rows[:, :3] += part.mesh.vertices.min(axis=0) + 2
    solid = Truth(scene, {f"walls.{extension}": known}).verdicts(rows)[1]
    assert 0.1 < solid.mean() < 0.9
    for engine in ENGINES:
        np.testing.assert_array_equal(scene.in_collision(rows, engine=engine), solid)
    mesh = next(m for m in scene.report.meshes if m.file.startswith("walls"))
    assert (mesh.solids, mesh.sheets, mesh.closed) == (18, 1, False)
    assert mesh.note.startswith("18 convex parts as hulls, 1 piece as a surface: 11 triangles in ")
    assert mesh.certificate is not None
    assert mesh.certificate.exact


def test_a_robot_with_an_open_piece_holds_what_is_in_its_closed_one(tmp_path: Path) -> None:
    """A small cube as an obstacle, in the closed and in the open box of a robot of two."""
    boxes = [trimesh.creation.box((2, 2, 2)) for _ in range(2)]
    boxes[1].apply_translation([4, 0, 0])
    mesh = trimesh.Trimesh(
        np.vstack([b.vertices for b in boxes]), np.vstack([boxes[0].faces, boxes[1].faces[1:] + 8]), process=False
    )
    write_mesh(tmp_path / "two.g", mesh)
    robot = "1\ntwo.g Volumetric Rotational\nConnections\n0\n"
    scene = env2mjcf.load(write_scene(tmp_path, free_cube("small.g 0 0 0 0 0 0", robot=robot), small=SMALL))
    # The mean of the vertices is halfway between the two.
    for engine in ENGINES:
        assert scene.in_collision([2.0, 0, 0, 0, 0, 0], engine=engine)
        assert not scene.in_collision([-2.0, 0, 0, 0, 0, 0], engine=engine)
        # A point of the closed one that is inside of the obstacle's surface only as a solid: both ways round.
        assert scene.in_collision([2.5, 0.3, -0.2, 0.3, 0.1, 0], engine=engine)
    # The solid is exact, and the open one a sheet of a hundredth of its own diagonal.
    area, diagonal = 24 - 2, float(np.sqrt(4 + 4 + 4))
    assert scene.report.mass == pytest.approx(1000 * (8 + area * diagonal / 100))
    assert any("a part of two in 11 triangles" in d.message for d in scene.diagnostics if d.code == "GEO250")


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow), pytest.param(3, marks=pytest.mark.slow)])
def test_no_verdict_on_random_pieces_is_wrong_outside_the_band(tmp_path: Path, seed: int, engine: str) -> None:
    case, known = scene_of_pieces(tmp_path, seed)
    result = verdicts.examine(case, 300, seed=1, engine=engine, known=known)
    for tally in result.tallies.values():
        assert tally.outside == []
        assert 0 < tally.colliding < tally.verdicts


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10, 40))
def test_many_random_pieces(tmp_path: Path, seed: int) -> None:
    skip_without("fast")
    case, known = scene_of_pieces(tmp_path, seed)
    for engine in ENGINES:
        assert [
            t.outside for t in verdicts.examine(case, 400, seed=1, engine=engine, known=known).tallies.values()
        ] == [[], []]
