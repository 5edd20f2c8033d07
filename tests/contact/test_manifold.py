"""Contacts of a pair of bodies: few, deep first, with normals that part them."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from real_scenes import FEW, real_scene, scene_names
from scenes import MODELS, box_mesh, free_cube, notched_block, write_scene

import env2mjcf
from env2mjcf.contact.manifold import Touch, merged

FLYER = "1\nsmall.g Volumetric Rotational\nConnections\n0\n"


def at(*xyz: float) -> np.ndarray:
    return np.array([*xyz, 0, 0, 0])


def touch(x: float, normal: tuple[float, float, float], distance: float) -> Touch:
    return Touch(np.array([x, 0.0, 0.0]), np.array(normal), distance)


def test_near_and_alike_contacts_are_one_and_the_deepest_stays() -> None:
    up, side = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)
    touches = [touch(0, up, -0.1), touch(0.01, up, -0.3), touch(0.01, side, -0.2), touch(1, up, -0.4)]
    assert [t.distance for t in merged(touches, 0.1)] == [-0.4, -0.3, -0.2]
    assert len(merged([touch(i, up, -0.1) for i in range(100)], 0.1)) == 8


@pytest.fixture(params=["auto", "surface"])
def notched(tmp_path: Path, request: pytest.FixtureRequest) -> env2mjcf.Scene:
    """A small cube and a block with a groove in its top, which is not convex."""
    path = write_scene(tmp_path, free_cube("block.g 0 0 0 0 0 0", robot=FLYER),
                       block=notched_block(), small=box_mesh(0.2, 0.2, 0.2))  # fmt: skip
    return env2mjcf.load(path, collision=request.param)


BOTTOM = 0.25 - float(np.mean([-1, 1, 1, 0.25]))
"""z of the bottom of the groove: the block is recentred on the mean of its vertices."""


@pytest.mark.parametrize(
    ("place", "normal", "depth"),
    [
        ((0, 0, BOTTOM + 0.2 - 0.02), (0, 0, -1), 0.02),  # into the bottom of the groove
        ((0.33, 0, BOTTOM + 0.4), (1, 0, 0), 0.03),  # into the groove's right side
        ((-0.34, 0.1, BOTTOM + 0.4), (-1, 0, 0), 0.04),  # into its left side
        ((1.15, 0.1, BOTTOM - 0.4), (-1, 0, 0), 0.05),  # into the block from the right
    ],
)
def test_the_normal_is_that_of_the_face(
    notched: env2mjcf.Scene, place: tuple[float, float, float], normal: tuple[float, float, float], depth: float
) -> None:
    contacts = notched.contacts(at(*place))
    assert 1 <= len(contacts) <= 8
    assert {(c.link, c.other, c.kind) for c in contacts} == {("small", "block", "obstacle")}
    np.testing.assert_allclose(contacts[0].normal, normal, atol=1e-9)
    assert contacts[0].distance == pytest.approx(-depth, abs=1e-9)
    assert notched.clearance(at(*place)) == pytest.approx(-depth, abs=1e-6)
    for c in contacts:
        assert np.abs(c.position - place).max() <= 0.2 + 1e-9
        assert np.abs((c.position - place) @ normal - 0.2 + depth) < 1e-6 or abs(c.normal @ normal) < 0.1


def test_a_body_in_a_corner_is_held_by_both_walls(notched: env2mjcf.Scene) -> None:
    normals = {tuple(np.round(c.normal)) for c in notched.contacts(at(0.32, 0, BOTTOM + 0.17))}
    assert {(1, 0, 0), (0, 0, -1)} <= normals


def test_a_body_inside_another_is_pushed_out_by_the_short_way(tmp_path: Path) -> None:
    path = write_scene(tmp_path, free_cube("block.g 0 0 0 0 0 0", robot=FLYER),
                       block=notched_block(), small=box_mesh(0.1, 0.1, 0.1))  # fmt: skip
    scene = env2mjcf.load(path)
    q = at(0.2, 0.7, BOTTOM - 0.6)
    (contact,) = scene.contacts(q)
    np.testing.assert_allclose(contact.normal, [0, -1, 0], atol=1e-9)
    assert contact.distance == pytest.approx(-0.4, abs=1e-6)
    assert contact.position[1] == pytest.approx(0.9, abs=1e-9)  # between the cube's side and the block's
    assert scene.clearance(q) == pytest.approx(contact.distance, abs=1e-9)
    out = q.copy()
    out[:3] += 1.001 * contact.normal * contact.distance
    assert not scene.in_collision(out)


def test_a_turned_cube_is_as_deep_as_its_corner(tmp_path: Path) -> None:
    scene = env2mjcf.load(write_scene(tmp_path, free_cube("5 0 0 0 0 0")))
    contacts = scene.contacts(np.array([4.3, 0, 0, 0, 0, 0.2]))
    reach = 0.5 * (np.cos(0.2) + np.sin(0.2))
    assert contacts[0].distance == pytest.approx(4.5 - 4.3 - reach, abs=1e-6)
    np.testing.assert_allclose(contacts[0].normal, [1, 0, 0], atol=1e-6)
    assert scene.clearance(np.array([4.3, 0, 0, 0, 0, 0.2])) == pytest.approx(contacts[0].distance, abs=1e-6)


def assert_sane(scene: env2mjcf.Scene, rows: np.ndarray) -> int:
    """Check the contacts of configurations and return how many there are."""
    count, verdicts = 0, scene.in_collision(rows)
    for q, hit in zip(rows, verdicts, strict=True):
        contacts = scene.contacts(q)
        assert bool(contacts) == hit
        assert {(c.link, c.other) for c in contacts} <= set(scene.pairs)
        of_pair = Counter((c.link, c.other) for c in contacts)
        assert max(of_pair.values(), default=0) <= 8
        for pair in of_pair:
            distances = [c.distance for c in contacts if (c.link, c.other) == pair]
            assert distances == sorted(distances)
            assert distances[0] <= 1e-5 * scene.extent
        if min((c.distance for c in contacts), default=0.0) < -1e-5 * scene.extent:
            assert min(c.distance for c in contacts) == pytest.approx(scene.clearance(q), abs=1e-9 * scene.extent)
        for c in contacts:
            assert np.linalg.norm(c.normal) == pytest.approx(1, abs=1e-9)
            assert np.isfinite(c.position).all()
        count += len(contacts)
    return count


@pytest.mark.slow_but("hull")
@pytest.mark.parametrize("name", ["seed", "alpha", "bug-trap", "two-robots", "gantry"])
@pytest.mark.parametrize("collision", ["auto", "surface", "hull"])
def test_contacts_of_models_are_sane(name: str, collision: str) -> None:
    scene = env2mjcf.load(MODELS / f"{name}/{name}.env", collision=collision)
    rows = scene.space.sample(60, seed=9)
    touching = rows[scene.in_collision(rows)][:10]
    assert assert_sane(scene, np.concatenate([rows[:5], touching])) or not len(touching)


@pytest.mark.slow_but(*FEW)
@pytest.mark.parametrize("name", scene_names(golden=True))
def test_contacts_of_real_scenes_are_sane(corpus: Path, name: str) -> None:
    real = real_scene(name)
    scene = env2mjcf.load(real.env, **real.keywords)
    golden = real.read_golden()
    assert_sane(scene, scene.space.decode(np.array([row["cfg"] for row in golden["random"]])))
