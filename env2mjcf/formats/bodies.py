"""The bodies of dialects B to E: options, mass, base and pose (env-format sections 5 to 8)."""

from __future__ import annotations

import re
from dataclasses import replace

from ..model import BaseKind, Body, Pose, Recentring
from .blocks import Grammar, read_color, read_pose, with_directives
from .lexer import Scanner, Token, misspelling

_BASES = {"Planar": "Planar", "Volumetric": "Volumetric", "Fixed": "Fixed", "Joint": "Joint"}
_MOVEMENTS = {"Rotational": "Rotational", "Translational": "Translational"}
_ADJUSTMENTS = {r.value.lower(): r for r in Recentring}
# One letter behind a minus sign: neither a coordinate nor `-nan`.
_OPTION = re.compile(r"-([A-Za-z])(?![A-Za-z])")
_OPTION_TEXT = re.compile(r"([^)\r\n]*)(?=\))")


def read_robot_body(scan: Scanner, grammar: Grammar) -> Body:
    """Read `file [options] [mass] base`."""
    comments = scan.take_directives()
    body = _read_mesh(scan, grammar, scan.word("a mesh file", whole=True))
    if scan.next_is_number():
        body = replace(body, mass=_read_mass(scan))
    base, pose = _read_base(scan, grammar)
    return with_directives(scan, replace(body, base=base, pose=pose), comments)


def read_static_body(scan: Scanner, grammar: Grammar) -> Body:
    """Read `file [options] pose`."""
    return _with_pose(scan, grammar, scan.word("a mesh file", whole=True))


def read_surface_body(scan: Scanner, grammar: Grammar) -> tuple[str | None, Body]:
    """Read `[label] file [options] pose`."""
    first = scan.word("a label or a mesh file", whole=True)
    # Builds before be353b3d have no label: the file name stands first then.
    if scan.next_is_number() or scan.next_matches(_OPTION):
        return None, _with_pose(scan, grammar, first)
    return first.text, read_static_body(scan, grammar)


def _with_pose(scan: Scanner, grammar: Grammar, filename: Token) -> Body:
    comments = scan.take_directives()
    body = _read_mesh(scan, grammar, filename)
    # Dialect E lets an obstacle say `Fixed` before its pose (env-format section 8.1).
    if misspelling(scan.peek_word(), _BASES) is not None:
        start = scan.position
        base, pose = _read_base(scan, grammar)
        if base is not BaseKind.FIXED:
            scan.fail(
                "ENV123", f"an obstacle with a {base.value} base; expected Fixed or a pose",
                hint="robots have files of their own", span=scan.span(start),
            )  # fmt: skip
    else:
        pose = read_pose(scan, grammar)
    return with_directives(scan, replace(body, pose=pose), comments)


def _read_mesh(scan: Scanner, grammar: Grammar, filename: Token) -> Body:
    """Read the options behind a file name, in any order; blanks are free (env-format section 7)."""
    span = scan.source.span(filename.start, filename.end)
    body = Body(filename.text, BaseKind.FIXED, recentring=grammar.rules.recentring, span=span)
    while (option := scan.next_matches(_OPTION)) is not None:
        scan.advance(option.end())
        body = _read_option(scan, body, option.group(1).lower(), option.start())
    return body


def _read_option(scan: Scanner, body: Body, letter: str, start: int) -> Body:
    if letter not in "act":
        scan.fail(
            "ENV124", f"unknown body option -{letter}; expected -a(...), -c(...) or -t(...)",
            hint="write -a for the adjustment, -c for the colour, -t for the texture", span=scan.span(start),
        )  # fmt: skip
    scan.punctuation("(", f"after -{letter}")
    if letter == "c":
        body = replace(body, color=read_color(scan))
    else:
        match = scan.next_matches(_OPTION_TEXT)
        if match is None:
            scan.fail_expected(f"')' at the end of -{letter}(...)")
        scan.advance(match.end())
        text = match.group(1).strip()
        if letter == "t":
            body = replace(body, texture=text)
        elif text.lower() in _ADJUSTMENTS:
            body = replace(body, recentring=_ADJUSTMENTS[text.lower()])
        else:
            scan.fail(
                "ENV124", f"unknown adjustment {text!r}; expected COM, Surface or None",
                hint="write -a(COM), -a(Surface) or -a(None)", span=scan.span(start),
            )  # fmt: skip
    scan.punctuation(")", f"at the end of -{letter}(...)")
    return body


def _read_mass(scan: Scanner) -> float:
    start = scan.position
    mass = scan.number("mass")
    if mass <= 0:
        scan.fail(
            "ENV118", f"mass {mass:g}; expected a positive number",
            hint="leave it out to have it computed from the density", span=scan.span(start),
        )  # fmt: skip
    return mass


def _read_base(scan: Scanner, grammar: Grammar) -> tuple[BaseKind, Pose | None]:
    word = scan.keyword(_BASES, "base", code="ENV123")
    if word == "Fixed":
        return BaseKind.FIXED, read_pose(scan, grammar)
    if word == "Joint":
        return BaseKind.JOINT, None
    return BaseKind(f"{word} {scan.keyword(_MOVEMENTS, 'movement', code='ENV123')}"), None
