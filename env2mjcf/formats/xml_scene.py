"""Dialect E's XML environments and XML robots (env-format section 8.3)."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from ..dialects import RULES
from ..errors import FormatError
from ..model import (
    Actuator,
    BaseKind,
    Body,
    Boundary,
    BoundaryShape,
    Connection,
    DHParameters,
    Dialect,
    Environment,
    JointLimits,
    JointType,
    MultiBody,
    MultiBodyKind,
    Pose,
    Recentring,
    Resolution,
)
from .blocks import read_range
from .xml import Node

_RULES = RULES[Dialect.E]
_JOINTS = {"revolute": JointType.REVOLUTE, "spherical": JointType.SPHERICAL, "nonactuated": JointType.NON_ACTUATED}
_KINDS = {"passive": MultiBodyKind.PASSIVE, "internal": MultiBodyKind.INTERNAL, "surface": MultiBodyKind.SURFACE}
_ADJUSTMENTS = {"none": Recentring.NONE, "com": Recentring.COM, "surface": Recentring.SURFACE}
_MOVEMENTS = {"rotational": "Rotational", "translational": "Translational"}
_RESOLUTIONS = {"positionRes": "position", "orientationRes": "orientation", "timeRes": "time"}


def read_environment(node: Node) -> Environment:
    """Read an `<Environment>` element: boundary and obstacles."""
    boundary: Boundary | None = None
    multibodies: list[MultiBody] = []
    for child in node.children("Boundary", "MultiBody"):
        if child.tag.lower() == "boundary":
            boundary = _read_boundary(child)
        else:
            multibodies.append(_read_obstacle(child))
    node.ignore_other_children("Boundary", "MultiBody")
    path = node.source.path
    environment = Environment(
        name=Path(path).stem,
        dialect=Dialect.E,
        multibodies=tuple(multibodies),
        boundary=boundary,
        declared_multibodies=len(multibodies),
        directory=Path(path).parent,
        path=path,
    )
    return with_environment_attributes(environment, node)


def with_environment_attributes(environment: Environment, node: Node) -> Environment:
    """Apply the attributes of an `<Environment>` element, which override the file (env-format section 8.1)."""
    resolution = environment.resolution
    for attribute, name in _RESOLUTIONS.items():
        if node.get(attribute) is not None:
            value = node.number(attribute)
            if value >= 0:
                value = value * _RULES.configuration_angle if name == "orientation" else value
                resolution = replace(resolution, **{name: value})
    kept = tuple(sorted((k, v) for k, v in node.attributes.items() if k not in ("filename", "input_env")))
    return replace(environment, resolution=resolution, attributes=(*environment.attributes, *kept))


def read_robot(node: Node) -> MultiBody:
    """Read a `<Robot>` element: one active multibody and its actuators."""
    found = list(node.children("MultiBody"))
    if len(found) != 1:
        node.fail("ENV145", f"<Robot> has {len(found)} <MultiBody> elements; expected one")
    body = found[0]
    bases = list(body.children("Base"))
    if len(bases) != 1:
        body.fail("ENV145", f"<MultiBody> has {len(bases)} <Base> elements; expected one")
    bodies = [_read_body(bases[0], _read_base(bases[0]))]
    connections: list[Connection] = []
    links = list(body.children("Link"))
    for number, link in enumerate(links, 1):
        _check_link_index(link, number)
        bodies.append(_read_body(link, BaseKind.JOINT))
        connections.append(_read_connection(link, number, len(links) + 1))
    body.ignore_other_children("Base", "Link")
    node.ignore_other_children("MultiBody", "Actuator")
    actuators = tuple(
        Actuator(a.get("label") or "", tuple(sorted(a.attributes.items())), a.span) for a in node.children("Actuator")
    )
    if actuators:
        node.log.info(
            "ENV308", "<Actuator>", f"{len(actuators)} planner actuators are kept, but not simulated",
            hint="actuators='position' adds position actuators", span=actuators[0].span,
        )  # fmt: skip
    return MultiBody(
        MultiBodyKind.ACTIVE,
        tuple(bodies),
        tuple(connections),
        dialect=Dialect.E,
        dh_form=_RULES.dh_form,
        actuators=actuators,
        robot_file=node.source.path,
        span=body.span,
    )


def _read_boundary(node: Node) -> Boundary:
    shape = node.choice("shape", {s.value.lower(): s for s in BoundaryShape})
    space = node.get("space") or "workspace"
    if space != "workspace":
        node.log.warn(
            FormatError, "ENV212", "Boundary", f"a boundary of the {space} is used as one of the workspace",
            span=node.span_of("space"),
        )  # fmt: skip
    scan = node.scan("limits")
    scan.punctuation("[", "before the boundary")
    if shape in (BoundaryShape.SPHERE, BoundaryShape.SPHERE2D):
        center: list[float] = []
        while scan.next_is_number():
            center.append(scan.number("centre"))
        scan.punctuation(";", "before the radius")
        radius = scan.number("radius")
        if not 2 <= len(center) <= 3 or radius <= 0:
            node.fail("ENV119", "expected two or three centre coordinates and a positive radius", at="limits")
        scan.punctuation("]", "after the boundary")
        return Boundary(shape, center=tuple(center), radius=radius, space=space, span=node.span)
    ranges = [read_range(scan, "a range of the boundary")]
    while scan.peek() == ";":
        scan.punctuation(";", "between two ranges")
        ranges.append(read_range(scan, "a range of the boundary"))
    scan.punctuation("]", "after the boundary")
    if not 2 <= len(ranges) <= 3:
        node.fail("ENV119", f"a box with {len(ranges)} ranges; expected two or three", at="limits")
    lower, upper = tuple(r[0] for r in ranges), tuple(r[1] for r in ranges)
    return Boundary(shape, lower=lower, upper=upper, space=space, span=node.span)


def _read_obstacle(node: Node) -> MultiBody:
    kind = node.choice("type", _KINDS)
    bases = list(node.children("Base"))
    if len(bases) != 1:
        node.fail("ENV145", f"<MultiBody> has {len(bases)} <Base> elements; expected one")
    node.ignore_other_children("Base")
    body = _read_body(bases[0], BaseKind.FIXED)
    pose = _read_pose(bases[0], "transform") if bases[0].get("transform") is not None else Pose()
    return MultiBody(
        kind, (replace(body, pose=pose),), dialect=Dialect.E, dh_form=_RULES.dh_form, span=node.span
    )  # fmt: skip


def _read_base(node: Node) -> BaseKind:
    kind = node.choice("type", {"planar": "Planar", "volumetric": "Volumetric", "fixed": "Fixed"})
    if kind == "Fixed":
        return BaseKind.FIXED
    return BaseKind(f"{kind} {node.choice('movement', _MOVEMENTS)}")


def _read_body(node: Node, base: BaseKind) -> Body:
    color = None
    if node.get("color") is not None:
        r, g, b, a = node.numbers("color", "red green blue alpha")
        color = (r, g, b, a)
    pose = _read_pose(node, "transform") if base is BaseKind.FIXED and node.get("transform") is not None else None
    mass = node.number("mass") if node.get("mass") is not None else None
    if mass is not None and mass <= 0:
        node.fail("ENV118", f"mass {mass:g}; expected a positive number", at="mass")
    # XML meshes are not recentred by default, unlike those of text files (env-format section 10.3).
    recentring = Recentring.NONE if node.get("comAdjustment") is None else node.choice("comAdjustment", _ADJUSTMENTS)
    return Body(
        node.require("filename"), base, pose, recentring, color, mass=mass, span=node.span_of("filename")
    )  # fmt: skip


def _check_link_index(link: Node, number: int) -> None:
    if link.get("index") is not None and link.integer("index") != number:
        link.fail("ENV146", f"link index {link.get('index')} where {number} was expected", at="index",
                  hint="links stand in the order of their indices")  # fmt: skip


def _read_connection(link: Node, number: int, bodies: int) -> Connection:
    found = list(link.children("Connection"))
    if len(found) != 1:
        at = found[1] if len(found) > 1 else link
        at.fail("ENV147", f"link {number} has {len(found)} connections; an XML robot's link has exactly one parent")
    node = found[0]
    previous, following = node.integer("parentIndex"), node.integer("childIndex")
    for name, value in (("parentIndex", previous), ("childIndex", following)):
        if not 0 <= value < bodies:
            node.fail("ENV115", f"{name} {value} is out of range; the robot has {bodies} bodies", at=name)
    if following != number:
        node.fail("ENV147", f"the connection of link {number} leads to body {following}", at="childIndex")
    joint = node.choice("joint", _JOINTS)
    names = {JointType.REVOLUTE: ("range",), JointType.SPHERICAL: ("range", "range2")}.get(joint, ())
    alpha, a, d, theta = node.numbers("initialDHParams", "alpha a d theta")
    return Connection(
        previous,
        following,
        joint,
        to_dh=_read_pose(node, "transformParentToDH"),
        dh=DHParameters(alpha, a, d, theta, node.span_of("initialDHParams")),
        to_body=_read_pose(node, "transformDHToChild"),
        limits=tuple(_read_limits(node, name) for name in names if node.get(name) is not None),
        span=node.span,
    )


def _read_limits(node: Node, name: str) -> JointLimits:
    lower, upper = read_range(node.scan(name), name)
    unit = _RULES.configuration_angle
    return JointLimits(lower * unit, upper * unit, node.span_of(name))


def _read_pose(node: Node, name: str) -> Pose:
    x, y, z, rx, ry, rz = node.numbers(name, "x y z rx ry rz")
    unit = math.pi / 180
    return Pose((x, y, z), (rx * unit, ry * unit, rz * unit), node.span_of(name))
