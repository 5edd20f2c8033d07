"""Dialect E's XML environments and XML robots (docs/format/xml.md)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..model.dialects import rules_of
from ..model.environment import (
    Actuator,
    BaseKind,
    Body,
    Boundary,
    Connection,
    Dialect,
    Environment,
    JointLimits,
    JointType,
    MultiBody,
    MultiBodyKind,
    Pose,
    Recentring,
)
from .blocks import SHAPES, read_color, read_dh, read_extent, read_pose
from .bodies import SELF_CONNECTION, read_body_index, read_limits, warn_of_no_limits
from .lexer import Scanner
from .xml import Node

_RULES = rules_of(Dialect.E)
_JOINTS = {"revolute": JointType.REVOLUTE, "spherical": JointType.SPHERICAL, "nonactuated": JointType.NON_ACTUATED}
_RANGES = {JointType.REVOLUTE: ("range",), JointType.SPHERICAL: ("range", "range2"), JointType.NON_ACTUATED: ()}
_KINDS = {"passive": MultiBodyKind.PASSIVE, "internal": MultiBodyKind.INTERNAL, "surface": MultiBodyKind.SURFACE}
_ADJUSTMENTS = {"none": Recentring.NONE, "com": Recentring.COM, "surface": Recentring.SURFACE}
_BASES = {"planar": "Planar", "volumetric": "Volumetric", "fixed": "Fixed"}
_MOVEMENTS = {"rotational": "Rotational", "translational": "Translational"}
_RESOLUTIONS = {"positionRes": "position", "orientationRes": "orientation", "timeRes": "time"}
_BODY_ATTRIBUTES = ("filename", "comAdjustment", "color", "type", "mass")
_ENVIRONMENT_ATTRIBUTES = ("filename", "input_env", *_RESOLUTIONS, "gravity", "frictionCoefficient")


def read_environment(node: Node) -> Environment:
    """Read an `<Environment>` element: boundary and obstacles."""
    multibodies = tuple(_read_obstacle(child) for child in node.children("MultiBody"))
    node.ignore_other_children("Boundary", "MultiBody")
    path = node.source.path
    environment = Environment(
        name=Path(path).stem,
        dialect=Dialect.E,
        multibodies=multibodies,
        boundary=_read_boundaries(node),
        declared_multibodies=len(multibodies),
        directory=Path(path).parent,
        path=path,
        xml=True,
    )
    return with_environment_attributes(environment, node)


def with_environment_attributes(environment: Environment, node: Node) -> Environment:
    """Apply the attributes of an `<Environment>` element, which override the file."""
    resolution = environment.resolution
    for attribute, name in _RESOLUTIONS.items():
        value = node.number(attribute) if node.get(attribute) is not None else 0.0
        if value > 0:
            value = value * _RULES.configuration_angle if name == "orientation" else value
            resolution = replace(resolution, **{name: value})
            if name == "position":
                resolution = replace(resolution, span=node.span_of(attribute))
    node.ignore_other_attributes(*_ENVIRONMENT_ATTRIBUTES)
    kept = tuple(sorted((k, v) for k, v in node.attributes.items() if k not in ("filename", "input_env")))
    return replace(environment, resolution=resolution, attributes=(*environment.attributes, *kept))


def read_robot(node: Node) -> MultiBody:
    """Read a `<Robot>` element: one active multibody and its actuators."""
    multibody = node.only_child("MultiBody", "ENV145")
    if multibody.get("type") is not None:
        multibody.choice("type", {"active": None})
    base = multibody.only_child("Base", "ENV145")
    links = list(multibody.children("Link"))
    kind = _read_base(base)
    bodies = [_read_body(base, kind, *["movement"] * (kind is not BaseKind.FIXED))]
    base.ignore_other_children()
    connections: list[Connection] = []
    for number, link in enumerate(links, 1):
        _check_link(link, number)
        bodies.append(_read_body(link, BaseKind.JOINT, "index"))
        link.ignore_other_children("Connection")
        connections.append(_read_connection(link, number, len(links) + 1))
    multibody.ignore_other_children("Base", "Link")
    multibody.ignore_other_attributes("type")
    node.ignore_other_children("MultiBody", "Actuator")
    node.ignore_other_attributes()
    return MultiBody(
        MultiBodyKind.ACTIVE,
        tuple(bodies),
        tuple(connections),
        dialect=Dialect.E,
        dh_form=_RULES.dh_form,
        actuators=_read_actuators(node),
        robot_file=node.source.path,
        span=multibody.span,
    )


def _read_actuators(node: Node) -> tuple[Actuator, ...]:
    actuators = tuple(
        Actuator(a.get("label") or "", tuple(sorted(a.attributes.items())), a.span) for a in node.children("Actuator")
    )
    if actuators:
        message = f"{len(actuators)} planner actuators are kept, but not simulated"
        hint = "actuators='position' adds position actuators"
        node.log.info("ENV308", "<Actuator>", message, hint=hint, span=actuators[0].span)
    return actuators


def _read_boundaries(node: Node) -> Boundary | None:
    """Return the boundary of the workspace; one of the configuration space only where there is no other."""
    found = [(child, _read_boundary(child)) for child in node.children("Boundary")]
    if not found:
        return None
    used, boundary = next((f for f in found if f[1].space == "workspace"), found[0])
    for child, _ in found:
        if child.element is not used.element:
            child.ignore("another <Boundary> is not used")
    if boundary.space != "workspace":
        message = f"a boundary of the {boundary.space} is used as one of the workspace"
        hint = "give a boundary with space='workspace'"
        node.log.warn("ENV212", "Boundary", message, hint=hint, span=used.span_of("space"))
    return boundary


def _read_boundary(node: Node) -> Boundary:
    shape = node.choice("shape", SHAPES)
    space = node.choice("space", {"workspace": "workspace", "cspace": "cspace"}) if node.get("space") else "workspace"
    boundary = node.read("limits", lambda scan: read_extent(scan, shape, node.span_of("limits")))
    node.ignore_other_attributes("shape", "space", "limits")
    node.ignore_other_children()
    return replace(boundary, space=space, span=node.span)


def _read_obstacle(node: Node) -> MultiBody:
    kind = node.choice("type", _KINDS)
    base = node.only_child("Base", "ENV145")
    node.ignore_other_attributes("type")
    node.ignore_other_children("Base")
    base.ignore_other_children()
    if base.get("type") is not None and base.choice("type", {**_BASES, "joint": "Joint"}) != "Fixed":
        message = f"an obstacle with a {base.get('type')} base; expected fixed"
        base.fail("ENV123", message, hint="write type='fixed'", at="type")
    body = _read_body(base, BaseKind.FIXED)
    return MultiBody(kind, (body,), dialect=Dialect.E, dh_form=_RULES.dh_form, span=node.span)


def _read_base(node: Node) -> BaseKind:
    kind = node.choice("type", _BASES)
    if kind == "Fixed":
        return BaseKind.FIXED
    return BaseKind(f"{kind} {node.choice('movement', _MOVEMENTS)}")


def _read_body(node: Node, base: BaseKind, *more_attributes: str) -> Body:
    # XML meshes are not recentred by default, unlike those of text files.
    recentring = Recentring.NONE if node.get("comAdjustment") is None else node.choice("comAdjustment", _ADJUSTMENTS)
    body = Body(
        node.require("filename"),
        base,
        recentring=recentring,
        color=node.read("color", read_color) if node.get("color") is not None else None,
        mass=_read_mass(node) if node.get("mass") is not None else None,
        span=node.span_of("filename"),
    )
    node.ignore_other_attributes(*_BODY_ATTRIBUTES, *["transform"] * (base is BaseKind.FIXED), *more_attributes)
    return replace(body, pose=_read_fixed_pose(node)) if base is BaseKind.FIXED else body


def _read_fixed_pose(node: Node) -> Pose:
    if node.get("transform") is not None:
        return node.read("transform", _pose)
    message = "a fixed body without transform; it stands at the origin"
    node.log.warn("ENV219", f"<{node.tag}>", message, hint="write transform='x y z rx ry rz'", span=node.span)
    return Pose()


def _read_mass(node: Node) -> float:
    mass = node.number("mass")
    if mass <= 0:
        hint = "leave it out to have it computed from the density"
        node.fail("ENV118", f"mass {mass:g}; expected a positive number", hint=hint, at="mass")
    return mass


def _check_link(link: Node, number: int) -> None:
    if link.get("index") is not None and link.integer("index") != number:
        hint = "links stand in the order of their indices"
        link.fail("ENV146", f"link index {link.get('index')} where {number} was expected", hint=hint, at="index")
    if link.get("type") is not None:
        link.choice("type", {"joint": None})


def _read_connection(link: Node, number: int, bodies: int) -> Connection:
    node = link.only_child("Connection", "ENV147")
    node.ignore_other_children()

    def index(name: str) -> int:
        return node.read(name, lambda scan: read_body_index(scan, bodies))

    previous, following = index("parentIndex"), index("childIndex")
    if following != number:
        message = f"the connection of link {number} leads to body {following}; expected {number}"
        node.fail("ENV147", message, hint="each link holds the one connection that leads to it", at="childIndex")
    if previous == following:
        node.fail("ENV116", SELF_CONNECTION.format(previous), hint="parentIndex names another body", at="parentIndex")
    joint = node.choice("joint", _JOINTS)
    ranges = _RANGES[joint]
    node.ignore_other_attributes(
        "parentIndex", "childIndex", "joint", "transformParentToDH", "initialDHParams", "transformDHToChild", *ranges
    )
    return Connection(
        previous,
        following,
        joint,
        to_dh=node.read("transformParentToDH", _pose),
        dh=node.read("initialDHParams", lambda scan: read_dh(scan, _RULES)),
        to_body=node.read("transformDHToChild", _pose),
        limits=tuple(_read_limits(node, name, joint) for name in ranges),
        span=node.span,
    )


def _read_limits(node: Node, name: str, joint: JointType) -> JointLimits:
    if node.get(name) is not None:
        return node.read(name, lambda scan: read_limits(scan, _RULES, joint))
    warn_of_no_limits(node.log, _RULES, joint, node.span)
    unit = _RULES.configuration_angle
    return JointLimits(-unit, unit, node.span)


def _pose(scan: Scanner) -> Pose:
    return read_pose(scan, _RULES)
