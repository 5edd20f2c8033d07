"""Closed loops: a connection that places no body becomes an equality for the simulation."""

from __future__ import annotations

import numpy as np

from ..diagnostics import DiagnosticLog
from ..geometry.assembly import RobotParts
from ..kinematics.tree import DofKind
from ..model.environment import JointType
from ..transforms import Array, inverse, quaternion_from_matrix
from .links import Compilation
from .markup import Element, add, numbers, tidy

CLOSED = 1e-6
"""A loop counts as closed at home below this fraction of the scene's extent."""


def add_loops(root: Element, compilation: Compilation, log: DiagnosticLog) -> None:
    """Append `<equality>`: sites on the connection's DH axis, joined as the joint allows."""
    equality = add(root, "equality")
    tolerance = CLOSED * compilation.assembly.extent
    for robot in compilation.assembly.robots:
        gaps = robot.kinematics.loop_gaps(robot.home, [p.radius for p in robot.links])
        for k, gap in zip(robot.kinematics.tree.loops, gaps, strict=True):
            closed = _axis_gap(robot, k) <= tolerance
            if not closed:
                _report_open(robot, k, float(gap), log)
            _add_loop(equality, robot, k, closed, compilation, log)
    if not len(equality):
        root.remove(equality)


def _add_loop(
    equality: Element, robot: RobotParts, k: int, closed: bool, compilation: Compilation, log: DiagnosticLog
) -> None:
    connection = robot.kinematics.multibody.connections[k]
    here, there = _frames(robot, k)
    previous, following = robot.links[connection.previous], robot.links[connection.next]
    name = f"{following.name}:loop{k}"
    active = None if closed else "false"

    def sites(suffix: str, offset: Array, turned: bool) -> tuple[str, str]:
        names = f"{name}:{suffix}a", f"{name}:{suffix}b"
        for site, part, frame in zip(names, (previous, following), (here, there), strict=True):
            place = tidy(frame[:3, :3] @ offset + frame[:3, 3])
            quat = numbers(tidy(quaternion_from_matrix(frame[:3, :3]))) if turned else None
            add(compilation.elements[part.name], "site", name=site, pos=numbers(place), quat=quat, group="5")
        return names

    origin = np.zeros(3)
    if connection.joint is JointType.NON_ACTUATED:
        a, b = sites("", origin, True)
        add(equality, "weld", name=name, site1=a, site2=b, active=active)
        return
    if connection.joint is JointType.PRISMATIC:
        message = (
            f"the loop of {previous.name} and {following.name} closes by a slide, "
            "which MuJoCo cannot express as an equality; the simulation leaves it open"
        )
        log.info("MJC410", following.name, message, span=connection.span)
        return
    # One point leaves a ball joint; a second one on the same axis leaves the hinge.
    axis = np.array([0.0, 0.0, max(previous.radius, following.radius)])
    offsets = [("0", origin)] if connection.joint is JointType.SPHERICAL else [("0", origin), ("1", axis)]
    for suffix, offset in offsets:
        a, b = sites(suffix, offset, False)
        add(equality, "connect", name=f"{name}:{suffix}", site1=a, site2=b, active=active)


def loop_points(robot: RobotParts, tolerance: float) -> list[tuple[int, int, Array]]:
    """Return the pairs of bodies that loops closed at home join, and points that they share, (3,) in the world.

    Args:
        robot: The robot.
        tolerance: Length below which a loop counts as closed.
    """
    found: list[tuple[int, int, Array]] = []
    for k in robot.kinematics.tree.loops:
        connection = robot.kinematics.multibody.connections[k]
        if connection.joint is JointType.PRISMATIC or _axis_gap(robot, k) > tolerance:
            continue
        frame = robot.links[connection.previous].pose @ _frames(robot, k)[0]
        length = max(robot.links[connection.previous].radius, robot.links[connection.next].radius)
        places = [frame[:3, 3]]
        if connection.joint is not JointType.SPHERICAL:
            columns = (0, 1, 2) if connection.joint is JointType.NON_ACTUATED else (2,)
            places += [frame[:3, 3] + length * frame[:3, c] for c in columns]
        found += [(connection.previous, connection.next, p) for p in places]
    return found


def _frames(robot: RobotParts, k: int) -> tuple[Array, Array]:
    """Return the frame on whose z axis the loop turns, in its previous and in its next body.

    A slide or weld is taken at the end of the chain, where the next body's own frame lies.
    """
    kinematics = robot.kinematics
    frame = kinematics.joint_frames(k, robot.home)[DofKind.THETA]
    if kinematics.multibody.connections[k].joint is JointType.NON_ACTUATED:
        return kinematics.step(k, robot.home), np.eye(4)
    return frame, inverse(kinematics.step(k, robot.home)) @ frame


def _axis_gap(robot: RobotParts, k: int) -> float:
    """Return how far the two halves of a loop are apart at home: at two points of the axis, or in all for a weld."""
    connection = robot.kinematics.multibody.connections[k]
    here, there = _frames(robot, k)
    a = robot.links[connection.previous].pose @ here
    b = robot.links[connection.next].pose @ there
    length = max(robot.links[connection.previous].radius, robot.links[connection.next].radius)
    columns = (0, 1, 2) if connection.joint is JointType.NON_ACTUATED else (2,)
    points = [(a[:3, 3], b[:3, 3])]
    if connection.joint is not JointType.SPHERICAL:
        points += [(a[:3, 3] + length * a[:3, c], b[:3, 3] + length * b[:3, c]) for c in columns]
    return max(float(np.linalg.norm(p - q)) for p, q in points)


def _report_open(robot: RobotParts, k: int, gap: float, log: DiagnosticLog) -> None:
    connection = robot.kinematics.multibody.connections[k]
    a, b = robot.links[connection.previous].name, robot.links[connection.next].name
    message = f"the loop of {a} and {b} is open by {gap:.3g} m at home; its equality is written, but inactive"
    log.warn("KIN311", b, message, hint="give the connections the theta values of a closed pose", span=connection.span)
