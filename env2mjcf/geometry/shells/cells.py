"""The cell under each polygon: the half-spaces that bound it, and the corners of what lies in all of them.

Cells are kept in groups of polygons with equally many corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..coplanar import Polygon
from ..pieces import by_length, corner_loops, flattened
from ..topology import Bools, Floats, Ints

PARALLEL = 1e-9
"""Sine of the angle between two edges below which they are taken for parallel."""

_SIDE_MARGIN = 0.01
"""Margin of the sides in units of that of top and bottom. Polygons may be bent by the whole margin, sides follow their
edges exactly; and what is overlooked where two sides meet at a sharp corner is many margins wide."""


@dataclass(slots=True, eq=False)
class Group:
    """Cells under g polygons of k corners each; `slopes`, `height` and `tilted` are still to be fitted.

    The cell of a polygon with outward normal n holds the points at depth 0 <= z <= height below its plane, for which
    the distance inside of edge i's line is at least slopes[i] * z.

    Attributes:
        members: (g,) number of each polygon.
        centers: (g, 3) mean of the corners, in the mesh's frame.
        corners: (g, k, 3) relative to the centre.
        normals: (g, 3).
        inward: (g, k, 3) unit vectors in the polygon's plane, square to the edge that begins at each corner.
        reach: (g, k) distance of the centre from each edge's line.
        slopes: (g, k) how far each side recedes per unit of depth; negative where it leans outward.
        height: (g,).
        tilted: (g,) whether a side leans more than its edge asks for.
    """

    members: Ints
    centers: Floats
    corners: Floats
    normals: Floats
    inward: Floats
    reach: Floats
    slopes: Floats
    height: Floats
    tilted: Bools

    def __len__(self) -> int:
        return len(self.members)

    def depth(self) -> Floats:
        """Return how deep each cell is below its centre, (g,)."""
        return np.minimum(self.height, self.limits(np.arange(len(self))).min(axis=1))

    def limits(self, rows: Ints) -> Floats:
        """Return how deep each side of some cells lets them be below their centres, (len(rows), k)."""
        reach, slopes = self.reach[rows], self.slopes[rows]
        return np.divide(reach, slopes, out=np.full(slopes.shape, np.inf), where=slopes > 0)

    def planes(self, rows: Ints, margin: float) -> Floats:
        """Return the planes (len(rows), k + 2, 4) of some cells about their centres, moved inward by a margin.

        The last two are the polygon's own and the bottom; x . plane[:3] + plane[3] >= 0 inside.
        """
        normal, slopes = self.normals[rows], self.slopes[rows]
        scale = np.sqrt(1 + slopes**2)
        sides = (self.inward[rows] + slopes[:, :, None] * normal[:, None]) / scale[:, :, None]
        # The edges' lines lie in the plane through the centre, so the slope does not enter their offsets.
        offsets = self.reach[rows] / scale - _SIDE_MARGIN * margin
        top = np.column_stack([-normal, np.full(len(rows), -margin)])
        bottom = np.column_stack([normal, self.height[rows] - margin])
        return np.concatenate([np.concatenate([sides, offsets[:, :, None]], axis=2), top[:, None], bottom[:, None]], 1)

    def boxes(self) -> tuple[Floats, Floats]:
        """Return the corners of boxes around the cells, (g, 3) each."""
        bottom = self.corners + self.height[:, None, None] * (self._outward() - self.normals[:, None])
        both = np.concatenate([self.corners, bottom], axis=1)
        return self.centers + both.min(axis=1), self.centers + both.max(axis=1)

    def _outward(self) -> Floats:
        """Return how far the corners move per unit of depth, (g, k, 3), were there no sides that lean inward."""
        after = np.minimum(self.slopes, 0.0)
        before = np.roll(after, 1, axis=1)
        u, v, n = np.roll(self.inward, 1, axis=1), self.inward, self.normals[:, None]
        return _corner_speed(before, after, u, v, np.broadcast_to(n, u.shape))


def _corner_speed(before: Floats, after: Floats, u: Floats, v: Floats, normal: Floats) -> Floats:
    """Return how corners move per unit of depth, (..., 3), between edges with inward vectors u and v and such slopes.

    Parallel edges have no corner that moves.
    """
    sine = np.einsum("...j,...j->...", normal, np.cross(u, v))[..., None]
    move = before[..., None] * np.cross(v, normal) + after[..., None] * np.cross(normal, u)
    return np.divide(move, sine, out=np.zeros_like(move), where=np.abs(sine) > PARALLEL)


def groups(vertices: Floats, faces: Ints, polygons: Sequence[Polygon], face_slopes: Floats, cap: float) -> list[Group]:
    """Set up the cells under polygons, with sides in the planes that their edges ask for.

    Args:
        vertices: (n, 3).
        faces: (m, 3).
        polygons: Convex polygons of whole faces.
        face_slopes: (m, 3) `Sides.slopes`.
        cap: Greatest height of a cell.
    """
    loops = corner_loops(vertices, polygons)
    slopes = _loop_slopes(faces, polygons, loops, face_slopes)
    out: list[Group] = []
    for members in by_length(loops):
        corners = vertices[np.array([loops[i] for i in members])]
        normals = np.array([polygons[i].normal for i in members])
        out.append(group_of(np.array(members), corners, normals, np.array([slopes[i] for i in members]), cap))
    return out


def group_of(members: Ints, corners: Floats, normals: Floats, slopes: Floats, height: float) -> Group:
    """Set up a group from its polygons' corners (g, k, 3) in the mesh's frame, normals (g, 3) and slopes (g, k)."""
    centers = corners.mean(axis=1)
    local = flattened(corners - centers[:, None], normals)
    along = np.roll(local, -1, axis=1) - local
    inward = np.cross(normals[:, None], along / np.linalg.norm(along, axis=2, keepdims=True))
    inward /= np.linalg.norm(inward, axis=2, keepdims=True)
    return Group(
        members=members,
        centers=centers,
        corners=local,
        normals=normals,
        inward=inward,
        reach=-np.einsum("gkj,gkj->gk", inward, local),
        slopes=slopes,
        height=np.full(len(members), height),
        tilted=np.zeros(len(members), dtype=np.bool_),
    )


def _loop_slopes(
    faces: Ints, polygons: Sequence[Polygon], loops: Sequence[tuple[int, ...]], face_slopes: Floats
) -> list[list[float]]:
    """Return the slope at each edge of the loops; collinear edges share the greatest one."""
    triangles: list[list[int]] = faces.tolist()
    values: list[list[float]] = face_slopes.tolist()
    out: list[list[float]] = []
    for polygon, loop in zip(polygons, loops, strict=True):
        of_edge: dict[tuple[int, int], float] = {}
        for f in polygon.faces:
            a, b, c = triangles[f]
            of_edge[a, b], of_edge[b, c], of_edge[c, a] = values[f]
        whole, wanted = polygon.loop, set(loop)
        at = whole.index(loop[0])
        slopes: list[float] = []
        for a, b in zip(whole[at:] + whole[:at], whole[at + 1 :] + whole[: at + 1], strict=True):
            if a in wanted:
                slopes.append(of_edge[a, b])
            else:
                slopes[-1] = max(slopes[-1], of_edge[a, b])
        out.append(slopes)
    return out


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """Corners of g cells, about the cells' centres.

    Attributes:
        points: (g, c, 3); the first k are the polygon's own.
        used: (g, c) which of them count.
        depths: (g,) of the deepest one.
        volumes: (g,).
    """

    points: Floats
    used: Bools
    depths: Floats
    volumes: Floats


def cell_corners(group: Group, tolerance: float) -> Corners:
    """Find the corners of all cells.

    A cell of which rounding spoils a corner becomes a frustum between its polygon and a smaller copy of that.

    Args:
        group: The cells.
        tolerance: Length by which a corner may lie outside of its cell's planes.
    """
    shrinking = _Shrinking(group)
    while shrinking.step():
        pass
    points, used = shrinking.points()
    planes = group.planes(np.arange(len(group)), 0.0)
    with np.errstate(invalid="ignore"):
        heights = np.einsum("gcj,gpj->gcp", points, planes[:, :, :3]) + planes[:, None, :, 3]
    spoiled = (~(heights >= -tolerance).all(axis=2) & used).any(axis=1)
    depths = np.where(used, -np.einsum("gcj,gj->gc", np.nan_to_num(points), group.normals), 0.0).max(axis=1)
    volumes = shrinking.volumes
    if spoiled.any():
        _replace_by_frustums(group, np.asarray(spoiled), points, used, depths, volumes)
    return Corners(points, used, depths, volumes)


class _Shrinking:
    """The polygons at the depth of their next events; each corner moves along a line, `at + depth * speed`."""

    def __init__(self, group: Group) -> None:
        g, k = group.slopes.shape
        self._group = group
        self._rows = np.arange(g)
        self._along = np.cross(group.inward, group.normals[:, None])
        self._before = np.tile(np.roll(np.arange(k), 1), (g, 1))
        self._after = np.tile(np.roll(np.arange(k), -1), (g, 1))
        self._left = np.ones((g, k), dtype=np.bool_)
        self._at = group.corners.copy()
        speeds = [self._meeting(self._rows, self._before[:, i], np.full(g, i)) for i in range(k)]
        self._speed = np.stack(speeds, axis=1)
        self._depth = np.zeros(g)
        self._busy = group.height > 0
        self._ended = np.zeros(g, dtype=np.bool_)
        self._events: list[Floats] = []
        self._happened: list[Bools] = []
        self.volumes = np.zeros(g)

    def step(self) -> bool:
        """Move every polygon on to its next event: an edge that vanishes, or the bottom of the cell."""
        rows = self._rows[self._busy]
        if len(rows) == 0:
            return False
        after = self._after[rows]
        side = self._along[rows]
        length = np.einsum("gkj,gkj->gk", _take(self._at[rows], after) - self._at[rows], side)
        rate = np.einsum("gkj,gkj->gk", _take(self._speed[rows], after) - self._speed[rows], side)
        shrinks = self._left[rows] & (rate < 0)
        end = np.divide(length, -rate, out=np.full(rate.shape, np.inf), where=shrinks)
        end = np.maximum(end, self._depth[rows, None])
        edge = end.argmin(axis=1)
        depth = end[np.arange(len(rows)), edge]
        height = self._group.height[rows]
        self._sweep(rows, np.minimum(depth, height))
        vanishes = depth < height
        self._busy[rows[~vanishes]] = False
        self._vanish(rows[vanishes], edge[vanishes], depth[vanishes])
        return True

    def points(self) -> tuple[Floats, Bools]:
        """Return all corners (g, c, 3) and which of them count (g, c)."""
        group, g = self._group, len(self._rows)
        bottom = self._at + group.height[:, None, None] * (self._speed - group.normals[:, None])
        stays = self._left & ~self._ended[:, None]
        parts = [group.corners, *(e[:, None] for e in self._events), bottom]
        used = [np.ones(stays.shape, dtype=np.bool_), *(h[:, None] for h in self._happened), stays]
        return np.concatenate(parts, axis=1), np.concatenate(used, axis=1).reshape(g, -1)

    def _vanish(self, rows: Ints, edge: Ints, depth: Floats) -> None:
        event, happened = np.zeros((len(self._rows), 3)), np.zeros(len(self._rows), dtype=np.bool_)
        flat = self._at[rows, edge] + self._speed[rows, edge] * depth[:, None]
        event[rows] = flat - self._group.normals[rows] * depth[:, None]
        happened[rows] = True
        self._events.append(event)
        self._happened.append(happened)
        before, after = self._before[rows, edge], self._after[rows, edge]
        self._left[rows, edge] = False
        self._after[rows, before], self._before[rows, after] = after, before
        self._speed[rows, after] = self._meeting(rows, before, after)
        self._at[rows, after] = flat - self._speed[rows, after] * depth[:, None]
        over = self._left[rows].sum(axis=1) < 3
        self._busy[rows[over]] = False
        self._ended[rows[over]] = True

    def _meeting(self, rows: Ints, first: Ints, second: Ints) -> Floats:
        """Return how the corner between two edges moves per unit of depth, (r, 3)."""
        slopes, inward, normals = self._group.slopes, self._group.inward, self._group.normals[rows]
        return _corner_speed(
            slopes[rows, first], slopes[rows, second], inward[rows, first], inward[rows, second], normals
        )

    def _sweep(self, rows: Ints, depth: Floats) -> None:
        """Add the volume between the last depth and this one; areas are quadratic in depth, so Simpson is exact."""
        start = self._depth[rows]
        areas = [self._area(rows, start + f * (depth - start)) for f in (0.0, 0.5, 1.0)]
        self.volumes[rows] += (depth - start) * (areas[0] + 4 * areas[1] + areas[2]) / 6
        self._depth[rows] = depth

    def _area(self, rows: Ints, depth: Floats) -> Floats:
        here = self._at[rows] + self._speed[rows] * depth[:, None, None]
        turned = np.where(self._left[rows][:, :, None], np.cross(here, _take(here, self._after[rows])), 0.0)
        return np.einsum("gkj,gj->g", turned, self._group.normals[rows]) / 2


def _take(points: Floats, index: Ints) -> Floats:
    return np.take_along_axis(points, index[:, :, None], axis=1)


def _replace_by_frustums(
    group: Group, spoiled: Bools, points: Floats, used: Bools, depths: Floats, volumes: Floats
) -> None:
    k = group.corners.shape[1]
    rows = np.flatnonzero(spoiled)
    limit = group.limits(rows).min(axis=1)
    depth = np.minimum(group.height[rows], limit / 2)
    scale = 1 - np.divide(depth, limit, out=np.ones_like(limit), where=limit > 0)
    top = group.corners[rows]
    points[rows], used[rows] = 0.0, False
    points[rows, :k] = top
    points[rows, k : 2 * k] = top * scale[:, None, None] - (group.normals[rows] * depth[:, None])[:, None]
    used[rows, : 2 * k] = True
    depths[rows] = depth
    area = np.einsum("gkj,gj->g", np.cross(top, np.roll(top, -1, axis=1)), group.normals[rows]) / 2
    volumes[rows] = area * depth * (1 + scale + scale**2) / 3
