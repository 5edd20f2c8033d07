"""How the time a query takes grows with the number of obstacles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from c_loop import CLoop
from generated import tile_offsets
from pages import Check, mark, micro, table
from peers import Fcl
from per_query import AUTO, SURFACE, WRITTEN, ask
from rounds import Race, Way, race
from subjects import Subject, has_exact

FCL = "fcl manager"
# Scenes of a group, the factor between the first and the last, and what that may cost.
GROUPS = {
    "cube among boxes": (("boxes50", "boxes500", "boxes5000"), "100 times as many boxes", 5.0),
    "maze, copies of the walls": (("Maze.maze", "maze4", "maze16"), "16 times as many walls", 1.5),
}
LEGEND = """
All scenes and ways of a group take turns in one race, {rounds} rounds; CPU microseconds a query, both halves together;
ratios are medians of the rounds' ratios to the first scene of the group. Boxes lie as dense in more space, so that the
share in collision stays. The maze is asked about the same configurations, each moved to a copy of the walls at random.
"""


@dataclass(frozen=True, slots=True)
class Result:
    """The race of one group; ways are called by scene and way."""

    name: str
    race: Race


def measure(name: str, subjects: Mapping[str, Subject], rounds: int) -> Result:
    """Let all scenes of a group take turns."""
    scenes, _, _ = GROUPS[name]
    ways: dict[str, Way] = {}
    halves = subjects[scenes[0]].halves
    for scene in scenes:
        subject = subjects[scene]
        rows = _moved(subjects[scenes[0]].rows, scene) if "maze" in scene else subject.rows
        engine = "exact" if has_exact(subject.auto) else "mujoco"
        ways[f"{scene} {SURFACE}"] = ask(subject.surface, rows, engine)
        ways[f"{scene} {AUTO}"] = ask(subject.auto, rows, engine)
        ways[f"{scene} {WRITTEN}"] = CLoop(subject.auto.model, subject.auto.space.qpos(rows))
        ways[f"{scene} {FCL}"] = Fcl(subject.judged.truth, rows).managed
        assert subject.halves == halves, "scenes of a group have configurations of one number"
    needed = [way for way in ways if not way.endswith(FCL)]
    return Result(name, race(ways, halves, rounds, needed=needed))


def _moved(rows: np.ndarray, scene: str) -> np.ndarray:
    """Move configurations of the maze to its copies, at random."""
    copies = int(scene.removeprefix("maze") if scene.startswith("maze") else 1)
    offsets = tile_offsets(copies)
    moved = rows.copy()
    moved[:, :2] += offsets[np.random.default_rng(3).integers(copies, size=len(rows))]
    return moved


def text(results: Sequence[Result], rounds: int) -> tuple[list[str], list[Check]]:
    """Return the section of the page, and what is met."""
    lines, checks = ["## Scaling", "", *LEGEND.format(rounds=rounds).strip().splitlines(), ""], []
    header = ("group", "way", "first, µs", "second, µs", "third, µs", "second / first", "third / first", "mark")
    rows = []
    for result in results:
        scenes, factor, most = GROUPS[result.name]
        for way in (SURFACE, AUTO, WRITTEN, FCL):
            names = [f"{scene} {way}" for scene in scenes]
            if any(n in result.race.left_out for n in names):
                continue
            ratios = [result.race.ratio(n, names[0]) for n in names[1:]]
            judged = way in (SURFACE, AUTO)
            if judged:
                checks.append(Check(f"{factor}, {way}", result.name, ratios[-1].median, most))
            times = (micro(result.race.median(n)) for n in names)
            verdict = mark(ratios[-1].median, most) if judged else ""
            rows.append((result.name, way, *times, *map(str, ratios), verdict))
    return [*lines, *table(header, rows), ""], checks
