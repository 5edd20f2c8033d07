"""Poses of a robot's bodies from its configuration, and back; batched, in radians and the lengths of its multibody."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..diagnostics import DiagnosticLog
from ..model.environment import BaseKind, DHForm, Dialect, MultiBody, Pose
from ..system.locks import lazy_property
from ..transforms import (
    Array,
    angles_from_quaternion,
    dh_matrix,
    inverse,
    pose_gaps,
    pose_matrix,
    quaternion_from_matrix,
    rotation_matrix,
    transform,
    wrap,
)
from .tree import POSITIONS, ROTATIONS, Dof, DofKind, Tree, build_tree, degrees_of_freedom


@dataclass(frozen=True)
class RobotKinematics:
    """A robot ready to be placed.

    Attributes:
        multibody: Its description.
        tree: What places each body.
        dofs: The numbers of its configuration, in the planner's order.
        origin: Where the origin of the poses lies in the file's frame, to which configurations and bodies refer.
    """

    multibody: MultiBody
    tree: Tree
    dofs: tuple[Dof, ...]
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @classmethod
    def of(cls, multibody: MultiBody, log: DiagnosticLog | None = None) -> RobotKinematics:
        """Build the tree and the degrees of freedom of a multibody.

        Raises:
            KinematicsError: A body is neither a base nor reached from one.
        """
        tree = build_tree(multibody, DiagnosticLog() if log is None else log)
        return cls(multibody, tree, degrees_of_freedom(multibody, tree))

    @property
    def travels(self) -> bool:
        """Whether all its bases move about, so that its place at home says little."""
        moving = {d.body for d in self.dofs if d.connection is None and d.kind.is_length}
        return bool(self.tree.bases) and moving == set(self.tree.bases)

    @property
    def dim(self) -> int:
        """Number of degrees of freedom."""
        return len(self.dofs)

    def forward(self, q: ArrayLike) -> Array:
        """Place every body.

        Args:
            q: Configurations, (..., dim).

        Returns:
            World poses of the bodies in file order, about `origin`, (..., nbodies, 4, 4).
        """
        values = np.asarray(q, dtype=np.float64)
        poses = np.empty((*values.shape[:-1], len(self.multibody.bodies), 4, 4))
        for body in self.tree.order:
            k = self.tree.parent[body]
            if k is None:
                poses[..., body, :, :] = self.base_pose(body, values)
            else:
                previous = self.multibody.connections[k].previous
                poses[..., body, :, :] = poses[..., previous, :, :] @ self.step(k, values)
        return poses

    def step(self, k: int, q: ArrayLike) -> Array:
        """Return the pose of a connection's next body in its previous one's frame, (..., 4, 4)."""
        connection = self.multibody.connections[k]
        alpha, d, theta = self._dh_values(k, np.asarray(q, dtype=np.float64))
        row = dh_matrix(self.multibody.dh_form, alpha, connection.dh.a, d, theta)
        return pose_matrix(connection.to_dh) @ row @ pose_matrix(connection.to_body)

    def joint_frames(self, k: int, q: ArrayLike) -> dict[DofKind, Array]:
        """Return where each elementary motion of a connection acts, (4, 4) in its previous body's frame, for one q.

        Theta turns about z and d slides along z of its frame, alpha turns about x.
        """
        connection = self.multibody.connections[k]
        alpha, d, theta = self._dh_values(k, np.asarray(q, dtype=np.float64))
        start, a = pose_matrix(connection.to_dh), connection.dh.a

        def after(alpha: ArrayLike, a: float, d: ArrayLike, theta: ArrayLike) -> Array:
            return start @ dh_matrix(self.multibody.dh_form, alpha, a, d, theta)

        if self.multibody.dh_form is DHForm.CRAIG:
            return {DofKind.ALPHA: start, DofKind.THETA: after(alpha, a, 0, 0), DofKind.D: after(alpha, a, 0, theta)}
        return {DofKind.THETA: start, DofKind.D: after(0, 0, 0, theta), DofKind.ALPHA: after(0, a, d, theta)}

    def loop_gaps(self, q: ArrayLike, radii: Sequence[float]) -> Array:
        """Return how far each loop is from closed, (..., nloops).

        The greatest distance, over a ball of radius `radii[body]` about the loop's last body, between where the tree
        puts a point and where the loop's own connection would put it.
        """
        values = np.asarray(q, dtype=np.float64)
        poses = self.forward(values)
        gaps = np.zeros((*values.shape[:-1], len(self.tree.loops)))
        for n, k in enumerate(self.tree.loops):
            connection = self.multibody.connections[k]
            expected = poses[..., connection.previous, :, :] @ self.step(k, values)
            gaps[..., n] = pose_gaps(poses[..., connection.next, :, :], expected, radii[connection.next])
        return gaps

    def home(self, log: DiagnosticLog | None = None) -> Array:
        """Return the configuration that the file describes, (dim,).

        Joint values are reduced by whole turns, then clipped to their limits, each clipping with a diagnostic.
        """
        log = DiagnosticLog() if log is None else log
        q = np.array([self._home_value(d) for d in self.dofs], dtype=np.float64)
        for i, dof in enumerate(self.dofs):
            if dof.connection is None or dof.periodic or dof.lower <= q[i] <= dof.upper:
                continue
            clipped = float(np.clip(q[i], dof.lower, dof.upper))
            connection = self.multibody.connections[dof.connection]
            name = self.multibody.bodies[dof.body].filename
            message = (
                f"{dof.kind} of {name} is {q[i]:.6g} in the file, outside its limits {dof.lower:.6g} to "
                f"{dof.upper:.6g}; home has {clipped:.6g}"
            )
            log.warn("KIN310", name, message, span=connection.dh.span)
            q[i] = clipped
        return q

    def levers(self, radii: Sequence[float], slide: Sequence[float]) -> Array:
        """Bound how far any point of each body moves for a unit of each degree of freedom, (dim, nbodies).

        A turn moves a point by its distance from the axis, which is no longer than the way along the chain.

        Args:
            radii: For each body the greatest distance of a vertex from its origin.
            slide: For each degree of freedom that is a slide, the greatest absolute value it takes; others unused.
        """
        arms = [self._arm(k, slide) for k in range(len(self.multibody.connections))]
        reach = self._reaches(radii, arms)
        levers = np.zeros((self.dim, len(radii)))
        for i, dof in enumerate(self.dofs):
            if dof.loop:
                continue
            moved = np.isfinite(reach[dof.body])
            arm = 0.0 if dof.connection is None else arms[dof.connection]
            levers[i, moved] = 1.0 if dof.kind.is_length else arm + reach[dof.body][moved]
        return levers

    def _home_value(self, dof: Dof) -> float:
        if dof.connection is None:
            pose = self.multibody.bodies[dof.body].pose
            # Only dialect A gives a base pose with a free base; elsewhere the base starts at the origin.
            if pose is None or self.multibody.dialect is not Dialect.A:
                return 0.0
            if dof.kind.is_length:
                return pose.position[POSITIONS.index(dof.kind)]
            return float(wrap(pose.rotation[ROTATIONS.index(dof.kind)]))
        dh = self.multibody.connections[dof.connection].dh
        value = {DofKind.THETA: dh.theta, DofKind.ALPHA: dh.alpha, DofKind.D: dh.d}[dof.kind]
        return value if dof.kind.is_length else float(wrap(value))

    def base_pose(self, body: int, q: Array) -> Array:
        """Return the pose of a base about `origin`, (..., 4, 4)."""
        # What is far away cancels before anything is rounded.
        if self.tree.bases[body] is BaseKind.FIXED:
            pose = pose_matrix(self.multibody.bodies[body].pose)
            return transform(pose[:3, :3], pose[:3, 3] - self.origin)
        zeros = np.zeros(q.shape[:-1])
        value = {kind: q[..., i] for kind, i in self.base_columns(body).items()}
        rotation = rotation_matrix(*(value.get(k, zeros) for k in ROTATIONS))
        return transform(rotation, np.stack([value.get(k, zeros) for k in POSITIONS], axis=-1) - self.origin)

    def base_columns(self, body: int) -> dict[DofKind, int]:
        """Return the place in a configuration of each degree of freedom of a body's base; none where it has none."""
        return self._base_columns.get(body, {})

    @lazy_property
    def _base_columns(self) -> dict[int, dict[DofKind, int]]:
        columns: dict[int, dict[DofKind, int]] = {}
        for i, dof in enumerate(self.dofs):
            if dof.connection is None:
                columns.setdefault(dof.body, {})[dof.kind] = i
        return columns

    @lazy_property
    def columns(self) -> dict[tuple[int, DofKind], int]:
        """The place in a configuration of each degree of freedom of a connection."""
        return {(d.connection, d.kind): i for i, d in enumerate(self.dofs) if d.connection is not None}

    def _dh_values(self, k: int, q: Array) -> tuple[Array, Array, Array]:
        """Return alpha, d and theta of a connection: the file's, but where a degree of freedom replaces one."""

        def value(kind: DofKind, default: float) -> Array:
            column = self.columns.get((k, kind))
            return np.asarray(default) if column is None else q[..., column]

        dh = self.multibody.connections[k].dh
        return value(DofKind.ALPHA, dh.alpha), value(DofKind.D, dh.d), value(DofKind.THETA, dh.theta)

    def _arm(self, k: int, slide: Sequence[float]) -> float:
        """Length of the way from a connection's DH frame to the origin of its next body."""
        connection = self.multibody.connections[k]
        column = self.columns.get((k, DofKind.D))
        d = abs(connection.dh.d) if column is None else slide[column]
        return abs(connection.dh.a) + d + _norm(connection.to_body)

    def _reaches(self, radii: Sequence[float], arms: Sequence[float]) -> Array:
        """Bound the distance of the points of a body from the origin of another, (nbodies, nbodies).

        Rows: the body whose origin it is; columns: the bodies that it carries; -inf for others.
        """
        reach = np.full((len(radii), len(radii)), -np.inf)
        for body in reversed(self.tree.order):
            reach[body, body] = radii[body]
            k = self.tree.parent[body]
            if k is not None:
                connection = self.multibody.connections[k]
                way = _norm(connection.to_dh) + arms[k]
                # Each body is reached in one way, so that a maximum only replaces what is not there.
                reach[connection.previous] = np.maximum(reach[connection.previous], way + reach[body])
        return reach


