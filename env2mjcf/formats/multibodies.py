"""The multibodies of every dialect, and the robots of robot files: bodies, adjacencies, connections, controls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..errors import did_you_mean
from ..model.dialects import DialectRules
from ..model.environment import BaseKind, Body, Connection, Dialect, MultiBody, MultiBodyKind, VelocityBounds
from .blocks import is_multibody_tag, read_counted
from .bodies import (
    read_body_index,
    read_connections,
    read_legacy_body,
    read_robot_body,
    read_static_body,
    read_surface_body,
)
from .lexer import Scanner, misspelling

_KINDS = {k.value: k for k in MultiBodyKind}
# `Internal` and `Surface` are in no grammar of dialect A, but in real files of it.
_LEGACY_KINDS = {k.value: k for k in MultiBodyKind if k is not MultiBodyKind.NON_HOLONOMIC}
_LIST_ENDS = ("Connections", "Connection", "Adjacencies")


def read_multibody(scan: Scanner, rules: DialectRules) -> MultiBody:
    """Read one multibody, from its tag on."""
    start = scan.position
    if rules.legacy_layout:
        scan.keyword({"MultiBody": None}, "tag")
    kind = scan.keyword(_LEGACY_KINDS if rules.legacy_layout else _KINDS, "multibody tag")
    span = scan.span(start)
    if rules.legacy_layout and scan.peek_word().lower() == "internal":
        scan.word("Internal")
        kind = MultiBodyKind.INTERNAL if kind is MultiBodyKind.PASSIVE else kind
    if rules.dialect is Dialect.E and kind not in (MultiBodyKind.PASSIVE, MultiBodyKind.INTERNAL):
        message = f"a {kind.value} multibody in dialect E, whose reader refuses it"
        hint = "a robot has a file of its own in dialect E; read this file as dialect='D'"
        scan.log.warn("ENV216", kind.value, message, hint=hint, span=span)
    if rules.legacy_layout or kind in (MultiBodyKind.ACTIVE, MultiBodyKind.NON_HOLONOMIC):
        multibody = replace(read_linked_bodies(scan, rules), kind=kind, span=span)
        return _with_controls(scan, multibody) if kind is MultiBodyKind.NON_HOLONOMIC else multibody
    label: str | None = None
    if kind is MultiBodyKind.SURFACE:
        label, body = read_surface_body(scan, rules)
    else:
        body = read_static_body(scan, rules)
    return MultiBody(kind, (body,), dialect=rules.dialect, dh_form=rules.dh_form, label=label, span=span)


def read_linked_bodies(scan: Scanner, rules: DialectRules) -> MultiBody:
    """Read a robot, or an obstacle of dialect A, from its body count on: bodies, adjacencies, connections."""
    span = scan.span()

    def read_body(number: int) -> Body:
        return read_legacy_body(scan, rules, number == 0) if rules.legacy_layout else read_robot_body(scan, rules)

    follows = _legacy_body_follows if rules.legacy_layout else _body_follows
    bodies = read_counted(scan, "body", "bodies", read_body, lambda expected: follows(scan, expected), required=True)
    adjacencies = () if rules.legacy_layout else _read_adjacencies(scan, len(bodies))
    connections = read_connections(scan, rules, len(bodies))
    if rules.legacy_layout:
        _report_poses(scan, bodies, connections)
    return MultiBody(
        MultiBodyKind.ACTIVE,
        bodies,
        connections,
        dialect=rules.dialect,
        dh_form=rules.dh_form,
        adjacencies=adjacencies,
        span=span,
    )


def _report_poses(scan: Scanner, bodies: Sequence[Body], connections: Sequence[Connection]) -> None:
    """Report poses of FreeBodies that connections place; without one, the pose is where the body is at home."""
    for index in sorted({c.next for c in connections}):
        body = bodies[index]
        if body.base is BaseKind.JOINT and body.pose is not None:
            message = f"a connection places FreeBody {index} ({body.filename}); its own pose is not used"
            scan.log.info("ENV301", body.filename, message, span=body.pose.span)


def _legacy_body_follows(scan: Scanner, expected: bool) -> bool:
    """Whether a body tag comes next; a misspelt one is read where a body is due, anything else ends the list."""
    word = scan.peek_word()
    if word.lower() in {"freebody", "fixedbody"}:
        return True
    return expected and not scan.at_end() and not did_you_mean(word, ("Connection", "Connections", "MultiBody"))


def _body_follows(scan: Scanner, expected: bool) -> bool:
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

    def read_pair(_: int) -> tuple[int, int]:
        return read_body_index(scan, bodies), read_body_index(scan, bodies)

    return read_counted(scan, "adjacency", "connections", read_pair)


def _with_controls(scan: Scanner, multibody: MultiBody) -> MultiBody:
    """Read `VelocityBounds` and `Controls`, one control vector a line."""
    scan.keyword({"VelocityBounds": None}, "tag")
    linear, angular = scan.numbers("linear angular")
    scan.keyword({"Controls": None}, "tag")
    start = scan.position
    count = scan.count("the number of controls", "connections")
    span = scan.span(start)
    rest = scan.line()
    if not rest.at_end():
        rest.fail("ENV112", "expected the end of the line behind the number of controls", hint="start a new line")
    controls = tuple(_read_control(scan, f"control {n} of {count}") for n in range(1, count + 1))
    widths = sorted({len(c) for c in controls})
    if len(widths) > 1:
        message = f"controls of {widths[0]} to {widths[-1]} numbers; expected equally many"
        scan.log.warn("ENV217", "Controls", message, hint="blank lines and comments count as controls", span=span)
    return replace(multibody, velocity_bounds=VelocityBounds(linear, angular), controls=controls)


def _read_control(scan: Scanner, what: str) -> tuple[float, ...]:
    """Read one line; a blank line, or a comment alone, is an empty control."""
    if scan.behind_last_line():
        scan.fail_expected(what)
    line = scan.line()
    if scan.behind_last_line() and not scan.source.text.endswith(("\n", "\r")):
        message = f"no newline behind {what}: is it cut off?"
        hint = "end the last line with a newline, if nothing is missing"
        scan.log.warn("ENV210", scan.source.path, message, hint=hint, span=line.span())
    values: list[float] = []
    while not line.at_end():
        values.append(line.number(what))
    return tuple(values)
