"""Blocks that several dialects share, in text and XML: poses, DH rows, colours, ranges, boundaries, counted lists."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

from ..errors import Span
from ..limits import LARGEST, Limits
from ..model.dialects import DialectRules
from ..model.environment import Body, Boundary, BoundaryShape, Comment, DHParameters, MultiBodyKind, Pose
from .lexer import Scanner, parse_number

T = TypeVar("T")

# An angle beyond two turns was probably meant in degrees.
_SUSPICIOUS_RADIANS = 4 * math.pi

_MULTIBODY_TAGS = {"multibody", *(k.value.lower() for k in MultiBodyKind)}

SHAPES = {s.value: s for s in BoundaryShape}


def read_pose(scan: Scanner, rules: DialectRules) -> Pose:
    """Read `x y z rx ry rz`."""
    start = scan.position
    x, y, z, rx, ry, rz = scan.numbers("x y z rx ry rz")
    unit = rules.pose_angle
    return Pose((x, y, z), (rx * unit, ry * unit, rz * unit), scan.span(start))


def read_dh(scan: Scanner, rules: DialectRules) -> DHParameters:
    """Read `alpha a d theta`."""
    start = scan.position
    alpha, a, d, theta = scan.numbers("alpha a d theta")
    span = scan.span(start)
    unit = rules.dh_angle
    if unit == 1.0 and max(abs(alpha), abs(theta)) > _SUSPICIOUS_RADIANS:
        message = f"alpha {alpha:g} and theta {theta:g} are read as radians in dialect {rules.dialect}"
        scan.log.warn("ENV303", "DH parameters", message, hint="only dialect A has degrees here", span=span)
    return DHParameters(alpha * unit, a, d, theta * unit, span)


def read_color(scan: Scanner) -> tuple[float, float, float, float]:
    """Read `red green blue alpha`, each 0 to 1."""
    start = scan.position
    r, g, b, a = scan.numbers("red green blue alpha")
    if not all(0 <= c <= 1 for c in (r, g, b, a)):
        message = f"colour {r:g} {g:g} {b:g} {a:g}; expected four numbers from 0 to 1"
        scan.log.warn("ENV215", "color", message, hint="divide by 255 where they are bytes", span=scan.span(start))
    return r, g, b, a


def read_coordinate(scan: Scanner, what: str) -> float:
    """Read a number that is small enough to be computed with."""
    start = scan.position
    value = scan.number(what)
    if abs(value) > LARGEST:
        message = f"{what} is {value:g}; at most {LARGEST:g} can be computed with"
        hint = "is the file damaged? For a range without end, 1e6 is wide enough"
        scan.fail("ENV183", message, hint=hint, span=scan.span(start))
    return value


def read_range(scan: Scanner, what: str) -> tuple[float, float]:
    """Read `lower:upper`."""
    start = scan.position
    lower = read_coordinate(scan, f"lower end of {what}")
    scan.punctuation(":", f"between the two ends of {what}")
    upper = read_coordinate(scan, f"upper end of {what}")
    if lower > upper:
        message = f"{what} {lower:g}:{upper:g} is empty; expected lower:upper"
        scan.fail("ENV114", message, hint=f"write {upper:g}:{lower:g}", span=scan.span(start))
    return lower, upper


def read_counted(
    scan: Scanner,
    what: str,
    limit: str,
    read: Callable[[int], T],
    follows: Callable[[bool], bool] | None = None,
    *,
    required: bool = False,
) -> tuple[T, ...]:
    """Read a count and the entries that are really there; warn where these are two numbers.

    Args:
        scan: Stands in front of the count.
        what: What an entry is called.
        limit: The field of `Limits` that bounds them.
        read: Reads an entry, given how many came before.
        follows: Whether an entry comes next, given whether one is due; None: each begins with a number.
        required: Whether one entry is needed.

    Raises:
        FormatError: The file ends too early: one that is cut off must not read as another robot.
    """
    start = scan.position
    declared = scan.count(f"the number of {_plural(what)}", limit)
    span = scan.span(start)
    found: list[T] = []
    while follows(len(found) < declared) if follows else scan.next_is_number():
        check_limit(scan, len(found) + 1, what, limit)
        found.append(read(len(found)))
    if len(found) < declared and scan.at_end():
        scan.fail_expected(f"{what} {len(found) + 1} of {declared}")
    if declared != len(found):
        warn_of_count(scan, declared, len(found), what, span)
    if required and not found:
        message = f"a multibody without {_plural(what)}; expected one or more"
        scan.fail("ENV117", message, hint="remove the multibody", span=span)
    return tuple(found)


def warn_of_count(scan: Scanner, declared: int, found: int, what: str, span: Span) -> None:
    """Warn that a file declares another number of things than it has."""
    plural = _plural(what)
    message = f"the file declares {declared} {what if declared == 1 else plural} and has {found}; read {found}"
    scan.log.warn("ENV203", plural, message, hint=f"write {found}", span=span)


def check_limit(scan: Scanner, found: int, what: str, limit: str) -> None:
    """Refuse more things than `Limits` allow in the field `limit`."""
    at_most = getattr(scan.limits, limit)
    if found > at_most:
        scan.fail("ENV110", f"more than {at_most} {_plural(what)}", hint=Limits.hint(limit))


def with_directives(scan: Scanner, body: Body, comments: Sequence[Comment]) -> Body:
    """Apply `#VIZMO_COLOR` and `#VIZMO_NAME` lines to a body that has no colour of its own."""
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
        message = "a colour that is not used; expected three numbers from 0 to 1"
        scan.log.warn("ENV215", "#VIZMO_COLOR", message, hint="write #VIZMO_COLOR red green blue", span=comment.span)
        return None
    return rgb[0], rgb[1], rgb[2], 1.0


def is_multibody_tag(word: str) -> bool:
    """Whether a word begins a multibody in some dialect."""
    return word.lower() in _MULTIBODY_TAGS


def _plural(what: str) -> str:
    return {"body": "bodies", "multibody": "multibodies", "adjacency": "adjacencies"}.get(what, f"{what}s")


def read_boundary(scan: Scanner) -> Boundary:
    """Read what follows the word `Boundary`, with or without brackets."""
    start = scan.position
    if scan.peek() == "[":
        # The newest planner's own writer leaves the word out.
        shape = BoundaryShape.BOX
        hint = "write Boundary Box ["
        scan.log.warn("ENV206", "Boundary", "a boundary without a shape; read as Box", hint=hint, span=scan.span())
        return read_extent(scan, shape, scan.span())
    shape = scan.keyword(SHAPES, "boundary shape", code="ENV125")
    return read_extent(scan, shape, scan.span(start))


def read_extent(scan: Scanner, shape: BoundaryShape, span: Span) -> Boundary:
    """Read the ranges of a box, or the centre and radius of a ball, in brackets or as dialect C has them."""
    brackets = scan.peek() == "["
    if brackets:
        scan.punctuation("[", "before the boundary")
    read = _read_box if shape in (BoundaryShape.BOX, BoundaryShape.BOX2D) else _read_ball
    boundary = read(scan, shape, span, brackets)
    if brackets:
        scan.punctuation("]", "after the boundary")
    return boundary


def _read_box(scan: Scanner, shape: BoundaryShape, span: Span, brackets: bool) -> Boundary:
    ranges = [read_range(scan, "the x range of the boundary")]
    while len(ranges) < 3 and _range_follows(scan, brackets):
        if brackets:
            scan.punctuation(";", "between two ranges")
        ranges.append(read_range(scan, f"the {'xyz'[len(ranges)]} range of the boundary"))
    if len(ranges) < 2:
        hint = "write lower:upper for each axis"
        scan.fail("ENV119", "a box with one range; expected two or three (x, y and perhaps z)", hint=hint, span=span)
    if shape is BoundaryShape.BOX2D and len(ranges) == 3:
        scan.log.warn("ENV207", "Boundary", "Box2D with three ranges; all are used", hint="write Box", span=span)
    if shape is BoundaryShape.BOX and len(ranges) == 2:
        scan.log.info("ENV302", "Boundary", "a Box with two ranges leaves z unbounded", span=span)
    return Boundary(shape, lower=tuple(r[0] for r in ranges), upper=tuple(r[1] for r in ranges), span=span)


def _range_follows(scan: Scanner, brackets: bool) -> bool:
    if brackets:
        return scan.peek() == ";"
    # Dialect C ends the boundary with its line; every later tag is a word.
    return scan.next_is_number()


def _read_ball(scan: Scanner, shape: BoundaryShape, span: Span, brackets: bool) -> Boundary:
    center = [read_coordinate(scan, "x of the centre"), read_coordinate(scan, "y of the centre")]
    if shape is BoundaryShape.SPHERE and scan.next_is_number():
        center.append(read_coordinate(scan, "z of the centre"))
    if brackets:
        scan.punctuation(";", "before the radius")
    at = scan.position
    radius = read_coordinate(scan, "radius")
    if radius <= 0:
        hint = "write the radius behind the centre"
        scan.fail("ENV119", f"radius {radius:g}; expected a positive number", hint=hint, span=scan.span(at))
    return Boundary(shape, center=tuple(center), radius=radius, span=span)