def _norm(pose: Pose) -> float:
    return float(np.linalg.norm(pose.position))


def configuration_of_poses(robot: RobotKinematics, poses: Array) -> Array:
    """Return the configurations that put bodies where they are, (..., dim).

    A base is read off its pose. A joint is read off the poses of the two bodies that its connection joins, so that an
    error of one pose does not travel along the chain; loop-closing joints are read off in the same way. Poses that no
    configuration has give the values that turn and slide the bodies nearest to them, joint by joint.

    Args:
        robot: The robot.
        poses: World poses of its bodies in file order, (..., nbodies, 4, 4).
    """
    q = np.zeros((*poses.shape[:-3], robot.dim))
    rows = {k: _joint_values(robot, k, poses) for k in {d.connection for d in robot.dofs} if k is not None}
    bases = {b: _base_values(poses[..., b, :, :]) for b in {d.body for d in robot.dofs if d.connection is None}}
    for i, dof in enumerate(robot.dofs):
        q[..., i] = bases[dof.body][dof.kind] if dof.connection is None else rows[dof.connection][dof.kind]
    return q


def _base_values(pose: Array) -> dict[DofKind, Array]:
    angles = angles_from_quaternion(quaternion_from_matrix(pose[..., :3, :3]))
    positions = np.moveaxis(pose[..., :3, 3], -1, 0)
    return {**dict(zip(POSITIONS, positions, strict=True)), **dict(zip(ROTATIONS, angles, strict=True))}


