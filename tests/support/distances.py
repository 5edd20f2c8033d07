"""Distances of triangle meshes by other programs: coal and python-fcl.

A test that asks for one that is not there is skipped, and no other one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest


def coal_model(vertices: np.ndarray, faces: np.ndarray) -> Any:
    coal = pytest.importorskip("coal", reason="no coal to compare with")
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(faces), len(vertices))
    points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for vertex in vertices:
        points.append(np.asarray(vertex, dtype=float))
    for face in faces:
        triangles.append(coal.Triangle(*map(int, face)))
    model.addSubModel(points, triangles)
    model.endModel()
    return model


def coal_distance(a: Any, pose_a: np.ndarray, b: Any, pose_b: np.ndarray) -> float:
    """Return the distance of surfaces; not above zero where they cross."""
    coal = pytest.importorskip("coal", reason="no coal to compare with")
    frames = [coal.Transform3s(p[:3, :3].copy(), p[:3, 3].copy()) for p in (pose_a, pose_b)]
    return coal.distance(a, frames[0], b, frames[1], coal.DistanceRequest(), coal.DistanceResult())


def fcl_distance(a: np.ndarray, b: np.ndarray) -> float:
    """Return the distance of two triangle soups (m, 3, 3) in one frame; not above zero where they cross."""
    fcl, objects = pytest.importorskip("fcl", reason="no python-fcl to compare with"), []
    for triangles in (a, b):
        model = fcl.BVHModel()
        model.beginModel(3 * len(triangles), len(triangles))
        model.addSubModel(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))
        model.endModel()
        objects.append(fcl.CollisionObject(model, fcl.Transform()))
    if fcl.collide(*objects, fcl.CollisionRequest(), fcl.CollisionResult()):
        return 0.0
    return fcl.distance(*objects, fcl.DistanceRequest(), fcl.DistanceResult())


def surface_distances(scene: object, rows: np.ndarray) -> np.ndarray:
    """Return coal's least distance of the surfaces of a scene's tested pairs, (n,); not above zero where they cross."""
    parts = {p.name: p for p in scene.compiled.assembly.parts()}
    models = {n: coal_model(p.mesh.vertices, p.mesh.faces) for n, p in parts.items()}
    out = np.full(len(rows), np.inf)
    for i, poses in enumerate(scene.link_poses(rows)):
        world = dict(zip(scene.obstacle_names, scene.obstacle_poses(), strict=True))
        world.update(zip(scene.link_names, poses, strict=True))
        found = [coal_distance(models[a], world[a], models[b], world[b]) for a, b in scene.pairs]
        out[i] = min(found, default=np.inf)
    return out
