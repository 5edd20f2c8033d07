"""Roadmap files of all ages: graphs of configurations (docs/format/companions.md)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from ..diagnostics import DiagnosticLog
from ..errors import Span
from .graph import Node, read_nodes
from .rows import row_text
from .source import Source

_START, _STOP = "#####GRAPHSTART#####", "#####GRAPHSTOP#####"
# What stands in front of a word is looked at once, not from each of its characters on: that takes quadratic time.
_GRAPH_START = re.compile(r"(?<!\S)\S*?GRAPHSTART\S*")
_GRAPH_STOP = re.compile(r"(?<!\S)\S*?GRAPHSTOP\S*")
_SECTION = re.compile(r"(?<!#)#{3,}(PREAMBLE|ENVFILE|LP|CD|DM|RNGSEED)START#{3,}[ \t]*")
# What would end the line of the env file's name, or begin a section in it, or is not text.
_UNFIT = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]|#{3,}|(?<=GRAPH)(?=ST)")
_VERSION = re.compile(r"\s*(PMPL )?Roadmap Version( Number)?\s+(\S+)", re.IGNORECASE)
_COUNTS = re.compile(r"\s*(\S+)\s+(\S+)\s+(\S+)")


@dataclass(frozen=True, slots=True)
class RoadmapHeader:
    """What stands above the graph of a roadmap.

    Attributes:
        version: As it is written, such as "061300"; empty in files since 2012, which have none.
        environment: The env file that it names.
        preamble: The command that made it.
        local_planners, collision_detectors, distance_metrics: A line each.
        seed: Of the random numbers.
        of_turns: Whether it is of dialect A's time, which counts angles in turns.
    """

    version: str = ""
    environment: str = ""
    preamble: str = ""
    local_planners: tuple[str, ...] = ()
    collision_detectors: tuple[str, ...] = ()
    distance_metrics: tuple[str, ...] = ()
    seed: str = ""
    of_turns: bool = False


@dataclass(frozen=True, slots=True)
class RoadmapFile:
    """A roadmap file in its own numbers.

    Attributes:
        header: What stands above the graph.
        nodes: In file order; each with its edges, so that an edge stands at both of its ends.
        dropped: What stands in nodes and is not used, such as "velocities"; empty where nothing does.
    """

    header: RoadmapHeader
    nodes: tuple[Node, ...]
    dropped: str = field(default="")


@dataclass(frozen=True, slots=True)
class _Counts:
    nodes: int
    edges: int
    span: Span


def is_roadmap(source: Source) -> bool:
    """Whether a text holds what only roadmaps hold."""
    return _GRAPH_START.search(source.text) is not None


def read_roadmap(source: Source, dofs: Sequence[int], log: DiagnosticLog) -> RoadmapFile:
    """Read a roadmap of any version.

    How nodes and edges are built is found by trying, what the version suggests first: a layout is wrong where it puts
    a fraction in the place of a whole number. Declared counts are compared with what is there, not believed.

    Args:
        source: The file.
        dofs: Number of degrees of freedom of each robot.
        log: Where findings go.

    Raises:
        FormatError: It is not a roadmap, is cut off, or belongs to another robot.
    """
    start = _GRAPH_START.search(source.text)
    if start is None:
        message = f"{source.path} holds no graph; expected a line '{_START}'"
        log.fail("CFG520", source.path, message, hint="is it a roadmap, and whole?", span=source.line_span(1))
    header = _read_header(source, start.start(), log)
    stop = _GRAPH_STOP.search(source.text, start.end())
    end = stop.start() if stop else len(source.text)
    counts, begin = _read_counts(source, start.end(), end, log)
    nodes, dropped = read_nodes(source, (begin, end), counts.nodes, dofs, header.version, log)
    _compare(source, counts, nodes, whole=stop is not None, log=log)
    return RoadmapFile(header, nodes, dropped)


def roadmap_text(nodes: Iterable[Node], environment: str, *, index: bool) -> str:
    """Return a roadmap as the planners since 2012 read it, with 17 digits.

    Args:
        nodes: With every edge at both of its ends.
        environment: Name of the env file; what no line of the format can hold of it is written as "_".
        index: Whether the robot's index stands in front of each configuration.
    """
    listed = list(nodes)
    lines = ["#####ENVFILESTART#####", _UNFIT.sub("_", environment), "#####ENVFILESTOP#####", _START]
    edges = sum(len(node.edges) for node in listed)
    lines.append(f"{len(listed)} {edges} {max((node.vid for node in listed), default=-1) + 1}")
    for node in listed:
        robot = node.robot if index else None
        words = [str(node.vid), row_text(node.configuration, robot), str(len(node.edges))]
        for edge in node.edges:
            between = (row_text(row, robot) for row in edge.intermediates)
            words += [str(edge.target), str(len(edge.intermediates)), *between, f"{edge.weight:.16e}"]
        lines.append(" ".join(words))
    return "\n".join([*lines, _STOP]) + "\n"


def _read_header(source: Source, end: int, log: DiagnosticLog) -> RoadmapHeader:
    version = _VERSION.match(source.text, 0, end)
    begins = list(_SECTION.finditer(source.text, 0, end))
    # A section ends before the next one begins.
    ends = (*(m.start() for m in begins[1:]), end)
    sections = {m[1]: _section(source, m, stop, log) for m, stop in zip(begins, ends, strict=False)}

    def lines(name: str) -> tuple[str, ...]:
        # The first line says how many follow.
        return tuple(line.strip() for line in sections.get(name, [])[1:])

    def text(name: str) -> str:
        return "\n".join(sections.get(name, [])).strip()

    return RoadmapHeader(
        version=version[3] if version else "",
        environment=text("ENVFILE"),
        preamble=text("PREAMBLE"),
        local_planners=lines("LP"),
        collision_detectors=lines("CD"),
        distance_metrics=lines("DM"),
        seed=text("RNGSEED"),
        of_turns=version is not None and not version[1],
    )


def _section(source: Source, begin: re.Match[str], end: int, log: DiagnosticLog) -> list[str]:
    stop = re.compile(rf"(?<!#)#{{3,}}{begin[1]}STOP#{{3,}}").search(source.text, begin.end(), end)
    if stop is None:
        message = f"this section has no end; expected '#####{begin[1]}STOP#####'"
        log.warn("CFG530", source.path, message, hint="it is not used", span=source.span(begin.start(), begin.end()))
        return []
    return [line for line in re.split(r"\r\n?|\n", source.text[begin.end() : stop.start()]) if line.strip()]


def _read_counts(source: Source, begin: int, end: int, log: DiagnosticLog) -> tuple[_Counts, int]:
    match = _COUNTS.match(source.text, begin, end)
    words = [str(w) for w in match.groups()] if match else []
    if match is None or not all(re.fullmatch("[0-9]{1,18}", w) for w in words):
        found = source.text[begin:end].split(maxsplit=3)[:3]
        at = begin + len(source.text[begin:end]) - len(source.text[begin:end].lstrip())
        message = f"expected three counts (nodes, edges, next node) behind GRAPHSTART, found {' '.join(found)[:60]!r}"
        hint = "is the file cut off?"
        log.fail("CFG521", source.path, message, hint=hint, span=source.span(min(at, max(0, len(source.text) - 1))))
    return _Counts(int(words[0]), int(words[1]), source.span(match.start(1), match.end(3))), match.end()


def _compare(source: Source, counts: _Counts, nodes: Sequence[Node], *, whole: bool, log: DiagnosticLog) -> None:
    """Compare declared counts with what was read."""
    last = source.span(max(0, len(source.text.rstrip()) - 1))
    if not whole and len(nodes) < counts.nodes:
        message = f"the roadmap ends behind {len(nodes)} of {counts.nodes} nodes, without GRAPHSTOP"
        log.fail("CFG522", source.path, message, hint="is the file cut off?", span=last)
    if not whole:
        log.warn("CFG524", source.path, f"the roadmap ends without '{_STOP}'", hint="is the file cut off?", span=last)
    if len(nodes) != counts.nodes:
        message = f"the roadmap declares {counts.nodes} nodes, and has {len(nodes)}"
        log.warn("CFG523", source.path, message, hint=f"write {len(nodes)}", span=counts.span)
    entries = sum(len(node.edges) for node in nodes)
    # Up to 061300 an edge was counted once, later at both of its ends.
    if counts.edges not in (entries, entries / 2):
        message = f"the roadmap declares {counts.edges} edges, and its nodes have {entries} entries, two for each edge"
        hint = f"write {entries}, or {entries // 2} up to version 061300"
        log.warn("CFG523", source.path, message, hint=hint, span=counts.span)
