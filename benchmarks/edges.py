"""What a certified edge costs beside the linear check that it replaces, and whether certificates hold."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pages import Check, mark, micro, table
from rounds import Race, Ratio, Way, race, trial
from subjects import Subject

CERTIFIED, LINEAR = "certified", "linear"
MARK = 3.0
# An edge goes this share of the way from one free configuration to another.
_SHORTEST, _LONGEST = 0.02, 0.3
# Configurations on a certified edge that are looked at: both ends, and random ones in between.
DENSE = 200
_LEAST = 5
# Edges whose samples are asked about at once.
_EDGES_AT_ONCE = 500
LEGEND = """
Edges begin at a free configuration, of the uniform or the near half, and go 2 to 30 % of the way to another one.
CPU microseconds an edge on one thread, {rounds} rounds: `edge_is_free(q0, q1)`, which proves, beside
`edge_in_collision(q0, q1)` at the file's resolution (else 0.01 extent), which looks at steps. free, hit: what the steps
say. The mark is for free edges, where there is nothing to stop at; all is in the mixture that was drawn. certified:
share of the free edges that are proved free; refuted: edges that are proved free although a step touches.
"""
PROOF_LEGEND = """
Certified edges, {wanted:,} of all scenes together or as many as there was time for, each looked at in {dense}
configurations: its ends, and random ones in between. contradicted: edges of which `in_collision` calls one in
collision; by triangles: edges of which the triangles and containment say so as well.
"""


@dataclass(frozen=True, slots=True)
class Result:
    """What one scene came to; `race` is on the halves "free" and "hit"."""

    name: str
    race: Race
    free: int
    hit: int
    certified: int
    refuted: int

    def all_edges(self) -> Ratio:
        """Return the ratio of certified to linear over the mixture of free edges and hits."""
        shares = {"free": self.free, "hit": self.hit}
        certified, linear = (
            sum(shares[half] * self.race.rounds(way, half) for half in self.race.times) for way in (CERTIFIED, LINEAR)
        )
        return Ratio.of(certified / linear)


@dataclass(frozen=True, slots=True)
class Proof:
    """What looking at certified edges came to."""

    name: str
    drawn: int
    certified: int
    contradicted: int
    by_triangles: int


def draw(subject: Subject, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of random edges, (count, dim) each."""
    rng = np.random.default_rng(seed)
    # Both halves are of random order, so that a few of each are as good as all.
    q = np.vstack([subject.rows[part][: 2 * count + 200] for part in subject.halves.values()])
    free = q[~subject.auto.in_collision(q, threads=1)]
    if len(free) < 2:
        return free[:0], free[:0]
    start, towards = (free[rng.integers(len(free), size=count)] for _ in range(2))
    share = rng.uniform(_SHORTEST, _LONGEST, size=(count, 1))
    return start, start + share * subject.auto.space.difference(start, towards)


def measure(subject: Subject, rounds: int, count: int, seconds: float) -> Result | None:
    """Race the two kinds of check on a scene's edges; None where no edge is free at its steps.

    Args:
        subject: The scene.
        rounds: How often.
        count: How many edges, at most.
        seconds: How long one pass over all of them may take.
    """
    scene = subject.auto
    start, end = draw(subject, count, seed=5)
    if not len(start):
        return None
    cost = trial(lambda part: scene.edge_is_free(start[part], end[part]), slice(0, len(start)))
    few = int(np.clip(seconds / cost, 2 * _LEAST, len(start)))
    start, end = start[:few], end[:few]
    hits = np.asarray(scene.edge_in_collision(start, end))
    order = np.argsort(hits, kind="stable")
    start, end, free = start[order], end[order], int((~hits).sum())
    halves = {"free": slice(0, free), "hit": slice(free, len(start))}
    halves = {name: part for name, part in halves.items() if part.stop > part.start}
    if "free" not in halves:
        return None
    ways: dict[str, Way] = {
        CERTIFIED: lambda part: scene.edge_is_free(start[part], end[part]),
        LINEAR: lambda part: scene.edge_in_collision(start[part], end[part]),
    }
    found = race(ways, halves, rounds, needed=tuple(ways), least=_LEAST)
    proved = np.asarray(scene.edge_is_free(start, end))
    return Result(subject.name, found, free, len(start) - free, int(proved[:free].sum()), int(proved[free:].sum()))


