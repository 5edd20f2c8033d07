"""The configuration space: units, limits, qpos, sampling, interpolation."""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scenes import MODEL_FILES, MODELS, free_cube, write_scene

import env2mjcf
from env2mjcf.kinematics.forward import RobotKinematics
from env2mjcf.kinematics.space import ConfigurationSpace
from env2mjcf.model.environment import BaseKind, Body, Boundary, BoundaryShape, Dialect, MultiBody, MultiBodyKind


@pytest.fixture(params=MODEL_FILES, ids=lambda p: p.stem)
def scene(request: pytest.FixtureRequest) -> env2mjcf.Scene:
    return env2mjcf.load(request.param)


def test_names_and_slices_cover_the_space(scene: env2mjcf.Scene) -> None:
    space = scene.space
    assert len(set(space.names)) == space.dim == len(space.lower) == len(space.upper) == len(space.periodic)
    assert sum(s.stop - s.start for s in space.robot_slices) == space.robot_slices[-1].stop == space.dim
    assert all(name.split(".")[0] in "".join(scene.link_names) for name in space.names)


def test_encode_undoes_decode(scene: env2mjcf.Scene) -> None:
    cfg = np.random.default_rng(0).uniform(-1, 1, size=(5, scene.space.dim))
    np.testing.assert_allclose(scene.space.encode(scene.space.decode(cfg)), cfg, rtol=1e-15)
    np.testing.assert_allclose(scene.space.decode(2 * cfg), 2 * scene.space.decode(cfg), rtol=1e-15)


def test_qpos_and_back_is_the_same_pose(scene: env2mjcf.Scene) -> None:
    q = scene.space.sample(20, seed=1)
    back = scene.space.from_qpos(scene.space.qpos(q))
    loops = np.array(["(loop)" in n for n in scene.space.names], dtype=bool)
    np.testing.assert_allclose(back[:, loops], np.broadcast_to(scene.space.home[loops], back[:, loops].shape))
    np.testing.assert_allclose(scene.link_poses(back), scene.link_poses(q), atol=1e-6)


def test_samples_keep_limits_and_repeat(scene: env2mjcf.Scene) -> None:
    q = scene.space.sample(50, seed=3)
    assert q.shape == (50, scene.space.dim)
    assert scene.space.within_limits(q).all()
    np.testing.assert_array_equal(q, scene.space.sample(50, seed=3))
    assert not np.array_equal(q, scene.space.sample(50, seed=4))


def test_a_model_at_rest_is_at_home(scene: env2mjcf.Scene) -> None:
    data = mujoco.MjData(scene.model)
    np.testing.assert_allclose(scene.space.from_qpos(data.qpos), scene.space.home, atol=1e-12)
    np.testing.assert_allclose(scene.q(), scene.space.home, atol=1e-12)


def test_interpolation_goes_the_short_way_on_periodic_angles_only(tmp_path: Path) -> None:
    text = free_cube(
        robot="2\ncube.g Planar Rotational\ncube.g Joint\nConnections\n1\n0 1 Revolute -1:1\n"
        "2 0 0 0 0 0  0 0 0 0  0 0 0 0 0 0\n"
    )
    space = env2mjcf.load(write_scene(tmp_path, text)).space
    assert list(space.periodic) == [False, False, True, False]
    q0, q1 = np.array([0, 0, 3.0, 3.0]), np.array([1, 2, -3.0, -3.0])
    way = space.interpolate(q0, q1, 5)
    assert way.shape == (5, 4)
    np.testing.assert_array_equal(way[0], q0)
    np.testing.assert_allclose(way[-1, [0, 1, 3]], q1[[0, 1, 3]])
    np.testing.assert_allclose(way[-1, 2], -3.0 + 2 * math.pi)
    np.testing.assert_allclose(way[2, 3], 0.0, atol=1e-15)
    with pytest.raises(ValueError, match="at least 2"):
        space.interpolate(q0, q1, 1)


def test_hinges_of_dialect_a_turn_freely_and_later_ones_do_not() -> None:
    legacy, later = env2mjcf.load(MODELS / "seed/seed.env"), env2mjcf.load(MODELS / "closed-chain/closed-chain.env")
    assert legacy.space.periodic[3:].all()
    assert not later.space.periodic.any()
    q = legacy.space.home.copy()
    q[6] = 40.0
    assert legacy.is_valid(q)


