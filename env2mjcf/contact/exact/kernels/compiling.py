"""How functions are compiled: without Python's lock, kept between runs, and with multiplications fused to additions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])

# Nothing here is NaN or infinite (boxes of unused lanes are far away instead), and no sum is put in another order.
_RELAXED = {"nnan", "nsz", "contract"}


def compiled(function: F) -> F:
    """Compile a function that other compiled functions call."""
    return cast(F, numba.njit(nogil=True, fastmath=_RELAXED, error_model="numpy")(function))


def compiled_strictly(function: F) -> F:
    """Compile a function whose results must not depend on where it is used: each operation is rounded by itself."""
    return cast(F, numba.njit(nogil=True, error_model="numpy")(function))


def entry(function: F) -> F:
    """Compile a function that Python calls, and keep it on disk."""
    return cast(F, numba.njit(nogil=True, fastmath=_RELAXED, error_model="numpy", cache=True)(function))
