"""All that compiled code knows of a scene, in two flat arrays: few arguments make a call from Python quick."""

from __future__ import annotations

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from ...geometry.topology import Floats, Ints

LANES = 8
"""Boxes of a node of a tree."""

BLOCK = 4
"""Triangles of a leaf."""

# Columns of `Tables.links`, and of `Tables.shapes`.
STEP, SHAPE, TOP, FIRST_VERTEX, LAST_VERTEX = 0, 1, 2, 3, 4
ROOT, START, IS_BOX, IS_SOLID, FIRST_POINT, LAST_POINT, ENCLOSING = 0, 1, 2, 3, 4, 5, 6


class Tables(NamedTuple):
    """The tables, in the order in which they lie in the arrays; the first eight are integers.

    Attributes:
        steps: (s, 8) parent, motion and columns of the steps of kinematics.
        links: (l, 5) step, shape, root of the tree over the obstacles that the link is tested with, or -1; its first
            vertex and the one after the last.
        shapes: (k, 7) root; where walks over its tree alone begin; is it a box; does its inside count: 0 not, 1
            yes, 2 yes, though its triangles are not wound alike; its first component point and the one after the last;
            where walks begin that look at the triangles of its closed pieces alone.
        children: (n, 8) of the nodes of the meshes' trees; see `WideTree`.
        obstacles: (o, 1) shape.
        top_children: (n, 8) of the trees over obstacles; a leaf is ~obstacle.
        pairs: (p, 2) links that are tested against each other.
        counts: (1, 3) shape of the boundary (`BoundaryKind`), most entries on the stack of a walk over
            obstacles, and over meshes.
        constants: (s, 12) constant transforms of the steps.
        halves: (k, 4) half sizes of each shape's box, and the diagonal of its smallest component's box.
        boxes: (n, 48) of the nodes of the meshes' trees.
        blocks: (b, 36) triangles of their leaves.
        points: (c, 3) one point of each component of a shape.
        poses: (o, 12) of obstacles.
        top_boxes: (n, 48) of the nodes of the trees over obstacles.
        limits: (dim, 2) least and greatest value of each degree of freedom, infinite where there is none.
        vertices: (v, 3) extreme vertices of each link, in the frame of its shape.
        boundary: (2, 3) lower and upper corner, infinite on axes that are not bounded; or the centre and, in the second
            row, the radius and the number of bounded axes.
    """

    steps: Any
    links: Any
    shapes: Any
    children: Any
    obstacles: Any
    top_children: Any
    pairs: Any
    counts: Any
    constants: Any
    halves: Any
    boxes: Any
    blocks: Any
    points: Any
    poses: Any
    top_boxes: Any
    limits: Any
    vertices: Any
    boundary: Any


WIDTHS = (8, 5, 7, 8, 1, 8, 2, 3, 12, 4, 48, 36, 3, 12, 48, 2, 3, 3)
"""Columns of each table."""

INTEGERS = 8
"""How many tables, the first ones, are integers."""


class BoundaryKind(IntEnum):
    """What links must stay within."""

    NONE = 0
    BOX = 1
    BALL = 2


def packed(tables: Tables) -> tuple[Ints, Floats]:
    """Put tables, of anything array-like, one after the other.

    Returns:
        The integers, which begin with where each table starts and how many rows it has; and the floats.
    """
    ints: list[Ints] = [np.asarray(t, dtype=np.int64).ravel() for t in tables[:INTEGERS]]
    floats: list[Floats] = [np.asarray(t, dtype=np.float64).ravel() for t in tables[INTEGERS:]]
    starts: list[int] = []
    start = 2 * len(WIDTHS)
    for i, flat in enumerate((*ints, *floats)):
        start = 0 if i == INTEGERS else start
        assert len(flat) % WIDTHS[i] == 0, Tables._fields[i]
        starts += [start, len(flat) // WIDTHS[i]]
        start += len(flat)
    return np.concatenate([np.array(starts, dtype=np.int64), *ints]), np.concatenate(floats)
