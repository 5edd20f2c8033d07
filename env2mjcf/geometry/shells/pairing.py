"""Where the solid is: which two faces bound it at an edge, how the sides of their cells lean there, and which polygons
of a folded or crossing surface have no solid under them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...limits import Work
from ..analysis import Analysis
from ..coplanar import Polygon
from ..orientation import encloses
from ..pieces import ConvexPiece
from ..topology import Edges, Floats, Ints, connected, facing

# Angles between the faces of a solid from which on an edge counts as blunt: sides that follow the neighbour would reach
# far beyond the polygon, and cost time.
_BLUNT = 0.9 * np.pi

_LEAN = np.radians(3.0)
"""Angle between a face and a lip of its cell. MuJoCo takes faces within 5.13 degrees for parallel (`mjFACE_TOL`), and
then uses the normal of the second geom's face."""

FLAT = -1 / np.tan(_LEAN)
"""Slope of such a lip."""


@dataclass(frozen=True, slots=True, eq=False)
class Sides:
    """What happens at each edge of each face.

    Attributes:
        slopes: (m, 3) how much the cell of the face recedes per unit of depth at each edge; negative where it grows.
        lips: (m, 3) the same for its lip there, if the edge is nearly flat; else infinite.
        links: (p, 2) pairs of faces that bound the same wedge of the solid at some edge.
        folded: Whether faces lie upon each other at some edge.
    """

    slopes: Floats
    lips: Floats
    links: Ints
    folded: bool


def pair_sides(vertices: Floats, faces: Ints, table: Edges, normals: Floats, work: Work) -> Sides:
    """Find the partner of each face at each of its edges, and how the cell's side leans there.

    At a convex edge the side lies in the partner's face, and leans outward at an obtuse one, so that the cell fills
    the wedge between the two, and the partner's cell does too. Bisector planes between them would make blades of the
    cells: a body that lies on one face would touch with the blades of all others, and several contacts of a blade get
    the normal of its own side, not of the face. At blunt, flat, reflex and open edges the side goes straight down.

    A body that slides over an upright side gets caught. So where two faces fold by little, either way, the side begins
    with a lip, which reaches under the neighbour, in its plane or three degrees below the face, whichever is lower.

    Where more than two faces meet, the partner of a face is the one that `facing` finds.

    Args:
        vertices: (n, 3).
        faces: (m, 3) counter-clockwise from outside.
        table: `edges(faces)`.
        normals: (m, 3) unit normals.
        work: What may be done.

    Raises:
        TooMuchWorkError: So many faces meet at edges that it takes more.
    """
    work.spend(int((table.faces**2).sum()))
    here, there, angle, folded = facing(vertices, faces, table, normals)
    slopes = np.zeros(faces.size)
    convex = angle < _BLUNT
    slopes[here[convex]] = 1 / np.tan(angle[convex])
    lips = np.full(faces.size, np.inf)
    shallow = ~convex & (angle <= 2 * np.pi - _BLUNT)
    lips[here[shallow]] = -1 / np.tan(np.maximum(np.pi - angle[shallow], _LEAN))
    links = np.stack([here // 3, there // 3], axis=1)
    return Sides(slopes.reshape(-1, 3), lips.reshape(-1, 3), links, folded)


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
    because no face passes through a cell: one of them is looked at. Else every cell is.

    Args:
        analysis: The mesh.
        polygons: Of the surface.
        cells: The cells of each polygon; none where there was no room.
        sides: How faces are paired at their edges.
        thickness: Depth at which polygons without a cell are looked at.
        work: What may be done.
    """
    # A surface that passes through itself, or touches itself, leaves no room for some cell, or cuts it.
    suspect = sides.folded or any(len(own) != 1 for own in cells)
    patch = np.arange(len(polygons)) if suspect else _patches(polygons, sides.links)
    some = range(len(cells)) if suspect else np.unique(patch, return_index=True)[1].tolist()
    tested = [(i, cell) for i in some for cell in cells[i]]
    insides = np.reshape([cell.center for _, cell in tested], (-1, 3))
    surface = analysis.enclosing
    outside = ~encloses(analysis.vertices, surface, insides, work)
    wrong = patch[[i for (i, _), out in zip(tested, outside.tolist(), strict=True) if out]]
    doubtful = [i for i, own in enumerate(cells) if not own or patch[i] in wrong]
    middles = np.array([analysis.vertices[list(polygons[i].loop)].mean(axis=0) for i in doubtful]).reshape(-1, 3)
    step = thickness / 2 * np.array([polygons[i].normal for i in doubtful]).reshape(-1, 3)
    under, over = (encloses(analysis.vertices, surface, p, work) for p in (middles - step, middles + step))
    turn = ~under & over
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
