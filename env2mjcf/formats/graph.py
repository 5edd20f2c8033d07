"""The nodes and edges of a roadmap, in any of the layouts that were ever written (docs/format/companions.md)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NoReturn

from ..diagnostics import DiagnosticLog
from .lexer import parse_integer
from .rows import check_rows, coordinate, coordinate_hint
from .source import Source

_WORD = re.compile(r"\S+")
_MODERN_INFO = 3
# Beyond this, doubles are no longer every whole number.
_LARGEST_ID = 2**53


class EdgeForm(StrEnum):
    """What stands behind the target of an edge."""

    WEIGHT = "a weight"
    PLANNER = "a local planner and a weight"
    INTERMEDIATES = "intermediate configurations and a weight"
    CONTROLS = "intermediate configurations, a weight and controls"


@dataclass(frozen=True, slots=True)
class Edge:
    """One end of an edge.

    Attributes:
        target: Id of the node at the other end.
        weight: Its length, in ticks or whatever the planner measured.
        planner: Index of the local planner that made it; None where the file has none.
        intermediates: Configurations on the way, both ends left out.
    """

    target: int
    weight: float
    planner: int | None = None
    intermediates: tuple[tuple[float, ...], ...] = ()


@dataclass(frozen=True, slots=True)
class Node:
    """A node and its edges.

    Attributes:
        vid: Its id.
        robot: Index of the robot.
        configuration: In the file's own numbers.
        info: Obstacle, tag and clearance, as many as the version has.
        edges: In file order.
        line: The line that it begins on.
    """

    vid: int
    robot: int
    configuration: tuple[float, ...]
    info: tuple[float, ...]
    edges: tuple[Edge, ...]
    line: int


@dataclass(frozen=True, slots=True)
class _Layout:
    indexed: bool
    velocities: bool
    info: int
    edge: EdgeForm


@dataclass(frozen=True, slots=True)
class _Word:
    text: str
    value: float | None
    start: int
    first: bool  # of its line


class _Misfit(Exception):
    """A word that a layout has no place for.

    Args:
        at: Index of the word; one past the last where the words end too early.
        expected: What the layout has there.
    """

    def __init__(self, at: int, expected: str) -> None:
        super().__init__(at, expected)
        self.at = at
        self.expected = expected


def read_nodes(
    source: Source, part: tuple[int, int], count: int, dofs: Sequence[int], version: str, log: DiagnosticLog
) -> tuple[tuple[Node, ...], str]:
    """Read the nodes of a roadmap.

    Args:
        source: The file.
        part: Where they begin and end in its text.
        count: How many are declared.
        dofs: Number of degrees of freedom of each robot.
        version: What the header says, or nothing.
        log: Where findings go.

    Returns:
        The nodes, and what of them is not used.

    Raises:
        FormatError: The numbers fit these robots in no layout.
    """
    words = _words(source, *part)
    best: tuple[int, _Misfit] | None = None
    complete: tuple[_Layout, list[Node]] | None = None
    for layout in _layouts(version, len(dofs)):
        reading = _Reading(source, words, layout, dofs)
        try:
            nodes = reading.nodes()
        except _Misfit as misfit:
            # What the version suggests speaks, unless another layout understood more of the nodes.
            best = (reading.understood, misfit) if best is None or reading.understood > best[0] else best
            continue
        check_rows(source, len(nodes), log, source.span(part[0]))
        # Numbers that happen to fit may still be cut up wrongly: every planner begins a line with each node.
        if reading.aligned and len(nodes) == count:
            return tuple(nodes), _dropped(layout)
        complete = complete or (layout, nodes)
    if complete is not None:
        return tuple(complete[1]), _dropped(complete[0])
    assert best is not None
    _fail(source, words, best[1], part[1], dofs, log)


def _words(source: Source, begin: int, end: int) -> list[_Word]:
    words: list[_Word] = []
    for start, text in source.lines():
        if start + len(text) <= begin or start >= end:
            continue
        low, high = max(0, begin - start), min(len(text), end - start)
        for n, match in enumerate(_WORD.finditer(text, low, high)):
            words.append(_Word(match.group(), coordinate(match.group()), start + match.start(), n == 0))
    return words


def _layouts(version: str, robots: int) -> Iterator[_Layout]:
    """Yield all layouts, those of the version first.

    A version stands above the graph up to 2011: 061300 and later have three info fields, 62000 and 061100 two, and
    older ones none. Files since 2012 have no version, and each of their edges has intermediates.
    """
    infos = [0, 2, _MODERN_INFO]
    forms = [EdgeForm.INTERMEDIATES, EdgeForm.CONTROLS, EdgeForm.PLANNER, EdgeForm.WEIGHT]
    if version:
        infos.sort(key=lambda n: n != _expected_info(parse_integer(version) or 0))
        forms = [EdgeForm.PLANNER, EdgeForm.WEIGHT, EdgeForm.INTERMEDIATES]
    indices = (True, False) if robots > 1 else (False, True)
    moving = [] if version else [(True, 0)]
    kinds = [(False, infos[0]), *moving, *((False, info) for info in infos[1:])]
    for velocities, info in kinds:
        for indexed in indices:
            for form in forms:
                yield _Layout(indexed, velocities, info, form)


def _expected_info(number: int) -> int:
    if number in (62000, 61100):
        return 2
    return _MODERN_INFO if number >= 61300 else 0


def _dropped(layout: _Layout) -> str:
    parts = ["velocities"] if layout.velocities else []
    return " and ".join([*parts, "controls"] if layout.edge is EdgeForm.CONTROLS else parts)


class _Reading:
    """Reads words in one layout."""

    def __init__(self, source: Source, words: Sequence[_Word], layout: _Layout, dofs: Sequence[int]) -> None:
        self._source, self._words, self._layout, self._dofs = source, words, layout, dofs
        self._at = self._intermediates = 0
        self.aligned = True
        self.understood = 0

    def nodes(self) -> list[Node]:
        """Read to the end.

        Raises:
            _Misfit: The layout is not the one of these words.
        """
        found: list[Node] = []
        while self._at < len(self._words):
            found.append(self._node())
            whole_line = self._at >= len(self._words) or self._words[self._at].first
            self.understood += self.aligned and whole_line
        return found

    def _node(self) -> Node:
        word = self._words[self._at]
        self.aligned = self.aligned and word.first
        vid = self._whole("the id of a node")
        robot, configuration = self._configuration()
        info = tuple(self._number("an info field") for _ in range(self._layout.info))
        count = self._whole("the number of edges of a node")
        if count > len(self._words) - self._at:
            raise _Misfit(len(self._words), f"{count} edges")
        edges = tuple(self._edge() for _ in range(count))
        return Node(vid, robot, configuration, info, edges, self._source.span(word.start).line)

    def _edge(self) -> Edge:
        form = self._layout.edge
        target = self._whole("the id of a neighbour")
        if form is EdgeForm.WEIGHT:
            return Edge(target, self._number("the weight of an edge"))
        if form is EdgeForm.PLANNER:
            planner = self._whole("the index of a local planner", least=-1)
            return Edge(target, self._number("the weight of an edge"), planner)
        count = self._whole("the number of intermediate configurations of an edge")
        # Counted over all edges: those of a robot without degrees of freedom are made of no words.
        self._intermediates += count
        if self._intermediates > len(self._words):
            raise _Misfit(len(self._words), f"{count} intermediate configurations")
        between = tuple(self._configuration()[1] for _ in range(count))
        weight = self._number("the weight of an edge")
        if form is EdgeForm.CONTROLS:
            self._skip_controls(len(self._dofs) and self._dofs[0])
        return Edge(target, weight, None, between)

    def _configuration(self) -> tuple[int, tuple[float, ...]]:
        robot = self._whole("the index of a robot") if self._layout.indexed else 0
        if robot >= len(self._dofs):
            raise _Misfit(self._at - 1, "the index of a robot")
        numbers = tuple(self._number("a number of a configuration") for _ in range(self._dofs[robot]))
        if self._layout.velocities:
            for _ in numbers:
                self._number("a velocity")
        return robot, numbers

    def _skip_controls(self, signals: int) -> None:
        self._whole("the number of time steps of an edge")
        count = self._whole("the number of controls of an edge")
        if count > len(self._words) - self._at:
            raise _Misfit(len(self._words), f"{count} controls")
        for _ in range(count):
            if self._at >= len(self._words):
                raise _Misfit(self._at, "the name of an actuator")
            self._at += 1
            for _ in range(signals):
                self._number("a signal of a control")

    def _number(self, expected: str) -> float:
        if self._at >= len(self._words):
            raise _Misfit(self._at, expected)
        value = self._words[self._at].value
        if value is None:
            raise _Misfit(self._at, expected)
        self._at += 1
        return value

    def _whole(self, expected: str, least: int = 0) -> int:
        value = self._number(expected)
        if not value.is_integer() or not least <= value <= _LARGEST_ID:
            raise _Misfit(self._at - 1, expected)
        return int(value)


def _fail(
    source: Source, words: Sequence[_Word], misfit: _Misfit, end: int, dofs: Sequence[int], log: DiagnosticLog
) -> NoReturn:
    expected = " or ".join(f"{d} (robot {i})" for i, d in enumerate(dofs)) or "none"
    if misfit.at >= len(words):
        message = f"the nodes end where {misfit.expected} was expected; degrees of freedom of the robots: {expected}"
        hint = "is the file cut off, or the roadmap of another scene?"
        log.fail("CFG522", source.path, message, hint=hint, span=source.span(max(0, end - 1)))
    word = words[misfit.at]
    message = f"expected {misfit.expected}, found {word.text[:60]!r}; degrees of freedom of the robots: {expected}"
    hint = coordinate_hint(word.text) or "is it the roadmap of another scene?"
    log.fail("CFG529", source.path, message, hint=hint, span=source.span(word.start, word.start + len(word.text)))
