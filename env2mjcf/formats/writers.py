"""Decimals that read back as the numbers they were written for.

MERGED: The lines of bodies: file name, options, mass, base, pose.

MERGED: The lines of connections, their fields in each dialect's order.

MERGED: Whole environments and robots as text, as the original readers and our own take them (env-format sections 4 to 8).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from ..model.dialects import RULES, VOCABULARIES, DialectRules, SurfaceLabels, Vocabulary
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
from .blocks import Grammar

_NEIGHBOURS = 4


def decimal(value: float, unit: float = 1.0) -> str:
    """Return the shortest decimal that, multiplied by `unit` as readers do, is a value again to the last bit.

    Not every double is such a product: where there is none within four neighbours, the nearest, which is one unit of
    the last place off at most. A value that was read with the same unit always comes back.

    Args:
        value: A finite number: an angle in radians, or a length.
        unit: Radians per unit of the file; 1 for lengths.
    """
    if unit == 1.0:
        return short(value)
    quotient = value / unit
    for digits in range(1, 18):
        rounded = float(f"{quotient:.{digits}g}")
        if rounded * unit == value:
            return short(rounded)
    candidates = [quotient]
    for towards in (-math.inf, math.inf):
        near = quotient
        for _ in range(_NEIGHBOURS):
            near = math.nextafter(near, towards)
            candidates.append(near)
    return short(min(candidates, key=lambda x: abs(x * unit - value)))


def settled(value: float, unit: float = 1.0) -> float:
    """Return what the decimal of a value reads as: the value itself wherever some decimal does."""
    return float(decimal(value, unit)) * unit


def short(value: float) -> str:
    """Return the shortest decimal of a double, integers without a point."""
    text = repr(float(value))
    return text.removesuffix(".0")


def pose_words(pose: Pose | None, unit: float) -> str:
    """Return `x y z rx ry rz`; a body without a pose stands at the origin."""
    pose = pose or Pose()
    return " ".join([*map(short, pose.position), *(decimal(r, unit) for r in pose.rotation)])


def legacy_bodies(bodies: Sequence[Body]) -> Iterator[str]:
    """Yield the lines of dialect A's bodies, each counted within its kind where it has no index (section 4.2)."""
    unit = RULES[Dialect.A].pose_angle
    counts = {True: 0, False: 0}
    for body in bodies:
        fixed = body.base is BaseKind.FIXED
        index = counts[fixed] if body.index is None else body.index
        counts[fixed] += 1
        words = ["FixedBody" if fixed else "FreeBody", str(index), body.filename]
        if fixed or body.pose is not None:
            words.append(pose_words(body.pose, unit))
        yield from _directives(body, color=True)
        yield " ".join(words)


def robot_body(body: Body, dialect: Dialect, vocabulary: Vocabulary) -> Iterator[str]:
    """Yield the lines of a robot's body in dialects B to E."""
    words = [body.filename, *_options(body, vocabulary)]
    if body.mass is not None and vocabulary.mass:
        words.append(short(body.mass))
    words.append(body.base.value)
    if body.base is BaseKind.FIXED:
        words.append(pose_words(body.pose, RULES[dialect].pose_angle))
    yield from _directives(body, color=not vocabulary.options)
    yield " ".join(words)


def static_body(body: Body, dialect: Dialect, vocabulary: Vocabulary) -> Iterator[str]:
    """Yield the lines of an obstacle's body in dialects B to E."""
    yield from _directives(body, color=not vocabulary.options)
    yield " ".join([body.filename, *_options(body, vocabulary), pose_words(body.pose, RULES[dialect].pose_angle)])


def _options(body: Body, vocabulary: Vocabulary) -> Iterator[str]:
    if not vocabulary.options:
        return
    if body.recentring is not Recentring.COM:
        yield f"-a({body.recentring.value})"
    if body.color is not None:
        yield f"-c({' '.join(map(short, body.color))})"
    if body.texture is not None:
        yield f"-t({body.texture})"


