"""Truth about touching bodies: triangles against triangles by python-fcl, and containment by counting crossings.

A test that asks for it without python-fcl is skipped, and no other one.
"""

from __future__ import annotations

import numpy as np
import pytest

import env2mjcf

# A direction that no edge of a mesh made by hand is parallel to.
_RAY = np.array([0.5377, 0.7391, 0.4057])


class Truth:
    """Answers for the tested pairs of a scene, from the triangles of its meshes."""

    def __init__(self, scene: env2mjcf.Scene) -> None:
        self._fcl = fcl = pytest.importorskip("fcl", reason="no python-fcl to compare with")
        self._scene = scene
        self._parts = {p.name: p for p in scene.compiled.assembly.parts()}
        self._objects = {}
        self._triangles = {}
        for name in {n for pair in scene.pairs for n in pair}:
            mesh = self._parts[name].mesh
            model = fcl.BVHModel()
            model.beginModel(len(mesh.vertices), len(mesh.faces))
            model.addSubModel(mesh.vertices, mesh.faces)
            model.endModel()
            self._objects[name] = fcl.CollisionObject(model, fcl.Transform())
            self._triangles[name] = mesh.vertices[mesh.faces]

    def poses(self, q: np.ndarray) -> dict[str, np.ndarray]:
        links = dict(zip(self._scene.link_names, self._scene.link_poses(q), strict=True))
        return links | dict(zip(self._scene.obstacle_names, self._scene.obstacle_poses(), strict=True))

    def collides(self, q: np.ndarray, shift: np.ndarray | None = None) -> bool:
        """Whether any pair touches or nests; with a shift, all links but no obstacles are moved by it."""
        poses = self.poses(q)
        for name in self._scene.link_names if shift is not None else ():
            poses[name] = poses[name].copy()
            poses[name][:3, 3] += shift
        self._place(poses)
        fcl, pairs = self._fcl, [(self._objects[a], self._objects[b]) for a, b in self._scene.pairs]
        request = fcl.CollisionRequest()
        if any(fcl.collide(a, b, request, fcl.CollisionResult()) for a, b in pairs):
            return True
        return any(self._holds(a, b, poses) or self._holds(b, a, poses) for a, b in self._scene.pairs)

    def clearance(self, q: np.ndarray) -> float:
        """Least distance between the triangles of any pair."""
        self._place(self.poses(q))
        fcl, pairs = self._fcl, [(self._objects[a], self._objects[b]) for a, b in self._scene.pairs]
        request = fcl.DistanceRequest()
        return min(fcl.distance(a, b, request, fcl.DistanceResult()) for a, b in pairs)

    def depth_is_below(self, q: np.ndarray, depth: float) -> bool:
        """Whether some short translation of the links frees them (tries 26 directions)."""
        steps = np.array(np.meshgrid(*[[-1.0, 0, 1]] * 3)).reshape(3, -1).T
        steps = steps[np.any(steps != 0, axis=1)]
        return any(not self.collides(q, depth * s / np.linalg.norm(s)) for s in steps)

    def wrong(self, q: np.ndarray, verdict: bool, band: float) -> bool:
        """Whether a verdict is wrong by more than the band."""
        if verdict == self.collides(q):
            return False
        return self.clearance(q) > band if verdict else not self.depth_is_below(q, band)

    def _place(self, poses: dict[str, np.ndarray]) -> None:
        for name, thing in self._objects.items():
            thing.setTransform(self._fcl.Transform(poses[name][:3, :3], poses[name][:3, 3]))

    def _holds(self, outer: str, inner: str, poses: dict[str, np.ndarray]) -> bool:
        analysis = self._parts[outer].analysis
        a, b = poses[outer], poses[inner]
        corner = b[:3, :3] @ self._triangles[inner][0, 0] + b[:3, 3]
        return inside(a[:3, :3].T @ (corner - a[:3, 3]), analysis.vertices[analysis.enclosing])


def inside(point: np.ndarray, triangles: np.ndarray) -> bool:
    """Whether a ray leaves a closed surface an odd number of times (Moeller and Trumbore's test)."""
    a, e, f = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(_RAY, f)
    det = np.einsum("ij,ij->i", e, p)
    det[det == 0] = np.inf
    s = point - a
    u = np.einsum("ij,ij->i", s, p) / det
    q = np.cross(s, e)
    v, t = q @ _RAY / det, np.einsum("ij,ij->i", f, q) / det
    return bool(((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)).sum() % 2)


def near_obstacles(scene: env2mjcf.Scene, count: int, seed: int) -> np.ndarray:
    """Sample configurations whose bases lie within a box a little larger than that around the obstacles."""
    q = scene.space.sample(count, seed)
    parts = scene.compiled.assembly.obstacles
    corners = np.vstack([p.mesh.vertices @ p.pose[:3, :3].T + p.pose[:3, 3] for p in parts])
    corners = np.vstack([corners, (1.2 * corners.max(axis=0) - 0.2 * corners.min(axis=0))])
    rng = np.random.default_rng(seed)
    for column, name in enumerate(scene.space.names):
        if (axis := "xyz".find(name.rpartition(".")[2])) >= 0:
            q[:, column] = rng.uniform(corners[:, axis].min(), corners[:, axis].max(), count)
    return q


def bisected(scene: env2mjcf.Scene, truth: Truth, count: int, halvings: int, seed: int) -> np.ndarray:
    """Configurations on both sides of the border between free and colliding, by truth's verdicts."""
    q = near_obstacles(scene, 8 * count + 80, seed)
    hits = np.array([truth.collides(row) for row in q])
    free, colliding = q[~hits], q[hits]
    assert len(free), "no free configuration among the samples"
    assert len(colliding), "no colliding configuration among the samples"
    rng = np.random.default_rng(seed)
    rows = []
    for _ in range(count):
        a, b = free[rng.integers(len(free))], colliding[rng.integers(len(colliding))]
        for _ in range(int(rng.integers(6, halvings))):
            middle = (a + b) / 2
            a, b = (a, middle) if truth.collides(middle) else (middle, b)
        rows += [a, b]
    return np.array(rows)
