"""How far bodies can move, and how much nearer they can come to each other, on straight ways."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..dofs import Dof, DofKind
from ..geometry.assembly import Assembly
from ..pairs import Pair
from ..space import ConfigurationSpace
from ..transforms import Array

_TRANSLATIONS = (DofKind.X, DofKind.Y, DofKind.Z)
_ROTATIONS = (DofKind.RX, DofKind.RY, DofKind.RZ)


class MotionBounds:
    """Bounds of motion from distances along the chains of links.

    Args:
        assembly: The scene.
        space: Its configuration space.
        pairs: Pairs of links whose approach is asked for.
    """

    def __init__(self, assembly: Assembly, space: ConfigurationSpace, pairs: Sequence[Pair] = ()) -> None:
        self._robots = assembly.robots
        self._slices = space.robot_slices
        names = [n for r in assembly.robots for n in r.names]
        self._shape = (space.dim, len(names))
        first = [names.index(p.link) for p in pairs]
        second = [names.index(p.other) for p in pairs]
        self._first, self._second = np.array(first, dtype=np.int64), np.array(second, dtype=np.int64)
        dofs = [d for r in assembly.robots for d in r.kinematics.dofs]
        self._slides = np.array([d.kind is DofKind.D for d in dofs], dtype=np.bool_)
        self._bases = [
            (columns.start + np.array([i for i, d in enumerate(r.kinematics.dofs) if d.body == body and _of_base(d)]))
            for r, columns in zip(assembly.robots, space.robot_slices, strict=True)
            for body in sorted(r.kinematics.tree.bases)
        ]
        self._kinds = [d.kind for d in dofs]
        self._fixed = None if self._slides.any() else self._levers(np.zeros(space.dim))

    def links(self, start: Array, delta: Array) -> Array:
        """Bound how far any point of each link moves, (n, nlinks), on the ways from (n, dim) by (n, dim)."""
        return self._bound(start, delta, lambda levers: levers)

    def split(self, start: Array, delta: Array) -> tuple[Array, Array]:
        """Part the motion of links on ways from (n, dim) by (n, dim) in two.

        Returns:
            The straight translation of each link's base in the world, (n, nlinks, 3); and bounds of how far any point
            of each link moves besides, (n, nlinks).
        """
        drifts = np.zeros((len(start), self._shape[1], 3))
        rest, link = delta.copy(), 0
        for robot, columns in zip(self._robots, self._slices, strict=True):
            # Links of robots with several bases have no translation in common.
            if len(robot.kinematics.tree.bases) == 1:
                for i, kind in enumerate(self._kinds[columns]):
                    if kind in _TRANSLATIONS and robot.kinematics.dofs[i].connection is None:
                        moved = delta[:, columns.start + i]
                        drifts[:, link : link + len(robot.links), _TRANSLATIONS.index(kind)] = moved[:, None]
                        rest[:, columns.start + i] = 0.0
            link += len(robot.links)
        return drifts, self.links(start, rest)

    def pairs(self, start: Array, delta: Array) -> Array:
        """Bound how much nearer the links of each pair can come to each other, (n, npairs).

        What moves both of them as one does not count.
        """
        return self._bound(start, delta, self._between)

    def _bound(self, start: Array, delta: Array, chosen: Callable[[Array], Array]) -> Array:
        turns = self._turns(delta)
        if self._fixed is not None:
            return turns @ chosen(self._fixed)
        # How far a slide reaches out depends on the way.
        farthest = np.maximum(np.abs(start), np.abs(start + delta))
        out = np.empty((len(start), chosen(np.zeros(self._shape)).shape[1]))
        for i, (turn, far) in enumerate(zip(turns, farthest, strict=True)):
            out[i] = turn @ chosen(self._levers(far))
        return out

    def _between(self, levers: Array) -> Array:
        first, second = levers[:, self._first], levers[:, self._second]
        return np.where((first > 0) & (second > 0), 0.0, first + second)

    def _levers(self, slide: Array) -> Array:
        levers = np.zeros(self._shape)
        link = 0
        for robot, columns in zip(self._robots, self._slices, strict=True):
            of_robot = robot.kinematics.levers([p.radius for p in robot.links], list(slide[columns]))
            levers[columns, link : link + len(robot.links)] = of_robot
            link += len(robot.links)
        return levers

    def _turns(self, delta: Array) -> Array:
        """Return how far each degree of freedom goes, (n, dim), those of a base taken together.

        The translations of a base make one straight line. Its angular velocity is at most the root of
        (|rx'| + |rz'|)^2 + ry'^2, since the axis of ry is square to the two others (env-format section 9.2).
        """
        turns = np.abs(delta)
        for columns in self._bases:
            by_kind = {self._kinds[c]: c for c in columns}
            along = [by_kind[k] for k in _TRANSLATIONS if k in by_kind]
            about = [by_kind[k] for k in _ROTATIONS if k in by_kind]
            if along:
                turns[:, along[0]], turns[:, along[1:]] = np.linalg.norm(turns[:, along], axis=1), 0.0
            if len(about) == 3:
                x, y, z = about
                turns[:, x], turns[:, about[1:]] = np.hypot(turns[:, x] + turns[:, z], turns[:, y]), 0.0
        return turns


def _of_base(dof: Dof) -> bool:
    return dof.connection is None