def test_scale_turns_file_units_into_metres(tmp_path: Path) -> None:
    path = write_scene(tmp_path, free_cube("5 0 0 0 0 0"))
    space = env2mjcf.load(path, scale=0.01).space
    q = space.decode([100, 0, 0, 0.5, 0, 0])
    np.testing.assert_allclose(q, [1, 0, 0, math.pi / 2, 0, 0])
    np.testing.assert_allclose(space.upper[:3], 0.1)
    scene = env2mjcf.load(path, scale=0.01)
    np.testing.assert_allclose(scene.obstacle_poses()[0, :3, 3], [0.05, 0, 0])
    assert scene.in_collision([0.0401, 0, 0, 0, 0, 0])
    assert not scene.in_collision([0.0399, 0, 0, 0, 0, 0])


def test_an_unbounded_base_is_drawn_around_the_obstacles(tmp_path: Path) -> None:
    text = "2\nActive\n1\ncube.g Volumetric Translational\nConnections\n0\nPassive\ncube.g 20 0 0 0 0 0\n"
    space = env2mjcf.load(write_scene(tmp_path, text)).space
    assert np.isinf(space.upper).all()
    q = space.sample(500, seed=0)
    radius = math.sqrt(0.75)
    assert q[:, 0].min() > 19.5 - radius - 1e-9
    assert q[:, 0].max() < 20.5 + radius + 1e-9
    assert np.ptp(q[:, 1]) > 1.5 * (0.5 + radius)


@pytest.mark.parametrize(
    ("q", "message"),
    [
        ([0.0] * 5, r"shape \(5,\).*expected \(6,\)"),
        ([[[0.0] * 6]], "expected"),
        ([0, 0, float("nan"), 0, 0, 0], r"cube\.z is nan"),
        ([[0] * 6, [0, 0, 0, 0, float("inf"), 0]], r"cube\.ry is inf in row 1"),
    ],
)
def test_a_bad_configuration_is_named(tmp_path: Path, q: object, message: str) -> None:
    scene = env2mjcf.load(write_scene(tmp_path, free_cube("5 0 0 0 0 0")))
    for query in (scene.in_collision, scene.is_valid, scene.link_poses, scene.loop_error):
        with pytest.raises(ValueError, match=message):
            query(q)


def test_what_has_no_limits_is_drawn_from_the_obstacles_grown_by_the_robot(tmp_path: Path) -> None:
    text = "2\nActive\n1\ncube.g Volumetric Translational\nConnections\n0\nPassive\ncube.g 20 5 -3 0 0 0\n"
    space = env2mjcf.load(write_scene(tmp_path, text)).space
    lower, upper = space.sample_limits
    reach = 0.5 + math.sqrt(0.75)  # half a cube, and the corner of the one that flies
    np.testing.assert_allclose(lower, np.array([20, 5, -3]) - reach)
    np.testing.assert_allclose(upper, np.array([20, 5, -3]) + reach)


@pytest.mark.parametrize(
    ("given", "drawn"),
    [
        ((-np.inf, 4.0), (-2.0, 4.0)),  # the obstacles' side, for it is below the limit
        ((-np.inf, -7.0), (-11.0, -7.0)),  # the box's size below it, for it is not
        ((1.0, np.inf), (1.0, 2.0)),
        ((7.0, np.inf), (7.0, 11.0)),
        ((-7.0, 7.0), (-7.0, 7.0)),
    ],
)
def test_what_has_one_limit_is_drawn_beside_it(given: tuple[float, float], drawn: tuple[float, float]) -> None:
    flat = MultiBody(MultiBodyKind.ACTIVE, (Body("a.g", BaseKind.PLANAR_TRANSLATIONAL),), dialect=Dialect.D)
    robot = RobotKinematics.of(flat)
    box = np.full(3, -2.0), np.full(3, 2.0)
    limits = Boundary(BoundaryShape.BOX2D, lower=(given[0], 0.0), upper=(given[1], 1.0))
    space = ConfigurationSpace([robot], ["x", "y"], [np.zeros(2)], limits, 1.0, box)
    lower, upper = space.sample_limits
    assert (lower.tolist(), upper.tolist()) == ([drawn[0], 0.0], [drawn[1], 1.0])


def test_robots_that_a_query_does_not_name_stand_at_home() -> None:
    scene = env2mjcf.load(MODELS / "two-robots/two-robots.env", query=MODELS / "two-robots/two-robots.query")
    car, arm = scene.space.robot_slices
    (task,) = [t for t in scene.compiled.environment.tasks if t.robots == (1,)]
    (q,) = scene.space.of_tasks([task])
    # The file's own theta of each joint, in radians.
    np.testing.assert_allclose(scene.space.home[arm], [-2.2, 1.1, -1.3])
    (of_car,) = scene.space.of_tasks([t for t in scene.compiled.environment.tasks if t.robots == (0,)])
    np.testing.assert_allclose(of_car[:, arm], [[-2.2, 1.1, -1.3]] * len(of_car))
    np.testing.assert_array_equal(q[:, car], np.zeros((len(q), 3)))
