"""Environments and robots as text that the original readers take, and that ours read back to the last bit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from ..model.dialects import RULES, DialectRules, SurfaceLabels, rules_of
from ..model.environment import (
    BaseKind,
    Body,
    Boundary,
    Comment,
    Connection,
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
from .env import RESOLUTION_TAGS

# Doubles on either side of a quotient that are tried for one that reads back.
_NEIGHBOURS = 4
_WHOLE_TURNS = {JointType.REVOLUTE: 1, JointType.SPHERICAL: 2, JointType.SMA: 1}
# They stand in front of their bodies, where they are written anew.
_DIRECTIVES = ("#VIZMO_COLOR", "#VIZMO_NAME")
# Dialect A's reader has 256 characters for a comment.
_LONGEST_HEADER = 240


def env_text(environment: Environment) -> str:
    """Return an environment as text of its own dialect, comments at the top.

    Robots that have files of their own are left out: `robot_text` writes them. What the dialect cannot express is left
    out, too; `translate` reports what that is, also when it translates into the environment's own dialect.
    """
    rules = rules_of(environment.dialect, environment.semantics)
    inside = [m for m in environment.multibodies if m.robot_file is None]
    comments = _legacy_comments(environment) if rules.legacy_layout else _comments(environment.comments)
    lines = [*comments, *_preamble(environment, rules), str(len(inside))]
    for multibody in inside:
        lines += ["", *(_legacy(multibody, rules) if rules.legacy_layout else _later(multibody, rules))]
    return _joined(lines)


def robot_text(robot: MultiBody) -> str:
    """Return a robot as the text of a dialect E robot file."""
    return _joined(_robot(robot, RULES[Dialect.E]))


def decimal(value: float, unit: float = 1.0) -> str:
    """Return the shortest decimal that, multiplied by `unit` as readers do, is a value again to the last bit.

    Not every double is such a product: where there is none within four neighbours, the nearest, which is one unit of
    the last place off at most. A value that was read with the same unit always comes back.

    Args:
        value: A finite number: an angle in radians, or a length.
        unit: Radians per unit of the file; 1 for lengths.
    """
    if unit == 1.0:
        return _short(value)
    quotient = value / unit
    for digits in range(1, 18):
        rounded = float(f"{quotient:.{digits}g}")
        if rounded * unit == value:
            return _short(rounded)
    candidates = [quotient]
    for towards in (-math.inf, math.inf):
        near = quotient
        for _ in range(_NEIGHBOURS):
            near = math.nextafter(near, towards)
            candidates.append(near)
    return _short(min(candidates, key=lambda x: abs(x * unit - value)))


def settled(value: float, unit: float = 1.0) -> float:
    """Return what the decimal of a value reads as: the value itself wherever some decimal does."""
    return float(decimal(value, unit)) * unit


def _short(value: float) -> str:
    """Return the shortest decimal of a double, integers without a point."""
    return repr(float(value)).removesuffix(".0")


def written_limits(connection: Connection) -> tuple[JointLimits, ...]:
    """Return the limits that a dialect which demands them must have: a whole turn where there are none."""
    turn = JointLimits(-math.pi, math.pi)
    return connection.limits or (turn,) * _WHOLE_TURNS.get(connection.joint, 0)


def _pose(pose: Pose | None, unit: float) -> str:
    """Return `x y z rx ry rz`; a body without a pose stands at the origin."""
    pose = pose or Pose()
    return " ".join([*map(_short, pose.position), *(decimal(r, unit) for r in pose.rotation)])


def _joined(lines: Iterable[str]) -> str:
    # The original readers of dialects B to E fail on a file that ends with its last word.
    return "".join(f"{line}\n" for line in lines)


def _comments(comments: Iterable[Comment]) -> Iterator[str]:
    return (c.text for c in comments if c.text.split()[0] not in _DIRECTIVES)


def _legacy_comments(environment: Environment) -> Iterator[str]:
    """Yield comments that dialect A's reader takes in front of the count."""
    versioned = False
    for text in _comments(environment.comments):
        words = text.split()
        version = len(words) >= 3 and words[0] == "#Environment" and "Version" in words[1]
        versioned |= version
        # It stops at any other header line with this word in it, and reads so many characters of a line.
        safe = text if version else text.replace("Environment", "environment")
        yield safe[:_LONGEST_HEADER]
        for at in range(_LONGEST_HEADER, len(safe), _LONGEST_HEADER - 1):
            yield f"#{safe[at : at + _LONGEST_HEADER - 1]}"
    if not versioned and any(m.kind is MultiBodyKind.INTERNAL for m in environment.multibodies):
        yield "#Environment Version 20020327"


def _preamble(environment: Environment, rules: DialectRules) -> Iterator[str]:
    if not rules.boundaries or environment.boundary is None:
        return
    yield f"Boundary {_boundary(environment.boundary, rules.brackets)}"
    yield from _resolution(environment.resolution, rules)
    yield ""
    yield "Multibodies"


def _boundary(boundary: Boundary, brackets: bool) -> str:
    ranges = [f"{_short(a)}:{_short(b)}" for a, b in zip(boundary.lower, boundary.upper, strict=True)]
    parts = ranges or [" ".join(map(_short, boundary.center)), _short(boundary.radius)]
    # Brackets and semicolons are words of their own to the original.
    extent = f"[ {' ; '.join(parts)} ]" if brackets else " ".join(parts)
    return f"{boundary.shape.value} {extent}"


