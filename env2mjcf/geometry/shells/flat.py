"""Convex polygons in a plane of their own, and cuts through them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..topology import Floats

# Distance from a cut, in units of the polygon's size, below which a corner lies on it.
_ON = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class FlatPolygon:
    """A convex polygon, counter-clockwise.

    Attributes:
        points: (k, 2).
        slopes: (k,) how the cell's side recedes at the edge that begins at each corner.
        axes: (2, 3) the plane's axes in the mesh's frame.
    """

    points: Floats
    slopes: Floats
    axes: Floats

    @property
    def area(self) -> float:
        """Its area (Gauss)."""
        x, y = self.points.T
        return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2

    @property
    def normals(self) -> Floats:
        """Outward unit normals of the edges, (k, 2)."""
        return _outward(self.points)

    def projected(self, points: Floats) -> Floats:
        """Return where points (n, 3) about the same origin lie in the plane, (n, 2)."""
        return points @ self.axes.T

    def beyond(self, normal: Floats, offset: float) -> FlatPolygon | None:
        """Return the part where `x . normal >= offset`, if that is more than an edge; the cut goes straight down."""
        height = self.points @ normal - offset
        height[np.abs(height) <= _ON * float(np.ptp(self.points, axis=0).max())] = 0.0
        if height.max() <= 0:
            return None
        points: list[Floats] = []
        slopes: list[float] = []
        for i, slope in enumerate(self.slopes.tolist()):
            j = (i + 1) % len(height)
            if height[i] >= 0:
                points.append(self.points[i])
                # What leaves at a corner on the cut gives way to the cut.
                slopes.append(0.0 if height[i] == 0 and height[j] < 0 else slope)
            if height[i] * height[j] < 0:
                share = height[i] / (height[i] - height[j])
                points.append(self.points[i] + share * (self.points[j] - self.points[i]))
                slopes.append(0.0 if height[i] > 0 else slope)
        return FlatPolygon(np.array(points), np.array(slopes), self.axes)


def hull_normals(points: Floats) -> Floats:
    """Return the outward unit normals of the edges of the convex hull of points (n, 2), (h, 2).

    By Andrew's monotone chain ("Another efficient algorithm for convex hulls in two dimensions", 1979).
    """
    order = np.unique(points, axis=0)
    if len(order) < 2:
        return np.zeros((0, 2))
    chain: list[Floats] = []
    for half in (order, order[::-1]):
        start = len(chain)
        for point in half:
            while len(chain) > start + 1 and _turn(chain[-2], chain[-1], point) <= 0:
                chain.pop()
            chain.append(point)
        chain.pop()
    return _outward(np.array(chain))


def _turn(a: Floats, b: Floats, c: Floats) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _outward(points: Floats) -> Floats:
    along = np.roll(points, -1, axis=0) - points
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return np.stack([along[:, 1], -along[:, 0]], axis=1)
