"""Views of the tables that `tables.packed` has put one after the other."""

from __future__ import annotations

from typing import Any, NamedTuple

from ..tables import WIDTHS, Table
from .compiling import compiled

_WIDTHS = WIDTHS
_STEPS, _LINKS, _SHAPES, _CHILDREN = int(Table.STEPS), int(Table.LINKS), int(Table.SHAPES), int(Table.CHILDREN)
_OBSTACLES, _TOP_CHILDREN, _PAIRS = int(Table.OBSTACLES), int(Table.TOP_CHILDREN), int(Table.PAIRS)
_SCALARS, _CONSTANTS, _HALVES = int(Table.SCALARS), int(Table.CONSTANTS), int(Table.HALVES)
_BOXES, _BLOCKS, _POINTS = int(Table.BOXES), int(Table.BLOCKS), int(Table.POINTS)
_POSES, _TOP_BOXES = int(Table.POSES), int(Table.TOP_BOXES)


class Tables(NamedTuple):
    """The tables of `Table`, by name."""

    steps: Any
    links: Any
    shapes: Any
    children: Any
    obstacles: Any
    top_children: Any
    pairs: Any
    scalars: Any
    constants: Any
    halves: Any
    boxes: Any
    blocks: Any
    points: Any
    poses: Any
    top_boxes: Any


@compiled
def _view(array: Any, integers: Any, table: int) -> Any:
    start, rows, width = integers[2 * table], integers[2 * table + 1], _WIDTHS[table]
    return array[start : start + rows * width].reshape(rows, width)


@compiled
def opened(integers: Any, floats: Any) -> Tables:
    """Return views of all tables."""
    return Tables(
        _view(integers, integers, _STEPS),
        _view(integers, integers, _LINKS),
        _view(integers, integers, _SHAPES),
        _view(integers, integers, _CHILDREN),
        _view(integers, integers, _OBSTACLES),
        _view(integers, integers, _TOP_CHILDREN),
        _view(integers, integers, _PAIRS),
        _view(integers, integers, _SCALARS),
        _view(floats, integers, _CONSTANTS),
        _view(floats, integers, _HALVES),
        _view(floats, integers, _BOXES),
        _view(floats, integers, _BLOCKS),
        _view(floats, integers, _POINTS),
        _view(floats, integers, _POSES),
        _view(floats, integers, _TOP_BOXES),
    )
