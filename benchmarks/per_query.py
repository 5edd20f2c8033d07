"""Time a query of a batch takes on one thread: both engines, MuJoCo's C loop, and the peers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from c_loop import CLoop, layouts
from judged import Disagreements
from pages import Check, mark, micro, table
from peers import Coal, Fcl
from pinocchio_peer import Pinocchio
from rounds import Race, Way, quickest_kind, race
from subjects import Subject, has_exact

import env2mjcf

SURFACE, AUTO, MUJOCO, WRITTEN, BEST = "surface", "auto", "mujoco engine", "C as written", "C best"
PEERS = ("fcl pairs", "fcl manager", "coal pairs", "coal manager")
PINOCCHIO = ("pin rows", "pin batch")
SOLID_MARK = 1.3
# Disagreements of which it is found out how far off they are: of our own ways all but for very many.
_LOOKED_AT, _LOOKED_AT_OF_OURS = 40, 2000

LEGEND = """
CPU time of one thread, microseconds a query, both halves together; medians over {rounds} rounds in which all ways take
turns in one process. A ratio is the median of the rounds' ratios, with the least and the greatest in brackets.

- hits: share of the configurations that touch, by the triangles / by triangles and containment.
- surface, auto: `in_collision(q, threads=1)` of `collision="surface"` and of `collision="auto"` with engine `{engine}`;
  mujoco engine: `collision="auto", engine="mujoco"`. Kinematics is in all of these.
