"""The `Boundary` of dialects C to E, in text and XML (env-format sections 6 to 8)."""

from __future__ import annotations

from ..errors import FormatError, Span
from ..model import Boundary, BoundaryShape
from .blocks import read_coordinate, read_range
from .lexer import Scanner

SHAPES = {s.value: s for s in BoundaryShape}
_AXES = "xyz"


def read_boundary(scan: Scanner) -> Boundary:
    """Read what follows the word `Boundary`, with or without brackets."""
    start = scan.position
    if scan.peek() == "[":
        # The newest planner's own writer leaves the word out (env-format section 8.1).
        shape = BoundaryShape.BOX
        scan.log.warn(
            FormatError, "ENV206", "Boundary", "a boundary without a shape; read as Box", hint="write Boundary Box [",
            span=scan.span(),
        )  # fmt: skip
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
        ranges.append(read_range(scan, f"the {_AXES[len(ranges)]} range of the boundary"))
    if len(ranges) < 2:
        scan.fail(
            "ENV119", "a box with one range; expected two or three (x, y and perhaps z)",
            hint="write lower:upper for each axis", span=span,
        )  # fmt: skip
    if shape is BoundaryShape.BOX2D and len(ranges) == 3:
        scan.log.warn(
            FormatError, "ENV207", "Boundary", "Box2D with three ranges; all are used", hint="write Box", span=span
        )
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
        scan.fail(
            "ENV119", f"radius {radius:g}; expected a positive number", hint="write the radius behind the centre",
            span=scan.span(at),
        )  # fmt: skip
    return Boundary(shape, center=tuple(center), radius=radius, span=span)
