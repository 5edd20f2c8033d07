"""Verdicts of a scene against the truth, for configurations on the way to the border of contact."""

from __future__ import annotations

import time
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from pieces import Pieces
from table import Case
from triangles import Truth

import env2mjcf

BAND = 1e-5
HALVINGS = 20
MODES = ("auto", "surface")


def samples(scene: env2mjcf.Scene, count: int, seed: int) -> np.ndarray:
    """Sample configurations: half in the whole space, half with bases in a box somewhat larger than the obstacles'."""
    q = scene.space.sample(count, seed)
    parts = scene.compiled.assembly.obstacles
    if not parts:
        return q
    corners = np.vstack([p.mesh.vertices @ p.pose[:3, :3].T + p.pose[:3, 3] for p in parts])
    low, high = corners.min(axis=0), corners.max(axis=0)
    low, high = low - 0.1 * (high - low), high + 0.1 * (high - low)
    rng = np.random.default_rng(seed)
    for column, name in enumerate(scene.space.names):
        if (axis := "xyz".find(name.rpartition(".")[2])) >= 0:
            q[::2, column] = rng.uniform(low[axis], high[axis], len(q[::2]))
    return q


def visited(truth: Truth, count: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Return configurations, whether triangles touch, whether solids do, and how many of the first are uniform.

    The others are all points that bisections pass through: half of them onto the border of the solids, half of them
    onto the border of the surfaces.
    """
    q = samples(truth.scene, max(count // 4, 1), seed)
    surface, solid = truth.verdicts(q)
    rows, surfaces, solids = [q], [surface], [solid]
    rng = np.random.default_rng(seed)
    ends = []
    for hits in (surface, solid):
        free, colliding = np.flatnonzero(~hits), np.flatnonzero(hits)
        if len(free) and len(colliding):
            number = max((count - count // 4) // (2 * HALVINGS), 1)
            ends.append((q[rng.choice(free, number)], q[rng.choice(colliding, number)]))
    if ends:
        low, high = (np.vstack(x) for x in zip(*ends, strict=True))
        # The two borders; either may be missing where nothing was found on one of its sides.
        of_surface = np.zeros(len(low), dtype=bool)
        of_surface[: len(ends[0][0])] = len(ends) == 2 or not np.any(solid != surface)
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            surface, solid = truth.verdicts(middle)
            rows.append(middle), surfaces.append(surface), solids.append(solid)
            hit = np.where(of_surface, surface, solid)[:, None]
            low, high = np.where(hit, low, middle), np.where(hit, middle, high)
    return np.vstack(rows), np.concatenate(surfaces), np.concatenate(solids), len(q)


@dataclass
class Tally:
    """What one mode's verdicts on one scene came to; distances are fractions of the extent."""

    verdicts: int = 0
    colliding: int = 0
    false_hits: list[float] = field(default_factory=list)
    false_free: list[float] = field(default_factory=list)
    outside: list[str] = field(default_factory=list)


@dataclass
class Result:
    """All of one scene."""

    name: str
    uniform: int
    bisected: int
    tallies: dict[str, Tally]
    seconds: float


def examine(
    case: Case, count: int, seed: int, engine: str = "mujoco", known: Mapping[str, Pieces] | None = None
) -> Result:
    """Compare all verdicts on one scene; MuJoCo's are those of the cells, the exact engine's those of triangles.

    Which pieces of a mesh are closed is taken from its analysis, unless it is known.
    """
    start = time.perf_counter()
    scenes = {mode: env2mjcf.load(case.path, collision=mode, **case.options) for mode in MODES}
    truth = Truth(scenes["auto"], known)
    if not scenes["auto"].space.dim or not scenes["auto"].pairs:
        count = 1
    # Scenes that differ in their dialect alone are to be asked different questions.
    seed += zlib.crc32(case.name.encode())
    rows, surface, solid, uniform = visited(truth, count, seed)
    tallies = {}
    for mode, expected in (("auto", solid), ("surface", surface)):
        verdicts = scenes[mode].in_collision(rows, threads=1, engine=engine)
        tally = tallies[mode] = Tally(len(rows), int(expected.sum()))
        for i in np.flatnonzero(verdicts != expected):
            found, pair = truth.distance(rows[i]) if verdicts[i] else truth.depth(rows[i], mode)
            share = found / truth.scene.extent
            (tally.false_hits if verdicts[i] else tally.false_free).append(share)
            if share > BAND:
                kind = "said to collide, distance" if verdicts[i] else "said to be free, depth"
                tally.outside.append(f"{case.name}, {mode}: {pair} {kind} {share:.3g}, q = {rows[i].tolist()}")
    return Result(case.name, uniform, len(rows) - uniform, tallies, time.perf_counter() - start)
