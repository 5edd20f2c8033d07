"""How deep bodies are that are not convex: resting contact, against algebra."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenes import box_mesh, free_cube, notched_block, write_scene
from truth import Truth

import env2mjcf
from env2mjcf.contact import separation
from env2mjcf.formats.meshes.byu import export_byu

FLYER = "1\nsmall.g Volumetric Rotational\nConnections\n0\n"
SMALL = 0.3
"""Half side of the box that flies."""
HALF, HOLE = 3.0, 1.0
"""Half sides of the block and of the square hole that leads into it from above."""


def block(*, through: bool = False) -> trimesh.Trimesh:
    """A block with a hole, open above and perhaps below, as one closed mesh."""
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], dtype=float)
    levels = (-HALF, HALF, -HALF if through else -HOLE, HALF)
    sizes = (HALF, HALF, HOLE, HOLE)
    vertices = [(s * x, s * y, z) for s, z in zip(sizes, levels, strict=True) for x, y in corners]
    quads = [] if through else [(3, 2, 1, 0), (8, 9, 10, 11)]
    for i in range(4):
        j = (i + 1) % 4
        quads += [(i, j, 4 + j, 4 + i), (8 + j, 8 + i, 12 + i, 12 + j), (4 + i, 4 + j, 12 + j, 12 + i)]
        quads += [(j, i, 8 + i, 8 + j)] if through else []
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return trimesh.Trimesh(vertices, faces, process=False)


def scene_of(folder: Path, small: str, big: str, **options: object) -> tuple[env2mjcf.Scene, np.ndarray]:
    """A body that flies in another one, and where the origin of the other's file lies."""
    path = write_scene(folder, free_cube("big.g 0 0 0 0 0 0", robot=FLYER), small=small, big=big)
    scene = env2mjcf.load(path, **options)
    (part,) = scene.compiled.assembly.obstacles
    lowest = part.mesh.vertices.min(axis=0) + scene.obstacle_poses()[0][:3, 3]
    return scene, lowest


def in_the_hole(folder: Path, small: str, *, through: bool = False) -> tuple[env2mjcf.Scene, np.ndarray]:
    """A body that flies in the block, and the middle of the hole's bottom square, raised by half of its side."""
    mesh = block(through=through)
    assert mesh.is_volume
    scene, lowest = scene_of(folder, small, export_byu(mesh))
    return scene, lowest + HALF


def assert_depth(scene: env2mjcf.Scene, q: np.ndarray, expected: float, rel: float = 1e-6) -> None:
    """Check what `clearance` and `contacts` say, and that the push of the deepest contact separates."""
    found = scene.contacts(q)
    slack = 1e-11 * scene.extent
    assert -scene.clearance(q) == pytest.approx(expected, rel=rel, abs=slack)
    assert -found[0].distance == pytest.approx(-scene.clearance(q), rel=0, abs=1e-12)
    assert min(c.distance for c in found) == found[0].distance
    free = q.copy()
    free[:3] += found[0].normal * (found[0].distance - slack)
    assert not Truth(scene).collides(free)


