"""Bodies: obstacles beside each other in the world, links nested along the chain."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..geometry.assembly import Assembly, Part, RobotParts
from ..geometry.inertia import Inertial
from ..kinematics.space import ConfigurationSpace, children_first_to_last
from ..kinematics.transforms import Array, inverse, quaternion_from_matrix
from ..kinematics.tree import DofKind
from ..options import Options
from .assets import AssetBook
from .geoms import add_collision, add_visual, robot_color
from .joints import add_base_joints, add_connection_joints
from .writer import Element, add, numbers, tidy


@dataclass(slots=True)
class Compilation:
    """What the parts of the compiler share.

    Attributes:
        assembly, space, options: The input.
        assets: The assets so far.
        owners: Name of the body that each collision geom belongs to.
        own_bodies: Obstacles that need a body of their own, because an exclude names them.
        elements: The element of every body, by name.
    """

    assembly: Assembly
    space: ConfigurationSpace
    options: Options
    own_bodies: frozenset[str]
    assets: AssetBook = field(default_factory=AssetBook)
    owners: dict[str, str] = field(default_factory=dict[str, str])
    elements: dict[str, Element] = field(default_factory=dict[str, Element])


def add_obstacles(world: Element, compilation: Compilation) -> None:
    """Append obstacles and surfaces as world geoms, which MuJoCo's midphase sorts once for all."""
    for part in (*compilation.assembly.obstacles, *compilation.assembly.surfaces):
        tag = "body" if part.name in compilation.own_bodies else "frame"
        place = add(world, tag, name=part.name, **_place(part.pose))
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
        # A base on slides is placed by them alone; its home is the origin.
        local = np.eye(4)
    element = add(parent, "body", name=part.name, **_place(local))
    compilation.elements[part.name] = element
    names = compilation.space.names[compilation.space.robot_slices[number]]
    if previous is None:
        add_base_joints(element, robot, body, names)
    else:
        add_connection_joints(element, robot, body, names)
    if part.inertial is not None:
        _add_inertial(element, part.inertial)
    _add_geoms(element, part, compilation, obstacle=False, color=robot_color(number))
    return element


def _has_slides(robot: RobotParts, body: int) -> bool:
    kinds = {d.kind for d in robot.kinematics.dofs if d.connection is None and d.body == body}
    return bool(kinds) and DofKind.RX not in kinds


def _add_geoms(
    place: Element, part: Part, compilation: Compilation, *, obstacle: bool, color: tuple[float, ...] | None = None
) -> None:
    add_visual(place, part, compilation.assets, color)
    add_collision(
        place,
        part,
        compilation.assets,
        obstacle=obstacle,
        primitives=compilation.options.primitives,
        owners=compilation.owners,
    )


def _add_inertial(element: Element, inertial: Inertial) -> None:
    add(
        element, "inertial", pos=numbers(tidy(inertial.com)), quat=numbers(tidy(inertial.quat)),
        mass=numbers(inertial.mass), diaginertia=numbers(inertial.diagonal),
    )  # fmt: skip


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
