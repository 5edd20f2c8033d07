"""Large polygons with a thin spot: cut in their own plane, so that only what lies over the spot is thin."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..topology import Bools, Floats
from .cells import Group, group_of
from .fitting import Surroundings, corners_within, fit
from .pairing import FLAT

THIN = 0.25
"""Depth in units of `Group.shallow` below which a cell is worth cutting."""

_SPOT = 8.0
"""What counts as a thin spot: where other faces are less deep than this many times the cell."""

_LEAST_SHARE = 0.1
"""Least area beside the spot, in units of the polygon's, that is worth a cell of its own."""

_ON = 1e-9
"""Distance from a cut, in units of the polygon's size, below which a corner lies on it."""

_CUTS = 4
_ROUNDS = 3


def split_thin(group: Group, wanted: Floats, around: Surroundings, diagonal: float) -> list[tuple[int, list[Group]]]:
    """Cut the polygons of thin cells.

    Args:
        group: Fitted cells.
        wanted: (g, k) how their sides leaned before.
        around: What may reach into cells.
        diagonal: Of the mesh.

    Returns:
        Row and fitted parts, groups of one, of each polygon most of which becomes at least twice as thick.
    """
    out: list[tuple[int, list[Group]]] = []
    for row in np.flatnonzero(_worth_cutting(group)).tolist():
        before = float(group.depth()[row])
        corners = group.corners[row] + group.centers[row]
        sides = np.stack([wanted[row], group.lips[row]], axis=1)
        parts = list(_parts(group, row, corners, sides, around, diagonal, _ROUNDS))
        areas = np.array([_flat(part, 0, sides).area for part in parts])
        better = np.array([part.depth()[0] >= 2 * before for part in parts])
        if areas[better].sum() > areas.sum() / 2:
            out.append((row, parts))
    return out


def _worth_cutting(group: Group) -> Bools:
    """Tell which cells are thin, and wide enough for parts that are wider than deep, (g,)."""
    depth = group.depth()
    return np.asarray((depth > 0) & (depth < THIN * group.shallow) & (group.width > 2 * group.shallow))


def _parts(
    group: Group, row: int, corners: Floats, sides: Floats, around: Surroundings, diagonal: float, rounds: int
) -> Iterator[Group]:
    """Fit a cell under a part of a polygon, (k, 3) in the mesh's frame; where it is thin, cut the part further."""

    def cell() -> Group:
        members, normals = group.members[row : row + 1], group.normals[row : row + 1]
        return group_of(members, corners[None], normals, sides[None, :, 0].copy(), sides[None, :, 1], diagonal)

    fitted = cell()
    fit(fitted, around)
    if rounds == 0 or not _worth_cutting(fitted)[0]:
        yield fitted
        return
    part, low = _flat(fitted, 0, sides), cell()
    low.height = np.minimum(low.shallow, _SPOT * fitted.depth())
    free, rest = _cut_free(part, part.projected(corners_within(low, around)), low.shallow)
    if not free:
        yield fitted
        return
    for piece in (*free, rest):
        lifted = piece.points @ part.axes + fitted.centers[0]
        yield from _parts(group, row, lifted, piece.sides, around, diagonal, rounds - 1)


def _flat(group: Group, row: int, sides: Floats) -> FlatPolygon:
    inward, normal = group.inward[row, 0], group.normals[row]
    axes = np.stack([np.cross(inward, normal), inward])
    return FlatPolygon(group.corners[row] @ axes.T, sides, axes)


def _cut_free(part: FlatPolygon, spot: Floats, narrow: float) -> tuple[list[FlatPolygon], FlatPolygon]:
    """Cut off what lies beside a spot (n, 2), along its outline or the polygon's: the largest parts first."""
    free: list[FlatPolygon] = []
    least = _LEAST_SHARE * part.area
    for _ in range(_CUTS):
        best, border, largest = None, (np.zeros(2), 0.0), least
        for normal in np.concatenate([hull_normals(spot), part.normals, -part.normals]):
            offset = float((spot @ normal).max(initial=-np.inf))
            beside = part.beyond(normal, offset)
            if beside is not None and beside.area > largest and float(np.ptp(beside.points @ normal)) > narrow:
                best, border, largest = beside, (-normal, -offset), beside.area
        rest = part.beyond(*border)
        if best is None or rest is None:
            break
        free.append(best)
        part = rest
    return free, part


@dataclass(frozen=True, slots=True, eq=False)
class FlatPolygon:
    """A convex polygon, counter-clockwise.

    Attributes:
        points: (k, 2).
        sides: (k, 2) how the cell's side, and its lip, recede at the edge that begins at each corner.
        axes: (2, 3) the plane's axes in the mesh's frame.
    """

    points: Floats
    sides: Floats
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
        """Return the part where `x . normal >= offset`, if that is more than an edge; cut straight down, with a lip."""
        height = self.points @ normal - offset
        height[np.abs(height) <= _ON * float(np.ptp(self.points, axis=0).max())] = 0.0
        if height.max() <= 0:
            return None
        points: list[Floats] = []
        sides: list[Floats] = []
        cut = np.array([0.0, FLAT])
        for i, side in enumerate(self.sides):
            j = (i + 1) % len(height)
            if height[i] >= 0:
                points.append(self.points[i])
                # What leaves at a corner on the cut gives way to the cut.
                sides.append(cut if height[i] == 0 and height[j] < 0 else side)
            if height[i] * height[j] < 0:
                share = height[i] / (height[i] - height[j])
                points.append(self.points[i] + share * (self.points[j] - self.points[i]))
                sides.append(cut if height[i] > 0 else side)
        return FlatPolygon(np.array(points), np.array(sides), self.axes)


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
