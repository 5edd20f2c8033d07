"""Convex hulls: how much more space than the mesh one takes.

trimesh needs scipy for hulls, which env2mjcf does not depend on. Pieces need no hull of their own, because MuJoCo
takes the hull of the points that it is given; so MuJoCo is also asked for the volume of what it will collide.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from .topology import Floats


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


def hull_triangles(points: Floats) -> Floats:
    """Return the triangles of the convex hull of points that are not coplanar, (m, 3, 3), as MuJoCo collides it.

    Corners are those of `points` in full precision, though MuJoCo's qhull saw them as float32.
    """
    mujoco: Any = import_module("mujoco")
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    size = float(np.ptp(points, axis=0).max())
    spec = mujoco.MjSpec()
    local = (points - middle) / size
    spec.add_mesh(name="hull", uservert=local.ravel())
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="hull")
    model = spec.compile()
    graph, turn = model.mesh_graph, np.zeros(9)
    corners, faces = int(graph[0]), int(graph[1])
    triangles = graph[2 + 3 * corners + 3 * faces :][: 3 * faces].reshape(-1, 3)
    mujoco.mju_quat2Mat(turn, model.mesh_quat[0])
    seen = model.mesh_vert.astype(np.float64) @ turn.reshape(3, 3).T + model.mesh_pos[0]
    source = np.array([int(np.argmin(np.linalg.norm(local - v, axis=1))) for v in seen])
    return points[source[triangles]]
