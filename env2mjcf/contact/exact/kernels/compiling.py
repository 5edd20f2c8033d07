"""How functions are compiled, without Python's lock and with multiplications fused to additions; and what they work on.

That is views of the tables that `tables.packed` has put one after the other, and room to work in.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, cast

import numba
import numpy as np

from ..tables import WIDTHS, Tables

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


@compiled_with_arrays
def _view(array: Any, integers: Any, table: int) -> Any:
    start, rows, width = integers[2 * table], integers[2 * table + 1], WIDTHS[table]
    return array[start : start + rows * width].reshape(rows, width)


@compiled_with_arrays
def opened(integers: Any, floats: Any) -> Tables:
    """Return views of all tables."""
    return Tables(
        _view(integers, integers, 0),
        _view(integers, integers, 1),
        _view(integers, integers, 2),
        _view(integers, integers, 3),
        _view(integers, integers, 4),
        _view(integers, integers, 5),
        _view(integers, integers, 6),
        _view(integers, integers, 7),
        _view(floats, integers, 8),
        _view(floats, integers, 9),
        _view(floats, integers, 10),
        _view(floats, integers, 11),
        _view(floats, integers, 12),
        _view(floats, integers, 13),
        _view(floats, integers, 14),
        _view(floats, integers, 15),
        _view(floats, integers, 16),
        _view(floats, integers, 17),
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
