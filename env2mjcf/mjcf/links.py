"""Bodies: obstacles beside each other in the world, links nested along the chain, which must not be too long."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..diagnostics import DiagnosticLog
from ..geometry.assembly import Assembly, Part, RobotParts
from ..geometry.inertia import Inertial
from ..kinematics.qpos import children_first_to_last
from ..kinematics.space import ConfigurationSpace
from ..kinematics.tree import POSITIONS, DofKind, build_tree
from ..model.environment import Environment
from ..options import Options
from ..transforms import Array, inverse, quaternion_from_matrix, transform
from .assets import AssetBook
from .geoms import add_collision, add_visual, robot_color
from .joints import add_base_joints, add_connection_joints, add_tool
from .markup import Element, add, numbers, tidy

# MuJoCo's XML parser refuses the 500th element within others: <mujoco> and <worldbody> are around the bodies, and
# geoms in the last.
_MOST_LINKS = 496

# In metres: frames that are nearer to each other are one to MuJoCo.
_SAME_FRAME = 1e-6


@dataclass(slots=True)
class Compilation:
    """What the parts of the compiler share.

    Attributes:
        assembly, space, options: The input.
        dampings: Of joints that are driven, by name.
        assets: The assets so far.
        owners: Name of the body that each collision geom belongs to.
        own_bodies: Obstacles that need a body of their own, because an exclude names them.
        elements: The element of every body, by name.
    """

    assembly: Assembly
    space: ConfigurationSpace
    options: Options
    own_bodies: frozenset[str]
    dampings: Mapping[str, float]
    assets: AssetBook = field(default_factory=AssetBook)
    owners: dict[str, str] = field(default_factory=dict[str, str])
    elements: dict[str, Element] = field(default_factory=dict[str, Element])


def refuse_long_chains(environment: Environment, log: DiagnosticLog) -> None:
    """Make sure that MuJoCo's parser reads the bodies of each chain, which are nested.

    Raises:
        ConversionError: A link has too many others before it.
        KinematicsError: The bodies of a robot do not hang together.
    """
    for robot in environment.robots:
        # The readers have said already what is doubtful about it.
        tree = build_tree(robot, DiagnosticLog())
        depth: dict[int, int] = {}
        for body in tree.order:
            k = tree.parent[body]
            depth[body] = 1 if k is None else depth[robot.connections[k].previous] + 1
            if k is not None and depth[body] > _MOST_LINKS:
                message = (
                    f"this connection leads to link {depth[body]} of a chain; MuJoCo's XML parser reads at most "
                    f"{_MOST_LINKS} bodies within each other"
                )
                hint = "make the chain shorter, or a robot of its own of a part"
                log.fail("MJC403", robot.bodies[body].filename, message, hint=hint, span=robot.connections[k].span)


def add_obstacles(world: Element, compilation: Compilation) -> None:
    """Append obstacles and surfaces as world geoms, which MuJoCo's midphase sorts once for all."""
    for part in (*compilation.assembly.obstacles, *compilation.assembly.surfaces):
        tag = "body" if part.name in compilation.own_bodies else "frame"
        place = add(world, tag, name=part.name, **_place(part.mesh_pose))
        compilation.elements[part.name] = place
        _add_geoms(place, part, compilation, obstacle=True)


def add_robot(world: Element, number: int, compilation: Compilation) -> None:
    """Append a robot's bodies depth first, each in its parent at the home configuration."""
    robot = compilation.assembly.robots[number]
    stack: list[tuple[Element, int | None, int]] = [
        (world, None, root) for root in reversed(children_first_to_last(robot.kinematics, None))
    ]
    while stack:
        parent, previous, body = stack.pop()
        element = _add_link(parent, previous, body, number, robot, compilation)
        children = children_first_to_last(robot.kinematics, body)
        stack += [(element, body, child) for child in reversed(children)]


def _add_link(
    parent: Element, previous: int | None, body: int, number: int, robot: RobotParts, compilation: Compilation
) -> Element:
    part = robot.links[body]
    local = part.pose if previous is None else inverse(robot.links[previous].pose) @ part.pose
    if previous is None and _has_slides(robot, body):
        # A base on slides is placed by them alone: its home is the origin, on other axes that of the file.
        slides = [d.kind for d in robot.kinematics.dofs if d.connection is None and d.body == body]
        fixed = [k not in slides for k in POSITIONS]
        local = transform(np.eye(3), np.where(fixed, -np.array(robot.kinematics.origin), 0.0))
    element = add(parent, "body", name=part.name, **_place(local))
    compilation.elements[part.name] = element
    names = compilation.space.names[compilation.space.robot_slices[number]]
    if previous is None:
        add_base_joints(element, robot, body, names, compilation.dampings)
    else:
        add_connection_joints(element, robot, body, names, compilation.dampings)
    if part.inertial is not None:
        _add_inertial(element, part.inertial)
    if compilation.options.sensors and body == len(robot.links) - 1:
        several = len(compilation.assembly.robots) > 1
        add_tool(element, robot, f"robot{number}/tool" if several else "tool")
    _add_geoms(element, part, compilation, obstacle=False, color=robot_color(number))
    return element


def _has_slides(robot: RobotParts, body: int) -> bool:
    kinds = set(robot.kinematics.base_columns(body))
    return bool(kinds) and DofKind.RX not in kinds


def _add_geoms(
    place: Element, part: Part, compilation: Compilation, *, obstacle: bool, color: tuple[float, ...] | None = None
) -> None:
    assets, owners, primitives = compilation.assets, compilation.owners, compilation.options.primitives
    center = np.zeros(3) if obstacle else np.array(part.mesh.center)
    add_visual(place, part, assets, center, color)
    add_collision(place, part, assets, center, obstacle=obstacle, primitives=primitives, owners=owners)


def _add_inertial(element: Element, inertial: Inertial) -> None:
    # MuJoCo takes so near a frame for that of the body when it moves, but not when it builds bounding volumes.
    com = inertial.com if np.linalg.norm(inertial.com) >= _SAME_FRAME else np.zeros(3)
    pos, quat = numbers(tidy(com)), numbers(tidy(inertial.quat))
    mass, diagonal = numbers(inertial.mass), numbers(inertial.diagonal)
    add(element, "inertial", pos=pos, quat=quat, mass=mass, diaginertia=diagonal)


def _place(pose: Array) -> dict[str, str]:
    """Return pos and quat, each left out where it is the default."""
    place: dict[str, str] = {}
    position = tidy(pose[:3, 3])
    if np.any(position != 0):
        place["pos"] = numbers(position)
    quaternion = tidy(quaternion_from_matrix(pose[:3, :3]))
    if np.any(quaternion != (1, 0, 0, 0)):
        place["quat"] = numbers(quaternion)
    return place
