"""Convex pieces, which are point sets that MuJoCo takes the hull of, and what those hulls are.

trimesh needs scipy for hulls, which env2mjcf does not depend on. Pieces need no hull of their own, because MuJoCo
takes the hull of the points that it is given; so MuJoCo is also asked for the volume of what it will collide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from .coplanar import Polygon
from .topology import RELATIVE_TOLERANCE, Bools, Floats, Ints, area_vectors

SLENDEREST = 5e-6
"""Least width of a piece in units of its length: MuJoCo keeps mesh vertices as float32 (6e-8), and its qhull refuses
points that are nearly coplanar."""

LEAST_WIDTH = 1e-7
"""Least width of a piece in metres: below 5e-15 square metres MuJoCo finds a mesh's surface too small."""

LEAST_AREA = 2e-14
"""Least area of a mesh in square metres that MuJoCo takes, with room for rounding."""

# How far a corner of a polygon may be off its plane, in units of the thickness, and of the diagonal at most. A cell
# is off by as much at its top, at its sides, which follow the neighbours, and where it grazes others: together less
# than half of the thickness.
_FLAT_PER_THICKNESS, _FLATTEST = 0.1, 1e-6

_BLOCK = 2_000_000  # distances from corners to edges that are computed at once


def flatness(diagonal: float, thickness: float) -> float:
    """Return by how much a corner of a polygon may be off its plane, for a mesh and the thickness of its prisms."""
    return min(_FLAT_PER_THICKNESS * thickness, _FLATTEST * diagonal)


def hull_volume(points: Floats) -> float:
    """Return the volume of the convex hull of points that are not coplanar, (n, 3).

    Computed by MuJoCo's qhull from float32 vertices: good to about 1e-6 of the cube of the diagonal.

    Raises:
        ValueError: The points are (nearly) coplanar.
    """
    # Imported here, because the rest of geometry/ works without MuJoCo, and as Any, because it has no type stubs.
    mujoco: Any = import_module("mujoco")
    if not np.ptp(points, axis=0).any():
        raise ValueError("the points coincide, so they have no hull")
    spec = mujoco.MjSpec()
    size = _add_hull(mujoco, spec, "hull", points)
    body = spec.worldbody.add_body()
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="hull", density=1.0)
    return float(spec.compile().body_mass[1]) * size**3


def _add_hull(mujoco: Any, spec: Any, name: str, points: Floats) -> float:
    """Add points to a specification as a mesh of size 1 about the origin, and return their size."""
    size = float(np.ptp(points, axis=0).max()) or 1.0
    local = (points - (points.min(axis=0) + points.max(axis=0)) / 2) / size
    spec.add_mesh(name=name, uservert=local.ravel(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX)
    return size


def hull_faces(clouds: Sequence[Floats]) -> list[Ints]:
    """Return the triangles of the convex hull of each point set, (m, 3) indices, counter-clockwise from outside.

    Computed by MuJoCo's qhull from float32 vertices: a corner that is lower than that over its neighbours may be left
    out.

    Raises:
        ValueError: Some points are (nearly) coplanar.
    """
    mujoco: Any = import_module("mujoco")
    spec = mujoco.MjSpec()
    for i, points in enumerate(clouds):
        _add_hull(mujoco, spec, str(i), points)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=str(i))
    model = spec.compile()
    out: list[Ints] = []
    for i, points in enumerate(clouds):
        start, count = model.mesh_faceadr[i], model.mesh_facenum[i]
        faces = model.mesh_face[start : start + count].astype(np.int64)
        corners = points[faces]
        inward = np.einsum("ij,ij->i", area_vectors(corners), corners[:, 0] - points[np.unique(faces)].mean(axis=0)) < 0
        faces[inward] = faces[inward, ::-1]
        out.append(faces)
    return out


def hull_triangles(points: Floats) -> Floats:
    """Return the triangles of the convex hull of points that are not coplanar, (m, 3, 3); see `hull_faces`."""
    return points[hull_faces([points])[0]]


