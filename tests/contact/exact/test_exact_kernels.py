"""The compiled parts of the exact engine, each against algebra, MuJoCo, python-fcl or exact arithmetic."""

from __future__ import annotations

import os
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenes import MODELS, free_cube, write_scene

import env2mjcf
from env2mjcf.contact.exact.motions import Motions
from env2mjcf.contact.exact.tables import BLOCK, LANES
from env2mjcf.contact.exact.wide_tree import box_tree, depth, wide_tree
from env2mjcf.formats.meshes.byu import export_byu
from env2mjcf.geometry.distance import nearest
from env2mjcf.geometry.orientation import winding_numbers
from env2mjcf.transforms import rotation_matrix, transform

pytest.importorskip("numba", reason="no numba: pip install 'env2mjcf[fast]'")

from kernels import from_python, holds_point, place_links, views

from env2mjcf.contact.exact.kernels import boxes, separations, triangles
from env2mjcf.contact.exact.kernels.linking import INNER
from env2mjcf.contact.exact.kernels.touching import _LEAN_X, _LEAN_Y

boxes_apart, lanes_near = from_python(boxes.boxes_apart), from_python(boxes.lanes_near)
triangle_distance, triangle_gap = from_python(separations.triangle_distance), from_python(separations.triangle_gap)
box_meets, triangle_meets = from_python(triangles.box_meets), from_python(triangles.triangle_meets)


def test_python_cannot_call_what_is_only_a_part() -> None:
    """It is not translated by itself: there is nothing to be called."""
    if not INNER:
        pytest.skip("this numba has other private parts: every function is translated by itself")
    with pytest.raises(TypeError, match="not callable"):
        boxes.lanes_about(np.zeros(48), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def block_of(triangles: np.ndarray) -> np.ndarray:
    """Triangles (4, 3, 3) as a leaf holds them."""
    return np.ascontiguousarray(triangles.reshape(BLOCK, 9).T.ravel())


def crosses(a: list[list[int]], b: list[list[int]]) -> bool:
    """Whether triangles with integer corners meet, in rational numbers: an edge of one meets the other one."""
    return any(
        meets(p, q, t)
        for s, t in ((a, b), (b, a))
        for p, q in ((s[0], s[1]), (s[1], s[2]), (s[2], s[0]))
    )  # fmt: skip


def meets(p: list[int], q: list[int], t: list[list[int]]) -> bool:
    """Whether a segment meets a triangle in general position."""
    normal = np.cross(np.subtract(t[1], t[0]), np.subtract(t[2], t[0]))
    over, under = int(np.dot(normal, np.subtract(p, t[0]))), int(np.dot(normal, np.subtract(q, t[0])))
    if over * under > 0 or over == under:
        return False
    s = Fraction(over, over - under)
    x = [Fraction(a) + s * (b - a) for a, b in zip(p, q, strict=True)]
    sides = []
    for i in range(3):
        e, w = np.subtract(t[(i + 1) % 3], t[i]).tolist(), [x[k] - t[i][k] for k in range(3)]
        c = (e[1] * w[2] - e[2] * w[1], e[2] * w[0] - e[0] * w[2], e[0] * w[1] - e[1] * w[0])
        sides.append(sum(int(n) * k for n, k in zip(normal, c, strict=True)))
    return all(side >= 0 for side in sides)


@pytest.mark.slow
def test_triangles_meet_as_rational_numbers_say() -> None:
    rng = np.random.default_rng(1)
    met = 0
    for _ in range(1500):
        a, four = rng.integers(-6, 7, (3, 3)), rng.integers(-6, 7, (4, 3, 3))
        if any(not np.cross(t[1] - t[0], t[2] - t[0]).any() for t in [a, *four]):
            continue
        expected = any(crosses(a.tolist(), b.tolist()) for b in four)
        # Triangles of one plane have no general position.
        if any(not (np.cross(a[1] - a[0], a[2] - a[0]) @ (b - a[0]).T).any() for b in four):
            continue
        assert triangle_meets(tuple(a.ravel().astype(float)), block_of(four.astype(float))) == expected
        met += expected
    assert 300 < met < 1200


@pytest.mark.parametrize("axes", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
def test_triangles_of_one_plane_meet_where_they_overlap(axes: tuple[int, ...]) -> None:
    a = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0]], dtype=float)[:, axes]
    for shift, expected in (([1, 1, 0], True), ([3, 3, 0], False), ([-5, 0, 0], False), ([2, 1, 0], True)):
        b = np.tile(a + np.array(shift)[list(axes)], (BLOCK, 1, 1))
        assert triangle_meets(tuple(a.ravel()), block_of(b)) == expected


