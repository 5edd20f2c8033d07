"""Scene.clearance and Scene.edge_is_free, against algebra, coal and golden vectors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from distances import surface_distances
from real_scenes import FEW, real_scene, scene_names
from scenes import MODELS, box_mesh, free_cube, notched_block, write_scene

import env2mjcf
from env2mjcf.contact.edges import certified
from env2mjcf.formats.meshes.byu import export_byu

FLYER = "1\nsmall.g Volumetric Rotational\nConnections\n0\n"


def at(*xyz: float) -> np.ndarray:
    return np.array([*xyz, 0, 0, 0])


@pytest.fixture
def cube(tmp_path: Path) -> env2mjcf.Scene:
    """A unit cube that flies, and another one at x = 5."""
    return env2mjcf.load(write_scene(tmp_path, free_cube("5 0 0 0 0 0")))


@pytest.mark.parametrize("collision", ["auto", "hull", "surface"])
def test_boxes_face_to_face_corner_to_corner_and_in_each_other(tmp_path: Path, collision: str) -> None:
    scene = env2mjcf.load(write_scene(tmp_path, free_cube("5 0 0 0 0 0")), collision=collision)
    turned = np.array([0, 0, 0, 0, 0, np.pi / 4])
    for q, expected in (
        (at(0, 0, 0), 4.0),
        (at(3, 0.3, 0.2), 1.0),
        (at(0, 2, 0), np.hypot(4, 1)),
        (at(7, 3, 4), np.sqrt(1 + 4 + 9)),
        (turned, 4.5 - np.sqrt(0.5)),
        (at(4.25, 0.1, 0), -0.25),
        (at(5.1, 0.2, 0.9), -0.1),
        (at(5, 0.25, 0), -0.75),
    ):
        assert scene.clearance(q) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("collision", ["auto", "hull", "surface"])
def test_cubes_that_meet_with_crossed_edges_are_parted_square_to_both(tmp_path: Path, collision: str) -> None:
    """The other cube is turned by an eighth about y, this one about z: an edge of each points at the other's."""
    scene = env2mjcf.load(write_scene(tmp_path, free_cube("5 0 0 0 45 0")), collision=collision)
    touching = 5 - 2 * np.sqrt(0.5)
    for depth in (1e-4, 0.05, -0.05):
        q = np.array([touching + depth, 0.1, 0.05, 0, 0, np.pi / 4])
        assert scene.clearance(q) == pytest.approx(-depth, abs=1e-6)


def test_one_row_gives_a_float_and_many_rows_an_array(cube: env2mjcf.Scene) -> None:
    assert type(cube.clearance(at(0, 0, 0))) is float
    rows = np.stack([at(0, 0, 0), at(4.25, 0, 0), at(3, 0, 0)])
    found = cube.clearance(rows)
    assert found.dtype == np.float64
    np.testing.assert_allclose(found, [4, -0.25, 1], atol=1e-12)
    assert cube.clearance(rows[:0]).shape == (0,)
    many = cube.space.sample(4500, seed=1)
    np.testing.assert_array_equal(cube.clearance(many, threads=2), cube.clearance(many, threads=1))
    with pytest.raises(ValueError, match="at least 1"):
        cube.clearance(rows, threads=0)
    with pytest.raises(ValueError, match=r"nan|finite"):
        cube.clearance(at(np.nan, 0, 0))


def test_the_boundary_does_not_count_and_no_pairs_is_infinitely_far(tmp_path: Path) -> None:
    scene = env2mjcf.load(write_scene(tmp_path, free_cube()), boundary="solid", ground=True)
    assert scene.clearance(at(9, 9, 0)) == np.inf
    np.testing.assert_array_equal(scene.clearance(np.zeros((2, 6))), [np.inf, np.inf])


def test_depth_fades_to_zero_as_bodies_come_free(tmp_path: Path) -> None:
    """A small cube leaves a notched block through its side, which is not convex."""
    path = write_scene(tmp_path, free_cube("block.g 0 0 0 0 0 0", robot=FLYER),
                       block=notched_block(), small=box_mesh(0.1, 0.1, 0.1))  # fmt: skip
    scene = env2mjcf.load(path)
    low = -1 - scene.obstacle_poses()[0][2, 3] - 0.1  # below the groove
    # From wholly inside to outside: the way out is what is left of the block, and the cube's own size.
    for x in (0.75, 0.8, 0.89, 0.91, 1.0, 1.09, 1.11, 1.5):
        assert scene.clearance(at(x, 0.05, low + 0.5)) == pytest.approx(x - 1.1, abs=1e-6)
    for q, inside in ((at(0.5, 0, low + 0.5), True), (at(0, 0, 0.9), False)):
        assert (scene.clearance(q) < 0) == inside == scene.in_collision(q)


