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
        LINKS: (l, 3) step, shape, and root of the tree over the obstacles that the link is tested with, or -1.
        SHAPES: (k, 6) root, is it a box, does its inside count, first component point and the one after the last,
            is it convex.
        CHILDREN: (n, 8) of the nodes of the meshes' trees; see `WideTree`.
        OBSTACLES: (o, 1) shape.
        TOP_CHILDREN: (n, 8) of the trees over obstacles; a leaf is ~obstacle.
        PAIRS: (p, 2) links that are tested against each other.
        SCALARS: (1, 2) most entries on the stack of a walk over obstacles, and over meshes.
        CONSTANTS: (s, 12) constant transforms of the steps.
        HALVES: (k, 4) half sizes of each shape's box, and the diagonal of its smallest component's box.
        BOXES: (n, 48) of the nodes of the meshes' trees.
        BLOCKS: (b, 36) triangles of their leaves.
        POINTS: (c, 3) one point of each component of a shape.
        POSES: (o, 12) of obstacles.
        TOP_BOXES: (n, 48) of the nodes of the trees over obstacles.
    """

    STEPS = 0
    LINKS = 1
    SHAPES = 2
    CHILDREN = 3
    OBSTACLES = 4
    TOP_CHILDREN = 5
    PAIRS = 6
    SCALARS = 7
    CONSTANTS = 8
    HALVES = 9
    BOXES = 10
    BLOCKS = 11
    POINTS = 12
    POSES = 13
    TOP_BOXES = 14


WIDTHS = (8, 3, 6, 8, 1, 8, 2, 2, 12, 4, 48, 36, 3, 12, 48)
"""Columns of each table."""

FIRST_OF_FLOATS = Table.CONSTANTS
"""The tables before it are integers."""


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
        kind = table >= FIRST_OF_FLOATS
        values = np.ascontiguousarray(tables[table], dtype=np.float64 if kind else np.int64).reshape(-1)
        assert len(values) % WIDTHS[table] == 0, table
        starts += [lengths[kind], len(values) // WIDTHS[table]]
        lengths[kind] += len(values)
        (floats if kind else ints).append(values)
    return np.concatenate([np.array(starts, dtype=np.int64), *ints]), np.concatenate(floats)
