"""`env2mjcf check`: verdicts on configurations and on the edges between them, as text and as JSON."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import tyro
from numpy.typing import NDArray
from rich.text import Text
from tqdm import tqdm
from tyro.conf import Positional

from ..diagnostics import DiagnosticLog
from ..errors import ConversionError, abridged, counted, one_line
from ..options import Options
from ..system.files import refuse_unwritable
from .arguments import OptionFlags, Output, OutputFlags
from .program import BAD_INPUT, DONE, FINDING
from .terminal import listed, loaded, plain, print_diagnostics, print_json, print_parts, reason_lines, working

if TYPE_CHECKING:
    from ..companions.records import Configurations, Graph, Poses
    from ..contact.types import Reason, Verdict
    from ..simulation.edge_verdicts import EdgeVerdict, EdgeVerdicts
    from ..simulation.scene import Scene
    from ..simulation.verdicts import Verdicts

# More configurations than this are listed one by one only with --all.
_LISTED = 20


@dataclass(frozen=True, slots=True)
class Check:
    """Tell whether configurations are valid, and who touches whom, where and how deep.

    A configuration is numbers in the file's own units (turns in dialect A, fractions of pi in B to E; lengths as in
    the file), as many as there are degrees of freedom of all robots, or of one robot behind its index. A .query file,
    or a .csv or .npy file with such rows, holds many; a .path or .map file of any version holds the ways between them,
    too, which are checked at even steps. Without any: the scene's own tasks, else home.

    Examples:
      env2mjcf check serial.env -0.5 0 0 0.125 0.25 0
      env2mjcf check serial.env --query serial.query
      env2mjcf check serial.env serial.path --resolution 0.01
      env2mjcf check serial.env serial.map --certified --picture serial.png
      env2mjcf check box.env samples.npy --robots box.robot --radians
      env2mjcf check problem.xml --json

    Attributes:
        scene: An env file, an XML environment or a problem XML.
        configurations: Numbers of one configuration, or a file of many.
        radians: Numbers are radians and metres.
        all: List every configuration and edge, also when there are many.
        resolution: Greatest distance in metres that any point of a robot moves between two checks of an edge; the
            file's PositionRes by default, else 0.01 of the scene's extent.
        certified: Prove, too, that nothing touches between the checks of an edge.
        picture: Draw a PNG file, too: configurations as dots and edges as lines, red where they are invalid, and the
            robot where the first one is.
    """

    scene: Annotated[str, tyro.conf.arg(metavar="SCENE"), Positional]
    configurations: Annotated[tuple[str, ...], tyro.conf.arg(metavar="[NUMBERS | FILE]"), Positional] = ()
    radians: bool = False
    all: bool = False
    resolution: float | None = None
    certified: bool = False
    picture: Annotated[str | None, tyro.conf.arg(metavar="PICTURE.png")] = None
    output: OutputFlags = field(default_factory=Output)
    options: OptionFlags = field(default_factory=Options)

    def run(self) -> int:
        """Print a verdict on each configuration; 1 if any is invalid."""
        from ..simulation.verdicts import Verdicts
        from ..view.graph_picture import draw

        if self.picture is not None and not self.picture.lower().endswith(".png"):
            raise ValueError(f"--picture is {self.picture}; expected a file that ends in .png")
        if self.picture is not None:
            refuse_unwritable(self.picture, "CFG552")
        if self.configurations and self.options.query is not None:
            raise ValueError("configurations are given twice: behind the scene and with --query")
        options = dataclasses.replace(self.options, query=None)
        scene, log = loaded(self.scene, options)
        rows = self._rows(scene, log)
        print_diagnostics(log, self.output.verbose)
        graph = rows.graph
        poses = graph.poses if graph else None
        placed = (poses.links, poses.fits) if poses else (None, None)
        nodes = Verdicts(scene, scene.space.check(rows.q), rows.labels, *placed)
        edges = self._edges(scene, graph)
        valid = bool(nodes.valid.all()) and (edges is None or bool(edges.valid.all()))
        if self.output.json:
            found = {"valid": valid, "dofs": scene.space.names, **_as_json(nodes, graph, edges)}
            print_json({**found, "diagnostics": listed(log, self.output.verbose)})
        else:
            print_parts(self._lines(scene, nodes, graph, edges))
        if self.picture is not None:
            # Where the picture fails, the report is there.
            sys.stdout.flush()
            try:
                with working("drawing"):
                    draw(scene, rows, nodes, edges, self.picture)
            except ConversionError as error:
                print_diagnostics(error.diagnostics, self.output.verbose)
                return BAD_INPUT
        return DONE if valid else FINDING

    def _edges(self, scene: Scene, graph: Graph | None) -> EdgeVerdicts | None:
        from ..simulation.edge_verdicts import EdgeVerdicts

        if graph is None:
            if self.certified or self.resolution is not None:
                raise ValueError("--resolution and --certified are for the edges of a path or roadmap; there is none")
            return None
        checked = None
        if graph.poses is not None:
            checked = graph.poses.fits[graph.edges.ends[:, 0]] & graph.poses.fits[graph.edges.ends[:, 1]]
        return EdgeVerdicts(scene, graph.edges, self.resolution, self.certified, checked)

    def _rows(self, scene: Scene, log: DiagnosticLog) -> Configurations:
        from ..companions.configurations import of_file, of_numbers, of_scene
        from ..companions.records import is_number

        words = self.configurations if self.options.query is None else (str(self.options.query),)
        if not words:
            return of_scene(scene)
        if len(words) == 1 and not is_number(words[0]):
            return of_file(scene, words[0], self.radians, self.options.limits, log)
        return of_numbers(scene, words, self.radians)

    def _lines(self, scene: Scene, nodes: Verdicts, graph: Graph | None, edges: EdgeVerdicts | None) -> Iterator[Text]:
        from ..simulation.verdicts import any_rough

        told: list[Reason] = []

        def node(i: int) -> Iterator[Text]:
            verdict = nodes.verdict(i)
            told.extend(verdict.reasons)
            return _node_lines(nodes.labels[i], verdict, self.all)

        def edge(edges: EdgeVerdicts, i: int) -> Iterator[Text]:
            verdict = edges.verdict(i)
            told.extend(verdict.at.reasons if verdict.at else ())
            return _edge_lines(verdict, self.all)

        yield from self._listed("configuration", nodes.valid, node)
        if edges is not None:
            yield from self._listed("edge", edges.valid, partial(edge, edges))
        if any_rough(scene, told):
            yield Text("depths at bodies that are not convex may be more than the shortest way out", "dim")
        if graph is not None and graph.poses is not None:
            yield _pose_summary(graph.poses)
        yield _node_summary(nodes, "node" if graph and graph.kind == "roadmap" else "configuration")
        if edges is not None:
            yield _edge_summary(edges)
            yield from _first_invalid(nodes, edges)

    def _listed(self, what: str, valid: NDArray[np.bool_], lines: Callable[[int], Iterator[Text]]) -> Iterator[Text]:
        every = self.all or len(valid) <= _LISTED
        chosen = range(len(valid)) if every else np.flatnonzero(~valid).tolist()
        for i in chosen if self.all else chosen[:_LISTED]:
            yield from lines(i)
        left = len(chosen) - _LISTED
        if left > 0 and not self.all:
            yield Text(f"... and {left} more that are invalid (--all lists every {what})", "dim")


def _node_lines(label: str, verdict: Verdict, every: bool) -> Iterator[Text]:
    yield _headed(label, verdict.summary)
    yield from reason_lines(verdict.reasons, every)


def _edge_lines(verdict: EdgeVerdict, every: bool) -> Iterator[Text]:
    if verdict.at is not None and verdict.fraction is not None:
        head, *reasons = _node_lines(verdict.label, verdict.at, every)
        yield head.append(f" at {verdict.fraction:.4g} of the way", "bold red")
        yield from reasons
    elif not verdict.checked:
        yield _headed(verdict.label, "not checked: the poses at its ends belong to no configuration")
    else:
        yield _headed(verdict.label, "" if verdict.valid else "not proved: bodies touch, or nearly, between the checks")


def _pose_summary(poses: Poses) -> Text:
    """Return a line on how far recorded poses are from what the robot can do."""
    fitting = int(poses.fits.sum())
    return Text(
        f"recorded poses: {fitting} of {len(poses.fits)} are configurations of the robot; links at most "
        f"{poses.error:.2g} m from where these put them",
        "bold",
    )


def _node_summary(nodes: Verdicts, what: str) -> Text:
    wrong = {
        "in collision": nodes.in_collision.sum(),
        "out of limits": (~nodes.in_limits).sum(),
        "outside the boundary": (~nodes.inside).sum(),
    }
    return Text(f"{counted(len(nodes.valid), what)}: {_counts(f'{nodes.valid.sum()} valid', wrong)}", "bold")


def _edge_summary(edges: EdgeVerdicts) -> Text:
    wrong = {
        "invalid": (edges.checked & ~edges.stepped).sum(),
        "not proved": 0 if edges.proved is None else (edges.stepped & ~edges.proved).sum(),
        "not checked": (~edges.checked).sum(),
    }
    counts = _counts(f"{edges.valid.sum()} valid{'' if edges.proved is None else ' and proved free'}", wrong)
    return Text(f"{counted(len(edges.valid), 'edge')}, checked every {edges.resolution:.4g} m: {counts}", "bold")


def _counts(valid: str, wrong: dict[str, int]) -> str:
    return ", ".join([valid, *(f"{count} {what}" for what, count in wrong.items() if count)])


def _first_invalid(nodes: Verdicts, edges: EdgeVerdicts) -> Iterator[Text]:
    """Yield which configuration and which edge are the first that are invalid."""
    if not nodes.valid.all():
        yield Text(f"first invalid: {one_line(abridged(nodes.labels[int(np.argmin(nodes.valid))]))}")
    if not edges.valid.all():
        verdict = edges.verdict(int(np.argmin(edges.valid)))
        where = "" if verdict.fraction is None else f", at {verdict.fraction:.4g} of the way"
        yield Text(f"first invalid: {one_line(abridged(verdict.label))}{where}")


def _as_json(nodes: Verdicts, graph: Graph | None, edges: EdgeVerdicts | None) -> dict[str, Any]:
    """Return every configuration, and every edge, in terms of JSON."""
    configurations = [_node_json(nodes.labels[i], nodes.verdict(i)) for i in _bar(len(nodes.valid), "q")]
    if graph is None or edges is None:
        return {"configurations": configurations}
    for node, line in zip(configurations, graph.lines.tolist(), strict=True):
        node["line"] = line
    if graph.ids is not None:
        for node, name in zip(configurations, graph.ids.tolist(), strict=True):
            node["id"] = name
    return {
        "kind": graph.kind,
        "version": graph.version,
        "pose_error": None if graph.poses is None else graph.poses.error,
        "resolution": edges.resolution,
        "certified": edges.proved is not None,
        "configurations": configurations,
        "edges": [_edge_json(edges.verdict(i)) for i in _bar(len(edges.valid), "edge")],
    }


def _node_json(label: str, verdict: Verdict) -> dict[str, Any]:
    return {
        "label": label,
        "q": plain(verdict.q),
        "valid": verdict.valid,
        "in_collision": bool(verdict.contacts),
        "limits": plain(verdict.limits),
        "outside": plain(verdict.outside),
        "contacts": plain(verdict.contacts),
    }


def _edge_json(verdict: EdgeVerdict) -> dict[str, Any]:
    at = None if verdict.at is None else _node_json(verdict.label, verdict.at)
    return {**plain(verdict), "at": at}


def _headed(label: str, wrong: str) -> Text:
    return Text.assemble(f"{one_line(abridged(label))}: ", (wrong, "bold red") if wrong else ("valid", "bold green"))


def _bar(count: int, unit: str) -> tqdm[int]:
    return tqdm(range(count), unit=unit, delay=1, leave=False, disable=not sys.stderr.isatty())
