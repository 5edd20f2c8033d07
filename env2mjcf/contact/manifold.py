"""One manifold of contacts for each pair of bodies, instead of one contact for each pair of cells."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..geometry.assembly import Part
from ..geometry.distance import nearest
from ..geometry.topology import Floats
from ..geometry.triangle_search import Jobs, Search
from ..pairs import Pair
from ..transforms import Array
from .clearance import BAND, Clearance
from .separation import nearest_points, separations
from .surfaces import Surface, Surfaces, unit_normals
from .types import Contact

# The most contacts of a pair.
_MOST = 8
# Contacts nearer than this, in sizes of the smaller body, whose normals are within about 18 degrees, are one.
_NEAR, _ALIKE = 0.05, 0.95
_BLOCK = 4096


@dataclass(frozen=True, slots=True, eq=False)
class Touch:
    """One point of a contact: where, the unit normal from link to other, and the distance; (3,), (3,)."""

    position: Floats
    normal: Floats
    distance: float


class Manifolds:
    """Turns what touches into a few contacts for each pair, the deepest first.

    Contacts of two hulls are MuJoCo's own. The normals and depths of thin surface cells mean nothing, so those of
    surfaces come from the triangles that touch: the normal is that of one of the two faces, and the depth how far to
    push the link's triangle against it until it is beside the other. Bodies inside others are pushed out.
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
            if self._hulls[pair.link] and self._hulls[pair.other] and index in touching:
                found = touching[index]
            else:
                found = self._of_triangles(index, poses)
            near = _NEAR * min(self._sizes[pair.link], self._sizes[pair.other])
            for t in merged(found, near):
                out.append(Contact(pair.link, pair.other, pair.kind, t.position, t.normal, t.distance))
        return out

    def _of_triangles(self, index: int, poses: Mapping[str, Array]) -> list[Touch]:
        job = self._clearance.pair_jobs(poses, np.array([index]))
        trees, touch = self._surfaces.trees, self._clearance.touch
        near = Search(trees, job, np.array([np.inf]), touch).within(self._band)
        rows = near[:, 1:]
        a, b = trees.triangles[rows[:, 0]], trees.triangles[rows[:, 1]] @ job.rotation[0].T + job.translation[0]
        parts = [nearest(a[i : i + _BLOCK], b[i : i + _BLOCK]) for i in range(0, len(rows), _BLOCK)]
        distance = np.concatenate([np.zeros(0), *(p.distance for p in parts)])
        met = distance <= self._band
        pose = poses[self._pairs[index].link][0]
        # A body inside another, or a part of the other's inside that a hull stands for.
        if not met.any():
            return [self._apart_or_inside(job, pose)]
        places = np.concatenate([(p.on_a + p.on_b) / 2 for p in parts])[met]
        first, second = (self._surfaces.surface(int(t)) for t in (job.a[0], job.b[0]))
        normals, depths = _through(a[met], b[met], first, second)
        # A triangle pushed off one that it merely meets at an edge may go far: no contact is deeper than its pair.
        whole, push = separations(self._surfaces, job, near[distance <= touch], touch)
        ways = depths <= max(float(whole[0]), self._band)
        if not ways.any():
            position = pose[:3, :3] @ places.mean(axis=0) + pose[:3, 3]
            return [Touch(position, pose[:3, :3] @ -push[0], -float(whole[0]))]
        world, turned = places[ways] @ pose[:3, :3].T + pose[:3, 3], normals[ways] @ pose[:3, :3].T
        return [Touch(p, n, -float(d)) for p, n, d in zip(world, turned, depths[ways], strict=True)]

    def _apart_or_inside(self, job: Jobs, pose: Array) -> Touch:
        """Return the nearest points of surfaces that do not touch, and how deep one is inside the other, if it is."""
        touch = self._clearance.touch
        points = nearest_points(self._surfaces, job, touch)
        position = pose[:3, :3] @ ((points.on_a[0] + points.on_b[0]) / 2) + pose[:3, 3]
        if self._surfaces.contained(job)[0]:
            depth, push = separations(self._surfaces, job, np.zeros((0, 3), dtype=np.int64), touch)
            return Touch(position, pose[:3, :3] @ -push[0], -float(depth[0]))
        normal = points.on_b[0] - points.on_a[0]
        return Touch(position, pose[:3, :3] @ (normal / points.distance[0]), float(points.distance[0]))


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


def _through(a: Floats, b: Floats, first: Surface, second: Surface) -> tuple[Floats, Floats]:
    """Return normals, (k, 3) from a to b, and depths, (k,), of triangles that touch.

    A triangle is pushed out of the other's plane, to the outside where that is known, else to the nearer side.
    """
    normal_a, normal_b = (unit_normals(t) for t in (a, b))
    over_b = np.einsum("kci,ki->kc", a - b[:, :1], normal_b)
    over_a = np.einsum("kci,ki->kc", b - a[:, :1], normal_a)
    depths = np.stack([-over_b.min(axis=1), over_b.max(axis=1), -over_a.min(axis=1), over_a.max(axis=1)], axis=1)
    normals = np.stack([-normal_b, normal_b, normal_a, -normal_a], axis=1)
    depths = np.where((normals == 0).all(axis=2), np.inf, np.maximum(depths, 0))
    # Columns 1 and 3 push into the inside.
    depths[:, 1] = np.inf if second.outward else depths[:, 1]
    depths[:, 3] = np.inf if first.outward else depths[:, 3]
    best = np.argmin(depths, axis=1)
    rows = np.arange(len(a))
    return normals[rows, best], depths[rows, best]
