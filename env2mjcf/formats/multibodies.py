"""Dialect A: the multibodies of the planner of 1998 to 2012 (env-format section 4).

MERGED: Dialects B to E: multibodies, and the robots of robot files (env-format sections 5 to 8).
"""

from __future__ import annotations

from dataclasses import replace

from ..errors import did_you_mean
from ..model.environment import BaseKind, Body, Dialect, MultiBody, MultiBodyKind, VelocityBounds
from .blocks import Grammar, check_count, check_limit, is_multibody_tag, read_counted, read_pose, with_directives
from .bodies import read_body_index, read_connections, read_robot_body, read_static_body, read_surface_body
from .lexer import Scanner, misspelling

# `Internal` and `Surface` are in no grammar of this dialect, but in real files.
_KINDS_OF_A = {
    "Active": MultiBodyKind.ACTIVE,
    "Passive": MultiBodyKind.PASSIVE,
    "Internal": MultiBodyKind.INTERNAL,
    "Surface": MultiBodyKind.SURFACE,
}
_BODY_TAGS_OF_A = {"FreeBody": True, "FixedBody": False}


def read_multibody_of_a(scan: Scanner, grammar: Grammar) -> MultiBody:
    """Read `MultiBody Active|Passive`, its bodies and its connections."""
    start = scan.position
    scan.keyword({"MultiBody": None}, "tag")
    kind = scan.keyword(_KINDS_OF_A, "tag")
    span = scan.span(start)
    if scan.peek_word().lower() == "internal":
        scan.word("Internal")
        kind = MultiBodyKind.INTERNAL if kind is MultiBodyKind.PASSIVE else kind
    bodies = _read_bodies_of_a(scan, grammar)
    connections = read_connections(scan, grammar, len(bodies))
    return MultiBody(kind, bodies, connections, dialect=grammar.dialect, dh_form=grammar.rules.dh_form, span=span)


def _read_bodies_of_a(scan: Scanner, grammar: Grammar) -> tuple[Body, ...]:
    start = scan.position
    declared = scan.count("the number of bodies", scan.limits.bodies, "bodies")
    span = scan.span(start)
    bodies: list[Body] = []
    while _body_of_a_follows(scan, expected=len(bodies) < declared):
        check_limit(scan, len(bodies) + 1, scan.limits.bodies, "body", "bodies")
        bodies.append(_read_body_of_a(scan, grammar, first=not bodies))
    check_count(scan, declared, len(bodies), "body", span)
    if not bodies:
        scan.fail("ENV117", "a multibody without bodies; expected one or more", hint="remove the multibody", span=span)
    return tuple(bodies)


def _body_of_a_follows(scan: Scanner, *, expected: bool) -> bool:
    word = scan.peek_word()
    if word.lower() in {"freebody", "fixedbody"}:
        return True
    # A misspelt body tag is read where a body is due; anything else ends the list.
    return expected and not scan.at_end() and not did_you_mean(word, ("Connection", "Connections", "MultiBody"))


def _read_body_of_a(scan: Scanner, grammar: Grammar, *, first: bool) -> Body:
    comments = scan.take_directives()
    # The original takes every word but `FixedBody` for `FreeBody`, and compares its case.
    free = scan.keyword(_BODY_TAGS_OF_A, "body tag", code="ENV122", exact_case=grammar.rules.keyword_case)
    index = scan.integer("the index of the body")
    filename = scan.word("a mesh file", whole=True)
    pose = read_pose(scan, grammar) if not free or scan.next_is_number() else None
    if free and not first and pose is not None:
        message = "only the first FreeBody of a robot has a pose; this one is not used"
        scan.log.info("ENV301", filename.text, message, span=pose.span)
    free_base = BaseKind.VOLUMETRIC_ROTATIONAL if first else BaseKind.JOINT
    span = scan.source.span(filename.start, filename.end)
    base = free_base if free else BaseKind.FIXED
    body = Body(filename.text, base, pose, grammar.rules.recentring, index=index, span=span)
    return with_directives(scan, body, comments)


_KINDS = {k.value: k for k in MultiBodyKind}
_LIST_ENDS = ("Connections", "Connection", "Adjacencies")


def read_multibody(scan: Scanner, grammar: Grammar) -> MultiBody:
    """Read one multibody, from its tag on."""
    start = scan.position
    kind = scan.keyword(_KINDS, "multibody tag")
    span = scan.span(start)
    if grammar.dialect is Dialect.E and kind not in (MultiBodyKind.PASSIVE, MultiBodyKind.INTERNAL):
        message = f"a {kind.value} multibody in dialect E, whose reader refuses it"
        hint = "a robot has a file of its own in dialect E; read this file as dialect='D'"
        scan.log.warn("ENV216", kind.value, message, hint=hint, span=span)
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