def test_distances_of_triangles_are_those_of_the_library_of_arrays() -> None:
    """`nearest` is held against coal elsewhere."""
    rng = np.random.default_rng(2)
    for scale in (1e-3, 1.0, 1e3):
        for _ in range(200):
            a, four = rng.normal(size=(3, 3)) * scale, rng.normal((2.5, 0, 0), size=(4, 3, 3)) * scale
            expected = nearest(np.tile(a, (4, 1, 1)), four).distance
            row, triangle = block_of(four), tuple(a.ravel())
            if triangle_meets(triangle, row):
                continue
            assert np.sqrt(triangle_distance(triangle, row)) == pytest.approx(expected.min(), rel=1e-9)
            assert triangle_gap(triangle, row) <= expected.min() ** 2 * (1 + 1e-12)


@pytest.mark.parametrize("angle", [1.0, 5e-3, 1e-4, 1e-6])
def test_edges_that_are_nearly_parallel_are_nearest_where_they_cross(angle: float) -> None:
    """One edge passes at a height over the middle of another one; what else the triangles have lies farther off."""
    height = 0.1 * angle
    a = np.array([[-1, 0, 0], [1, 0, 0], [0.3, 0.2, -1]])
    c, s = np.cos(angle), np.sin(angle)
    b = np.array([[-c, -s, height], [c, s, height], [0.1, -0.3, 1 + height]])
    for first, second in ((a, b), (b, a)):
        for turn in range(3):
            row, triangle = block_of(np.tile(np.roll(second, turn, axis=0), (BLOCK, 1, 1))), tuple(first.ravel())
            assert np.sqrt(triangle_distance(triangle, row)) == pytest.approx(height, rel=1e-6)


def test_a_triangle_without_area_is_as_far_as_its_edges() -> None:
    """It lies on a line beside a corner of the other one, and its plane is none."""
    line = np.array([[0, 0, 2.0], [1, 1, 2], [3, 3, 2]])
    other = np.array([[1, 1, 0], [5, 1, 0], [1, 5, -1.0]])
    for a, b in ((line, other), (other, line)):
        row = block_of(np.tile(b, (BLOCK, 1, 1)))
        assert np.sqrt(triangle_distance(tuple(a.ravel()), row)) == pytest.approx(2.0)


def test_a_box_meets_the_triangles_that_its_hull_meets() -> None:
    """Against python-fcl, whose box is solid too."""
    fcl = pytest.importorskip("fcl", reason="no python-fcl to compare with")
    rng = np.random.default_rng(3)
    half = np.array([0.5, 0.8, 0.3])
    box = fcl.CollisionObject(fcl.Box(*(2 * half)), fcl.Transform())
    met = 0
    for _ in range(600):
        pose = transform(rotation_matrix(*rng.uniform(-3, 3, 3)), rng.uniform(-1, 1, 3))
        four = np.tile(rng.normal(size=(1, 3, 3)), (BLOCK, 1, 1))
        model = fcl.BVHModel()
        model.beginModel(3, 1)
        model.addSubModel(four[0], np.array([[0, 1, 2]]))
        model.endModel()
        other = fcl.CollisionObject(model, fcl.Transform(pose[:3, :3], pose[:3, 3]))
        expected = fcl.collide(box, other, fcl.CollisionRequest(), fcl.CollisionResult()) > 0
        assert box_meets(block_of(four), tuple(pose[:3].ravel()), *half) == expected
        met += expected
    assert 150 < met < 550


def test_boxes_are_apart_as_fcl_says_and_lanes_agree() -> None:
    fcl = pytest.importorskip("fcl", reason="no python-fcl to compare with")
    rng = np.random.default_rng(4)
    a, b = np.array([1.0, 0.4, 0.2]), np.array([0.3, 0.9, 0.5])
    row = np.zeros(48)
    row[24:] = -1e150
    row[[24, 32, 40]] = b
    first = fcl.CollisionObject(fcl.Box(*(2 * a)), fcl.Transform())
    for _ in range(1000):
        pose = transform(rotation_matrix(*rng.uniform(-3, 3, 3)), rng.uniform(-1.6, 1.6, 3))
        second = fcl.CollisionObject(fcl.Box(*(2 * b)), fcl.Transform(pose[:3, :3], pose[:3, 3]))
        touching = fcl.collide(first, second, fcl.CollisionRequest(), fcl.CollisionResult()) > 0
        m = tuple(pose[:3].ravel())
        assert boxes_apart(m, *a, *b) is not touching
        assert lanes_near(row, m, 0.0, 0.0, 0.0, *a) == int(touching)


@pytest.mark.parametrize("angle", [0.0, np.pi / 2, np.pi, 1e-9])
def test_parallel_boxes_that_overlap_are_never_called_apart(angle: float) -> None:
    """Cross products of parallel sides are all rounding."""
    rng = np.random.default_rng(5)
    for _ in range(500):
        pose = transform(rotation_matrix(0, 0, angle), rng.uniform(-1, 1, 3) * 0.999)
        assert not boxes_apart(tuple(pose[:3].ravel()), 0.5, 0.5, 0.5, 0.5, 0.5, 0.5)