- C as written: mj_kinematics and mj_collision on the scene's own `auto` model, called by address from a loop that numba
  compiles; it looks for all contacts, does not look for containment and is not called from Python. C best: the same on
  the quickest of other models of the same geometry: libccd (one contact a pair, not by MuJoCo's native algorithm); bare
  (one contact a pair, nothing that is only drawn), and with libccd; static bodies (bare, each obstacle a body instead
  of geoms of the world), and with libccd.
- fcl, coal: python-fcl and coal from a Python loop, triangles alone, poses and transforms made beforehand and not
  counted; done at the first contact. Pair by pair, or with a broadphase manager of the obstacles (coal's: the quickest
  of six kinds); links among each other pair by pair. pin: pinocchio with coal on the same triangles, kinematics
  included, stopping at the first collision: one row after the other from Python, or a batch on one thread
  (computeCollisionsInParallel); of each the quickest of no broadphase, broadphase and tree broadphase. coal and
  pinocchio use BVHModelOBBRSS and requests without contacts. A cell with (!) is of one short trial: too slow to race.
"""
RATIO_LEGEND = """
- surface / peers: to the quicker of coal and python-fcl, whichever that is on both halves together, on the uniform and
  on the near half; the mark is for both together. solid: auto / surface, mark {solid:g}. auto / C: to MuJoCo's C loop,
  as written and best, and the mark that both are held to. surface / pin: to pinocchio's quickest way.
"""
WRONG_LEGEND = """
Verdicts unlike the triangles' (python-fcl; with containment by crossings of a ray where a way knows solids), and in
brackets how many of these are off by more than {band:g} of the extent. Up to {rows} configurations of each half, and no
more than the way's turn had. C as written and C best are compared where triangles and solids agree: their shells are
not filled.
"""


@dataclass(frozen=True, slots=True)
class Result:
    """What one scene came to."""

    name: str
    engine: str
    subject: Subject
    race: Race
    kinds: Mapping[str, str]
    hits: tuple[float, float]
    wrong: Mapping[str, Disagreements]


def measure(subject: Subject, rounds: int) -> Result:
    """Let all ways answer a scene's configurations."""
    rows, halves = subject.rows, subject.halves
    exact = has_exact(subject.auto)
    engine = "exact" if exact else "mujoco"
    ways: dict[str, Way] = {SURFACE: ask(subject.surface, rows, engine), AUTO: ask(subject.auto, rows, engine)}
    if exact:
        ways[MUJOCO] = ask(subject.auto, rows, "mujoco")
    peers, kinds = _peers(subject)
    loops, best = _loops(subject)
    ways |= loops | peers
    kinds[BEST] = best
    found = race(ways, halves, rounds, needed=(SURFACE, AUTO, WRITTEN))
    answering = ways | {name: loop.verdicts for name, loop in loops.items()}
    wrong = {name: _disagreements(subject, found, name, answering[name]) for name in found.turns["uniform"]}
    means = [float(np.mean([subject.judged.share(half, mode) for half in halves])) for mode in ("surface", "solid")]
    return Result(subject.name, engine, subject, found, kinds, (means[0], means[1]), wrong)


def ask(scene: env2mjcf.Scene, rows: np.ndarray, engine: str) -> Way:
    """Return a way that asks a scene."""
    return lambda part: scene.in_collision(rows[part], threads=1, engine=engine)


def _peers(subject: Subject) -> tuple[dict[str, Way], dict[str, str]]:
    """Return the ways of the peers, the quickest kind of each where there are several; and which kinds these are."""
    ways: dict[str, Way] = dict(Fcl(subject.judged.truth, subject.rows).ways())
    coal = Coal(subject.auto, subject.rows).ways()
    pin = Pinocchio(subject.auto, subject.rows).ways()
    ways["coal pairs"] = coal.pop("coal pairs")
    groups = {
        "coal manager": coal,
        "pin rows": {name: way for name, way in pin.items() if "batch" not in name},
        "pin batch": {name: way for name, way in pin.items() if "batch" in name},
    }
    kinds = {}
    for group, members in groups.items():
        if members:
            kinds[group] = quickest_kind(members, subject.halves)
            ways[group] = members[kinds[group]]
    return ways, kinds


def _loops(subject: Subject) -> tuple[dict[str, CLoop], str]:
    """Return the C loop on the model that is written, and on the quickest other one; and which one that is."""
    qpos = subject.auto.space.qpos(subject.rows)
    others = {name: CLoop(model, qpos) for name, model in layouts(subject.auto).items()}
    best = quickest_kind(others, subject.halves)
    return {WRITTEN: CLoop(subject.auto.model, qpos), BEST: others[best]}, best


def _disagreements(subject: Subject, found: Race, name: str, way: Way) -> Disagreements:
    judged = subject.judged
    verdicts = {
        half: np.asarray(way(judged.part(half, turns[name].rows)), dtype=bool) for half, turns in found.turns.items()
    }
    mode = {AUTO: "solid", MUJOCO: "solid", WRITTEN: "either", BEST: "either"}.get(name, "surface")
    most = _LOOKED_AT_OF_OURS if name in (SURFACE, AUTO, MUJOCO) else _LOOKED_AT
    return judged.compare(verdicts, mode, most)


def text(results: Sequence[Result], rounds: int, rows: int, band: float) -> tuple[list[str], list[Check]]:
    """Return the section of the page, and what is met."""
    engine = results[0].engine
    legend = [*LEGEND.format(rounds=rounds, engine=engine).strip().splitlines(), ""]
    ratio_legend = [*RATIO_LEGEND.format(solid=SOLID_MARK).strip().splitlines(), ""]
    wrong_legend = [*WRONG_LEGEND.format(band=band, rows=rows).strip().splitlines(), ""]
    ways = (SURFACE, AUTO, MUJOCO, WRITTEN, BEST, *PEERS, *PINOCCHIO)
    parts = ["## A query of a batch, one thread", "", *legend]
    parts += table(("scene", "hits", *(f"{w}, µs" for w in ways)), [_times(r, ways, None) for r in results])
    parts += ["", "### Ratios", "", *ratio_legend]
    header = (
        "scene", "surface / peers", "mark", "uniform", "near", "solid", "mark", "auto / C as written",
        "auto / C best", "mark", "surface / pin",
    )  # fmt: skip
    parts += table(header, [_ratios(r) for r in results])
    for half in ("uniform", "near"):
        parts += ["", f"### The {half} half alone, µs", ""]
        chosen = [r for r in results if half in r.race.times]
        parts += table(("scene", "hits", *ways), [_times(r, ways, half) for r in chosen])
    parts += ["", "### Disagreements", "", *wrong_legend]
    header = ("scene", "configurations", *ways)
    parts += table(header, [_wrong(r, ways) for r in results])
    return [*parts, ""], [check for r in results for check in _checks(r)]


def _checks(result: Result) -> Iterable[Check]:
    found, marks, name = result.race, result.subject.mark, result.name
    if marks.peers:
        ratio = found.ratio(SURFACE, found.quickest(PEERS)).median
        yield Check("surface / quicker of coal and python-fcl", name, ratio, marks.peers)
    yield Check("auto / surface", name, found.ratio(AUTO, SURFACE).median, SOLID_MARK)
    yield Check("auto / MuJoCo's C loop as written", name, found.ratio(AUTO, WRITTEN).median, marks.c_loop)
    yield Check("auto / MuJoCo's C loop, best layout", name, found.ratio(AUTO, BEST).median, marks.c_loop)
    for way in (SURFACE, AUTO, MUJOCO):
        if way in result.wrong:
            yield Check(f"wrong verdicts outside the band, {way}", name, result.wrong[way].outside, 0)


def _times(result: Result, ways: Iterable[str], half: str | None) -> tuple[str, ...]:
    found, cells = result.race, []
    for way in ways:
        if way in found.left_out:
            cells.append(f"{micro(found.left_out[way])} (!)")
        elif way in found.turns["uniform"]:
            cells.append(micro(found.median(way, half)) + _kind(result, way, half))
        else:
            cells.append("")
    judged = result.subject.judged
    hits = result.hits if half is None else (judged.share(half, "surface"), judged.share(half, "solid"))
    return (result.name, f"{100 * hits[0]:.1f} / {100 * hits[1]:.1f} %", *cells)


def _kind(result: Result, way: str, half: str | None) -> str:
    """Return which kind of a way was the quickest, in the first table alone."""
    if half is not None or way not in result.kinds:
        return ""
    kind = result.kinds[way].removeprefix("coal ").removesuffix("CollisionManager").removeprefix("pin ")
    return f" {kind}"


def _ratios(result: Result) -> tuple[str, ...]:
    found, marks = result.race, result.subject.mark
    best = found.quickest(PEERS)
    peers = found.ratio(SURFACE, best)
    halves = []
    for half in ("uniform", "near"):
        present = half in found.times
        halves.append(f"{found.ratio(SURFACE, found.quickest(PEERS, half), half).median:.3g}" if present else "")
    solid = found.ratio(AUTO, SURFACE)
    written, quick = found.ratio(AUTO, WRITTEN), found.ratio(AUTO, BEST)
    pin = found.quickest(PINOCCHIO)
    return (
        result.name,
        f"{peers} {best}",
        mark(peers.median, marks.peers) if marks.peers else "",
        *halves,
        str(solid),
        mark(solid.median, SOLID_MARK),
        str(written),
        str(quick),
        mark(max(written.median, quick.median), marks.c_loop),
        str(found.ratio(SURFACE, pin)) if pin else "",
    )


def _wrong(result: Result, ways: Iterable[str]) -> tuple[str, ...]:
    cells = [str(result.wrong[w]) if w in result.wrong else "" for w in ways]
    return (result.name, str(result.wrong[AUTO].asked), *cells)


def log(result: Result) -> str:
    """Return a line on a scene, for whoever waits."""
    times = {way: float(f"{1e6 * result.race.median(way):.3g}") for way in result.race.turns["uniform"]}
    off = {way: str(d) for way, d in result.wrong.items() if d.differ}
    return f"{result.name}: {times} µs; disagreements {off}; {dict(result.kinds)}"