@dataclass(frozen=True, slots=True, eq=False)
class ConvexPiece:
    """The convex hull of a few points.

    Attributes:
        vertices: (k, 3) float64, read-only, relative to `center`, so that rounding to float32 is relative to the
            size of the piece and not to its place.
        center: (3,) float64, read-only, in the mesh's frame.
        polygon: The polygon of the surface, over the analysis's vertices, for all or a part of which it stands; None
            for a hull.
    """

    vertices: Floats
    center: Floats
    polygon: Polygon | None = None


def hull_piece(points: Floats, thickness: float) -> ConvexPiece:
    """Make one piece of all points, (n, 3).

    A plate or a rod that is too thin for MuJoCo grows evenly to both sides, by `thickness` / 2 at most; a flat one
    becomes `thickness` thick.
    """
    center = (points.min(axis=0) + points.max(axis=0)) / 2
    local = points - center
    axes = np.linalg.svd(np.vstack([local - local.mean(axis=0), np.zeros((3, 3))]), full_matrices=False)[2]
    spread = np.ptp(local @ axes.T, axis=0)
    for axis, width in zip(axes, spread, strict=True):
        least = float(_least_width(spread.max(), thickness))
        if width < least:
            reach = (thickness if width < least / 1000 else least) - width
            local = np.concatenate([local + axis * (reach / 2), local - axis * (reach / 2)])
    return frozen_piece(local, center)


def prisms(vertices: Floats, polygons: Sequence[Polygon], thickness: float, inward: bool) -> tuple[ConvexPiece, ...]:
    """Make one thin prism of each polygon.

    Args:
        vertices: (n, 3) what the polygons' loops refer to.
        polygons: Convex polygons.
        thickness: Height of the prisms.
        inward: Extrude against the normal, so that the outer face is exactly the polygon; else half to each side.

    Returns:
        Prisms in the order of the polygons. One of a polygon too narrow for MuJoCo is widened, by less than
        `thickness`; one that is still too small is left out.
    """
    loops = corner_loops(vertices, polygons)
    out: list[ConvexPiece | None] = [None] * len(polygons)
    below, above = (-thickness, 0.0) if inward else (-thickness / 2, thickness / 2)
    for members in by_length(loops):
        corners = vertices[np.array([loops[i] for i in members])]  # (g, k, 3)
        normals = np.array([polygons[i].normal for i in members])
        centers = corners.mean(axis=1)
        local = flattened(corners - centers[:, None], normals)
        shift = normals[:, None] * np.array([below, above])[None, :, None]  # (g, 2, 3)
        points = (local[:, None] + shift[:, :, None]).reshape(len(members), -1, 3)
        points.setflags(write=False)
        centers.setflags(write=False)
        narrow, surfaces = too_narrow(local, normals, thickness), _surfaces(local, thickness)
        for row, i in enumerate(members):
            if narrow[row]:
                rectangle = _widened(local[row], normals[row], thickness)
                if _surfaces(rectangle[None], thickness)[0] >= LEAST_AREA:
                    whole = np.concatenate([rectangle + shift[row, 0], rectangle + shift[row, 1]])
                    out[i] = frozen_piece(whole, centers[row], polygons[i])
            elif surfaces[row] >= LEAST_AREA:
                out[i] = ConvexPiece(points[row], centers[row], polygons[i])
    return tuple(piece for piece in out if piece is not None)


def flattened(local: Floats, normals: Floats) -> Floats:
    """Return corners (g, k, 3) about their means, moved into planes through those with unit normals (g, 3)."""
    return local - np.einsum("gkj,gj->gk", local, normals)[:, :, None] * normals[:, None]


def corner_loops(vertices: Floats, polygons: Sequence[Polygon]) -> list[tuple[int, ...]]:
    """Return the loops without vertices at which they go straight on: the hull does not need those."""
    out = [polygon.loop for polygon in polygons]
    for members in by_length(out):
        if len(out[members[0]]) == 3:
            continue
        points = vertices[np.array([out[i] for i in members])]
        tolerance = RELATIVE_TOLERANCE * np.linalg.norm(np.ptp(points, axis=1), axis=1)
        bends = _height(np.roll(points, 1, axis=1), points, np.roll(points, -1, axis=1)) > tolerance[:, None]
        for row in np.flatnonzero(~bends.all(axis=1)):
            # Many small turns in a row are a curve: measure against the chord between the corners around them.
            corner = np.flatnonzero(bends[row])
            if len(corner) < 3:
                continue
            after = np.searchsorted(corner, np.arange(len(points[row])))
            chord = points[row, corner[after - 1]], points[row, corner[after % len(corner)]]
            stays = bends[row] | (_height(chord[0], points[row], chord[1]) > tolerance[row])
            out[members[row]] = tuple(np.array(out[members[row]])[stays].tolist())
    return out


