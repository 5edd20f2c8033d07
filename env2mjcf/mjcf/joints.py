"""Joints: DH connections become hinges and slides, free bases a freejoint, the other bases slides and a hinge."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ..geometry.assembly import RobotParts
from ..kinematics.qpos import joint_kinds
from ..kinematics.tree import Dof, DofKind
from ..model.environment import BaseKind
from ..transforms import inverse, pose_matrix
from .markup import Element, add, number, numbers, tidy

STANDARD_GRAVITY = 9.80665
_BASE_AXES = {
    DofKind.X: ("slide", "1 0 0"),
    DofKind.Y: ("slide", "0 1 0"),
    DofKind.Z: ("slide", "0 0 1"),
    DofKind.RZ: ("hinge", "0 0 1"),
}


def add_base_joints(
    element: Element, robot: RobotParts, body: int, names: Sequence[str], dampings: Mapping[str, float]
) -> None:
    """Append the joints of a base, named after its degrees of freedom; a free joint is named after its body."""
    dofs = robot.kinematics.dofs
    if robot.kinematics.tree.bases[body] is BaseKind.VOLUMETRIC_ROTATIONAL:
        add(element, "freejoint", name=robot.links[body].name)
        return
    for i, dof in enumerate(dofs):
        if dof.connection is None and dof.body == body:
            kind, axis = _BASE_AXES[dof.kind]
            add(element, "joint", name=names[i], type=kind, axis=axis, damping=_damping(dampings, names[i]))


def add_connection_joints(
    element: Element, robot: RobotParts, body: int, names: Sequence[str], dampings: Mapping[str, float]
) -> None:
    """Append the joints of the connection that places a body, in the order of its chain.

    The body stands at home, so each joint's `ref` is its home value and the joint's value replaces the DH one.
    """
    k = robot.kinematics.tree.parent[body]
    assert k is not None
    frames = robot.kinematics.joint_frames(k, robot.home)
    child_from_previous = inverse(robot.kinematics.step(k, robot.home))
    for kind in joint_kinds(robot.kinematics, k):
        column = next(i for i, d in enumerate(robot.kinematics.dofs) if d.connection == k and d.kind is kind)
        frame = child_from_previous @ frames[kind]
        axis = frame[:3, 0] if kind is DofKind.ALPHA else frame[:3, 2]
        dof = robot.kinematics.dofs[column]
        add(
            element,
            "joint",
            name=names[column],
            type="slide" if kind is DofKind.D else "hinge",
            pos=numbers(tidy(frame[:3, 3])),
            axis=numbers(tidy(axis)),
            range=_range(dof),
            ref=number(robot.home[column]) if robot.home[column] else None,
            damping=_damping(dampings, names[column]),
        )


def _damping(dampings: Mapping[str, float], name: str) -> str | None:
    return number(dampings[name]) if name in dampings else None


def _range(dof: Dof) -> str | None:
    """Periodic hinges and joints without limits have none."""
    if dof.periodic or math.isinf(dof.lower) or math.isinf(dof.upper):
        return None
    if dof.lower == dof.upper:
        # MuJoCo wants lower < upper; a joint that its limits hold in place gets the smallest play.
        return f"{number(dof.lower)} {number(math.nextafter(dof.upper, math.inf))}"
    return f"{number(dof.lower)} {number(dof.upper)}"


def add_tool(element: Element, robot: RobotParts, name: str) -> None:
    """Append a site at the DH frame of a robot's last link, as which inverse kinematics takes its tool."""
    k = robot.kinematics.tree.parent[len(robot.links) - 1]
    to_body = None if k is None else robot.kinematics.multibody.connections[k].to_body
    frame = np.eye(4) if to_body is None else inverse(pose_matrix(to_body))
    place = {"pos": numbers(tidy(frame[:3, 3])), "xyaxes": numbers(tidy(frame[:3, :2].T.ravel()))}
    add(element, "site", name=name, group="5", **place)
