"""Dialect E robot text files (env-format section 8.2)."""

from __future__ import annotations

from dataclasses import replace

from ..errors import FormatError
from ..model import Dialect, MultiBody
from . import later
from .blocks import Grammar
from .lexer import Scanner


def read_robot(scan: Scanner) -> MultiBody:
    """Read a `.robot` file: a count, bodies, adjacencies and connections.

    Raises:
        FormatError: The text breaks the grammar.
    """
    grammar = Grammar.of(Dialect.E, "planner")
    if scan.peek_word().lower() == "active":
        # Some robot files begin with the tag that a multibody has.
        scan.log.warn(FormatError, "ENV211", "Active", "a robot file begins with its body count", span=scan.span())
        scan.word("Active")
    robot = later.read_robot_bodies(scan, grammar)
    if not scan.at_end():
        scan.log.warn(
            FormatError, "ENV209", scan.source.path, "text behind the last connection is not used", span=scan.span()
        )
    return replace(robot, robot_file=scan.source.path)
