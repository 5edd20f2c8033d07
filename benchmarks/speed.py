"""Measure how long verdicts and conversions take: `python benchmarks/speed.py [--quick]`.

Writes `benchmarks/speed.md`. ENV2MJCF_CORPUS names the folder of real scenes. Needs numba and python-fcl.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from c_loop import CLoop, with_verdict_settings
from pages import table
from peers import Fcl
from rounds import no_collections, order
from table import Case, corpus_cases
from truth import Truth, visited

import env2mjcf

OUTPUT = Path(__file__).with_name("speed.md")
# Name, and how many times as slow as python-fcl the C loop may be.
SCENES = {
    "LTunnel.tunnel": 1.0,
    "SerialWalls.serial": 1.0,
    "ZTunnel.tunnel": 1.0,
    "Box.box": 1.0,
    "Maze.maze": 2.5,
    "alpha1.6.alpha": None,
    "bug_trap1.0.bug-trap": None,
}
ROUNDS = 15
ROWS = 1000
REPEATS = 3


def configurations(truth: Truth, count: int) -> np.ndarray:
    """Return rows of which half are uniform in the whole space, half the last steps of bisections onto contact."""
    rows, _, _, uniform = visited(truth, 40 * count // 3 + 400, seed=5)
    rng = np.random.default_rng(5)
    near = rows[uniform + (len(rows) - uniform) // 2 :]
    near = near[rng.choice(len(near), count // 2, replace=False)]
    q = np.vstack([truth.scene.space.sample(count - count // 2, 6), near])
    return q[rng.permutation(len(q))]


def race(case: Case, count: int, rounds: int) -> dict[str, float]:
    """Return medians in seconds a query, and disagreements."""
    scene = env2mjcf.load(case.path, **case.options)
    truth = Truth(scene)
    q = configurations(truth, count)
    everything = slice(0, len(q))
    rivals = Fcl(truth, q).ways()
    qpos = scene.space.qpos(q)
    # With the settings of verdicts; `written` is the model as it is converted, meant for simulation.
    cells = CLoop(with_verdict_settings(scene.model), qpos)
    runs = {
        "c": cells,
        "written": CLoop(scene.model, qpos),
        "scene": lambda part: scene.in_collision(q[part], threads=1),
        **rivals,
    }
    times: dict[str, list[float]] = {name: [] for name in runs}
    for run in runs.values():
        run(everything)
    with no_collections():
        for number in range(rounds):
            for name in order(list(runs), number):
                start = time.thread_time()
                runs[name](everything)
                times[name].append((time.thread_time() - start) / len(q))
    out = {name: float(np.median(t)) for name, t in times.items()}
    best = min(rivals, key=out.__getitem__)
    # A ratio of one round is of one moment of the machine.
    for name in ("c", "written", "scene"):
        out[f"{name} ratio"] = float(np.median(np.divide(times[name], times[best])))
    hits, (surface, solid) = cells.verdicts(everything), truth.verdicts(q)
    out["hits"] = float(surface.mean())
    for name, way in rivals.items():
        assert np.array_equal(way(everything), surface), f"{case.name}: {name} is not what the triangles say"
    out["nested"] = int((solid & ~surface).sum())
    out["c differs"] = int((hits != surface).sum())
    out["c differs, not nested"] = int((hits != surface)[surface == solid].sum())
    out["scene differs"] = int((scene.in_collision(q) != solid).sum())
    return out


def conversions(case: Case, runs: int) -> tuple[float, ...] | None:
    """Return the least elapsed seconds, cold and warm, and the least CPU seconds; None if it does not convert.

    Cold is a conversion with an empty cache, warm the next one.
    """
    seconds = []
    for _ in range(runs):
        with tempfile.TemporaryDirectory() as folder:
            os.environ["ENV2MJCF_CACHE_DIR"] = str(Path(folder) / "cache")
            elapsed, spent = [], []
            for name in ("cold", "warm"):
                start, cpu = time.perf_counter(), time.process_time()
                try:
                    env2mjcf.convert(case.path, Path(folder) / name, **case.options)
                except env2mjcf.Env2MjcfError:
                    return None
                elapsed.append(time.perf_counter() - start)
                spent.append(time.process_time() - cpu)
            seconds.append(elapsed + spent)
    return tuple(np.min(seconds, axis=0).tolist())


def text(races: dict[str, dict[str, float]], times: dict[str, tuple[float, ...]], count: int, rounds: int) -> str:
    """Return the page."""
    rows = []
    for name, r in races.items():
        mark = SCENES[name]
        met = "" if mark is None else ("met" if r["c ratio"] <= mark else "missed")
        micro = [f"{1e6 * r[k]:.2f}" if k in r else "" for k in ("c", "fcl pairs", "fcl manager", "scene", "written")]
        rows.append(
            [
                name,
                f"{100 * r['hits']:.0f} %",
                *micro[:3],
                f"{r['c ratio']:.2f}",
                f"{mark:g}, {met}" if mark else "",
                str(r["c differs"]),
                str(r["nested"]),
                str(r["c differs, not nested"]),
                micro[3],
                f"{r['scene ratio']:.2f}",
                str(r["scene differs"]),
                micro[4],
            ]
        )
    header = (
        "scene", "hits", "C loop, µs", "fcl pairs, µs", "fcl manager, µs", "C loop / fcl", "mark", "differ",
        "nested", "differ, not nested", "in_collision, µs", "in_collision / fcl", "wrong", "as written, µs",
    )  # fmt: skip
    cold, warm = (max(times.items(), key=lambda item, i=i: item[1][i]) for i in (0, 1))
    return "\n".join(
        [
            "# Speed",
            "",
            "Made by `OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/speed.py`, "
            "with `ENV2MJCF_CORPUS` naming the folder of real scenes.",
            "",
            "## Verdicts",
            "",
            f'`collision="auto"`, {count} configurations a scene: half uniform in the whole space, half from the last '
            f"ten of twenty halvings onto contact. CPU time of one thread in microseconds a query, medians over "
            f"{rounds} rounds in which all take turns; a ratio is the median of the rounds' ratios, to the quicker way "
            "of python-fcl.",
            "",
            "- C loop: mj_kinematics and mj_collision, called by address from a loop that numba compiles, on the model "
            "of the verdicts (one contact a pair, libccd). Kinematics is in its time, containment is not, and it does "
            "not stop at the first contact.",
            "- fcl: triangles alone, poses and `Transform` objects made beforehand and not counted, ends at the first "
            "contact; pair by pair, or with a DynamicAABBTreeCollisionManager of the obstacles.",
            "- hits: share that touches by the triangles. differ: verdicts of the C loop unlike python-fcl's; nested: "
            "configurations with one body inside another, which python-fcl calls free and convex hulls do not.",
            "- in_collision: the method, containment included; wrong: its verdicts unlike triangles and containment, "
            "inside the band of truth.md or not.",
            "- as written: the C loop on the converted model with its settings for simulation.",
            "",
            *table(header, rows),
            "",
            "## Conversions",
            "",
            f"Seconds of `env2mjcf.convert` with an empty cache and again with that cache, each the best of {REPEATS}. "
            f"{len(times)} scenes convert. The slowest cold is {cold[0]} with {cold[1][0]:.2f} s (mark: 10 s), the "
            f"slowest warm is {warm[0]} with {warm[1][1]:.2f} s (mark: 1 s).",
            "",
            *table(
                ("scene", "cold, s", "warm, s", "cold, CPU s", "warm, CPU s"),
                [(name, *(f"{t:.3f}" for t in found)) for name, found in times.items()],
            ),
            "",
        ]
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few rounds, and write nothing")
    chosen = parser.parse_args(arguments)
    folder = os.environ.get("ENV2MJCF_CORPUS")
    if not folder:
        parser.error("ENV2MJCF_CORPUS must name the folder of real scenes")
    count, rounds = (200, 3) if chosen.quick else (ROWS, ROUNDS)
    cases = {case.name: case for case in corpus_cases(Path(folder))}
    times = {}
    # The first conversion of a process loads libraries.
    conversions(cases["LTunnel.tunnel"], 1)
    for name, case in cases.items():
        if (seconds := conversions(case, 1 if chosen.quick else REPEATS)) is not None:
            times[name] = seconds
    races = {}
    for name in SCENES:
        races[name] = race(cases[name], count, rounds)
        print(name, {k: float(f"{v:.3g}") for k, v in races[name].items()}, flush=True)
    page = text(races, times, count, rounds)
    if chosen.quick:
        print(page)
    else:
        OUTPUT.write_text(page, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
