"""Depths of convex bodies, against all facets of the Minkowski difference, python-fcl and algebra."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenes import box_mesh, free_cube, write_scene
from scipy.spatial import ConvexHull

import env2mjcf
from env2mjcf.contact.convex_depth import Overlap, gauss_map, over_each_other
from env2mjcf.contact.types import Contact
from env2mjcf.formats.meshes.byu import export_byu

FLYER = "1\nsmall.g Volumetric Rotational\nConnections\n0\n"
IN_PLANE = np.eye(3)[:, :2]


def random_body(rng: np.random.Generator) -> trimesh.Trimesh:
    """A box, a prism or cylinder, a cone, a ball, a thin plate, or the hull of random points."""
    kind = rng.integers(6)
    if kind == 0:
        return trimesh.creation.box(rng.uniform(0.1, 2, 3))
    if kind == 1:
        return trimesh.creation.cylinder(rng.uniform(0.2, 1), rng.uniform(0.1, 2), sections=int(rng.integers(3, 25)))
    if kind == 2:
        return trimesh.creation.cone(rng.uniform(0.2, 1), rng.uniform(0.2, 2), sections=int(rng.integers(3, 20)))
    if kind == 3:
        return trimesh.creation.icosphere(int(rng.integers(0, 3)), rng.uniform(0.2, 1))
    if kind == 4:
        return trimesh.creation.box([rng.uniform(0.5, 2), rng.uniform(0.5, 2), rng.uniform(1e-3, 2e-2)])
    return trimesh.Trimesh(rng.normal(size=(int(rng.integers(4, 30)), 3))).convex_hull


def turn(rng: np.random.Generator) -> np.ndarray:
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def true_depth(a: np.ndarray, b: np.ndarray) -> float:
    """The distance of the origin from the nearest facet of the Minkowski difference, by qhull; 0 outside of it."""
    corners = (b[:, None] - a[None]).reshape(-1, 3)
    return max(0.0, float((-ConvexHull(corners).equations[:, 3]).min()))


def depth_by_all_axes(a: trimesh.Trimesh, b: trimesh.Trimesh) -> float:
    """The least overlap along all normals of faces and all lines square to an edge of each, no pair left out."""
    edges = [m.vertices[m.edges_unique[:, 0]] - m.vertices[m.edges_unique[:, 1]] for m in (a, b)]
    axes = np.concatenate([a.face_normals, b.face_normals, np.cross(edges[0][:, None], edges[1]).reshape(-1, 3)])
    axes = np.concatenate([axes, -axes])
    axes = axes[np.linalg.norm(axes, axis=1) > 1e-9]
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    ways = (
        float(((b.vertices @ some.T).max(axis=0) - (a.vertices @ some.T).min(axis=0)).min())
        for some in np.array_split(axes, 1 + len(axes) // 20000)
    )
    return max(0.0, min(ways))


def corners_of(scene: env2mjcf.Scene, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the link and of the obstacle in the world."""
    meshes = {p.name: p.mesh for p in scene.compiled.assembly.parts()}
    poses = (scene.link_poses(q)[0], scene.obstacle_poses()[0])
    names = (scene.link_names[0], scene.obstacle_names[0])
    out = [meshes[n].vertices[np.unique(meshes[n].faces)] @ p[:3, :3].T + p[:3, 3] for n, p in zip(names, poses)]  # noqa: B905
    return out[0], out[1]


def assert_in_both(contacts: list[Contact], bodies: tuple[np.ndarray, np.ndarray], slack: float) -> None:
    for corners in bodies:
        planes = ConvexHull(corners).equations
        for c in contacts:
            assert (planes[:, :3] @ c.position + planes[:, 3]).max() <= slack


def check_pairs(folder: Path, seed: int, count: int, engine: str) -> int:
    """Compare depths of `count` configurations of two random bodies; return how many overlap."""
    rng = np.random.default_rng(seed)
    small, big = random_body(rng), random_body(rng)
    text = free_cube("big.g 0 0 0 20 30 40", robot=FLYER)
    scene = env2mjcf.load(write_scene(folder, text, small=export_byu(small), big=export_byu(big)), engine=engine)
    assert all(p.analysis.convex for p in scene.compiled.assembly.parts())
    deep = 0
    for _ in range(count):
        q = np.concatenate([rng.normal(size=3) * rng.choice([0, 0.1, 0.5]), rng.uniform(-np.pi, np.pi, 3)])
        q[:3] += scene.obstacle_poses()[0][:3, 3]
        link, other = bodies = corners_of(scene, q)
        tolerance = 1e-6 * scene.extent
        expected = true_depth(link, other)
        if expected < 1e-4 * scene.extent:
            continue
        deep += 1
        contacts = scene.contacts(q)
        assert -scene.clearance(q) == pytest.approx(expected, abs=tolerance)
        assert -contacts[0].distance == pytest.approx(expected, abs=tolerance)
        assert max(-c.distance for c in contacts) <= expected + tolerance
        normal = contacts[0].normal
        assert np.linalg.norm(normal) == pytest.approx(1, abs=1e-12)
        # Pushed back along the normal, the link is beside the other; by a little less it is not.
        assert (link @ normal).max() + contacts[0].distance <= (other @ normal).min() + tolerance
        assert true_depth(link + 0.999 * contacts[0].distance * normal, other) > 0
        assert_in_both(contacts[:1], bodies, 1e-4 * scene.extent)
    return deep


