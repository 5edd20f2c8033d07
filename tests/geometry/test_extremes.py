"""The highest of many points: against all of them, one by one."""

from __future__ import annotations

import numpy as np
import pytest

from env2mjcf.geometry.extremes import PointTree
from env2mjcf.limits import TooMuchWorkError, Work


@pytest.mark.parametrize("count", [1, 7, 8, 9, 1000, 3001])
def test_the_highest_point_along_any_direction(count: int) -> None:
    rng = np.random.default_rng(count)
    points, normals = rng.standard_normal((count, 3)), rng.standard_normal((700, 3))
    all_heights = normals @ points.T
    known = all_heights[np.arange(700), rng.integers(count, size=700)]
    tree = PointTree(points)
    np.testing.assert_allclose(tree.highest(normals, known), all_heights.max(axis=1), rtol=0, atol=1e-14)
    np.testing.assert_array_equal(tree.highest(normals, known + 100), known + 100)
    # Above its limit any height will do; below, the highest.
    limits = np.full(700, np.median(all_heights.max(axis=1)))
    found = tree.highest(normals, known, limits)
    below = all_heights.max(axis=1) <= limits
    np.testing.assert_allclose(found[below], all_heights[below].max(axis=1), rtol=0, atol=1e-14)
    assert (found[~below] > limits[~below]).all()


def test_a_flat_side_costs_work() -> None:
    flat = np.column_stack([np.random.default_rng(0).random((20_000, 2)), np.zeros(20_000)])
    tilted = flat @ np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0].T
    up = np.cross(tilted[1] - tilted[0], tilted[2] - tilted[0])
    work = Work(100_000)
    with pytest.raises(TooMuchWorkError):
        PointTree(tilted).highest(
            np.repeat(up[None] / np.linalg.norm(up), 2000, axis=0), np.full(2000, -9.0), work=work
        )
