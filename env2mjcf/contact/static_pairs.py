"""Pairs that cannot move against each other: decided once, and added to every answer."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..pairs import Pair
from .types import Contact


def static_contacts(
    model: mujoco.MjModel, data: mujoco.MjData, pairs: tuple[Pair, ...], owners: Mapping[str, str]
) -> tuple[Contact, ...]:
    """Return the contacts of all constant pairs, the deepest of each.

    Args:
        model: The scene's model.
        data: Its data, with kinematics at any configuration.
        pairs: The tested pairs.
        owners: Name of the body that each collision geom belongs to.
    """
    geoms: dict[str, list[int]] = {}
    for geom, owner in owners.items():
        geoms.setdefault(owner, []).append(int(model.geom(geom).id))
    found: list[Contact] = []
    for pair in pairs:
        if pair.constant:
            contact = _deepest(model, data, pair, geoms.get(pair.link, []), geoms.get(pair.other, []))
            if contact is not None:
                found.append(contact)
    return tuple(found)


def _deepest(
    model: mujoco.MjModel, data: mujoco.MjData, pair: Pair, mine: list[int], others: list[int]
) -> Contact | None:
    best: Contact | None = None
    if not mine or not others:
        return None
    second = np.array(others)
    centers, radii = data.geom_xpos[second], model.geom_rbound[second]
    for a in mine:
        gaps = np.linalg.norm(centers - data.geom_xpos[a], axis=1) - radii - model.geom_rbound[a]
        for b in second[gaps <= 0]:
            contact = _touch(model, data, pair, a, int(b))
            if contact is not None and (best is None or contact.distance < best.distance):
                best = contact
    return best


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
