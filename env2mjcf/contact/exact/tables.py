"""All that compiled code knows of a scene, in two flat arrays: few arguments make a call from Python quick."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Any

import numpy as np

from ...geometry.topology import Floats, Ints


class Table(IntEnum):
    """The tables, in the order in which they lie in the arrays.

    Attributes:
        STEPS: (s, 8) parent, motion and columns of the steps of kinematics.
        LINKS: (l, 5) step, shape, root of the tree over the obstacles that the link is tested with, or -1; its first
            vertex and the one after the last.
        SHAPES: (k, 6) root; where walks over its tree alone begin; is it a box; does its inside count: 0 not, 1
            yes, 2 yes, though its triangles are not wound alike; its first component point and the one after the last.
        CHILDREN: (n, 8) of the nodes of the meshes' trees; see `WideTree`.
        OBSTACLES: (o, 1) shape.
        TOP_CHILDREN: (n, 8) of the trees over obstacles; a leaf is ~obstacle.
        PAIRS: (p, 2) links that are tested against each other.
        COUNTS: (1, 3) shape of the boundary (`BoundaryKind`), most entries on the stack of a walk over
            obstacles, and over meshes.
        CONSTANTS: (s, 12) constant transforms of the steps.
        HALVES: (k, 4) half sizes of each shape's box, and the diagonal of its smallest component's box.
        BOXES: (n, 48) of the nodes of the meshes' trees.
        BLOCKS: (b, 36) triangles of their leaves.
        POINTS: (c, 3) one point of each component of a shape.
        POSES: (o, 12) of obstacles.
        TOP_BOXES: (n, 48) of the nodes of the trees over obstacles.
        LIMITS: (dim, 2) least and greatest value of each degree of freedom, infinite where there is none.
        VERTICES: (v, 3) extreme vertices of each link, in the frame of its shape.
        BOUNDARY: (2, 3) lower and upper corner, infinite on axes that are not bounded; or the centre and, in the second
            row, the radius and the number of bounded axes.
    """

    STEPS = 0
    LINKS = 1
    SHAPES = 2
    CHILDREN = 3
    OBSTACLES = 4
    TOP_CHILDREN = 5
    PAIRS = 6
    COUNTS = 7
    CONSTANTS = 8
    HALVES = 9
    BOXES = 10
    BLOCKS = 11
    POINTS = 12
    POSES = 13
    TOP_BOXES = 14
    LIMITS = 15
    VERTICES = 16
    BOUNDARY = 17


WIDTHS = (8, 5, 6, 8, 1, 8, 2, 3, 12, 4, 48, 36, 3, 12, 48, 2, 3, 3)
"""Columns of each table."""

FIRST_OF_FLOATS = Table.CONSTANTS
"""The tables before it are integers."""


class BoundaryKind(IntEnum):
    """What links must stay within."""

    NONE = 0
    BOX = 1
    BALL = 2


def packed(tables: Mapping[Table, Any]) -> tuple[Ints, Floats]:
    """Put tables one after the other.

    Returns:
        The integers, which begin with where each table starts and where the last ends; and the floats.
    """
    ints: list[Ints] = []
    floats: list[Floats] = []
    starts: list[int] = []
    lengths = [2 * len(Table), 0]
    for table in Table:
        real = table >= FIRST_OF_FLOATS
        if real:
            floats.append(np.asarray(tables[table], dtype=np.float64).ravel())
        else:
            ints.append(np.asarray(tables[table], dtype=np.int64).ravel())
        count = len((floats if real else ints)[-1])
        assert count % WIDTHS[table] == 0, table
        starts += [lengths[real], count // WIDTHS[table]]
        lengths[real] += count
    return np.concatenate([np.array(starts, dtype=np.int64), *ints]), np.concatenate(floats)
