"""`env2mjcf info`."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

import tyro
from tyro.conf import Positional

from ..diagnostics import DiagnosticLog
from ..errors import Env2MjcfError
from ..options import Options
from .arguments import OptionFlags, Output, OutputFlags
from .program import BAD_INPUT, DONE
from .terminal import listed, plain, print_diagnostics, print_json, print_parts, working

if TYPE_CHECKING:
    from rich.console import RenderableType

    from ..simulation.scene import Scene
    from ..simulation.verdicts import PairCount
    from ..summary import SceneSummary


@dataclass(frozen=True, slots=True)
class Info:
    """Say what a scene holds and how it is read: dialect, robots, degrees of freedom, obstacles, meshes.

    Examples:
      env2mjcf info serial.env
      env2mjcf info box.env --robots box.robot --query box.query
      env2mjcf info problem.xml --pairs
      env2mjcf info serial.env --json | jq '.robots[0].dofs[].name'

    Attributes:
        scene: An env file, an XML environment or a problem XML.
        pairs: List every pair of bodies that is tested, and how often it touches in sampled configurations.
        samples: Number of configurations that --pairs samples.
    """

    scene: Annotated[str, tyro.conf.arg(metavar="SCENE"), Positional]
    pairs: bool = False
    samples: int = 1000
    output: OutputFlags = field(default_factory=Output)
    options: OptionFlags = field(default_factory=Options)

    def run(self) -> int:
        """Print what the text says, then what meshes and MuJoCo add to it."""
        if self.samples < 1:
            raise ValueError(f"--samples is {self.samples}; expected at least 1")
        from ..formats.reading import read_scene
        from ..simulation.loading import prepare
        from ..summary import describe

        log = DiagnosticLog(self.options.strict)
        environment = read_scene(self.scene, self.options, log)
        summary = describe(environment, self.options)
        scene, error = None, None
        try:
            with working(f"loading {self.scene}"):
                loaded = scene = prepare(environment, self.options, log)
        except Env2MjcfError as wrong:
            loaded = error = wrong
        if self.output.json:
            facts: dict[str, Any] = self._facts(summary, scene)
            if error:
                facts["error"] = plain(error.diagnostic)
            print_json({**facts, "diagnostics": listed(loaded.diagnostics, self.output.verbose)})
        else:
            print_parts(self._parts(summary, scene))
        # Notes are part of what was asked for.
        print_diagnostics(loaded.diagnostics, self.output.verbose, notes=not self.output.json)
        return BAD_INPUT if error else DONE

    def _facts(self, summary: SceneSummary, scene: Scene | None) -> dict[str, Any]:
        facts: dict[str, Any] = plain(summary)
        if scene is not None:
            report = dataclasses.asdict(scene.report)
            facts |= {k: report[k] for k in ("collision", "geoms", "mass", "extent", "meshes", "wall_speed")}
            facts["pairs"] = scene.pairs if self.pairs else len(scene.pairs)
            if self.pairs:
                counts = self._counts(scene)
                facts["touching"] = {
                    "samples": self.samples,
                    "pairs": [{**plain(c), "verdict": c.verdict} for c in counts],
                }
        return facts

    def _parts(self, summary: SceneSummary, scene: Scene | None) -> Iterator[RenderableType]:
        from .columns import geometry_part, pairs_part, text_part

        every = self.output.verbose
        yield from text_part(summary, every)
        if scene is not None:
            yield from geometry_part(scene.report, every)
            if self.pairs:
                yield from pairs_part(self._counts(scene), self.samples)

    def _counts(self, scene: Scene) -> tuple[PairCount, ...]:
        from ..simulation.verdicts import count_touching

        with working(f"looking at {self.samples} configurations"):
            return count_touching(scene, self.samples)
