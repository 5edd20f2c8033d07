"""Dialects B to E: multibodies, and the robots of robot files (env-format sections 5 to 8)."""

from __future__ import annotations

from dataclasses import replace

from ..errors import FormatError
from ..model import Body, Dialect, MultiBody, MultiBodyKind, VelocityBounds
from .blocks import Grammar, check_count, check_limit, is_multibody_tag, read_counted
from .bodies import read_robot_body, read_static_body, read_surface_body
from .connections import read_body_index, read_connections
from .lexer import Scanner, misspelling

_KINDS = {k.value: k for k in MultiBodyKind}
_LIST_ENDS = ("Connections", "Connection", "Adjacencies")


def read_multibody(scan: Scanner, grammar: Grammar) -> MultiBody:
    """Read one multibody, from its tag on."""
    start = scan.position
    kind = scan.keyword(_KINDS, "multibody tag")
    span = scan.span(start)
    if grammar.dialect is Dialect.E and kind not in (MultiBodyKind.PASSIVE, MultiBodyKind.INTERNAL):
        scan.log.warn(
            FormatError, "ENV216", kind.value, f"a {kind.value} multibody in dialect E, whose reader refuses it",
            hint="a robot has a file of its own in dialect E; read this file as dialect='D'", span=span,
        )  # fmt: skip
    if kind in (MultiBodyKind.ACTIVE, MultiBodyKind.NON_HOLONOMIC):
        multibody = replace(read_robot_bodies(scan, grammar), kind=kind, span=span)
        return _with_controls(scan, multibody) if kind is MultiBodyKind.NON_HOLONOMIC else multibody
    label: str | None = None
    if kind is MultiBodyKind.SURFACE:
        label, body = read_surface_body(scan, grammar)
    else:
        body = read_static_body(scan, grammar)
    return MultiBody(kind, (body,), dialect=grammar.dialect, dh_form=grammar.rules.dh_form, label=label, span=span)


def read_robot_bodies(scan: Scanner, grammar: Grammar) -> MultiBody:
    """Read a robot from its body count on: bodies, adjacencies, connections."""
    start = scan.position
    declared = scan.count("the number of bodies", scan.limits.bodies, "bodies")
    span = scan.span(start)
    bodies: list[Body] = []
    while _body_follows(scan, expected=len(bodies) < declared):
        check_limit(scan, len(bodies) + 1, scan.limits.bodies, "body", "bodies")
        bodies.append(read_robot_body(scan, grammar))
    check_count(scan, declared, len(bodies), "body", span)
    if not bodies:
        scan.fail("ENV117", "a robot without bodies; expected one or more", hint="remove the multibody", span=span)
    adjacencies = _read_adjacencies(scan, len(bodies))
    return MultiBody(
        MultiBodyKind.ACTIVE,
        tuple(bodies),
        read_connections(scan, grammar, len(bodies)),
        dialect=grammar.dialect,
        dh_form=grammar.rules.dh_form,
        adjacencies=adjacencies,
        span=span,
    )


def _body_follows(scan: Scanner, *, expected: bool) -> bool:
    """Whether a mesh file comes next; behind the declared bodies only a word with a dot can be one."""
    word = scan.peek_word()
    if scan.at_end():
        return False
    if "." in word and not scan.next_is_number():
        return True
    return expected and not is_multibody_tag(word) and misspelling(word, _LIST_ENDS) is None


def _read_adjacencies(scan: Scanner, bodies: int) -> tuple[tuple[int, int], ...]:
    if misspelling(scan.peek_word(), _LIST_ENDS) != "Adjacencies":
        return ()
    scan.keyword({"Adjacencies": None}, "tag")
    return read_counted(
        scan, "adjacency", scan.limits.connections,
        lambda: (read_body_index(scan, bodies), read_body_index(scan, bodies)),
    )  # fmt: skip


def _with_controls(scan: Scanner, multibody: MultiBody) -> MultiBody:
    """Read `VelocityBounds` and `Controls`, one control vector a line (env-format section 7)."""
    scan.keyword({"VelocityBounds": None}, "tag")
    linear, angular = scan.numbers("linear angular")
    scan.keyword({"Controls": None}, "tag")
    start = scan.position
    count = scan.count("the number of controls", scan.limits.connections, "connections")
    span = scan.span(start)
    rest = scan.line()
    if not rest.at_end():
        rest.fail("ENV112", "expected the end of the line behind the number of controls", hint="start a new line")
    controls = tuple(_read_control(scan, f"control {n} of {count}") for n in range(1, count + 1))
    widths = sorted({len(c) for c in controls})
    if len(widths) > 1:
        scan.log.warn(
            FormatError, "ENV217", "Controls",
            f"controls of {widths[0]} to {widths[-1]} numbers; expected equally many",
            hint="blank lines and comments count as controls", span=span,
        )  # fmt: skip
    return replace(multibody, velocity_bounds=VelocityBounds(linear, angular), controls=controls)


def _read_control(scan: Scanner, what: str) -> tuple[float, ...]:
    """Read one line; a blank line, or a comment alone, is an empty control."""
    if scan.behind_last_line():
        scan.fail_expected(what)
    line = scan.line()
    if scan.behind_last_line() and not scan.source.text.endswith(("\n", "\r")):
        scan.log.warn(
            FormatError, "ENV210", scan.source.path, f"no newline behind {what}: is it cut off?",
            hint="end the last line with a newline, if nothing is missing", span=line.span(),
        )  # fmt: skip
    values: list[float] = []
    while not line.at_end():
        values.append(line.number(what))
    return tuple(values)
