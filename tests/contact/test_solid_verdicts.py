"""Verdicts of non-convex pairs against python-fcl's triangles and containment, close to the border."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from real_scenes import FEW, real_scene
from scenes import MODELS, box_mesh, free_cube, write_scene
from truth import Truth, bisected, near_obstacles

import env2mjcf

# Fraction of a scene's extent within which a verdict may go either way.
BAND = 1e-5
ROWS = 60


def assert_right(scene: env2mjcf.Scene, rows: int = ROWS) -> None:
    truth = Truth(scene)
    q = np.vstack([bisected(scene, truth, rows, 24, seed=3), near_obstacles(scene, rows, seed=4)])
    verdicts = scene.in_collision(q, engine="mujoco")
    wrong = [
        row for row, verdict in zip(q, verdicts, strict=True) if truth.wrong(row, bool(verdict), BAND * scene.extent)
    ]
    assert wrong == []
    # Both verdicts occur, so that a constant answer fails.
    assert 0.2 < verdicts.mean() < 0.8 or rows < ROWS


@pytest.mark.slow_but("alpha")
@pytest.mark.parametrize("collision", ["solid", "auto"])
@pytest.mark.parametrize("name", ["alpha/alpha.env", "bug-trap/bug-trap.env", "maze/maze.xml", "seed/seed.env"])
def test_models(name: str, collision: str) -> None:
    assert_right(env2mjcf.load(MODELS / name, collision=collision))


@pytest.mark.slow_but(*FEW)
@pytest.mark.parametrize(
    "name",
    [
        "Maze.maze",
        "alpha1.6.alpha",
        "bug_trap1.0.bug-trap",
        "SerialWalls.serial",
        "LTunnel.tunnel",
        "Heterogeneous.heterogeneous2D",
    ],
)
def test_real_scenes(corpus: Path, name: str) -> None:
    real = real_scene(name)
    assert_right(env2mjcf.load(real.env, collision="solid", **real.keywords))


def test_the_comparison_finds_hulls_wrong() -> None:
    scene = env2mjcf.load(MODELS / "bug-trap/bug-trap.env", collision="hull")
    truth = Truth(scene)
    q = near_obstacles(scene, 40, seed=4)
    assert any(truth.wrong(row, bool(scene.in_collision(row, engine="mujoco")), BAND * scene.extent) for row in q)


def bottle_scene(folder: Path, half: float) -> env2mjcf.Scene:
    bottle = (MODELS / "bug-trap/bottle.g").read_text()
    text = free_cube("bottle.g 0 0 0 0 0 0")
    return env2mjcf.load(write_scene(folder, text, cube=box_mesh(half, half, half), bottle=bottle), collision="solid")


def test_a_body_wholly_inside_a_wall_collides_though_cells_are_thin(tmp_path: Path) -> None:
    """The bottle's wall is 0.14 thick, from radius 1.06 to 1.2; its bottom lies between z = -1.63 and -1.49."""
    scene = bottle_scene(tmp_path, 0.001)
    inside_wall = [[1.06 + x, 0, -0.5, 0, 0, 0] for x in (0.03, 0.07, 0.11)] + [[0.3, 0.2, -1.55, 0, 0, 0]]
    assert scene.in_collision(np.array(inside_wall)).all()
    assert not scene.in_collision(np.array([[0.9, 0, -0.5, 0, 0, 0], [1.3, 0, -0.5, 0, 0, 0]])).any()
    assert scene.contacts(np.array(inside_wall[1]))


def test_a_solid_collides_with_what_it_holds(tmp_path: Path) -> None:
    """The other way round: the small body is the obstacle, and the bottle is the robot."""
    bottle = (MODELS / "bug-trap/bottle.g").read_text()
    text = free_cube("cube.g 0 0 0 0 0 0", robot="1\nbottle.g Volumetric Rotational\nConnections\n0\n")
    small = box_mesh(0.001, 0.001, 0.001)
    scene = env2mjcf.load(write_scene(tmp_path, text, cube=small, bottle=bottle), collision="solid")
    assert scene.in_collision(np.array([-1.13, 0, 0.5, 0, 0, 0]))
    assert not scene.in_collision(np.array([-0.9, 0, 0.5, 0, 0, 0]))
