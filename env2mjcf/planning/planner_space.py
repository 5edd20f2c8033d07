"""What a planner moves: the topology, limits and distances of its degrees of freedom, and which motions are valid."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..contact.edges import MotionBounds
from ..kinematics.tree import POSITIONS
from ..simulation.scene import Scene
from ..transforms import Array

# What moves nothing (a degree of freedom that only closes a loop) weighs this part of what moves most: its way counts
# for hardly anything, and yet configurations that differ in it are not the same.
_LEAST = 1e-3


@dataclass(frozen=True, slots=True)
class Piece:
    """Degrees of freedom that belong together: the position of a base, or a single angle or slide.

    Attributes:
        columns: Which, among those that move.
        turns: Whether it is an angle that turns without end.
        weight: How far a point of the robot moves for a unit of it, at most, in metres.
    """

    columns: tuple[int, ...]
    turns: bool
    weight: float


class PlanningSpace:
    """The configurations of the robots that move; the others stay where they are.

    Angles of bases and hinges without limits are circles, each for itself: an edge is the straight way in q, the short
    way round on circles, which is the motion that the scene's queries about edges are about. (The rotations of
    SE(3) would be another motion, whose edges no query of the scene has looked at.)

    The distance of two configurations bounds how far any point of a robot moves on the way between them: translations
    of a base count as they are, every other degree of freedom by its longest lever. Steps that are no longer than a
    resolution in this distance pass over nothing that is thicker.

    Args:
        scene: The scene.
        rows: (k, dim) configurations that are to be in the space, start and goal; what does not move is as in the
            first.
        columns: Which degrees of freedom move.

    Attributes:
        columns: (d,) which degrees of freedom move.
        pieces: What the space is made of.
        lower, upper: (d,) finite limits of what is drawn.
        turns: (d,) which are circles.
        weights: (d,) of the distance.
        extent: Of the scene, in metres.
    """

    def __init__(self, scene: Scene, rows: Array, columns: NDArray[np.int64]) -> None:
        space = scene.space
        self.columns = columns
        self.extent = scene.extent
        self.turns: NDArray[np.bool_] = space.periodic[columns]
        lower, upper = space.sample_limits
        inside = rows[:, columns]
        # The origin of a base may lie outside the boundary that its vertices keep to.
        self.lower = np.where(self.turns, -np.pi, np.minimum(lower[columns], inside.min(axis=0)))
        self.upper = np.where(self.turns, np.pi, np.maximum(upper[columns], inside.max(axis=0)))
        self.weights = _levers(scene)[columns]
        place = {int(c): i for i, c in enumerate(columns)}
        self.pieces = tuple(
            Piece(
                tuple(place[c] for c in group), bool(self.turns[place[group[0]]]), float(self.weights[place[group[0]]])
            )
            for group in _groups(scene)
            if group[0] in place
        )
        self._whole_turns = np.where(self.turns, 2 * np.pi, 0.0)
        self._bases = [p.columns for p in self.pieces if len(p.columns) > 1]
        self._rest = self.weights.copy()
        self._rest[[c for base in self._bases for c in base]] = 0.0
        self._all = len(columns) == space.dim
        self._template = rows[0].copy()

    @property
    def dim(self) -> int:
        """Number of degrees of freedom that move."""
        return len(self.columns)

    def full(self, values: Array) -> Array:
        """Return the scene's configurations, (n, dim), for values of what moves, (n, d)."""
        if self._all:
            return values
        rows = np.tile(self._template, (len(values), 1))
        rows[:, self.columns] = values
        return rows

    def difference(self, start: Array, end: Array) -> Array:
        """Return the way from one to the other, (..., d): the short way round on circles."""
        delta = end - start
        return delta - self._whole_turns * np.floor(delta / (2 * np.pi) + 0.5)

    def lengths(self, delta: Array) -> Array:
        """Return how long ways are, (n,), for ways (n, d)."""
        out = np.abs(delta) @ self._rest
        for base in self._bases:
            moved = delta[:, base]
            out += np.sqrt(np.einsum("ij,ij->i", moved, moved))
        return out

    def distance(self, start: Array, end: Array) -> float:
        """Return the distance of two configurations, (d,) each."""
        return float(self.lengths(self.difference(start, end)[None])[0])

    def path_length(self, values: Array) -> float:
        """Return the length of a path, (k, d)."""
        return float(self.lengths(self.difference(values[:-1], values[1:])).sum())

    def enforced(self, values: Array) -> Array:
        """Return configurations, (n, d), within the limits, angles of circles from -pi to pi."""
        reduced = values - self._whole_turns * np.floor(values / (2 * np.pi) + 0.5)
        return np.clip(reduced, self.lower, self.upper)

    def draw(self, n: int, rng: np.random.Generator) -> Array:
        """Draw configurations uniformly, (n, d)."""
        return rng.uniform(self.lower, self.upper, size=(n, self.dim))


