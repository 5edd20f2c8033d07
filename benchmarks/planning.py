"""Plan the motion planning benchmarks: `python benchmarks/planning.py [--scenes NAME ...] [--time SECONDS]`.

Writes `benchmarks/planning.md`: for each scene of the folder that ENV2MJCF_CORPUS names which has a query, what `plan`
came to, beside the figures that are published with the scenes. Every solution is looked at by python-fcl.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from machine import ForeignLoad, machine
from triangles import Truth

import env2mjcf
from env2mjcf.planning import Plan, plan_through

OUTPUT = Path(__file__).with_name("planning.md")
# Triangles are looked at where no point of the robot has moved farther than this part of the extent.
STEP = 1e-3
# The Motion Planning Benchmarks' page: samples, calls of collision detection, seconds.
PUBLISHED = {
    "Box.box": (24_993, 9_224_856, 967.0),
    "Heterogeneous.heterogeneous2D": (7_924, 3_661_820, 238.0),
    "LTunnel.tunnel": (1_041, 82_064, 3.37),
    "Maze.maze": (16_913, 14_633_653, 142.0),
    "SerialWalls.serial": (10_797, 12_970_998, 292.0),
    "SimpleObstacle.Obstacle1.obstacle": (42, 248_564, 1.5),
    "SimpleObstacle.Obstacle2.obstacle": (42, 172_098, 1.08),
    "SimpleObstacle.Obstacle3.obstacle": (42, 121_903, 0.75),
    "ZTunnel.tunnel": (6_875, 1_286_308, 30.1),
    "alpha1.6.alpha": (35_404, 264_501_104, 2_550.0),
}
# Others that come with a query.
OTHERS = (
    "bug_trap1.0.bug-trap",
    "exps-FloorPlan.apartment",
    "old-testBranchs.branchs",
    "old-testSerialInWall.serial",
    "pmpl-3D.3d",
    "pmpl-ReachableVolumes.Walls22d.walls5",
    "skel-2D.doors",
    "ppl-3D.3d+linked",
)
HEADER = (
    "scene", "DOF", "solved", "planner", "s", "checks", "checks a second", "length", "certified", "by triangles",
    "published: samples", "CD calls", "s",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Row:
    """What one scene came to."""

    name: str
    dof: int
    plan: Plan | None
    note: str
    looked_at: int
    touching: int

    @property
    def solved(self) -> bool:
        """Whether there is a solution, and triangles agree."""
        return self.plan is not None and self.plan.solved and not self.touching


def load(corpus: Path, name: str) -> env2mjcf.Scene:
    """Load a scene of the corpus with its query."""
    with (corpus / "scenes.tsv").open(newline="", encoding="utf-8") as file:
        row = next(r for r in csv.DictReader(file, delimiter="\t") if r["name"] == name)
    folder = corpus / "scenes" / name
    robots = () if row["robot"] == "-" else (folder / row["robot"],)
    return env2mjcf.load(folder / row["env"], robots=robots, query=folder / row["query"])


def run(corpus: Path, name: str, planner: str, seconds: float, seed: int) -> Row:
    """Plan the first task of a scene."""
    scene = load(corpus, name)
    query = scene.queries[0]
    try:
        plan = plan_through(scene, query.q, planner=planner, robot=query.robot, time=seconds, seed=seed)
    except ValueError as error:
        return Row(name, scene.space.dim, None, str(error), 0, 0)
    looked_at = touching = 0
    if plan.solved:
        rows = interpolated(scene, plan.path, STEP * scene.extent)
        looked_at, touching = len(rows), int(Truth(scene).verdicts(rows)[1].sum())
    return Row(name, scene.space.dim, plan, "", looked_at, touching)


def interpolated(scene: env2mjcf.Scene, path: np.ndarray, step: float) -> np.ndarray:
    """Return configurations along a path, no point of a robot moving farther than a step from one to the next."""
    return np.concatenate([scene.edge_rows(a, b, step) for a, b in pairwise(path)])


def cells(row: Row) -> tuple[str, ...]:
    """Return the cells of a row of the table."""
    name, published = row.name.replace("_", "\\_"), PUBLISHED.get(row.name)
    figures = tuple(f"{x:,g}" if isinstance(x, float) else f"{x:,}" for x in published or ()) or ("", "", "")
    if row.plan is None:
        return (name, str(row.dof), "refused", *[""] * 7, *figures)
    plan = row.plan
    verified = f"{row.touching} of {row.looked_at:,} touch" if row.looked_at else ""
    return (
        name, str(row.dof), "yes" if row.solved else "no", plan.planner, f"{plan.seconds:.2f}", f"{plan.checks:,}",
        f"{plan.checks_per_second:,.0f}", f"{plan.length:.4g}" if plan.solved else f"{plan.left:.4g} left",
        f"{int(plan.certified.sum())} of {len(plan.certified)}" if plan.solved else "", verified, *figures,
    )  # fmt: skip


def text(rows: Sequence[Row], command: str, seconds: float, load_share: float) -> str:
    """Return the page."""
    named = [r for r in rows if r.name in PUBLISHED]
    total = sum(r.looked_at for r in rows)
    notes = [f"- {r.name}: {r.note}" for r in rows if r.note]
    return "\n".join(
        [
            "# The motion planning benchmarks",
            "",
            f"Made by `{command}`, with `ENV2MJCF_CORPUS` naming the folder of real scenes: the first task of each, "
            f"{seconds:g} s at the most. {machine()} Other processes took {load_share:.0%} of the machine meanwhile.",
            "",
            "s: from the query to the proved and shortened path, without loading. checks: configurations that were "
            "looked at, of the planner, of shortening and of the final look in fine steps; proofs are not counted. "
            "length: metres of a base, and for every other degree of freedom how far a point of the robot moves, at "
            "most; for what is not solved, what is left to the goal. certified: edges that are proved to be free. by "
            "triangles: configurations along the path, no point of the robot moving farther than "
            f"{STEP:g} of the extent from one to the next, and how many of them touch by python-fcl's triangles and "
            "containment.",
            "",
            "Published: what the authors of the scenes give for their own planner (RRT for ZTunnel) on other hardware. "
            "Compare counts first, and times only in their order of magnitude. A check of ours is a whole "
            "configuration; what a call of theirs is may differ.",
            "",
            f"**{sum(r.solved for r in rows)} of {len(rows)} scenes solved, {sum(r.solved for r in named)} of the "
            f"{len(named)} with published figures; {sum(r.touching for r in rows)} of {total:,} configurations on "
            "solutions touch.**",
            "",
            f"| {' | '.join(HEADER)} |",
            f"| --- | ---: | --- | --- | {' | '.join(['---:'] * (len(HEADER) - 4))} |",
            *(f"| {' | '.join(cells(r))} |" for r in rows),
            *([""] if notes else []),
            *notes,
            "",
        ]
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Plan, and write the page; the exit status is 1 if triangles touch on a solution."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="*", help="only these; write nothing")
    parser.add_argument("--planner", default="auto")
    parser.add_argument("--time", type=float, default=120.0, help="seconds for each scene")
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args(arguments)
    folder = os.environ.get("ENV2MJCF_CORPUS")
    if not folder:
        parser.error("ENV2MJCF_CORPUS must name the folder of real scenes")
    foreign, rows = ForeignLoad(), list[Row]()
    for name in chosen.scenes or (*PUBLISHED, *OTHERS):
        began = time.perf_counter()
        rows.append(run(Path(folder), name, chosen.planner, chosen.time, chosen.seed))
        print(" | ".join(cells(rows[-1])), f"({time.perf_counter() - began:.0f} s in all)", rows[-1].note, flush=True)
    given = {k: v for k, v in vars(chosen).items() if k != "scenes" and v != parser.get_default(k)}
    command = " ".join(["python benchmarks/planning.py", *(f"--{k} {v}" for k, v in given.items())])
    if not chosen.scenes:
        OUTPUT.write_text(text(rows, command, chosen.time, foreign.share()), encoding="utf-8")
    return int(any(r.touching for r in rows))


if __name__ == "__main__":
    sys.exit(main())
