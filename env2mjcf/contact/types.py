"""What contact queries return: contacts, verdicts with their reasons, reports on paths."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..pairs import ContactKind

# What type checkers can tell of configurations. An array of unknown shape passes for one of any shape: so overloads
# begin with a shape that no configurations have.
UnknownShape: TypeAlias = np.ndarray[tuple[int, int, int], np.dtype[Any]]
OneRow: TypeAlias = Sequence[float] | np.ndarray[tuple[int], np.dtype[Any]]
Rows: TypeAlias = Sequence[Sequence[float]] | Sequence[NDArray[Any]] | np.ndarray[tuple[int, int], np.dtype[Any]]


@dataclass(frozen=True, slots=True, eq=False)
class Contact:
    """Two bodies that touch.

    Attributes:
        link: Name of a robot's body.
        other: Name of the obstacle or link that it touches.
        kind: Whether `other` is an obstacle, a link of the same robot, or of another one.
        position: (3,) where, world frame, metres.
        normal: (3,) unit vector from `link` towards `other`.
        distance: Metres; negative in depth. Of the deepest contact of a pair, how far the link must go back along the
            normal to be clear of the other, as `clearance` says. Others are less deep or as deep; of bodies that are
            not convex, they say how far the link's triangle must go back to be beside the other's.
    """

    link: str
    other: str
    kind: ContactKind
    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    distance: float

    def __str__(self) -> str:
        return f"{self.link} and {self.other} ({self.kind}): {self.depth} at ({_numbers(self.position)})"

    @property
    def depth(self) -> str:
        """How deep the bodies are in each other, in words."""
        return f"{-self.distance:.3g} m deep" if self.distance < 0 else "touching"


def deepest(contacts: Iterable[Contact]) -> tuple[Contact, ...]:
    """Return the deepest contact of each pair, pairs in the order in which they come."""
    found: dict[tuple[str, str], Contact] = {}
    for contact in contacts:
        pair = (contact.link, contact.other)
        if pair not in found or contact.distance < found[pair].distance:
            found[pair] = contact
    return tuple(found.values())


@dataclass(frozen=True, slots=True)
class BrokenLimit:
    """A degree of freedom beyond its limits, in radians or metres."""

    name: str
    value: float
    lower: float
    upper: float

    def __str__(self) -> str:
        return f"{self.name} is {short(self.value)}; limits {short(self.lower)} to {short(self.upper)}"


@dataclass(frozen=True, slots=True, eq=False)
class Outside:
    """A link that reaches beyond the boundary.

    Attributes:
        link: Its name.
        vertex: Index, in the link's mesh, of the vertex that is farthest outside.
        position: (3,) where that vertex is, world frame, metres.
        distance: How far outside it is, metres.
    """

    link: str
    vertex: int
    position: NDArray[np.float64]
    distance: float

    def __str__(self) -> str:
        return f"{self.link} reaches {self.distance:.3g} m outside the boundary, to ({_numbers(self.position)})"


Reason: TypeAlias = Contact | BrokenLimit | Outside

_Somewhere = TypeVar("_Somewhere", Contact, Outside)


def moved(found: Sequence[_Somewhere], by: ArrayLike) -> list[_Somewhere]:
    """Return contacts, or what is outside, with their positions moved by a vector of the world, (3,)."""
    vector = np.asarray(by, dtype=np.float64)
    return [replace(f, position=f.position + vector) for f in found] if vector.any() else list(found)


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """Whether a configuration is valid, and all that is wrong with it.

    Attributes:
        q: (dim,) the configuration, radians and metres.
        reasons: What is wrong: the deepest contact of each pair that touches, limits that are broken, links that reach
            beyond the boundary. `str(reason)` says it in words.
    """

    q: NDArray[np.float64]
    reasons: tuple[Reason, ...]

    @property
    def valid(self) -> bool:
        """Whether nothing is wrong."""
        return not self.reasons

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """The deepest contact of each pair that touches."""
        return tuple(r for r in self.reasons if isinstance(r, Contact))

    @property
    def limits(self) -> tuple[BrokenLimit, ...]:
        """The limits that are broken."""
        return tuple(r for r in self.reasons if isinstance(r, BrokenLimit))

    @property
    def outside(self) -> tuple[str, ...]:
        """Names of the links that reach beyond the boundary."""
        return tuple(r.link for r in self.reasons if isinstance(r, Outside))

    @property
    def summary(self) -> str:
        """What kinds of things are wrong, in words; empty where nothing is."""
        told = {"in collision": self.contacts, "out of limits": self.limits, "outside the boundary": self.outside}
        return ", ".join(what for what, so in told.items() if so)


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

    def __repr__(self) -> str:
        return f"<PackedContacts: {len(self)} in {len(self.offsets) - 1} configurations>"


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


def short(value: float) -> str:
    """Return a number with six digits, or more if the first ones say where on a map it is."""
    return f"{value:.6g}" if abs(value) < 1e5 or abs(value) > 1e9 else f"{value:.11g}"


def _numbers(position: NDArray[np.float64]) -> str:
    return ", ".join(map(short, position.tolist()))
