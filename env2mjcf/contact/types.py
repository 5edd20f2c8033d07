"""What a contact query answers with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..pairs import ContactKind


@dataclass(frozen=True, slots=True, eq=False)
class Contact:
    """Two bodies that touch.

    Attributes:
        link: Name of a robot's body.
        other: Name of the obstacle or link that it touches.
        kind: Whether `other` is an obstacle, a link of the same robot, or of another one.
        position: (3,) where, world frame, metres.
        normal: (3,) unit vector from `link` towards `other`.
        distance: Metres; negative in depth. Between hulls, MuJoCo's penetration. Where surfaces cross, how far the
            link's triangle must go back along the normal to be beside the other's: with small triangles less than the
            bodies are in each other. For a body wholly inside another, the way out.
    """

    link: str
    other: str
    kind: ContactKind
    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    distance: float


@dataclass(frozen=True, slots=True, eq=False)
class PackedContacts:
    """The contacts of many configurations, one after the other.

    Those of configuration i are the entries from `offsets[i]` up to `offsets[i + 1]`: the ones of `contacts(q[i])`, in
    the same order, and their fields mean the same.

    Attributes:
        offsets: (n + 1,) int64, from 0 to the number k of all contacts.
        pair: (k,) int64, index into `scene.pairs`.
        position: (k, 3).
        normal: (k, 3), from the first body of the pair towards the second.
        distance: (k,).
    """

    offsets: NDArray[np.int64]
    pair: NDArray[np.int64]
    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    distance: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.pair)


@dataclass(frozen=True, slots=True, eq=False)
class PathReport:
    """What is wrong with a path, if anything.

    Attributes:
        valid: Whether every configuration and every edge is valid.
        configurations: (k,) bool, whether each configuration is valid.
        edges: (k - 1,) bool, whether everything between two configurations is valid.
        first_invalid: Index of the first invalid configuration, or of the configuration that the first invalid edge
            begins at; None where there is none.
        invalid_q: (dim,) the first invalid configuration found along the path; None where there is none.
        contacts: What touches there; empty where limits or the boundary are broken.
    """

    valid: bool
    configurations: NDArray[np.bool_]
    edges: NDArray[np.bool_]
    first_invalid: int | None
    invalid_q: NDArray[np.float64] | None
    contacts: tuple[Contact, ...]
