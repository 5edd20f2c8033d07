"""The blocks that several dialects share: poses, DH rows, ranges, colours, counted lists."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from ..dialects import RULES, DialectRules
from ..errors import FormatError, Span
from ..model import Body, Comment, DHForm, DHParameters, Dialect, MultiBodyKind, Pose
from ..options import LARGEST, Limits
from .lexer import Scanner, parse_number

T = TypeVar("T")

# An angle beyond two turns is hardly one in radians: it is taken for one in degrees.
_SUSPICIOUS_RADIANS = 4 * math.pi

_MULTIBODY_TAGS = {"multibody", *(k.value.lower() for k in MultiBodyKind)}


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
        """Look the dialect up; `page` swaps dialect A's two transforms and takes textbook DH (design: section 4)."""
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


def read_coordinate(scan: Scanner, what: str) -> float:
    """Read a number that is small enough to be computed with."""
    start = scan.position
    value = scan.number(what)
    if abs(value) > LARGEST:
        scan.fail(
            "ENV183", f"{what} is {value:g}; at most {LARGEST:g} can be computed with",
            hint="is the file damaged? What has no end is wide enough with 1e6", span=scan.span(start),
        )  # fmt: skip
    return value


def read_range(scan: Scanner, what: str) -> tuple[float, float]:
    """Read `lower:upper`."""
    start = scan.position
    lower = read_coordinate(scan, f"lower end of {what}")
    scan.punctuation(":", f"between the two ends of {what}")
    upper = read_coordinate(scan, f"upper end of {what}")
    if lower > upper:
        scan.fail(
            "ENV114", f"{what} {lower:g}:{upper:g} is empty; expected lower:upper",
            hint=f"write {upper:g}:{lower:g}", span=scan.span(start),
        )  # fmt: skip
    return lower, upper


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
        scan.fail("ENV110", f"more than {at_most} {_plural(what)}", hint=Limits.hint(limit))


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


def _directive_color(scan: Scanner, comment: Comment, words: Sequence[str]) -> tuple[float, float, float, float] | None:
    rgb = [c for w in words if (c := parse_number(w)) is not None and 0 <= c <= 1]
    if len(rgb) != 3:
        scan.log.warn(
            FormatError, "ENV215", "#VIZMO_COLOR", "a colour that is not used; expected three numbers from 0 to 1",
            hint="write #VIZMO_COLOR red green blue", span=comment.span,
        )  # fmt: skip
        return None
    return rgb[0], rgb[1], rgb[2], 1.0


def is_multibody_tag(word: str) -> bool:
    """Whether a word begins a multibody in some dialect."""
    return word.lower() in _MULTIBODY_TAGS


def _plural(what: str) -> str:
    return {"body": "bodies", "multibody": "multibodies", "adjacency": "adjacencies"}.get(what, f"{what}s")
