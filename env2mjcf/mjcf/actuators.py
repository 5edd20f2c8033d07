"""Actuators that hold: gains by weight and reach, damping by the coupled motion of all joints, bounded forces.

Damping is proportional to stiffness, c K, with c = 2 / w for the least frequency w of M^-1 K: every mode of the coupled
motion is damped critically or more, and none swings. It stands in the joints, where MuJoCo integrates it implicitly and
outside the bounds of forces. A step h of implicitfast is then stable for all modes where h < 2 c: with V = c K the
update of a mode of frequency w has its roots within the unit circle if (h w)^2 < 4 + 2 h c w^2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..diagnostics import DiagnosticLog
from ..geometry.assembly import RobotParts
from ..kinematics.space import ConfigurationSpace
from ..kinematics.tree import POSITIONS, ROTATIONS, DofKind
from ..options import Actuators
from ..transforms import Array, matrix_from_quaternion
from .joints import STANDARD_GRAVITY
from .loops import loop_points
from .markup import Element, add, comment, number

# A gain of m g r holds a link at one radian of error; this many times stiffer, at a hundredth.
_STIFFNESS = 100.0

# Forces of this many weights, at most: without a bound, a far target pushes a robot through walls.
_WEIGHTS = 5.0

# Configurations at which the least frequency is looked for, besides the keys.
_SAMPLES = 4


@dataclass(frozen=True, slots=True)
class Drive:
    """What moves a joint.

    Attributes:
        joint: Name of the joint, and of its actuator.
        stiffness: N m / rad, or N / m.
        damping: N m s / rad, or N s / m.
        force: Greatest force, N m or N.
        limits: Least and greatest position; None where there are none.
    """

    joint: str
    stiffness: float
    damping: float
    force: float
    limits: tuple[float, float] | None


def drives(
    robots: Sequence[RobotParts],
    space: ConfigurationSpace,
    keys: Sequence[Array],
    closed: float,
    step: float,
    log: DiagnosticLog,
) -> dict[str, Drive]:
    """Return what moves the hinges and slides of all robots, by joint.

    A free base is not driven. Of the joints of closed loops as many are driven as can move independently.

    Args:
        robots: The robots at home.
        space: Their configuration space.
        keys: Configurations, (dim,), at which simulations begin.
        closed: Length below which a loop counts as closed at home.
        step: Time step of the simulation, seconds.
        log: Where what is not driven is reported.
    """
    found: dict[str, Drive] = {}
    samples = [*keys, *space.sample(_SAMPLES, seed=0)]
    for i, robot in enumerate(robots):
        slots, columns = space.slots[i], space.robot_slices[i]
        free = [robot.links[s.body].name for s in slots if s.free]
        if free:
            log.info("MJC411", free[0], f"the free base of {free[0]} gets no actuator: it is not driven")
        joints = {s.columns[0] - columns.start: s.body for s in slots if not s.free}
        if not joints:
            continue
        loops = loop_points(robot, closed)
        motion = _independent(robot, robot.home, loops)
        chosen = _driven(motion, sorted(joints))
        # In the order of qpos.
        driven = [c for c in joints if c in chosen]
        names = [space.names[columns.start + c] for c in driven]
        if len(driven) < len(joints):
            message = (
                f"{len(joints)} joints in closed loops move in {len(driven)} ways: {', '.join(names)} are driven, the "
                "others follow"
            )
            log.info("MJC417", robot.names[0], message)
        stiffness, force = (np.array(x) for x in zip(*(_gain(robot, joints[c], c) for c in driven), strict=True))
        # Elsewhere loops would have to be closed first.
        places = [robot.home] if loops else [q[columns] for q in samples]
        least = min(_least_frequency(robot, q, motion, driven, stiffness) for q in places)
        if step * least > 4:
            stiffness *= (4 / (step * least)) ** 2
            least = 4 / step
        for c, name, k, f in zip(driven, names, stiffness.tolist(), force.tolist(), strict=True):
            kept, limits = _three_digits(k), _limits(space, columns.start + c)
            found[name] = Drive(name, kept, _three_digits(2 * kept / least), _three_digits(f), limits)
    return found


def add_actuators(root: Element, found: dict[str, Drive], kind: Actuators) -> None:
    """Append an actuator for each joint that is driven."""
    if not found:
        return
    actuator = add(root, "actuator")
    if kind == "velocity":
        comment(actuator, ["velocity: the gain is the joint's damping, so that it moves at the speed asked for."])
    for drive in found.values():
        force = _range(-drive.force, drive.force)
        common = {"name": drive.joint, "joint": drive.joint, "forcerange": force}
        if kind == "position":
            limits = None if drive.limits is None else _range(*drive.limits)
            add(actuator, "position", **common, kp=number(drive.stiffness), ctrlrange=limits)
        elif kind == "velocity":
            speed = drive.force / drive.damping
            add(actuator, "general", **common, gainprm=number(drive.damping), ctrlrange=_range(-speed, speed))
        else:
            add(actuator, "motor", **common, ctrlrange=force)


def add_sensors(root: Element, space: ConfigurationSpace) -> None:
    """Append sensors of the position and the speed of each hinge and slide."""
    sensor = add(root, "sensor")
    for name in (space.names[s.columns[0]] for slots in space.slots for s in slots if not s.free):
        add(sensor, "jointpos", name=f"{name}:position", joint=name)
        add(sensor, "jointvel", name=f"{name}:velocity", joint=name)
    if not len(sensor):
        root.remove(sensor)


def _three_digits(value: float) -> float:
    return float(f"{value:.3g}")


def _range(low: float, high: float) -> str:
    return f"{number(low)} {number(high)}"


def _limits(space: ConfigurationSpace, column: int) -> tuple[float, float] | None:
    low, high = float(space.lower[column] - space.shift[column]), float(space.upper[column] - space.shift[column])
    bounded = np.isfinite(low) and np.isfinite(high) and low < high and not space.periodic[column]
    return (low, high) if bounded else None


def _gain(robot: RobotParts, body: int, column: int) -> tuple[float, float]:
    """Return stiffness and greatest force for the weight and reach of all that hangs on a body."""
    carried = _carried(robot)[:, column]
    hanging = [p for p, moves in zip(robot.links, carried, strict=True) if moves]
    weight = STANDARD_GRAVITY * sum(p.inertial.mass for p in hanging if p.inertial is not None)
    origin = robot.links[body].pose[:3, 3]
    reach = max(float(np.linalg.norm(p.pose[:3, 3] - origin)) + p.radius for p in hanging)
    if robot.kinematics.dofs[column].kind.is_length:
        return _STIFFNESS * weight / reach, _WEIGHTS * weight
    return _STIFFNESS * weight * reach, _WEIGHTS * weight * reach


def _carried(robot: RobotParts) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    """Return which bodies each degree of freedom moves, (nbodies, dim)."""
    kinematics = robot.kinematics
    out = np.zeros((len(robot.links), kinematics.dim), dtype=np.bool_)
    for body in kinematics.tree.order:
        k = kinematics.tree.parent[body]
        if k is not None:
            out[body] = out[kinematics.multibody.connections[k].previous]
        out[body] |= [d.body == body and not d.loop for d in kinematics.dofs]
    return out


def _twists(robot: RobotParts, q: Array) -> tuple[Array, Array, Array]:
    """Return how each degree of freedom moves the bodies it carries, in the world, at q (dim,).

    Returns:
        Angular velocities, (dim, 3), zero for slides; velocities, (dim, 3), of slides; points on the axes, (dim, 3).
        The angles of a free base are taken about the axes of the world.
    """
    kinematics = robot.kinematics
    poses = kinematics.forward(q)
    angular, linear, points = (np.zeros((kinematics.dim, 3)) for _ in range(3))
    for i, dof in enumerate(kinematics.dofs):
        if dof.connection is None:
            axis = np.eye(3)[(POSITIONS if dof.kind.is_length else ROTATIONS).index(dof.kind)]
            points[i] = poses[dof.body, :3, 3]
        else:
            previous = kinematics.multibody.connections[dof.connection].previous
            frame = poses[previous] @ kinematics.joint_frames(dof.connection, q)[dof.kind]
            axis, points[i] = frame[:3, 0 if dof.kind is DofKind.ALPHA else 2], frame[:3, 3]
        (linear if dof.kind.is_length else angular)[i] = axis
    return angular, linear, points


def mass_matrix(robot: RobotParts, q: Array) -> Array:
    """Return the mass matrix of a robot at q, (dim, dim); zero for what closes loops.

    M = sum over the links of m Jv^T Jv + Jw^T I Jw, with the Jacobians of centre and rotation (Featherstone, Rigid Body
    Dynamics Algorithms, 2008, section 2.14).
    """
    angular, linear, points = _twists(robot, q)
    carried = _carried(robot)
    out = np.zeros((len(angular), len(angular)))
    for part, pose, moves in zip(robot.links, robot.kinematics.forward(q), carried, strict=True):
        if part.inertial is None:
            continue
        center = pose[:3, :3] @ part.inertial.com + pose[:3, 3]
        axes = pose[:3, :3] @ matrix_from_quaternion(part.inertial.quat)
        turn = np.where(moves[:, None], angular, 0.0)
        velocity = np.where(moves[:, None], linear + np.cross(angular, center - points), 0.0)
        local = turn @ axes
        out += part.inertial.mass * velocity @ velocity.T + (local * part.inertial.diagonal) @ local.T
    return out


def _independent(robot: RobotParts, q: Array, loops: Sequence[tuple[int, int, Array]]) -> Array:
    """Return a basis of the velocities that closed loops and the tree allow, (dim, k)."""
    angular, linear, points = _twists(robot, q)
    carried = _carried(robot)
    moving = np.flatnonzero(carried.any(axis=0))
    basis = np.eye(len(angular))[:, moving]
    rows: list[Array] = []
    for previous, following, point in loops:
        velocity = linear + np.cross(angular, point - points)
        rows.append(((carried[previous].astype(float) - carried[following])[:, None] * velocity).T)
    if not rows:
        return basis
    constraints = np.concatenate(rows)[:, moving]
    _, sizes, directions = np.linalg.svd(constraints)
    rank = int((sizes > 1e-6 * sizes.max(initial=0.0)).sum())
    return basis @ directions[rank:].T


def _driven(motion: Array, joints: Sequence[int]) -> list[int]:
    """Return joints that move independently, and that all others follow: the first of the chain that move well."""
    left = motion[list(joints)].copy()
    chosen: list[int] = []
    while len(chosen) < len(joints):
        sizes = np.linalg.norm(left, axis=1)
        if sizes.max() < 1e-6:
            break
        # A crank rather than the rocker that it moves, unless it is near a dead point.
        best = int(np.flatnonzero(sizes > 0.1 * sizes.max())[0])
        chosen.append(joints[best])
        direction = left[best] / sizes[best]
        left -= np.outer(left @ direction, direction)
    return sorted(chosen)


def _least_frequency(robot: RobotParts, q: Array, motion: Array, driven: Sequence[int], stiffness: Array) -> float:
    """Return the least frequency, rad/s, of the coupled motion about q in which the driven joints are springs."""
    mass = motion.T @ mass_matrix(robot, q) @ motion
    springs = motion[list(driven)].T
    # The square root of the stiffness, in coordinates in which the mass is one.
    root = np.linalg.solve(np.linalg.cholesky(mass), springs * np.sqrt(stiffness))
    return float(np.linalg.svd(root, compute_uv=False).min())
