"""The bodies of a multibody, with options, mass, base and pose, and the connections between them."""

from __future__ import annotations

import re
from dataclasses import replace

from ..diagnostics import DiagnosticLog
from ..errors import Span
from ..model.dialects import DialectRules
from ..model.environment import (
    BaseKind,
    Body,
    Connection,
    DHParameters,
    Dialect,
    JointLimits,
    JointType,
    Pose,
    Recentring,
    SMAShape,
)
from .blocks import is_multibody_tag, read_color, read_counted, read_dh, read_pose, read_range, with_directives
from .lexer import Scanner, Token, misspelling

_LEGACY_TAGS = {"FreeBody": True, "FixedBody": False}
_BASES = {"Planar": "Planar", "Volumetric": "Volumetric", "Fixed": "Fixed", "Joint": "Joint"}
_MOVEMENTS = {"Rotational": "Rotational", "Translational": "Translational"}
_ADJUSTMENTS = {r.value.lower(): r for r in Recentring}
# One letter behind a minus sign: neither a coordinate nor `-nan`.
_OPTION = re.compile(r"-([A-Za-z])(?![A-Za-z])")
_OPTION_TEXT = re.compile(r"([^)\r\n]*)(?=\))")
_LEGACY_JOINTS = {"Revolute": JointType.REVOLUTE, "Prismatic": JointType.PRISMATIC}
_LATER_JOINTS = {j.value: j for j in JointType}
_LIMIT_COUNT = {JointType.REVOLUTE: 1, JointType.PRISMATIC: 1, JointType.SPHERICAL: 2, JointType.SMA: 1}
_LIMIT_NEXT = re.compile(r"[+-]?[0-9.]\S*\s*:")
# A hinge between -2 pi and 2 pi is still meant; beyond that the limits are hardly fractions of pi.
_SUSPICIOUS_LIMIT = 2.0
_CONNECTION_TAGS = ("Connections", "Connection")

SELF_CONNECTION = "a connection from body {} to itself; expected two bodies"


def read_legacy_body(scan: Scanner, rules: DialectRules, first: bool) -> Body:
    """Read dialect A's `FreeBody index file [pose]` or `FixedBody index file pose`; `first` of its multibody or not."""
    comments = scan.take_directives()
    # The original takes every word but `FixedBody` for `FreeBody`, and compares its case.
    free = scan.keyword(_LEGACY_TAGS, "body tag", code="ENV122", exact_case=rules.keyword_case)
    index = scan.integer("the index of the body")
    filename = scan.word("a mesh file", whole=True)
    pose = read_pose(scan, rules) if not free or scan.next_is_number() else None
    free_base = BaseKind.VOLUMETRIC_ROTATIONAL if first else BaseKind.JOINT
    span = scan.source.span(filename.start, filename.end)
    base = free_base if free else BaseKind.FIXED
    body = Body(filename.text, base, pose, rules.recentring, index=index, span=span)
    return with_directives(scan, body, comments)


def read_robot_body(scan: Scanner, rules: DialectRules) -> Body:
    """Read `file [options] [mass] base`."""
    comments = scan.take_directives()
    body = _read_mesh(scan, rules, scan.word("a mesh file", whole=True))
    if scan.next_is_number():
        body = replace(body, mass=_read_mass(scan))
    base, pose = _read_base(scan, rules)
    return with_directives(scan, replace(body, base=base, pose=pose), comments)


def read_static_body(scan: Scanner, rules: DialectRules) -> Body:
    """Read `file [options] pose`."""
    return _with_pose(scan, rules, scan.word("a mesh file", whole=True))


def read_surface_body(scan: Scanner, rules: DialectRules) -> tuple[str | None, Body]:
    """Read `[label] file [options] pose`."""
    first = scan.word("a label or a mesh file", whole=True)
    # Older builds of the planner have no label: the file name stands first then.
    if scan.next_is_number() or scan.next_matches(_OPTION):
        return None, _with_pose(scan, rules, first)
    return first.text, read_static_body(scan, rules)


