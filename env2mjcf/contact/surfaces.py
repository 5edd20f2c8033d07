"""The triangles that bodies collide with, and which bodies have an inside."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..geometry.assembly import Part
from ..geometry.convexity import Box
from ..geometry.orientation import encloses_any
from ..geometry.pieces import hull_triangles
from ..geometry.topology import Bools, Floats, Ints
from ..geometry.triangle_search import Jobs
from ..geometry.triangle_tree import Forest, forest
from ..options import Collision
from .convex_depth import GaussMap, gauss_map


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """What one mesh collides with.

    Attributes:
        triangles: (m, 3, 3) in the frame of the mesh.
        enclosing: (k,) rows of those of closed pieces, whose inside counts as touching; none where no inside does.
        outward: Whether all of it is solid and its normals are known to point outwards.
        alike: Whether the enclosing ones are wound alike, so that their winding number tells inside from outside.
        convex: Whether it is the boundary of its hull.
        box: The box that it is, if it is one.
        points: (c, 3) one corner of each component.
        corners: (v, 3) all corners, once each.
        gauss: Directions of faces and edges, if `convex`.
    """

    triangles: Floats
    enclosing: Ints
    outward: bool
    alike: bool
    convex: bool
    box: Box | None
    points: Floats
    corners: Floats
    gauss: GaussMap | None

    @property
    def solid(self) -> bool:
        """Whether a body inside it, or inside a piece of it, counts as touching."""
        return len(self.enclosing) > 0


class Surfaces:
    """The surfaces of all bodies that have a shape, and a tree over each; bodies of one shape share both.

    Attributes:
        index: Place of a body, by its name, in `tree`.
        tree: (n,) which tree is over each body's surface.
        trees: The trees.
    """

    def __init__(self, parts: Mapping[str, Part], collision: Collision) -> None:
        self.index: dict[str, int] = {}
        numbers: dict[int, int] = {}
        self._distinct: list[Surface] = []
        tree: list[int] = []
        for name, part in parts.items():
            if part.shape is None:
                continue
            key = id(part.shape)
            if key not in numbers:
                numbers[key] = len(self._distinct)
                self._distinct.append(_surface(part, collision))
            self.index[name] = len(tree)
            tree.append(numbers[key])
        self.trees: Forest = forest([s.triangles for s in self._distinct])
        self.tree: Ints = np.array(tree, dtype=np.int64)

    def surface(self, tree: int) -> Surface:
        """Return the surface that a tree is over."""
        return self._distinct[tree]

    def contained(self, jobs: Jobs) -> Bools:
        """Return whether a component of one mesh lies inside the other, (j,), given that they do not cross.

        Where surfaces do not cross, a component lies inside a solid whole or not at all, so one of its corners decides.
        """
        out = np.zeros(len(jobs.a), dtype=np.bool_)
        for a, b in np.unique(np.stack([jobs.a, jobs.b], axis=1), axis=0):
            rows = np.flatnonzero((jobs.a == a) & (jobs.b == b))
            rotation, translation = jobs.rotation[rows], jobs.translation[rows][:, None]
            first, second = self._distinct[a], self._distinct[b]
            if first.solid:
                out[rows] |= _inside(first, second.points @ rotation.transpose(0, 2, 1) + translation)
            if second.solid:
                out[rows] |= _inside(second, (first.points - translation) @ rotation)
        return out


def _inside(solid: Surface, points: Floats) -> Bools:
    """Return whether any of each row's points, (n, c, 3), is in a solid, (n,)."""
    triangles = solid.triangles[solid.enclosing]
    return encloses_any(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3), points)


def _surface(part: Part, collision: Collision) -> Surface:
    analysis, shape = part.analysis, part.shape
    assert shape is not None
    if collision in ("hull", "coacd") and not analysis.convex:
        # What collides is not the mesh but these hulls.
        hulls = [hull_triangles(p.vertices + p.center) for p in shape.pieces]
        triangles, points = np.concatenate(hulls), np.array([h[0, 0] for h in hulls])
        return _made(triangles, np.arange(len(triangles)), True, True, len(hulls) == 1, None, points)
    triangles = analysis.vertices[analysis.faces]
    first = np.unique(analysis.component, return_index=True)[1]
    inside = collision != "surface"
    enclosing = np.flatnonzero(analysis.closed_components[analysis.component] & inside)
    alike = bool(analysis.solids[analysis.closed_components].all())
    outward = analysis.solid and inside
    return _made(triangles, enclosing, outward, alike, analysis.convex, analysis.box, triangles[first, 0])


def _made(
    triangles: Floats, enclosing: Ints, outward: bool, alike: bool, convex: bool, box: Box | None, points: Floats
) -> Surface:
    corners = np.unique(triangles.reshape(-1, 3), axis=0)
    gauss = gauss_map(triangles) if convex else None
    return Surface(triangles, enclosing, outward, alike, convex, box, points, corners, gauss)


def unit_normals(triangles: Floats) -> Floats:
    """Return unit normals of triangles (m, 3, 3); zero where a triangle has none."""
    return unit(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]))


def unit(vectors: Floats) -> Floats:
    """Return vectors (..., 3) at length one; zero where they have no length."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)
