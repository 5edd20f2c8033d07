"""Joints: DH connections become hinges and slides, free bases a freejoint, the other bases slides and a hinge.

And actuators, stiff enough to hold a robot up against gravity.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..diagnostics import DiagnosticLog
from ..geometry.assembly import RobotParts
from ..kinematics.qpos import joint_kinds
from ..kinematics.space import ConfigurationSpace
from ..kinematics.tree import Dof, DofKind
from ..model.environment import BaseKind
from ..transforms import inverse
from .markup import Element, add, number, numbers, tidy

STANDARD_GRAVITY = 9.80665
_BASE_AXES = {
    DofKind.X: ("slide", "1 0 0"),
    DofKind.Y: ("slide", "0 1 0"),
    DofKind.Z: ("slide", "0 0 1"),
    DofKind.RZ: ("hinge", "0 0 1"),
}
# A gain of m g r holds a link at one radian of error; this many times stiffer, at a hundredth.
_STIFFNESS = 100.0


def add_base_joints(element: Element, robot: RobotParts, body: int, names: Sequence[str]) -> None:
    """Append the joints of a base, named after its degrees of freedom; a free joint is named after its body."""
    dofs = robot.kinematics.dofs
    if robot.kinematics.tree.bases[body] is BaseKind.VOLUMETRIC_ROTATIONAL:
        add(element, "freejoint", name=robot.links[body].name)
        return
    for i, dof in enumerate(dofs):
        if dof.connection is None and dof.body == body:
            kind, axis = _BASE_AXES[dof.kind]
            add(element, "joint", name=names[i], type=kind, axis=axis)


def add_connection_joints(element: Element, robot: RobotParts, body: int, names: Sequence[str]) -> None:
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
        )


def _range(dof: Dof) -> str | None:
    """Periodic hinges and joints without limits have none."""
    if dof.periodic or math.isinf(dof.lower) or math.isinf(dof.upper):
        return None
    if dof.lower == dof.upper:
        # MuJoCo wants lower < upper; a joint that its limits hold in place gets the smallest play.
        return f"{number(dof.lower)} {number(math.nextafter(dof.upper, math.inf))}"
    return f"{number(dof.lower)} {number(dof.upper)}"


def add_actuators(root: Element, robots: Sequence[RobotParts], space: ConfigurationSpace, log: DiagnosticLog) -> None:
    """Append a critically damped `<position>` for every hinge and slide; a free base has none."""
    actuator = add(root, "actuator")
    for robot, slots, columns in zip(robots, space.slots, space.robot_slices, strict=True):
        free = [robot.links[s.body].name for s in slots if s.free]
        if free:
            log.info("MJC411", free[0], f"the free base of {free[0]} gets no actuator: it is not driven")
        for slot in slots:
            if slot.free:
                continue
            column = slot.columns[0]
            kind = robot.kinematics.dofs[column - columns.start].kind
            low, high = (float(limit[column] - space.shift[column]) for limit in (space.lower, space.upper))
            bounded = np.isfinite(low) and np.isfinite(high) and low < high and not space.periodic[column]
            add(
                actuator,
                "position",
                name=space.names[column],
                joint=space.names[column],
                kp=number(_gain(robot, slot.body, kind)),
                dampratio="1",
                ctrlrange=f"{number(low)} {number(high)}" if bounded else None,
            )
    if not len(actuator):
        root.remove(actuator)


def _gain(robot: RobotParts, body: int, kind: DofKind) -> float:
    """Return a gain for the mass and reach of all that hangs on a body, rounded to three digits."""
    connections, parent = robot.kinematics.multibody.connections, robot.kinematics.tree.parent
    inside = {body}
    for other in robot.kinematics.tree.order:
        k = parent[other]
        if k is not None and connections[k].previous in inside:
            inside.add(other)
    hanging = [robot.links[i] for i in sorted(inside)]
    mass = sum(p.inertial.mass for p in hanging if p.inertial is not None)
    origin = robot.links[body].pose[:3, 3]
    reach = max(float(np.linalg.norm(p.pose[:3, 3] - origin)) + p.radius for p in hanging)
    gain = _STIFFNESS * mass * STANDARD_GRAVITY * (1 / reach if kind.is_length else reach)
    return float(f"{gain:.3g}")
