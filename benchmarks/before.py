"""Tell how quick this tree is beside an older one, each in an installation of its own.

    python benchmarks/before.py OLD_PYTHON NEW_PYTHON [--scenes NAME ...] [--rounds N]

Both do the same work in turns, so that whatever else the machine does hits both. Printed is new / old in CPU time, the
geometric mean over scenes of the medians of rounds, and the worst scene. Exit status 1 where a mean is above the limit
or results differ. A "python" may be a command, such as "env PYTHONPATH=/a/tree python3". Scenes are those of `models/`,
and of ENV2MJCF_CORPUS where it names their folder.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rounds import no_collections
from table import Case, corpus_cases, model_cases

LIMIT = 1.05
# A turn lasts about so many seconds.
TURN = 0.1
SCENES = (
    "seed", "two-robots", "bug-trap", "LTunnel.tunnel", "SerialWalls.serial", "Maze.maze", "alpha1.6.alpha",
    "bug_trap1.0.bug-trap", "old-testBranchs.branchs", "exps-2DHeterogeneous.heterogeneous",
)  # fmt: skip
IMPORT = "import time; t = time.process_time(); import env2mjcf; print(time.process_time() - t)"


def works(path: str, options: dict[str, Any], folder: Path) -> dict[str, Callable[[], Any]]:
    """Return what is timed of a scene, by what it is called."""
    import env2mjcf

    scene = env2mjcf.load(path, **options)
    q = scene.space.sample(500, seed=1)
    hits = np.asarray(scene.in_collision(q, threads=1))
    free = q[~hits][:100] if (~hits).sum() > 1 else q[:100]
    towards = free + 0.1 * scene.space.difference(free, np.roll(free, 1, axis=0))
    return {
        "verdicts": lambda: scene.in_collision(q, threads=1),
        "linear edges": lambda: scene.edge_in_collision(free, towards, threads=1),
        "proofs of edges": lambda: scene.edge_is_free(free, towards, threads=1),
        "clearance": lambda: scene.clearance(free[:20], threads=1),
        "warm conversion": lambda: env2mjcf.convert(path, folder / "converted", **options),
    }


def timed(run: Callable[[], Any], repeats: int) -> float:
    """Return the CPU seconds of one pass."""
    start = time.process_time()
    for _ in range(repeats):
        run()
    return max((time.process_time() - start) / repeats, 1e-9)


def work(path: str, options: str) -> int:
    """Answer each line that names a work with the CPU seconds of one pass; first tell what verdicts there are."""
    with tempfile.TemporaryDirectory() as folder, no_collections():
        chosen = works(path, json.loads(options), Path(folder))
        told = {n: None if n == "warm conversion" else np.asarray(run(), float).tolist() for n, run in chosen.items()}
        print(json.dumps(told), flush=True)
        repeats = {n: max(1, round(TURN / timed(run, 1))) for n, run in chosen.items()}
        for line in sys.stdin:
            name = line.strip()
            print(timed(chosen[name], repeats[name]), flush=True)
    return 0


def race(pythons: Sequence[str], case: Case, rounds: int) -> tuple[dict[str, float], list[str]]:
    """Return new / old of each work of a scene, and the works whose results differ."""
    options = json.dumps({k: v for k, v in case.options.items() if k != "query"}, default=os.fspath)
    words = [str(Path(__file__).resolve()), "--work", str(case.path), options]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    workers = [subprocess.Popen([*shlex.split(p), *words], text=True, **pipes) for p in pythons]

    def answer(worker: subprocess.Popen[str], name: str) -> float:
        print(name, file=worker.stdin, flush=True)
        return float(worker.stdout.readline())

    try:
        told = [json.loads(w.stdout.readline()) for w in workers]
        differ = [n for n in told[0] if told[0][n] and not np.allclose(told[0][n], told[1][n], rtol=1e-9, atol=1e-12)]
        ratios: dict[str, list[float]] = {name: [] for name in told[0]}
        for number in range(rounds):
            for name, found in ratios.items():
                seconds = {i: answer(workers[i], name) for i in (number % 2, 1 - number % 2)}
                found.append(seconds[1] / seconds[0])
    finally:
        for worker in workers:
            worker.communicate()
    return {name: float(np.median(found)) for name, found in ratios.items()}, differ


def main(arguments: Sequence[str] | None = None) -> int:
    """Race, and print the ratios."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pythons", nargs=2, metavar="PYTHON", help="of the old installation, and of the new one")
    parser.add_argument("--scenes", nargs="*", default=SCENES)
    parser.add_argument("--rounds", type=int, default=15)
    chosen = parser.parse_args(arguments)
    # -P: of the installation, and not of the current folder.
    words = [[*shlex.split(python), "-P", "-c", IMPORT] for python in chosen.pythons]
    seconds = [[float(subprocess.check_output(w)) for w in words] for _ in range(chosen.rounds)]
    found, wrong = {"import": {"": float(np.median([new / old for old, new in seconds]))}}, False
    corpus = os.environ.get("ENV2MJCF_CORPUS")
    known = [*model_cases(), *(corpus_cases(Path(corpus)) if corpus else ())]
    for case in (case for case in known if case.name in chosen.scenes):
        ratios, differ = race(chosen.pythons, case, chosen.rounds)
        print(
            case.name, {k: round(v, 3) for k, v in ratios.items()}, "DIFFERENT: " + ", ".join(differ) if differ else ""
        )
        wrong |= bool(differ)
        for kind, ratio in ratios.items():
            found.setdefault(kind, {})[case.name] = ratio
    print(f"\n{'new / old':16}  mean  worst")
    for kind, ratios in found.items():
        mean, worst = math.exp(np.mean(np.log(list(ratios.values())))), max(ratios, key=ratios.__getitem__)
        wrong |= mean > LIMIT
        print(f"{kind:16} {mean:5.3f}  {ratios[worst]:5.3f} {worst} {'' if mean <= LIMIT else 'TOO SLOW'}")
    return int(wrong)


if __name__ == "__main__":
    sys.exit(work(*sys.argv[2:]) if sys.argv[1:2] == ["--work"] else main())