def test_containment_counts_as_the_collision_option_says(tmp_path: Path) -> None:
    path = write_scene(tmp_path, free_cube("0 0 0 0 0 0", robot=FLYER), small=box_mesh(0.1, 0.1, 0.1))
    inside = at(0.1, 0, 0)
    for collision in ("auto", "hull"):
        assert env2mjcf.load(path, collision=collision).clearance(inside) == pytest.approx(-0.5, abs=1e-9)
    assert env2mjcf.load(path, collision="surface").clearance(inside) == pytest.approx(0.3, abs=1e-12)


def test_with_hulls_the_hulls_are_measured(tmp_path: Path) -> None:
    path = write_scene(tmp_path, free_cube("block.g 0 0 0 0 0 0", robot=FLYER),
                       block=notched_block(), small=box_mesh(0.1, 0.1, 0.1))  # fmt: skip
    hull, auto = env2mjcf.load(path, collision="hull"), env2mjcf.load(path)
    top = float(np.mean([-1, 1, 1, 0.25]))  # the block is recentred on the mean of its vertices
    in_the_groove, above = at(0, 0, 0.6 - top), at(0, 0, 1.4 - top)
    assert auto.clearance(in_the_groove) == pytest.approx(0.25, abs=1e-9)
    assert hull.clearance(in_the_groove) == pytest.approx(-0.5, abs=1e-6)
    assert hull.in_collision(in_the_groove)
    assert hull.clearance(above) == pytest.approx(0.3, abs=1e-6)
    assert auto.clearance(above) == pytest.approx(np.hypot(0.3, 0.4), abs=1e-9)


