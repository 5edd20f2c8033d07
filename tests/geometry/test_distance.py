"""Distances of triangles and of triangle meshes, against coal, python-fcl and algebra."""

from __future__ import annotations

import numpy as np
import pytest
from distances import coal_distance, coal_model, fcl_distance
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from env2mjcf.geometry.distance import nearest
from env2mjcf.geometry.pieces import hull_triangles, hull_volume
from env2mjcf.geometry.triangle_search import Jobs, Search
from env2mjcf.geometry.triangle_sweep import escapes
from env2mjcf.geometry.triangle_tree import forest

FLAT = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])


def one(a: np.ndarray, b: np.ndarray) -> float:
    return float(nearest(np.asarray(a, float)[None], np.asarray(b, float)[None]).distance[0])


@pytest.mark.parametrize(
    ("other", "distance"),
    [
        (FLAT + np.array([0, 0, 2]), 2.0),
        (FLAT + np.array([0.2, 0.2, 0]), 0.0),  # in one plane, overlapping
        (FLAT * 0.1 + np.array([0.2, 0.2, 0]), 0.0),  # in one plane, one inside the other
        (FLAT + np.array([3, 0, 0]), 2.0),  # in one plane, apart
        ([[0.2, 0.2, 0.5], [0.2, 0.2, 3], [5, 5, 3]], 0.5),  # a corner above the inside
        ([[0.2, 0.2, -1], [0.2, 0.2, 1], [5, 5, 1]], 0.0),  # an edge through the inside
        ([[-1, 0.5, 1], [2, 0.5, 1], [0, 0.5, 4]], 1.0),  # an edge above an edge and the inside
        ([[0.5, 0.5, 0], [3, 3, 0], [3, 3, 1]], 0.0),  # a corner on an edge
        ([[2, 0, 0], [2, 0, 0], [2, 0, 0]], 1.0),  # a point
        ([[-1, -1, 3], [2, 2, 3], [0.5, 0.5, 3]], 3.0),  # a line
        ([[0.1, 0.1, -1], [0.1, 0.1, 1], [0.1, 0.1, 0]], 0.0),  # a line through the inside
    ],
)
def test_known_distances(other: list[list[float]], distance: float) -> None:
    assert one(FLAT, np.array(other)) == pytest.approx(distance, abs=1e-14)
    assert one(np.array(other), FLAT) == pytest.approx(distance, abs=1e-14)


def test_random_triangles_are_as_far_apart_as_coal_and_fcl_say() -> None:
    rng = np.random.default_rng(3)
    a, b = rng.normal(size=(2, 400, 3, 3))
    # Slivers, and nearly parallel ones.
    a[:100, 2] = a[:100, 0] + 1e-5 * a[:100, 2]
    b[50:150] = a[50:150] + 1e-6 * b[50:150] + [0, 0, 0.3]
    b[200:] += [1.5, 0, 0]
    found, face = nearest(a, b), np.array([[0, 1, 2]])
    assert 20 < (found.distance == 0).sum() < 380
    for i in range(len(a)):
        of_coal = coal_distance(coal_model(a[i], face), np.eye(4), coal_model(b[i], face), np.eye(4))
        assert found.distance[i] == pytest.approx(max(of_coal, 0.0), abs=2e-6 if of_coal < 2e-6 else 1e-9)
        if i >= 150:
            assert found.distance[i] == pytest.approx(max(fcl_distance(a[i : i + 1], b[i : i + 1]), 0), abs=1e-6)


coordinates = arrays(np.float64, (2, 3, 3), elements=st.integers(-3, 3).map(float) | st.floats(-3, 3, width=32))


@settings(max_examples=200, deadline=None)
@given(coordinates)
def test_nearest_points_lie_on_the_triangles_and_no_sampled_ones_are_nearer(both: np.ndarray) -> None:
    """Degenerate triangles included."""
    a, b = both
    found = nearest(a[None], b[None])
    grid = np.array([(i, j, 12 - i - j) for i in range(13) for j in range(13 - i)]) / 12
    samples_a, samples_b = grid @ a, grid @ b
    sampled = np.linalg.norm(samples_a[:, None] - samples_b[None], axis=2).min()
    assert found.distance[0] <= sampled + 1e-9
    # Within half a step of the grid of any point there is a sample.
    step = max(np.linalg.norm(np.ptp(t, axis=0)) for t in both) / 12
    assert found.distance[0] >= sampled - 2 * step - 1e-9
    if found.distance[0] > 0:
        assert np.linalg.norm(found.on_a[0] - found.on_b[0]) == pytest.approx(found.distance[0], abs=1e-12)
    assert np.linalg.norm(samples_a - found.on_a[0], axis=1).min() <= step
    assert np.linalg.norm(samples_b - found.on_b[0], axis=1).min() <= step
    assert one(b, a) == pytest.approx(found.distance[0], abs=1e-9)


