"""Convex hulls: how much more space than the mesh one takes.

trimesh needs scipy for hulls, which env2mjcf does not depend on. Pieces need no hull of their own, because MuJoCo
takes the hull of the points that it is given; so MuJoCo is also asked for the volume of what it will collide.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np

from .topology import Floats, Ints


def hull_volume(points: Floats) -> float:
    """Return the volume of the convex hull of points that are not coplanar, (n, 3).

    Computed by MuJoCo's qhull from float32 vertices: good to about 1e-6 of the cube of the diagonal.

    Raises:
        ValueError: The points are (nearly) coplanar.
    """
    # Imported here, because the rest of geometry/ works without MuJoCo, and as Any, because it has no type stubs.
    mujoco: Any = import_module("mujoco")
    size = float(np.ptp(points, axis=0).max())
    if size == 0:
        raise ValueError("the points coincide, so they have no hull")
    spec = mujoco.MjSpec()
    local = (points - (points.min(axis=0) + points.max(axis=0)) / 2) / size
    spec.add_mesh(name="hull", uservert=local.ravel(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX)
    body = spec.worldbody.add_body()
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="hull", density=1.0)
    return float(spec.compile().body_mass[1]) * size**3


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
        size = float(np.ptp(points, axis=0).max()) or 1.0
        local = (points - (points.min(axis=0) + points.max(axis=0)) / 2) / size
        spec.add_mesh(name=str(i), uservert=local.ravel(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=str(i))
    model = spec.compile()
    out: list[Ints] = []
    for i, points in enumerate(clouds):
        start, count = model.mesh_faceadr[i], model.mesh_facenum[i]
        faces = model.mesh_face[start : start + count].astype(np.int64)
        corners = points[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        inward = np.einsum("ij,ij->i", normals, corners[:, 0] - points[np.unique(faces)].mean(axis=0)) < 0
        faces[inward] = faces[inward, ::-1]
        out.append(faces)
    return out


def hull_triangles(points: Floats) -> Floats:
    """Return the triangles of the convex hull of points that are not coplanar, (m, 3, 3); see `hull_faces`."""
    return points[hull_faces([points])[0]]