def _directives(body: Body, *, color: bool) -> Iterator[str]:
    """Yield the visualiser's lines in front of a body (env-format section 3.1)."""
    if color and body.color is not None:
        yield f"#VIZMO_COLOR {' '.join(map(short, body.color[:3]))}"
    if body.label is not None:
        yield f"#VIZMO_NAME {body.label}"


_WHOLE_TURNS = {JointType.REVOLUTE: 1, JointType.SPHERICAL: 2, JointType.SMA: 1}


def connection_lines(connections: Sequence[Connection], dialect: Dialect, rules: DialectRules) -> Iterator[str]:
    """Yield the tag, the count and each connection."""
    legacy = VOCABULARIES[dialect].legacy_layout
    yield "Connection" if legacy else "Connections"
    yield str(len(connections))
    for connection in connections:
        fields = {name: _field(connection, name, dialect, rules) for name in rules.connection_fields}
        head = [str(connection.previous), str(connection.next)]
        if legacy:
            yield " ".join([*head, fields.pop("actuated")])
        else:
            yield " ".join([*head, fields.pop("joint"), fields.pop("limits")]).rstrip()
        yield "  ".join(fields.values())


def written_limits(connection: Connection) -> tuple[JointLimits, ...]:
    """Return the limits that a dialect which demands them must have: a whole turn where there are none."""
    turn = JointLimits(-math.pi, math.pi)
    return connection.limits or (turn,) * _WHOLE_TURNS.get(connection.joint, 0)


def _field(connection: Connection, name: str, dialect: Dialect, rules: DialectRules) -> str:
    if name == "actuated":
        return connection.actuated or "Actuated"
    if name == "joint":
        return connection.joint.value
    if name == "limits":
        return _limits(connection, rules) if VOCABULARIES[dialect].limits else ""
    if name == "dh":
        return _dh(connection, rules)
    return pose_words(connection.to_dh if name == "to_dh" else connection.to_body, rules.pose_angle)


def _limits(connection: Connection, rules: DialectRules) -> str:
    unit = 1.0 if connection.joint is JointType.PRISMATIC else rules.configuration_angle
    return " ".join(f"{decimal(x.lower, unit)}:{decimal(x.upper, unit)}" for x in written_limits(connection))


def _dh(connection: Connection, rules: DialectRules) -> str:
    dh, unit = connection.dh, rules.dh_angle
    words = [decimal(dh.alpha, unit), short(dh.a), short(dh.d), decimal(dh.theta, unit)]
    if connection.sma is not None:
        words += [short(connection.sma.length), short(connection.sma.width)]
    return " ".join(words)


_RESOLUTION_TAGS = {
    "position": "PositionRes",
    "position_factor": "PositionResFactor",
    "orientation": "Orientation",
    "time": "TimeRes",
    "rd": "RDRes",
}
# They stand in front of their bodies, where they are written anew.
_DIRECTIVES = ("#VIZMO_COLOR", "#VIZMO_NAME")
# Dialect A's reader has 256 characters for a comment.
_LONGEST_HEADER = 240


def env_text(environment: Environment) -> str:
    """Return an environment as text of its own dialect, comments at the top.

    Robots that have files of their own are left out: `robot_text` writes them. What the dialect cannot express is left
    out, too; `translate` says what that is, also where it is asked for the dialect that the environment has.
    """
    dialect = environment.dialect
    inside = [m for m in environment.multibodies if m.robot_file is None]
    legacy = VOCABULARIES[dialect].legacy_layout
    comments = _legacy_comments(environment) if legacy else _comments(environment.comments)
    lines = [*comments, *_preamble(environment)]
    lines.append(str(len(inside)))
    for multibody in inside:
        lines.append("")
        lines += _legacy(multibody, environment.semantics) if legacy else _later(multibody, dialect)
    return _joined(lines)


