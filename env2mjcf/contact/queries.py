"""All queries of a scene, on rows of configurations: the part of `Scene` that knows how answers are found."""

from __future__ import annotations

import threading
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..geometry.assembly import Part
from ..options import Collision
from ..pipeline import Compiled
from ..transforms import Array
from .advancement import certified
from .boundary import BoundaryTest
from .clearance import Clearance
from .containment import Containment
from .engine import MujocoEngine
from .manifold import Manifolds, Touch
from .static_pairs import static_contacts
from .surfaces import Surfaces
from .types import Contact

# Bodies nearer than this, in extents, may touch by the verdicts (design: section 6).
_BAND = 1e-5


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
        self._pair_of = {frozenset((p.link, p.other)): i for i, p in enumerate(self._pairs)}
        self._parts: dict[str, Part] = {p.name: p for p in assembly.parts()}
        self._engine = MujocoEngine(model, document.owners)
        self._bodies = np.array([model.body(p.name).id for p in self.links], dtype=np.int64)
        self._boundary = BoundaryTest(assembly.environment.boundary, self.links)
        self._containment = Containment(self._pairs, self._parts)
        self._collision: Collision = compiled.options.collision
        self._scratch = threading.local()
        self._lock = threading.Lock()
        self._of_triangles: _Triangles | None = None
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
        return self._triangles.clearance.signed(self._poses_by_name(rows), len(rows))

    def certify(self, start: Array, delta: Array, motion: float) -> bool:
        """Return whether the way from `start` by `delta` is provably free.

        Args:
            start: (dim,).
            delta: (dim,).
            motion: Bound of how far any point of a robot moves on that way.
        """
        # Constant pairs are decided by themselves: a small distance of theirs must not shorten the steps.
        constant = self._triangles.constant.signed(self._poses_by_name(start[None]), 1)
        if self._static or constant[0] <= 0:
            return False
        # Two links come nearer by what both of them move.
        movers = 2 if any(p.kind != "obstacle" for p in self._pairs) else 1
        return certified(self._moving_clearances, start, delta, movers * motion, _BAND * self._assembly.extent)

    def _moving_clearances(self, rows: Array) -> Array:
        return self._triangles.moving.signed(self._poses_by_name(rows), len(rows))

    def contacts(self, row: Array) -> list[Contact]:
        """Return the contacts of one configuration, (dim,): a few for each pair that touches."""
        found: dict[int, list[Touch]] = {}
        for a, b, position, normal, distance in self._engine.touching(self._space.qpos(row), self._thread_data()):
            index = self._pair_of[frozenset((a, b))]
            pair = self._pairs[index]
            if not pair.constant:
                direction = normal if a == pair.link else -normal
                found.setdefault(index, []).append(Touch(position, direction, distance))
        for contact in self._static:
            index = self._pair_of[frozenset((contact.link, contact.other))]
            found.setdefault(index, []).append(Touch(contact.position, contact.normal, contact.distance))
        if not found and not self._containment.needed:
            return []
        poses = self._poses_by_name(row[None])
        contained = [index for index, _ in self._containment.pairs_inside(poses)] if self._containment.needed else []
        return self._triangles.manifolds.contacts(found, contained, poses)

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

    @property
    def _triangles(self) -> _Triangles:
        # Built when it is first asked for: verdicts do without it.
        with self._lock:
            if self._of_triangles is None:
                surfaces = Surfaces(self._parts, self._collision)
                clearance = Clearance(self._pairs, surfaces, self._assembly.extent)
                moving, constant = (
                    Clearance(tuple(p for p in self._pairs if p.constant is c), surfaces, self._assembly.extent)
                    for c in (False, True)
                )
                manifolds = Manifolds(self._pairs, self._parts, surfaces, clearance, self._assembly.extent)
                self._of_triangles = _Triangles(clearance, moving, constant, manifolds)
            return self._of_triangles


@dataclass(frozen=True, slots=True, eq=False)
class _Triangles:
    """What works on triangles instead of cells."""

    clearance: Clearance
    moving: Clearance
    constant: Clearance
    manifolds: Manifolds
