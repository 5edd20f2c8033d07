"""Connections in another dialect: joint types, limits, units."""

from __future__ import annotations

import math
from dataclasses import replace

from ..dialects import RULES
from ..formats.writers.connections import written_limits
from ..formats.writers.decimals import settled
from ..model import Connection, DHParameters, JointLimits, JointType, MultiBody
from .dh import in_form
from .losses import Losses


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
        actuated=connection.actuated if same else "Actuated" if losses.vocabulary.legacy_layout else None,
    )


def _judge_joint(connection: Connection, losses: Losses) -> None:
    joint, dialect = connection.joint, losses.dialect
    if joint in losses.vocabulary.joints:
        return
    if joint is JointType.PRISMATIC:
        losses.lost(
            "ENV166", joint.value, f"the original planner of dialect {dialect} knows no Prismatic joints; written all "
            "the same, and read as a slide by env2mjcf", "", connection.span,
        )  # fmt: skip
        return
    losses.refuse(
        "ENV165",
        joint.value,
        f"dialect {dialect} has no {joint.value} joints",
        "choose another dialect",
        connection.span,
    )


def _limits(connection: Connection, losses: Losses) -> tuple[JointLimits, ...]:
    if losses.vocabulary.limits:
        return written_limits(connection)
    turn = JointLimits(-math.pi, math.pi)
    narrow = next((x for x in connection.limits if x != turn), None)
    if narrow is not None:
        losses.lost(
            "ENV163", connection.joint.value,
            f"dialect {losses.dialect} has no limits of joints; {narrow.lower:.6g} to {narrow.upper:.6g} "
            f"{'' if connection.joint is JointType.PRISMATIC else 'rad '}is lost", "", narrow.span or connection.span,
        )  # fmt: skip
    return ()


def _report_periodic(robot: MultiBody, losses: Losses) -> None:
    if not RULES[robot.dialect].hinges_are_periodic or losses.rules.hinges_are_periodic:
        return
    hinge = next((c for c in robot.connections if c.joint is JointType.REVOLUTE), None)
    if hinge is not None:
        losses.lost(
            "ENV164", robot.bodies[hinge.next].filename,
            f"hinges turn without end in dialect {robot.dialect}; in dialect {losses.dialect} they go from half a turn "
            "back to half a turn on, and not past it", "every pose is still reached", hinge.span,
        )  # fmt: skip
