"""The Scene: verdicts, validity, contacts, edges, paths, and what surrounds them."""

from __future__ import annotations

import copy
import pickle
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import mujoco
import numpy as np
import pytest
from extras import skip_without
from scenes import box_mesh, free_cube, notched_block, write_scene

import env2mjcf


@pytest.fixture
def cubes(tmp_path: Path) -> env2mjcf.Scene:
    """A unit cube that flies between two others, five metres to either side."""
    return env2mjcf.load(write_scene(tmp_path, free_cube("5 0 0 0 0 0", "-5 0 0 0 0 0")))


def at(*xyz: float) -> np.ndarray:
    return np.array([*xyz, 0, 0, 0])


def test_one_row_gives_a_bool_and_many_rows_an_array(cubes: env2mjcf.Scene) -> None:
    assert cubes.in_collision(at(4.5, 0, 0)) is True
    assert cubes.in_collision(at(0, 0, 0)) is False
    rows = np.stack([at(4.5, 0, 0), at(0, 0, 0), at(-4.1, 0, 0)])
    found = cubes.in_collision(rows)
    assert found.dtype == bool
    np.testing.assert_array_equal(found, [True, False, True])
    assert cubes.in_collision(np.zeros((0, 6))).shape == (0,)
    assert cubes.is_valid(np.zeros((0, 6))).shape == (0,)
    assert cubes.link_poses(np.zeros((0, 6))).shape == (0, 1, 4, 4)


@pytest.mark.parametrize("collision", ["hull", "surface", "auto"])
def test_the_verdict_turns_where_the_cubes_touch(tmp_path: Path, collision: str) -> None:
    scene = env2mjcf.load(write_scene(tmp_path, free_cube("5 0 0 0 0 0")), collision=collision)
    band = 1e-5 * scene.extent
    assert not scene.in_collision(at(4 - band, 0.1, 0.2))
    assert scene.in_collision(at(4 + band, 0.1, 0.2))


def test_threads_change_nothing(cubes: env2mjcf.Scene) -> None:
    q = cubes.space.sample(6000, seed=0)
    one, two = cubes.in_collision(q, threads=1), cubes.in_collision(q, threads=2)
    np.testing.assert_array_equal(one, two)
    assert 0 < one.sum() < len(one)
    with pytest.raises(ValueError, match="at least 1"):
        cubes.in_collision(q, threads=0)


