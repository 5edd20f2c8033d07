"""Connections in another dialect: joint types, limits, units, DH form, and poses as six numbers that a file can hold.

In the other DH form a connection has the same pose for every value of its joint; docs/format/kinematics.md has both.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..formats.writers import settled, written_limits
from ..model.dialects import RULES
from ..model.environment import Connection, DHForm, DHParameters, Dialect, JointLimits, JointType, MultiBody, Pose
from ..transforms import Array, dh_matrix, inverse, pose_matrix
from .scene_parts import Losses


def connections(robot: MultiBody, losses: Losses) -> tuple[Connection, ...]:
    """Return a robot's connections, in the same order."""
    _report_periodic(robot, losses)
    return tuple(_connection(c, robot, losses) for c in robot.connections)


def _connection(connection: Connection, robot: MultiBody, losses: Losses) -> Connection:
    _judge_joint(connection, losses)
    found = in_form(connection, robot.dh_form, losses.rules.dh_form)
    unit, dh = losses.rules.dh_angle, found.dh
    same = robot.dialect is losses.dialect
    return replace(
        found,
        dh=DHParameters(settled(dh.alpha, unit), dh.a, dh.d, settled(dh.theta, unit), dh.span),
        limits=_limits(found, losses),
        actuated=connection.actuated if same else "Actuated" if losses.rules.legacy_layout else None,
    )


def _judge_joint(connection: Connection, losses: Losses) -> None:
    joint, dialect = connection.joint, losses.dialect
    if joint in losses.rules.joints:
        return
    if joint is JointType.PRISMATIC:
        message = (
            f"the original planner of dialect {dialect} knows no Prismatic joints; written all "
            "the same, and read as a slide by env2mjcf"
        )
        losses.lost("ENV166", joint.value, message, span=connection.span)
        return
    message = f"dialect {dialect} has no {joint.value} joints"
    losses.refuse("ENV165", joint.value, message, hint="choose another dialect", span=connection.span)


def _limits(connection: Connection, losses: Losses) -> tuple[JointLimits, ...]:
    if losses.rules.limits:
        return written_limits(connection)
    turn = JointLimits(-math.pi, math.pi)
    narrow = next((x for x in connection.limits if x != turn), None)
    if narrow is not None:
        message = (
            f"dialect {losses.dialect} has no limits of joints; {narrow.lower:.6g} to {narrow.upper:.6g} "
            f"{'' if connection.joint is JointType.PRISMATIC else 'rad '}is lost"
        )
        losses.lost("ENV163", connection.joint.value, message, span=narrow.span or connection.span)
    return ()


def _report_periodic(robot: MultiBody, losses: Losses) -> None:
    if not RULES[robot.dialect].hinges_are_periodic or losses.rules.hinges_are_periodic:
        return
    hinge = next((c for c in robot.connections if c.joint is JointType.REVOLUTE), None)
    if hinge is not None:
        message = (
            f"hinges turn without end in dialect {robot.dialect}; in dialect {losses.dialect} they go from half a turn "
            "back to half a turn on, and not past it"
        )
        hint = "every pose is still reached"
        losses.lost("ENV164", robot.bodies[hinge.next].filename, message, hint=hint, span=hinge.span)


# Half a turn about x + z: what turned about x turns about z behind it, and the other way round.
_SWAP: Array = np.array([[0, 0, 1, 0], [0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1]], dtype=np.float64)


def swaps_angles(connection: Connection, source: DHForm, target: DHForm) -> bool:
    """Whether theta and alpha of a connection change their places between two forms."""
    return source is not target and connection.joint is JointType.SPHERICAL


def in_form(connection: Connection, source: DHForm, target: DHForm) -> Connection:
    """Return a connection in another DH form.

    `Rx(alpha) Tx(a)` stands in front of the joint in Craig's form and behind it in the standard one: where alpha does
    not move, both go into the fixed transform on their side, and what is left, `Rz(theta) Tz(d)`, is the same in both.
    A spherical joint moves alpha, too. With C half a turn about x + z,
    `Rx(alpha) Tx(a) Rz(theta) Tz(d) = C Rz(alpha) Tz(a) Tx(d) Rx(theta) C^-1`: the other form, with alpha and theta
    exchanged, and a and d.
    """
    dh = connection.dh
    if source is target or (dh.alpha == 0 and dh.a == 0 and connection.joint is not JointType.SPHERICAL):
        return connection
    before, after = pose_matrix(connection.to_dh), pose_matrix(connection.to_body)
    if connection.joint is JointType.SPHERICAL:
        return replace(
            connection,
            to_dh=six_numbers(before @ _SWAP),
            dh=DHParameters(dh.theta, dh.d, dh.a, dh.alpha, dh.span),
            to_body=six_numbers(inverse(_SWAP) @ after),
            limits=connection.limits[::-1],
        )
    twist = dh_matrix(source, dh.alpha, dh.a, 0.0, 0.0)
    left = DHParameters(0.0, 0.0, dh.d, dh.theta, dh.span)
    if source is DHForm.CRAIG:
        return replace(connection, to_dh=six_numbers(before @ twist), dh=left)
    return replace(connection, to_body=six_numbers(twist @ after), dh=left)


# All dialects have degrees in poses.
_DEGREE = RULES[Dialect.A].pose_angle
# Noise of a few products of matrices; it would spoil numbers such as 90.
_ANGLE_NOISE_DEGREES = 2e-13
_LENGTH_NOISE = 2e-15


def six_numbers(transform: Array) -> Pose:
    """Return the pose of a rigid transform (4, 4), angles to the last digit also where ry is a quarter turn.

    The angle about z comes first, then that about x is read from what is left when it is taken back, so that the
    product of all three is the rotation again however near a quarter turn ry is.
    """
    r = transform[:3, :3]
    level = math.hypot(r[0, 0], r[1, 0])
    rz = math.atan2(r[1, 0], r[0, 0]) if level > 1e-12 else 0.0
    s, c = math.sin(rz), math.cos(rz)
    rx = math.atan2(s * r[0, 2] - c * r[1, 2], c * r[1, 1] - s * r[0, 1])
    ry = math.atan2(-r[2, 0], level)
    x, y, z = transform[:3, 3]
    noise = _LENGTH_NOISE * (1 + float(np.abs(transform[:3, 3]).max()))
    return Pose((_length(x, noise), _length(y, noise), _length(z, noise)), (_angle(rx), _angle(ry), _angle(rz)))


def _length(value: float, noise: float) -> float:
    near = round(float(value), 12)
    return (near if abs(near - value) <= noise else float(value)) + 0.0


def _angle(value: float) -> float:
    degrees = value / _DEGREE
    near = round(degrees, 10)
    if abs(near - degrees) <= _ANGLE_NOISE_DEGREES:
        return near * _DEGREE + 0.0
    return settled(value, _DEGREE)
