"""From the triangles of closed solids to convex cells."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...limits import Work
from ..analysis import Analysis
from ..coplanar import Polygon, bend, convex_polygons
from ..pieces import SLENDEREST, ConvexPiece, flatness, frozen_piece, prisms, too_narrow
from ..topology import Ints, edges
from .cells import Group, groups
from .corners import cell_corners
from .fitting import Surroundings, fit
from .lips import lipped
from .pairing import doubtful_polygons, pair_sides
from .splitting import split_thin

_THINNEST = 5e-6
"""Least height of a cell in units of the mesh's diagonal; below it a thin prism stands for the polygon."""

_EXACT = 2e-10
"""What counts as nothing, in units of the mesh's diagonal, where no polygon is bent by more: bent polygons and grazing
triangles, two of each at worst, must not add up to 1e-9."""


@dataclass(frozen=True, slots=True, eq=False)
class Shells:
    """The cells of a surface.

    Attributes:
        pieces: In the order of their polygons.
        pinned: How many are thin prisms, because there is no room for a cell.
        tilted: How many cells lean further than their edges ask for, to make way for another part of the surface.
        split: How many polygons are cut, because only a part of their cells would have to be thin.
        thinnest: Height of the lowest piece.
        volume: Of all cells together; where they overlap it counts once for each.
        missing: Polygons that are too small for MuJoCo.
    """

    pieces: tuple[ConvexPiece, ...]
    pinned: int
    tilted: int
    split: int
    thinnest: float
    volume: float
    missing: tuple[Polygon, ...]


def shells(analysis: Analysis, faces: Ints, thickness: float, work: Work | None = None) -> Shells:
    """Line the inside of a closed surface with convex cells, which overlap at its convex edges.

    Args:
        analysis: The mesh.
        faces: (k,) rows of `analysis.faces`, of its `solids`, to be lined.
        thickness: Height of the prisms where there is no room for a cell.
        work: What may be done; None sets no bound.

    Raises:
        TooMuchWorkError: It takes more.
    """
    work = work or Work()
    vertices, chosen = analysis.vertices, analysis.faces[faces]
    nothing = _EXACT * analysis.diagonal
    table = edges(chosen)
    polygons = convex_polygons(vertices, chosen, max(nothing, flatness(analysis.diagonal, thickness)), table)
    nothing = max(nothing, bend(vertices, polygons))
    normals = np.empty((len(chosen), 3))
    for polygon in polygons:
        normals[list(polygon.faces)] = polygon.normal
    sides = pair_sides(vertices, chosen, table, normals, work)
    # An open piece has no inside, so that it takes no room.
    cavity = analysis.solids & (analysis.component_volumes <= 0)
    solid = np.where(cavity, -1, np.arange(analysis.components))[analysis.component]
    of_polygon = solid[faces[[p.faces[0] for p in polygons]]]
    around = Surroundings(vertices[analysis.faces], solid, of_polygon, nothing, work)
    found: list[tuple[_Cell, ...]] = [()] * len(polygons)
    for group in groups(vertices, chosen, polygons, sides.slopes, sides.lips, analysis.diagonal):
        for number, cells in _fitted(group, around, polygons, analysis, thickness):
            found[number] = cells
    pieces = [[cell.piece for cell in cells] for cells in found]
    doubtful = doubtful_polygons(analysis, polygons, pieces, sides, thickness, work)
    bare, standing = list(doubtful), list(doubtful.values())
    pins = {id(p.polygon): p for p in prisms(vertices, standing, thickness, inward=True)}
    for i, polygon in zip(bare, standing, strict=True):
        pin = pins.get(id(polygon))
        found[i] = () if pin is None else (_Cell(pin, thickness, 0.0, False),)
    every = [cell for cells in found for cell in cells]
    return Shells(
        pieces=tuple(cell.piece for cell in every),
        pinned=len(pins),
        tilted=sum(cell.tilted for cell in every),
        split=sum(len(cells) > 1 for cells in found),
        thinnest=min((cell.height for cell in every), default=thickness),
        volume=sum(cell.volume for cell in every),
        missing=tuple(polygons[i] for i in bare if not found[i]),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Cell:
    """A piece, its height and volume, and whether a side is tilted."""

    piece: ConvexPiece
    height: float
    volume: float
    tilted: bool


def _fitted(
    group: Group, around: Surroundings, polygons: tuple[Polygon, ...], analysis: Analysis, thickness: float
) -> Iterator[tuple[int, tuple[_Cell, ...]]]:
    """Yield the cells under each polygon of a group for which there is room; parts after wholes."""
    wanted = group.slopes.copy()
    fit(group, around)
    for row, cell in _cells(group, around, polygons, analysis, thickness):
        yield int(group.members[row]), (cell,)
    for row, parts in split_thin(group, wanted, around, analysis.diagonal):
        cells = [cell for part in parts for _, cell in _cells(part, around, polygons, analysis, thickness)]
        if len(cells) == len(parts):
            yield int(group.members[row]), tuple(cells)


def _cells(
    group: Group, around: Surroundings, polygons: tuple[Polygon, ...], analysis: Analysis, thickness: float
) -> Iterator[tuple[int, _Cell]]:
    """Yield row and cell of those of a group that MuJoCo can hold."""
    corners = cell_corners(group, analysis.tolerance)
    length = np.ptp(group.corners, axis=1).max(axis=1)
    least = np.maximum(_THINNEST * analysis.diagonal, 2 * SLENDEREST * length)
    good = (
        (corners.depths >= least) & (corners.depths > thickness) & ~too_narrow(group.corners, group.normals, thickness)
    )
    rows = np.flatnonzero(good)
    whole = {row: (corners.points[row][corners.used[row]], float(corners.volumes[row])) for row in rows.tolist()}
    for row, points, volume in lipped(group, rows, around, analysis.diagonal, analysis.tolerance):
        whole[row] = points, volume
    for row, (points, volume) in whole.items():
        mean = points.mean(axis=0)
        piece = frozen_piece(points - mean, group.centers[row] + mean, polygons[group.members[row]])
        yield row, _Cell(piece, float(corners.depths[row]), volume, bool(group.tilted[row]))
