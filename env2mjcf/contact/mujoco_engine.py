"""MuJoCo's own collision detection: verdicts, contacts, and the pairs that cannot move, which are decided once."""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Iterator, Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..pairs import Pair
from ..transforms import Array
from .arena import collide, collide_in_parts, new_data, restart, silence
from .types import Contact, deepest

# Extents in metres between which MuJoCo's tolerances, which are absolute, are small enough, and large enough; and one
# that is well between them.
_SMALLEST, _LARGEST, _CHOSEN = 1.0, 1e3, 16.0

_CCD_TOLERANCE = 1e-6

# What a model measures in metres, besides the positions of slides and free joints.
_LENGTHS = (
    "body_pos",
    "body_ipos",
    "jnt_pos",
    "geom_pos",
    "geom_size",
    "geom_aabb",
    "geom_rbound",
    "bvh_aabb",
    "mesh_vert",
    "site_pos",
)


class MujocoEngine:
    """Asks `mj_collision` about configurations.

    The engine has a model of its own, in which only links and obstacles collide: ground and walls act in simulation
    alone. It also sees the explicit pairs of bodies that cannot move, which are decided elsewhere. Where the scene is
    tiny or huge, this model is larger or smaller by a power of two, because MuJoCo's tolerances are absolute.

    Args:
        model: The scene's model.
        owners: Name of the body that each collision geom belongs to.
        extent: Of the scene, in metres.
        own: Whether the model is that of another engine of the same scene.

    Attributes:
        model: The engine's own model; an engine made of it answers alike.
    """

    def __init__(self, model: mujoco.MjModel, owners: Mapping[str, str], extent: float, own: bool = False) -> None:
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
        self.model.opt.ccd_tolerance = _CCD_TOLERANCE
        self._lengths = _lengths_of_qpos(model)
        self._size = 1.0 if _SMALLEST <= extent <= _LARGEST else 2.0 ** round(math.log2(_CHOSEN / extent))
        if not own:
            self._grow(self._size)

    def _grow(self, factor: float) -> None:
        """Make the model larger; powers of two change no digit of any number."""
        if factor == 1:
            return
        for name in _LENGTHS:
            getattr(self.model, name)[:] *= factor
        self.model.qpos0[self._lengths] *= factor
        # Frames less than a millionth of a metre apart were taken for one when the model was compiled.
        self.model.body_sameframe[:] = self.model.geom_sameframe[:] = 0

    def _place(self, row: Array, data: mujoco.MjData) -> None:
        """Put the bodies of `data` at qpos, in metres."""
        data.qpos[:] = row
        if self._size != 1:
            data.qpos[self._lengths] *= self._size
        mujoco.mj_kinematics(self.model, data)

    def data(self) -> mujoco.MjData:
        """Return scratch data for one thread."""
        data = new_data(self.model)
        silence(data)
        return data

    def collide(self, qpos: Array, data: mujoco.MjData) -> NDArray[np.bool_]:
        """Return whether anything touches, (n,), for qpos of shape (n, nq)."""
        model, place, collision = self.model, self._place, mujoco.mj_collision
        hits = np.zeros(len(qpos), dtype=bool)
        full = data.warning[int(mujoco.mjtWarning.mjWARN_CONTACTFULL)]
        for i, row in enumerate(qpos):
            place(row, data)
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
        self._place(qpos, data)
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
            geoms, frames, places = contacts.geom.copy(), contacts.frame.copy(), contacts.pos / self._size
            distances = contacts.dist / self._size
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
            self._place(row, data)
            poses[i, :, :3, :3] = data.xmat[bodies].reshape(-1, 3, 3)
            poses[i, :, :3, 3] = data.xpos[bodies] / self._size
        return poses

    def static_contacts(self, pairs: tuple[Pair, ...]) -> tuple[Contact, ...]:
        """Return the contacts of all constant pairs, the deepest of each, about the model's origin."""
        model, data = self.model, self.data()
        mujoco.mj_kinematics(model, data)
        geoms: dict[str, list[int]] = {}
        for geom in np.flatnonzero(self._owner >= 0).tolist():
            geoms.setdefault(self._names[self._owner[geom]], []).append(geom)
        constant = [p for p in pairs if p.constant and p.link in geoms and p.other in geoms]
        found = (c for p in constant for c in _touches(model, data, p, geoms[p.link], np.array(geoms[p.other])))
        return tuple(
            dataclasses.replace(c, position=c.position / self._size, distance=c.distance / self._size)
            for c in deepest(found)
        )


def _lengths_of_qpos(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Return which entries of qpos are lengths."""
    kinds = {int(mujoco.mjtJoint.mjJNT_FREE): 3, int(mujoco.mjtJoint.mjJNT_SLIDE): 1}
    joints = zip(model.jnt_qposadr.tolist(), model.jnt_type.tolist(), strict=True)
    return np.array([first + i for first, kind in joints for i in range(kinds.get(kind, 0))], dtype=np.int64)


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
