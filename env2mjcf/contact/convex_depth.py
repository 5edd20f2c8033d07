"""How deep two convex bodies are in each other, and where they touch: exact, from their Gauss maps."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from ..geometry.topology import Bools, Floats, Ints

FAN: Floats = np.array([np.array(d) / np.linalg.norm(d) for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)])
"""Even directions, (26, 3)."""

# Directions whose supports are taken at once, by how many corners: products held in memory.
_BLOCK = 2_000_000
# Normals that differ by less are one.
_DIGITS = 12
# What two values of the support function may differ by, in extents of the pair, and still be equal.
_ROUNDING = 1e-14
# What is less than this, in sizes of the pair, out of a plane or a line is in it.
_PLANE = 1e-9
# The most projections of a point onto planes, each half as long again as it must be: so they may end inside.
_PROJECTIONS = 400
# How many points stand for an area.
_POINTS = 4
# The most halvings of an arc, against endless loops of rounding: each names a corner that was not known before.
_ROUNDS = 200


@dataclass(frozen=True, slots=True, eq=False)
class GaussMap:
    """The directions in which the faces and the edges of a convex body are farthest out.

    Attributes:
        normals: (f, 3) outward unit normals of the faces, each once.
        offsets: (f,) how far the body reaches along each.
        start, square: (e, 3) each: at an edge, the directions from the normal of one face, `start`, towards `square`,
            as far as `angle`, in radians, where the other face's is; both are unit vectors square to the edge.
        angle: (e,) more than 0, at most pi.
    """

    normals: Floats
    offsets: Floats
    start: Floats
    square: Floats
    angle: Floats


def gauss_map(triangles: Floats) -> GaussMap:
    """Return the Gauss map of a convex surface of triangles, (m, 3, 3).

    Edges between triangles of one plane have no arc. The normal of a sliver is anywhere between those of its
    neighbours, or beyond one of them; the arcs of its two long edges together still reach from one to the other.
    """
    area = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    flat = np.linalg.norm(area, axis=1) == 0
    corners, index = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    faces = index.reshape(-1, 3)
    # Outward, whichever way they are wound.
    inward = ((triangles.mean(axis=1) - corners.mean(axis=0)) * area).sum(axis=1) < 0
    normals = _unit(np.where(inward[:, None], -area, area))
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    ends.sort(axis=1)
    owner = np.repeat(np.arange(len(faces)), 3)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    same = np.flatnonzero(~np.diff(ends[order], axis=0).any(axis=1))
    first, second = order[:-1][same], order[1:][same]
    along = _unit(corners[ends[first, 1]] - corners[ends[first, 0]])
    one, other = normals[owner[first]], normals[owner[second]]
    # Square to the edge to the last bit, whatever the normals' rounding.
    start = _unit(one - (one * along).sum(axis=1, keepdims=True) * along)
    square = np.cross(along, start)
    side = (other * square).sum(axis=1)
    square[side < 0] *= -1
    angle = np.arctan2(np.abs(side), (other * start).sum(axis=1))
    curved = (angle > 10.0**-_DIGITS) & ~flat[owner[first]] & ~flat[owner[second]]
    once = normals[~flat][np.unique(np.round(normals[~flat], _DIGITS), axis=0, return_index=True)[1]]
    step = max(1, _BLOCK // len(corners))
    reach = [(once[i : i + step] @ corners.T).max(axis=1) for i in range(0, len(once), step)]
    return GaussMap(once, np.concatenate([np.zeros(0), *reach]), start[curved], square[curved], angle[curved])


class Overlap:
    """Two convex bodies at a relative pose, and the least push that parts them.

    Pushing a by the support function of the Minkowski difference b - a in some direction sets it beside b. The least
    value of that function over all directions is at a facet of the difference: at the normal of a face of one of them,
    or where arcs of both Gauss maps cross (Cameron and Culley, Determining the minimum translational distance between
    two convex polyhedra, 1986; Gregorius, The separating axis test between convex polyhedra, 2013). As long as the
    same corner of the difference is farthest out, the function is concave along an arc, so its least value on an arc of
    one body is where that corner changes: where it crosses arcs of the other. Corners that are already known bound it
    from below: most arcs are never looked at, and each place that is looked at names a new corner.

    Args:
        corners_a, corners_b: (v, 3) and (w, 3), each in the frame of its own body.
        map_a, map_b: Their Gauss maps, likewise.
        rotation, translation: (3, 3) and (3,), the pose of b in the frame of a.

    Attributes:
        depth: How far to push, 0 at least.
        push: (3,) in which direction a is pushed, a unit vector in the frame of a.
    """

    def __init__(
        self,
        corners_a: Floats,
        corners_b: Floats,
        map_a: GaussMap,
        map_b: GaussMap,
        rotation: Floats,
        translation: Floats,
    ) -> None:
        self._a, self._b = corners_a, corners_b @ rotation.T + translation
        self._map_a, self._map_b, self._rotation, self._translation = map_a, map_b, rotation, translation
        self._size = float(np.linalg.norm(np.ptp(corners_a, axis=0)) + np.linalg.norm(np.ptp(corners_b, axis=0)))
        self._best, self.push = np.inf, FAN[0]
        known = self._look(FAN)
        normals = np.concatenate([map_b.normals @ rotation.T, -map_a.normals])
        self._look_where_less(normals, (known @ normals.T).max(axis=0))
        # Arcs of both: where one body's faces are not quite those of its hull, the other's arcs are still exact.
        start = np.concatenate([map_b.start @ rotation.T, -map_a.start])
        square = np.concatenate([map_b.square @ rotation.T, -map_a.square])
        self._search_arcs(start, square, np.concatenate([map_b.angle, map_a.angle]), known)
        self.depth = max(self._best, 0.0)

    def _look(self, directions: Floats) -> Floats:
        """Return the corners of b - a that are farthest out in some directions, (d, 3)."""
        out = np.empty_like(directions)
        step = max(1, _BLOCK // (len(self._a) + len(self._b)))
        for i in range(0, len(directions), step):
            block = directions[i : i + step]
            far = self._b[np.argmax(block @ self._b.T, axis=1)] - self._a[np.argmin(block @ self._a.T, axis=1)]
            ways = (far * block).sum(axis=1)
            least = int(np.argmin(ways))
            if ways[least] < self._best:
                self._best, self.push = float(ways[least]), block[least]
            out[i : i + step] = far
        return out

    def _look_where_less(self, directions: Floats, bounds: Floats) -> None:
        """Look in directions, the most promising first, until the bounds from below are no less than what is known."""
        order = np.argsort(bounds, kind="stable")
        done, step = 0, 64
        while done < len(order) and bounds[order[done]] < self._best:
            self._look(directions[order[done : done + step]])
            done, step = done + step, 4 * step

    def _search_arcs(self, start: Floats, square: Floats, angle: Floats, known: Floats) -> None:
        # A corner's height is concave along an arc where it is positive, so it is least at one of the ends.
        end = np.cos(angle)[:, None] * start + np.sin(angle)[:, None] * square
        kept = np.minimum(start @ known.T, end @ known.T).max(axis=1) < self._best
        start, square, angle = start[kept], square[kept], angle[kept]
        left, right = np.zeros(len(angle)), angle
        corner, other = self._look(start), self._look(end[kept])
        for _ in range(_ROUNDS):
            apart = corner - other
            level = np.arctan2(-(apart * start).sum(axis=1), (apart * square).sum(axis=1))
            place = left + (level - left) % np.pi
            at = np.cos(place)[:, None] * start + np.sin(place)[:, None] * square
            bound = (at * corner).sum(axis=1)
            slack = _ROUNDING * self._size
            open_ = apart.any(axis=1) & (place < right) & (bound < self._best - slack)
            if not open_.any():
                return
            start, square, place, at = start[open_], square[open_], place[open_], at[open_]
            found = self._look(at)
            new = (at * found).sum(axis=1) > bound[open_] + slack
            left, right = (np.concatenate(x) for x in ((left[open_][new], place[new]), (place[new], right[open_][new])))
            corner, other = (
                np.concatenate(x) for x in ((corner[open_][new], found[new]), (found[new], other[open_][new]))
            )
            start, square = np.concatenate([start[new]] * 2), np.concatenate([square[new]] * 2)

    def patch(self, flat: float) -> tuple[Floats, Floats]:
        """Return where the bodies meet, (k, 3) in the frame of a, and how deep there, (k,), the deepest first.

        What is farthest in of each, seen along the push, is a face, an edge or a corner. Where the two lie over each
        other the bodies come free last: up to four points, far from each other, stand for that area. The first is as
        deep as the pair, none is deeper. Each is in the middle of what the bodies share of the line along the push, or
        near to it.

        Args:
            flat: How much less deep a corner may be and still belong to a face, or to an edge, that is farthest in.
        """
        low, high = self._a @ self.push, self._b @ self.push
        rounding = _PLANE * self._size
        flat = min(flat, self.depth / 2) + rounding
        across = np.linalg.svd(self.push[None])[2][1:].T
        mine, other = self._a[low <= low.min() + flat], self._b[high >= high.max() - flat]
        a, b = over_each_other(mine, other, across, 10 * rounding)
        depth = np.clip(((b - a) @ self.push), 0.0, self.depth)
        chosen = _spread(a @ across, int(np.argmax(depth)), 10 * rounding)
        depth = np.r_[self.depth, depth[chosen][1:]]
        places = self._in_both(a[chosen], depth)
        order = np.argsort(-depth, kind="stable")
        return places[order], depth[order]

    def _in_both(self, points: Floats, depth: Floats) -> Floats:
        """Return the middle of what is in both bodies of lines along the push, from points as far as their depths.

        Where bodies slant, such a line may miss what they share. The plane that it is farthest outside of is then
        projected on, again and again (Agmon, The relaxation method for linear inequalities, 1954).
        """
        normals = np.concatenate([self._map_a.normals, self._map_b.normals @ self._rotation.T])
        offsets = self._map_b.offsets + normals[len(self._map_a.normals) :] @ self._translation
        offsets = np.concatenate([self._map_a.offsets, offsets])
        speed, room = normals @ self.push, offsets - points @ normals.T
        steep = np.abs(speed) > _PLANE
        reach = room / np.where(steep, speed, 1.0)
        high = np.minimum(np.where(steep & (speed > 0), reach, np.inf).min(axis=1), depth)
        low = np.maximum(np.where(steep & (speed < 0), reach, -np.inf).max(axis=1), 0.0)
        places = points + np.clip((low + high) / 2, 0.0, depth)[:, None] * self.push
        for i in range(len(places)):
            for _ in range(_PROJECTIONS):
                outside = normals @ places[i] - offsets
                worst = int(np.argmax(outside))
                if outside[worst] <= _PLANE * self._size:
                    break
                places[i] -= 1.5 * outside[worst] * normals[worst]
        return places


def over_each_other(first: Floats, second: Floats, across: Floats, rounding: float) -> tuple[Floats, Floats]:
    """Return corners of the area where two convex polygons lie over each other, (k, 3) on each, one at least.

    Args:
        first: (p, 3) corners and other points of a nearly flat polygon, of a segment, or one point.
        second: (q, 3) the same of the other.
        across: (3, 2) axes of the plane in which they are seen.
        rounding: How far off an area a point may be and still be in it.
    """
    p, q = (x[_outline(x @ across)] for x in (first, second))
    flat_p, flat_q = p @ across, q @ across
    in_q, in_p = _within(flat_p, flat_q, rounding), _within(flat_q, flat_p, rounding)
    a, b = [p[in_q], _lifted(q[in_p], p, across)], [_lifted(p[in_q], q, across), q[in_p]]
    i, j = (x.ravel() for x in np.indices((len(p), len(q))))
    along_p, along_q = (np.roll(x, -1, axis=0) - x for x in (flat_p, flat_q))
    cross = _cross(along_p[i], along_q[j])
    parallel = np.abs(cross) <= 1e-12 * np.linalg.norm(along_p[i], axis=1) * np.linalg.norm(along_q[j], axis=1)
    apart = flat_q[j] - flat_p[i]
    s, t = (_cross(apart, x) / np.where(parallel, np.inf, cross) for x in (along_q[j], along_p[i]))
    met = ~parallel & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    a.append((p[i] + s[:, None] * (np.roll(p, -1, axis=0) - p)[i])[met])
    b.append((q[j] + t[:, None] * (np.roll(q, -1, axis=0) - q)[j])[met])
    found_a, found_b = np.concatenate(a), np.concatenate(b)
    if len(found_a):
        return found_a, found_b
    # Apart by rounding alone: the nearest corners.
    nearest = int(np.argmin(np.linalg.norm(flat_p[i] - flat_q[j], axis=1)))
    return p[i[nearest]][None], q[j[nearest]][None]


def _lifted(points: Floats, polygon: Floats, across: Floats) -> Floats:
    """Return points moved square to the plane into that of a nearly flat polygon, through the middle of it."""
    middle = polygon.mean(axis=0)
    return middle + (points - middle) @ across @ across.T


def _outline(points: Floats) -> Ints:
    """Return which points are the corners of the convex hull of (p, 2), counter-clockwise (Andrew's chains, 1979)."""
    order = np.lexsort((points[:, 1], points[:, 0]))
    xy = points.tolist()
    found: list[int] = []
    for way in (order, order[::-1]):
        chain: list[int] = []
        for k in way.tolist():
            while len(chain) > 1:
                (ax, ay), (bx, by), (cx, cy) = xy[chain[-2]], xy[chain[-1]], xy[k]
                if (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) > 0:
                    break
                chain.pop()
            chain.append(k)
        found += chain[:-1]
    return np.array(found or order[:1].tolist(), dtype=np.int64)


def _within(points: Floats, polygon: Floats, rounding: float) -> Bools:
    """Return whether points, (p, 2), are in a convex polygon, on a segment or at a point, (p,)."""
    start, along = polygon, np.roll(polygon, -1, axis=0) - polygon
    length = np.linalg.norm(along, axis=1)
    away = points[:, None] - start
    if len(polygon) > 2:
        return (_cross(along, away) >= -rounding * length).all(axis=1)
    t = np.clip((away * along).sum(axis=2) / np.where(length > 0, length, 1.0) ** 2, 0, 1)
    return np.linalg.norm(away - t[..., None] * along, axis=2).min(axis=1) <= rounding


def _cross(a: Floats, b: Floats) -> Floats:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _spread(points: Floats, first: int, near: float) -> Ints:
    """Return up to four points, (p, 2), far from each other, beginning with one of them."""
    chosen = [first]
    away = np.linalg.norm(points - points[first], axis=1)
    while len(chosen) < _POINTS and away.max() > near:
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.array(chosen)


def _unit(vectors: Floats) -> Floats:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)
