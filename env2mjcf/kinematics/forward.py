"""Forward kinematics of a robot, batched over configurations, in radians and the lengths of its multibody."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..diagnostics import DiagnosticLog
from ..model.environment import BaseKind, DHForm, Dialect, MultiBody, Pose
from ..system.locks import lasting
from .transforms import Array, dh_matrix, inverse, pose_matrix, rotation_matrix, transform, wrap
from .tree import Dof, DofKind, Tree, build_tree, degrees_of_freedom

_ROTATIONS = (DofKind.RX, DofKind.RY, DofKind.RZ)
_POSITIONS = (DofKind.X, DofKind.Y, DofKind.Z)


@dataclass(frozen=True)
class RobotKinematics:
    """A robot ready to be placed.

    Attributes:
        multibody: Its description.
        tree: What places each body.
        dofs: The numbers of its configuration, in the planner's order.
    """

    multibody: MultiBody
    tree: Tree
    dofs: tuple[Dof, ...]

    @classmethod
    def of(cls, multibody: MultiBody, log: DiagnosticLog | None = None) -> RobotKinematics:
        """Build the tree and the degrees of freedom of a multibody.

        Raises:
            KinematicsError: A body is neither a base nor reached from one.
        """
        tree = build_tree(multibody, DiagnosticLog() if log is None else log)
        return cls(multibody, tree, degrees_of_freedom(multibody, tree))

    @property
    def dim(self) -> int:
        """Number of degrees of freedom."""
        return len(self.dofs)

    def forward(self, q: ArrayLike) -> Array:
        """Place every body.

        Args:
            q: Configurations, (..., dim).

        Returns:
            World poses of the bodies in file order, (..., nbodies, 4, 4).
        """
        values = np.asarray(q, dtype=np.float64)
        poses = np.empty((*values.shape[:-1], len(self.multibody.bodies), 4, 4))
        for body in self.tree.order:
            k = self.tree.parent[body]
            if k is None:
                poses[..., body, :, :] = self._base(body, values)
            else:
                previous = self.multibody.connections[k].previous
                poses[..., body, :, :] = poses[..., previous, :, :] @ self.step(k, values)
        return poses

    def step(self, k: int, q: ArrayLike) -> Array:
        """Return the pose of a connection's next body in its previous one's frame, (..., 4, 4)."""
        values = np.asarray(q, dtype=np.float64)
        connection = self.multibody.connections[k]
        dh = connection.dh
        alpha, d, theta = (
            self._value(k, kind, values, default)
            for kind, default in ((DofKind.ALPHA, dh.alpha), (DofKind.D, dh.d), (DofKind.THETA, dh.theta))
        )
        row = dh_matrix(self.multibody.dh_form, alpha, dh.a, d, theta)
        return pose_matrix(connection.to_dh) @ row @ pose_matrix(connection.to_body)

    def joint_frames(self, k: int, q: ArrayLike) -> dict[DofKind, Array]:
        """Return where each elementary motion of a connection acts, (4, 4) in its previous body's frame, for one q.

        Theta turns about z and d slides along z of its frame, alpha turns about x.
        """
        values = np.asarray(q, dtype=np.float64)
        connection, dh = self.multibody.connections[k], self.multibody.connections[k].dh
        alpha = float(self._value(k, DofKind.ALPHA, values, dh.alpha))
        theta = float(self._value(k, DofKind.THETA, values, dh.theta))
        d = float(self._value(k, DofKind.D, values, dh.d))
        start = pose_matrix(connection.to_dh)

        def after(alpha: float, a: float, d: float, theta: float) -> Array:
            return start @ dh_matrix(self.multibody.dh_form, alpha, a, d, theta)

        if self.multibody.dh_form is DHForm.CRAIG:
            return {
                DofKind.ALPHA: start,
                DofKind.THETA: after(alpha, dh.a, 0, 0),
                DofKind.D: after(alpha, dh.a, 0, theta),
            }
        return {DofKind.THETA: start, DofKind.D: after(0, 0, 0, theta), DofKind.ALPHA: after(0, dh.a, d, theta)}

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
            apart = inverse(expected) @ poses[..., connection.next, :, :]
            cosine = np.clip((np.trace(apart[..., :3, :3], axis1=-2, axis2=-1) - 1) / 2, -1, 1)
            # A point at distance r from the axis of a turn by w moves by 2 r sin(w / 2).
            turn = 2 * radii[connection.next] * np.sqrt((1 - cosine) / 2)
            gaps[..., n] = np.linalg.norm(apart[..., :3, 3], axis=-1) + turn
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
                return pose.position[_POSITIONS.index(dof.kind)]
            return float(wrap(pose.rotation[_ROTATIONS.index(dof.kind)]))
        dh = self.multibody.connections[dof.connection].dh
        value = {DofKind.THETA: dh.theta, DofKind.ALPHA: dh.alpha, DofKind.D: dh.d}[dof.kind]
        return value if dof.kind.is_length else float(wrap(value))

    def _base(self, body: int, q: Array) -> Array:
        kind = self.tree.bases[body]
        if kind is BaseKind.FIXED:
            return pose_matrix(self.multibody.bodies[body].pose)
        zeros = np.zeros(q.shape[:-1])
        value = {d.kind: q[..., i] for i, d in enumerate(self.dofs) if d.connection is None and d.body == body}
        rotation = rotation_matrix(*(value.get(k, zeros) for k in _ROTATIONS))
        return transform(rotation, np.stack([value.get(k, zeros) for k in _POSITIONS], axis=-1))

    @lasting
    def _columns(self) -> dict[tuple[int, DofKind], int]:
        return {(d.connection, d.kind): i for i, d in enumerate(self.dofs) if d.connection is not None}

    def _value(self, k: int, kind: DofKind, q: Array, default: float) -> Array:
        column = self._columns.get((k, kind))
        return np.asarray(default) if column is None else q[..., column]

    def _arm(self, k: int, slide: Sequence[float]) -> float:
        """Length of the way from a connection's DH frame to the origin of its next body."""
        connection = self.multibody.connections[k]
        column = self._columns.get((k, DofKind.D))
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
