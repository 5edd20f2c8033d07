"""MuJoCo's own collision detection: verdicts, contacts, and the pairs that cannot move, which are decided once."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..pairs import Pair
from ..transforms import Array
from .arena import collide, collide_in_parts, new_data, restart, silence
from .types import Contact, deepest


class MujocoEngine:
    """Asks `mj_collision` about configurations.

    The engine has a model of its own, in which only links and obstacles collide: ground and walls act in simulation
    alone. It also sees the explicit pairs of bodies that cannot move, which are decided elsewhere.

    Args:
        model: The scene's model.
        owners: Name of the body that each collision geom belongs to.

    Attributes:
        model: The engine's own model; an engine made of it answers alike.
    """

    def __init__(self, model: mujoco.MjModel, owners: Mapping[str, str]) -> None:
        names = list(dict.fromkeys(owners.values()))
        index = {n: i for i, n in enumerate(names)}
        self._names = names
        self._owner = np.full(model.ngeom, -1, dtype=np.int64)
        for geom, owner in owners.items():
            self._owner[model.geom(geom).id] = index[owner]
        # Links collide with everything, obstacles only with them.
        collides = (self._owner >= 0) & (model.geom_contype > 0)
        self._links, self._obstacles = (
            np.flatnonzero(collides & (model.geom_conaffinity > 0)),
            np.flatnonzero(collides & (model.geom_conaffinity == 0)),
        )
        self.model = copy.copy(model)
        self.model.geom_contype[self._owner < 0] = 0
        self.model.geom_conaffinity[self._owner < 0] = 0
        # One contact is enough for a verdict, and for where two cells touch. MuJoCo's native algorithm misses some deep
        # overlaps of aligned boxes (coplanar plates that cross), libccd's does not.
        for flag in (mujoco.mjtDisableBit.mjDSBL_MULTICCD, mujoco.mjtDisableBit.mjDSBL_NATIVECCD):
            self.model.opt.disableflags |= int(flag)

    def data(self) -> mujoco.MjData:
        """Return scratch data for one thread."""
        data = new_data(self.model)
        silence(data)
        return data

    def collide(self, qpos: Array, data: mujoco.MjData) -> NDArray[np.bool_]:
        """Return whether anything touches, (n,), for qpos of shape (n, nq)."""
        model, kinematics, collision = self.model, mujoco.mj_kinematics, mujoco.mj_collision
        hits = np.zeros(len(qpos), dtype=bool)
        full = data.warning[int(mujoco.mjtWarning.mjWARN_CONTACTFULL)]
        for i, row in enumerate(qpos):
            data.qpos[:] = row
            kinematics(model, data)
            before = full.number
            try:
                collision(model, data)
                hits[i] = data.ncon > 0
            except mujoco.FatalError:
                restart(model, data)
                before = -1
            if not hits[i] and full.number != before:
                hits[i] = any(each.ncon > 0 for each in self._found(row, data))
        return hits

    def _found(self, qpos: Array, data: mujoco.MjData) -> Iterator[mujoco.MjData]:
        """Return data with all contacts of one qpos, at once or, where memory is too short for that, some at a time."""
        data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, data)
        if not collide(self.model, data):
            return iter((data,))
        return collide_in_parts(self.model, data, self._links, self._obstacles)

    def touching(self, qpos: Array, data: mujoco.MjData) -> Iterator[tuple[str, str, Array, Array, float]]:
        """Return (body, body, position, normal from the first to the second, distance) of every contact of one qpos."""
        for each in self._found(qpos, data):
            if not each.ncon:
                continue
            # Iterating data.contact costs more than the query itself.
            contacts = each.contact
            geoms, frames, places = contacts.geom.copy(), contacts.frame.copy(), contacts.pos.copy()
            distances = contacts.dist.copy()
            for i, (a, b) in enumerate(geoms):
                names = self._names[self._owner[a]], self._names[self._owner[b]]
                yield *names, places[i], frames[i, :3], float(distances[i])

    def touching_names(self, qpos: Array, data: mujoco.MjData) -> set[frozenset[str]]:
        """Return the pairs of names of bodies that touch at one qpos."""
        pairs: set[tuple[int, int]] = set()
        for each in self._found(qpos, data):
            if each.ncon:
                pairs.update(map(tuple, np.unique(self._owner[each.contact.geom], axis=0).tolist()))
        return {frozenset((self._names[a], self._names[b])) for a, b in pairs}

    def body_poses(self, qpos: Array, bodies: NDArray[np.int64], data: mujoco.MjData) -> Array:
        """Return world poses (n, nbodies, 4, 4) out of MuJoCo's kinematics for qpos of shape (n, nq)."""
        poses = np.zeros((len(qpos), len(bodies), 4, 4))
        poses[..., 3, 3] = 1.0
        for i, row in enumerate(qpos):
            data.qpos[:] = row
            mujoco.mj_kinematics(self.model, data)
            poses[i, :, :3, :3] = data.xmat[bodies].reshape(-1, 3, 3)
            poses[i, :, :3, 3] = data.xpos[bodies]
        return poses


def static_contacts(
    model: mujoco.MjModel, data: mujoco.MjData, pairs: tuple[Pair, ...], owners: Mapping[str, str]
) -> tuple[Contact, ...]:
    """Return the contacts of all constant pairs, the deepest of each; `data` has kinematics at any configuration."""
    geoms: dict[str, list[int]] = {}
    for geom, owner in owners.items():
        geoms.setdefault(owner, []).append(int(model.geom(geom).id))
    constant = [p for p in pairs if p.constant and p.link in geoms and p.other in geoms]
    return deepest(c for p in constant for c in _touches(model, data, p, geoms[p.link], np.array(geoms[p.other])))


def _touches(
    model: mujoco.MjModel, data: mujoco.MjData, pair: Pair, mine: list[int], others: NDArray[np.int64]
) -> Iterator[Contact]:
    centers, radii = data.geom_xpos[others], model.geom_rbound[others]
    for a in mine:
        gaps = np.linalg.norm(centers - data.geom_xpos[a], axis=1) - radii - model.geom_rbound[a]
        for b in others[gaps <= 0]:
            contact = _touch(model, data, pair, a, int(b))
            if contact is not None:
                yield contact


def _touch(model: mujoco.MjModel, data: mujoco.MjData, pair: Pair, a: int, b: int) -> Contact | None:
    ends = np.zeros(6)
    distance = mujoco.mj_geomDistance(model, data, a, b, 0.0, ends)
    if distance > 0 or not np.any(ends):
        return None
    start, end = ends[:3], ends[3:]
    return Contact(pair.link, pair.other, pair.kind, (start + end) / 2, _unit(start - end, data, a, b), distance)


def _unit(vector: NDArray[np.float64], data: mujoco.MjData, a: int, b: int) -> NDArray[np.float64]:
    """Return a unit vector; of the line between the geoms' centres where the bodies merely touch."""
    length = float(np.linalg.norm(vector))
    if length < 1e-12:
        vector = data.geom_xpos[b] - data.geom_xpos[a]
        length = float(np.linalg.norm(vector))
    return vector / length if length else np.array([0.0, 0.0, 1.0])
