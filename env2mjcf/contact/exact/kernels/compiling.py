"""How functions are compiled, without Python's lock and with fused multiplications; and room to work in."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, cast

import numba

from ..tables import Tables
from .linking import INNER, OUTER
from .pointers import grid, row

F = TypeVar("F", bound=Callable[..., Any])

# Some of its options are not in its type hints.
_njit: Any = numba.njit

# Nothing here is NaN or infinite (boxes of unused lanes are far away instead), and no sum is put in another order.
_RELAXED = {"nnan", "nsz", "contract"}
_PART: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": False, **INNER}


def compiled(function: F) -> F:
    """Compile a function that other compiled functions call.

    It may not make or return arrays: those that it is given, and its views of them, are not counted, because counting
    them would take longer than what is done with them.
    """
    return cast(F, _njit(fastmath=_RELAXED, **_PART)(function))


def inlined(function: F) -> F:
    """Compile a function as a part of those that call it: handing all tables over takes longer than what it does."""
    return cast(F, _njit(fastmath=_RELAXED, forceinline=True, **_PART)(function))


def compiled_strictly(function: F) -> F:
    """Compile a function whose results must not depend on where it is used: each operation is rounded by itself."""
    return cast(F, _njit(**_PART)(function))


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
    return cast(F, _njit(nogil=True, fastmath=_RELAXED, error_model="numpy", cache=True, **OUTER)(function))


class Room(NamedTuple):
    """Where compiled code works, one for each thread.

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


@compiled
def floats_of_room(tables: Tables) -> int:
    """Return how many floats room for verdicts takes; for distances and edges, `counts[0, 2]` more."""
    return len(tables.limits) + 12 * len(tables.steps) + 3 * len(tables.links)


@compiled
def integers_of_room(tables: Tables) -> int:
    """Return how many integers room takes."""
    return tables.counts[0, 1] + tables.counts[0, 2]


@compiled
def room_in(tables: Tables, floats: Any, integers: Any) -> Room:
    """Return room in two arrays, which must live as long."""
    frames = len(tables.limits)
    spans = frames + 12 * len(tables.steps)
    return Room(
        row(floats, 0),
        grid(floats, frames, len(tables.steps), 12),
        grid(floats, spans, len(tables.links), 3),
        row(integers, 0),
        row(integers, tables.counts[0, 1]),
        row(floats, floats_of_room(tables)),
    )
