"""Roadmaps of a scene: configurations, and the ways between them, which stand at both of their ends in a file."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..diagnostics import DiagnosticLog
from ..errors import Diagnostic
from ..formats import roadmap as text
from ..formats.graph import Edge, Node
from ..formats.lexer import parse_number
from ..formats.source import Source, read_source
from ..limits import LARGEST, Limits
from ..model.dialects import begins_with_robot
from ..options import PathArgument, whole
from ..simulation.scene import Scene
from ..transforms import Array, real_array
from .query_files import configurations, dofs_of, file_numbers, from_turns, write

Indices = NDArray[np.int64]
Rows = list[tuple[int, Sequence[float]]]

_STRAIGHT = re.compile(r"straight\w*", re.IGNORECASE)
_ROTATES = re.compile(r"rotate_?at_?s", re.IGNORECASE)


@dataclass(frozen=True, slots=True, eq=False)
class Roadmap:
    """A graph of configurations, whose edges have no direction and are there once.

    `Roadmap.of` makes one out of nodes and edges alone.

    Attributes:
        q: (n, dim) nodes in metres and radians; other robots stand at the start of their query, else at home.
        edges: (m, 2) indices into `q`; in what was read, the lower one first, and in order.
        weights: (m,) lengths as the planner measured them.
        intermediates: For each edge its (k, dim) configurations on the way from `edges[i, 0]` to `edges[i, 1]`, both
            ends left out.
        vids: (n,) ids of the nodes.
        robots: (n,) index of the robot that each node belongs to.
        info: (n, 3) obstacle, tag and clearance of each node; NaN where the file has none. Not written.
        planners: (m,) index of the local planner that made each edge; -1 where the file has none. Not written.
        lines: (n,) line of the file that each node stands on; zero for what was not read.
        header: What stands above the graph; only the name of the environment is written.
        file: Its name.
        diagnostics: What was found.
    """

    q: Array
    edges: Indices
    weights: Array
    intermediates: tuple[Array, ...]
    vids: Indices
    robots: Indices
    info: Array
    planners: Indices
    lines: Indices
    header: text.RoadmapHeader = field(default_factory=text.RoadmapHeader)
    file: str = ""
    diagnostics: tuple[Diagnostic, ...] = ()

    @classmethod
    def of(
        cls,
        q: ArrayLike,
        edges: ArrayLike,
        weights: ArrayLike | None = None,
        intermediates: Sequence[ArrayLike] | None = None,
        robot: int = 0,
    ) -> Roadmap:
        """Make a roadmap.

        Args:
            q: (n, dim) nodes.
            edges: (m, 2) indices into them.
            weights: (m,) lengths; None takes straight distances in q.
            intermediates: For each edge (k, dim) configurations between its ends; None means none.
            robot: Whose it is.

        Raises:
            TypeError: The robot is not a whole number.
            ValueError: Shapes do not belong together, a number is not finite, an index is not a whole number, or an
                edge leads to no node, to its own, or stands there twice.
        """
        nodes = real_array(q, "array of nodes")
        pairs = _pairs(edges)
        n, m = len(nodes), len(pairs)
        if nodes.ndim != 2:
            raise ValueError(f"nodes of shape {nodes.shape}; expected (n, dim)")
        if m and not (pairs.min() >= 0 and pairs.max() < n):
            raise ValueError(f"edges hold an index outside 0 to {n - 1}, the nodes")
        if (pairs[:, 0] == pairs[:, 1]).any():
            raise ValueError("an edge leads from a node to itself")
        if len(np.unique(np.sort(pairs, axis=1), axis=0)) != m:
            raise ValueError("an edge stands there twice; edges have no direction")
        lengths = np.linalg.norm(nodes[pairs[:, 1]] - nodes[pairs[:, 0]], axis=1)
        given = lengths if weights is None else real_array(weights, "array of weights")
        between = [np.zeros((0, nodes.shape[1]))] * m if intermediates is None else list(intermediates)
        if given.shape != (m,) or len(between) != m:
            raise ValueError(
                f"{given.shape} weights and {len(between)} intermediates; expected one for each of {m} edges"
            )
        if not (np.abs(nodes) <= LARGEST).all() or not (np.abs(given) <= LARGEST).all():
            raise ValueError(f"nodes or weights beyond {LARGEST:g}; no file can hold them")
        ways = tuple(real_array(b, "array of intermediates").reshape(-1, nodes.shape[1]) for b in between)
        robots = np.full(n, whole("robot", robot, 0), dtype=np.int64)
        info, planners, lines = np.full((n, 3), np.nan), np.full(m, -1, dtype=np.int64), np.zeros(n, dtype=np.int64)
        return cls(nodes, pairs, given, ways, np.arange(n), robots, info, planners, lines)

    def __len__(self) -> int:
        return len(self.q)

    def __repr__(self) -> str:
        return f"<Roadmap {self.file!r}: {len(self)} nodes, {len(self.edges)} edges>"

    def way(self, edge: int) -> Array:
        """Return the corners of an edge, both ends included, (k, dim)."""
        start, end = self.q[self.edges[edge]]
        return np.concatenate([start[None], self.intermediates[edge], end[None]])


def read_roadmap(scene: Scene, file: PathArgument, *, limits: Limits | None = None, strict: bool = False) -> Roadmap:
    """Read a roadmap file of any version for a scene.

    Args:
        scene: Whose roadmap it is.
        file: A roadmap file.
        limits: Bounds on hostile input.
        strict: Whether warnings are errors.

    Raises:
        FormatError: The file cannot be read, is cut off, or is the roadmap of another robot.
    """
    log = DiagnosticLog(strict)
    return roadmap_record(scene, read_source(file, log, limits or Limits()), log)


def roadmap_record(scene: Scene, source: Source, log: DiagnosticLog) -> Roadmap:
    """Read a roadmap from a text; see `read_roadmap`."""
    found = text.read_roadmap(source, dofs_of(scene), log)
    if found.dropped:
        log.info("CFG531", source.path, f"{found.dropped} are not used")
    nodes = found.nodes
    rows: Rows = [(n.robot, n.configuration) for n in nodes]
    kept = _undirected(source, nodes, log)
    robots = np.array([n.robot for n in nodes], dtype=np.int64)
    edges = np.array([pair for pair, _ in kept], dtype=np.int64).reshape(-1, 2)
    between: Rows = [(int(robots[i]), row) for (i, _), edge in kept for row in edge.intermediates]
    if found.header.of_turns:
        rows = from_turns(scene, rows, source.path, source.line_span(1), log)
    stops = np.cumsum([0, *(len(edge.intermediates) for _, edge in kept)])
    q, corners = configurations(scene, rows), configurations(scene, between)
    info = np.array([(*n.info, *[np.nan] * (3 - len(n.info))) for n in nodes], dtype=np.float64).reshape(-1, 3)
    return Roadmap(
        q,
        edges,
        np.array([edge.weight for _, edge in kept], dtype=np.float64),
        tuple(corners[a:b] for a, b in pairwise(stops)),
        np.array([n.vid for n in nodes], dtype=np.int64),
        robots,
        info,
        np.array([-1 if edge.planner is None else edge.planner for _, edge in kept], dtype=np.int64),
        np.array([n.line for n in nodes], dtype=np.int64),
        found.header,
        source.path,
        tuple(log),
    )


def write_roadmap(scene: Scene, roadmap: Roadmap, file: PathArgument) -> Path:
    """Write a roadmap as the planners since 2012 read it, whole or not at all.

    Every edge is written at both of its ends, with its weight and intermediates; numbers have 17 digits, as in
    `write_path`. What that version has no place for (info fields, local planners, preamble, seed) is not written.

    Args:
        scene: Whose roadmap it is.
        roadmap: What to write.
        file: The file to write; replaced if it exists.

    Raises:
        ConversionError: The file cannot be written.
        ValueError: A configuration has a wrong shape, a value or weight is not finite, or there is no such robot.
    """
    named = roadmap.header.environment or Path(scene.environment.path).name
    if not (np.abs(roadmap.weights) <= LARGEST).all():
        raise ValueError(f"weights that are not finite, or beyond {LARGEST:g}; no file can hold them")
    nodes = _nodes(scene, roadmap)
    return write(file, text.roadmap_text(nodes, named, index=begins_with_robot(scene.environment)))


def _pairs(edges: ArrayLike) -> Indices:
    """Return edges as indices, (m, 2)."""
    if isinstance(edges, np.ma.MaskedArray):
        raise ValueError("edges are a masked array; expected plain whole numbers")
    given = np.asarray(edges)
    if not given.size:
        return np.zeros((0, 2), dtype=np.int64)
    if given.ndim != 2 or given.shape[1] != 2:
        raise ValueError(f"edges of shape {given.shape}; expected (m, 2)")
    if not np.issubdtype(given.dtype, np.integer):
        raise ValueError(f"edges of {given.dtype}; expected whole numbers, indices of nodes")
    return given.astype(np.int64)


def _nodes(scene: Scene, roadmap: Roadmap) -> list[Node]:
    numbers: list[list[float]] = [[]] * len(roadmap)
    for robot in np.unique(roadmap.robots).tolist():
        own = np.flatnonzero(roadmap.robots == robot)
        for i, row in zip(own.tolist(), file_numbers(scene, roadmap.q[own], robot), strict=True):
            numbers[i] = row
    ends: list[list[Edge]] = [[] for _ in range(len(roadmap))]
    vids, robots = roadmap.vids.tolist(), roadmap.robots.tolist()
    for (i, j), weight, way in zip(
        roadmap.edges.tolist(), roadmap.weights.tolist(), roadmap.intermediates, strict=True
    ):
        between = tuple(map(tuple, file_numbers(scene, way, robots[i]))) if len(way) else ()
        ends[i].append(Edge(vids[j], weight, None, between))
        ends[j].append(Edge(vids[i], weight, None, between[::-1]))
    return [
        Node(vids[i], robots[i], tuple(numbers[i]), (), tuple(sorted(ends[i], key=lambda e: e.target)), 0)
        for i in range(len(roadmap))
    ]


Pair = tuple[int, int]


def _undirected(source: Source, nodes: Sequence[Node], log: DiagnosticLog) -> list[tuple[Pair, Edge]]:
    """Return each edge once: the indices of its nodes, the lower one first, and what it is from there.

    Edges that lead to no node, to their own, or to one of another robot are dropped with a diagnostic. One that stands
    at one end only is kept, with a diagnostic. Where two nodes have one id, edges lead to the first.
    """
    index: dict[int, int] = {}
    findings: dict[str, list[Node]] = {}
    there: dict[Pair, Edge] = {}
    back: dict[Pair, Edge] = {}
    for i, node in enumerate(nodes):
        if index.setdefault(node.vid, i) != i:
            findings.setdefault("CFG525", []).append(node)
    for i, node in enumerate(nodes):
        for edge in node.edges:
            j = index.get(edge.target)
            code = _fault(nodes, i, j)
            if j is None or code:
                findings.setdefault(code, []).append(node)
            elif i < j:
                there.setdefault((i, j), edge)
            else:
                back.setdefault((j, i), edge)
    findings["CFG527"] = [nodes[i] for i, _ in sorted(there.keys() ^ back.keys())]
    _report(source, findings, log)
    there |= {
        pair: dataclasses.replace(edge, intermediates=edge.intermediates[::-1])
        for pair, edge in back.items()
        if pair not in there
    }
    return sorted(there.items(), key=lambda item: item[0])


def _fault(nodes: Sequence[Node], i: int, j: int | None) -> str:
    if j is None:
        return "CFG526"
    if i == j:
        return "CFG528"
    return "CFG533" if nodes[i].robot != nodes[j].robot else ""


_WHAT = {
    "CFG525": ("node{} with an id that an earlier one has", "edges lead to the first one"),
    "CFG526": ("edge{} to a node that is not there", "they are not used; is the file cut off?"),
    "CFG527": ("edge{} at one of both ends only", "they are read as edges in both directions"),
    "CFG528": ("edge{} from a node to itself", "they are not used"),
    "CFG533": ("edge{} between nodes of different robots", "they are not used"),
}


def _report(source: Source, findings: dict[str, list[Node]], log: DiagnosticLog) -> None:
    for code, nodes in sorted(findings.items()):
        if nodes:
            what, hint = _WHAT[code]
            many = "" if len(nodes) == 1 else "s"
            message = f"{len(nodes)} {what.format(many)}, the first at node {nodes[0].vid}"
            log.warn(code, source.path, message, hint=hint, span=source.line_span(nodes[0].line))


def ways_between(scene: Scene, roadmap: Roadmap, log: DiagnosticLog) -> tuple[Array, ...]:
    """Return the configurations on each edge's way, (k, dim), both ends left out.

    Those of the file, and the corners of `rotate_at_s`, which moves the base without turning anything for a fraction s
    of the way, turns there, and moves on. What other local planners did is not known: their edges are taken as
    straight, with a finding.
    """
    names = roadmap.header.local_planners
    between = list(roadmap.intermediates)
    unknown: dict[str, int] = {}
    for edge, planner in enumerate(roadmap.planners.tolist()):
        # Planners are counted from 1.
        name = names[planner - 1] if 0 < planner <= len(names) else ""
        if planner < 0 or len(between[edge]) or _STRAIGHT.match(name):
            continue
        fraction = _turning_point(name)
        if fraction is None:
            unknown[name or str(planner)] = unknown.get(name or str(planner), 0) + 1
        else:
            between[edge] = _rotating_at(scene, roadmap, edge, fraction)
    for name, count in unknown.items():
        edges = f"{count} edge{'' if count == 1 else 's'} made by the local planner '{name}'"
        log.info("CFG534", roadmap.file, f"{edges}, which may have left the straight way; checked as straight")
    return tuple(between)


def _turning_point(name: str) -> float | None:
    """Return s of `rotate_at_s`; None for other planners, and where several are named."""
    if not _ROTATES.match(name):
        return None
    numbers = [n for n in map(parse_number, name.split()) if n is not None]
    return numbers[0] if len(numbers) == 1 else None


def _rotating_at(scene: Scene, roadmap: Roadmap, edge: int, fraction: float) -> Array:
    i, j = roadmap.edges[edge].tolist()
    robot = int(roadmap.robots[i])
    dofs = scene.compiled.assembly.robots[robot].kinematics.dofs
    columns = np.arange(scene.space.dim)[scene.space.robot_slices[robot]]
    moves = columns[[d.connection is None and d.kind.is_length for d in dofs]]
    corners = roadmap.q[[i, j]].copy()
    # The file lists the edge from both ends, and s counts from the one that it was made from: one half is the same.
    corners[:, moves] = (1 - fraction) * roadmap.q[i, moves] + fraction * roadmap.q[j, moves]
    return corners
