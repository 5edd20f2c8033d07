"""Dialects B to E: multibodies and the bodies of robot files (env-format sections 5 to 8)."""

from __future__ import annotations

from dataclasses import replace

from ..errors import FormatError
from ..model import BaseKind, Body, Dialect, MultiBody, MultiBodyKind, Pose, Recentring, VelocityBounds
from .blocks import Grammar, check_count, read_connections, read_pose, with_directives
from .lexer import Scanner, Token

_KINDS = {k.value: k for k in MultiBodyKind}
_BASES = {"Planar": "Planar", "Volumetric": "Volumetric", "Fixed": "Fixed", "Joint": "Joint"}
_MOVEMENTS = {"Rotational": "Rotational", "Translational": "Translational"}
_RECENTRING = {r.value: r for r in Recentring}
_CONNECTIONS = {"Connections": "Connections", "Connection": "Connection"}


def read_multibody(scan: Scanner, grammar: Grammar) -> MultiBody:
    """Read one multibody, from its tag on."""
    start = scan.position
    kind = scan.keyword(_KINDS, "multibody tag")
    span = scan.span(start)
    if kind in (MultiBodyKind.ACTIVE, MultiBodyKind.NON_HOLONOMIC):
        multibody = replace(read_robot_bodies(scan, grammar), kind=kind, span=span)
        return _with_controls(scan, multibody) if kind is MultiBodyKind.NON_HOLONOMIC else multibody
    label, body = None, None
    if kind is MultiBodyKind.SURFACE:
        label, body = _read_surface(scan, grammar)
    else:
        body = _read_static_body(scan, grammar, scan.word("a mesh file", whole=True))
    return MultiBody(
        kind, (body,), dialect=grammar.dialect, dh_form=grammar.rules.dh_form, label=label, span=span
    )  # fmt: skip


def read_robot_bodies(scan: Scanner, grammar: Grammar) -> MultiBody:
    """Read a robot from its body count on: bodies, adjacencies, connections."""
    start = scan.position
    declared = scan.count("the number of bodies", scan.limits.bodies)
    count_span = scan.span(start)
    bodies: list[Body] = []
    while len(bodies) <= scan.limits.bodies and not _list_ends(scan):
        bodies.append(_read_robot_body(scan, grammar))
    if len(bodies) < declared and scan.at_end():
        scan.fail_expected(f"body {len(bodies) + 1} of {declared}")
    check_count(scan, declared, len(bodies), "body", count_span)
    if not bodies:
        scan.fail("ENV117", "a robot without bodies", span=count_span)
    adjacencies = _read_adjacencies(scan, len(bodies))
    tag_at = scan.position
    tag = scan.keyword(_CONNECTIONS, "tag")
    if tag == "Connection" and grammar.rules.plural_connections:
        scan.log.warn(
            FormatError, "ENV205", tag, f"dialect {grammar.dialect} spells this tag 'Connections'",
            span=scan.span(tag_at),
        )  # fmt: skip
    connections = read_connections(scan, grammar, len(bodies))
    return MultiBody(
        MultiBodyKind.ACTIVE,
        tuple(bodies),
        connections,
        dialect=grammar.dialect,
        dh_form=grammar.rules.dh_form,
        adjacencies=adjacencies,
        span=count_span,
    )


def _list_ends(scan: Scanner) -> bool:
    word = scan.peek_word().lower()
    return not word or (word.startswith(("connection", "adjacenc")) and "." not in word)


def _read_robot_body(scan: Scanner, grammar: Grammar) -> Body:
    comments = scan.take_directives()
    filename = scan.word("a mesh file", whole=True)
    body = _read_options(scan, _body_of(scan, filename, grammar))
    if scan.next_is_number():
        body = replace(body, mass=_read_mass(scan))
    base, pose = _read_base(scan, grammar)
    return with_directives(replace(body, base=base, pose=pose), comments)


def _read_static_body(scan: Scanner, grammar: Grammar, filename: Token) -> Body:
    comments = scan.take_directives()
    body = _read_options(scan, _body_of(scan, filename, grammar))
    base, pose = BaseKind.FIXED, None
    # In E an obstacle may say `Fixed` before its pose (env-format section 8.1).
    if grammar.dialect is Dialect.E and scan.peek().isalpha():
        start = scan.position
        base, pose = _read_base(scan, grammar)
        if base is not BaseKind.FIXED:
            scan.fail("ENV123", f"an obstacle with a {base.value} base; expected Fixed", span=scan.span(start))
    body = replace(body, base=base, pose=pose or read_pose(scan, grammar))
    return with_directives(body, comments)


