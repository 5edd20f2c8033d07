"""The cell under each polygon: the half-spaces that bound it.

Cells are kept in groups of polygons with equally many corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..coplanar import Polygon
from ..pieces import by_length, corner_loops, flattened
from ..topology import Bools, Floats, Ints

SHALLOWEST, DEEPEST = 0.02, 0.2
"""A cell may be as deep as its polygon is wide, within these bounds in units of the mesh's diagonal: so deep that most
bodies inside of the solid touch one, and no deeper, because what overlaps costs time."""

PARALLEL = 1e-9
"""Sine of the angle between two edges below which they are taken for parallel."""

_SIDE_MARGIN = 0.01
"""Margin of the sides in units of that of top and bottom. Polygons may be bent by the whole margin, sides follow their
edges exactly; and what is overlooked where two sides meet at a sharp corner is many margins wide."""

_BLOCK = 2_000_000  # distances from corners to edges that are computed at once


@dataclass(slots=True, eq=False)
class Group:
    """Cells under g polygons of k corners each; `slopes`, `height` and `tilted` are still to be fitted.

    The cell of a polygon with outward normal n holds the points at depth 0 <= z <= height below its plane, for which
    the distance inside of edge i's line is at least slopes[i] * z; and where sides bend, also at least
    slopes[i] * bend + walls[i] * (z - bend).

    Attributes:
        members: (g,) number of each polygon.
        centers: (g, 3) mean of the corners, in the mesh's frame.
        corners: (g, k, 3) relative to the centre.
        normals: (g, 3).
        inward: (g, k, 3) unit vectors in the polygon's plane, square to the edge that begins at each corner.
        reach: (g, k) distance of the centre from each edge's line.
        slopes: (g, k) how far each side recedes per unit of depth; negative where it leans outward.
        lips: (g, k) the same of the side's lip, which reaches further; infinite where the edge asks for none.
        width: (g,) least width of each polygon.
        shallow: Height to which sides make way for what else there is of the surface.
        height: (g,).
        tilted: (g,) whether a side leans more than its edge asks for.
        bend: (g,) depth at which the sides bend; None if they are plane.
        walls: (g, k) how far each side recedes below the bend; no less than above.
    """

    members: Ints
    centers: Floats
    corners: Floats
    normals: Floats
    inward: Floats
    reach: Floats
    slopes: Floats
    lips: Floats
    width: Floats
    shallow: float
    height: Floats
    tilted: Bools
    bend: Floats | None = None
    walls: Floats | None = None

    def __len__(self) -> int:
        return len(self.members)

    def some(self, rows: Bools | Ints) -> Group:
        """Return some of the cells, as a copy."""
        fields = ("members", "centers", "corners", "normals", "inward", "reach", "slopes", "lips", "width", "height")
        arrays = {name: getattr(self, name)[rows] for name in (*fields, "tilted")}
        bend, walls = (None if x is None else x[rows] for x in (self.bend, self.walls))
        return Group(**arrays, shallow=self.shallow, bend=bend, walls=walls)

    def depth(self) -> Floats:
        """Return how deep each cell is below its centre, (g,)."""
        return np.minimum(self.height, self.limits(np.arange(len(self))).min(axis=1))

    def limits(self, rows: Ints) -> Floats:
        """Return how deep each side of some cells lets them be below their centres, (len(rows), k)."""
        reach, slopes = self.reach[rows], self.slopes[rows]
        return np.divide(reach, slopes, out=np.full(slopes.shape, np.inf), where=slopes > 0)

    def planes(self, rows: Ints, margin: float) -> Floats:
        """Return the planes (len(rows), p, 4) of some cells about their centres, moved inward by a margin.

        The last two are the polygon's own and the bottom; x . plane[:3] + plane[3] >= 0 inside.
        """
        normal, slopes, reach = self.normals[rows], self.slopes[rows], self.reach[rows]
        # The edges' lines lie in the plane through the centre, so the slope does not enter their offsets.
        sides = [(slopes, reach)]
        if self.bend is not None and self.walls is not None:
            walls = self.walls[rows]
            sides.append((walls, reach + (walls - slopes) * self.bend[rows, None]))
        planes: list[Floats] = []
        for slope, offset in sides:
            side = np.concatenate([self.inward[rows] + slope[:, :, None] * normal[:, None], offset[:, :, None]], axis=2)
            side /= np.sqrt(1 + slope**2)[:, :, None]
            side[:, :, 3] -= _SIDE_MARGIN * margin
            planes.append(side)
        top = np.column_stack([-normal, np.full(len(rows), -margin)])
        bottom = np.column_stack([normal, self.height[rows] - margin])
        return np.concatenate([*planes, top[:, None], bottom[:, None]], axis=1)

    def boxes(self) -> tuple[Floats, Floats]:
        """Return the corners of boxes around the cells, (g, 3) each."""
        levels = [self.corners]
        down = -self.normals[:, None]
        last = self.height
        if self.bend is not None and self.walls is not None:
            levels.append(levels[-1] + self.bend[:, None, None] * (self._outward(self.slopes) + down))
            levels.append(levels[-1] + (last - self.bend)[:, None, None] * (self._outward(self.walls) + down))
        else:
            levels.append(levels[-1] + last[:, None, None] * (self._outward(self.slopes) + down))
        points = np.concatenate(levels, axis=1)
        return self.centers + points.min(axis=1), self.centers + points.max(axis=1)

    def _outward(self, slopes: Floats) -> Floats:
        """Return how far the corners move per unit of depth, (g, k, 3), were there no sides that lean inward."""
        return corner_speeds(np.minimum(slopes, 0.0), self.inward, self.normals)


def corner_speed(before: Floats, after: Floats, u: Floats, v: Floats, normal: Floats) -> Floats:
    """Return how corners move per unit of depth, (..., 3), between edges with inward vectors u and v and such slopes.

    Parallel edges have no corner that moves.
    """
    sine = np.einsum("...j,...j->...", normal, np.cross(u, v))[..., None]
    move = before[..., None] * np.cross(v, normal) + after[..., None] * np.cross(normal, u)
    return np.divide(move, sine, out=np.zeros_like(move), where=np.abs(sine) > PARALLEL)


def corner_speeds(slopes: Floats, inward: Floats, normals: Floats) -> Floats:
    """Return how the corners of polygons move per unit of depth, (g, k, 3); slopes (g, k), inward (g, k, 3)."""
    u = np.roll(inward, 1, axis=1)
    return corner_speed(np.roll(slopes, 1, axis=1), slopes, u, inward, np.broadcast_to(normals[:, None], u.shape))


def groups(
    vertices: Floats, faces: Ints, polygons: Sequence[Polygon], face_slopes: Floats, face_lips: Floats, diagonal: float
) -> list[Group]:
    """Set up the cells under polygons, with sides in the planes that their edges ask for.

    Args:
        vertices: (n, 3).
        faces: (m, 3).
        polygons: Convex polygons of whole faces.
        face_slopes: (m, 3) `Sides.slopes`.
        face_lips: (m, 3) `Sides.lips`.
        diagonal: Of the mesh.
    """
    loops = corner_loops(vertices, polygons)
    slopes, lips = (_loop_slopes(faces, polygons, loops, s) for s in (face_slopes, face_lips))
    out: list[Group] = []
    for members in by_length(loops):
        corners = vertices[np.array([loops[i] for i in members])]
        normals = np.array([polygons[i].normal for i in members])
        lean, lip = (np.array([s[i] for i in members]) for s in (slopes, lips))
        out.append(group_of(np.array(members), corners, normals, lean, lip, diagonal))
    return out


def group_of(members: Ints, corners: Floats, normals: Floats, slopes: Floats, lips: Floats, diagonal: float) -> Group:
    """Set up a group of cells as deep as may be.

    Args:
        members: (g,) numbers of the polygons.
        corners: (g, k, 3) in the mesh's frame.
        normals: (g, 3).
        slopes: (g, k).
        lips: (g, k).
        diagonal: Of the mesh.
    """
    centers = corners.mean(axis=1)
    local = flattened(corners - centers[:, None], normals)
    along = np.roll(local, -1, axis=1) - local
    inward = np.cross(normals[:, None], along / np.linalg.norm(along, axis=2, keepdims=True))
    inward /= np.linalg.norm(inward, axis=2, keepdims=True)
    width = _widths(inward, local)
    return Group(
        members=members,
        centers=centers,
        corners=local,
        normals=normals,
        inward=inward,
        reach=-np.einsum("gkj,gkj->gk", inward, local),
        slopes=slopes,
        lips=lips,
        width=width,
        shallow=SHALLOWEST * diagonal,
        height=np.clip(width, SHALLOWEST * diagonal, DEEPEST * diagonal),
        tilted=np.zeros(len(members), dtype=np.bool_),
    )


def _widths(inward: Floats, corners: Floats) -> Floats:
    """Return the least widths of polygons, (g,): a convex one is narrowest square to one of its edges."""
    out = np.empty(len(corners))
    step = max(1, _BLOCK // corners.shape[1] ** 2)
    for i in range(0, len(out), step):
        across = np.einsum("gej,gvj->gev", inward[i : i + step], corners[i : i + step])
        out[i : i + step] = np.ptp(across, axis=2).min(axis=1)
    return out


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
