"""How deep bodies are in each other: the shortest push, of those tried, that takes one clear of the other."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from ..geometry.distance import Nearest, nearest
from ..geometry.topology import Bools, Floats, Ints
from ..geometry.triangle_search import Jobs, Search
from ..geometry.triangle_sweep import escapes
from .surfaces import Surface, Surfaces, unit, unit_normals

# The first window is this fraction of the smaller mesh; each next one is this many times as long.
_FIRST_WINDOW = 0.05
_WIDER = 4.0
# Of a convex pair: the most pairs of edges that are all tried; of more, those of triangles that touch.
_EDGES = 400
# Of a pair that is not convex: how many pairs of touching triangles, and how many other directions, are tried.
_TOUCHING, _OTHERS = 3, 4

_FAN = np.array([np.array(d) / np.linalg.norm(d) for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)])


@dataclass(frozen=True, slots=True, eq=False)
class _Trials:
    """Pushes to be tried: which job, in which direction (frame of its mesh a), from which offset on."""

    job: Ints
    direction: Floats
    offset: Floats

    def only(self, chosen: Bools) -> _Trials:
        return _Trials(self.job[chosen], self.direction[chosen], self.offset[chosen])


def separations(surfaces: Surfaces, jobs: Jobs, touching: Ints, touch: float) -> tuple[Floats, Floats]:
    """Return how far to push mesh a of each job clear of b, (j,), and in which direction, (j, 3), in the frame of a.

    Every push really separates the pair, so this never falls short of the shortest translation that does. Convex
    pairs are pushed along the face normals of both and square to their edges, which finds the shortest one (but of
    many edges only those of triangles that touch are tried). Others are pushed along the normals of triangles that
    touch, square to their edges, and along those of 26 even directions and of the line between the middles that would
    part their hulls soonest: until no triangles cross and none is inside the other.

    Args:
        surfaces: Of all bodies.
        jobs: Pairs that touch, or of which one contains the other.
        touching: (t, 3) job and triangles of pairs at no distance; a job without any is contained.
        touch: What counts as no distance.
    """
    depth, push = np.full(len(jobs.a), np.inf), np.zeros((len(jobs.a), 3))
    trials: list[tuple[int, Floats, float]] = []
    for k in range(len(jobs.a)):
        a, b = surfaces.surface(int(jobs.a[k])), surfaces.surface(int(jobs.b[k]))
        rotation, translation = jobs.rotation[k], jobs.translation[k]
        middle = translation + rotation @ b.corners.mean(axis=0) - a.corners.mean(axis=0)
        directions = np.concatenate([_FAN, unit(-middle)[None]])
        hits = touching[touching[:, 0] == k]
        first = surfaces.trees.triangles[hits[:, 1]]
        second = surfaces.trees.triangles[hits[:, 2]] @ rotation.T + translation
        if a.convex and b.convex:
            if len(a.edges) * len(b.edges) <= _EDGES:
                square = _square_to(a.edges[None], (b.edges @ rotation.T)[None])
            else:
                square = _square_to(_edges(first), _edges(second))
            square = square.reshape(-1, 3)
            directions = np.concatenate([directions, b.normals @ rotation.T, -a.normals, square, -square])
            directions = directions[(directions != 0).any(axis=1)]
        ways = _hulls_part(a, b, rotation, translation, directions)
        order = np.argsort(ways, kind="stable")
        depth[k], push[k] = ways[order[0]], directions[order[0]]
        if a.convex and b.convex:
            continue
        if len(hits):
            first, second = first[:_TOUCHING], second[:_TOUCHING]
            normals = np.concatenate([unit_normals(first), unit_normals(second)])
            square = _shortest(first, second, _square_to(_edges(first), _edges(second)))
            chosen, offset = np.concatenate([normals, -normals, square, directions[order[:_OTHERS]]]), 0.0
        else:
            points = nearest_points(surfaces, jobs.only(np.array([k])), touch)
            # Just beyond where they begin to touch.
            chosen, offset = unit(points.on_b - points.on_a), float(points.distance[0]) * (1 + 1e-9) + 10 * touch
        trials += [(k, d, offset) for d in chosen if d.any()]
    if trials:
        job, direction, offset = zip(*trials, strict=True)
        _push(surfaces, jobs, _Trials(np.array(job), np.array(direction), np.array(offset)), depth, push, touch)
    return depth, push


def _push(surfaces: Surfaces, jobs: Jobs, trials: _Trials, depth: Floats, push: Floats, touch: float) -> None:
    """Try pushes in windows that grow, until one of a job separates it; what is longer cannot be better."""
    sizes = np.linalg.norm(surfaces.trees.half[surfaces.trees.roots], axis=1)
    window = 2 * _FIRST_WINDOW * np.minimum(sizes[jobs.a], sizes[jobs.b])
    while len(trials.job):
        moved = _moved(jobs, trials.job, trials.direction * trials.offset[:, None])
        ways = escapes(surfaces.trees, moved, trials.direction, np.minimum(window, depth)[trials.job])
        free = np.isfinite(ways)
        if free.any():
            beyond = (ways + trials.offset)[free] + 10 * touch
            after = _moved(jobs, trials.job[free], trials.direction[free] * beyond[:, None])
            free[free] = ~surfaces.contained(after)
        for i in np.flatnonzero(free):
            k, way = trials.job[i], ways[i] + trials.offset[i]
            if way < depth[k]:
                depth[k], push[k] = way, trials.direction[i]
        done = np.zeros(len(jobs.a), dtype=np.bool_)
        done[trials.job[free]] = True
        trials = trials.only(~(done | (window >= depth))[trials.job])
        window *= _WIDER


def _moved(jobs: Jobs, of: Ints, push: Floats) -> Jobs:
    """Return jobs after mesh a was pushed."""
    jobs = jobs.only(of)
    return Jobs(jobs.a, jobs.b, jobs.rotation, jobs.translation - push, np.arange(len(of)))


def _hulls_part(a: Surface, b: Surface, rotation: Floats, translation: Floats, directions: Floats) -> Floats:
    """Return how far to push a in each direction until its hull is beside that of b, (d,)."""
    far = (b.corners @ (directions @ rotation).T).max(axis=0) + directions @ translation
    return np.maximum(far - (a.corners @ directions.T).min(axis=0), 0)


def _edges(triangles: Floats) -> Floats:
    return np.roll(triangles, -1, axis=1) - triangles


def _square_to(first: Floats, second: Floats) -> Floats:
    """Return unit vectors square to each edge of one and of the other, (t, e, 3) and (t, f, 3) to (t, e * f, 3)."""
    found = unit(np.cross(first[:, :, None], second[:, None]))
    return found.reshape(len(first), first.shape[1] * second.shape[1], 3)


def _shortest(first: Floats, second: Floats, axes: Floats) -> Floats:
    """Return the two of the axes (t, c, 3), either way, that triangles are pushed apart along soonest, (2 t, 3)."""
    axes = np.concatenate([axes, -axes], axis=1)
    ways = (second @ axes.transpose(0, 2, 1)).max(axis=1) - (first @ axes.transpose(0, 2, 1)).min(axis=1)
    ways[(axes == 0).all(axis=2)] = np.inf
    best = np.argsort(ways, axis=1)[:, :2]
    return np.take_along_axis(axes, best[..., None], axis=1).reshape(-1, 3)


def nearest_points(surfaces: Surfaces, job: Jobs, touch: float) -> Nearest:
    """Return where the surfaces of one job, which do not touch, are nearest to each other, in the frame of a."""
    alone = Jobs(job.a, job.b, job.rotation, job.translation, np.zeros(1, dtype=np.int64))
    found = Search(surfaces.trees, alone, np.array([np.inf]), touch).run()
    triangles = surfaces.trees.triangles
    moved = triangles[found.triangle_b] @ job.rotation[0].T + job.translation[0]
    return nearest(triangles[found.triangle_a], moved)
