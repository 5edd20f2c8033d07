"""Projects points into pictures, by the textbook and not by the package."""

from __future__ import annotations

import math

import numpy as np

from env2mjcf.view import Viewpoint
from env2mjcf.view.cameras import FIELD_OF_VIEW


def projected(points: np.ndarray, camera: Viewpoint, size: tuple[int, int]) -> np.ndarray:
    """Return the pixels (x, y from the top left) of world points, (n, 2)."""
    width, height = size
    forward = np.array(camera.forward)
    right = np.cross(forward, (0, 0, 1))
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    seen = np.asarray(points) - np.array(camera.position)
    focal = height / 2 / math.tan(FIELD_OF_VIEW / 2)
    depth = seen @ forward
    assert (depth > 0).all(), "behind the camera"
    return np.stack([width / 2 + focal * (seen @ right) / depth, height / 2 - focal * (seen @ up) / depth], axis=1)
