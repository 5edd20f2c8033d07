"""Measure how long verdicts and conversions take: `python benchmarks/speed.py [--quick]`.

Writes `benchmarks/speed.md`. ENV2MJCF_CORPUS names the folder of real scenes. Needs numba and python-fcl.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import fcl
import mujoco
import numba
import numpy as np
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


def c_loop() -> Callable[..., None]:
    """Return a compiled loop over configurations that calls MuJoCo's functions by their addresses."""
    library = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("libmujoco*"))))
    kinematics, collision = library.mj_kinematics, library.mj_collision
    for function in (kinematics, collision):
        function.argtypes, function.restype = [ctypes.c_void_p, ctypes.c_void_p], None

    @numba.njit(nogil=True)
    def loop(model: int, data: int, qpos: np.ndarray, rows: np.ndarray) -> None:
        for i in range(len(rows)):
            qpos[:] = rows[i]
            kinematics(model, data)
            collision(model, data)

    return loop


class Fcl:
    """What a Python user would do with python-fcl: poses known, obstacles placed once, done at the first contact."""

    def __init__(self, truth: Truth, rows: np.ndarray) -> None:
        links = len(truth.scene.link_names)
        poses = truth.poses(rows)
        self.transforms = [[fcl.Transform(p[:3, :3], p[:3, 3]) for p in row[:links]] for row in poses]
        truth.place(rows[0])
        self.links, others = truth.objects[:links], truth.objects[links:]
        index = {n: i for i, n in enumerate(truth.names)}
        numbers = [(index[a], index[b]) for a, b in truth.pairs]
        self.pairs = [(truth.objects[a], truth.objects[b]) for a, b in numbers]
        # A manager tests all links with all obstacles; the rest is tested one by one.
        self.own = [(truth.objects[a], truth.objects[b]) for a, b in numbers if max(a, b) < links]
        self.manager = fcl.DynamicAABBTreeCollisionManager() if others else None
        if self.manager:
            assert len(numbers) - len(self.own) == links * len(others), "not all links are tested with all obstacles"
            self.manager.registerObjects(others)
            self.manager.setup()

    def pair_by_pair(self) -> np.ndarray:
        """Ask about one pair after the other."""
        hits = np.zeros(len(self.transforms), dtype=bool)
        request = fcl.CollisionRequest()
        collide, result = fcl.collide, fcl.CollisionResult
        for i, row in enumerate(self.transforms):
            for link, transform in zip(self.links, row, strict=True):
                link.setTransform(transform)
            for a, b in self.pairs:
                if collide(a, b, request, result()):
                    hits[i] = True
                    break
        return hits

    def managed(self) -> np.ndarray:
        """Ask a broadphase manager about the obstacles."""
        hits = np.zeros(len(self.transforms), dtype=bool)
        request, callback = fcl.CollisionRequest(), fcl.defaultCollisionCallback
        for i, row in enumerate(self.transforms):
            for link, transform in zip(self.links, row, strict=True):
                link.setTransform(transform)
            for link in self.links:
                data = fcl.CollisionData(request=request)
                self.manager.collide(link, data, callback)
                if data.result.is_collision:
                    hits[i] = True
                    break
            else:
                hits[i] = any(fcl.collide(a, b, request, fcl.CollisionResult()) for a, b in self.own)
        return hits


def configurations(truth: Truth, count: int) -> np.ndarray:
    """Return rows of which half are uniform in the whole space, half the last steps of bisections onto contact."""
    rows, _, _, uniform = visited(truth, 40 * count // 3 + 400, seed=5)
    rng = np.random.default_rng(5)
    near = rows[uniform + (len(rows) - uniform) // 2 :]
    near = near[rng.choice(len(near), count // 2, replace=False)]
    q = np.vstack([truth.scene.space.sample(count - count // 2, 6), near])
    return q[rng.permutation(len(q))]


def race(case: Case, loop: Callable[..., None], count: int, rounds: int) -> dict[str, float]:
    """Return medians in seconds a query, and disagreements."""
    scene = env2mjcf.load(case.path, **case.options)
    truth = Truth(scene)
    q = configurations(truth, count)
    rival = Fcl(truth, q)
    qpos = np.ascontiguousarray(scene.space.qpos(q))
    # The verdicts' own model and its settings; `written` is the model as it is converted, meant for simulation.
    engine = scene._queries._engine
    verdict_data, written_data = engine.data(), mujoco.MjData(scene.model)
    runs = {
        "c": lambda: loop(engine._model._address, verdict_data._address, verdict_data.qpos, qpos),
        "written": lambda: loop(scene.model._address, written_data._address, written_data.qpos, qpos),
        "scene": lambda: scene.in_collision(q, threads=1),
        "fcl pairs": rival.pair_by_pair,
    }
    if rival.manager:
        runs["fcl manager"] = rival.managed
    times: dict[str, list[float]] = {name: [] for name in runs}
    for run in runs.values():
        run()
    for number in range(rounds):
        # Each round begins with another one.
        order = list(runs)[number % len(runs) :] + list(runs)[: number % len(runs)]
        for name in order:
            start = time.thread_time()
            runs[name]()
            times[name].append((time.thread_time() - start) / len(q))
    out = {name: float(np.median(t)) for name, t in times.items()}
    best = "fcl manager" if out.get("fcl manager", np.inf) < out["fcl pairs"] else "fcl pairs"
    # A ratio of one round is of one moment of the machine.
    for name in ("c", "written", "scene"):
        out[f"{name} ratio"] = float(np.median(np.divide(times[name], times[best])))
    cells, (surface, solid) = engine.collide(qpos, verdict_data), truth.verdicts(q)
    out["hits"] = float(surface.mean())
    for name in ("fcl pairs", "fcl manager"):
        if name in runs:
            assert np.array_equal(runs[name](), surface), f"{case.name}: {name} is not what the triangles say"
    out["nested"] = int((solid & ~surface).sum())
    out["c differs"] = int((cells != surface).sum())
    out["c differs, not nested"] = int((cells != surface)[surface == solid].sum())
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


def lines(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a Markdown table."""
    cells = [header, ["---", *["---:"] * (len(header) - 1)], *rows]
    return ["| " + " | ".join(c.replace("_", "\\_") for c in row) + " |" for row in cells]


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
            *lines(header, rows),
            "",
            "## Conversions",
            "",
            f"Seconds of `env2mjcf.convert` with an empty cache and again with that cache, each the best of {REPEATS}. "
            f"{len(times)} scenes convert. The slowest cold is {cold[0]} with {cold[1][0]:.2f} s (mark: 10 s), the "
            f"slowest warm is {warm[0]} with {warm[1][1]:.2f} s (mark: 1 s).",
            "",
            *lines(
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
    loop = c_loop()
    races = {}
    for name in SCENES:
        races[name] = race(cases[name], loop, count, rounds)
        print(name, {k: float(f"{v:.3g}") for k, v in races[name].items()}, flush=True)
    page = text(races, times, count, rounds)
    if chosen.quick:
        print(page)
    else:
        OUTPUT.write_text(page, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
