"""Edges of a roadmap file, which stand at both of their ends, as edges that are there once."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from ..errors import DiagnosticLog, FormatError
from ..formats.graph import Edge, Node
from ..formats.source import Source

Pair = tuple[int, int]


def undirected(source: Source, nodes: Sequence[Node], log: DiagnosticLog) -> list[tuple[Pair, Edge]]:
    """Return each edge once: the indices of its nodes, the lower one first, and what it is from there.

    Edges that lead to no node, to their own, or to one of another robot are dropped with a diagnostic. One that stands
    at one end only is kept, with a diagnostic.

    Args:
        source: The file.
        nodes: In file order. Where two have one id, edges lead to the first.
        log: Where findings go.
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
    return [(pair, there[pair] if pair in there else _reversed(back[pair])) for pair in sorted({*there, *back})]


def _fault(nodes: Sequence[Node], i: int, j: int | None) -> str:
    if j is None:
        return "CFG526"
    if i == j:
        return "CFG528"
    return "CFG533" if nodes[i].robot != nodes[j].robot else ""


def _reversed(edge: Edge) -> Edge:
    return dataclasses.replace(edge, intermediates=edge.intermediates[::-1])


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
            first = f", the first at node {nodes[0].vid}"
            log.warn(
                FormatError, code, source.path, f"{len(nodes)} {what.format(many)}{first}", hint=hint,
                span=source.line_span(nodes[0].line),
            )  # fmt: skip
