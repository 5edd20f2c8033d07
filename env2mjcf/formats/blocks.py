"""The blocks that several dialects share: poses, DH rows, connections, counted lists."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from ..dialects import RULES, DialectRules
from ..errors import FormatError, Span
from ..model import (
    Body,
    Comment,
    Connection,
    DHForm,
    DHParameters,
    Dialect,
    JointLimits,
    JointType,
    Pose,
    SMAShape,
)
from .lexer import Scanner

# What a value beyond this is taken for: an angle in radians that is really in degrees.
_SUSPICIOUS_RADIANS = 4 * math.pi

_LEGACY_JOINTS = {"Revolute": JointType.REVOLUTE, "Prismatic": JointType.PRISMATIC}
_LATER_JOINTS = {j.value: j for j in JointType}
_LIMIT_COUNT = {JointType.REVOLUTE: 1, JointType.PRISMATIC: 1, JointType.SPHERICAL: 2, JointType.SMA: 1}
_LIMIT_NEXT = re.compile(r"[+-]?[\d.]\S*\s*:")


@dataclass(frozen=True, slots=True)
class Grammar:
    """A dialect's rules as one file is read with them.

    Attributes:
        dialect: The dialect.
        rules: Its table, with the changes that `semantics` makes.
        semantics: Whose reading of a dialect A connection applies.
    """

    dialect: Dialect
    rules: DialectRules
    semantics: str

    @classmethod
    def of(cls, dialect: Dialect, semantics: str) -> Grammar:
        """Look the dialect up; `page` swaps the two transforms of dialect A and takes textbook DH (design: section 4)."""
        rules = RULES[dialect]
        if semantics == "page" and dialect is Dialect.A:
            swapped = ("actuated", "to_dh", "dh", "joint", "to_body")
            rules = replace(rules, connection_fields=swapped, dh_form=DHForm.STANDARD)
        return cls(dialect, rules, semantics)


def read_pose(scan: Scanner, grammar: Grammar) -> Pose:
    """Read `x y z rx ry rz`."""
    start = scan.position
    x, y, z, rx, ry, rz = scan.numbers("x y z rx ry rz")
    unit = grammar.rules.pose_angle
    return Pose((x, y, z), (rx * unit, ry * unit, rz * unit), scan.span(start))


def read_dh(scan: Scanner, grammar: Grammar) -> DHParameters:
    """Read `alpha a d theta`."""
    start = scan.position
    alpha, a, d, theta = scan.numbers("alpha a d theta")
    span = scan.span(start)
    unit = grammar.rules.dh_angle
    if unit == 1.0 and max(abs(alpha), abs(theta)) > _SUSPICIOUS_RADIANS:
        scan.log.warn(
            FormatError, "ENV303", "DH parameters",
            f"alpha {alpha:g} and theta {theta:g} are read as radians in dialect {grammar.dialect}",
            hint="only dialect A has degrees here", span=span,
        )  # fmt: skip
    return DHParameters(alpha * unit, a, d, theta * unit, span)


def read_range(scan: Scanner, what: str) -> tuple[float, float]:
    """Read `lower:upper`."""
    start = scan.position
    lower = scan.number(f"lower end of {what}")
    scan.punctuation(":", f"between the two ends of {what}")
    upper = scan.number(f"upper end of {what}")
    if lower > upper:
        scan.fail("ENV114", f"{what} {lower:g}:{upper:g} is empty; expected lower:upper", span=scan.span(start))
    return lower, upper


def read_connection(scan: Scanner, grammar: Grammar, bodies: int) -> Connection:
    """Read one connection, its fields in the dialect's order (env-format sections 4.1 and 5)."""
    start = scan.position
    previous = _body_index(scan, bodies)
    following = _body_index(scan, bodies)
    span = scan.span(start)
    if previous == following:
        scan.fail("ENV116", f"a connection from body {previous} to itself", span=span)
    fields = grammar.rules.connection_fields
    actuated = scan.word("a tag such as Actuated").text if "actuated" in fields else None
    joint, limits, sma = JointType.REVOLUTE, (), None
    poses: dict[str, Pose] = {}
    dh = DHParameters()
    for name in fields[1:] if actuated is not None else fields:
        if name == "joint":
            joint = _read_joint(scan, grammar)
        elif name == "limits":
            limits = _read_limits(scan, grammar, joint)
        elif name == "dh":
            dh = read_dh(scan, grammar)
            if joint is JointType.SMA:
                sma = SMAShape(*scan.numbers("length width"))
        else:
            poses[name] = read_pose(scan, grammar)
    return Connection(
        previous, following, joint, poses["to_dh"], dh, poses["to_body"], limits, actuated, sma, span
    )  # fmt: skip


