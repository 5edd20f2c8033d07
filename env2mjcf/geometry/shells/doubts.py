"""Polygons of a folded or crossing surface under which there is no solid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...work import Work
from ..analysis import Analysis
from ..orientation import winding_numbers
from ..pieces import ConvexPiece
from ..polygons import Polygon
from ..topology import Floats, Ints, connected
from .pairing import Sides


def doubtful_polygons(
    analysis: Analysis,
    polygons: Sequence[Polygon],
    cells: Sequence[Sequence[ConvexPiece]],
    sides: Sides,
    thickness: float,
    work: Work,
) -> dict[int, Polygon]:
    """Return the polygons that no cell may stand for, by number; turned round where the solid is on the other side.

    Such are the parts of a flat cap that is folded over itself: covered twice one way, and once the other. In a
    surface without folds and crossings all cells that are linked side to side are inside or outside together,
    because no face passes through a cell: one of them is asked. Else every cell is asked.

    Args:
        analysis: The mesh.
        polygons: Of the surface.
        cells: The cells of each polygon; none where there was no room.
        sides: How faces are paired at their edges.
        thickness: Depth at which polygons without a cell are asked.
        work: What may be done.
    """
    # A surface that passes through itself, or touches itself, leaves no room for some cell, or cuts it.
    suspect = sides.folded or any(len(own) != 1 for own in cells)
    patch = np.arange(len(polygons)) if suspect else _patches(polygons, sides.links)
    some = range(len(cells)) if suspect else np.unique(patch, return_index=True)[1].tolist()
    asked = [(i, cell) for i in some for cell in cells[i]]
    insides = np.reshape([cell.center for _, cell in asked], (-1, 3))
    outside = ~_inside(analysis, insides, work)
    wrong = patch[[i for (i, _), out in zip(asked, outside.tolist(), strict=True) if out]]
    doubtful = [i for i, own in enumerate(cells) if not own or patch[i] in wrong]
    middles = np.array([analysis.vertices[list(polygons[i].loop)].mean(axis=0) for i in doubtful]).reshape(-1, 3)
    step = thickness / 2 * np.array([polygons[i].normal for i in doubtful]).reshape(-1, 3)
    turn = ~_inside(analysis, middles - step, work) & _inside(analysis, middles + step, work)
    return {
        i: replace(polygons[i], loop=polygons[i].loop[::-1], normal=-polygons[i].normal) if t else polygons[i]
        for i, t in zip(doubtful, turn.tolist(), strict=True)
    }


def _patches(polygons: Sequence[Polygon], links: Ints) -> Ints:
    """Label polygons that are linked side to side, (len(polygons),)."""
    of_face = np.empty(sum(len(p.faces) for p in polygons), dtype=np.int64)
    for i, polygon in enumerate(polygons):
        of_face[list(polygon.faces)] = i
    return connected(len(polygons), of_face[links[:, 0]], of_face[links[:, 1]])


def _inside(analysis: Analysis, points: Floats, work: Work) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    return np.abs(winding_numbers(points, analysis.vertices, analysis.faces, work)) > 0.5
