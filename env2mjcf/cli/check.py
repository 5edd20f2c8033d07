"""`env2mjcf check`."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

import numpy as np
import tyro
from rich.text import Text
from tqdm import tqdm
from tyro.conf import Positional

from ..errors import DiagnosticLog
from ..options import Options
from .arguments import OptionFlags, Output, OutputFlags, keywords
from .printing import one_line, print_diagnostics, print_json, print_parts, working

if TYPE_CHECKING:
    from ..simulation.scene import Scene
    from ..simulation.verdicts import Judge, Verdict
    from .rows import Configurations

# More configurations than this are not listed one by one unless asked for.
_LISTED = 20


@dataclass(frozen=True, slots=True)
class Check:
    """Tell whether configurations are valid, and who touches whom, where and how deep.

    A configuration is numbers in the file's own units (turns in dialect A, fractions of pi in B to E; lengths as in
    the file), as many as there are degrees of freedom of all robots, or of one robot behind its index. A .query file,
    or a .csv or .npy file with such rows, holds many. Without any: the scene's own tasks, else home.

    Examples:
      env2mjcf check serial.env -0.5 0 0 0.125 0.25 0
      env2mjcf check serial.env --query serial.query
      env2mjcf check box.env samples.npy --robots box.robot --radians
      env2mjcf check problem.xml --json

    Attributes:
        scene: An env file, an XML environment or a problem XML.
        configurations: Numbers of one configuration, or a file of many.
        radians: Numbers are radians and metres.
        all: List every configuration, also when there are many.
        output: How to report.
        options: What may be chosen.
    """

    scene: Annotated[str, tyro.conf.arg(metavar="SCENE"), Positional]
    configurations: Annotated[tuple[str, ...], tyro.conf.arg(metavar="[NUMBERS | FILE]"), Positional] = ()
    radians: bool = False
    all: bool = False
    output: OutputFlags = field(default_factory=Output)
    options: OptionFlags = field(default_factory=Options)

    def run(self) -> int:
        """Print a verdict on each configuration; 1 if any is invalid."""
        from ..simulation.preparing import load
        from ..simulation.verdicts import Judge

        if self.configurations and self.options.query is not None:
            raise ValueError("configurations are given twice: behind the scene and with --query")
        options = dataclasses.replace(self.options, query=None)
        with working(f"loading {self.scene}"):
            scene = load(self.scene, **keywords(options))
        log = DiagnosticLog(self.options.strict)
        log.extend(scene.diagnostics)
        rows = self._rows(scene, log)
        print_diagnostics(log, self.output.verbose)
        judge = Judge(scene, scene.space.check(rows.q), rows.labels)
        if self.output.json:
            rows_bar = tqdm(range(len(rows.q)), unit="q", delay=1, leave=False, disable=not sys.stderr.isatty())
            verdicts = [judge.verdict(i) for i in rows_bar]
            print_json({"valid": bool(judge.valid.all()), "dofs": scene.space.names, "configurations": verdicts})
        else:
            print_parts(self._lines(judge))
        return 0 if judge.valid.all() else 1

    def _rows(self, scene: Scene, log: DiagnosticLog) -> Configurations:
        from .configurations import of_file, of_numbers, of_scene

        words = self.configurations if self.options.query is None else (str(self.options.query),)
        if not words:
            return of_scene(scene)
        if len(words) == 1 and not _is_number(words[0]):
            return of_file(scene, words[0], self.radians, self.options.limits, log)
        return of_numbers(scene, words, self.radians)

    def _lines(self, judge: Judge) -> Iterator[Text]:
        rough = False
        every = self.all or len(judge.valid) <= _LISTED
        chosen = range(len(judge.valid)) if every else np.flatnonzero(~judge.valid).tolist()
        for i in chosen if self.all else chosen[:_LISTED]:
            verdict = judge.verdict(i)
            rough |= judge.rough(verdict)
            yield from _verdict_lines(verdict)
        left = len(chosen) - _LISTED
        if left > 0 and not self.all:
            yield Text(f"... and {left} more that are invalid (--all lists every configuration)", "dim")
        if rough:
            yield Text("depths at bodies that are not convex are rough: such meshes collide as thin plates", "dim")
        yield _summary(judge)


def _verdict_lines(verdict: Verdict) -> Iterator[Text]:
    wrong = [
        what
        for what, so in (
            ("in collision", verdict.in_collision),
            ("out of limits", verdict.limits),
            ("outside the boundary", verdict.outside),
        )
        if so
    ]
    yield Text.assemble(
        f"{one_line(verdict.label)}: ", (", ".join(wrong), "bold red") if wrong else ("valid", "bold green")
    )
    for reason in verdict.reasons():
        yield Text(f"    {one_line(reason)}")


def _summary(judge: Judge) -> Text:
    total, valid = len(judge.valid), int(judge.valid.sum())
    counts = [f"{valid} valid"]
    for what, so in (
        ("in collision", judge.in_collision),
        ("out of limits", ~judge.in_limits),
        ("outside the boundary", ~judge.inside),
    ):
        if so.any():
            counts.append(f"{int(so.sum())} {what}")
    return Text(f"{total} configuration{'' if total == 1 else 's'}: {', '.join(counts)}", "bold")


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
