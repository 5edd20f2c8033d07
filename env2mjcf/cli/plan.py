"""`env2mjcf plan`."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import tyro
from rich.text import Text
from tyro.conf import Positional

from ..diagnostics import DiagnosticLog
from ..options import Options, PathArgument
from ..system.files import refuse_foreign, refuse_unwritable
from .arguments import OptionFlags, Output, OutputFlags
from .program import DONE, FINDING
from .terminal import listed, loaded, one_line, print_diagnostics, print_json, print_parts, reason_lines

if TYPE_CHECKING:
    from ..planning.result import Plan as Result
    from ..simulation.scene import Query, Scene


@dataclass(frozen=True, slots=True)
class Plan:
    """Plan a way from the start to the goal of a query, and write it as a path file.

    The robots of the query move, together if there are several; the others stay at the starts of their own queries, or
    at home. A query of more than two configurations is planned leg by leg. A solution is made shorter, and each of its
    edges is looked at in fine steps and, wherever it keeps 1e-5 of the scene's extent away from everything, proved to
    be free. The path file holds configurations no farther apart than the resolution, corners included, so that it plays
    smoothly; --corners writes just the corners. It has the numbers of all robots where several move, or others stand
    elsewhere than at home.

    Without a solution in time the exit status is 1, and the best approach, from the start to what came nearest to the
    goal, is written beside the output: out.approach.path for out.path. A start or goal that is not valid is a finding,
    too: the report says why, and nothing is written.

    Planners: auto, RRTConnect, RRT, RRTstar, KPIECE, BKPIECE, LBKPIECE, PRM, PRMstar, FMT, BFMT (all of OMPL) and
    BatchEST (ours: trees that grow by small changes, for narrow places). auto lets RRTConnect and BatchEST take turns.
    RRTstar and PRMstar use all of the time.

    Examples:
      env2mjcf plan maze.env --robots maze.robot --query maze.query -o maze.path
      env2mjcf plan alpha.env --query alpha.query --planner KPIECE --time 120 -o alpha.path
      env2mjcf plan problem.xml --json

    Attributes:
        scene: An env file, an XML environment or a problem XML.
        out: The path file to write; without it none is written.
        planner: Which planner; see above.
        time: Seconds after which to give up.
        seed: Seed of the random numbers; equal seeds give equal paths, unless time runs out.
        resolution: Greatest distance in metres that any point of a robot moves between two checks of the planner;
            otherwise the file's PositionRes, else 0.01 of the extent.
        corners: Write just the corners of the path.
        shorten: Make the path shorter.
        task: Which task of the query, counted from 1, where there are several.
    """

    scene: Annotated[str, tyro.conf.arg(metavar="SCENE"), Positional]
    out: Annotated[PathArgument | None, tyro.conf.arg(aliases=["-o"])] = None
    planner: str = "auto"
    time: float = 60.0
    seed: int = 0
    resolution: float | None = None
    corners: bool = False
    shorten: bool = True
    task: int = 1
    output: OutputFlags = field(default_factory=Output)
    options: OptionFlags = field(default_factory=Options)

    def run(self) -> int:
        """Plan, and report; 1 if there is no solution in time, or start or goal are not valid."""
        from ..formats.path import begins_as_path
        from ..planning.planners import checked_planner
        from ..planning.route import plan_through

        # Before anything is loaded and looked at, which may take a minute.
        checked_planner(self.planner)
        if self.out is not None:
            query = () if self.options.query is None else (self.options.query,)
            refuse_unwritable(self.out, "CFG542", (self.scene, *self.options.robots, *query))
            for file in (Path(self.out), _approach(Path(self.out))):
                refuse_foreign(
                    file, "CFG553", "a path file", lambda data: begins_as_path(data.decode("utf-8", "replace"))
                )
        scene, log = loaded(self.scene, self.options)
        query = self._query(scene, log)
        print_diagnostics(log, self.output.verbose)
        if (wrong := _wrong(scene, query)) is not None:
            self._say_wrong(wrong, log)
            return FINDING
        from .meter import planning_meter

        with planning_meter(self.time) as progress:
            result = plan_through(
                scene, query.q, planner=self.planner, robot=query.robots, time=self.time, seed=self.seed,
                resolution=self.resolution, shorten=self.shorten, progress=progress,
            )  # fmt: skip
        written = self._write(scene, query, result)
        if self.output.json:
            print_json({**_summary(scene, result, written), "diagnostics": listed(log, self.output.verbose)})
        else:
            print_parts(_lines(result, written))
        return DONE if result.solved else FINDING

    def _query(self, scene: Scene, log: DiagnosticLog) -> Query:
        """Return the task that is to be planned.

        Raises:
            FormatError: Nothing in the scene moves, there is no task, or it has no goal.
            ValueError: There are fewer tasks than --task asks for.
        """
        from ..companions.configurations import refuse_without_freedom

        refuse_without_freedom(scene, self.scene, log)
        tasks = scene.queries
        if not tasks:
            hint = "give a query file: --query FILE"
            log.fail("CFG540", self.scene, "there is no task: no start, and no goal", hint=hint)
        if not 1 <= self.task <= len(tasks):
            count = "there is 1 task" if len(tasks) == 1 else f"there are {len(tasks)} tasks"
            raise ValueError(f"--task is {self.task}: {count}, counted from 1")
        task = tasks[self.task - 1]
        if len(task.q) < 2:
            hint = "add the goal to the query file"
            log.fail("CFG541", self.scene, "the task holds one configuration; expected a start and a goal", hint=hint)
        return task

    def _write(self, scene: Scene, query: Query, result: Result) -> Path | None:
        from ..companions import write_path
        from ..planning.route import alone

        if self.out is None:
            return None
        out = Path(self.out) if result.solved else _approach(Path(self.out))
        q = result.path if self.corners else result.steps(scene)
        return write_path(scene, q, out, query.robot if alone(scene, query) else None)

    def _say_wrong(self, wrong: list[tuple[str, tuple[str, ...]]], log: DiagnosticLog) -> None:
        if self.output.json:
            print_json({"solved": False, "invalid": dict(wrong), "diagnostics": listed(log, self.output.verbose)})
            return
        parts: list[Text] = []
        for label, reasons in wrong:
            parts.append(Text.assemble(f"{label}: ", ("not valid", "bold red")))
            parts.extend(reason_lines(reasons, self.output.verbose))
        print_parts(parts)


def _approach(out: Path) -> Path:
    """Return where the best approach is written if there is no solution."""
    return out.with_name(f"{out.stem}.approach.path")


def _wrong(scene: Scene, query: Query) -> list[tuple[str, tuple[str, ...]]] | None:
    """Return which configurations of the query are not valid, and why; None if all are."""
    from ..planning.route import names_of

    names = names_of(len(query.q))
    wrong = [int(i) for i in np.flatnonzero(~scene.valid_rows(query.q))]
    return [(names[i], tuple(map(str, scene.explain(query.q[i]).reasons))) for i in wrong] or None


def _lines(result: Result, written: Path | None) -> Iterator[Text]:
    solved = ("solved", "bold green") if result.solved else ("not solved", "bold red")
    yield Text.assemble(solved, f" by {result.planner} in {result.seconds:.2f} s")
    yield Text(f"checks: {result.checks:,} configurations, {result.checks_per_second:,.0f} a second")
    what = "path" if result.solved else "best approach"
    yield Text(f"{what}: {len(result.path)} configurations, length {result.length:.6g} m")
    if not result.solved:
        yield Text(f"left to the goal: {result.left:.6g} m")
    yield Text(f"certified edges: {int(result.certified.sum())} of {len(result.certified)}")
    if not result.certified.all():
        bad = ", ".join(str(i + 1) for i in np.flatnonzero(~result.certified)[:10])
        verdict = "valid" if result.dense.all() else "not all valid"
        yield Text(
            f"    not certified, because bodies come nearer than 1e-5 of the extent or touch: edge {bad}; at steps of "
            f"{result.fine_step:.3g} m all edges are {verdict}"
        )
    if written is not None:
        yield Text(f"written: {one_line(str(written))}")


def _summary(scene: Scene, result: Result, written: Path | None) -> dict[str, object]:
    values = {f.name: getattr(result, f.name) for f in dataclasses.fields(result)}
    return {**values, "checks_per_second": result.checks_per_second, "dofs": scene.space.names, "file": written}
