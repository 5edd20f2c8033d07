"""The half-spaces that bound the cell under each polygon, kept in groups of polygons with equally many corners."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..pieces import by_length, corner_loops
from ..polygons import Polygon
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
    tilted: Bools = field(init=False)

    def __post_init__(self) -> None:
        self.tilted = np.zeros(len(self.members), dtype=np.bool_)

    def __len__(self) -> int:
        return len(self.members)

    def depth(self) -> Floats:
        """Return how deep each cell is below its centre, (g,)."""
        limits = np.divide(self.reach, self.slopes, out=np.full(self.slopes.shape, np.inf), where=self.slopes > 0)
        return np.minimum(self.height, limits.min(axis=1))

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
        sine = np.einsum("gkj,gkj->gk", np.broadcast_to(n, u.shape), np.cross(u, v))[:, :, None]
        move = before[:, :, None] * np.cross(v, n) + after[:, :, None] * np.cross(n, u)
        return np.divide(move, sine, out=np.zeros_like(move), where=np.abs(sine) > PARALLEL)


def groups(vertices: Floats, faces: Ints, polygons: Sequence[Polygon], face_slopes: Floats, cap: float) -> list[Group]:
    """Set up the cells under polygons, with sides in the planes that their edges ask for.

    Args:
        vertices: (n, 3).
        faces: (m, 3).
        polygons: Convex polygons of whole faces.
        face_slopes: (m, 3) from `side_slopes`.
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
    local = corners - centers[:, None]
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
