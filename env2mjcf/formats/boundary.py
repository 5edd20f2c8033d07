"""The `Boundary` of dialects C to E (env-format sections 6 to 8)."""

from __future__ import annotations

from ..errors import FormatError, Span
from ..model import Boundary, BoundaryShape
from .blocks import read_range
from .lexer import Scanner

_SHAPES = {s.value: s for s in BoundaryShape}
_AXES = "xyz"


def read_boundary(scan: Scanner) -> Boundary:
    """Read what follows the word `Boundary`, with or without brackets."""
    start = scan.position
    if scan.peek() == "[":
        # The newest planner's own writer leaves the word out (env-format section 8.1).
        shape = BoundaryShape.BOX
        scan.log.warn(FormatError, "ENV206", "Boundary", "a boundary without a shape; read as Box", span=scan.span())
    else:
        shape = scan.keyword(_SHAPES, "boundary shape", code="ENV125")
    span = scan.span(start)
    brackets = scan.peek() == "["
    if brackets:
        scan.punctuation("[", "before the boundary")
    if shape in (BoundaryShape.BOX, BoundaryShape.BOX2D):
        boundary = _read_box(scan, shape, span, brackets)
    else:
        boundary = _read_ball(scan, shape, span, brackets)
    if brackets:
        scan.punctuation("]", "after the boundary")
    return boundary


def _read_box(scan: Scanner, shape: BoundaryShape, span: Span, brackets: bool) -> Boundary:
    ranges = [read_range(scan, "the x range of the boundary")]
    while len(ranges) < 3 and _range_follows(scan, brackets):
        if brackets:
            scan.punctuation(";", "between two ranges")
        ranges.append(read_range(scan, f"the {_AXES[len(ranges)]} range of the boundary"))
    if len(ranges) < 2:
        scan.fail("ENV119", "a box with one range; expected two or three (x, y and perhaps z)", span=span)
    if shape is BoundaryShape.BOX2D and len(ranges) == 3:
        scan.log.warn(FormatError, "ENV207", "Boundary", "Box2D with three ranges; all are used", span=span)
    if shape is BoundaryShape.BOX and len(ranges) == 2:
        scan.log.info("ENV302", "Boundary", "a Box with two ranges leaves z unbounded", span=span)
    return Boundary(shape, lower=tuple(r[0] for r in ranges), upper=tuple(r[1] for r in ranges), span=span)


def _range_follows(scan: Scanner, brackets: bool) -> bool:
    if brackets:
        return scan.peek() == ";"
    # Dialect C ends the boundary with its line; every later tag is a word.
    return scan.next_is_number()


def _read_ball(scan: Scanner, shape: BoundaryShape, span: Span, brackets: bool) -> Boundary:
    center = [scan.number("x of the centre"), scan.number("y of the centre")]
    if shape is BoundaryShape.SPHERE and scan.next_is_number():
        center.append(scan.number("z of the centre"))
    if brackets:
        scan.punctuation(";", "before the radius")
    at = scan.position
    radius = scan.number("radius")
    if radius <= 0:
        scan.fail("ENV119", f"radius {radius:g}; expected a positive number", span=scan.span(at))
    return Boundary(shape, center=tuple(center), radius=radius, span=span)
