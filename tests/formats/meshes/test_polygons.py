"""Polygons cut into triangles."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from env2mjcf.formats.meshes.polygons import triangulate

L_SHAPE = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
# A square with a square hole, cut in along a bridge that is walked twice.
KEYHOLE = [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)]
T_JUNCTIONS = [(0, 0), (1, 0), (2, 0), (3, 0), (3, 3), (0, 3)]
COMB = [(0, 0), (7, 0), (7, 5), (6, 1), (5, 5), (4, 1), (3, 5), (2, 1), (1, 5)]
DART = [(0, 0), (2, 1), (0, 2), (0.5, 1)]


def cut(points: np.ndarray) -> tuple[np.ndarray, list[int]]:
    n = len(points)
    return triangulate(points, np.arange(n), np.array([n]))


def in_space(outline: list[tuple[float, float]] | np.ndarray) -> np.ndarray:
    """Put an outline into a slanted plane far from the origin."""
    u, v = np.array([2.0, 1.0, -2.0]) / 3, np.array([1.0, 2.0, 2.0]) / 3
    return np.asarray(outline, dtype=float) @ np.stack([u, v]) + (10.0, -20.0, 30.0)


def vector_areas(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = (points[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a) / 2


def assert_tiles(points: np.ndarray, faces: np.ndarray) -> None:
    """All triangles face one way, their area is the polygon's, their outer edges are its edges, each once."""
    n = len(points)
    assert len(faces) == n - 2
    areas = vector_areas(points, faces)
    total = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0) / 2
    size = np.linalg.norm(total)
    np.testing.assert_allclose(areas.sum(axis=0), total, atol=1e-9 * max(size, 1.0))
    assert np.linalg.norm(areas, axis=1).sum() == pytest.approx(size, rel=1e-9)
    edges = Counter((int(f[k]), int(f[k - 2])) for f in faces for k in range(3))
    outer = {e for e in edges if e[::-1] not in edges}
    assert max(edges.values()) == 1
    assert outer == {(k, (k + 1) % n) for k in range(n)}


@pytest.mark.parametrize("outline", [L_SHAPE, KEYHOLE, T_JUNCTIONS, COMB, DART])
@pytest.mark.parametrize("turned", [1, -1])
def test_a_polygon_is_tiled_without_new_vertices(outline: list[tuple[float, float]], turned: int) -> None:
    for start in range(len(outline)):
        points = in_space(np.roll(np.array(outline, dtype=float), start, axis=0)[::turned])
        faces, crossing = cut(points)
        assert_tiles(points, faces)
        assert crossing == []


@given(arrays(np.float64, st.integers(4, 30), elements=st.floats(0.2, 1.0)), st.floats(1e-3, 1e3))
def test_any_star_shaped_polygon_is_tiled(radii: np.ndarray, scale: float) -> None:
    angles = np.linspace(0, 2 * np.pi, len(radii), endpoint=False)
    points = in_space(radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)) * scale
    faces, crossing = cut(points)
    assert crossing == []
    size = scale**2
    areas = vector_areas(points / scale, faces)
    assert np.linalg.norm(areas, axis=1).sum() == pytest.approx(
        np.sum(radii * np.roll(radii, -1)) * np.sin(2 * np.pi / len(radii)) / 2, rel=1e-9
    ), size


def test_a_convex_polygon_is_a_fan_around_its_first_corner() -> None:
    angles = np.linspace(0, 2 * np.pi, 6, endpoint=False)
    points = in_space(np.stack([np.cos(angles), np.sin(angles)], axis=1))
    assert cut(points)[0].tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]


def test_a_dart_is_cut_at_its_notch() -> None:
    faces, _ = cut(in_space(DART))
    assert {frozenset(f) for f in faces.tolist()} == {frozenset({0, 1, 3}), frozenset({1, 2, 3})}


def test_polygons_of_all_sizes_keep_their_order() -> None:
    points = np.concatenate([in_space(L_SHAPE), in_space(DART)])
    corners = np.array([0, 1, 2, 6, 7, 8, 9, 3, 4, 5, *range(6)])
    faces, _ = triangulate(points, corners, np.array([3, 4, 3, 6]))
    assert faces[0].tolist() == [0, 1, 2]
    assert set(faces[1:3].ravel().tolist()) == {6, 7, 8, 9}
    assert faces[3].tolist() == [3, 4, 5]
    assert set(faces[4:].ravel().tolist()) == set(range(6))
    assert len(faces) == 8


@pytest.mark.parametrize(
    "outline",
    [
        [(0, 0), (1, 1), (1, 0), (0, 1)],
        [(0, 0), (3, 3), (1, 0), (0, 1)],
        [(np.cos(4 * np.pi * k / 5), np.sin(4 * np.pi * k / 5)) for k in range(5)],
    ],
)
def test_a_polygon_that_crosses_itself_is_told(outline: list[tuple[float, float]]) -> None:
    faces, crossing = cut(in_space(outline))
    assert len(faces) == len(outline) - 2
    assert crossing == [0]


def test_a_polygon_without_area_keeps_its_edges_and_is_no_crossing() -> None:
    points = in_space([(0, 0), (1, 0), (3, 0), (2, 0)])
    faces, crossing = cut(points)
    assert len(faces) == 2
    assert crossing == []


@pytest.mark.parametrize("scale", [1e-300, 1e-5, 1e5, 1.7e307])
@pytest.mark.filterwarnings("error")
def test_size_does_not_matter(scale: float) -> None:
    outline = np.array(DART) * 2.0 - 3.0
    points = np.column_stack([outline, np.zeros(len(outline))]) * scale
    assert {frozenset(f) for f in cut(points)[0].tolist()} == {frozenset({0, 1, 3}), frozenset({1, 2, 3})}


def test_the_place_does_not_matter() -> None:
    """Corners that doubles hold to the digit, a billion times as far away as they are apart."""
    points = np.column_stack([8.0 * np.array(DART), np.zeros(len(DART))]) + 2.0 ** np.array([34, 35, 33])
    faces, crossing = cut(points)
    assert {frozenset(f) for f in faces.tolist()} == {frozenset({0, 1, 3}), frozenset({1, 2, 3})}
    assert crossing == []