@pytest.mark.parametrize("depth", [1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("walls", [(2,), (0,), (1,), (0, 2), (0, 1), (0, 1, 2)])
def test_a_body_pressed_into_walls_and_corners_is_as_deep_as_it_is_pressed(
    tmp_path: Path, walls: tuple[int, ...], depth: float
) -> None:
    scene, middle = in_the_hole(tmp_path, box_mesh(SMALL, SMALL, SMALL))
    pressed = scene.extent * depth * np.array([1.0, 0.4, 0.7])[: len(walls)]
    q = np.zeros(6)
    q[:3] = middle + 0.05
    q[list(walls)] = middle[list(walls)] - HOLE + SMALL - pressed
    assert_depth(scene, q, float(np.linalg.norm(pressed)))


@pytest.mark.parametrize("depth", [1e-6, 1e-3])
def test_corners_and_edges_of_the_body_and_of_the_wall(tmp_path: Path, depth: float) -> None:
    scene, middle = in_the_hole(tmp_path, box_mesh(SMALL, SMALL, SMALL))
    depth = scene.extent * depth
    eighth, tip = np.pi / 4, np.arctan(np.sqrt(0.5))
    # An edge on the ground of the hole, then a corner.
    for angles, reach in (((eighth, 0, 0), np.sqrt(2)), ((eighth, tip, 0), np.sqrt(3))):
        place = middle + np.array([0.1, 0.05, -HOLE + reach * SMALL - depth])
        assert_depth(scene, np.r_[place, angles], depth)
    # An edge across the upright edge of the block, from outside.
    place = middle + np.array([HALF, HALF, 0.2]) + np.array([1, 1, 0]) / np.sqrt(2) * (np.sqrt(2) * SMALL - depth)
    assert_depth(scene, np.r_[place, eighth, 0, -eighth], depth)


def test_a_peg_in_a_hole_with_little_play_is_pressed_to_one_side(tmp_path: Path) -> None:
    peg = box_mesh(HOLE - 0.01, HOLE - 0.01, 2.0)
    scene, middle = in_the_hole(tmp_path, peg, through=True)
    for pressed in (1e-8, 1e-5, 1e-3):
        assert_depth(scene, np.r_[middle + np.array([0.01 + pressed, 0, 0]), 0, 0, 0], pressed)
        assert_depth(
            scene, np.r_[middle + np.array([0.01 + pressed, -0.01 - pressed, 0]), 0, 0, 0], np.sqrt(2) * pressed
        )
    # Too thick: no small push helps, and the way out is along the tunnel, up or down.
    scene, middle = in_the_hole(tmp_path / "thick", box_mesh(HOLE + 1e-3, HOLE - 0.01, 2.0), through=True)
    assert_depth(scene, np.r_[middle + np.array([0, 0, 1.5]), 0, 0, 0], HALF + 2.0 - 1.5)


@pytest.mark.parametrize("depth", [1e-7, 1e-3])
def test_a_corner_in_a_notch_touches_both_of_its_sides(tmp_path: Path, depth: float) -> None:
    """A V along y, 90 degrees wide, and a corner that is narrower."""
    profile = np.array([(-1, 0), (1, 0), (1, 1.5), (0.5, 1.5), (0, 1), (-0.5, 1.5), (-1, 1.5)])
    n = len(profile)
    vertices = [(x, y, z) for y in (-1.0, 1.0) for x, z in profile]
    front = [(0, 1, 4), (1, 2, 3), (1, 3, 4), (0, 4, 5), (0, 5, 6)]
    faces = [*front, *((a + n, c + n, b + n) for a, b, c in front)]
    for i in range(n):
        j = (i + 1) % n
        faces += [(i, j + n, j), (i, i + n, j + n)]
    notch = trimesh.Trimesh(vertices, faces, process=False)
    assert notch.is_volume
    tip = trimesh.Trimesh(
        [(0, 0, -0.4), (0.1, 0.1, 0), (-0.1, 0.1, 0), (0, -0.1, 0)], [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    )
    scene, lowest = scene_of(tmp_path, export_byu(tip), export_byu(notch))
    link = scene.compiled.assembly.links[0].mesh.vertices
    bottom = lowest + np.array([1, 1, 1]) - link[np.argmin(link[:, 2])]
    depth = depth * scene.extent
    assert_depth(scene, np.r_[bottom - np.array([0, 0, depth]), 0, 0, 0], depth)
    # Nearer to one of the sides, which alone is touched.
    assert_depth(scene, np.r_[bottom + np.array([0.1, 0, 0.1 - depth]), 0, 0, 0], depth * np.sqrt(0.5))


def test_depth_fades_to_zero_as_a_body_leaves_a_corner(tmp_path: Path) -> None:
    scene, middle = in_the_hole(tmp_path, box_mesh(SMALL, SMALL, SMALL))
    way = np.concatenate([np.logspace(-1.5, -8, 14), [0.0]])
    rows = np.zeros((len(way), 6))
    rows[:, :3] = middle - HOLE + SMALL - way[:, None] * [1, 0.5, 0.25]
    found = -scene.clearance(rows)
    np.testing.assert_allclose(found, way * np.linalg.norm([1, 0.5, 0.25]), rtol=1e-6, atol=1e-11)


@pytest.mark.slow_but("exact-auto", "mujoco-hull")
@pytest.mark.parametrize("collision", ["auto", "hull", "surface", "solid"])
@pytest.mark.parametrize("engine", ["exact", "mujoco"])
def test_no_contact_is_deeper_than_its_pair(tmp_path: Path, collision: str, engine: str) -> None:
    scene, _ = scene_of(tmp_path, box_mesh(0.4, 0.3, 0.2), notched_block(), collision=collision, engine=engine)
    q = scene.space.sample(24, seed=4) * [0.15, 0.15, 0.15, 1, 1, 1]
    depths = -scene.clearance(q)
    deep = np.flatnonzero(depths > 1e-4)[:4]
    assert len(deep) == 4
    for i in deep:
        contacts = scene.contacts(q[i])
        assert max(-c.distance for c in contacts) == pytest.approx(depths[i], abs=1e-12)
        (reason,) = scene.explain(q[i]).contacts
        assert -reason.distance == pytest.approx(depths[i], abs=1e-12)


def test_one_more_pair_of_triangles_changes_little_of_what_is_looked_at() -> None:
    """Which triangles barely touch is a matter of rounding: the depth must not hang on it."""
    pairs = np.random.default_rng(3).integers(0, 10_000, (4_000, 2))
    looked_at = set(map(tuple, separation._some(pairs).tolist()))
    for left_out in range(0, 4_000, 97):
        fewer = separation._some(np.delete(pairs, left_out, axis=0))
        assert len(looked_at - set(map(tuple, fewer.tolist()))) <= 1
    shuffled = separation._some(pairs[::-1])
    assert looked_at == set(map(tuple, shuffled.tolist()))
