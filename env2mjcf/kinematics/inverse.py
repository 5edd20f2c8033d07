"""The configuration of a robot out of the world poses of its bodies, batched, in radians and metres."""

from __future__ import annotations

import numpy as np

from ..model.environment import DHForm
from .forward import RobotKinematics
from .transforms import Array, angles_from_quaternion, inverse, pose_matrix, quaternion_from_matrix, rotation_matrix
from .tree import DofKind

_POSITIONS = (DofKind.X, DofKind.Y, DofKind.Z)
_ROTATIONS = (DofKind.RX, DofKind.RY, DofKind.RZ)


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
    rows = {k: _dh_values(robot, k, poses) for k in {d.connection for d in robot.dofs} if k is not None}
    bases = {b: _base_values(poses[..., b, :, :]) for b in {d.body for d in robot.dofs if d.connection is None}}
    for i, dof in enumerate(robot.dofs):
        q[..., i] = bases[dof.body][dof.kind] if dof.connection is None else rows[dof.connection][dof.kind]
    return q


def pose_gaps(found: Array, expected: Array, radii: Array) -> Array:
    """Return how far bodies are from where they should be, (..., nbodies).

    An upper bound of the distance over a ball about each body's origin: how far that is off, and twice the radius
    times the sine of half the turn.

    Args:
        found: Poses, (..., nbodies, 4, 4).
        expected: Where they should be, of the same shape.
        radii: (nbodies,) greatest distance of a vertex from the origin.
    """
    moved = np.linalg.norm(found[..., :3, 3] - expected[..., :3, 3], axis=-1)
    # |R1 - R2| (Frobenius) is 2 sqrt(2) sin(w / 2) for a turn by w, and keeps its digits where w is small.
    turned = np.linalg.norm(found[..., :3, :3] - expected[..., :3, :3], axis=(-2, -1)) / np.sqrt(2)
    return moved + turned * radii


def _base_values(pose: Array) -> dict[DofKind, Array]:
    angles = angles_from_quaternion(quaternion_from_matrix(pose[..., :3, :3]))
    positions = np.moveaxis(pose[..., :3, 3], -1, 0)
    return {**dict(zip(_POSITIONS, positions, strict=True)), **dict(zip(_ROTATIONS, angles, strict=True))}


def _dh_values(robot: RobotKinematics, k: int, poses: Array) -> dict[DofKind, Array]:
    """Return theta, alpha and d of a connection."""
    connection = robot.multibody.connections[k]
    between = inverse(poses[..., connection.previous, :, :]) @ poses[..., connection.next, :, :]
    row = inverse(pose_matrix(connection.to_dh)) @ between @ inverse(pose_matrix(connection.to_body))
    craig = robot.multibody.dh_form is DHForm.CRAIG
    moves_alpha = any(d.connection == k and d.kind is DofKind.ALPHA for d in robot.dofs)
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
