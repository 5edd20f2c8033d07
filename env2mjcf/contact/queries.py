"""All queries of a scene, on rows of configurations: the part of `Scene` that knows how answers are found."""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..geometry.assembly import Part
from ..options import Collision, Engine
from ..pairs import Pair
from ..pipeline import Compiled
from ..system.locks import Lock, lazy_property
from ..transforms import Array, shifted, translated
from .clearance import BAND, Clearance
from .containment import BoundaryTest, Containment
from .edges import EdgeSteps, MotionBounds, certified, even_rows
from .exact.engine import ExactEngine, available, compile_all
from .manifold import Manifolds, Touch
from .mujoco_engine import MujocoEngine
from .surfaces import Surfaces
from .types import BrokenLimit, Contact, PackedContacts, Reason, Verdict, deepest, moved

# Configurations of edges that are made at once.
_BLOCK = 10_000


class ContactQueries:
    """Answers for rows of configurations, each (n, dim) and already checked; safe to share between threads.

    `static` are the contacts of the pairs that cannot move, where they are known.
    """

    def __init__(self, compiled: Compiled, model: mujoco.MjModel, static: tuple[Contact, ...] | None = None) -> None:
        assembly, document = compiled.assembly, compiled.document
        self.links = assembly.links
        self._compiled = compiled
        # Looking for numba takes longer than a verdict.
        self._compiles = available()
        self._space = compiled.space
        self._assembly = assembly
        self._pairs = compiled.pairs.tested
        self._pair_of = {frozenset((p.link, p.other)): i for i, p in enumerate(self._pairs)}
        self._parts: dict[str, Part] = {p.name: p for p in assembly.parts()}
        self._engine = MujocoEngine(model, document.owners, assembly.extent, own=static is not None)
        self._bodies = np.array([model.body(p.name).id for p in self.links], dtype=np.int64)
        self._boundary = BoundaryTest(assembly)
        self._obstacle_poses = {p.name: p.mesh_pose for p in assembly.obstacles}
        self._off_center = [(p.name, p.mesh.center) for p in self.links if any(p.mesh.center)]
        self._containment = Containment(self._pairs, self._parts)
        self._collision: Collision = compiled.options.collision
        self._scratch = threading.local()
        self._lock = Lock()
        self._of_triangles: _Triangles | None = None
        self._default: Engine = compiled.options.engine
        self._exact: ExactEngine | None = None
        self._ready: ExactEngine | None = None
        self._moving = tuple(p for p in self._pairs if not p.constant)
        between_links = [p for p in self._moving if p.kind != "obstacle"]
        self.steps = EdgeSteps(assembly, self._space)
        self._motion = MotionBounds(assembly, self._space, between_links)
        if static is None:
            static = self._engine.static_contacts(self._pairs)
        self._static = static

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel without what queries do not need, and with the choice of the engine: it must not change elsewhere."""
        engine: Engine = "exact" if self._is_exact(None) else "mujoco"
        options = dataclasses.replace(self._compiled.options, engine=engine)
        document = dataclasses.replace(self._compiled.document, xml="", assets={})
        compiled = dataclasses.replace(self._compiled, options=options, document=document, diagnostics=())
        return type(self), (compiled, self._engine.model, self._static)

    def row_bytes(self, engine: Engine | None = None, verdicts: bool = False) -> int:
        """Return what working on a row needs, at most: poses and vertices are much, but verdicts may do without."""
        columns = 4 * self._space.dim + 2
        if verdicts and self._is_exact(engine):
            return 8 * columns
        vertices = max((len(p.mesh.vertices) for p in self.links), default=0)
        return 8 * (columns + 32 * len(self.links) + len(self._moving) + 6 * vertices)

    def link_poses(self, rows: Array) -> Array:
        """Return the world poses of all links in the file's frame, (n, nlinks, 4, 4)."""
        return translated(self._link_poses(rows), self._assembly.origin)

    def _link_poses(self, rows: Array) -> Array:
        """Return the poses of all links about the scene's origin, (n, nlinks, 4, 4)."""
        return self._engine.body_poses(self._space.qpos_of_checked(rows), self._bodies, self._thread_data())

    def collisions(self, rows: Array, engine: Engine | None = None) -> NDArray[np.bool_]:
        """Return whether any tested pair touches, (n,)."""
        exact = self._chosen(engine)
        if self._always:
            return np.ones(len(rows), dtype=bool)
        return self._hits(rows) if exact is None else exact.collisions(rows)

    def validities(self, rows: Array, engine: Engine | None = None) -> NDArray[np.bool_]:
        """Return whether rows are within limits, inside the boundary and free, (n,)."""
        exact = self._chosen(engine)
        if self._always:
            return np.zeros(len(rows), dtype=bool)
        if exact is not None:
            return exact.validities(rows)
        valid = self._space.within_limits(rows)
        if valid.any():
            valid[valid] = self._boundary.inside(self._link_poses(rows[valid]))
        if valid.any():
            valid[valid] = ~self._hits(rows[valid])
        return valid

    def clearances(self, rows: Array) -> Array:
        """Return the least signed distance over the tested pairs, (n,); inf without pairs."""
        exact = self._chosen(None)
        if exact is None:
            return self._triangles.clearance.signed(self._poses_by_name(rows), len(rows))
        out = np.minimum(exact.distances(rows), self._constant_clearance)
        touching = out <= 0
        if touching.any():
            out[touching] = self._triangles.clearance.signed(self._poses_by_name(rows[touching]), int(touching.sum()))
        return out

    def edges_collide(
        self, start: Array, delta: Array, resolution: float, engine: Engine | None = None
    ) -> NDArray[np.bool_]:
        """Return whether anything touches at even steps of such a length of ways from (e, dim) by (e, dim), (e,)."""
        exact = self._chosen(engine)
        if self._always:
            return np.ones(len(start), dtype=bool)
        steps = self.steps.bounded_counts(start, delta, resolution)
        if exact is not None:
            return exact.edges_collide(start, delta, steps)
        ways = zip(start, delta, steps, strict=True)
        return np.array([self._hits(a + np.linspace(0, 1, n)[:, None] * d).any() for a, d, n in ways], dtype=bool)

    def first_invalid(
        self, start: Array, delta: Array, counts: NDArray[np.int64], engine: Engine | None = None
    ) -> NDArray[np.int64]:
        """Return which of `counts` even steps of ways from (e, dim) by (e, dim) is not valid first, (e,), or -1."""
        first = np.full(len(start), -1)
        stops = np.cumsum(counts)
        for begin in range(0, int(counts.sum()), _BLOCK):
            row = np.arange(begin, min(begin + _BLOCK, int(stops[-1])))
            edge = np.searchsorted(stops, row, side="right")
            row, edge = row[first[edge] < 0], edge[first[edge] < 0]
            at = row - (stops - counts)[edge]
            bad = np.flatnonzero(~self.validities(even_rows(start[edge], delta[edge], counts[edge], at), engine))
            edges, which = np.unique(edge[bad], return_index=True)
            first[edges] = at[bad[which]]
        return first

    def edges_are_free(self, start: Array, delta: Array) -> NDArray[np.bool_]:
        """Return whether the ways from (e, dim) by (e, dim) are provably free, (e,)."""
        # Constant pairs are decided by themselves: a small distance of theirs must not shorten the steps.
        if self._always or self._constant_clearance <= 0:
            return np.zeros(len(start), dtype=bool)
        links, pairs = self._motion.links(start, delta), self._motion.pairs(start, delta)
        band = BAND * self._assembly.extent
        exact = self._chosen(None)
        if exact is not None:
            return exact.edges_are_free(start, delta, links, *self._motion.split(start, delta), pairs, band)
        motion = np.concatenate([links, pairs], axis=1).max(axis=1, initial=0.0)
        ways = zip(start, delta, motion, strict=True)
        return np.array([certified(self._moving_clearances, a, d, m, band) for a, d, m in ways], dtype=bool)

    def warm_up(self) -> None:
        """Make ready, and compile, what verdicts need."""
        if self._chosen(None) is not None:
            compile_all()

    def _hits(self, rows: Array) -> NDArray[np.bool_]:
        """Return what MuJoCo's collision detection says, and containment, (n,)."""
        hits = self._engine.collide(self._space.qpos_of_checked(rows), self._thread_data())
        free = ~hits
        if self._containment.needed and free.any():
            hits[free] = self._containment.inside(self._poses_by_name(rows[free]))
        return hits

    def _moving_clearances(self, rows: Array) -> Array:
        return self._triangles.moving.signed(self._poses_by_name(rows), len(rows))

    @lazy_property
    def _always(self) -> bool:
        """Whether bodies that cannot move against each other touch, or are inside each other: always, then."""
        if self._static or not self._containment.needed:
            return bool(self._static)
        inside = self._containment.pairs_inside(self._poses_by_name(self._space.home[None]))
        return any(self._pairs[i].constant for i, _ in inside)

    @lazy_property
    def _constant_clearance(self) -> float:
        """Distance of the pairs that cannot move against each other."""
        return float(self._triangles.constant.signed(self._poses_by_name(self._space.home[None]), 1)[0])

    def _chosen(self, engine: Engine | None) -> ExactEngine | None:
        """Return the exact engine if it is chosen: `auto` takes it where it can be compiled.

        Raises:
            ValueError: It is chosen by name, and numba is not installed.
        """
        # What a scene has chosen for itself, and made, is handed out at once: a verdict may take less than finding it.
        if engine is None and self._ready is not None:
            return self._ready
        if not self._is_exact(engine):
            return None
        if self._exact is None:
            with self._lock:
                if self._exact is None:
                    self._exact = ExactEngine(self._assembly, self._space, self._moving, self._surfaces)
        if engine is None:
            self._ready = self._exact
        return self._exact

    def _is_exact(self, engine: Engine | None) -> bool:
        engine = engine or self._default
        return engine == "exact" or (engine == "auto" and self._compiles)

    def touching_pairs(self, row: Array) -> list[Pair]:
        """Return the pairs that touch at one configuration, (dim,), as MuJoCo's engine says, in the order of pairs.

        Contacts of surfaces take a hundred times as long.
        """
        named = self._engine.touching_names(self._space.qpos_of_checked(row), self._thread_data())
        found = {index for names in named if not self._pairs[index := self._pair_of[names]].constant}
        found |= {self._pair_of[frozenset((c.link, c.other))] for c in self._static}
        if self._containment.needed:
            found |= {index for index, _ in self._containment.pairs_inside(self._poses_by_name(row[None]))}
        return [self._pairs[index] for index in sorted(found)]

    def contacts(self, row: Array, engine: Engine | None = None) -> list[Contact]:
        """Return the contacts of one configuration, (dim,): a few for each pair that touches."""
        exact = self._chosen(engine)
        if exact is not None and not self.collisions(row[None], engine)[0]:
            return []
        found: dict[int, list[Touch]] = {}
        qpos = self._space.qpos_of_checked(row)
        for a, b, position, normal, distance in self._engine.touching(qpos, self._thread_data()):
            index = self._pair_of[frozenset((a, b))]
            pair = self._pairs[index]
            if not pair.constant:
                direction = normal if a == pair.link else -normal
                found.setdefault(index, []).append(Touch(position, direction, distance))
        for contact in self._static:
            index = self._pair_of[frozenset((contact.link, contact.other))]
            found.setdefault(index, []).append(Touch(contact.position, contact.normal, contact.distance))
        if not found and exact is None and not self._containment.needed:
            return []
        poses = self._poses_by_name(row[None])
        others = [index for index, _ in self._containment.pairs_inside(poses)] if self._containment.needed else []
        if not found and not others and exact is not None:
            # Within the band of contact, cells may part what triangles say touches.
            others = self._triangles.clearance.nearest_pairs(poses)
        return moved(self._triangles.manifolds.contacts(found, others, poses), self._assembly.origin)

    def packed_contacts(self, rows: Array, engine: Engine | None = None) -> PackedContacts:
        """Return the contacts of configurations (n, dim)."""
        each = [self.contacts(row, engine) for row in rows]
        found = [c for contacts in each for c in contacts]
        return PackedContacts(
            np.cumsum([0, *map(len, each)], dtype=np.int64),
            np.array([self._pair_of[frozenset((c.link, c.other))] for c in found], dtype=np.int64),
            np.array([c.position for c in found], dtype=np.float64).reshape(-1, 3),
            np.array([c.normal for c in found], dtype=np.float64).reshape(-1, 3),
            np.array([c.distance for c in found], dtype=np.float64),
        )

    def out_of_bounds(self, row: Array) -> tuple[Reason, ...]:
        """Return the limits that one configuration, (dim,), breaks, and the links that reach beyond the boundary."""
        space = self._space
        limits = [
            BrokenLimit(space.names[i], float(row[i]), float(space.lower[i]), float(space.upper[i]))
            for i in np.flatnonzero(space.broken(row))
        ]
        return *limits, *moved(self._boundary.outside(self._link_poses(row[None])[0]), self._assembly.origin)

    def explain(self, row: Array, engine: Engine | None = None) -> Verdict:
        """Return all that is wrong with one configuration, (dim,)."""
        return Verdict(row.copy(), (*deepest(self.contacts(row, engine)), *self.out_of_bounds(row)))

    def contacts_of_poses(self, poses: Array) -> list[Contact]:
        """Return the contacts of links that stand anywhere, (nlinks, 4, 4), found on triangles."""
        by_name = self._named(translated(poses, -np.array(self._assembly.origin))[None])
        if self._triangles.clearance.signed(by_name, 1)[0] > 0:
            return []
        inside = self._containment.pairs_inside(by_name) if self._containment.needed else []
        pairs = {*self._triangles.clearance.nearest_pairs(by_name), *(index for index, _ in inside)}
        found = [c for c in self._triangles.manifolds.contacts({}, pairs, by_name) if c.distance <= 0]
        return moved(found, self._assembly.origin)

    def _thread_data(self) -> mujoco.MjData:
        data = getattr(self._scratch, "data", None)
        if data is None:
            data = self._scratch.data = self._engine.data()
        return data

    def _poses_by_name(self, rows: Array) -> dict[str, Array]:
        return self._named(self._link_poses(rows))

    def _named(self, poses: Array) -> dict[str, Array]:
        """Return the poses of the meshes of links at (n, nlinks, 4, 4), and of obstacles, by name, (n, 4, 4) each."""
        by_name = {p.name: poses[:, i] for i, p in enumerate(self.links)}
        for name, center in self._off_center:
            by_name[name] = shifted(by_name[name], center)
        for name, pose in self._obstacle_poses.items():
            by_name[name] = np.broadcast_to(pose, (len(poses), 4, 4))
        return by_name

    @lazy_property
    def _surfaces(self) -> Surfaces:
        return Surfaces(self._parts, self._collision)

    @property
    def _triangles(self) -> _Triangles:
        # Built at its first use: verdicts do without it.
        with self._lock:
            if self._of_triangles is None:
                surfaces = self._surfaces
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
    """What works on triangles instead of cells: for all pairs, those that move, and those that are constant."""

    clearance: Clearance
    moving: Clearance
    constant: Clearance
    manifolds: Manifolds


def joined(parts: Sequence[PackedContacts]) -> PackedContacts:
    """Put the contacts of consecutive chunks, one at least, together."""
    counts = np.concatenate([np.diff(p.offsets) for p in parts])
    return PackedContacts(
        np.concatenate([np.zeros(1, np.int64), np.cumsum(counts)]),
        *(np.concatenate([getattr(p, field) for p in parts]) for field in ("pair", "position", "normal", "distance")),
    )
