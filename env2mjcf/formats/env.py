"""Reads the text of an environment in any of the five dialects, and of dialect E's robot files."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

from ..model.dialects import DialectRules, rules_of
from ..model.environment import Boundary, Dialect, Environment, MultiBody, Resolution
from .blocks import check_limit, is_multibody_tag, read_boundary, warn_of_count
from .lexer import Scanner
from .multibodies import read_linked_bodies, read_multibody

RESOLUTION_TAGS = {
    "PositionRes": "position",
    "PositionResFactor": "position_factor",
    "Orientation": "orientation",
    "TimeRes": "time",
    "RDRes": "rd",
}
_HEADER_TAGS = {**RESOLUTION_TAGS, "Multibodies": None, "Obstacles": None}
_ENVIRONMENT_VERSIONS = {"0", "20001022", "20020327"}
# Classes whose configurations are the base, then the joints; others have a layout of their own.
_CONFIGURATION_CLASSES = {"cfg_free", "cfg_free_tree", "cfg_free_serial", "cfg_fixed_tree", "cfg_free_cc"}
_COUNT_AND_WORD = re.compile(r"[0-9]+\s+([A-Za-z]+)(?!\S)")


def read_env(scan: Scanner, dialect: Dialect, semantics: str) -> Environment:
    """Read a whole env file of a known dialect.

    Raises:
        FormatError: The text breaks the grammar (docs/format/env.md).
    """
    rules = rules_of(dialect, semantics)
    boundary, resolution = None, Resolution()
    if dialect is Dialect.A:
        _check_header(scan)
    if scan.peek_word().lower().startswith("bound"):
        boundary, resolution = _read_preamble(scan)
    multibodies, declared = _read_multibodies(scan, rules)
    _check_ending(scan, rules)
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
    """Judge dialect A's `#Environment Version N` and `#Cfg_...` lines."""
    scan.peek()
    for comment in scan.comments:
        words = comment.text.lstrip("#").split()
        if len(words) >= 3 and words[0] == "Environment" and "Version" in words[1]:
            if words[2] not in _ENVIRONMENT_VERSIONS:
                message = f"unknown environment version {words[2]!r}; expected 0, 20001022 or 20020327"
                hint = "the original reader stops here; this one goes on"
                scan.log.warn("ENV208", "header", message, hint=hint, span=comment.span)
        elif words and words[0].lower().startswith("cfg_") and words[0].lower() not in _CONFIGURATION_CLASSES:
            message = f"configurations of class {words[0]} have a layout of their own; read as base, then joints"
            hint = "compare the names of the degrees of freedom with the query"
            scan.log.warn("ENV218", "header", message, hint=hint, span=comment.span)


def _read_preamble(scan: Scanner) -> tuple[Boundary, Resolution]:
    scan.keyword({"Boundary": None}, "tag")
    boundary = read_boundary(scan)
    resolution = Resolution()
    while True:
        start = scan.position
        name = scan.keyword(_HEADER_TAGS, "tag")
        if name is None:
            return boundary, resolution
        value = scan.number(name)
        if name != "position_factor" and value <= 0:
            scan.log.info("ENV306", name, f"{value:g}: the planner computes a step of its own", span=scan.span(start))
            continue
        resolution = replace(resolution, **{name: value * math.pi if name == "orientation" else value})
        if name == "position":
            resolution = replace(resolution, span=scan.span(start))


def _read_multibodies(scan: Scanner, rules: DialectRules) -> tuple[tuple[MultiBody, ...], int]:
    start = scan.position
    declared = scan.count("the number of multibodies", "bodies")
    span = scan.span(start)
    found: list[MultiBody] = []
    bodies = connections = 0
    while not scan.at_end():
        if len(found) >= declared and not is_multibody_tag(scan.peek_word()):
            _ignore_rest(scan, "multibody")
            break
        found.append(read_multibody(scan, rules))
        bodies += len(found[-1].bodies)
        connections += len(found[-1].connections)
        check_limit(scan, bodies, "body", "bodies")
        check_limit(scan, connections, "connection", "connections")
    if declared != len(found):
        warn_of_count(scan, declared, len(found), "multibody", span)
    return tuple(found), declared


def _ignore_rest(scan: Scanner, last: str) -> None:
    message, hint = f"text behind the last {last} is not used", "begin comment lines with '#'"
    scan.log.warn("ENV209", scan.source.path, message, hint=hint, span=scan.span())
    scan.advance(len(scan.source.text))


def _check_ending(scan: Scanner, rules: DialectRules) -> None:
    text = scan.source.text
    if not text or text[-1].isspace():
        return
    report = scan.log.warn if rules.needs_final_newline else scan.log.info
    message = f"no newline at the end of the file{': the original reader fails here' * rules.needs_final_newline}"
    hint = "end the last line with a newline, if nothing is missing"
    report("ENV210", scan.source.path, message, hint=hint, span=scan.source.span(len(text) - 1))


def read_robot(scan: Scanner) -> MultiBody:
    """Read a `.robot` file: a count, bodies, adjacencies and connections.

    Raises:
        FormatError: The text breaks the grammar.
    """
    _refuse_environment(scan)
    if scan.peek_word().lower() == "active":
        # Some robot files begin with the tag that a multibody has.
        message = "a robot file begins with its body count, not with a tag"
        scan.log.warn("ENV211", "Active", message, hint="remove the tag", span=scan.span())
        scan.word("Active")
    robot = read_linked_bodies(scan, rules_of(Dialect.E))
    if not scan.at_end():
        _ignore_rest(scan, "connection")
    return replace(robot, robot_file=scan.source.path)


def _refuse_environment(scan: Scanner) -> None:
    behind_count = scan.next_matches(_COUNT_AND_WORD)
    if scan.peek_word().lower() == "boundary" or (behind_count and is_multibody_tag(behind_count.group(1))):
        message = f"{scan.source.path} is an environment, not a robot file; expected a number of bodies"
        hint = "robots= (--robots) takes dialect E robot files; an environment brings its own robots"
        scan.fail("ENV133", message, hint=hint)