@pytest.mark.parametrize("seed", range(3))
def test_depths_of_random_convex_bodies_are_those_of_the_minkowski_difference(tmp_path: Path, seed: int) -> None:
    assert check_pairs(tmp_path, seed, 15, ("exact", "mujoco")[seed % 2]) > 2


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["exact", "mujoco"])
def test_a_thousand_pairs_of_convex_bodies(tmp_path: Path, engine: str) -> None:
    deep, seed = 0, 100 if engine == "exact" else 10_000
    while deep < 1000:
        deep += check_pairs(tmp_path / str(seed), seed, 20, engine)
        seed += 1


def plate_and_bar(folder: Path, **options: object) -> env2mjcf.Scene:
    """A bar, which flies, and a plate about the origin."""
    text = free_cube("plate.g 0 0 0 0 0 0", robot=FLYER)
    meshes = {"small": box_mesh(0.17, 0.17, 0.05), "plate": box_mesh(0.5, 0.5, 0.25)}
    return env2mjcf.load(write_scene(folder, text, **meshes), **options)


@pytest.mark.parametrize("engine", ["exact", "mujoco"])
@pytest.mark.parametrize("place", [(0.1, 0, 0), (0, 0, 0), (0, 0.1, 0.1), (0, 0, -0.2)])
def test_a_bar_in_a_plate_comes_out_through_the_nearest_face(
    tmp_path: Path, place: tuple[float, float, float], engine: str
) -> None:
    scene = plate_and_bar(tmp_path, engine=engine)
    q = np.array([*place, 0, 0, 0])
    expected = 0.25 + 0.05 - abs(place[2])
    contacts = scene.contacts(q)
    assert scene.clearance(q) == pytest.approx(-expected, abs=1e-12)
    assert [c.distance for c in contacts] == pytest.approx([-expected] * 4, abs=1e-12)
    for c in contacts:
        np.testing.assert_allclose(np.abs(c.normal), [0, 0, 1], atol=1e-12)
        assert c.normal[2] * place[2] <= 0
    # The corners of the bar's face, half way through what the bodies share.
    found = sorted(tuple(np.round(c.position - place, 9) + 0.0) for c in contacts)
    assert found == [(x, y, 0.0) for x in (-0.17, 0.17) for y in (-0.17, 0.17)]
    (reason,) = scene.explain(q).contacts
    assert reason.distance == contacts[0].distance
    packed = scene.packed_contacts(q[None])
    np.testing.assert_array_equal(packed.distance, [c.distance for c in contacts])


def test_bodies_that_cannot_move_have_the_same_depths(tmp_path: Path) -> None:
    """A fixed robot in an obstacle: MuJoCo is asked once, at load."""
    robot = "1\nsmall.g Fixed 0 0 0 0 0 0\nConnections\n0\n"
    text = free_cube("plate.g 0.1 0 0 0 0 0", robot=robot)
    meshes = {"small": box_mesh(0.17, 0.17, 0.05), "plate": box_mesh(0.5, 0.5, 0.25)}
    scene = env2mjcf.load(write_scene(tmp_path, text, **meshes))
    q = np.zeros(scene.space.dim)
    assert scene.contacts(q)[0].distance == pytest.approx(-0.3, abs=1e-12)
    assert scene.clearance(q) == pytest.approx(-0.3, abs=1e-12)


