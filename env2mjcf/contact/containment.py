"""One body wholly inside another: what surfaces alone do not see."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.assembly import Part
from ..geometry.orientation import winding_numbers
from ..kinematics.transforms import Array
from ..pairs import Pair


@dataclass(frozen=True, slots=True, eq=False)
class _Probe:
    """A pair in which `outer` is a closed solid that only its surface stands for."""

    pair: int
    outer: str
    inner: str
    points: Array  # (c, 3) one vertex for each component of the inner mesh


class Containment:
    """Decides whether links or obstacles lie inside each other, given that their surfaces do not touch.

    Where surfaces do not cross, a component lies inside a solid whole or not at all, so one of its vertices decides:
    its winding number about the solid's triangles is not zero (Jacobson et al., Robust Inside-Outside Segmentation
    using Generalized Winding Numbers, 2013).

    Args:
        pairs: The tested pairs.
        parts: All bodies by name.
    """

    def __init__(self, pairs: tuple[Pair, ...], parts: Mapping[str, Part]) -> None:
        self._parts = parts
        self._probes: list[_Probe] = []
        for i, pair in enumerate(pairs):
            for outer, inner in ((pair.link, pair.other), (pair.other, pair.link)):
                shape = parts[outer].shape
                if shape is not None and shape.needs_containment:
                    self._probes.append(_Probe(i, outer, inner, _component_points(parts[inner])))

    @property
    def needed(self) -> bool:
        """Whether any pair needs the test."""
        return bool(self._probes)

    def inside(self, poses: Mapping[str, Array]) -> NDArray[np.bool_]:
        """Return whether any body lies inside another, (n,).

        Args:
            poses: World poses by name, (n, 4, 4) each.
        """
        n = max((len(p) for p in poses.values()), default=0)
        found = np.zeros(n, dtype=bool)
        for probe in self._probes:
            found |= self._probe(probe, poses)
        return found

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
        near = np.all((local > analysis.vertices.min(axis=0)) & (local < analysis.vertices.max(axis=0)), axis=-1)
        inside = np.zeros(near.shape, dtype=bool)
        if near.any():
            inside[near] = np.abs(winding_numbers(local[near], analysis.vertices, analysis.faces)) > 0.5
        return np.asarray(inside.any(axis=-1))


def _component_points(part: Part) -> Array:
    analysis = part.analysis
    _, first = np.unique(analysis.component, return_index=True)
    return analysis.vertices[analysis.faces[first, 0]]