def _levers(scene: Scene) -> Array:
    """Return how far a point moves for a unit of each degree of freedom, at most, (dim,)."""
    lower, upper = scene.space.sample_limits
    bounds = MotionBounds(scene.compiled.assembly, scene.space)
    farthest = np.tile(np.maximum(np.abs(lower), np.abs(upper)), (scene.space.dim, 1))
    levers = bounds.links(farthest, np.eye(scene.space.dim)).max(axis=1, initial=0.0)
    return np.maximum(levers, _LEAST * levers.max(initial=1.0))


def _groups(scene: Scene) -> Iterator[tuple[int, ...]]:
    """Yield the columns of each base's position together, and every other column by itself."""
    for robot, columns in zip(scene.compiled.assembly.robots, scene.space.robot_slices, strict=True):
        dofs = robot.kinematics.dofs
        bases: dict[int, list[int]] = {}
        for i, dof in enumerate(dofs):
            if dof.connection is None and dof.kind in POSITIONS:
                bases.setdefault(dof.body, []).append(columns.start + i)
        yield from map(tuple, bases.values())
        taken = {c for base in bases.values() for c in base}
        yield from ((c,) for c in range(columns.start, columns.stop) if c not in taken)


# A motion is looked at in rounds: most invalid ones show in the first few configurations, and a round costs as much
# as some ten of them.
_ROUND, _GROWTH = 2, 4
# Times of motions of at most so many steps are kept. Longer motions are each of a length of their own: what was kept of
# them would fill the memory.
_SHORT = 512


class Validity:
    """Answers a planner's questions, in batches, and counts.

    Args:
        scene: The scene.
        space: What moves.
        resolution: Greatest distance that any point of a robot moves between two configurations that are looked at.

    Attributes:
        checks: How many configurations were looked at.
        motions: How many motions were asked about.
        resolution: As above, in metres.
    """

    def __init__(self, scene: Scene, space: PlanningSpace, resolution: float) -> None:
        self._scene, self._space = scene, space
        self.resolution = resolution
        self.checks = self.motions = 0

    def states(self, values: Array) -> NDArray[np.bool_]:
        """Return whether configurations, (n, d), are valid, (n,)."""
        self.checks += len(values)
        return self._scene.valid_rows(self._space.full(values))

    def motion(self, start: Array, end: Array) -> bool:
        """Return whether the straight way from one configuration, (d,), known to be valid, to another is."""
        self.motions += 1
        delta = self._space.difference(start, end)
        steps = max(1, math.ceil(self._space.lengths(delta[None])[0] / self.resolution))
        times = _bisecting(steps)
        first, count = 0, _ROUND
        while first < steps:
            if not self.states(start + times[first : first + count] * delta).all():
                return False
            first, count = first + count, count * _GROWTH
        return True

    def free(self, starts: Array, ends: Array) -> NDArray[np.bool_]:
        """Return which of many motions, (n, d) to (n, d), are valid, (n,): first by their ends, then all the rest."""
        self.motions += len(starts)
        good = self.states(ends)
        left = np.flatnonzero(good)
        deltas = self._space.difference(starts[left], ends[left])
        steps = np.maximum(1, np.ceil(self._space.lengths(deltas) / self.resolution)).astype(np.int64)
        # The time of every step between the ends of each motion, one after the other.
        which = np.repeat(np.arange(len(left)), steps - 1)
        first = np.cumsum(steps - 1) - (steps - 1)
        times = (np.arange(len(which)) - np.repeat(first, steps - 1) + 1) / np.repeat(steps, steps - 1)
        # Every eighth first: most of what hits something does so there.
        for part in (np.arange(len(which)) % 8 == 0, np.arange(len(which)) % 8 != 0):
            here = np.flatnonzero(part & good[left[which]])
            hit = ~self.states(starts[left[which[here]]] + times[here, None] * deltas[which[here]])
            good[left[which[here[hit]]]] = False
        return good


def _bisecting(steps: int) -> Array:
    """Return the times 1/n to 1, (n, 1): the last, then halves, quarters, and so on: each once."""
    return _remembered(steps) if steps <= _SHORT else _times(steps)


def _times(steps: int) -> Array:
    strides = [1 << k for k in range((steps - 1).bit_length(), 0, -1)]
    indices = np.concatenate([[steps], *(np.arange(stride // 2, steps, stride) for stride in strides)])
    times = indices[:, None] / steps
    times.setflags(write=False)
    return times


_remembered = lru_cache(maxsize=_SHORT)(_times)