def _joint_values(robot: RobotKinematics, k: int, poses: Array) -> dict[DofKind, Array]:
    """Return theta, alpha and d of a connection between bodies at some poses."""
    connection = robot.multibody.connections[k]
    between = inverse(poses[..., connection.previous, :, :]) @ poses[..., connection.next, :, :]
    row = inverse(pose_matrix(connection.to_dh)) @ between @ inverse(pose_matrix(connection.to_body))
    craig = robot.multibody.dh_form is DHForm.CRAIG
    moves_alpha = (k, DofKind.ALPHA) in robot.columns
    if not moves_alpha:
        alpha = np.full(row.shape[:-2], connection.dh.alpha)
    elif craig:
        alpha = np.arctan2(-row[..., 1, 2], row[..., 2, 2])
    else:
        alpha = np.arctan2(row[..., 2, 1], row[..., 2, 2])
    back = rotation_matrix(-alpha, np.zeros_like(alpha), np.zeros_like(alpha))
    turn = back @ row[..., :3, :3] if craig else row[..., :3, :3] @ back
    # Both columns count, so that rounding of one does not.
    theta = np.arctan2(turn[..., 1, 0] - turn[..., 0, 1], turn[..., 0, 0] + turn[..., 1, 1])
    offset = row[..., :3, 3]
    d = (back @ offset[..., None])[..., 2, 0] if craig else offset[..., 2]
    return {DofKind.THETA: theta, DofKind.ALPHA: alpha, DofKind.D: d}