def test_a_scene_may_be_shared_by_threads(cubes: env2mjcf.Scene) -> None:
    q = cubes.space.sample(2000, seed=2)
    expected, found = cubes.in_collision(q), {}
    workers = [threading.Thread(target=lambda i=i: found.update({i: cubes.in_collision(q)})) for i in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    for answers in found.values():
        np.testing.assert_array_equal(answers, expected)
    assert len(found) == 4


def test_validity_wants_limits_boundary_and_freedom(tmp_path: Path) -> None:
    robot = "2\ncube.g Planar Rotational\ncube.g Joint\nConnections\n1\n0 1 Revolute -0.5:0.5\n" \
            "0.6 0 0 0 0 0  0 0 0 0  0.6 0 0 0 0 0\n"  # fmt: skip
    text = free_cube("5 5 0 0 0 0", boundary="Boundary Box2D [-10:10 ; -10:10]", robot=robot)
    scene = env2mjcf.load(write_scene(tmp_path, text))
    home = np.zeros(4)
    assert scene.is_valid(home)
    assert not scene.is_valid([0, 0, 0, 0.5 * np.pi + 1e-9])
    assert scene.is_valid([0, 0, 20.0, 0.5 * np.pi])
    # The second cube's far side is 1.2 + 0.5 before the base.
    assert scene.is_valid([8.3, 0, 0, 0])
    assert not scene.is_valid([8.3 + 1e-6, 0, 0, 0])
    assert scene.in_collision([5, 5, 0, 0])
    assert not scene.is_valid([5, 5, 0, 0])


def test_a_ball_bounds_the_farthest_vertex(tmp_path: Path) -> None:
    text = free_cube("1 0 0 0 0 0", boundary="Boundary Sphere [ 0 0 0 ; 9 ]")
    scene = env2mjcf.load(write_scene(tmp_path, text))
    reach = np.sqrt(81 - 0.5) - 0.5
    assert scene.is_valid(at(-reach + 1e-9, 0, 0))
    assert not scene.is_valid(at(-reach - 1e-6, 0, 0))


@pytest.mark.parametrize("engine", ["mujoco", "exact"])
def test_a_vertex_on_the_boundary_is_inside_on_every_side(tmp_path: Path, engine: str) -> None:
    """The boundary is closed, and a place is known to a rounding of it: 1e-12 of 10 m."""
    if engine == "exact":
        skip_without("fast")
    scene = env2mjcf.load(write_scene(tmp_path, free_cube("1 1 1 0 0 0")), engine=engine)
    for axis in range(3):
        for side in (-1, 1):
            for beyond, inside in ((0.0, True), (5e-12, True), (5e-11, False)):
                q = np.zeros(6)
                q[axis] = side * (9.5 + beyond)
                assert scene.is_valid(q) is inside, (axis, side, beyond)


def test_contacts_tell_who_where_and_how_deep(cubes: env2mjcf.Scene) -> None:
    right, left = cubes.contacts(at(4.25, 0, 0)), cubes.contacts(at(-4.25, 0, 0))
    assert {(c.link, c.other, c.kind) for c in right} == {("cube", "cube_2", "obstacle")}
    assert {(c.link, c.other, c.kind) for c in left} == {("cube", "cube_3", "obstacle")}
    for contacts, sign in ((right, 1), (left, -1)):
        deepest = min(contacts, key=lambda c: c.distance)
        assert deepest.distance == pytest.approx(-0.25, abs=1e-6)
        np.testing.assert_allclose(deepest.normal, [sign, 0, 0], atol=1e-6)
        assert abs(deepest.position[0] * sign - 4.625) < 0.13
    assert cubes.contacts(at(0, 0, 0)) == []


def test_a_body_inside_a_hollow_one_is_seen_by_auto_and_not_by_surface(tmp_path: Path) -> None:
    """A block with a notch is not convex; a small cube wholly inside its flesh touches no surface."""
    notched = notched_block()
    text = free_cube("block.g 0 0 0 0 0 0", robot="1\nsmall.g Volumetric Rotational\nConnections\n0\n")
    path = write_scene(tmp_path, text, block=notched, small=box_mesh(0.1, 0.1, 0.1))
    auto, surface = env2mjcf.load(path), env2mjcf.load(path, collision="surface")
    mean = np.array([0, 0, notch_mean()])
    inside, notch, outside = at(0, 0, -0.5 - mean[2]), at(0, 0, 0.9 - mean[2]), at(0, 0, 3)
    assert auto.in_collision(inside)
    assert not surface.in_collision(inside)
    for scene in (auto, surface):
        assert not scene.in_collision(notch)
        assert not scene.in_collision(outside)
    assert env2mjcf.load(path, collision="hull").in_collision(notch)
    contact = auto.contacts(inside)
    assert [(c.link, c.other) for c in contact] == [("small", "block")]
    assert contact[0].distance < 0


def notch_mean() -> float:
    """z of the mean of the block's vertices, on which it is recentred."""
    return float(np.mean([-1, -1, 1, 1, 0.25, 0.25, 1, 1]))


def test_plates_that_cross_in_one_plane_collide(tmp_path: Path) -> None:
    """MuJoCo's native algorithm misses some overlaps of aligned boxes; verdicts must not."""
    robot = "1\nplate.g Volumetric Rotational\nConnections\n0\n"
    text = free_cube("plate.g 0 0 0 0 0 0", robot=robot, boundary="Boundary Box [-30:30 ; -30:30 ; -30:30]")
    scene = env2mjcf.load(write_scene(tmp_path, text, plate=box_mesh(0.5, 0.05, 0.005)))
    rng = np.random.default_rng(0)
    rows = np.zeros((4000, 6))
    rows[:, :2] = np.round(rng.uniform(-0.5, 0.5, (4000, 2)) * 8) / 8
    rows[:, 5] = rng.integers(0, 8, 4000) * np.pi / 4
    # Both plates lie in one plane: they overlap where their rectangles do (separating axes of the plane).
    angle = rows[:, 5]
    axes = np.stack([np.ones(4000), np.zeros(4000), np.cos(angle), np.sin(angle)], 1).reshape(4000, 2, 2)
    axes = np.concatenate([axes, np.stack([-axes[..., 1], axes[..., 0]], -1)], axis=1)
    turned = np.stack([np.stack([np.cos(angle), np.sin(angle)], -1), np.stack([-np.sin(angle), np.cos(angle)], -1)], 1)
    reach = np.abs(axes) @ [0.5, 0.05] + np.abs(np.einsum("nak,nsk->nas", axes, turned)) @ [0.5, 0.05]
    depth = (reach - np.abs(np.einsum("nak,nk->na", axes, rows[:, :2]))).min(axis=1)
    sure = np.abs(depth) > 1e-5 * scene.extent
    assert 500 < (depth[sure] > 0).sum() < 3900
    np.testing.assert_array_equal(scene.in_collision(rows)[sure], depth[sure] > 0)


def test_a_base_beside_its_mesh_may_lie_outside_the_boundary(tmp_path: Path) -> None:
    """The boundary is one of vertices: the origin of a mesh that is not recentred does not count."""
    lines = box_mesh(0.5, 0.5, 0.5).splitlines()
    lines[2:10] = [f"{float(x) + 5} {y} {z}" for x, y, z in (line.split() for line in lines[2:10])]
    robot = "1\noff.g -a(None) Planar Rotational\nConnections\n0\n"
    text = free_cube("0 0 0 0 0 0", boundary="Boundary Box [-3:3 ; -3:3 ; -3:3]", robot=robot)
    scene = env2mjcf.load(write_scene(tmp_path, text, off="\n".join(lines) + "\n"))
    assert scene.is_valid([-6.5, 0, 0])
    assert not scene.is_valid([-1.5, 0, 0])
    assert not scene.is_valid([-5, 0, 0])


def test_a_call_is_checked_as_the_options_are(cubes: env2mjcf.Scene) -> None:
    assert cubes.in_collision(np.zeros((0, 6)), threads=3).shape == (0,)
    with pytest.raises(ValueError, match="'foo' is not one of"):
        cubes.in_collision(at(0, 0, 0), engine="foo")
    with pytest.raises(ValueError, match="expected real numbers"):
        cubes.in_collision(["a"] * 6)
    with pytest.raises(TypeError, match="expected a whole number"):
        cubes.in_collision(at(0, 0, 0), threads=1.5)  # type: ignore[arg-type]
    for bad in ("a", [0.1], True):
        with pytest.raises(TypeError, match="expected a number"):
            cubes.resolution(bad)  # type: ignore[arg-type]


def test_what_a_query_returns_stays_as_it_is(cubes: env2mjcf.Scene) -> None:
    row, path = at(4.5, 0, 0), np.stack([at(4.5, 0, 0), at(0, 0, 0)])
    verdict, report = cubes.explain(row), cubes.check_path(path)
    row[:], path[:] = 7, 7
    assert report.invalid_q is not None
    np.testing.assert_array_equal([verdict.q, report.invalid_q], [at(4.5, 0, 0)] * 2)
    assert repr(cubes.packed_contacts(np.tile(at(0, 0, 0), (9, 1)))) == "<PackedContacts: 0 in 9 configurations>"


def test_a_deep_copy_keeps_together_what_belongs_together(cubes: env2mjcf.Scene) -> None:
    scene, data = copy.deepcopy([cubes, cubes.data])
    assert scene.data is data is not cubes.data


@pytest.mark.parametrize("bad", [[np.nan] * 6, [np.inf, 0, 0, 0, 0, 0], [np.inf, -np.inf, 0, 0, 0, 0], [0.0] * 5])
def test_one_row_is_checked_as_many_are(cubes: env2mjcf.Scene, bad: list[float]) -> None:
    for row in (bad, np.array(bad), np.array([bad])):
        for query in (cubes.in_collision, cubes.is_valid):
            with pytest.raises(ValueError, match=r"cube\.x"):
                query(row)


def test_one_row_of_any_numbers_has_the_same_verdict(cubes: env2mjcf.Scene) -> None:
    for row in (at(4.5, 0, 0), at(0, 0, 0), at(1e308, 1e308, 0)):
        verdict = bool(cubes.in_collision(row[None])[0])
        for same in (row, list(row), row.astype(">f8"), np.repeat(row, 2)[::2]):
            assert cubes.in_collision(same) is verdict


def test_edges_are_checked_between_their_ends(cubes: env2mjcf.Scene) -> None:
    above, below = at(5, 0, 4), at(5, 0, -4)
    assert not cubes.in_collision(np.stack([above, below])).any()
    assert cubes.edge_in_collision(above, below) is True
    assert cubes.edge_in_collision(at(0, 0, 4), at(0, 0, -4)) is False
    many = cubes.edge_in_collision(np.stack([above, at(0, 0, 4)]), np.stack([below, at(0, 0, -4)]))
    np.testing.assert_array_equal(many, [True, False])
    assert not cubes.edge_in_collision(above, below, resolution=100.0)
    with pytest.raises(ValueError, match="equal shapes"):
        cubes.edge_in_collision(above, np.stack([below]))
    with pytest.raises(ValueError, match="positive number"):
        cubes.edge_in_collision(above, below, resolution=0)


def test_a_path_report_names_the_first_fault(cubes: env2mjcf.Scene) -> None:
    path = np.stack([at(0, 0, 4), at(5, 0, 4), at(5, 0, -4), at(0, 0, -4)])
    report = cubes.check_path(path)
    assert not report.valid
    np.testing.assert_array_equal(report.configurations, [True] * 4)
    np.testing.assert_array_equal(report.edges, [True, False, True])
    assert report.first_invalid == 1
    assert report.invalid_q is not None
    assert cubes.in_collision(report.invalid_q)
    assert {c.other for c in report.contacts} == {"cube_2"}
    assert cubes.check_path(path[:2]).valid
    with pytest.raises(ValueError, match="a path of shape"):
        cubes.check_path(path[0])


def test_set_moves_the_simulation_and_queries_do_not(cubes: env2mjcf.Scene) -> None:
    q = np.array([1, 2, 3, 0.1, 0.2, 0.3])
    cubes.set(q)
    np.testing.assert_allclose(cubes.q(), q, atol=1e-12)
    cubes.in_collision(at(4.5, 0, 0))
    cubes.contacts(at(4.5, 0, 0))
    np.testing.assert_allclose(cubes.q(), q, atol=1e-12)
    np.testing.assert_allclose(cubes.data.body("cube").xpos, [1, 2, 3])


def test_a_pickled_scene_answers_alike(cubes: env2mjcf.Scene) -> None:
    again = pickle.loads(pickle.dumps(cubes))
    q = cubes.space.sample(500, seed=5)
    np.testing.assert_array_equal(again.in_collision(q), cubes.in_collision(q))
    assert again.pairs == cubes.pairs


def test_a_spec_can_be_attached_elsewhere(cubes: env2mjcf.Scene) -> None:
    parent = mujoco.MjSpec()
    frame = parent.worldbody.add_frame()
    parent.attach(cubes.spec(), frame=frame, prefix="left/")
    model = parent.compile()
    assert model.body("left/cube").id > 0
    assert model.ngeom == cubes.model.ngeom


def test_ground_and_walls_act_in_simulation_only(tmp_path: Path) -> None:
    path = write_scene(tmp_path, free_cube("5 0 0 0 0 0", boundary="Boundary Box [-10:10 ; -10:10 ; -3:3]"))
    scene = env2mjcf.load(path, boundary="solid", ground=True)
    assert not scene.in_collision(at(0, 0, -3.4))
    assert not scene.is_valid(at(0, 0, -3.4))
    scene.set(at(0, 0, 0))
    while scene.data.time < 3:
        mujoco.mj_step(scene.model, scene.data)
    # The ground lies under the scene's lowest body at home, above the floor of the boundary.
    assert scene.q()[2] == pytest.approx(0.0, abs=0.02)
    walled = env2mjcf.load(path, boundary="solid")
    walled.set(at(0, 0, 0))
    while walled.data.time < 3:
        mujoco.mj_step(walled.model, walled.data)
    assert walled.q()[2] == pytest.approx(-2.5, abs=0.02)


def test_an_executor_must_be_one(cubes: env2mjcf.Scene) -> None:
    for query in (cubes.in_collision, cubes.is_valid, cubes.clearance):
        with pytest.raises(TypeError, match="ProcessPoolExecutor"):
            query(at(0, 0, 0), executor=object())
        with pytest.raises(TypeError, match="ProcessPoolExecutor"):
            query(at(0, 0, 0), executor=ThreadPoolExecutor)  # type: ignore[arg-type]


def test_a_scene_without_a_robot_is_valid_and_says_so(tmp_path: Path) -> None:
    text = "Boundary Box [-1:1 ; -1:1 ; -1:1]\nMultibodies\n1\nPassive\ncube.g 0 0 0 0 0 0\n"
    scene = env2mjcf.load(write_scene(tmp_path, text))
    assert scene.space.dim == 0
    assert scene.link_names == ()
    assert not scene.in_collision(np.zeros(0))
    assert scene.in_collision(np.zeros((3, 0))).tolist() == [False] * 3
    assert scene.clearance(np.zeros((3, 0))).tolist() == [np.inf] * 3
    assert "ENV310" in {d.code for d in scene.diagnostics}


def test_a_scene_with_nothing_in_it_loads(tmp_path: Path) -> None:
    scene = env2mjcf.load(write_scene(tmp_path, "Boundary Box [-1:1 ; -1:1 ; -1:1]\nMultibodies\n0\n"))
    assert scene.obstacle_names == ()
    assert scene.model.nbody == 1