def _with_pose(scan: Scanner, rules: DialectRules, filename: Token) -> Body:
    comments = scan.take_directives()
    body = _read_mesh(scan, rules, filename)
    # Dialect E lets an obstacle say `Fixed` before its pose.
    if misspelling(scan.peek_word(), _BASES) is not None:
        start = scan.position
        base, pose = _read_base(scan, rules)
        if base is not BaseKind.FIXED:
            message = f"an obstacle with a {base.value} base; expected Fixed or a pose"
            scan.fail("ENV123", message, hint="robots have files of their own", span=scan.span(start))
    else:
        pose = read_pose(scan, rules)
    return with_directives(scan, replace(body, pose=pose), comments)


def _read_mesh(scan: Scanner, rules: DialectRules, filename: Token) -> Body:
    """Read the options behind a file name, in any order; blanks are free."""
    span = scan.source.span(filename.start, filename.end)
    body = Body(filename.text, BaseKind.FIXED, recentring=rules.recentring, span=span)
    while (option := scan.next_matches(_OPTION)) is not None:
        scan.advance(option.end())
        body = _read_option(scan, body, option.group(1).lower(), option.start())
    return body


def _read_option(scan: Scanner, body: Body, letter: str, start: int) -> Body:
    if letter not in "act":
        message = f"unknown body option -{letter}; expected -a(...), -c(...) or -t(...)"
        hint = "write -a for the adjustment, -c for the colour, -t for the texture"
        scan.fail("ENV124", message, hint=hint, span=scan.span(start))
    scan.punctuation("(", f"after -{letter}")
    if letter == "c":
        body = replace(body, color=read_color(scan))
    else:
        match = scan.next_matches(_OPTION_TEXT)
        if match is None:
            scan.fail_expected(f"')' at the end of -{letter}(...)")
        scan.advance(match.end())
        text = match.group(1).strip()
        if letter == "t":
            body = replace(body, texture=text)
        elif text.lower() in _ADJUSTMENTS:
            body = replace(body, recentring=_ADJUSTMENTS[text.lower()])
        else:
            message = f"unknown adjustment {text!r}; expected COM, Surface or None"
            scan.fail("ENV124", message, hint="write -a(COM), -a(Surface) or -a(None)", span=scan.span(start))
    scan.punctuation(")", f"at the end of -{letter}(...)")
    return body


def _read_mass(scan: Scanner) -> float:
    start = scan.position
    mass = scan.number("mass")
    if mass <= 0:
        hint = "leave it out to have it computed from the density"
        scan.fail("ENV118", f"mass {mass:g}; expected a positive number", hint=hint, span=scan.span(start))
    return mass


def _read_base(scan: Scanner, rules: DialectRules) -> tuple[BaseKind, Pose | None]:
    word = scan.keyword(_BASES, "base", code="ENV123")
    if word == "Fixed":
        return BaseKind.FIXED, read_pose(scan, rules)
    if word == "Joint":
        return BaseKind.JOINT, None
    return BaseKind(f"{word} {scan.keyword(_MOVEMENTS, 'movement', code='ENV123')}"), None


def read_connections(scan: Scanner, rules: DialectRules, bodies: int) -> tuple[Connection, ...]:
    """Read a tag, a count and connections."""
    _read_connection_tag(scan, rules)
    return read_counted(scan, "connection", "connections", lambda _: _read_connection(scan, rules, bodies))


def _read_connection(scan: Scanner, rules: DialectRules, bodies: int) -> Connection:
    """Read one connection, its fields in the dialect's order."""
    start = scan.position
    previous = read_body_index(scan, bodies)
    following = read_body_index(scan, bodies)
    span = scan.span(start)
    if previous == following:
        hint = "a connection leads from a parent to its child"
        scan.fail("ENV116", SELF_CONNECTION.format(previous), hint=hint, span=span)
    joint, limits, sma, actuated = JointType.REVOLUTE, (), None, None
    poses: dict[str, Pose] = {}
    dh = DHParameters()
    for name in rules.connection_fields:
        if name == "actuated":
            actuated = scan.word("a tag such as Actuated").text
        elif name == "joint":
            joint = _read_joint(scan, rules)
        elif name == "limits":
            limits = _read_all_limits(scan, rules, joint)
        elif name == "dh":
            dh = read_dh(scan, rules)
            if joint is JointType.SMA:
                sma = SMAShape(*scan.numbers("length width"))
        else:
            poses[name] = read_pose(scan, rules)
    return Connection(previous, following, joint, poses["to_dh"], dh, poses["to_body"], limits, actuated, sma, span)


