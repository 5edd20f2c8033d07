"""Compare verdicts with exact triangles: `python benchmarks/truth.py [--engine ENGINE] [--quick] [--scenes NAME ...]`.

Writes `benchmarks/truth.md` (of MuJoCo's engine) or `benchmarks/truth-exact.md` (of the exact one): for every complete
scene of the folder that ENV2MJCF_CORPUS names, verdicts of `collision="auto"` against triangles and containment, and of
`collision="surface"` against triangles alone.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from tempfile import TemporaryDirectory

from generated import robots_in_groups, rounded_solids
from pieces import scene_of_pieces
from table import Case, corpus_cases
from triangles import DIRECTIONS, Truth
from verdicts import BAND, HALVINGS, MODES, Result, examine, visited

import env2mjcf

# Other benchmarks take these from here.
__all__ = ["BAND", "Truth", "main", "visited"]

OUTPUT = {"mujoco": Path(__file__).with_name("truth.md"), "exact": Path(__file__).with_name("truth-exact.md")}
HOW = {"mujoco": "by convex cells", "exact": "by triangles, in compiled code"}


def text(results: Sequence[Result], command: str, count: int, engine: str) -> str:
    """Return the page."""
    header = ("scene", "uniform", "bisected")
    for mode in MODES:
        header += (f"{mode}: colliding", "false hits in / out", "largest distance", "false free in / out", "depth")
    lines = [header, ("---", *["---:"] * (len(header) - 1))]
    total = wrong_in = wrong_out = 0
    for r in results:
        cells = [r.name.replace("_", "\\_"), str(r.uniform), str(r.bisected)]
        for mode in MODES:
            tally = r.tallies[mode]
            cells.append(str(tally.colliding))
            total += tally.verdicts
            for errors in (tally.false_hits, tally.false_free):
                out = sum(e > BAND for e in errors)
                wrong_in, wrong_out = wrong_in + len(errors) - out, wrong_out + out
                cells += [f"{len(errors) - out} / {out}", f"{max(errors):.1e}" if errors else ""]
        lines.append(tuple(cells))
    outside = [o for r in results for mode in MODES for o in r.tallies[mode].outside]
    largest = {
        kind: max((e for r in results for t in r.tallies.values() for e in getattr(t, kind)), default=0.0)
        for kind in ("false_hits", "false_free")
    }
    extra = []
    if outside:
        extra = ["", "## Outside the band", "", *(f"- `{o}`" for o in outside[:40])]
        extra += [f"- and {len(outside) - 40} more"] if len(outside) > 40 else []
    return "\n".join(
        [
            "# Verdicts against triangles",
            "",
            f"Made by `{command}`, with `ENV2MJCF_CORPUS` naming the folder of real scenes; about {count} "
            "configurations a scene, one where nothing moves or nothing can touch. Every "
            'complete scene is loaded with `collision="auto"`, whose verdicts are compared with triangles against '
            'triangles (python-fcl) and containment (crossings of a ray), and with `collision="surface"`, whose '
            "verdicts are compared with the triangles alone; all pairs of `scene.pairs` are tested, with "
            f'`engine="{engine}"`, which is to say {HOW[engine]}. Uniform: half of '
            "them in the whole space, half with the robot's base about the obstacles. Bisected: every point that "
            f"{HALVINGS} halvings between a free and a colliding configuration visit, onto the borders of both truths. "
            "Scenes with a number in their names are made at random: `pieces` of meshes in pieces, some with holes, of "
            "which it is known which are closed; `rounded` of convex solids in single precision; `groups` of robots "
            "that move together (`benchmarks/pieces.py`, `benchmarks/generated.py`).",
            "",
            f"The band is {BAND:g} of the scene's extent; numbers before a slash are disagreements in it, after the "
            "slash outside it. A false hit is judged by the distance of the triangles; a false free verdict by the "
            f"shortest of translations in {len(DIRECTIONS)} directions that frees the pair. Both are given as "
            "fractions of the extent.",
            "",
            f"**{total} verdicts on {len(results)} scenes: {wrong_out} wrong outside the band, {wrong_in} "
            f"disagreements within it; the largest distance of a false hit is {largest['false_hits']:.2g}, the "
            f"largest depth of a false free verdict {largest['false_free']:.2g}.**",
            "",
            *(f"| {' | '.join(line)} |" for line in lines),
            *extra,
            "",
        ]
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare and write the page; the exit status is 1 if a verdict is wrong outside the band."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few configurations, and write nothing")
    parser.add_argument("--count", type=int, default=8000, help="configurations for each scene")
    parser.add_argument("--engine", choices=tuple(OUTPUT), default="mujoco")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scenes", nargs="*", help="only these; write nothing")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--random", type=int, default=40, help="random scenes of each kind")
    chosen = parser.parse_args(arguments)
    folder = os.environ.get("ENV2MJCF_CORPUS")
    if not folder:
        parser.error("ENV2MJCF_CORPUS must name the folder of real scenes")
    count = 400 if chosen.quick else chosen.count
    done = {}
    with TemporaryDirectory() as made, ProcessPoolExecutor(chosen.processes) as pool:
        in_pieces = [scene_of_pieces(Path(made) / str(i), i) for i in range(chosen.random)]
        known = {case.name: pieces for case, pieces in in_pieces}
        random = [case for case, _ in in_pieces]
        random += [make(Path(made), i) for make in (rounded_solids, robots_in_groups) for i in range(chosen.random)]
        every = [*(c for c in corpus_cases(Path(folder)) if _complete(c)), *random]
        cases = [c for c in every if not chosen.scenes or c.name in chosen.scenes]
        futures = [pool.submit(examine, c, count, chosen.seed, chosen.engine, known.get(c.name)) for c in cases]
        for future in as_completed(futures):
            result = future.result()
            done[result.name] = result
            wrong = {m: (len(t.false_hits), len(t.false_free), len(t.outside)) for m, t in result.tallies.items()}
            print(
                f"{result.name}: {result.uniform + result.bisected} rows, {result.seconds:.1f} s, {wrong}", flush=True
            )
            for tally in result.tallies.values():
                for line in tally.outside[:3]:
                    print("  OUTSIDE", line, flush=True)
    results = [done[c.name] for c in cases]
    command = "python benchmarks/truth.py" + ("" if chosen.engine == "mujoco" else f" --engine {chosen.engine}")
    command += "" if count == parser.get_default("count") else f" --count {count}"
    page = text(results, command, count, chosen.engine)
    if chosen.quick or chosen.scenes:
        print(page)
    else:
        OUTPUT[chosen.engine].write_text(page, encoding="utf-8")
    return int(any(t.outside for r in results for t in r.tallies.values()))


def _complete(case: Case) -> bool:
    try:
        env2mjcf.load(case.path, **case.options)
    except env2mjcf.GeometryError:
        return False
    return True


if __name__ == "__main__":
    sys.exit(main())
