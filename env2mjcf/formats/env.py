"""Reads the text of an environment in any of the five dialects."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

from ..errors import FormatError
from ..model import Boundary, Dialect, Environment, MultiBody, Resolution
from . import later, legacy
from .blocks import Grammar, check_count
from .boundary import read_boundary
from .lexer import Scanner

_RESOLUTION_TAGS = {
    "PositionRes": "position",
    "PositionResFactor": "position_factor",
    "Orientation": "orientation",
    "TimeRes": "time",
    "RDRes": "rd",
}
_HEADER_TAGS = {**_RESOLUTION_TAGS, "Multibodies": None, "Obstacles": None}
_ENVIRONMENT_VERSIONS = {"0", "20001022", "20020327"}


def read_env(scan: Scanner, dialect: Dialect, semantics: str) -> Environment:
    """Read a whole env file of a known dialect.

    Raises:
        FormatError: The text breaks the grammar (env-format sections 3 to 8).
    """
    grammar = Grammar.of(dialect, semantics)
    boundary, resolution = None, Resolution()
    if dialect in (Dialect.A, Dialect.B):
        _check_header(scan)
    if scan.peek_word().lower().startswith("bound"):
        boundary, resolution = _read_preamble(scan)
    multibodies, declared = _read_multibodies(scan, grammar)
    _check_ending(scan, grammar)
    return Environment(
        name=Path(scan.source.path).stem,
        dialect=dialect,
        multibodies=multibodies,
        boundary=boundary,
        resolution=resolution,
        semantics=semantics,
        declared_multibodies=declared,
        comments=tuple(scan.comments),
        directory=Path(scan.source.path).parent,
        path=scan.source.path,
    )


def _check_header(scan: Scanner) -> None:
    """Judge dialect A's `# Environment Version N` line (env-format section 3.1)."""
    scan.peek()
    for comment in scan.comments:
        words = comment.text.lstrip("#").split()
        if len(words) >= 3 and words[0] == "Environment" and "Version" in words[1]:
            if words[2] not in _ENVIRONMENT_VERSIONS:
                scan.log.warn(
                    FormatError, "ENV208", "header", f"unknown environment version {words[2]!r}", span=comment.span
                )
            return


def _read_preamble(scan: Scanner) -> tuple[Boundary, Resolution]:
    scan.keyword({"Boundary": None}, "tag")
    boundary = read_boundary(scan)
    resolution: dict[str, float] = {}
    while True:
        start = scan.position
        name = scan.keyword(_HEADER_TAGS, "tag")
        if name is None:
            return boundary, Resolution(**resolution)
        value = scan.number(name)
        if name != "position_factor" and value < 0:
            scan.log.info("ENV306", name, f"{value:g}: the planner computes a step of its own", span=scan.span(start))
            continue
        resolution[name] = value * math.pi if name == "orientation" else value


def _read_multibodies(scan: Scanner, grammar: Grammar) -> tuple[tuple[MultiBody, ...], int]:
    start = scan.position
    declared = scan.count("the number of multibodies", scan.limits.bodies)
    span = scan.span(start)
    read = legacy.read_multibody if grammar.dialect is Dialect.A else later.read_multibody
    found: list[MultiBody] = []
    bodies = 0
    while not scan.at_end():
        if len(found) >= declared and not _multibody_follows(scan, grammar):
            _ignore_rest(scan)
            break
        found.append(read(scan, grammar))
        bodies += len(found[-1].bodies)
        if bodies > scan.limits.bodies:
            scan.fail("ENV110", f"more than {scan.limits.bodies} bodies", hint="raise limits=Limits(bodies=...)")
    check_count(scan, declared, len(found), "multibody", span)
    return tuple(found), declared


def _multibody_follows(scan: Scanner, grammar: Grammar) -> bool:
    word = scan.peek_word().lower()
    if grammar.dialect is Dialect.A:
        return word == "multibody"
    return word in {"active", "passive", "internal", "surface", "nonholonomic"}


def _ignore_rest(scan: Scanner) -> None:
    scan.log.warn(
        FormatError, "ENV209", scan.source.path, "text behind the last multibody is not used",
        hint="begin comment lines with '#'", span=scan.span(),
    )  # fmt: skip
    scan.advance(len(scan.source.text))


def _check_ending(scan: Scanner, grammar: Grammar) -> None:
    text = scan.source.text
    if grammar.rules.needs_final_newline and text and not text[-1].isspace():
        scan.log.warn(
            FormatError, "ENV210", scan.source.path,
            "no newline at the end of the file: the original reader fails here",
            hint="end the last line with a newline", span=scan.source.span(len(text) - 1),
        )  # fmt: skip


def with_attributes(environment: Environment, attributes: dict[str, str], resolution: Resolution) -> Environment:
    """Return the environment with the attributes of an `<Environment>` node, which override the file."""
    old = environment.resolution
    merged = {
        f.name: new if (new := getattr(resolution, f.name)) is not None else getattr(old, f.name)
        for f in dataclasses.fields(Resolution)
    }
    return dataclasses.replace(
        environment,
        attributes=(*environment.attributes, *sorted(attributes.items())),
        resolution=Resolution(**merged),
    )
