"""What is true of a configuration: triangles against triangles by python-fcl, and containment by a ray's crossings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import fcl
import numpy as np
from pieces import Pieces

import env2mjcf

# A direction that no edge of a mesh made by hand is parallel to.
RAY = np.array([0.5377, 0.7391, 0.4057])
# Translations that are tried to free a pair: a cube's faces, edges and corners, and random ones.
_GRID = np.array(np.meshgrid(*[[-1.0, 0, 1]] * 3)).reshape(3, -1).T
_GRID = np.vstack([_GRID[np.any(_GRID != 0, axis=1)], np.random.default_rng(0).normal(size=(74, 3))])
DIRECTIONS = _GRID / np.linalg.norm(_GRID, axis=1, keepdims=True)
DEPTHS = np.geomspace(1e-9, 1, 91)


class Truth:
    """Triangles against triangles by python-fcl, and containment by counting signed crossings of a ray.

    Which pieces of a mesh are closed is taken from its analysis, or from what is `known`, by the names of mesh files.
    """

    def __init__(self, scene: env2mjcf.Scene, known: Mapping[str, Pieces] | None = None) -> None:
        self.scene = scene
        self.pairs = scene.pairs
        parts = {p.name: p for p in scene.compiled.assembly.parts()}
        self.names = (*scene.link_names, *scene.obstacle_names)
        self._index = {n: i for i, n in enumerate(self.names)}
        self._pairs = np.array([[self._index[a], self._index[b]] for a, b in self.pairs], dtype=int).reshape(-1, 2)
        chosen = [parts[n] for n in self.names]
        self.objects = [fcl.CollisionObject(_model(p.mesh), fcl.Transform()) for p in chosen]
        corners = [np.array([p.mesh.vertices.min(axis=0), p.mesh.vertices.max(axis=0)]) for p in chosen]
        self._centre = np.array([c.mean(axis=0) for c in corners]).reshape(-1, 3)
        self._half = np.array([(c[1] - c[0]) / 2 for c in corners]).reshape(-1, 3)
        self._box = corners
        of = [(known or {}).get(p.body.filename) for p in chosen]
        self._faces = [
            k.enclosing(p.mesh.vertices, p.mesh.faces) if k else p.analysis.vertices[p.analysis.enclosing]
            for p, k in zip(chosen, of, strict=True)
        ]
        self._points = [
            k.points(p.mesh.vertices, p.mesh.faces) if k else _one_of_each_component(p.analysis)
            for p, k in zip(chosen, of, strict=True)
        ]
        self._request = fcl.CollisionRequest()

    def poses(self, q: np.ndarray) -> np.ndarray:
        """Return (n, bodies, 4, 4), links first."""
        fixed = self.scene.obstacle_poses()
        return np.concatenate([self.scene.link_poses(q), np.broadcast_to(fixed, (len(q), *fixed.shape))], axis=1)

    def verdicts(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return whether triangles of any pair touch, and whether they do or a body is inside another, (n,) each."""
        poses = self.poses(q)
        surface = self._surfaces(poses)
        solid = surface.copy()
        # A body inside another is in its box.
        near = self._near(poses) & ~surface[:, None]
        for p in np.flatnonzero(near.any(axis=0)):
            rows, (a, b) = np.flatnonzero(near[:, p]), self._pairs[p]
            for outer, inner in ((a, b), (b, a)):
                solid[rows] |= self._holds(outer, inner, poses[rows, outer], poses[rows, inner])
        return surface, solid

    def _surfaces(self, poses: np.ndarray) -> np.ndarray:
        hits = np.zeros(len(poses), dtype=bool)
        near = self._near(poses)
        moved: list[int | None] = [None] * len(self.names)
        for n, p in zip(*np.nonzero(near), strict=True):
            if hits[n]:
                continue
            for body in self._pairs[p]:
                if moved[body] != n:
                    moved[body] = n
                    self.objects[body].setTransform(fcl.Transform(poses[n, body, :3, :3], poses[n, body, :3, 3]))
            i, j = self._pairs[p]
            if fcl.collide(self.objects[i], self.objects[j], self._request, fcl.CollisionResult()):
                hits[n] = True
        return hits

    def _near(self, poses: np.ndarray) -> np.ndarray:
        """Return which pairs' boxes, along the axes of the world and a hair too large, overlap, (n, pairs)."""
        centre = np.einsum("nbij,bj->nbi", poses[..., :3, :3], self._centre) + poses[..., :3, 3]
        half = np.einsum("nbij,bj->nbi", np.abs(poses[..., :3, :3]), self._half) + 1e-9 * self.scene.extent
        a, b = self._pairs.T
        return np.all(np.abs(centre[:, a] - centre[:, b]) <= half[:, a] + half[:, b], axis=-1)

    def _holds(self, outer: int, inner: int, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Return whether one body, at poses a, holds another at poses b, (n,)."""
        found = np.zeros(len(a), dtype=bool)
        if not len(self._faces[outer]):
            return found
        world = np.einsum("nij,cj->nci", b[:, :3, :3], self._points[inner]) + b[:, None, :3, 3]
        local = np.einsum("nji,ncj->nci", a[:, :3, :3], world - a[:, None, :3, 3])
        low, high = self._box[outer]
        for n, c in zip(*np.nonzero(np.all((local > low) & (local < high), axis=-1)), strict=True):
            found[n] = found[n] or inside(local[n, c], self._faces[outer])
        return found

    def _nested(self, outer: int, inner: int, poses: np.ndarray) -> bool:
        return bool(self._holds(outer, inner, poses[None, outer], poses[None, inner])[0])

    def place(self, row: np.ndarray) -> np.ndarray:
        """Put all bodies where a configuration has them; return their poses."""
        poses = self.poses(row[None])[0]
        for thing, pose in zip(self.objects, poses, strict=True):
            thing.setTransform(fcl.Transform(pose[:3, :3], pose[:3, 3]))
        return poses

    def distance(self, row: np.ndarray) -> tuple[float, str]:
        """Return the least distance of any pair, and which one."""
        self.place(row)
        request = fcl.DistanceRequest()
        distances = [
            fcl.distance(self.objects[a], self.objects[b], request, fcl.DistanceResult()) for a, b in self._pairs
        ]
        nearest = int(np.argmin(distances))
        return distances[nearest], " - ".join(self.pairs[nearest])

    def depth(self, row: np.ndarray, mode: str) -> tuple[float, str]:
        """Return the shortest translation tried that frees the deepest pair, and which pair it is."""
        poses = self.place(row)
        worst = (0.0, "")
        for pair, (a, b) in zip(self.pairs, self._pairs, strict=True):
            if self._frees(a, b, poses, np.zeros((1, 3)), mode):
                continue
            low, high = -1, len(DEPTHS)
            while high - low > 1:
                middle = (low + high) // 2
                free = self._frees(a, b, poses, DEPTHS[middle] * self.scene.extent * DIRECTIONS, mode)
                low, high = (low, middle) if free else (middle, high)
            reached = DEPTHS[high] * self.scene.extent if high < len(DEPTHS) else np.inf
            worst = max(worst, (reached, " - ".join(pair)))
        return worst

    def _frees(self, a: int, b: int, poses: np.ndarray, shifts: Iterable[np.ndarray], mode: str) -> bool:
        for shift in shifts:
            moved = poses.copy()
            moved[a, :3, 3] += shift
            self.objects[a].setTransform(fcl.Transform(moved[a, :3, :3], moved[a, :3, 3]))
            hit = bool(fcl.collide(self.objects[a], self.objects[b], self._request, fcl.CollisionResult()))
            if not hit and mode != "surface":
                hit = self._nested(a, b, moved) or self._nested(b, a, moved)
            self.objects[a].setTransform(fcl.Transform(poses[a, :3, :3], poses[a, :3, 3]))
            if not hit:
                return True
        return False


def _model(mesh: object) -> fcl.BVHModel:
    model = fcl.BVHModel()
    model.beginModel(len(mesh.vertices), len(mesh.faces))
    model.addSubModel(mesh.vertices, mesh.faces)
    model.endModel()
    return model


def _one_of_each_component(analysis: object) -> np.ndarray:
    _, first = np.unique(analysis.component, return_index=True)
    return analysis.vertices[analysis.faces[first, 0]]


def inside(point: np.ndarray, triangles: np.ndarray) -> bool:
    """Whether a ray leaves a closed surface more often than it enters it, or less (Moeller and Trumbore's test)."""
    a, e, f = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(RAY, f)
    det = np.einsum("ij,ij->i", e, p)
    det[det == 0] = np.inf
    s = point - a
    u = np.einsum("ij,ij->i", s, p) / det
    q = np.cross(s, e)
    v, t = q @ RAY / det, np.einsum("ij,ij->i", f, q) / det
    return bool(np.sign(det[(u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)]).sum() != 0)