def by_length(loops: Sequence[tuple[int, ...]]) -> list[list[int]]:
    """Group the positions of loops with equally many corners, in order of each group's first."""
    groups: dict[int, list[int]] = {}
    for i, loop in enumerate(loops):
        groups.setdefault(len(loop), []).append(i)
    return list(groups.values())


def _height(start: Floats, point: Floats, end: Floats) -> Floats:
    """Return the distance of points from the lines through `start` and `end`, (..., 3) each."""
    chord = end - start
    length = np.linalg.norm(chord, axis=-1)
    area = np.linalg.norm(np.cross(point - start, chord), axis=-1)
    return np.divide(area, length, out=np.zeros_like(area), where=length > 0)


def _least_width(length: Floats | float, thickness: float) -> Floats:
    return np.minimum(thickness, np.maximum(SLENDEREST * np.maximum(length, thickness), LEAST_WIDTH))


def _surfaces(local: Floats, thickness: float) -> Floats:
    """Return the areas, (g,), of prisms on polygons (g, k, 3)."""
    following = np.roll(local, -1, axis=1)
    base = np.linalg.norm(np.cross(local, following).sum(axis=1), axis=1) / 2
    return 2 * base + thickness * np.linalg.norm(following - local, axis=2).sum(axis=1)


def _widths(local: Floats, normals: Floats) -> Floats:
    """Return how far the farthest corner lies inside of each edge's line, (g, k)."""
    along = np.roll(local, -1, axis=1) - local
    inside = np.cross(normals[:, None], along / np.linalg.norm(along, axis=2, keepdims=True))
    out = np.empty(local.shape[:2])
    # Each corner with each edge: for a polygon of thousands too many to be held at once.
    step = max(1, _BLOCK // (local.shape[0] * local.shape[1]))
    for i in range(0, local.shape[1], step):
        part = inside[:, i : i + step]
        across = (
            np.einsum("gej,gvj->gev", part, local) - np.einsum("gej,gej->ge", part, local[:, i : i + step])[..., None]
        )
        out[:, i : i + step] = across.max(axis=2)
    return out


def too_narrow(local: Floats, normals: Floats, thickness: float) -> Bools:
    """Tell which polygons (g, k, 3) MuJoCo cannot hold as they are, (g,)."""
    # A convex polygon is narrowest square to one of its edges.
    out = np.empty(len(local), dtype=np.bool_)
    step = max(1, _BLOCK // local.shape[1] ** 2)
    for i in range(0, len(local), step):
        part = local[i : i + step]
        width = _widths(part, normals[i : i + step]).min(axis=1)
        out[i : i + step] = width < _least_width(np.ptp(part, axis=1).max(axis=1), thickness)
    return out


def _widened(local: Floats, normal: Floats, thickness: float) -> Floats:
    """Return the corners (4, 3) of a rectangle about a narrow polygon that is wide enough in both directions."""
    edge = int(np.argmin(_widths(local[None], normal[None])[0]))
    along = np.roll(local, -1, axis=0)[edge] - local[edge]
    along /= np.linalg.norm(along)
    axes = np.stack([along, np.cross(normal, along)])
    flat = local @ axes.T
    middle, half = (flat.min(axis=0) + flat.max(axis=0)) / 2, np.ptp(flat, axis=0) / 2
    half = np.maximum(half, _least_width(np.full(2, 2 * half.max()), thickness) / 2)
    signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return (middle + signs * half) @ axes


def frozen_piece(vertices: Floats, center: Floats, polygon: Polygon | None = None) -> ConvexPiece:
    """Make a piece of arrays of its own, which become read-only."""
    vertices.setflags(write=False)
    center.setflags(write=False)
    return ConvexPiece(vertices, center, polygon)
