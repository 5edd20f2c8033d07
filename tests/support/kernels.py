"""Compiled functions that only others call, as Python may call them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from env2mjcf.contact.exact.kernels.pointers import grid, opened, row
from env2mjcf.contact.exact.kernels.poses import place
from env2mjcf.contact.exact.kernels.touching import holds
from env2mjcf.contact.exact.tables import INTEGERS, WIDTHS, Tables


def from_python(kernel: Any) -> Callable[..., Any]:
    """Return a function that Python can call."""

    @numba.njit
    def called(*arguments: Any) -> Any:
        return kernel(*arguments)

    return called


def views(integers: np.ndarray, floats: np.ndarray) -> Tables:
    """Return what `tables.packed` has put one after the other."""
    found = []
    for i, width in enumerate(WIDTHS):
        start, rows = integers[2 * i : 2 * i + 2]
        array = integers if i < INTEGERS else floats
        found.append(array[start : start + rows * width].reshape(rows, width))
    return Tables(*found)


@numba.njit
def place_links(integers: Any, floats: Any, q: Any, frames: Any) -> None:
    """Fill frames, (s, 12), with the world poses of all steps."""
    place(opened(integers, floats), row(q, 0), grid(frames, 0, len(frames), 12))


@numba.njit
def holds_point(integers: Any, floats: Any, shape: int, x: float, y: float, z: float, stack: Any) -> bool:
    """Return whether a point of a shape's frame lies inside of it."""
    return holds(opened(integers, floats), shape, x, y, z, row(stack, 0))
