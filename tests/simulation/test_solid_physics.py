"""Bodies in and on non-convex solids, simulated with the settings that the converter writes."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from meshes import channel
from real_scenes import real_scene
from scenes import MODELS, box_mesh, free_cube, write_scene
from simulations import fall, simulated, start, weight
from truth import Truth

import env2mjcf
from env2mjcf.formats.meshes.byu import export_byu
from env2mjcf.geometry.assembly import Part
from env2mjcf.geometry.orientation import winding_numbers

SIZE = 0.7071  # diagonal of the box that is dropped
BOX = (0.25, 0.2, 0.15)  # its half sizes


def bottle_scene(folder: Path, **options: object) -> env2mjcf.Scene:
    """A box in the bottle of the bug trap: inner radius 1.06, floor at z = -1.49, neck at the top."""
    bottle = (MODELS / "bug-trap/bottle.g").read_text()
    return env2mjcf.load(
        write_scene(folder, free_cube("bottle.g 0 0 0 0 0 0"), cube=box_mesh(*BOX), bottle=bottle), **options
    )


def deepest(scene: env2mjcf.Scene) -> float:
    """How deep points of one mesh lie in the other, by winding numbers and trimesh; 0 if none does."""
    parts = {p.name: p for p in scene.compiled.assembly.parts()}
    poses = Truth(scene).poses(scene.q())
    return max(
        (_depth(parts[a], poses[a], parts[b], poses[b]) for pair in scene.pairs for a, b in (pair, pair[::-1])),
        default=0.0,
    )


def _depth(solid: Part, pose: np.ndarray, other: Part, other_pose: np.ndarray) -> float:
    triangles = other.mesh.vertices[other.mesh.faces]
    points = np.vstack([other.mesh.vertices, (triangles + np.roll(triangles, 1, axis=1)).reshape(-1, 3) / 2])
    points = points @ other_pose[:3, :3].T + other_pose[:3, 3]
    points = (points - pose[:3, 3]) @ pose[:3, :3]
    a = solid.analysis
    points = points[((points > a.vertices.min(axis=0)) & (points < a.vertices.max(axis=0))).all(axis=1)]
    points = points[winding_numbers(points, a.vertices, a.faces) > 0.5]
    if len(points) == 0:
        return 0.0
    surface = trimesh.Trimesh(a.vertices, a.faces, process=False)
    return float(np.abs(trimesh.proximity.closest_point_naive(surface, points)[1]).max())


def test_mujoco_feels_bodies_wholly_inside_of_a_solid(tmp_path: Path) -> None:
    """A small cube in the walls of a channel, each as thick as a sixth of its diagonal."""
    solid = channel()
    text = free_cube("channel.g 0 0 0 0 0 0")
    cube, mesh = box_mesh(0.02, 0.02, 0.02), trimesh.Trimesh(solid.vertices, solid.faces)
    scene = env2mjcf.load(write_scene(tmp_path, text, cube=cube, channel=export_byu(mesh)))
    rng = np.random.default_rng(0)
    points = rng.uniform(solid.vertices.min(axis=0), solid.vertices.max(axis=0), (1000, 3))
    points = points[winding_numbers(points, solid.vertices, solid.faces) > 0.5]
    assert len(points) > 500
    felt = 0
    for point in points - solid.vertices.mean(axis=0):
        scene.set(np.array([*point, 0, 0, 0]))
        mujoco.mj_forward(scene.model, scene.data)
        felt += scene.data.ncon > 0
    assert felt >= 0.94 * len(points)


@pytest.mark.parametrize("seed", range(3))
def test_a_box_dropped_into_a_bottle_comes_to_rest_in_it(tmp_path: Path, seed: int) -> None:
    scene = bottle_scene(tmp_path)
    turn = np.random.default_rng(seed).uniform(-np.pi, np.pi, 3)
    energy = start(scene, np.array([0.1, 0.05, -0.3, *turn]))
    places, depths, highest = [], [], []
    for t, top in enumerate(simulated(scene, 10)):
        highest.append(top)
        if t * 0.25 >= 8:
            places.append(scene.data.geom_xpos.copy())
            depths.append(deepest(scene))
    assert max(highest) <= energy + 0.01 * weight(scene) * SIZE
    assert max(depths) < 0.01 * SIZE
    assert np.abs(np.array(places) - places[-1]).max() < 0.01 * SIZE
    x, y, z = scene.q()[:3]
    assert np.hypot(x, y) < 1.06
    # It lies on its largest side or another one, on the floor.
    assert any(z == pytest.approx(-1.4855 + half, abs=0.03) for half in BOX)


@pytest.mark.parametrize("speed", [1.0, 3.0])
def test_a_box_thrown_in_a_closed_room_does_not_leave_it(tmp_path: Path, speed: float) -> None:
    scene = bottle_scene(tmp_path, gravity=(0.0, 0.0, 0.0))
    start(scene, np.array([0, 0, -0.5, 0.3, 0.2, 0.1]))
    scene.data.qvel[:3] = speed * np.array([0.8, 0.5, -0.33])
    mass = float(scene.model.body_mass.sum())
    for highest in simulated(scene, 5):
        # The neck is narrower than the box.
        assert np.hypot(*scene.q()[:2]) < 1.06
        assert -1.5 < scene.q()[2] < 1.4
        assert highest <= 1.01 * mass * speed**2 / 2


def test_a_hull_throws_the_box_out_of_the_bottle(tmp_path: Path) -> None:
    """What the tests above would look like with a wrong shape."""
    scene = bottle_scene(tmp_path, collision="hull")
    scene.set(np.array([0.1, 0.05, -0.3, 0.3, 0.2, 0.1]))
    for _ in simulated(scene, 3):
        pass
    assert np.linalg.norm(scene.q()[:3]) > 2


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_a_box_dropped_into_the_real_bug_trap_comes_to_rest_in_it(corpus: Path, tmp_path: Path, seed: int) -> None:
    trap = next(real_scene("bug_trap1.0.bug-trap").env.parent.rglob("trap.obj"))
    path = write_scene(tmp_path, free_cube("trap.g 0 2 0 20 10 40"), cube=box_mesh(2.5, 2, 1.5))
    path.write_text(path.read_text().replace("trap.g", "trap.obj"))
    scene = env2mjcf.load(path, mesh_dirs=(trap.parent,))
    turn = np.random.default_rng(seed).uniform(-np.pi, np.pi, 3)
    start(scene, np.array([0, 0, 6, *turn]))
    # It slides on over the faces of the bottle's wall for a while: no seam stops it.
    fall(scene, seconds=16, every=0.25).check()
    assert deepest(scene) < 0.01 * np.sqrt(5**2 + 4**2 + 3**2)
    # The trap is a bottle about 35 long; a free fall would have been of 490.
    assert np.linalg.norm(scene.q()[:3]) < 15
    assert scene.q()[2] < -8


@pytest.mark.slow
def test_a_non_convex_bug_comes_to_rest_in_the_bottle() -> None:
    scene = env2mjcf.load(MODELS / "bug-trap/bug-trap.env", query=MODELS / "bug-trap/bug-trap.query")
    start(scene, scene.queries[0].q[0])
    fall(scene, every=0.25).check()
    assert deepest(scene) < 0.01 * 1.0914
    assert -1.49 < scene.q()[2] < -1.1


@pytest.mark.slow
def test_alpha_tubes_hang_in_one_another() -> None:
    scene = env2mjcf.load(MODELS / "alpha/alpha.env", query=MODELS / "alpha/alpha.query")
    energy = start(scene, scene.queries[0].q[0])
    size = 4.271
    for t, highest in enumerate(simulated(scene, 10)):
        assert highest <= energy + 0.01 * weight(scene) * size
        if t % 4 == 3:
            assert deepest(scene) < 0.01 * size
    # Without the other tube it would have fallen 490 m; it has dropped by the play of the rings, and swings.
    assert abs(scene.q()[2] - scene.queries[0].q[0][2]) < 0.6
    assert np.abs(scene.data.qvel).max() < 2


@pytest.mark.slow
def test_alpha_tubes_hang_still_once_their_swing_is_taken_from_them() -> None:
    """They roll on each other like a pendulum, and would swing for minutes."""
    scene = env2mjcf.load(MODELS / "alpha/alpha.env", query=MODELS / "alpha/alpha.query")
    scene.set(scene.queries[0].q[0])
    while scene.data.time < 5:
        mujoco.mj_step(scene.model, scene.data)
        scene.data.qvel *= 0.99
    seen = fall(scene, every=0.25)
    seen.check()
    assert np.abs(seen.shifted).max() < 0.01 * 4.271
    assert deepest(scene) < 0.01 * 4.271


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bug_trap1.0.bug-trap", "alpha1.6.alpha"])
def test_real_bodies_stay_where_the_planner_says_that_they_are_caught(corpus: Path, name: str) -> None:
    real = real_scene(name)
    scene = env2mjcf.load(real.env, query=real.query, **real.keywords)
    q = scene.queries[0].q[0]
    energy = start(scene, q)
    size = scene.compiled.assembly.robots[0].links[0].mesh.diagonal
    depths = []
    for t, highest in enumerate(simulated(scene, 10)):
        assert highest <= energy + 0.01 * weight(scene) * size
        if t % 4 == 3:
            depths.append(deepest(scene))
    assert max(depths) < 0.01 * size
    # A free fall would have been of 490 m.
    assert np.linalg.norm(scene.q()[:3] - q[:3]) < scene.extent


def test_the_depth_measure_sees_a_box_in_the_floor(tmp_path: Path) -> None:
    scene = bottle_scene(tmp_path)
    scene.set(np.array([0, 0, -1.4855 + BOX[2] - 0.02, 0, 0, 0]))
    assert deepest(scene) == pytest.approx(0.02, abs=2e-3)
    scene.set(np.array([0, 0, -1.0, 0, 0, 0]))
    assert deepest(scene) == 0
