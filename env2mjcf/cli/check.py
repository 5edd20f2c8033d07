"""`env2mjcf check`."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, TypeVar

import numpy as np
import tyro
from rich.text import Text
from tyro.conf import Positional

from ..diagnostics import DiagnosticLog
from ..errors import ConversionError
from ..options import Options
from ..system.files import refuse_unwritable
from .arguments import OptionFlags, Output, OutputFlags
from .judgements import (
    Listed,
    as_json,
    edge_lines,
    edge_summary,
    first_invalid,
    node_summary,
    pose_summary,
    verdict_lines,
)
from .program import BAD_INPUT, DONE, FINDING
from .terminal import loaded, print_diagnostics, print_json, print_parts, working

if TYPE_CHECKING:
    from ..companions.records import Configurations, Graph
    from ..simulation.edge_verdicts import EdgeJudge
    from ..simulation.scene import Scene
    from ..simulation.verdicts import Judge

V = TypeVar("V")

# More configurations than this are not listed one by one unless asked for.
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
        from ..simulation.verdicts import Judge
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
        poses = rows.graph.poses if rows.graph else None
        judge = Judge(
            scene, scene.space.check(rows.q), rows.labels, poses.links if poses else None, poses.fits if poses else None
        )
        edges = self._edges(scene, rows.graph)
        valid = bool(judge.valid.all()) and (edges is None or bool(edges.valid.all()))
        if self.output.json:
            print_json(
                {
                    "valid": valid,
                    "dofs": scene.space.names,
                    **as_json(judge, rows.graph, edges),
                    "diagnostics": tuple(log),
                }
            )
        else:
            print_parts(self._lines(judge, rows.graph, edges))
        if self.picture is not None:
            # Whoever cannot have the picture has the report.
            sys.stdout.flush()
            try:
                with working("drawing"):
                    draw(scene, rows, judge, edges, self.picture)
            except ConversionError as error:
                print_diagnostics(error.diagnostics, self.output.verbose)
                return BAD_INPUT
        return DONE if valid else FINDING

    def _edges(self, scene: Scene, graph: Graph | None) -> EdgeJudge | None:
        from ..simulation.edge_verdicts import EdgeJudge

        if graph is None:
            if self.certified or self.resolution is not None:
                raise ValueError("--resolution and --certified are for the edges of a path or roadmap; there is none")
            return None
        checked = None
        if graph.poses is not None:
            checked = graph.poses.fits[graph.edges.ends[:, 0]] & graph.poses.fits[graph.edges.ends[:, 1]]
        return EdgeJudge(scene, graph.edges, self.resolution, self.certified, checked)

    def _rows(self, scene: Scene, log: DiagnosticLog) -> Configurations:
        from ..companions.configurations import of_file, of_numbers, of_scene

        words = self.configurations if self.options.query is None else (str(self.options.query),)
        if not words:
            return of_scene(scene)
        if len(words) == 1 and not _is_number(words[0]):
            return of_file(scene, words[0], self.radians, self.options.limits, log)
        return of_numbers(scene, words, self.radians)

    def _lines(self, judge: Judge, graph: Graph | None, edges: EdgeJudge | None) -> Iterator[Text]:
        rough: list[bool] = []
        yield from self._listed("configuration", judge, verdict_lines, rough)
        if edges is not None:
            yield from self._listed("edge", edges, edge_lines, rough)
        if any(rough):
            yield Text("depths at bodies that are not convex are rough: such meshes collide as thin plates", "dim")
        if graph is not None and graph.poses is not None:
            yield pose_summary(graph.poses)
        yield node_summary(judge, "node" if graph and graph.kind == "roadmap" else "configuration")
        if edges is not None:
            yield edge_summary(edges)
        yield from first_invalid(judge, edges)

    def _listed(
        self, what: str, judge: Listed[V], lines: Callable[[V], Iterator[Text]], rough: list[bool]
    ) -> Iterator[Text]:
        every = self.all or len(judge.valid) <= _LISTED
        chosen = range(len(judge.valid)) if every else np.flatnonzero(~judge.valid).tolist()
        for i in chosen if self.all else chosen[:_LISTED]:
            verdict = judge.verdict(i)
            rough.append(judge.rough(verdict))
            yield from lines(verdict)
        left = len(chosen) - _LISTED
        if left > 0 and not self.all:
            yield Text(f"... and {left} more that are invalid (--all lists every {what})", "dim")


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
