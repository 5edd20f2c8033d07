"""Where joints stand in MuJoCo's qpos: robots in order, bodies depth first, joints in the order of the chain."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ..model.environment import BaseKind, DHForm, JointType
from .forward import RobotKinematics
from .tree import DofKind


@dataclass(frozen=True, slots=True)
class Slot:
    """Where a joint or free base of one body stands in MuJoCo's qpos.

    Attributes:
        body: Index of the body in its robot.
        columns: Columns of the configuration that it takes: six for a free base, else one.
        address: Its first entry in qpos.
        free: Whether it is a free joint: position and quaternion.
    """

    body: int
    columns: tuple[int, ...]
    address: int
    free: bool


def children_first_to_last(robot: RobotKinematics, body: int | None) -> list[int]:
    """Return the bodies that hang on a body, or the roots for None, in the order in which MJCF lists them."""
    if body is None:
        return sorted(robot.tree.bases)
    connections = robot.multibody.connections
    return [i for i, k in enumerate(robot.tree.parent) if k is not None and connections[k].previous == body]


def joint_kinds(robot: RobotKinematics, connection: int) -> tuple[DofKind, ...]:
    """Return a connection's joints in the order of the chain, as MJCF lists them.

    Craig's DH turns by alpha before theta, the standard form by theta before alpha.
    """
    joint = robot.multibody.connections[connection].joint
    if joint is JointType.SPHERICAL:
        craig = robot.multibody.dh_form is DHForm.CRAIG
        return (DofKind.ALPHA, DofKind.THETA) if craig else (DofKind.THETA, DofKind.ALPHA)
    kinds = {JointType.REVOLUTE: DofKind.THETA, JointType.PRISMATIC: DofKind.D}
    return (kinds[joint],) if joint in kinds else ()


def layout(robots: Sequence[RobotKinematics], slices: Sequence[slice]) -> tuple[tuple[tuple[Slot, ...], ...], int]:
    """Lay the joints out in qpos: robots in order, bodies depth first."""
    laid: list[tuple[Slot, ...]] = []
    address = 0
    for robot, columns in zip(robots, slices, strict=True):
        slots: list[Slot] = []
        for body, kinds, free in _joints_depth_first(robot):
            placed_by = robot.tree.parent[body]
            if placed_by is None:
                own = robot.base_columns(body)
            else:
                own = {kind: robot.columns[placed_by, kind] for kind in kinds}
            indices = tuple(columns.start + own[kind] for kind in kinds)
            for group in [indices] if free else [(i,) for i in indices]:
                slots.append(Slot(body, group, address, free))
                address += 7 if free else 1
        laid.append(tuple(slots))
    return tuple(laid), address


def _joints_depth_first(robot: RobotKinematics) -> Iterator[tuple[int, tuple[DofKind, ...], bool]]:
    stack = children_first_to_last(robot, None)[::-1]
    while stack:
        body = stack.pop()
        k = robot.tree.parent[body]
        if k is None:
            free = robot.tree.bases[body] is BaseKind.VOLUMETRIC_ROTATIONAL
            yield body, tuple(robot.base_columns(body)), free
        else:
            yield body, joint_kinds(robot, k), False
        stack += children_first_to_last(robot, body)[::-1]
