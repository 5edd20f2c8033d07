"""Dialect A: the multibodies of the planner of 1998 to 2012 (env-format section 4)."""

from __future__ import annotations

from ..errors import did_you_mean
from ..model import BaseKind, Body, MultiBody, MultiBodyKind
from .blocks import Grammar, check_count, read_connections, read_pose, with_directives
from .lexer import Scanner

# `Surface` is in no grammar of this dialect, but in real files.
_KINDS = {
    "Active": MultiBodyKind.ACTIVE,
    "Passive": MultiBodyKind.PASSIVE,
    "Surface": MultiBodyKind.SURFACE,
}
_BODY_TAGS = {"FreeBody": True, "FixedBody": False}
_CONNECTION_TAGS = {"Connection": None, "Connections": None}


def read_multibody(scan: Scanner, grammar: Grammar) -> MultiBody:
    """Read `MultiBody Active|Passive`, its bodies and its connections."""
    start = scan.position
    scan.keyword({"MultiBody": None}, "tag", exact_case=True)
    kind = scan.keyword(_KINDS, "tag", exact_case=True)
    span = scan.span(start)
    if scan.peek_word().lower() == "internal":
        scan.word("Internal")
        kind = MultiBodyKind.INTERNAL if kind is MultiBodyKind.PASSIVE else kind
    count_at = scan.position
    declared = scan.count("the number of bodies", scan.limits.bodies)
    count_span = scan.span(count_at)
    bodies: list[Body] = []
    while _body_follows(scan, expected=len(bodies) < declared):
        bodies.append(_read_body(scan, grammar, first=not bodies))
    check_count(scan, declared, len(bodies), "body", count_span)
    if not bodies:
        scan.fail("ENV117", "a multibody without bodies", span=count_span)
    scan.keyword(_CONNECTION_TAGS, "tag", exact_case=True)
    connections = read_connections(scan, grammar, len(bodies))
    return MultiBody(
        kind, tuple(bodies), connections, dialect=grammar.dialect, dh_form=grammar.rules.dh_form, span=span
    )  # fmt: skip


def _body_follows(scan: Scanner, *, expected: bool) -> bool:
    word = scan.peek_word()
    if word.lower() in {"freebody", "fixedbody"}:
        return True
    # A misspelt body tag is read where a body is due; anything else ends the list.
    return expected and not did_you_mean(word, ("Connection", "Connections", "MultiBody"))


def _read_body(scan: Scanner, grammar: Grammar, *, first: bool) -> Body:
    comments = scan.take_directives()
    free = scan.keyword(_BODY_TAGS, "body tag", code="ENV122", exact_case=True)
    index = scan.integer("the index of the body")
    filename = scan.word("a mesh file", whole=True)
    span = scan.source.span(filename.start, filename.end)
    pose = read_pose(scan, grammar) if not free or scan.next_is_number() else None
    if free and not first and pose is not None:
        scan.log.info(
            "ENV301", filename.text, "only the first FreeBody of a robot has a pose; this one is not used",
            span=pose.span,
        )  # fmt: skip
    if free:
        base = BaseKind.VOLUMETRIC_ROTATIONAL if first else BaseKind.JOINT
    else:
        base = BaseKind.FIXED
    body = Body(filename.text, base, pose, grammar.rules.recentring, index=index, span=span)
    return with_directives(body, comments)