def read_connections(scan: Scanner, grammar: Grammar, bodies: int) -> tuple[Connection, ...]:
    """Read a count and the connections that are really there; a wrong count is a warning."""
    start = scan.position
    declared = scan.count("the number of connections", scan.limits.connections)
    span = scan.span(start)
    found: list[Connection] = []
    while len(found) < scan.limits.connections and scan.next_is_number():
        found.append(read_connection(scan, grammar, bodies))
    if len(found) < declared and scan.at_end():
        # A file that is cut off must not read as a shorter robot.
        scan.fail_expected(f"connection {len(found) + 1} of {declared}")
    check_count(scan, declared, len(found), "connection", span)
    return tuple(found)


def check_count(scan: Scanner, declared: int, found: int, what: str, span: Span) -> None:
    """Warn where a file declares another number of things than it has."""
    if declared != found:
        plural = {"body": "bodies", "multibody": "multibodies"}.get(what, f"{what}s")
        scan.log.warn(
            FormatError, "ENV203", plural,
            f"the file declares {declared} {what if declared == 1 else plural} and has {found}; read {found}",
            hint=f"write {found}", span=span,
        )  # fmt: skip


def directives(comments: Sequence[Comment]) -> tuple[tuple[float, float, float, float] | None, str | None]:
    """Return the colour and the label that `#VIZMO_COLOR` and `#VIZMO_NAME` lines give (env-format section 3.1)."""
    color, label = None, None
    for comment in comments:
        words = comment.text.split()
        if words[0] == "#VIZMO_COLOR" and len(words) >= 4:
            try:
                r, g, b = (float(w) for w in words[1:4])
            except ValueError:
                continue
            color = (r, g, b, 1.0)
        elif words[0] == "#VIZMO_NAME" and len(words) >= 2:
            label = " ".join(words[1:])
    return color, label


def with_directives(body: Body, comments: Sequence[Comment]) -> Body:
    """Apply visualiser directives to a body that has no colour of its own."""
    color, label = directives(comments)
    return replace(body, color=body.color or color, label=body.label or label)


def _body_index(scan: Scanner, bodies: int) -> int:
    start = scan.position
    index = scan.integer("the index of a body")
    if not 0 <= index < bodies:
        scan.fail(
            "ENV115",
            f"body index {index} is out of range; this multibody has {bodies} bodies, 0 to {bodies - 1}",
            span=scan.span(start),
        )
    return index


def _read_joint(scan: Scanner, grammar: Grammar) -> JointType:
    legacy = grammar.dialect is Dialect.A
    start = scan.position
    joint = scan.keyword(
        _LEGACY_JOINTS if legacy else _LATER_JOINTS, "joint type", code="ENV121", exact_case=grammar.rules.keyword_case
    )
    if joint is JointType.PRISMATIC:
        scan.log.info(
            "ENV304", "Prismatic",
            "a Prismatic connection slides along the DH z axis, its value replacing d; "
            "the original planner turned it by theta instead"
            if legacy else "Prismatic is not a joint type of the original planner in this dialect; read as a slide",
            span=scan.span(start),
        )  # fmt: skip
    return joint


def _read_limits(scan: Scanner, grammar: Grammar, joint: JointType) -> tuple[JointLimits, ...]:
    count = _LIMIT_COUNT.get(joint, 0)
    if not count:
        return ()
    if not _LIMIT_NEXT.match(scan.source.text, scan.position):
        if grammar.dialect is not Dialect.B:
            scan.log.warn(
                FormatError, "ENV204", joint.value,
                f"{joint.value} without limits in dialect {grammar.dialect}; expected min:max, read as -1:1",
                span=scan.span(),
            )  # fmt: skip
        return ()
    limits: list[JointLimits] = []
    for _ in range(count):
        start = scan.position
        lower, upper = read_range(scan, "a joint's limits")
        span = scan.span(start)
        # Limits of a slide are lengths; the others are fractions of pi (env-format section 12).
        unit = 1.0 if joint is JointType.PRISMATIC else grammar.rules.configuration_angle
        if joint is not JointType.PRISMATIC and max(abs(lower), abs(upper)) > 2:
            scan.log.warn(
                FormatError, "ENV305", joint.value,
                f"limits {lower:g}:{upper:g} are fractions of pi, here more than a whole turn",
                hint="write -1:1 for a whole turn", span=span,
            )  # fmt: skip
        limits.append(JointLimits(lower * unit, upper * unit, span))
    return tuple(limits)
