"""The blocks that several dialects share: poses, DH rows, connections, counted lists."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

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
    MultiBodyKind,
    Pose,
    SMAShape,
)
from .lexer import Scanner, misspelling, parse_number

T = TypeVar("T")

# An angle beyond two turns is hardly one in radians: it is taken for one in degrees.
_SUSPICIOUS_RADIANS = 4 * math.pi
# A hinge between -2 pi and 2 pi is still meant; beyond that the limits are hardly fractions of pi.
_SUSPICIOUS_LIMIT = 2.0

_LEGACY_JOINTS = {"Revolute": JointType.REVOLUTE, "Prismatic": JointType.PRISMATIC}
_LATER_JOINTS = {j.value: j for j in JointType}
_LIMIT_COUNT = {JointType.REVOLUTE: 1, JointType.PRISMATIC: 1, JointType.SPHERICAL: 2, JointType.SMA: 1}
_LIMIT_NEXT = re.compile(r"[+-]?[0-9.]\S*\s*:")
_MULTIBODY_TAGS = {"multibody", *(k.value.lower() for k in MultiBodyKind)}
_CONNECTION_TAGS = ("Connections", "Connection")


@dataclass(frozen=True, slots=True)
class Grammar:
    """A dialect's rules as one file is read with them.

    Attributes:
        dialect: The dialect.
        rules: Its table, with the changes that `semantics` makes.
    """

    dialect: Dialect
    rules: DialectRules

    @classmethod
    def of(cls, dialect: Dialect, semantics: str = "planner") -> Grammar:
        """Look the dialect up; `page` swaps the two transforms of dialect A and takes textbook DH (design: section 4)."""
        rules = RULES[dialect]
        if semantics == "page" and dialect is Dialect.A:
            swapped = ("actuated", "to_dh", "dh", "joint", "to_body")
            rules = replace(rules, connection_fields=swapped, dh_form=DHForm.STANDARD)
        return cls(dialect, rules)


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


def read_color(scan: Scanner) -> tuple[float, float, float, float]:
    """Read `red green blue alpha`, each 0 to 1."""
    start = scan.position
    r, g, b, a = scan.numbers("red green blue alpha")
    if not all(0 <= c <= 1 for c in (r, g, b, a)):
        scan.log.warn(
            FormatError, "ENV215", "color", f"colour {r:g} {g:g} {b:g} {a:g}; expected four numbers from 0 to 1",
            hint="divide by 255 where they are bytes", span=scan.span(start),
        )  # fmt: skip
    return r, g, b, a


def read_range(scan: Scanner, what: str) -> tuple[float, float]:
    """Read `lower:upper`."""
    start = scan.position
    lower = scan.number(f"lower end of {what}")
    scan.punctuation(":", f"between the two ends of {what}")
    upper = scan.number(f"upper end of {what}")
    if lower > upper:
        scan.fail(
            "ENV114", f"{what} {lower:g}:{upper:g} is empty; expected lower:upper",
            hint=f"write {upper:g}:{lower:g}", span=scan.span(start),
        )  # fmt: skip
    return lower, upper


def read_limits(scan: Scanner, grammar: Grammar, joint: JointType) -> JointLimits:
    """Read one `lower:upper` of a joint: lengths for a slide, else fractions of pi (env-format section 12)."""
    start = scan.position
    lower, upper = read_range(scan, "a joint's limits")
    span = scan.span(start)
    if joint is JointType.PRISMATIC:
        return JointLimits(lower, upper, span)
    if max(abs(lower), abs(upper)) > _SUSPICIOUS_LIMIT:
        scan.log.warn(
            FormatError, "ENV305", joint.value,
            f"limits {lower:g}:{upper:g} are fractions of pi, here more than a whole turn either way",
            hint="write -1:1 for a whole turn", span=span,
        )  # fmt: skip
    unit = grammar.rules.configuration_angle
    return JointLimits(lower * unit, upper * unit, span)


def read_body_index(scan: Scanner, bodies: int) -> int:
    """Read the index of one of a multibody's bodies."""
    start = scan.position
    index = scan.integer("the index of a body")
    if not 0 <= index < bodies:
        scan.fail(
            "ENV115",
            f"body index {index} is out of range; this multibody has {bodies} bodies, 0 to {bodies - 1}",
            hint="bodies are counted from 0 in the order of the file", span=scan.span(start),
        )  # fmt: skip
    return index


def read_connection(scan: Scanner, grammar: Grammar, bodies: int) -> Connection:
    """Read one connection, its fields in the dialect's order (env-format sections 4.1 and 5)."""
    start = scan.position
    previous = read_body_index(scan, bodies)
    following = read_body_index(scan, bodies)
    span = scan.span(start)
    check_not_itself(scan, previous, following, span)
    joint, limits, sma, actuated = JointType.REVOLUTE, (), None, None
    poses: dict[str, Pose] = {}
    dh = DHParameters()
    for name in grammar.rules.connection_fields:
        if name == "actuated":
            actuated = scan.word("a tag such as Actuated").text
        elif name == "joint":
            joint = _read_joint(scan, grammar)
        elif name == "limits":
            limits = _read_all_limits(scan, grammar, joint)
        elif name == "dh":
            dh = read_dh(scan, grammar)
            if joint is JointType.SMA:
                sma = SMAShape(*scan.numbers("length width"))
        else:
            poses[name] = read_pose(scan, grammar)
    return Connection(previous, following, joint, poses["to_dh"], dh, poses["to_body"], limits, actuated, sma, span)


def check_not_itself(scan: Scanner, previous: int, following: int, span: Span) -> None:
    """Refuse a connection from a body to itself."""
    if previous == following:
        scan.fail(
            "ENV116", f"a connection from body {previous} to itself; expected two bodies",
            hint="a connection leads from a parent to its child", span=span,
        )  # fmt: skip


