"""What a Python user would do with python-fcl and coal: poses known, obstacles placed once, done at the first contact.

Every way of a peer is a function that answers a slice of the rows that the peer was made for.
"""

from __future__ import annotations

import functools

import coal
import fcl
import numpy as np
from truth import Truth

import env2mjcf

# All of coal's broadphase managers but SpatialHashing, which has to be told the bounds of the scene.
MANAGERS = (
    "DynamicAABBTreeCollisionManager",
    "DynamicAABBTreeArrayCollisionManager",
    "IntervalTreeCollisionManager",
    "NaiveCollisionManager",
    "SSaPCollisionManager",
    "SaPCollisionManager",
)


class Pairs:
    """The tested pairs of a scene by number, links first; `own` are those among links."""

    def __init__(self, scene: env2mjcf.Scene) -> None:
        self.links = len(scene.link_names)
        self.names = (*scene.link_names, *scene.obstacle_names)
        index = {n: i for i, n in enumerate(self.names)}
        self.all = [(index[a], index[b]) for a, b in scene.pairs]
        self.own = [(a, b) for a, b in self.all if max(a, b) < self.links]
        # A manager of the obstacles is asked about whole links.
        tested = {frozenset(p) for p in self.all}
        self.movers = [i for i in range(self.links) if frozenset((i, self.links)) in tested]
        obstacles = len(self.names) - self.links
        whole = len(self.all) - len(self.own) == len(self.movers) * obstacles
        assert whole, "a link is tested with some of the obstacles and not with others"


class Fcl:
    """python-fcl.

    Args:
        truth: The scene's triangles.
        rows: (n, dim) configurations.
    """

    def __init__(self, truth: Truth, rows: np.ndarray) -> None:
        pairs = Pairs(truth.scene)
        self.transforms = [[fcl.Transform(p[:3, :3], p[:3, 3]) for p in row] for row in truth.scene.link_poses(rows)]
        truth.place(rows[0])
        self.links, others = truth.objects[: pairs.links], truth.objects[pairs.links :]
        self.movers = [truth.objects[i] for i in pairs.movers]
        self.pairs = [(truth.objects[a], truth.objects[b]) for a, b in pairs.all]
        # A manager tests links with all obstacles; the rest is tested one by one.
        self.own = [(truth.objects[a], truth.objects[b]) for a, b in pairs.own]
        self.manager = None
        if others and self.movers:
            self.manager = fcl.DynamicAABBTreeCollisionManager()
            self.manager.registerObjects(others)
            self.manager.setup()

    def pair_by_pair(self, part: slice) -> np.ndarray:
        """Ask about one pair after the other."""
        transforms = self.transforms[part]
        hits = np.zeros(len(transforms), dtype=bool)
        request = fcl.CollisionRequest()
        collide, result = fcl.collide, fcl.CollisionResult
        for i, row in enumerate(transforms):
            for link, transform in zip(self.links, row, strict=True):
                link.setTransform(transform)
            for a, b in self.pairs:
                if collide(a, b, request, result()):
                    hits[i] = True
                    break
        return hits

    def managed(self, part: slice) -> np.ndarray:
        """Ask a broadphase manager about the obstacles."""
        transforms = self.transforms[part]
        hits = np.zeros(len(transforms), dtype=bool)
        request, callback = fcl.CollisionRequest(), fcl.defaultCollisionCallback
        for i, row in enumerate(transforms):
            for link, transform in zip(self.links, row, strict=True):
                link.setTransform(transform)
            for link in self.movers:
                data = fcl.CollisionData(request=request)
                self.manager.collide(link, data, callback)
                if data.result.is_collision:
                    hits[i] = True
                    break
            else:
                hits[i] = any(fcl.collide(a, b, request, fcl.CollisionResult()) for a, b in self.own)
        return hits

    def ways(self) -> dict:
        """Return the ways to ask, by name."""
        found = {"fcl pairs": self.pair_by_pair}
        if self.manager:
            found["fcl manager"] = self.managed
        return found


