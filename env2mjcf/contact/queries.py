"""All queries of a scene, on rows of configurations: the part of `Scene` that knows how answers are found."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..geometry.assembly import Part
from ..pipeline import Compiled
from ..transforms import Array
from .boundary import BoundaryTest
from .clearance import Clearance
from .containment import Containment
from .engine import MujocoEngine
from .static_pairs import static_contacts
from .surfaces import Surfaces
from .types import Contact


class ContactQueries:
    """Answers for rows of configurations, each (n, dim) and already checked; safe to share between threads.

    Args:
        compiled: The scene.
        model: Its model.
    """

    def __init__(self, compiled: Compiled, model: mujoco.MjModel) -> None:
        assembly, document = compiled.assembly, compiled.document
        self.links = [p for r in assembly.robots for p in r.links]
        self._space = compiled.space
        self._assembly = assembly
        self._pairs = compiled.pairs.tested
        self._pair_of = {frozenset((p.link, p.other)): p for p in self._pairs}
        self._parts: dict[str, Part] = {p.name: p for p in assembly.parts()}
        self._engine = MujocoEngine(model, document.owners)
        self._bodies = np.array([model.body(p.name).id for p in self.links], dtype=np.int64)
        self._boundary = BoundaryTest(assembly.environment.boundary, self.links)
        self._containment = Containment(self._pairs, self._parts)
        self._collision = compiled.options.collision
        self._scratch = threading.local()
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        self._static = static_contacts(model, data, self._pairs, document.owners)

    def link_poses(self, rows: Array) -> Array:
        """Return the world poses of all links, (n, nlinks, 4, 4)."""
        return self._engine.body_poses(self._space.qpos(rows), self._bodies, self._thread_data())

    def collisions(self, rows: Array) -> NDArray[np.bool_]:
        """Return whether any tested pair touches, (n,)."""
        if self._static:
            return np.ones(len(rows), dtype=bool)
        hits = self._engine.collide(self._space.qpos(rows), self._thread_data())
        free = ~hits
        if self._containment.needed and free.any():
            hits[free] = self._containment.inside(self._poses_by_name(rows[free]))
        return hits

    def validities(self, rows: Array) -> NDArray[np.bool_]:
        """Return whether rows are within limits, inside the boundary and free, (n,)."""
        valid = self._space.within_limits(rows)
        if valid.any():
            valid[valid] = self._boundary.inside(self.link_poses(rows[valid]))
        if valid.any():
            valid[valid] = ~self.collisions(rows[valid])
        return valid

    def clearances(self, rows: Array) -> Array:
        """Return the least signed distance over the tested pairs, (n,); inf without pairs."""
        return self._clearance.signed(self._poses_by_name(rows), len(rows))

    @cached_property
    def _clearance(self) -> Clearance:
        surfaces = Surfaces(self._parts, self._collision)
        return Clearance(self._pairs, surfaces, self._assembly.extent)

    def contacts(self, row: Array) -> list[Contact]:
        """Return every contact of one configuration, (dim,)."""
        found: list[Contact] = []
        for a, b, position, normal, distance in self._engine.touching(self._space.qpos(row), self._thread_data()):
            pair = self._pair_of[frozenset((a, b))]
            if pair.constant:
                continue
            direction = normal if a == pair.link else -normal
            found.append(Contact(pair.link, pair.other, pair.kind, position, direction, distance))
        return found + list(self._static) + self._contained(row, found)

    def _thread_data(self) -> mujoco.MjData:
        data = getattr(self._scratch, "data", None)
        if data is None:
            data = self._scratch.data = self._engine.data()
        return data

    def _poses_by_name(self, rows: Array) -> dict[str, Array]:
        poses = self.link_poses(rows)
        by_name = {p.name: poses[:, i] for i, p in enumerate(self.links)}
        for part in self._assembly.obstacles:
            by_name[part.name] = np.broadcast_to(part.pose, (len(rows), 4, 4))
        return by_name

    def _contained(self, row: Array, touching: Sequence[Contact]) -> list[Contact]:
        """Return contacts of bodies that lie wholly inside others; their normals point along the bodies' centres."""
        if not self._containment.needed:
            return []
        poses = self._poses_by_name(row[None])
        seen = {(c.link, c.other) for c in touching}
        found: list[Contact] = []
        for index, point in self._containment.pairs_inside(poses):
            pair = self._pairs[index]
            if (pair.link, pair.other) in seen:
                continue
            apart = poses[pair.other][0, :3, 3] - poses[pair.link][0, :3, 3]
            length = float(np.linalg.norm(apart))
            normal = apart / length if length else np.array([0.0, 0.0, 1.0])
            depth = -min(self._parts[pair.link].mesh.diagonal, self._parts[pair.other].mesh.diagonal)
            found.append(Contact(pair.link, pair.other, pair.kind, point, normal, depth))
        return found