def robot_text(robot: MultiBody) -> str:
    """Return a robot as the text of a dialect E robot file."""
    return _joined(_robot(robot, Dialect.E))


def _joined(lines: Iterable[str]) -> str:
    # The original readers of dialects B to E fail on a file that ends with its last word.
    return "".join(f"{line}\n" for line in lines)


def _comments(comments: Iterable[Comment]) -> Iterator[str]:
    return (c.text for c in comments if c.text.split()[0] not in _DIRECTIVES)


def _legacy_comments(environment: Environment) -> Iterator[str]:
    """Yield comments that dialect A's reader takes in front of the count (env-format section 3.1)."""
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


def _preamble(environment: Environment) -> Iterator[str]:
    vocabulary = VOCABULARIES[environment.dialect]
    if not vocabulary.boundaries or environment.boundary is None:
        return
    yield f"Boundary {_boundary(environment.boundary, vocabulary.brackets)}"
    yield from _resolution(environment.resolution, environment.dialect)
    yield ""
    yield "Multibodies"


def _boundary(boundary: Boundary, brackets: bool) -> str:
    ranges = [f"{short(a)}:{short(b)}" for a, b in zip(boundary.lower, boundary.upper, strict=True)]
    parts = ranges or [" ".join(map(short, boundary.center)), short(boundary.radius)]
    # Brackets and semicolons are words of their own to the original (env-format section 7).
    extent = f"[ {' ; '.join(parts)} ]" if brackets else " ".join(parts)
    return f"{boundary.shape.value} {extent}"


def _resolution(resolution: Resolution, dialect: Dialect) -> Iterator[str]:
    for name in VOCABULARIES[dialect].resolution:
        value: float | None = getattr(resolution, name)
        if value is not None:
            unit = RULES[dialect].configuration_angle if name == "orientation" else 1.0
            yield f"{_RESOLUTION_TAGS[name]} {decimal(value, unit)}"


def _legacy(multibody: MultiBody, semantics: str) -> Iterator[str]:
    internal = multibody.kind is MultiBodyKind.INTERNAL
    yield f"MultiBody {'Passive Internal' if internal else multibody.kind.value}"
    yield str(len(multibody.bodies))
    yield from legacy_bodies(multibody.bodies)
    yield from connection_lines(multibody.connections, Dialect.A, Grammar.of(Dialect.A, semantics).rules)


def _later(multibody: MultiBody, dialect: Dialect) -> Iterator[str]:
    if multibody.kind is MultiBodyKind.SURFACE:
        labelled = multibody.label is not None and VOCABULARIES[dialect].surface_labels is not SurfaceLabels.NONE
        yield f"Surface {multibody.label}" if labelled else "Surface"
        yield from static_body(multibody.bodies[0], dialect, VOCABULARIES[dialect])
        return
    yield multibody.kind.value
    if not multibody.moves:
        yield from static_body(multibody.bodies[0], dialect, VOCABULARIES[dialect])
        return
    yield from _robot(multibody, dialect)
    if multibody.velocity_bounds is not None:
        yield f"VelocityBounds {short(multibody.velocity_bounds.linear)} {short(multibody.velocity_bounds.angular)}"
        yield f"Controls {len(multibody.controls)}"
        yield from (" ".join(map(short, control)) for control in multibody.controls)


def _robot(robot: MultiBody, dialect: Dialect) -> Iterator[str]:
    vocabulary = VOCABULARIES[dialect]
    yield str(len(robot.bodies))
    for body in robot.bodies:
        yield from robot_body(body, dialect, vocabulary)
    if robot.adjacencies and vocabulary.adjacencies:
        yield "Adjacencies"
        yield str(len(robot.adjacencies))
        yield from (f"{i} {j}" for i, j in robot.adjacencies)
    yield from connection_lines(robot.connections, dialect, RULES[dialect])
