"""Forward kinematics as a list of steps, for compiled code: a constant transform each, then one motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import IntEnum

import numpy as np

from ...geometry.topology import Floats, Ints
from ...kinematics.forward import RobotKinematics
from ...kinematics.tree import POSITIONS, ROTATIONS, DofKind
from ...model.environment import BaseKind, DHForm
from ...transforms import dh_matrix, pose_matrix, transform

WORLD = -1
"""The parent of a step that begins at the origin; the column of a number that is zero."""


class Motion(IntEnum):
    """What a step does after its constant transform."""

    NONE = 0
    TURN_Z = 1
    TURN_X = 2
    SLIDE_Z = 3
    BASE = 4
    """Rz Ry Rx and a translation, in the world; the constant is a translation before them."""


class Motions:
    """The steps that place frames fixed to the bodies of all robots; parents come first.

    Each is the frame of an earlier step, or of the `WORLD`, times a constant, times a motion.
    """

    def __init__(self) -> None:
        self._constants: list[Floats] = []
        self._numbers: list[tuple[int, ...]] = []

    def add(self, robot: RobotKinematics, first: int, frames: Sequence[Floats]) -> list[int]:
        """Add a robot.

        Args:
            robot: The robot.
            first: Its first column in the configuration.
            frames: For each body, in file order, the frame to be placed, (4, 4) in the body's own.

        Returns:
            The step of each body's frame.
        """
        # For each body the last step before it, and the constant transform from there.
        tails: dict[int, tuple[int, Floats]] = {}
        columns = {(d.connection, d.body, d.kind): first + i for i, d in enumerate(robot.dofs)}
        for body in robot.tree.order:
            k = robot.tree.parent[body]
            if k is None:
                tails[body] = self._base(robot, body, columns)
                continue
            step, tail = tails[robot.multibody.connections[k].previous]
            for motion, value in _elements(robot, k, columns):
                if motion is Motion.NONE:
                    tail = tail @ value
                else:
                    step, tail = self._add(step, tail, motion, (int(value), *(WORLD,) * 5)), np.eye(4)
            tails[body] = step, tail
        return [self._add(tails[i][0], tails[i][1] @ frame, Motion.NONE) for i, frame in enumerate(frames)]

    def arrays(self) -> tuple[Floats, Ints]:
        """Return constants (s, 12), rows of the upper three rows, and (s, 8) parents, motions and columns.

        Columns are those of the configuration: six for a base (x, y, z, rx, ry, rz), else one in the first place.
        """
        return np.reshape(self._constants, (-1, 12)), np.array(self._numbers, dtype=np.int64).reshape(-1, 8)

    def _add(self, parent: int, constant: Floats, motion: Motion, columns: tuple[int, ...] = (WORLD,) * 6) -> int:
        self._constants.append(constant[:3].ravel())
        self._numbers.append((parent, int(motion), *columns))
        return len(self._numbers) - 1

    def _base(
        self, robot: RobotKinematics, body: int, columns: dict[tuple[int | None, int, DofKind], int]
    ) -> tuple[int, Floats]:
        if robot.tree.bases[body] is BaseKind.FIXED:
            return WORLD, robot.base_pose(body, np.zeros(robot.dim))
        own = tuple(columns.get((None, body, kind), WORLD) for kind in POSITIONS + ROTATIONS)
        return self._add(WORLD, transform(np.eye(3), -np.array(robot.origin)), Motion.BASE, own), np.eye(4)


def _elements(
    robot: RobotKinematics, k: int, columns: dict[tuple[int | None, int, DofKind], int]
) -> Iterator[tuple[Motion, Floats | int]]:
    """Yield the factors of a connection: constant transforms, and motions with their columns."""
    connection = robot.multibody.connections[k]
    dh, form = connection.dh, robot.multibody.dh_form

    def factor(kind: DofKind, motion: Motion, **constant: float) -> tuple[Motion, Floats | int]:
        column = columns.get((k, connection.next, kind))
        if column is not None:
            return motion, column
        row = {"alpha": 0.0, "a": 0.0, "d": 0.0, "theta": 0.0} | constant
        return Motion.NONE, dh_matrix(form, row["alpha"], row["a"], row["d"], row["theta"])

    alpha = factor(DofKind.ALPHA, Motion.TURN_X, alpha=dh.alpha)
    along = Motion.NONE, dh_matrix(form, 0.0, dh.a, 0.0, 0.0)
    theta = factor(DofKind.THETA, Motion.TURN_Z, theta=dh.theta)
    d = factor(DofKind.D, Motion.SLIDE_Z, d=dh.d)
    yield Motion.NONE, pose_matrix(connection.to_dh)
    yield from (alpha, along, theta, d) if form is DHForm.CRAIG else (theta, d, along, alpha)
    yield Motion.NONE, pose_matrix(connection.to_body)
