"""Whether links stay within the boundary: every vertex, closed, missing axes unbounded."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..geometry.assembly import Part
from ..kinematics.transforms import Array
from ..model.environment import Boundary

ROUNDING = 1e-12
"""Of a vertex that lies exactly on the boundary, as a fraction of the boundary's size."""


class BoundaryTest:
    """Tests the vertices of links against a boundary.

    Args:
        boundary: In metres; None accepts everything.
        links: The links, in the order of the poses that will be asked about.
    """

    def __init__(self, boundary: Boundary | None, links: Sequence[Part]) -> None:
        self._boundary = boundary
        self._vertices = [p.mesh.used_vertices for p in links]

    def inside(self, poses: Array) -> NDArray[np.bool_]:
        """Return whether every vertex is inside, (n,), for link poses (n, nlinks, 4, 4)."""
        ok = np.ones(len(poses), dtype=bool)
        if self._boundary is None:
            return ok
        for i, vertices in enumerate(self._vertices):
            ok &= self._link_inside(poses[:, i], vertices)
        return ok

    def _link_inside(self, poses: Array, vertices: Array) -> NDArray[np.bool_]:
        boundary = self._boundary
        assert boundary is not None
        world = np.einsum("nij,vj->nvi", poses[:, :3, :3], vertices) + poses[:, None, :3, 3]
        if boundary.lower:
            axes = len(boundary.lower)
            lower, upper = np.array(boundary.lower), np.array(boundary.upper)
            slack = ROUNDING * float(np.max(np.abs([lower, upper])))
            low, high = world[..., :axes].min(axis=1), world[..., :axes].max(axis=1)
            return np.all((low >= lower - slack) & (high <= upper + slack), axis=-1)
        axes = len(boundary.center)
        distance = np.linalg.norm(world[..., :axes] - boundary.center, axis=-1).max(axis=1)
        return distance <= boundary.radius * (1 + ROUNDING)
