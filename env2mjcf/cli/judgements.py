"""What `env2mjcf check` says of configurations and of the edges between them, as text and as JSON."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from rich.text import Text
from tqdm import tqdm

from .terminal import one_line, plain

if TYPE_CHECKING:
    from ..companions.records import Graph, Poses
    from ..simulation.edge_verdicts import EdgeJudge, EdgeVerdict
    from ..simulation.verdicts import Judge, Verdict

V = TypeVar("V")


class Listed(Protocol[V]):
    """Who has a verdict on each of many things."""

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Whether each is valid."""
        ...

    def verdict(self, index: int) -> V:
        """Say all about one."""
        ...

    def rough(self, verdict: V) -> bool:
        """Whether a depth is not that of a body."""
        ...


def verdict_lines(verdict: Verdict) -> Iterator[Text]:
    """Yield what is wrong with a configuration."""
    wrong = ", ".join(_wrong(verdict))
    yield _headed(verdict.label, wrong)
    for reason in verdict.reasons():
        yield Text(f"    {one_line(reason)}")


def edge_lines(verdict: EdgeVerdict) -> Iterator[Text]:
    """Yield what is wrong with an edge, and where."""
    if verdict.at is not None and verdict.fraction is not None:
        yield _headed(verdict.label, f"{', '.join(_wrong(verdict.at))} at {verdict.fraction:.4g} of the way")
        for reason in verdict.at.reasons():
            yield Text(f"    {one_line(reason)}")
    elif not verdict.checked:
        yield _headed(verdict.label, "not checked: the poses at its ends belong to no configuration")
    else:
        yield _headed(verdict.label, "" if verdict.valid else "not proved: bodies touch, or nearly, between the checks")


def pose_summary(poses: Poses) -> Text:
    """Return a line on how far recorded poses are from what the robot can do."""
    fitting = int(poses.fits.sum())
    return Text(
        f"recorded poses: {fitting} of {len(poses.fits)} are configurations of the robot; links at most "
        f"{poses.error:.2g} m from where these put them",
        "bold",
    )


def node_summary(judge: Judge, what: str) -> Text:
    """Return a line on all configurations."""
    total, valid = len(judge.valid), int(judge.valid.sum())
    counts = [f"{valid} valid"]
    for wrong, so in (
        ("in collision", judge.in_collision),
        ("out of limits", ~judge.in_limits),
        ("outside the boundary", ~judge.inside),
    ):
        if so.any():
            counts.append(f"{int(so.sum())} {wrong}")
    return Text(f"{_counted(total, what)}: {', '.join(counts)}", "bold")


def edge_summary(judge: EdgeJudge) -> Text:
    """Return a line on all edges."""
    valid = int(judge.valid.sum())
    counts = [f"{valid} valid{'' if judge.proved is None else ' and proved free'}"]
    unproved = 0 if judge.proved is None else int((judge.stepped & ~judge.proved).sum())
    for wrong, so in (
        ("invalid", int((judge.checked & ~judge.stepped).sum())),
        ("not proved", unproved),
        ("not checked", int((~judge.checked).sum())),
    ):
        if so:
            counts.append(f"{so} {wrong}")
    steps = f", checked every {judge.resolution:.4g} m"
    return Text(f"{_counted(len(judge.valid), 'edge')}{steps}: {', '.join(counts)}", "bold")


def first_invalid(judge: Judge, edges: EdgeJudge | None) -> Iterator[Text]:
    """Yield which configuration and which edge are the first that are invalid, where there are edges."""
    if edges is None:
        return
    if not judge.valid.all():
        yield Text(f"first invalid: {one_line(judge.verdict(int(np.argmin(judge.valid))).label)}")
    if not edges.valid.all():
        verdict = edges.verdict(int(np.argmin(edges.valid)))
        where = "" if verdict.fraction is None else f", at {verdict.fraction:.4g} of the way"
        yield Text(f"first invalid: {one_line(verdict.label)}{where}")


def as_json(judge: Judge, graph: Graph | None, edges: EdgeJudge | None) -> dict[str, Any]:
    """Return every configuration, and every edge, in terms of JSON."""
    nodes: list[dict[str, Any]] = [plain(judge.verdict(i)) for i in _bar(len(judge.valid), "q")]
    if graph is None or edges is None:
        return {"configurations": nodes}
    for node, line in zip(nodes, graph.lines.tolist(), strict=True):
        node["line"] = line
    if graph.ids is not None:
        for node, name in zip(nodes, graph.ids.tolist(), strict=True):
            node["id"] = name
    return {
        "kind": graph.kind,
        "version": graph.version,
        "pose_error": None if graph.poses is None else graph.poses.error,
        "resolution": edges.resolution,
        "certified": edges.proved is not None,
        "configurations": nodes,
        "edges": [plain(edges.verdict(i)) for i in _bar(len(edges.valid), "edge")],
    }


def _wrong(verdict: Verdict) -> list[str]:
    told = (
        ("in collision", verdict.in_collision),
        ("out of limits", verdict.limits),
        ("outside the boundary", verdict.outside),
    )
    return [what for what, so in told if so]


def _headed(label: str, wrong: str) -> Text:
    return Text.assemble(f"{one_line(label)}: ", (wrong, "bold red") if wrong else ("valid", "bold green"))


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def _bar(count: int, unit: str) -> tqdm[int]:
    return tqdm(range(count), unit=unit, delay=1, leave=False, disable=not sys.stderr.isatty())