def test_faces_edges_and_corners_meet_in_as_many_points_as_it_takes(tmp_path: Path) -> None:
    scene = env2mjcf.load(write_scene(tmp_path, free_cube("0 0 0 0 0 0")))
    reach = np.sqrt(0.5)
    down = np.arctan(np.sqrt(0.5))
    for q, points in (
        ((0.7, 0.2, 0.99, 0, 0, 0), [(0.2, -0.3), (0.2, 0.5), (0.5, -0.3), (0.5, 0.5)]),  # face on face
        ((0.1, 0, 0.5 + reach - 0.01, np.pi / 4, 0, 0), [(-0.4, 0), (0.5, 0)]),  # edge on face
        ((0, 0.1, 0.5 + np.sqrt(0.75) - 0.01, np.pi / 4, down, 0), [(0, 0.1)]),  # corner on face
    ):
        contacts = scene.contacts(np.array(q))
        assert [c.distance for c in contacts] == pytest.approx([-0.01] * len(points), abs=1e-9)
        found = np.array(sorted(tuple(np.round(c.position, 6)) for c in contacts))
        np.testing.assert_allclose(found, [(x, y, 0.495) for x, y in points], atol=1e-3)


def test_all_pairs_of_edges_agree_with_the_minkowski_difference() -> None:
    """Two independent answers, and the one under test."""
    rng = np.random.default_rng(5)
    for _ in range(60):
        a, b = random_body(rng), random_body(rng)
        rotation, translation = turn(rng), rng.normal(size=3) * 0.3
        moved = trimesh.Trimesh(b.vertices @ rotation.T + translation, b.faces, process=False)
        maps = (gauss_map(m.vertices[m.faces]) for m in (a, b))
        found = Overlap(a.vertices, b.vertices, *maps, rotation, translation)
        assert found.depth == pytest.approx(depth_by_all_axes(a, moved), abs=1e-9)
        assert found.depth == pytest.approx(true_depth(a.vertices, moved.vertices), abs=1e-7)


@pytest.mark.parametrize("digits", [6, 7])
def test_rounded_meshes_with_nearly_coplanar_faces_have_the_depth_of_their_hulls(digits: int) -> None:
    """Faces of a rounded box in many pieces are not quite in one plane, and slivers may point anywhere."""
    rng = np.random.default_rng(digits)
    for _ in range(15):
        meshes = []
        for _ in range(2):
            m = trimesh.creation.box(rng.uniform(0.3, 2, 3)).subdivide().subdivide()
            # Inner corners, nearly on the edges of the box: slivers.
            half = np.abs(m.vertices).max(axis=0)
            inner = np.abs(m.vertices) < 0.9 * half
            m.vertices = np.where(inner, np.sign(m.vertices) * rng.choice([0.5, 1 - 1e-5], 3) * half, m.vertices)
            meshes.append((np.round(m.vertices @ turn(rng).T, digits), m.faces))
        (v, f), (w, g) = meshes
        rotation, translation = turn(rng), rng.normal(size=3) * 0.3
        found = Overlap(v, w, gauss_map(v[f]), gauss_map(w[g]), rotation, translation)
        expected = true_depth(v, w @ rotation.T + translation)
        assert found.depth == pytest.approx(expected, abs=2e-6)
        assert found.depth >= expected - 1e-9


def test_balls_of_many_edges_do_not_take_long() -> None:
    """9,000,000 pairs of edges, of which hardly any are looked at."""
    ball = trimesh.creation.uv_sphere(count=[32, 48])
    assert len(ball.edges_unique) > 3000
    gauss = gauss_map(ball.vertices[ball.faces])
    for away in (0.0, 0.3, 1.9):
        found = Overlap(
            ball.vertices, ball.vertices, gauss, gauss, turn(np.random.default_rng(1)), np.array([away, 0, 0])
        )
        assert found.depth == pytest.approx(2 - away, abs=0.02)


def test_what_lies_over_each_other_is_where_polygons_overlap() -> None:
    square = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0.2, 0.1, 0)], dtype=float)

    def corners(first: np.ndarray, second: np.ndarray) -> set[tuple[float, ...]]:
        a, b = over_each_other(first, second, IN_PLANE, 1e-9)
        np.testing.assert_allclose(a[:, :2], b[:, :2], atol=1e-12)
        return {tuple(x) for x in np.round(a[:, :2], 9) + 0.0}

    assert corners(square, square + np.array([1, 0.5, 3])) == {(0, -0.5), (1, -0.5), (1, 1), (0, 1)}
    assert corners(square, np.array([(-3.0, 0, 1), (3, 0, 1)])) == {(-1, 0), (1, 0)}
    assert corners(np.array([(0.5, 0.5, 0.0)]), square) == {(0.5, 0.5)}
    assert corners(np.array([(0.0, -2, 0), (0, 2, 0)]), np.array([(-2.0, 0, 0), (2, 0, 0)])) == {(0, 0)}
    assert corners(np.array([(0.0, -2, 0), (0, 2, 0)]), np.array([(0.0, 1, 0), (0, 5, 0)])) == {(0, 1), (0, 2)}
    assert len(over_each_other(square, square + np.array([2.001, 0, 0]), IN_PLANE, 1e-9)[0]) == 1