def test_trees_hold_every_triangle_once_in_boxes_around_it() -> None:
    for mesh in (trimesh.creation.icosphere(3), trimesh.creation.box(), trimesh.creation.torus(2, 0.5)):
        triangles = np.asarray(mesh.triangles)
        tree = wide_tree(triangles)
        held = {}
        for node, lane in np.argwhere(tree.child < 0):
            block = ~tree.child[node, lane]
            corners = triangles[tree.faces[block]].reshape(-1, 3)
            center, half = tree.boxes[node, :3, lane], tree.boxes[node, 3:, lane]
            assert (np.abs(corners - center) <= half).all()
            np.testing.assert_array_equal(tree.blocks[block].T.reshape(BLOCK, 3, 3), triangles[tree.faces[block]])
            held[block] = set(tree.faces[block])
        assert sorted(f for faces in held.values() for f in faces) == list(range(len(triangles)))
        for node, lane in np.argwhere(tree.child > 0):
            inner = tree.child[node, lane]
            used = tree.boxes[inner, 3] >= 0
            low = (tree.boxes[inner, :3] - tree.boxes[inner, 3:])[:, used].min(axis=1)
            high = (tree.boxes[inner, :3] + tree.boxes[inner, 3:])[:, used].max(axis=1)
            center, half = tree.boxes[node, :3, lane], tree.boxes[node, 3:, lane]
            assert (low >= center - half - 1e-12).all()
            assert (high <= center + half + 1e-12).all()
        assert depth(tree.child) <= 2 + 2 * np.log(len(triangles)) / np.log(LANES)


def test_trees_far_away_hold_their_triangles_too() -> None:
    """Middles and half sizes of boxes are rounded by as much as the place is."""
    triangles = np.asarray(trimesh.creation.icosphere(2).triangles) + np.array([1e6, -3e6, 2e6])
    tree = wide_tree(triangles)
    for node, lane in np.argwhere(tree.child < 0):
        corners = triangles[tree.faces[~tree.child[node, lane]]].reshape(-1, 3)
        center, half = tree.boxes[node, :3, lane], tree.boxes[node, 3:, lane]
        assert (corners <= center + half).all()
        assert (corners >= center - half).all()


def test_trees_over_equal_boxes_are_not_deep() -> None:
    low = np.zeros((4096, 3))
    _, child = box_tree(low, low + 1)
    assert sorted(~child[child < 0]) == list(range(4096))
    assert depth(child) <= 6


@pytest.mark.slow
def test_steps_place_links_where_the_kinematics_do() -> None:
    checked = 0
    for path in sorted(MODELS.glob("*/*.env")):
        scene = env2mjcf.load(path, robots=tuple(path.parent.glob("*.robot")))
        engine = scene._solver._chosen("exact")
        tables = views(*engine._tables)
        frames = np.empty((len(tables.steps), 12))
        for q in scene.space.sample(20, seed=1):
            place_links(*engine._tables, q, frames)
            link = 0
            for robot, columns in zip(scene.compiled.assembly.robots, scene.space.robot_slices, strict=True):
                motions = Motions()
                motions.add(robot.kinematics, 0, [np.eye(4)] * len(robot.links))
                for pose, part in zip(robot.kinematics.forward(q[columns]), robot.links, strict=True):
                    step, shape = tables.links[link, :2]
                    # The step places the frame of the shape's box: its centre is that of the box.
                    found = frames[step].reshape(3, 4)
                    box = part.analysis.box
                    if box is not None:
                        np.testing.assert_allclose(found[:, 3], pose[:3, :3] @ box.center + pose[:3, 3], atol=1e-12)
                    half = tables.halves[shape, :3]
                    corners = part.analysis.vertices @ pose[:3, :3].T + pose[:3, 3]
                    assert (np.abs((corners - found[:, 3]) @ found[:, :3]) <= half * (1 + 1e-9) + 1e-12).all()
                    np.testing.assert_allclose(found[:, :3].T @ found[:, :3], np.eye(3), atol=1e-12)
                    link += 1
                    checked += 1
    assert checked > 200


