"""What a clearance costs beside coal's distance, and whether the two are the same."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pages import Check, mark, micro, table
from peers import Coal
from rounds import Race, Way, quickest_kind, race
from subjects import Subject

CLEARANCE, PAIRS, MANAGER = "clearance", "coal pairs", "coal manager"
MARK, TOLERANCE = 1.0, 1e-6
# Distances take long: a turn may have fewer rows than one of verdicts.
_LEAST = 40
# Values that python-fcl is asked about where coal and clearance differ.
_LOOKED_AT = 20
LEGEND = """
Free configurations only (by the `auto` scene), {rows} of each half at most: in collision, clearance is a depth, which
coal does not give. CPU microseconds a query on one thread, {rounds} rounds. coal: least distance of all tested pairs on
BVHModelOBBRSS, transforms made beforehand and not counted, pair by pair or with the quickest of its managers.
Values: greatest difference in extents; how many differ by more than {tolerance:g} of it; and of {looked_at} of these at
most, how many python-fcl gives to clearance and how many to coal. A cell with (!) is of one short trial.
"""


@dataclass(frozen=True, slots=True)
class Result:
    """What one scene came to."""

    name: str
    race: Race
    kind: str
    compared: int
    greatest: float
    differ: int
    ours: int
    theirs: int


def measure(subject: Subject, rounds: int, most: int) -> Result | None:
    """Race clearance against coal on the free configurations of a scene; None where there is none."""
    scene = subject.auto
    rows, halves = _free(subject, most)
    if not halves:
        return None
    ways: dict[str, Way] = {CLEARANCE: lambda part: scene.clearance(rows[part], threads=1)}
    coal = Coal(scene, rows).distance_ways()
    ways[PAIRS] = coal.pop(PAIRS)
    kind = ""
    if coal:
        kind = quickest_kind(coal, halves)
        ways[MANAGER] = coal[kind]
    found = race(ways, halves, rounds, needed=(CLEARANCE,), least=_LEAST)
    quickest = found.quickest((PAIRS, MANAGER))
    parts = [turns[quickest].part for turns in found.turns.values()] if quickest else []
    values = [np.concatenate([ways[w](part) for part in parts]) for w in (CLEARANCE, quickest)] if parts else [[], []]
    compared = np.concatenate([rows[part] for part in parts]) if parts else rows[:0]
    off = np.abs(np.subtract(*values)) / scene.extent
    differing = np.flatnonzero(off > TOLERANCE)
    ours = theirs = 0
    for i in differing[:_LOOKED_AT]:
        fcl, _ = subject.judged.truth.distance(compared[i])
        ours += abs(values[0][i] - fcl) <= TOLERANCE * scene.extent
        theirs += abs(values[1][i] - fcl) <= TOLERANCE * scene.extent
    greatest = float(off.max(initial=0.0))
    return Result(subject.name, found, kind, len(compared), greatest, len(differing), int(ours), int(theirs))


def _free(subject: Subject, most: int) -> tuple[np.ndarray, dict[str, slice]]:
    """Return free configurations of each half, and where each half is."""
    rows, halves, begin = [], {}, 0
    for half, part in subject.halves.items():
        q = subject.rows[part][: 4 * most]
        free = q[~subject.auto.in_collision(q, threads=1)][:most]
        if len(free):
            halves[half] = slice(begin, begin + len(free))
            rows.append(free)
            begin += len(free)
    return np.vstack(rows) if rows else subject.rows[:0], halves


def text(results: Sequence[Result], rounds: int, rows: int) -> tuple[list[str], list[Check]]:
    """Return the section of the page, and what is met."""
    legend = LEGEND.format(rounds=rounds, rows=rows, tolerance=TOLERANCE, looked_at=_LOOKED_AT)
    header = (
        "scene", "clearance, µs", "coal pairs, µs", "coal manager, µs", "clearance / coal", "mark", "compared",
        "greatest difference", "differ", "fcl agrees: clearance / coal",
    )  # fmt: skip
    lines, checks = [], []
    for r in results:
        best = r.race.quickest((PAIRS, MANAGER))
        ratio = r.race.ratio(CLEARANCE, best) if best else None
        cells = []
        for way in (CLEARANCE, PAIRS, MANAGER):
            if way in r.race.left_out:
                cells.append(f"{micro(r.race.left_out[way])} (!)")
            else:
                present = way in next(iter(r.race.times.values()))
                cells.append(micro(r.race.median(way)) if present else "")
        if cells[2]:
            cells[2] += f" {r.kind.removeprefix('coal ').removesuffix('CollisionManager')}"
        if ratio:
            checks.append(Check("clearance / coal", r.name, ratio.median, MARK))
        checks.append(
            Check("clearances that python-fcl does not confirm", r.name, min(r.differ, _LOOKED_AT) - r.ours, 0)
        )
        lines.append(
            (
                r.name,
                *cells,
                str(ratio or ""),
                mark(ratio.median, MARK) if ratio else "",
                str(r.compared),
                f"{r.greatest:.1e}",
                str(r.differ),
                f"{r.ours} / {r.theirs}" if r.differ else "",
            )
        )
    return ["## Clearance", "", *legend.strip().splitlines(), "", *table(header, lines), ""], checks
