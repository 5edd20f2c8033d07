"""Dialect A: the multibodies of the planner of 1998 to 2012 (env-format section 4)."""

from __future__ import annotations

from ..errors import did_you_mean
from ..model import BaseKind, Body, MultiBody, MultiBodyKind
from .blocks import Grammar, check_count, check_limit, read_pose, with_directives
from .connections import read_connections
from .lexer import Scanner

# `Internal` and `Surface` are in no grammar of this dialect, but in real files.
_KINDS = {
    "Active": MultiBodyKind.ACTIVE,
    "Passive": MultiBodyKind.PASSIVE,
    "Internal": MultiBodyKind.INTERNAL,
    "Surface": MultiBodyKind.SURFACE,
}
_BODY_TAGS = {"FreeBody": True, "FixedBody": False}


def read_multibody(scan: Scanner, grammar: Grammar) -> MultiBody:
    """Read `MultiBody Active|Passive`, its bodies and its connections."""
    start = scan.position
    scan.keyword({"MultiBody": None}, "tag")
    kind = scan.keyword(_KINDS, "tag")
    span = scan.span(start)
    if scan.peek_word().lower() == "internal":
        scan.word("Internal")
        kind = MultiBodyKind.INTERNAL if kind is MultiBodyKind.PASSIVE else kind
    bodies = _read_bodies(scan, grammar)
    connections = read_connections(scan, grammar, len(bodies))
    return MultiBody(kind, bodies, connections, dialect=grammar.dialect, dh_form=grammar.rules.dh_form, span=span)


def _read_bodies(scan: Scanner, grammar: Grammar) -> tuple[Body, ...]:
    start = scan.position
    declared = scan.count("the number of bodies", scan.limits.bodies, "bodies")
    span = scan.span(start)
    bodies: list[Body] = []
    while _body_follows(scan, expected=len(bodies) < declared):
        check_limit(scan, len(bodies) + 1, scan.limits.bodies, "body", "bodies")
        bodies.append(_read_body(scan, grammar, first=not bodies))
    check_count(scan, declared, len(bodies), "body", span)
    if not bodies:
        scan.fail("ENV117", "a multibody without bodies; expected one or more", hint="remove the multibody", span=span)
    return tuple(bodies)


def _body_follows(scan: Scanner, *, expected: bool) -> bool:
    word = scan.peek_word()
    if word.lower() in {"freebody", "fixedbody"}:
        return True
    # A misspelt body tag is read where a body is due; anything else ends the list.
    return expected and not scan.at_end() and not did_you_mean(word, ("Connection", "Connections", "MultiBody"))


def _read_body(scan: Scanner, grammar: Grammar, *, first: bool) -> Body:
    comments = scan.take_directives()
    # The original takes every word but `FixedBody` for `FreeBody`, and compares its case.
    free = scan.keyword(_BODY_TAGS, "body tag", code="ENV122", exact_case=grammar.rules.keyword_case)
    index = scan.integer("the index of the body")
    filename = scan.word("a mesh file", whole=True)
    pose = read_pose(scan, grammar) if not free or scan.next_is_number() else None
    if free and not first and pose is not None:
        scan.log.info(
            "ENV301", filename.text, "only the first FreeBody of a robot has a pose; this one is not used",
            span=pose.span,
        )  # fmt: skip
    free_base = BaseKind.VOLUMETRIC_ROTATIONAL if first else BaseKind.JOINT
    span = scan.source.span(filename.start, filename.end)
    base = free_base if free else BaseKind.FIXED
    body = Body(filename.text, base, pose, grammar.rules.recentring, index=index, span=span)
    return with_directives(scan, body, comments)
