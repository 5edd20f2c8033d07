"""Position actuators, stiff enough to hold a robot up against gravity."""

from __future__ import annotations

import numpy as np

from ..diagnostics import DiagnosticLog
from ..geometry.assembly import Part, RobotParts
from ..kinematics.tree import DofKind
from .links import Compilation
from .markup import Element, add, number

# A gain of m g r holds a link at one radian of error; this many times stiffer, at a hundredth.
_STIFFNESS = 100.0
_STANDARD_GRAVITY = 9.80665


def add_actuators(root: Element, compilation: Compilation, log: DiagnosticLog) -> None:
    """Append a critically damped `<position>` for every hinge and slide; a free base has none."""
    actuator = add(root, "actuator")
    space = compilation.space
    for robot, slots, columns in zip(compilation.assembly.robots, space.slots, space.robot_slices, strict=True):
        free = [robot.links[s.body].name for s in slots if s.free]
        if free:
            log.info("MJC411", free[0], f"the free base of {free[0]} gets no actuator: it is not driven")
        for slot in slots:
            if slot.free:
                continue
            column = slot.columns[0]
            kind = robot.kinematics.dofs[column - columns.start].kind
            low, high = float(space.lower[column]), float(space.upper[column])
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
    hanging = _hanging(robot, body)
    mass = sum(p.inertial.mass for p in hanging if p.inertial is not None)
    origin = robot.links[body].pose[:3, 3]
    reach = max(float(np.linalg.norm(p.pose[:3, 3] - origin)) + p.radius for p in hanging)
    gain = _STIFFNESS * mass * _STANDARD_GRAVITY * (1 / reach if kind.is_length else reach)
    return float(f"{gain:.3g}")


def _hanging(robot: RobotParts, body: int) -> list[Part]:
    connections, parent = robot.kinematics.multibody.connections, robot.kinematics.tree.parent
    inside = {body}
    for other in robot.kinematics.tree.order:
        k = parent[other]
        if k is not None and connections[k].previous in inside:
            inside.add(other)
    return [robot.links[i] for i in sorted(inside)]