@pytest.mark.parametrize("sizes", [(1, 1), (2, 3), (5, 17), (64, 65), (300, 1000)])
def test_every_triangle_is_a_leaf_and_lies_in_the_boxes_above_it(sizes: tuple[int, int]) -> None:
    rng = np.random.default_rng(sum(sizes))
    meshes = [rng.normal(size=(m, 3, 3)) for m in sizes]
    trees = forest(meshes)
    leaves = np.flatnonzero(trees.children == 0)
    np.testing.assert_array_equal(np.sort(trees.triangle[leaves]), np.arange(sum(sizes)))
    below = {int(leaf): [int(trees.triangle[leaf])] for leaf in leaves}
    for node in range(len(trees.first) - 1, -1, -1):
        if trees.children[node]:
            first = int(trees.first[node])
            below[node] = [t for c in range(first, first + int(trees.children[node])) for t in below[c]]
        corners = trees.triangles[below[node]].reshape(-1, 3) - trees.center[node]
        assert (np.abs(corners @ trees.frame[node]) <= trees.half[node] + 1e-9).all()
    assert sorted(below[int(trees.roots[1])]) == list(range(sizes[0], sum(sizes)))


def random_jobs(rng: np.random.Generator, count: int, spread: float) -> Jobs:
    rotation = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation))[:, None, None]
    translation = spread * rng.normal(size=(count, 3))
    zeros = np.zeros(count, dtype=np.int64)
    return Jobs(zeros, zeros + 1, rotation, translation, np.arange(count))


def test_meshes_are_as_far_apart_as_their_nearest_triangles() -> None:
    rng = np.random.default_rng(8)
    small = 0.15 * rng.normal(size=(2, 60, 3, 3)) + rng.normal(size=(2, 60, 1, 3))
    jobs = random_jobs(rng, 40, 3.0)
    found = Search(forest(list(small)), jobs, np.full(40, np.inf), 1e-13).run()
    for k in range(40):
        moved = small[1] @ jobs.rotation[k].T + jobs.translation[k]
        brute = nearest(np.repeat(small[0], 60, axis=0), np.tile(moved, (60, 1, 1))).distance.min()
        assert found.distance[k] == pytest.approx(brute, abs=1e-12)
        assert (brute == 0) == bool((found.touching[:, 0] == k).any())
        assert found.distance[k] == pytest.approx(fcl_distance(small[0], moved), abs=1e-6)
    assert 3 < (found.distance == 0).sum() < 37
    together = Jobs(jobs.a, jobs.b, jobs.rotation, jobs.translation, np.arange(40) // 20)
    least = Search(forest(list(small)), together, np.full(2, np.inf), 1e-13).run()
    np.testing.assert_allclose(least.distance, [found.distance[:20].min(), found.distance[20:].min()])


def test_a_push_ends_where_the_triangles_come_free() -> None:
    """Against a walk in small steps with python-fcl."""
    rng = np.random.default_rng(4)
    small = 0.3 * rng.normal(size=(2, 12, 3, 3)) + 0.3 * rng.normal(size=(2, 12, 1, 3))
    jobs = random_jobs(rng, 12, 0.2)
    directions = rng.normal(size=(12, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ways = escapes(forest(list(small)), jobs, directions, np.full(12, 10.0))
    assert (ways > 0.01).sum() > 5
    for k in range(12):
        moved = small[1] @ jobs.rotation[k].T + jobs.translation[k]
        assert fcl_distance(small[0] + (ways[k] + 1e-6) * directions[k], moved) > 0
        for part in np.linspace(0, 0.9999, 40):
            if ways[k] > 0:
                assert fcl_distance(small[0] + part * ways[k] * directions[k], moved) <= 1e-6
    for few in (0, 1, 5):
        short = escapes(forest(list(small)), jobs, directions, ways / 2, few)
        assert (short <= ways + 1e-12).all()
        if not few:
            assert (short > ways / 2)[ways > 0].all()


def test_the_triangles_of_a_hull_enclose_its_points() -> None:
    points = np.random.default_rng(2).normal(size=(80, 3)) + np.array([100, 0, 0])
    triangles = hull_triangles(points)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    heights = np.einsum("vmi,mi->vm", points[:, None] - triangles[None, :, 0], normals)
    assert heights.max() < 1e-5
    volume = np.einsum("mi,mi->", triangles[:, 0] - [100, 0, 0], normals) / 6
    assert volume == pytest.approx(hull_volume(points), rel=1e-5)