def _read_surface(scan: Scanner, grammar: Grammar) -> tuple[str | None, Body]:
    first = scan.word("a label or a mesh file", whole=True)
    # Builds before be353b3d have no label: the file name stands first then.
    if scan.next_is_number() or scan.peek() == "-":
        return None, _read_static_body(scan, grammar, first)
    return first.text, _read_static_body(scan, grammar, scan.word("a mesh file", whole=True))


def _body_of(scan: Scanner, filename: Token, grammar: Grammar) -> Body:
    return Body(
        filename.text,
        BaseKind.FIXED,
        recentring=grammar.rules.recentring,
        span=scan.source.span(filename.start, filename.end),
    )


def _read_options(scan: Scanner, body: Body) -> Body:
    """Read `-a(...)`, `-c(...)` and `-t(...)` in any order; blanks are free (env-format section 7)."""
    while scan.peek() == "-" and scan.peek(1).isalpha():
        start = scan.position
        letter = scan.peek(1).lower()
        scan.punctuation("-", "before an option")
        scan.punctuation(scan.peek(), "of an option")
        if letter not in "act":
            scan.fail("ENV124", f"unknown body option -{letter}; expected -a(), -c() or -t()", span=scan.span(start))
        scan.punctuation("(", f"after -{letter}")
        if letter == "c":
            r, g, b, a = scan.numbers("red green blue alpha")
            body = replace(body, color=(r, g, b, a))
        else:
            text = _until_parenthesis(scan)
            if letter == "t":
                body = replace(body, texture=text)
            else:
                folded = {k.lower(): v for k, v in _RECENTRING.items()}
                if text.lower() not in folded:
                    scan.fail(
                        "ENV124", f"unknown adjustment {text!r}; expected COM, Surface or None", span=scan.span(start)
                    )
                body = replace(body, recentring=folded[text.lower()])
        scan.punctuation(")", f"at the end of -{letter}(...)")
    return body


def _until_parenthesis(scan: Scanner) -> str:
    text = scan.source.text
    start = scan.position
    end = text.find(")", start)
    if end < 0 or "\n" in text[start:end]:
        scan.fail_expected("')' at the end of an option")
    scan.advance(end)
    return text[start:end].strip()


def _read_mass(scan: Scanner) -> float:
    start = scan.position
    mass = scan.number("mass")
    if mass <= 0:
        scan.fail("ENV118", f"mass {mass:g}; expected a positive number", span=scan.span(start))
    return mass


def _read_base(scan: Scanner, grammar: Grammar) -> tuple[BaseKind, Pose | None]:
    word = scan.keyword(_BASES, "base", code="ENV123")
    if word == "Fixed":
        return BaseKind.FIXED, read_pose(scan, grammar)
    if word == "Joint":
        return BaseKind.JOINT, None
    return BaseKind(f"{word} {scan.keyword(_MOVEMENTS, 'movement', code='ENV123')}"), None


def _read_adjacencies(scan: Scanner, bodies: int) -> tuple[tuple[int, int], ...]:
    if not scan.peek_word().lower().startswith("adjacenc"):
        return ()
    scan.keyword({"Adjacencies": None}, "tag")
    pairs: list[tuple[int, int]] = []
    for _ in range(scan.count("the number of adjacencies", scan.limits.connections)):
        start = scan.position
        pair = scan.integer("the index of a body"), scan.integer("the index of a body")
        if not all(0 <= i < bodies for i in pair):
            scan.fail("ENV115", f"adjacency {pair[0]} {pair[1]} of {bodies} bodies is out of range", span=scan.span(start))
        pairs.append(pair)
    return tuple(pairs)


def _with_controls(scan: Scanner, multibody: MultiBody) -> MultiBody:
    """Read `VelocityBounds` and `Controls`, one control vector a line (env-format section 7)."""
    scan.keyword({"VelocityBounds": None}, "tag")
    bounds = VelocityBounds(*scan.numbers("linear angular"))
    scan.keyword({"Controls": None}, "tag")
    count = scan.count("the number of controls", scan.limits.connections)
    scan.rest_of_line()
    controls: list[tuple[float, ...]] = []
    for _ in range(count):
        scan.next_line()
        start = scan.end_of_last
        if start >= len(scan.source.text):
            scan.fail_expected(f"control {len(controls) + 1} of {count}")
        words = scan.rest_of_line().split("#")[0].split()
        try:
            controls.append(tuple(float(w) for w in words))
        except ValueError:
            scan.fail("ENV112", "expected a line of numbers (a control)", span=scan.span(start))
    return replace(multibody, velocity_bounds=bounds, controls=tuple(controls))