@pytest.mark.slow
def test_a_push_as_long_as_the_depth_separates_and_a_much_shorter_one_does_not(tmp_path: Path) -> None:
    """The depth bounds the shortest translation that separates; 300 directions come near to that one."""
    path = write_scene(tmp_path, free_cube("block.g 0 0 0 0 0 0", robot=FLYER),
                       block=notched_block(), small=box_mesh(0.4, 0.3, 0.2))  # fmt: skip
    scene = env2mjcf.load(path)
    q = scene.space.sample(400, seed=4) * [0.2, 0.2, 0.2, 1, 1, 1]
    depth = -scene.clearance(q)
    deep = np.flatnonzero(depth > 0.01)[:30]
    assert len(deep) == 30
    directions = np.random.default_rng(0).normal(size=(300, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    parted_by_less = 0
    for i in deep:
        pushed = np.tile(q[i], (300, 1))
        pushed[:, :3] += 1.1 * depth[i] * directions
        assert not scene.in_collision(pushed).all()
        pushed[:, :3] -= 0.5 * depth[i] * directions
        parted_by_less += not scene.in_collision(pushed).all()
    # The tried directions are few, so that a depth may be too large, but not by far and not often.
    assert parted_by_less <= 3


@pytest.mark.slow_but("alpha", "seed", "maze")
@pytest.mark.parametrize("name", ["seed", "alpha", "bug-trap", "maze", "two-robots", "gantry", "spherical-arm"])
def test_models_are_as_far_apart_as_coal_says(name: str) -> None:
    scene = env2mjcf.load(MODELS / f"{name}/{name}.env", **robots_of(name))
    q = scene.space.sample(40, seed=6)
    found, expected = scene.clearance(q), surface_distances(scene, q)
    verdicts = scene.in_collision(q)
    free = expected > 1e-6
    inside = free & verdicts
    np.testing.assert_allclose(found[free & ~inside], expected[free & ~inside], rtol=0, atol=1e-6 * scene.extent)
    assert (found[~free] <= 1e-6 * scene.extent).all()
    agree = np.abs(found) > 1e-5 * scene.extent
    np.testing.assert_array_equal((found <= 0)[agree], verdicts[agree])
    assert free.any()


def robots_of(name: str) -> dict[str, object]:
    robot = MODELS / name / f"{name}.robot"
    return {"robots": [robot]} if robot.exists() else {}


@pytest.mark.slow_but(*FEW)
@pytest.mark.parametrize("name", scene_names(golden=True))
def test_golden_margins_are_met(corpus: Path, name: str) -> None:
    real = real_scene(name)
    rows = real.read_golden()["random"]
    for collision, key in (("surface", "hit"), ("auto", "hit_solid")):
        scene = env2mjcf.load(real.env, **{**real.keywords, "collision": collision, "inter_robot": False})
        found = scene.clearance(scene.space.decode(np.array([row["cfg"] for row in rows])))
        band = 1e-5 * scene.extent
        for row, clearance in zip(rows, found, strict=True):
            if row["margin"] is None:
                assert clearance == np.inf
            elif not row[key] and row["margin"] > 0:
                assert clearance == pytest.approx(row["margin"], abs=1e-6 * scene.extent)
            elif row[key] and abs(row["margin"]) > band:
                assert clearance <= 0


@pytest.mark.slow_but(*FEW)
@pytest.mark.parametrize("name", scene_names())
def test_real_scenes_are_as_far_apart_as_coal_says(corpus: Path, name: str) -> None:
    real = real_scene(name)
    scene = env2mjcf.load(real.env, **{**real.keywords, "collision": "surface"})
    q = scene.space.sample(8, seed=2)
    found, expected = scene.clearance(q), surface_distances(scene, q)
    far = np.isinf(expected)
    np.testing.assert_array_equal(np.isinf(found), far)
    error = np.abs(np.maximum(found[~far], 0) - np.maximum(expected[~far], 0))
    assert error.max(initial=0) <= 1e-6 * scene.extent


def test_an_edge_is_free_only_where_nothing_is_touched_on_the_way(cube: env2mjcf.Scene) -> None:
    below, above = at(5, 0, -4), at(5, 0, 4)
    assert cube.edge_is_free(at(0, 0, -4), at(0, 0, 4)) is True
    assert cube.edge_is_free(below, above) is False
    # Past the corner by a hair, and through it by a hair, where steps see nothing.
    assert cube.edge_is_free(below + at(-1.001, 0, 0), above + at(-1.001, 0, 0))
    assert not cube.edge_is_free(below + at(-0.9999, 0, 0), above + at(-0.9999, 0, 0))
    both = cube.edge_is_free(np.stack([below, at(0, 0, -4)]), np.stack([above, at(0, 0, 4)]))
    np.testing.assert_array_equal(both, [False, True])
    assert cube.edge_is_free(at(0, 0, 0), at(0, 0, 0))
    with pytest.raises(ValueError, match="equal shapes"):
        cube.edge_is_free(below, np.stack([above]))


@pytest.mark.parametrize("name", ["seed", "gantry", "alpha"])
def test_a_certified_edge_has_no_collision_at_fine_steps(name: str) -> None:
    scene = env2mjcf.load(MODELS / f"{name}/{name}.env")
    rng = np.random.default_rng(1)
    free = [q for q in scene.space.sample(60, seed=3) if scene.clearance(q) > 1e-3 * scene.extent][:6]
    assert free
    proved = 0
    for q in free:
        end = q + 0.1 * rng.normal(size=q.shape)
        certified = scene.edge_is_free(q, end)
        proved += certified
        stepped = scene.edge_in_collision(q, end, resolution=1e-4 * scene.extent)
        assert not (certified and stepped)
        # What is not proved is near to something, at the least.
        if not certified:
            way = scene.space.interpolate(q, end, 3000)
            assert scene.clearance(way).min() < 1e-3 * scene.extent
    assert proved


def test_a_body_whose_middle_is_empty_hides_no_nearer_one(tmp_path: Path) -> None:
    """The cube flies in the middle between two plates of one body; a small cube beside it is nearer than these."""
    plates = trimesh.util.concatenate(
        [trimesh.creation.box((0.2, 4, 4), trimesh.transformations.translation_matrix((x, 0, 0))) for x in (-5, 5)]
    )
    text = free_cube("plates.g 0 0 0 0 0 0", "small.g 0 3 0 0 0 0")
    path = write_scene(tmp_path, text, plates=export_byu(plates), small=box_mesh(0.1, 0.1, 0.1))
    scene = env2mjcf.load(path, engine="mujoco")
    assert scene.clearance(at(0, 0, 0)) == pytest.approx(3 - 0.1 - 0.5)
    assert scene.clearance(at(2.5, 0, 0)) == pytest.approx(4.9 - 2.5 - 0.5)


@pytest.mark.parametrize("motion", [1.0, 4.0])
def test_no_stretch_is_passed_over_however_thin_the_obstacle(motion: float) -> None:
    """A point on a line, and an obstacle as thin as a hair anywhere on its way."""
    start, delta = np.zeros(1), np.array([motion])
    for place in np.linspace(0.01, 0.99, 197) * motion:
        hit = certified(lambda rows, place=place: np.abs(rows[:, 0] - place) - 1e-4, start, delta, motion, 1e-6)
        assert not hit
        assert certified(lambda rows, place=place: np.hypot(rows[:, 0] - place, 0.01), start, delta, motion, 1e-6)


def test_a_ball_of_many_edges_inside_a_convex_body_has_a_depth(tmp_path: Path) -> None:
    """No triangles touch that could say which edges to try."""
    ball = export_byu(trimesh.creation.icosphere(subdivisions=2, radius=0.15))
    robot = "1\nball.g Volumetric Rotational\nConnections\n0\n"
    scene = env2mjcf.load(write_scene(tmp_path, free_cube("0 0 0 0 0 0", robot=robot), ball=ball))
    assert scene.clearance(at(0, 0, 0.1)) == pytest.approx(-0.55, abs=1e-6)
