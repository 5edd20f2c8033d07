"""Says of each configuration not only whether it is valid, but what is wrong with it."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..contact.boundary import BoundaryTest
from ..contact.types import Contact
from ..kinematics.transforms import Array
from ..options import Engine
from .scene import Scene


@dataclass(frozen=True, slots=True)
class BrokenLimit:
    """A degree of freedom beyond its limits, in radians or metres."""

    name: str
    value: float
    lower: float
    upper: float

    def __str__(self) -> str:
        return f"{self.name} is {self.value:.6g}; limits {self.lower:.6g} to {self.upper:.6g}"


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """What is known of one configuration.

    Attributes:
        label: What it is called.
        q: (dim,) radians and metres.
        valid: Whether nothing is wrong with it.
        in_collision: Whether anything touches.
        limits: Degrees of freedom beyond their limits.
        outside: Links that reach beyond the boundary.
        contacts: The deepest contact of each pair that touches.
    """

    label: str
    q: Array
    valid: bool
    in_collision: bool
    limits: tuple[BrokenLimit, ...] = ()
    outside: tuple[str, ...] = ()
    contacts: tuple[Contact, ...] = field(default=())

    def reasons(self) -> tuple[str, ...]:
        """Return a line on everything that is wrong: who touches, where and how deep; limits; the boundary."""
        outside = (f"outside: {', '.join(self.outside)}",) if self.outside else ()
        return (*map(touch, self.contacts), *map(str, self.limits), *outside)


def touch(contact: Contact) -> str:
    """Return a line on who touches whom, where and how deep."""
    place = ", ".join(f"{x:.6g}" for x in contact.position)
    depth = f"{-contact.distance:.3g} m deep" if contact.distance < 0 else "touching"
    return f"{contact.link} and {contact.other} ({contact.kind}): {depth} at ({place})"


class Judge:
    """Judges configurations of a scene.

    Args:
        scene: The scene.
        q: (n, dim) configurations.
        labels: What each is called.
        poses: (n, nlinks, 4, 4) where links stand instead, in rows that are not `fits`.
        fits: (n,) whether q puts the links where they stand; None for all.
    """

    def __init__(
        self,
        scene: Scene,
        q: Array,
        labels: Sequence[str],
        poses: Array | None = None,
        fits: NDArray[np.bool_] | None = None,
    ) -> None:
        self._scene, self._q, self._labels = scene, q, labels
        self._placed = np.zeros(len(q), dtype=bool) if fits is None or poses is None else ~fits
        assembly = scene.compiled.assembly
        links = assembly.links
        self._boundaries = [(p.name, BoundaryTest(assembly.environment.boundary, [p])) for p in links]
        hulls = scene.report.collision == "hull"
        self._plates = {p.name for p in assembly.parts() if not hulls and not p.analysis.convex}
        self.in_limits = scene.space.within_limits(q)
        self.in_collision = scene.in_collision(q, progress=True)
        self._poses = scene.link_poses(q)
        if poses is not None and self._placed.any():
            self._poses[self._placed] = poses[self._placed]
            self.in_limits[self._placed] = True
            self.in_collision[self._placed] = [bool(scene.contacts_of_poses(p)) for p in poses[self._placed]]
        self.inside = BoundaryTest(assembly.environment.boundary, links).inside(self._poses)
        self.valid = self.in_limits & self.inside & ~self.in_collision

    def verdict(self, index: int) -> Verdict:
        """Return all that is wrong with one configuration."""
        q = self._q[index]
        collides = bool(self.in_collision[index])
        return Verdict(
            self._labels[index],
            q,
            bool(self.valid[index]),
            collides,
            () if self.in_limits[index] else self._broken_limits(q),
            () if self.inside[index] else self._outside(self._poses[index]),
            _deepest(self._contacts(index)) if collides else (),
        )

    def rough(self, verdict: Verdict) -> bool:
        """Whether a depth is that of a thin plate, not of a body."""
        return any(name in self._plates for c in verdict.contacts for name in (c.link, c.other))

    def _broken_limits(self, q: Array) -> tuple[BrokenLimit, ...]:
        space = self._scene.space
        beyond = space.broken(q)
        return tuple(
            BrokenLimit(space.names[i], float(q[i]), float(space.lower[i]), float(space.upper[i]))
            for i in np.flatnonzero(beyond)
        )

    def _contacts(self, index: int) -> list[Contact]:
        if self._placed[index]:
            return self._scene.contacts_of_poses(self._poses[index])
        return self._scene.contacts(self._q[index])

    def _outside(self, poses: Array) -> tuple[str, ...]:
        return tuple(
            name for i, (name, test) in enumerate(self._boundaries) if not test.inside(poses[None, i : i + 1])[0]
        )


def _deepest(contacts: Sequence[Contact]) -> tuple[Contact, ...]:
    """Return the deepest contact of each pair."""
    deepest: dict[tuple[str, str], Contact] = {}
    for contact in contacts:
        pair = (contact.link, contact.other)
        if pair not in deepest or contact.distance < deepest[pair].distance:
            deepest[pair] = contact
    return tuple(deepest.values())


@dataclass(frozen=True, slots=True, eq=False)
class Judgement:
    """What is known of the configuration that is shown.

    Attributes:
        collides: Whether anything touches.
        contacts: All contacts, the deepest first; None while they are being looked for.
        beyond: Columns of the degrees of freedom beyond their limits.
        outside: Names of the links that reach beyond the boundary.
    """

    collides: bool
    contacts: tuple[Contact, ...] | None
    beyond: tuple[int, ...]
    outside: tuple[str, ...]

    @property
    def valid(self) -> bool:
        """Whether nothing is wrong."""
        return not (self.collides or self.beyond or self.outside)


class LiveJudge:
    """Judges one configuration at a time.

    MuJoCo's engine answers, unless another one was asked for by name: the exact engine of `auto` may have to be
    compiled for a minute, and gains nothing on single verdicts.

    Args:
        scene: The scene.
    """

    def __init__(self, scene: Scene) -> None:
        chosen = scene.compiled.options.engine
        self._engine: Engine = "mujoco" if chosen == "auto" else chosen
        self._scene = scene
        boundary = scene.compiled.assembly.environment.boundary
        links = scene.compiled.assembly.links
        self._boundaries = [(p.name, BoundaryTest(boundary, [p])) for p in links] if boundary else []

    def verdict(self, q: Array) -> Judgement:
        """Return what a verdict tells of q, (dim,): everything but the contacts, unless there are none."""
        collides = bool(self._scene.in_collision(q, engine=self._engine))
        beyond = tuple(int(i) for i in np.flatnonzero(self._scene.space.broken(q)))
        return Judgement(collides, None if collides else (), beyond, self._outside(q))

    def judge(self, q: Array) -> Judgement:
        """Return all that is known of q, (dim,)."""
        judgement = self.verdict(q)
        if judgement.contacts is not None:
            return judgement
        return dataclasses.replace(judgement, contacts=tuple(self._scene.contacts(q, engine=self._engine)))

    def valid(self, q: Array) -> bool:
        """Return whether q, (dim,), is valid."""
        return bool(self._scene.is_valid(q, engine=self._engine))

    def _outside(self, q: Array) -> tuple[str, ...]:
        if not self._boundaries:
            return ()
        poses = self._scene.link_poses(q[None])
        return tuple(name for i, (name, test) in enumerate(self._boundaries) if not test.inside(poses[:, i : i + 1])[0])
