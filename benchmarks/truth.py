"""Compare verdicts with exact triangles: `python benchmarks/truth.py [--quick] [--scenes NAME ...]`.

Writes `benchmarks/truth.md`: for every complete scene of the folder that ENV2MJCF_CORPUS names, verdicts of
`collision="auto"` against triangles and containment, and of `collision="surface"` against triangles alone.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
import zlib
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path

import fcl
import numpy as np
from table import Case, corpus_cases

import env2mjcf

OUTPUT = Path(__file__).with_name("truth.md")
BAND = 1e-5
HALVINGS = 20
MODES = ("auto", "surface")
# A direction that no edge of a mesh made by hand is parallel to.
RAY = np.array([0.5377, 0.7391, 0.4057])
# Translations that are tried to free a pair: a cube's faces, edges and corners, and random ones.
_GRID = np.array(np.meshgrid(*[[-1.0, 0, 1]] * 3)).reshape(3, -1).T
_GRID = np.vstack([_GRID[np.any(_GRID != 0, axis=1)], np.random.default_rng(0).normal(size=(74, 3))])
DIRECTIONS = _GRID / np.linalg.norm(_GRID, axis=1, keepdims=True)
DEPTHS = np.geomspace(1e-9, 1, 91)


class Truth:
    """Triangles against triangles by python-fcl, and containment by counting signed crossings of a ray."""

    def __init__(self, scene: env2mjcf.Scene) -> None:
        self.scene = scene
        self.pairs = scene.pairs
        parts = {p.name: p for p in scene.compiled.assembly.parts()}
        self.names = (*scene.link_names, *scene.obstacle_names)
        self._index = {n: i for i, n in enumerate(self.names)}
        self._pairs = np.array([[self._index[a], self._index[b]] for a, b in self.pairs], dtype=int).reshape(-1, 2)
        chosen = [parts[n] for n in self.names]
        self.objects = [fcl.CollisionObject(_model(p.mesh), fcl.Transform()) for p in chosen]
        corners = [np.array([p.mesh.vertices.min(axis=0), p.mesh.vertices.max(axis=0)]) for p in chosen]
        self._centre = np.array([c.mean(axis=0) for c in corners]).reshape(-1, 3)
        self._half = np.array([(c[1] - c[0]) / 2 for c in corners]).reshape(-1, 3)
        self._box = corners
        self._closed = [p.analysis.closed for p in chosen]
        self._faces = [p.analysis.vertices[p.analysis.faces] for p in chosen]
        self._points = [_one_of_each_component(p.analysis) for p in chosen]
        self._request = fcl.CollisionRequest()

    def poses(self, q: np.ndarray) -> np.ndarray:
        """Return (n, bodies, 4, 4), links first."""
        fixed = self.scene.obstacle_poses()
        return np.concatenate([self.scene.link_poses(q), np.broadcast_to(fixed, (len(q), *fixed.shape))], axis=1)

    def verdicts(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return whether triangles of any pair touch, and whether they do or a body is inside another, (n,) each."""
        poses = self.poses(q)
        surface = self._surfaces(poses)
        solid = surface.copy()
        # A body inside another is in its box.
        near = self._near(poses) & ~surface[:, None]
        for p in np.flatnonzero(near.any(axis=0)):
            rows, (a, b) = np.flatnonzero(near[:, p]), self._pairs[p]
            for outer, inner in ((a, b), (b, a)):
                solid[rows] |= self._holds(outer, inner, poses[rows, outer], poses[rows, inner])
        return surface, solid

    def _surfaces(self, poses: np.ndarray) -> np.ndarray:
        hits = np.zeros(len(poses), dtype=bool)
        near = self._near(poses)
        moved: list[int | None] = [None] * len(self.names)
        for n, p in zip(*np.nonzero(near), strict=True):
            if hits[n]:
                continue
            for body in self._pairs[p]:
                if moved[body] != n:
                    moved[body] = n
                    self.objects[body].setTransform(fcl.Transform(poses[n, body, :3, :3], poses[n, body, :3, 3]))
            i, j = self._pairs[p]
            if fcl.collide(self.objects[i], self.objects[j], self._request, fcl.CollisionResult()):
                hits[n] = True
        return hits

    def _near(self, poses: np.ndarray) -> np.ndarray:
        """Return which pairs' boxes, along the axes of the world and a hair too large, overlap, (n, pairs)."""
        centre = np.einsum("nbij,bj->nbi", poses[..., :3, :3], self._centre) + poses[..., :3, 3]
        half = np.einsum("nbij,bj->nbi", np.abs(poses[..., :3, :3]), self._half) + 1e-9 * self.scene.extent
        a, b = self._pairs.T
        return np.all(np.abs(centre[:, a] - centre[:, b]) <= half[:, a] + half[:, b], axis=-1)

    def _holds(self, outer: int, inner: int, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Return whether one body, at poses a, holds another at poses b, (n,)."""
        found = np.zeros(len(a), dtype=bool)
        if not self._closed[outer]:
            return found
        world = np.einsum("nij,cj->nci", b[:, :3, :3], self._points[inner]) + b[:, None, :3, 3]
        local = np.einsum("nji,ncj->nci", a[:, :3, :3], world - a[:, None, :3, 3])
        low, high = self._box[outer]
        for n, c in zip(*np.nonzero(np.all((local > low) & (local < high), axis=-1)), strict=True):
            found[n] = found[n] or inside(local[n, c], self._faces[outer])
        return found

    def _nested(self, outer: int, inner: int, poses: np.ndarray) -> bool:
        return bool(self._holds(outer, inner, poses[None, outer], poses[None, inner])[0])

    def place(self, row: np.ndarray) -> np.ndarray:
        """Put all bodies where a configuration has them; return their poses."""
        poses = self.poses(row[None])[0]
        for thing, pose in zip(self.objects, poses, strict=True):
            thing.setTransform(fcl.Transform(pose[:3, :3], pose[:3, 3]))
        return poses

    def distance(self, row: np.ndarray) -> tuple[float, str]:
        """Return the least distance of any pair, and which one."""
        self.place(row)
        request = fcl.DistanceRequest()
        distances = [
            fcl.distance(self.objects[a], self.objects[b], request, fcl.DistanceResult()) for a, b in self._pairs
        ]
        nearest = int(np.argmin(distances))
        return distances[nearest], " - ".join(self.pairs[nearest])

    def depth(self, row: np.ndarray, mode: str) -> tuple[float, str]:
        """Return the shortest translation tried that frees the deepest pair, and which pair it is."""
        poses = self.place(row)
        worst = (0.0, "")
        for pair, (a, b) in zip(self.pairs, self._pairs, strict=True):
            if self._frees(a, b, poses, np.zeros((1, 3)), mode):
                continue
            low, high = -1, len(DEPTHS)
            while high - low > 1:
                middle = (low + high) // 2
                free = self._frees(a, b, poses, DEPTHS[middle] * self.scene.extent * DIRECTIONS, mode)
                low, high = (low, middle) if free else (middle, high)
            reached = DEPTHS[high] * self.scene.extent if high < len(DEPTHS) else np.inf
            worst = max(worst, (reached, " - ".join(pair)))
        return worst

    def _frees(self, a: int, b: int, poses: np.ndarray, shifts: Iterable[np.ndarray], mode: str) -> bool:
        for shift in shifts:
            moved = poses.copy()
            moved[a, :3, 3] += shift
            self.objects[a].setTransform(fcl.Transform(moved[a, :3, :3], moved[a, :3, 3]))
            hit = bool(fcl.collide(self.objects[a], self.objects[b], self._request, fcl.CollisionResult()))
            if not hit and mode != "surface":
                hit = self._nested(a, b, moved) or self._nested(b, a, moved)
            self.objects[a].setTransform(fcl.Transform(poses[a, :3, :3], poses[a, :3, 3]))
            if not hit:
                return True
        return False


def _model(mesh: object) -> fcl.BVHModel:
    model = fcl.BVHModel()
    model.beginModel(len(mesh.vertices), len(mesh.faces))
    model.addSubModel(mesh.vertices, mesh.faces)
    model.endModel()
    return model


def _one_of_each_component(analysis: object) -> np.ndarray:
    _, first = np.unique(analysis.component, return_index=True)
    return analysis.vertices[analysis.faces[first, 0]]


def inside(point: np.ndarray, triangles: np.ndarray) -> bool:
    """Whether a ray leaves a closed surface more often than it enters it, or less (Moeller and Trumbore's test)."""
    a, e, f = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(RAY, f)
    det = np.einsum("ij,ij->i", e, p)
    det[det == 0] = np.inf
    s = point - a
    u = np.einsum("ij,ij->i", s, p) / det
    q = np.cross(s, e)
    v, t = q @ RAY / det, np.einsum("ij,ij->i", f, q) / det
    return bool(np.sign(det[(u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)]).sum() != 0)


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


def examine(case: Case, count: int, seed: int) -> Result:
    """Compare all verdicts on one scene."""
    start = time.perf_counter()
    scenes = {mode: env2mjcf.load(case.path, collision=mode, **case.options) for mode in MODES}
    truth = Truth(scenes["auto"])
    if not scenes["auto"].space.dim or not scenes["auto"].pairs:
        count = 1
    # Scenes that differ in their dialect alone are to be asked different questions.
    seed += zlib.crc32(case.name.encode())
    rows, surface, solid, uniform = visited(truth, count, seed)
    tallies = {}
    for mode, expected in (("auto", solid), ("surface", surface)):
        verdicts = scenes[mode].in_collision(rows, threads=1)
        tally = tallies[mode] = Tally(len(rows), int(expected.sum()))
        for i in np.flatnonzero(verdicts != expected):
            found, pair = truth.distance(rows[i]) if verdicts[i] else truth.depth(rows[i], mode)
            share = found / truth.scene.extent
            (tally.false_hits if verdicts[i] else tally.false_free).append(share)
            if share > BAND:
                kind = "said to collide, distance" if verdicts[i] else "said to be free, depth"
                tally.outside.append(f"{case.name}, {mode}: {pair} {kind} {share:.3g}, q = {rows[i].tolist()}")
    return Result(case.name, uniform, len(rows) - uniform, tallies, time.perf_counter() - start)


def text(results: Sequence[Result], command: str, count: int) -> str:
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
            "verdicts are compared with the triangles alone; all pairs of `scene.pairs` are tested. Uniform: half of "
            "them in the whole space, half with the robot's base about the obstacles. Bisected: every point that "
            f"{HALVINGS} halvings between a free and a colliding configuration visit, onto the borders of both truths.",
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
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scenes", nargs="*", help="only these; write nothing")
    parser.add_argument("--processes", type=int, default=2)
    chosen = parser.parse_args(arguments)
    folder = os.environ.get("ENV2MJCF_CORPUS")
    if not folder:
        parser.error("ENV2MJCF_CORPUS must name the folder of real scenes")
    count = 400 if chosen.quick else chosen.count
    cases = [c for c in corpus_cases(Path(folder)) if _complete(c) and (not chosen.scenes or c.name in chosen.scenes)]
    done = {}
    with ProcessPoolExecutor(chosen.processes) as pool:
        futures = [pool.submit(examine, case, count, chosen.seed) for case in cases]
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
    page = text(results, "python benchmarks/truth.py", count)
    if chosen.quick or chosen.scenes:
        print(page)
    else:
        OUTPUT.write_text(page, encoding="utf-8")
    return int(any(t.outside for r in results for t in r.tallies.values()))


def _complete(case: Case) -> bool:
    try:
        env2mjcf.load(case.path, **case.options)
    except env2mjcf.GeometryError:
        return False
    return True


if __name__ == "__main__":
    sys.exit(main())
