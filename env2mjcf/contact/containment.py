"""What surfaces alone do not see: one body wholly inside another, and links that reach beyond the boundary."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.assembly import Assembly, Part
from ..geometry.orientation import encloses_any
from ..model.environment import Boundary
from ..pairs import Pair
from ..transforms import Array
from .types import Outside

# Of a vertex that lies exactly on the boundary, as a fraction of the boundary's size.
ROUNDING = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class _Probe:
    """A pair in which `outer` has closed pieces that only their surfaces stand for."""

    pair: int
    outer: str
    inner: str
    points: Array  # (c, 3) one vertex for each component of the inner mesh


class Containment:
    """Decides whether links or obstacles lie inside each other, given that their surfaces do not touch.

    Where surfaces do not cross, a component lies inside a solid whole or not at all, so one of its vertices decides:
    its winding number about the solid's triangles is not zero (Jacobson et al., Robust Inside-Outside Segmentation
    using Generalized Winding Numbers, 2013).
    """

    def __init__(self, pairs: tuple[Pair, ...], parts: Mapping[str, Part]) -> None:
        self._parts = parts
        self._probes: list[_Probe] = []
        for i, pair in enumerate(pairs):
            for outer, inner in ((pair.link, pair.other), (pair.other, pair.link)):
                shape = parts[outer].shape
                if shape is not None and shape.needs_containment:
                    mesh = parts[inner].analysis
                    first = np.unique(mesh.component, return_index=True)[1]
                    self._probes.append(_Probe(i, outer, inner, mesh.vertices[mesh.faces[first, 0]]))

    @property
    def needed(self) -> bool:
        """Whether any pair needs the test."""
        return bool(self._probes)

    def inside(self, poses: Mapping[str, Array]) -> NDArray[np.bool_]:
        """Return whether any body lies inside another, (n,), for world poses by name, (n, 4, 4) each."""
        n = max((len(p) for p in poses.values()), default=0)
        return np.logical_or.reduce([np.zeros(n, dtype=bool), *(self._probe(p, poses) for p in self._probes)])

    def pairs_inside(self, poses: Mapping[str, Array]) -> list[tuple[int, Array]]:
        """Return (index of the pair, a point of the inner body) for each contained body; poses are (1, 4, 4)."""
        found: list[tuple[int, Array]] = []
        for probe in self._probes:
            if self._probe(probe, poses)[0]:
                pose = poses[probe.inner][0]
                found.append((probe.pair, pose[:3, :3] @ probe.points[0] + pose[:3, 3]))
        return found

    def _probe(self, probe: _Probe, poses: Mapping[str, Array]) -> NDArray[np.bool_]:
        outer, inner = poses[probe.outer], poses[probe.inner]
        world = np.einsum("nij,cj->nci", inner[:, :3, :3], probe.points) + inner[:, None, :3, 3]
        local = np.einsum("nji,ncj->nci", outer[:, :3, :3], world - outer[:, None, :3, 3])
        analysis = self._parts[probe.outer].analysis
        return encloses_any(analysis.vertices, analysis.enclosing, local)


class BoundaryTest:
    """Tests the vertices of a scene's links against its boundary, in metres; none accepts everything.

    The boundary is closed; axes that it does not name are unbounded. Poses come in the order of the links, about the
    scene's origin.
    """

    def __init__(self, assembly: Assembly) -> None:
        self._boundary, self._names = assembly.boundary, [p.name for p in assembly.links]
        self._slack = boundary_slack(assembly)
        self._used = [np.unique(p.mesh.faces) for p in assembly.links]
        self._vertices = [p.used_vertices for p in assembly.links]

    def inside(self, poses: Array) -> NDArray[np.bool_]:
        """Return whether every vertex is inside, (n,), for link poses (n, nlinks, 4, 4)."""
        ok = np.ones(len(poses), dtype=bool)
        if self._boundary is not None:
            for i, vertices in enumerate(self._vertices):
                ok &= (self._beyond(self._boundary, _placed(poses[:, i], vertices)) <= 0).all(axis=1)
        return ok

    def outside(self, poses: Array) -> list[Outside]:
        """Return the links that reach beyond the boundary, for link poses (nlinks, 4, 4)."""
        found: list[Outside] = []
        if self._boundary is not None:
            for i, (name, vertices) in enumerate(zip(self._names, self._vertices, strict=True)):
                world = _placed(poses[i : i + 1], vertices)
                beyond = self._beyond(self._boundary, world)[0]
                if (beyond > 0).any():
                    worst = int(beyond.argmax())
                    found.append(Outside(name, int(self._used[i][worst]), world[0, worst], float(beyond[worst])))
        return found

    def _beyond(self, boundary: Boundary, world: Array) -> Array:
        """Return how far points (n, v, 3) are outside, (n, v); zero or less inside."""
        if boundary.lower:
            axes = len(boundary.lower)
            lower, upper = np.array(boundary.lower), np.array(boundary.upper)
            slack = self._slack
            beyond = np.maximum(lower - slack - world[..., :axes], world[..., :axes] - (upper + slack))
            return beyond.max(axis=-1)
        away = np.linalg.norm(world[..., : len(boundary.center)] - boundary.center, axis=-1)
        return away - (boundary.radius + self._slack)


def boundary_slack(assembly: Assembly) -> float:
    """Return how far beyond the boundary, in metres, a vertex may be found that lies on it."""
    boundary = assembly.boundary
    if boundary is None:
        return 0.0
    size = float(np.max(np.abs([boundary.lower, boundary.upper]))) if boundary.lower else boundary.radius
    # Numbers of the file that are far away were rounded before they came here.
    return ROUNDING * size + 4 * float(np.spacing(np.abs(assembly.origin).max())) * any(assembly.origin)


def _placed(poses: Array, vertices: Array) -> Array:
    return np.einsum("nij,vj->nvi", poses[:, :3, :3], vertices) + poses[:, None, :3, 3]