def read_connections(scan: Scanner, grammar: Grammar, bodies: int) -> tuple[Connection, ...]:
    """Read a tag, a count and connections."""
    _read_connection_tag(scan, grammar)
    return read_counted(
        scan, "connection", scan.limits.connections, lambda: read_connection(scan, grammar, bodies)
    )  # fmt: skip


def read_counted(scan: Scanner, what: str, at_most: int, read: Callable[[], T]) -> tuple[T, ...]:
    """Read a count and the entries that are really there; each entry begins with a number."""
    start = scan.position
    declared = scan.count(f"the number of {_plural(what)}", at_most, "connections")
    span = scan.span(start)
    found: list[T] = []
    while scan.next_is_number():
        check_limit(scan, len(found) + 1, at_most, what, "connections")
        found.append(read())
    check_count(scan, declared, len(found), what, span)
    return tuple(found)


def check_count(scan: Scanner, declared: int, found: int, what: str, span: Span) -> None:
    """Warn where a file declares another number of things than it has.

    Raises:
        FormatError: The file ends too early: one that is cut off must not read as another robot.
    """
    if found < declared and scan.at_end():
        scan.fail_expected(f"{what} {found + 1} of {declared}")
    if declared != found:
        warn_of_count(scan, declared, found, what, span)


def warn_of_count(scan: Scanner, declared: int, found: int, what: str, span: Span) -> None:
    """Warn that a file declares another number of things than it has."""
    plural = _plural(what)
    scan.log.warn(
        FormatError, "ENV203", plural,
        f"the file declares {declared} {what if declared == 1 else plural} and has {found}; read {found}",
        hint=f"write {found}", span=span,
    )  # fmt: skip


def check_limit(scan: Scanner, found: int, at_most: int, what: str, limit: str) -> None:
    """Refuse more things than `limits` allow; `limit` is the name of the field."""
    if found > at_most:
        scan.fail("ENV110", f"more than {at_most} {_plural(what)}", hint=f"raise limits=Limits({limit}=...)")


def with_directives(scan: Scanner, body: Body, comments: Sequence[Comment]) -> Body:
    """Apply `#VIZMO_COLOR` and `#VIZMO_NAME` lines to a body that has no colour of its own (env-format section 3.1)."""
    color, label = None, None
    for comment in comments:
        words = comment.text.split()
        if words[0] == "#VIZMO_COLOR":
            color = _directive_color(scan, comment, words[1:4])
        elif words[0] == "#VIZMO_NAME" and len(words) >= 2:
            label = " ".join(words[1:])
    return replace(body, color=body.color or color, label=body.label or label)


def _directive_color(
    scan: Scanner, comment: Comment, words: Sequence[str]
) -> tuple[float, float, float, float] | None:
    rgb = [c for w in words if (c := parse_number(w)) is not None and 0 <= c <= 1]
    if len(rgb) != 3:
        scan.log.warn(
            FormatError, "ENV215", "#VIZMO_COLOR", "a colour that is not used; expected three numbers from 0 to 1",
            hint="write #VIZMO_COLOR red green blue", span=comment.span,
        )  # fmt: skip
        return None
    return rgb[0], rgb[1], rgb[2], 1.0


def _read_connection_tag(scan: Scanner, grammar: Grammar) -> None:
    start = scan.position
    word = scan.peek_word()
    tag = next((t for t in _CONNECTION_TAGS if t.lower() == word.lower()), None) or misspelling(word, _CONNECTION_TAGS)
    if tag is None and not grammar.rules.plural_connections and word.isalpha() and not is_multibody_tag(word):
        # The readers of A, B and early C take any word here.
        scan.word("a tag")
        scan.log.warn(
            FormatError, "ENV202", word, f"{word!r} stands where 'Connections' was expected", hint="write Connections",
            span=scan.span(start),
        )  # fmt: skip
        return
    tag = scan.keyword({t: t for t in _CONNECTION_TAGS}, "tag")
    if tag == "Connection" and grammar.rules.plural_connections:
        scan.log.warn(
            FormatError, "ENV205", tag, f"dialect {grammar.dialect} spells this tag 'Connections'",
            hint="write Connections", span=scan.span(start),
        )  # fmt: skip


def is_multibody_tag(word: str) -> bool:
    """Whether a word begins a multibody in some dialect."""
    return word.lower() in _MULTIBODY_TAGS


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


def _read_all_limits(scan: Scanner, grammar: Grammar, joint: JointType) -> tuple[JointLimits, ...]:
    count = _LIMIT_COUNT.get(joint, 0)
    if not count:
        return ()
    if scan.next_matches(_LIMIT_NEXT):
        return tuple(read_limits(scan, grammar, joint) for _ in range(count))
    if grammar.dialect is not Dialect.B:
        warn_of_no_limits(scan, grammar, joint, scan.span())
    return ()


def warn_of_no_limits(scan: Scanner, grammar: Grammar, joint: JointType, span: Span) -> None:
    """Warn that a joint has no limits in a dialect that demands them."""
    unbounded = joint is JointType.PRISMATIC
    scan.log.warn(
        FormatError, "ENV204", joint.value,
        f"{joint.value} without limits in dialect {grammar.dialect}; expected min:max, read as "
        f"{'unbounded' if unbounded else '-1:1'}",
        hint="write the limits behind the joint type" if unbounded else "write -1:1", span=span,
    )  # fmt: skip


def _plural(what: str) -> str:
    return {"body": "bodies", "multibody": "multibodies", "adjacency": "adjacencies"}.get(what, f"{what}s")
