"""Cuts through flat convex polygons, against areas and half-planes."""

from __future__ import annotations

import numpy as np
import pytest

from env2mjcf.geometry.shells.splitting import FlatPolygon, hull_normals

AXES = np.eye(3)[:2]


def ellipse(corners: int, seed: int) -> FlatPolygon:
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, corners))
    points = np.column_stack([3 * np.cos(angle), np.sin(angle)]) + rng.normal(size=2)
    return FlatPolygon(points, np.arange(1.0, corners + 1)[:, None] * (1, -1), AXES)


@pytest.mark.parametrize("seed", range(20))
def test_the_two_sides_of_a_cut_make_up_the_polygon(seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    polygon = ellipse(3 + seed % 6, seed)
    normal = rng.normal(size=2)
    normal /= np.linalg.norm(normal)
    height = polygon.points @ normal
    # Through a corner every other time.
    offset = float(np.sort(height)[1] if seed % 2 else rng.uniform(height.min(), height.max()))
    above, below = polygon.beyond(normal, offset), polygon.beyond(-normal, -offset)
    assert above is not None
    assert below is not None
    assert above.area + below.area == pytest.approx(polygon.area)
    assert (above.points @ normal >= offset - 1e-8).all()
    assert (below.points @ normal <= offset + 1e-8).all()
    for part in (above, below):
        # One edge is the cut, straight with a lip; the others lie on edges of the polygon, whose slopes they have.
        slopes, lips = part.sides.T
        assert (slopes == 0).sum() == 1
        assert lips[slopes == 0] == pytest.approx(-1 / np.tan(np.radians(3)))
        for start, end, slope, lip in zip(part.points, np.roll(part.points, -1, axis=0), slopes, lips, strict=True):
            if slope:
                assert lip == -slope
                a, b = polygon.points[int(slope) - 1], polygon.points[int(slope) % len(polygon.points)]
                for p in (start, end):
                    assert abs((b - a)[0] * (p - a)[1] - (b - a)[1] * (p - a)[0]) < 1e-9


def test_nothing_lies_beyond_a_cut_along_an_edge() -> None:
    polygon = ellipse(5, 1)
    for normal, point in zip(polygon.normals, polygon.points, strict=True):
        assert polygon.beyond(normal, float(normal @ point)) is None
        whole = polygon.beyond(-normal, float(-normal @ point))
        assert whole is not None
        assert whole.area == pytest.approx(polygon.area)
        np.testing.assert_array_equal(np.sort(whole.sides, axis=0), np.sort(polygon.sides, axis=0))


def test_hull_normals_bound_the_points_and_touch_them() -> None:
    points = np.random.default_rng(0).normal(size=(200, 2))
    normals = hull_normals(points)
    reach = (points @ normals.T).max(axis=0)
    # Each is square to an edge: two points are as far as any.
    assert ((np.abs(points @ normals.T - reach) < 1e-12).sum(axis=0) == 2).all()
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)
    turn = np.unwrap(np.arctan2(normals[:, 1], normals[:, 0]))
    assert (np.diff(turn) > 0).all()
    assert len(hull_normals(points[:1])) == 0