@pytest.mark.slow
def test_rays_count_as_winding_numbers_do() -> None:
    """Of the bottle, from points all over it, and from points whose rays go through corners of the mesh."""
    scene = env2mjcf.load(MODELS / "bug-trap/bug-trap.env")
    packed = scene._solver._chosen("exact")._tables
    tables = views(*packed)
    part, shape = scene.compiled.assembly.obstacles[0], int(tables.obstacles[0, 0])
    frame = tables.poses[0].reshape(3, 4)
    vertices = (part.analysis.vertices @ part.pose[:3, :3].T + part.pose[:3, 3] - frame[:, 3]) @ frame[:, :3]
    rng = np.random.default_rng(6)
    corners = vertices[rng.integers(len(vertices), size=1500)]
    below = corners - rng.uniform(0.01, 1, (1500, 1)) * np.array([_LEAN_X, _LEAN_Y, 1.0])
    points = np.concatenate([rng.uniform(vertices.min(axis=0), vertices.max(axis=0), (1500, 3)), below])
    expected = np.abs(winding_numbers(points, vertices, part.analysis.faces)) > 0.5
    stack = np.zeros(4096, dtype=np.int64)
    assert [holds_point(*packed, shape, *point, stack) for point in points] == expected.tolist()
    assert 200 < expected.sum() < 2800


@pytest.mark.slow
@pytest.mark.parametrize("height", [0.4, 1.5])
@pytest.mark.parametrize("corners", [5, 7, 9, 12])
def test_points_of_a_star_are_inside_as_algebra_says(tmp_path: Path, corners: int, height: float) -> None:
    """A prism over a star, which is not convex: leaves of its tree are filled up with a triangle again.

    Rays go along the shortest side of the box, through the star or along its plane.
    """
    angles = np.pi * np.arange(2 * corners) / corners
    radii = np.where(np.arange(2 * corners) % 2, 0.5, 1.0)
    rim = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    n = len(rim)
    vertices = [[*p, z] for z in (-height, height) for p in [*rim, np.zeros(2)]]
    faces = []
    for i in range(n):
        j, top = (i + 1) % n, n + 1
        faces += [[j, i, n], [top + i, top + j, top + n], [i, j, top + j], [i, top + j, top + i]]
    # One triangle becomes three, so that their number is no multiple of a leaf's.
    a, b, c = faces.pop(1)
    vertices.append(np.mean([vertices[k] for k in (a, b, c)], axis=0).tolist())
    faces += [[a, b, len(vertices) - 1], [b, c, len(vertices) - 1], [c, a, len(vertices) - 1]]
    assert len(faces) % BLOCK == 2
    star = trimesh.Trimesh(vertices, faces, process=False)
    path = write_scene(tmp_path, free_cube("star.g 0 0 0 0 0 0"), star=export_byu(star))
    scene = env2mjcf.load(path)
    packed = scene._solver._chosen("exact")._tables
    tables = views(*packed)
    frame, shape = tables.poses[0].reshape(3, 4), int(tables.obstacles[0, 0])
    rng = np.random.default_rng(7)
    points = rng.uniform(-1, 1, (200, 3)) * [1.05, 1.05, 1.2 * height]
    # And such that their rays pass every triangle.
    passed = np.repeat(np.array(vertices)[faces].mean(axis=1), 20, axis=0)
    below = rng.uniform(0.01, 2, (len(passed), 1)) * (frame[:, :3] @ [_LEAN_X, _LEAN_Y, 1.0])
    points = np.concatenate([points, passed - below])
    # Between two corners of the rim, a point is inside if it is on the middle's side of the line through them.
    sector = np.floor(np.mod(np.arctan2(points[:, 1], points[:, 0]), 2 * np.pi) / (np.pi / corners)).astype(int)
    p, q = rim[sector], rim[(sector + 1) % n]
    side = np.linalg.det(np.stack([q - p, points[:, :2] - p], axis=1))
    expected = (side > 0) & (np.abs(points[:, 2]) < height)
    stack = np.zeros(4096, dtype=np.int64)
    # Meshes are placed by the mean of their vertices.
    local = (points - np.mean(vertices, axis=0) - frame[:, 3]) @ frame[:, :3]
    assert [holds_point(*packed, shape, *point, stack) for point in local] == expected.tolist()
    assert 0.1 < expected.mean() < 0.7


FALLBACK = """
import sys
import env2mjcf.contact.exact.kernels.linking as linking
if sys.argv[2] == "without":
    linking.INNER, linking.OUTER = {}, {}
import env2mjcf
scene = env2mjcf.load(sys.argv[1])
print(scene.is_valid(scene.space.sample(500, seed=2)).tolist())
"""


@pytest.mark.slow
def test_without_private_parts_of_numba_the_answers_are_the_same(tmp_path: Path) -> None:
    said = []
    for way in ("with", "without"):
        package = Path(env2mjcf.__file__).parents[1]
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / way), "PYTHONPATH": str(package)}
        command = [sys.executable, "-c", FALLBACK, str(MODELS / "bug-trap/bug-trap.env"), way]
        said.append(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)
    assert said[0] == said[1]
    assert "True" in said[0]
    assert "False" in said[0]
