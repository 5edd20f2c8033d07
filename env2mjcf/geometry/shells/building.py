"""From the triangles of closed solids to convex cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..analysis import Analysis
from ..pieces import SLENDEREST, ConvexPiece, prisms, too_narrow
from ..polygons import Polygon, convex_polygons
from ..topology import Ints
from .corners import cell_corners
from .doubts import doubtful_polygons
from .pairing import pair_sides
from .thickness import fit
from .walls import Group, groups

THICKEST = 0.02
"""Greatest height of a cell in units of the mesh's diagonal: thicker ones cost time and gain nothing."""

_THINNEST = 5e-6
"""Least height of a cell in units of the mesh's diagonal; below it a thin prism stands for the polygon."""


_EXACT = 2e-10
"""What counts as nothing, in units of the mesh's diagonal: bent polygons and grazing triangles, two of each at worst,
must not add up to 1e-9."""


@dataclass(frozen=True, slots=True, eq=False)
class Shells:
    """The cells of a surface.

    Attributes:
        pieces: In the order of their polygons.
        pinned: How many are thin prisms, because there is no room for a cell.
        tilted: How many cells lean further than their edges ask for, to make way for another part of the surface.
        thinnest: Height of the lowest piece.
        volume: Of all cells together; where they overlap it counts once for each.
        missing: Polygons that are too small for MuJoCo.
    """

    pieces: tuple[ConvexPiece, ...]
    pinned: int
    tilted: int
    thinnest: float
    volume: float
    missing: tuple[Polygon, ...]


def shells(analysis: Analysis, faces: Ints, thickness: float) -> Shells:
    """Line the inside of a closed surface with convex cells, which overlap at its convex edges.

    Args:
        analysis: Of a `solid` mesh.
        faces: (k,) rows of `analysis.faces` to be lined.
        thickness: Height of the prisms where there is no room for a cell.
    """
    vertices, chosen = analysis.vertices, analysis.faces[faces]
    nothing = _EXACT * analysis.diagonal
    polygons = convex_polygons(vertices, chosen, nothing)
    normals = np.empty((len(chosen), 3))
    for polygon in polygons:
        normals[list(polygon.faces)] = polygon.normal
    sides = pair_sides(vertices, chosen, normals)
    solid = np.where(analysis.component_volumes > 0, np.arange(analysis.components), -1)[analysis.component]
    of_polygon = solid[faces[[p.faces[0] for p in polygons]]]
    found: list[ConvexPiece | None] = [None] * len(polygons)
    # Height, volume, and whether a side is tilted.
    measures = np.zeros((len(polygons), 3))
    for group in groups(vertices, chosen, polygons, sides.slopes, THICKEST * analysis.diagonal):
        fit(group, vertices[analysis.faces], solid, of_polygon[group.members], nothing)
        for row, piece, height, volume in _cells(group, polygons, analysis, thickness):
            number = int(group.members[row])
            found[number] = piece
            measures[number] = height, volume, group.tilted[row]
    doubtful = doubtful_polygons(analysis, polygons, found, sides, thickness)
    bare, standing = list(doubtful), list(doubtful.values())
    pins = {id(p.polygon): p for p in prisms(vertices, standing, thickness, inward=True)}
    for i, polygon in zip(bare, standing, strict=True):
        found[i] = pins.get(id(polygon))
    missing = tuple(polygons[i] for i in bare if found[i] is None)
    measures[bare] = thickness, 0.0, 0.0
    return Shells(
        pieces=tuple(piece for piece in found if piece is not None),
        pinned=len(pins),
        tilted=int(measures[:, 2].sum()),
        thinnest=float(measures[:, 0].min()),
        volume=float(measures[:, 1].sum()),
        missing=missing,
    )


def _cells(
    group: Group, polygons: tuple[Polygon, ...], analysis: Analysis, thickness: float
) -> list[tuple[int, ConvexPiece, float, float]]:
    """Return (row, piece, height, volume) of the cells of a group that MuJoCo can hold."""
    corners = cell_corners(group, analysis.tolerance)
    length = np.ptp(group.corners, axis=1).max(axis=1)
    least = np.maximum(_THINNEST * analysis.diagonal, 2 * SLENDEREST * length)
    good = (
        (corners.depths >= least) & (corners.depths > thickness) & ~too_narrow(group.corners, group.normals, thickness)
    )
    out: list[tuple[int, ConvexPiece, float, float]] = []
    for row in np.flatnonzero(good).tolist():
        points = corners.points[row][corners.used[row]]
        mean = points.mean(axis=0)
        local, center = points - mean, group.centers[row] + mean
        local.setflags(write=False)
        center.setflags(write=False)
        piece = ConvexPiece(local, center, polygons[group.members[row]])
        out.append((row, piece, float(corners.depths[row]), float(corners.volumes[row])))
    return out
