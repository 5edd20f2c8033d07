"""Arguments that are numbers: those that are none, or out of range, are refused by name."""

from __future__ import annotations

import math
from numbers import Integral, Real


def whole(name: str, value: object, least: int, most: int | None = None) -> int:
    """Return an argument that is a whole number.

    Raises:
        TypeError: It is none (True and 2.0 are not); the message names it.
        ValueError: It is below `least` or above `most`.
    """
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise TypeError(f"{name} is {value!r}; expected a whole number")
    number = int(value)
    if number < least or (most is not None and number > most):
        raise ValueError(f"{name} is {number}; expected {_range(str(least), most)}")
    return number


def positive(name: str, value: object, most: float | None = None) -> float:
    """Return an argument that is a finite number above zero.

    Raises:
        TypeError: It is no number; the message names it.
        ValueError: It is not positive, not finite, or above `most`.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"{name} is {value!r}; expected a number")
    number = float(value)
    if not 0 < number < math.inf or (most is not None and number > most):
        limit = "" if most is None else f" up to {most:g}"
        raise ValueError(f"{name} is {value}; expected a positive number{limit}")
    return number


def _range(least: str, most: int | None) -> str:
    return f"at least {least}" if most is None else f"{least} to {most}"
