"""How deep bodies are in each other: the shortest push, of those tried, that takes one clear of the other."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ..geometry.distance import Nearest, nearest
from ..geometry.topology import Bools, Floats, Ints
from ..geometry.triangle_search import Jobs, Search
from ..geometry.triangle_sweep import escapes
from .convex_depth import FAN, Overlap
from .surfaces import Surface, Surfaces, unit, unit_normals

# The first window is this fraction of the smaller mesh, or down to this fraction of that where a short push may do;
# each next one, behind it, is this many times as long.
_FIRST_WINDOW, _NARROWEST, _WIDER = 0.1, 0.01, 4.0
# How many pairs of touching triangles are looked at, in how many directions they are taken apart, how many of the
# pushes of each kind that take all of them apart are tried, how many others, and of how many normals; and how often.
_TOUCHING, _WAYS, _PUSHES, _OTHERS, _LEFT_SOON, _AGAIN = 512, 8, 2, 8, 4, 3
# Off planes of either, of b alone, of a alone, off planes or square to edges: columns of ways to take triangles apart.
_KINDS = (slice(0, 4), slice(0, 2), slice(2, 4), slice(0, 6))
_DIGITS = 9
# Of each push, pairs of nodes in a level of the trees that are looked at to begin with.
_FEW = 512
_BLOCK = 4096


@dataclass(frozen=True, slots=True, eq=False)
class _Trials:
    """Pushes to be tried: which job, in which direction (frame of its mesh a), from which offset on."""

    job: Ints
    direction: Floats
    offset: Floats

    def only(self, chosen: Bools) -> _Trials:
        return _Trials(self.job[chosen], self.direction[chosen], self.offset[chosen])


def separations(surfaces: Surfaces, jobs: Jobs, touch: float) -> tuple[Floats, Floats]:
    """Return how far to push mesh a of each job clear of b, (j,), and in which direction, (j, 3), in the frame of a.

    Every push really separates the pair, so this never falls short of the shortest translation that does. Of convex
    pairs it is the shortest one.

    Others are pushed until no triangles cross and none is inside the other. First come the shortest pushes that take
    each pair of touching triangles apart, off the plane of one of them or square to an edge of each: one, two or three
    of these planes decide. What is met then is added, a few times. Where a body is pressed a little into flat walls, a
    corner or a notch, eight planes at the most, that is the shortest push there is. After that come directions that
    would part their hulls soonest: of normals of triangles that touch, of lines square to two of these, along which a
    tunnel leads out, of 26 even directions, and the line between the middles. Beyond shallow contact, all that is
    certain is that the push separates: bodies that are not convex may be called deeper than they are.

    Args:
        surfaces: Of all bodies.
        jobs: Pairs that touch, or of which one contains the other.
        touch: What counts as no distance.
    """
    depth, push = np.full(len(jobs.a), np.inf), np.zeros((len(jobs.a), 3))
    first, others = list[_Trials](), list[_Trials]()
    window = np.zeros(len(jobs.a))
    sizes = np.linalg.norm(surfaces.trees.half[surfaces.trees.roots], axis=1)
    for k in range(len(jobs.a)):
        convex = overlap(surfaces, jobs, k)
        if convex is not None:
            depth[k], push[k] = convex.depth, convex.push
            continue
        a, b = surfaces.surface(int(jobs.a[k])), surfaces.surface(int(jobs.b[k]))
        alone, rotation, translation = jobs.only(np.array([k])), jobs.rotation[k], jobs.translation[k]
        middle = translation + rotation @ b.corners.mean(axis=0) - a.corners.mean(axis=0)
        directions = np.concatenate([FAN, unit(-middle)[None]])
        hits = touching_triangles(surfaces, alone, touch)
        window[k] = _FIRST_WINDOW * min(sizes[jobs.a[k]], sizes[jobs.b[k]])
        if len(hits):
            pushes, lengths, normals = _pushes_of(surfaces, alone, hits, touch)
            square = unit(np.cross(normals[:, None], normals[None])[np.triu_indices(len(normals), 1)])
            directions = np.concatenate([directions, normals, -normals, square, -square])
            first.append(_Trials(np.full(len(pushes), k), pushes, np.zeros(len(pushes))))
            window[k] = np.clip(2 * lengths.min(initial=window[k]), _NARROWEST * window[k], window[k])
        else:
            points = nearest_points(surfaces, alone, touch)
            # Just beyond where they begin to touch.
            offset = points.distance * (1 + 1e-9) + 10 * touch
            first.append(_Trials(np.array([k]), unit(points.on_b - points.on_a), offset))
        directions = directions[directions.any(axis=1)]
        apart = _hulls_part(a, b, rotation, translation, directions)
        order = np.argsort(apart, kind="stable")
        depth[k], push[k] = apart[order[0]], directions[order[0]]
        if len(hits):
            others.append(_Trials(np.full(_OTHERS, k), directions[order[:_OTHERS]], np.zeros(_OTHERS)))
    for trials in (first, others):
        if trials:
            job, direction, offset = (np.concatenate([getattr(t, f) for t in trials]) for f in _Trials.__slots__)
            some = _Trials(job, direction, offset).only(np.asarray(direction.any(axis=1)))
            _push(surfaces, jobs, some, depth, push, window.copy(), touch)
    return depth, push


def overlap(surfaces: Surfaces, jobs: Jobs, k: int) -> Overlap | None:
    """Return how two convex bodies overlap; None where one of them is not convex."""
    a, b = surfaces.surface(int(jobs.a[k])), surfaces.surface(int(jobs.b[k]))
    if a.gauss is None or b.gauss is None:
        return None
    return Overlap(a.corners, b.corners, a.gauss, b.gauss, jobs.rotation[k], jobs.translation[k])


def touching_triangles(surfaces: Surfaces, job: Jobs, touch: float) -> Ints:
    """Return all pairs of triangles of one job that are at no distance, (t, 2)."""
    near = Search(surfaces.trees, job, np.array([np.inf]), touch).within(touch)[:, 1:]
    parts = [near[i : i + _BLOCK] for i in range(0, len(near), _BLOCK)]
    hits = [p[nearest(*pair_triangles(surfaces, job, p)).distance <= touch] for p in parts]
    return np.concatenate([near[:0], *hits])


def _some(hits: Ints) -> Ints:
    """Return not too many of pairs of triangles, by numbers that look random: one more or less changes one at most."""
    if len(hits) <= _TOUCHING:
        return hits
    a, b = hits.astype(np.uint64).T
    scattered = (a * np.uint64(0x9E3779B97F4A7C15)) ^ (b * np.uint64(0xC2B2AE3D27D4EB4F))
    scattered = (scattered ^ (scattered >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
    return hits[np.sort(np.argsort(scattered ^ (scattered >> np.uint64(32)), kind="stable")[:_TOUCHING])]


def _push(
    surfaces: Surfaces, jobs: Jobs, trials: _Trials, depth: Floats, push: Floats, window: Floats, touch: float
) -> None:
    """Try pushes in windows, one behind the other and each longer, as far as the best one of their job that is known.

    Before that, a few of the triangles on the way tell at least how far each must go.
    """
    few = _FEW
    while len(trials.job):
        moved = _moved(jobs, trials.job, trials.direction * trials.offset[:, None])
        left = depth[trials.job] - trials.offset
        reach = left if few else np.minimum(window[trials.job], left)
        ways = escapes(surfaces.trees, moved, trials.direction, reach, few)
        places, ended = trials.offset + ways, (ways <= reach) & (few == 0)
        free = ended.copy()
        if free.any():
            beyond = places[free] + 10 * touch
            after = _moved(jobs, trials.job[free], trials.direction[free] * beyond[:, None])
            free[free] = ~surfaces.contained(after)
        for i in np.flatnonzero(free):
            k = trials.job[i]
            if places[i] < depth[k]:
                depth[k], push[k] = places[i], trials.direction[i]
        # Back by what is no distance: rounding must not open a gap where one crossing ends and another begins.
        further = _Trials(trials.job, trials.direction, np.maximum(places - touch, trials.offset))
        trials = further.only(~ended & (places < depth[trials.job]))
        window, few = window * (1 if few else _WIDER), 0


def _moved(jobs: Jobs, of: Ints, push: Floats) -> Jobs:
    """Return jobs after mesh a was pushed."""
    jobs = jobs.only(of)
    return Jobs(jobs.a, jobs.b, jobs.rotation, jobs.translation - push, np.arange(len(of)))


def pair_triangles(surfaces: Surfaces, job: Jobs, pairs: Ints) -> tuple[Floats, Floats]:
    """Return the triangles of pairs of one job, (t, 3, 3) each, in the frame of a."""
    triangles = surfaces.trees.triangles
    return triangles[pairs[:, 0]], triangles[pairs[:, 1]] @ job.rotation[0].T + job.translation[0]


def _hulls_part(a: Surface, b: Surface, rotation: Floats, translation: Floats, directions: Floats) -> Floats:
    """Return how far to push a in each direction until its hull is beside that of b, (d,)."""
    far = (b.corners @ (directions @ rotation).T).max(axis=0) + directions @ translation
    return np.maximum(far - (a.corners @ directions.T).min(axis=0), 0)


def off_planes(a: Floats, b: Floats, first: Surface, second: Surface) -> tuple[Floats, Floats]:
    """Return directions, (k, 4, 3), and how far triangles of a go along them to be beside those of b, (k, 4).

    A triangle is pushed out of the other's plane, to the outside where that is known; inf where there is no such way.
    """
    normal_a, normal_b = (unit_normals(t) for t in (a, b))
    over_b = np.einsum("kci,ki->kc", a - b[:, :1], normal_b)
    over_a = np.einsum("kci,ki->kc", b - a[:, :1], normal_a)
    ways = np.stack([-over_b.min(axis=1), over_b.max(axis=1), -over_a.min(axis=1), over_a.max(axis=1)], axis=1)
    directions = np.stack([normal_b, -normal_b, -normal_a, normal_a], axis=1)
    ways = np.where(directions.any(axis=2), np.maximum(ways, 0), np.inf)
    # Columns 1 and 3 push into the inside.
    ways[:, 1] = np.inf if second.outward else ways[:, 1]
    ways[:, 3] = np.inf if first.outward else ways[:, 3]
    return directions, ways


def _ways_apart(a: Floats, b: Floats, first: Surface, second: Surface) -> tuple[Floats, Floats]:
    """Return directions and ways as `off_planes` does, and the two shortest of those square to edges, (k, 6)."""
    planes, ways = off_planes(a, b, first, second)
    axes = unit(np.cross(_edges(a)[:, :, None], _edges(b)[:, None])).reshape(len(a), 9, 3)
    axes = np.concatenate([axes, -axes], axis=1)
    square = (b @ axes.transpose(0, 2, 1)).max(axis=1) - (a @ axes.transpose(0, 2, 1)).min(axis=1)
    square = np.where(axes.any(axis=2), np.maximum(square, 0), np.inf)
    best = np.argsort(square, axis=1, kind="stable")[:, :2]
    axes, square = np.take_along_axis(axes, best[..., None], axis=1), np.take_along_axis(square, best, axis=1)
    return np.concatenate([planes, axes], axis=1), np.concatenate([ways, square], axis=1)


def _edges(triangles: Floats) -> Floats:
    return np.roll(triangles, -1, axis=1) - triangles


def _pushes_of(surfaces: Surfaces, job: Jobs, hits: Ints, touch: float) -> tuple[Floats, Floats, Floats]:
    """Return what `_pushes` does of one job and its touching triangles, and of those that are met after the best push.

    What is still to be done there is added to what was to be done before, a few times.
    """
    a, b = surfaces.surface(int(job.a[0])), surfaces.surface(int(job.b[0]))
    at, here, found = np.zeros(3), job, list[tuple[Floats, Floats, Floats]]()
    directions, ways = np.zeros((0, 6, 3)), np.zeros((0, 6))
    for _ in range(_AGAIN):
        more, needed = _ways_apart(*pair_triangles(surfaces, here, _some(hits)), a, b)
        # What merely touches must not be pushed against, either.
        needed = np.maximum(needed, touch) + more @ at
        directions, ways = np.concatenate([directions, more]), np.concatenate([ways, needed])
        pushes, lengths, normals = _pushes(directions, ways, touch)
        found.append((pushes, lengths, normals))
        if not len(pushes):
            break
        best = int(np.argmin(lengths))
        at = pushes[best] * (lengths[best] * (1 + 1e-9) + 10 * touch)
        here = _moved(job, np.zeros(1, dtype=np.int64), at[None])
        hits = touching_triangles(surfaces, here, touch)
        if not len(hits):
            break
    # What looked best at first may still be what is shortest.
    kept = found[:: max(1, len(found) - 1)]
    return np.concatenate([f[0] for f in kept]), np.concatenate([f[1] for f in kept]), found[0][2]


def _pushes(directions: Floats, ways: Floats, touch: float) -> tuple[Floats, Floats, Floats]:
    """Return the shortest pushes that take each pair of triangles apart in one of its ways, (t, 6), or nearly.

    As unit vectors, (p, 3), and how far, (p,), at a guess where some would not come apart. Also returns normals of
    planes, (n, 3), that must be left, the last ones of those that are left soonest.
    """
    found, pushes, kind = list[Floats](), list[Floats](), list[Ints]()
    for columns in _KINDS:
        normals, needed = _planes(directions[:, columns], ways[:, columns], touch)
        tried = [normals * needed[:, None], *(_meeting(normals, needed, many) for many in (2, 3))]
        kind.append(np.full(sum(map(len, tried)), len(found)))
        found.append(normals)
        pushes += tried
    tried, of = np.concatenate(pushes), np.concatenate(kind)
    # What a push leaves to be done, where triangles are still not apart.
    left = np.zeros(len(tried))
    for i in range(0, len(ways), 256):
        short = ways[i : i + 256, :, None] - directions[i : i + 256] @ tried.T
        left = np.maximum(left, short.min(axis=1).max(axis=0))
    lengths = np.linalg.norm(tried, axis=1) + 2 * left
    order = np.argsort(lengths, kind="stable")
    order = order[np.sort(np.unique(np.round(unit(tried[order]), _DIGITS), axis=0, return_index=True)[1])]
    # Of each kind some: the best may not be what looks best.
    chosen = np.unique(np.concatenate([np.flatnonzero(of[order] == k)[:_PUSHES] for k in range(len(_KINDS))]))
    return unit(tried[order[chosen]]), lengths[order[chosen]], found[0][-_LEFT_SOON:]


def _planes(directions: Floats, ways: Floats, touch: float) -> tuple[Floats, Floats]:
    """Return in which directions triangles come apart soonest, (n, 3), and how far, (n,), the farthest first.

    Each direction is as far as the pairs want that have no shorter way.
    """
    best = np.argmin(ways, axis=1)
    rows = np.flatnonzero(np.isfinite(ways.min(axis=1)))
    chosen, way = directions[rows, best[rows]], ways[rows, best[rows]]
    _, first, which = np.unique(np.round(chosen, _DIGITS), axis=0, return_index=True, return_inverse=True)
    most = np.full(len(first), touch)
    np.maximum.at(most, which.ravel(), way)
    order = np.argsort(-most, kind="stable")[:_WAYS]
    return chosen[first[order]], most[order]


def _meeting(normals: Floats, ways: Floats, many: int) -> Floats:
    """Return the shortest pushes that reach so many planes at once, (p, 3): none where the planes are parallel."""
    chosen = np.array(list(combinations(range(len(normals)), many)), dtype=np.int64).reshape(-1, many)
    planes = normals[chosen]
    products = planes @ planes.transpose(0, 2, 1)
    sound = np.linalg.det(products) > 1e-9
    weights = np.linalg.solve(products[sound], ways[chosen][sound][..., None])
    # With a negative weight, one of the planes is left sooner without that one.
    pushes = (planes[sound].transpose(0, 2, 1) @ weights)[..., 0]
    return pushes[(weights >= 0).all(axis=(1, 2))]


def nearest_points(surfaces: Surfaces, job: Jobs, touch: float) -> Nearest:
    """Return where the surfaces of one job, which do not touch, are nearest to each other, in the frame of a."""
    alone = Jobs(job.a, job.b, job.rotation, job.translation, np.zeros(1, dtype=np.int64))
    found = Search(surfaces.trees, alone, np.array([np.inf]), touch).run()
    return nearest(*pair_triangles(surfaces, job, np.column_stack([found.triangle_a, found.triangle_b])))
