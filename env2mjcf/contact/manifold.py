"""One manifold of contacts for each pair of bodies, instead of one contact for each pair of cells."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..geometry.assembly import Part
from ..geometry.distance import Nearest, nearest
from ..geometry.topology import Floats
from ..geometry.triangle_search import Jobs, Search
from ..pairs import Pair
from ..transforms import Array
from .clearance import BAND, Clearance
from .separation import nearest_points, off_planes, overlap, pair_triangles, separations
from .surfaces import Surfaces
from .types import Contact

# The most contacts of a pair.
_MOST = 8
# Contacts nearer than this, in sizes of the smaller body, whose normals are within about 18 degrees, are one.
_NEAR, _ALIKE = 0.05, 0.95
# Corners of convex bodies that are less far in than the farthest, by this in sizes of the smaller one, touch as well.
_FLAT = 1e-3
_BLOCK = 4096


@dataclass(frozen=True, slots=True, eq=False)
class Touch:
    """One point of a contact: where, the unit normal from link to other, and the distance; (3,), (3,)."""

    position: Floats
    normal: Floats
    distance: float


class Manifolds:
    """Turns what touches into a few contacts for each pair, the deepest first.

    The first is as deep as the pair, by the least push that `separations` knows, and none is deeper. Those of two
    convex bodies are corners of the area where they come free last. Others have the places, normals and depths of
    their parts as well: of bodies made of several hulls, those of MuJoCo. Normals and depths of thin surface cells
    mean nothing, so those of surfaces come from the triangles that touch: the normal is that of one of the two faces,
    and the depth how far to push the link's triangle against it until it is beside the other.
    """

    def __init__(
        self, pairs: Sequence[Pair], parts: Mapping[str, Part], surfaces: Surfaces, clearance: Clearance, extent: float
    ) -> None:
        self._pairs = pairs
        self._surfaces = surfaces
        self._clearance = clearance
        self._band = BAND * extent
        self._sizes = {n: p.mesh.diagonal for n, p in parts.items()}
        self._hulls = {n: _only_hulls(p) for n, p in parts.items()}

    def contacts(
        self, touching: Mapping[int, list[Touch]], contained: Iterable[int], poses: Mapping[str, Array]
    ) -> list[Contact]:
        """Return the contacts of one configuration.

        Args:
            touching: What MuJoCo found, by index of the pair.
            contained: Pairs that MuJoCo does not see: of which one body lies inside the other, or that barely touch.
            poses: World poses by name, (1, 4, 4) each.
        """
        out: list[Contact] = []
        for index in sorted({*touching, *contained}):
            pair = self._pairs[index]
            near = _NEAR * min(self._sizes[pair.link], self._sizes[pair.other])
            for t in merged(self._of_pair(index, touching.get(index, []), poses), near):
                out.append(Contact(pair.link, pair.other, pair.kind, t.position, t.normal, t.distance))
        return out

    def _of_pair(self, index: int, found: list[Touch], poses: Mapping[str, Array]) -> list[Touch]:
        pair, surfaces, touch = self._pairs[index], self._surfaces, self._clearance.touch
        job = self._clearance.pair_jobs(poses, np.array([index]))
        pose = poses[pair.link][0]
        convex = overlap(surfaces, job, 0)
        solid = surfaces.surface(int(job.a[0])).solid or surfaces.surface(int(job.b[0])).solid
        if convex is None or convex.depth <= self._band or not solid:
            points = nearest_points(surfaces, job, touch)
            if points.distance[0] > touch and not surfaces.contained(job)[0]:
                return [_apart(points, pose)]
        if convex is not None:
            places, depths = convex.patch(_FLAT * min(self._sizes[pair.link], self._sizes[pair.other]))
            turned = pose[:3, :3] @ -convex.push
            return [Touch(p, turned, -float(d)) for p, d in zip(_world(pose, places), depths, strict=True)]
        whole, push = separations(surfaces, job, touch)
        depth, normal = float(whole[0]), pose[:3, :3] @ -push[0]
        if not (found and self._hulls[pair.link] and self._hulls[pair.other]):
            found = self._of_triangles(job, pose)
        return _no_deeper(found, depth, normal)

    def _of_triangles(self, job: Jobs, pose: Array) -> list[Touch]:
        """Return the contacts of triangles that touch, or where the surfaces of one body inside another are nearest."""
        near = Search(self._surfaces.trees, job, np.array([np.inf]), self._clearance.touch).within(self._band)[:, 1:]
        a, b = pair_triangles(self._surfaces, job, near)
        parts = [nearest(a[i : i + _BLOCK], b[i : i + _BLOCK]) for i in range(0, len(near), _BLOCK)]
        met = np.concatenate([np.zeros(0), *(p.distance for p in parts)]) <= self._band
        # A body inside another, or a part of the other's inside that a hull stands for.
        if not met.any():
            return [_apart(nearest_points(self._surfaces, job, self._clearance.touch), pose)]
        places = np.concatenate([(p.on_a + p.on_b) / 2 for p in parts])[met]
        first, second = (self._surfaces.surface(int(t)) for t in (job.a[0], job.b[0]))
        directions, ways = off_planes(a[met], b[met], first, second)
        best = np.argmin(ways, axis=1)
        rows = np.arange(len(best))
        world, turned = _world(pose, places), -directions[rows, best] @ pose[:3, :3].T
        return [Touch(p, n, -float(d)) for p, n, d in zip(world, turned, ways[rows, best], strict=True)]


def _world(pose: Array, points: Floats) -> Floats:
    return points @ pose[:3, :3].T + pose[:3, 3]


def _apart(points: Nearest, pose: Array) -> Touch:
    """Return the contact of surfaces that do not touch, where they are nearest."""
    normal = points.on_b[0] - points.on_a[0]
    place = _world(pose, (points.on_a + points.on_b) / 2)[0]
    return Touch(place, pose[:3, :3] @ (normal / points.distance[0]), float(points.distance[0]))


def _no_deeper(found: Sequence[Touch], depth: float, normal: Floats) -> list[Touch]:
    """Return contacts of which none is deeper than its pair, and the first as deep, with the normal of the least push.

    A triangle pushed off one that it merely meets at an edge may go far. That of a contact which is too deep says
    nothing then, but where it is, is kept if there is no better.
    """
    sound = [t for t in found if -depth <= t.distance <= 0 and t.normal.any()]
    alike = [t for t in sound if float(t.normal @ normal) > _ALIKE]
    place = min(alike or found, key=lambda t: t.distance).position
    return [Touch(place, normal, -depth), *sound]


def merged(touches: Sequence[Touch], near: float) -> list[Touch]:
    """Return a few of many contacts, the deepest first; contacts that are near and alike are one."""
    kept: list[Touch] = []
    for t in sorted(touches, key=lambda t: t.distance):
        if not any(_same(t, k, near) for k in kept):
            kept.append(t)
            if len(kept) == _MOST:
                break
    return kept


def _same(a: Touch, b: Touch, near: float) -> bool:
    return float(a.normal @ b.normal) > _ALIKE and float(np.linalg.norm(a.position - b.position)) < near


def _only_hulls(part: Part) -> bool:
    return part.shape is not None and all(p.polygon is None for p in part.shape.pieces)
