"""Decimals that read back as the numbers they were written for."""

from __future__ import annotations

import math

_NEIGHBOURS = 4


def decimal(value: float, unit: float = 1.0) -> str:
    """Return the shortest decimal that, multiplied by `unit` as readers do, is a value again to the last bit.

    Not every double is such a product: where there is none within four neighbours, the nearest, which is one unit of
    the last place off at most. A value that was read with the same unit always comes back.

    Args:
        value: A finite number: an angle in radians, or a length.
        unit: Radians per unit of the file; 1 for lengths.
    """
    if unit == 1.0:
        return short(value)
    quotient = value / unit
    for digits in range(1, 18):
        rounded = float(f"{quotient:.{digits}g}")
        if rounded * unit == value:
            return short(rounded)
    candidates = [quotient]
    for towards in (-math.inf, math.inf):
        near = quotient
        for _ in range(_NEIGHBOURS):
            near = math.nextafter(near, towards)
            candidates.append(near)
    return short(min(candidates, key=lambda x: abs(x * unit - value)))


def settled(value: float, unit: float = 1.0) -> float:
    """Return what the decimal of a value reads as: the value itself wherever some decimal does."""
    return float(decimal(value, unit)) * unit


def short(value: float) -> str:
    """Return the shortest decimal of a double, integers without a point."""
    text = repr(float(value))
    return text.removesuffix(".0")