def prove(subject: Subject, wanted: int, seconds: float) -> Proof:
    """Look closely at so many certified edges of a scene, or at as many as there is time for."""
    drawn = certified = contradicted = by_triangles = 0
    begin, size = time.perf_counter(), 10
    while certified < wanted and time.perf_counter() - begin < seconds:
        start, end = draw(subject, size, seed=1000 + drawn)
        size = min(2 * size, _EDGES_AT_ONCE)
        if not len(start):
            break
        drawn += len(start)
        proved = np.flatnonzero(subject.auto.edge_is_free(start, end))[: wanted - certified]
        certified += len(proved)
        found, confirmed = _contradictions(subject, start[proved], end[proved], seed=drawn)
        contradicted, by_triangles = contradicted + found, by_triangles + confirmed
    return Proof(subject.name, drawn, certified, contradicted, by_triangles)


def _contradictions(subject: Subject, start: np.ndarray, end: np.ndarray, seed: int) -> tuple[int, int]:
    """Return of how many edges a configuration is in collision, by the scene and by the triangles."""
    share = np.random.default_rng(seed).random((len(start), DENSE))
    share[:, 0], share[:, 1] = 0.0, 1.0
    delta = subject.auto.space.difference(start, end)
    rows = start[:, None] + share[..., None] * delta[:, None]
    hits = subject.auto.in_collision(rows.reshape(-1, rows.shape[-1])).reshape(share.shape)
    edges = np.flatnonzero(hits.any(axis=1))
    confirmed = sum(subject.judged.truth.verdicts(rows[i][hits[i]])[1].any() for i in edges)
    return len(edges), int(confirmed)


def text(results: Sequence[Result], proofs: Sequence[Proof], rounds: int, wanted: int) -> tuple[list[str], list[Check]]:
    """Return the section of the page, and what is met."""
    header = (
        "scene", "edges", "free", "certified free, µs", "linear free, µs", "certified hit, µs", "linear hit, µs",
        "certified / linear, free", "mark", "certified / linear, all", "certified", "refuted",
    )  # fmt: skip
    rows, checks = [], []
    for r in results:
        ratio = r.race.ratio(CERTIFIED, LINEAR, "free")
        checks.append(Check("certified / linear edge, free ones", r.name, ratio.median, MARK))
        times = [
            micro(r.race.median(way, half)) if half in r.race.times else ""
            for half in ("free", "hit")
            for way in (CERTIFIED, LINEAR)
        ]
        edges = r.free + r.hit
        rows.append(
            (
                r.name, str(edges), f"{100 * r.free / edges:.0f} %", *times, str(ratio), mark(ratio.median, MARK),
                str(r.all_edges()), f"{100 * r.certified / r.free:.1f} %", str(r.refuted),
            )
        )  # fmt: skip
    lines = ["## Edges", "", *LEGEND.format(rounds=rounds).strip().splitlines(), "", *table(header, rows), ""]
    if proofs:
        lines += [*PROOF_LEGEND.format(dense=DENSE, wanted=wanted).strip().splitlines(), ""]
        rows = [(p.name, *(f"{n:,}" for n in (p.drawn, p.certified, p.contradicted, p.by_triangles))) for p in proofs]
        total = tuple(f"{sum(getattr(p, n) for p in proofs):,}" for n in Proof.__dataclass_fields__ if n != "name")
        header = ("scene", "drawn", "certified", "contradicted", "by triangles")
        lines += [*table(header, [*rows, ("all", *total)]), ""]
        checks += [Check("certified edges with a collision", p.name, p.contradicted, 0) for p in proofs]
    return lines, checks