def read_limits(scan: Scanner, rules: DialectRules, joint: JointType) -> JointLimits:
    """Read one `lower:upper` of a joint: lengths for a slide, else fractions of pi."""
    start = scan.position
    lower, upper = read_range(scan, "a joint's limits")
    span = scan.span(start)
    if joint is JointType.PRISMATIC:
        return JointLimits(lower, upper, span)
    if max(abs(lower), abs(upper)) > _SUSPICIOUS_LIMIT:
        message = f"limits {lower:g}:{upper:g} are fractions of pi, here more than a whole turn either way"
        scan.log.warn("ENV305", joint.value, message, hint="write -1:1 for a whole turn", span=span)
    unit = rules.configuration_angle
    return JointLimits(lower * unit, upper * unit, span)


def read_body_index(scan: Scanner, bodies: int) -> int:
    """Read the index of one of a multibody's bodies."""
    start = scan.position
    index = scan.integer("the index of a body")
    if not 0 <= index < bodies:
        message = f"body index {index} is out of range; this multibody has {bodies} bodies, 0 to {bodies - 1}"
        scan.fail("ENV115", message, hint="bodies are counted from 0 in the order of the file", span=scan.span(start))
    return index


def warn_of_no_limits(log: DiagnosticLog, rules: DialectRules, joint: JointType, span: Span) -> None:
    """Warn that a joint has no limits in a dialect that demands them."""
    unbounded = joint is JointType.PRISMATIC
    message = (
        f"{joint.value} without limits in dialect {rules.dialect}; expected min:max, read as "
        f"{'unbounded' if unbounded else '-1:1'}"
    )
    hint = "write the limits behind the joint type" if unbounded else "write -1:1"
    log.warn("ENV204", joint.value, message, hint=hint, span=span)


def _read_connection_tag(scan: Scanner, rules: DialectRules) -> None:
    start = scan.position
    word = scan.peek_word()
    tag = next((t for t in _CONNECTION_TAGS if t.lower() == word.lower()), None) or misspelling(word, _CONNECTION_TAGS)
    if tag is None and not rules.plural_connections and word.isalpha() and not is_multibody_tag(word):
        # The readers of A, B and early C take any word here.
        scan.word("a tag")
        message = f"{word!r} stands where 'Connections' was expected"
        scan.log.warn("ENV202", word, message, hint="write Connections", span=scan.span(start))
        return
    tag = scan.keyword({t: t for t in _CONNECTION_TAGS}, "tag")
    if tag == "Connection" and rules.plural_connections:
        message = f"dialect {rules.dialect} spells this tag 'Connections'"
        scan.log.warn("ENV205", tag, message, hint="write Connections", span=scan.span(start))


def _read_joint(scan: Scanner, rules: DialectRules) -> JointType:
    legacy = rules.dialect is Dialect.A
    start = scan.position
    joints = _LEGACY_JOINTS if legacy else _LATER_JOINTS
    joint = scan.keyword(joints, "joint type", code="ENV121", exact_case=rules.keyword_case)
    if joint is JointType.PRISMATIC:
        message = (
            "a Prismatic connection slides along the DH z axis, its value replacing d; "
            "the original planner turned it by theta instead"
            if legacy
            else "Prismatic is not a joint type of the original planner in this dialect; read as a slide"
        )
        scan.log.info("ENV304", "Prismatic", message, span=scan.span(start))
    return joint


def _read_all_limits(scan: Scanner, rules: DialectRules, joint: JointType) -> tuple[JointLimits, ...]:
    count = _LIMIT_COUNT.get(joint, 0)
    if not count:
        return ()
    if scan.next_matches(_LIMIT_NEXT):
        return tuple(read_limits(scan, rules, joint) for _ in range(count))
    if rules.dialect is not Dialect.B:
        warn_of_no_limits(scan.log, rules, joint, scan.span())
    return ()