def _resolution(resolution: Resolution, rules: DialectRules) -> Iterator[str]:
    for tag, name in RESOLUTION_TAGS.items():
        value: float | None = getattr(resolution, name)
        if value is not None and name in rules.resolution:
            yield f"{tag} {decimal(value, rules.configuration_angle if name == 'orientation' else 1.0)}"


def _legacy(multibody: MultiBody, rules: DialectRules) -> Iterator[str]:
    internal = multibody.kind is MultiBodyKind.INTERNAL
    yield f"MultiBody {'Passive Internal' if internal else multibody.kind.value}"
    yield str(len(multibody.bodies))
    counts = {True: 0, False: 0}
    for body in multibody.bodies:
        fixed = body.base is BaseKind.FIXED
        # Where a body has no index, bodies of its kind are counted.
        index = counts[fixed] if body.index is None else body.index
        counts[fixed] += 1
        words = ["FixedBody" if fixed else "FreeBody", str(index), body.filename]
        if fixed or body.pose is not None:
            words.append(_pose(body.pose, rules.pose_angle))
        yield from _body_lines(body, words, rules)
    yield from _connections(multibody, rules)


def _later(multibody: MultiBody, rules: DialectRules) -> Iterator[str]:
    labelled = multibody.label is not None and rules.surface_labels is not SurfaceLabels.NONE
    label = f" {multibody.label}" if labelled and multibody.kind is MultiBodyKind.SURFACE else ""
    yield f"{multibody.kind.value}{label}"
    if not multibody.moves:
        body = multibody.bodies[0]
        words = [body.filename, *_options(body, rules), _pose(body.pose, rules.pose_angle)]
        yield from _body_lines(body, words, rules)
        return
    yield from _robot(multibody, rules)
    if multibody.velocity_bounds is not None:
        yield f"VelocityBounds {_short(multibody.velocity_bounds.linear)} {_short(multibody.velocity_bounds.angular)}"
        yield f"Controls {len(multibody.controls)}"
        yield from (" ".join(map(_short, control)) for control in multibody.controls)


def _robot(robot: MultiBody, rules: DialectRules) -> Iterator[str]:
    yield str(len(robot.bodies))
    for body in robot.bodies:
        words = [body.filename, *_options(body, rules)]
        if body.mass is not None and rules.mass:
            words.append(_short(body.mass))
        words.append(body.base.value)
        if body.base is BaseKind.FIXED:
            words.append(_pose(body.pose, rules.pose_angle))
        yield from _body_lines(body, words, rules)
    if robot.adjacencies and rules.adjacencies:
        yield "Adjacencies"
        yield str(len(robot.adjacencies))
        yield from (f"{i} {j}" for i, j in robot.adjacencies)
    yield from _connections(robot, rules)


def _options(body: Body, rules: DialectRules) -> Iterator[str]:
    if not rules.options:
        return
    if body.recentring is not Recentring.COM:
        yield f"-a({body.recentring.value})"
    if body.color is not None:
        yield f"-c({' '.join(map(_short, body.color))})"
    if body.texture is not None:
        yield f"-t({body.texture})"


def _body_lines(body: Body, words: Iterable[str], rules: DialectRules) -> Iterator[str]:
    """Yield the line of a body behind the visualiser's lines about it."""
    if body.color is not None and not rules.options:
        yield f"#VIZMO_COLOR {' '.join(map(_short, body.color[:3]))}"
    if body.label is not None:
        yield f"#VIZMO_NAME {body.label}"
    yield " ".join(words)


def _connections(robot: MultiBody, rules: DialectRules) -> Iterator[str]:
    """Yield the tag, the count and each connection."""
    yield "Connection" if rules.legacy_layout else "Connections"
    yield str(len(robot.connections))
    for connection in robot.connections:
        fields = {name: _field(connection, name, rules) for name in rules.connection_fields}
        head = [str(connection.previous), str(connection.next)]
        if rules.legacy_layout:
            yield " ".join([*head, fields.pop("actuated")])
        else:
            yield " ".join([*head, fields.pop("joint"), fields.pop("limits")]).rstrip()
        yield "  ".join(fields.values())


def _field(connection: Connection, name: str, rules: DialectRules) -> str:
    if name == "actuated":
        return connection.actuated or "Actuated"
    if name == "joint":
        return connection.joint.value
    if name == "limits":
        return _limits(connection, rules) if rules.limits else ""
    if name == "dh":
        return _dh(connection, rules)
    return _pose(connection.to_dh if name == "to_dh" else connection.to_body, rules.pose_angle)


def _limits(connection: Connection, rules: DialectRules) -> str:
    unit = 1.0 if connection.joint is JointType.PRISMATIC else rules.configuration_angle
    return " ".join(f"{decimal(x.lower, unit)}:{decimal(x.upper, unit)}" for x in written_limits(connection))


def _dh(connection: Connection, rules: DialectRules) -> str:
    dh, unit = connection.dh, rules.dh_angle
    words = [decimal(dh.alpha, unit), _short(dh.a), _short(dh.d), decimal(dh.theta, unit)]
    if connection.sma is not None:
        words += [_short(connection.sma.length), _short(connection.sma.width)]
    return " ".join(words)
