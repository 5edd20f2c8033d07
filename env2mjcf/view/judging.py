"""Verdicts while somebody looks on: always about the newest configuration, never in its way."""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from ..contact.boundary import BoundaryTest
from ..contact.types import Contact
from ..options import Engine
from ..simulation.scene import Scene
from ..transforms import Array

T = TypeVar("T")


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
        links = [p for r in scene.compiled.assembly.robots for p in r.links]
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


class Newest(Generic[T]):
    """Works on what was handed in last, in a thread of its own; what has been overtaken meanwhile is dropped.

    Args:
        work: What to do. It is handed a function, too, that says whether something newer waits.
    """

    def __init__(self, work: Callable[[T, Callable[[], bool]], None]) -> None:
        self._work = work
        self._waiting: T | None = None
        self._changed = threading.Condition()
        self._closed = False
        threading.Thread(target=self._run, name="env2mjcf-judge", daemon=True).start()

    def submit(self, item: T) -> None:
        """Hand in something newer."""
        with self._changed:
            self._waiting = item
            self._changed.notify()

    def close(self) -> None:
        """End the thread after what it is working on."""
        with self._changed:
            self._closed = True
            self._changed.notify()

    def _overtaken(self) -> bool:
        return self._waiting is not None or self._closed

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(self._overtaken)
                if self._closed:
                    return
                item, self._waiting = self._waiting, None
            assert item is not None
            self._work(item, self._overtaken)
