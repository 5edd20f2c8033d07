"""Dialect E robot text files (env-format section 8.2)."""

from __future__ import annotations

import re
from dataclasses import replace

from ..errors import FormatError
from ..model import Dialect, MultiBody
from . import later
from .blocks import Grammar, is_multibody_tag
from .lexer import Scanner

_COUNT_AND_WORD = re.compile(r"[0-9]+\s+([A-Za-z]+)(?!\S)")


def read_robot(scan: Scanner) -> MultiBody:
    """Read a `.robot` file: a count, bodies, adjacencies and connections.

    Raises:
        FormatError: The text breaks the grammar.
    """
    _refuse_environment(scan)
    if scan.peek_word().lower() == "active":
        # Some robot files begin with the tag that a multibody has.
        scan.log.warn(
            FormatError, "ENV211", "Active", "a robot file begins with its body count, not with a tag",
            hint="remove the tag", span=scan.span(),
        )  # fmt: skip
        scan.word("Active")
    robot = later.read_robot_bodies(scan, Grammar.of(Dialect.E))
    if not scan.at_end():
        scan.log.warn(
            FormatError, "ENV209", scan.source.path, "text behind the last connection is not used",
            hint="begin comment lines with '#'", span=scan.span(),
        )  # fmt: skip
    return replace(robot, robot_file=scan.source.path)


def _refuse_environment(scan: Scanner) -> None:
    behind_count = scan.next_matches(_COUNT_AND_WORD)
    if scan.peek_word().lower() == "boundary" or (behind_count and is_multibody_tag(behind_count.group(1))):
        scan.fail(
            "ENV133", f"{scan.source.path} is an environment, not a robot file; expected a number of bodies",
            hint="robots= (--robots) takes dialect E robot files; an environment brings its own robots",
        )  # fmt: skip
