"""How functions are compiled: without Python's lock, and with multiplications fused to additions.

MERGED: Views of the tables that `tables.packed` has put one after the other, and room to work in.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, cast

import numba
import numpy as np

from ..tables import WIDTHS, Table

F = TypeVar("F", bound=Callable[..., Any])

# Some of its options are not in its type hints.
_njit: Any = numba.njit

# Nothing here is NaN or infinite (boxes of unused lanes are far away instead), and no sum is put in another order.
_RELAXED = {"nnan", "nsz", "contract"}


def compiled(function: F) -> F:
    """Compile a function that other compiled functions call.

    It may not make or return arrays: those that it is given, and its views of them, are not counted, because counting
    them would take longer than what is done with them.
    """
    return cast(F, _njit(nogil=True, fastmath=_RELAXED, error_model="numpy", _nrt=False)(function))


def inlined(function: F) -> F:
    """Compile a function as a part of those that call it: handing all tables over takes longer than what it does."""
    return cast(F, _njit(nogil=True, fastmath=_RELAXED, error_model="numpy", _nrt=False, forceinline=True)(function))


def compiled_strictly(function: F) -> F:
    """Compile a function whose results must not depend on where it is used: each operation is rounded by itself."""
    return cast(F, _njit(nogil=True, error_model="numpy", _nrt=False)(function))


def compiled_with_arrays(function: F) -> F:
    """Compile a function that makes or returns arrays."""
    return cast(F, _njit(nogil=True, fastmath=_RELAXED, error_model="numpy")(function))


def _digest() -> int:
    """Return a number that changes with the source of any compiled function."""
    folder = Path(__file__).parent
    sources = sorted([*folder.glob("*.py"), folder.parent / "tables.py", folder.parent / "motions.py"])
    digest = hashlib.sha256(b"".join(p.read_bytes() for p in sources)).digest()
    return int.from_bytes(digest[:7], "big")


SOURCES = _digest()
"""What entries refer to, so that none is taken from the disk that was compiled of other sources.

Numba looks at the file of the entry alone, not at those of the functions that it calls; but variables of an enclosing
function are part of what it looks an entry up by.
"""


def entry(function: F) -> F:
    """Compile a function that Python calls, and keep it on disk."""
    return cast(F, _njit(nogil=True, fastmath=_RELAXED, error_model="numpy", cache=True)(function))


_WIDTHS = WIDTHS
_STEPS, _LINKS, _SHAPES, _CHILDREN = int(Table.STEPS), int(Table.LINKS), int(Table.SHAPES), int(Table.CHILDREN)
_OBSTACLES, _TOP_CHILDREN, _PAIRS = int(Table.OBSTACLES), int(Table.TOP_CHILDREN), int(Table.PAIRS)
_COUNTS, _CONSTANTS, _HALVES = int(Table.COUNTS), int(Table.CONSTANTS), int(Table.HALVES)
_BOXES, _BLOCKS, _POINTS = int(Table.BOXES), int(Table.BLOCKS), int(Table.POINTS)
_POSES, _TOP_BOXES, _LIMITS = int(Table.POSES), int(Table.TOP_BOXES), int(Table.LIMITS)
_VERTICES, _BOUNDARY = int(Table.VERTICES), int(Table.BOUNDARY)


class Tables(NamedTuple):
    """The tables of `Table`, by name."""

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


@compiled_with_arrays
def _view(array: Any, integers: Any, table: int) -> Any:
    start, rows, width = integers[2 * table], integers[2 * table + 1], _WIDTHS[table]
    return array[start : start + rows * width].reshape(rows, width)


@compiled_with_arrays
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
        _view(integers, integers, _COUNTS),
        _view(floats, integers, _CONSTANTS),
        _view(floats, integers, _HALVES),
        _view(floats, integers, _BOXES),
        _view(floats, integers, _BLOCKS),
        _view(floats, integers, _POINTS),
        _view(floats, integers, _POSES),
        _view(floats, integers, _TOP_BOXES),
        _view(floats, integers, _LIMITS),
        _view(floats, integers, _VERTICES),
        _view(floats, integers, _BOUNDARY),
    )


class Room(NamedTuple):
    """Arrays that compiled code works in, one set for each thread.

    Attributes:
        q: (dim,) a configuration.
        frames: (s, 12) world poses of all steps.
        spans: (l, 3) half the sizes of the links' boxes along the world's axes.
        top: Stack of a walk over obstacles.
        stack: Stack of a walk over meshes.
        gaps: A bound for each place on that stack, behind eight for the lanes of a node.
    """

    q: Any
    frames: Any
    spans: Any
    top: Any
    stack: Any
    gaps: Any


@compiled_with_arrays
def room_for_verdicts(tables: Tables) -> Room:
    """Return room for looking at configurations one by one, without that for edges and distances: it is made sooner."""
    nothing = np.empty(0)
    return Room(
        nothing,
        np.empty((len(tables.steps), 12)),
        np.empty((len(tables.links), 3)),
        np.empty(tables.counts[0, 1], dtype=np.int64),
        np.empty(tables.counts[0, 2], dtype=np.int64),
        nothing,
    )


@compiled_with_arrays
def room(tables: Tables) -> Room:
    """Return room to work in."""
    return Room(
        np.empty(len(tables.limits)),
        np.empty((len(tables.steps), 12)),
        np.empty((len(tables.links), 3)),
        np.empty(tables.counts[0, 1], dtype=np.int64),
        np.empty(tables.counts[0, 2], dtype=np.int64),
        np.empty(tables.counts[0, 2]),
    )