class Coal:
    """coal, on trees of triangles (BVHModelOBBRSS); requests are for verdicts alone, without contacts.

    Args:
        scene: The scene.
        rows: (n, dim) configurations.
    """

    def __init__(self, scene: env2mjcf.Scene, rows: np.ndarray) -> None:
        self.pairs = Pairs(scene)
        parts = {p.name: p for p in scene.compiled.assembly.parts()}
        self.geometries = [bvh(parts[n].mesh) for n in self.pairs.names]
        self.transforms = [[coal.Transform3s(p[:3, :3], p[:3, 3]) for p in row] for row in scene.link_poses(rows)]
        self.fixed = [coal.Transform3s(p[:3, :3], p[:3, 3]) for p in scene.obstacle_poses()]
        self._managers: dict[str, coal.BroadPhaseCollisionManager] = {}
        links = self.pairs.links
        self.request, self.distance_request = coal.CollisionRequest(), coal.DistanceRequest()
        self.request.enable_contact = False
        self.distance_request.enable_signed_distance = False
        self.links = [coal.CollisionObject(g, coal.Transform3s.Identity()) for g in self.geometries[:links]]
        self.obstacles = [coal.CollisionObject(g, t) for g, t in zip(self.geometries[links:], self.fixed, strict=True)]

    def pair_by_pair(self, part: slice) -> np.ndarray:
        """Ask about one pair after the other, each by an object that has looked its functions up beforehand."""
        transforms, result, request = self.transforms[part], coal.CollisionResult(), self.request
        pairs = [(coal.ComputeCollision(self.geometries[a], self.geometries[b]), a, b) for a, b in self.pairs.all]
        hits = np.zeros(len(transforms), dtype=bool)
        for i, row in enumerate(transforms):
            placed = row + self.fixed
            for collide, a, b in pairs:
                result.clear()
                if collide(placed[a], placed[b], request, result):
                    hits[i] = True
                    break
        return hits

    def managed(self, part: slice, kind: str) -> np.ndarray:
        """Ask a broadphase manager about the obstacles."""
        manager, transforms = self._manager(kind), self.transforms[part]
        callback, result = coal.CollisionCallBackDefault(), coal.CollisionResult()
        callback.data.request = self.request
        own = [(coal.ComputeCollision(self.geometries[a], self.geometries[b]), a, b) for a, b in self.pairs.own]
        hits = np.zeros(len(transforms), dtype=bool)
        for i, row in enumerate(transforms):
            for number in self.pairs.movers:
                link = self.links[number]
                link.setTransform(row[number])
                link.computeAABB()
                manager.collide(link, callback)
                if callback.data.result.isCollision():
                    hits[i] = True
                    break
            else:
                for collide, a, b in own:
                    result.clear()
                    if collide(row[a], row[b], self.request, result):
                        hits[i] = True
                        break
        return hits

    def ways(self) -> dict:
        """Return the ways to ask, by name."""
        found = {"coal pairs": self.pair_by_pair}
        if self.obstacles and self.pairs.movers:
            found |= {f"coal {kind}": functools.partial(self.managed, kind=kind) for kind in MANAGERS}
        return found

    def distances(self, part: slice) -> np.ndarray:
        """Return the least distance of any pair, (k,), asking about one pair after the other."""
        transforms, result, request = self.transforms[part], coal.DistanceResult(), self.distance_request
        pairs = [(coal.ComputeDistance(self.geometries[a], self.geometries[b]), a, b) for a, b in self.pairs.all]
        least = np.full(len(transforms), np.inf)
        for i, row in enumerate(transforms):
            placed = row + self.fixed
            for distance, a, b in pairs:
                result.clear()
                least[i] = min(least[i], distance(placed[a], placed[b], request, result))
        return least

    def managed_distances(self, part: slice, kind: str) -> np.ndarray:
        """Return the least distance of any pair, (k,), asking a broadphase manager about the obstacles."""
        manager, transforms = self._manager(kind), self.transforms[part]
        callback, result = coal.DistanceCallBackDefault(), coal.DistanceResult()
        callback.data.request = self.distance_request
        own = [(coal.ComputeDistance(self.geometries[a], self.geometries[b]), a, b) for a, b in self.pairs.own]
        least = np.full(len(transforms), np.inf)
        for i, row in enumerate(transforms):
            for number in self.pairs.movers:
                link = self.links[number]
                link.setTransform(row[number])
                link.computeAABB()
                # The manager begins anew with every link.
                manager.distance(link, callback)
                least[i] = min(least[i], callback.data.result.min_distance)
            for distance, a, b in own:
                result.clear()
                least[i] = min(least[i], distance(row[a], row[b], self.distance_request, result))
        return least

    def distance_ways(self) -> dict:
        """Return the ways to ask for distances, by name."""
        found = {"coal pairs": self.distances}
        if self.obstacles and self.pairs.movers:
            found |= {f"coal {kind}": functools.partial(self.managed_distances, kind=kind) for kind in MANAGERS}
        return found

    def _manager(self, kind: str) -> coal.BroadPhaseCollisionManager:
        if kind not in self._managers:
            manager = self._managers[kind] = getattr(coal, kind)()
            for thing in self.obstacles:
                manager.registerObject(thing)
            manager.setup()
        return self._managers[kind]


def bvh(mesh: object) -> coal.BVHModelOBBRSS:
    """Return a tree of a mesh's triangles."""
    model = coal.BVHModelOBBRSS()
    vertices, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for vertex in mesh.vertices:
        vertices.append(vertex)
    for face in mesh.faces:
        triangles.append(coal.Triangle(*(int(i) for i in face)))
    model.beginModel(len(triangles), len(vertices))
    model.addSubModel(vertices, triangles)
    model.endModel()
    model.computeLocalAABB()
    return model
