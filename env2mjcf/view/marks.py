"""What is drawn beside the bodies: lines and dots in the world frame; what cannot be drawn is a ValueError."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..options import positive
from ..transforms import real_array

Color = tuple[float, float, float, float]

# Calm colours that stand out from the palette of bodies.
GOOD: Color = (0.18, 0.55, 0.34, 1.0)
BAD: Color = (0.83, 0.18, 0.16, 1.0)
TRAIL: Color = (0.95, 0.62, 0.07, 1.0)
WIRE: Color = (0.35, 0.38, 0.42, 0.6)


@dataclass(frozen=True, slots=True, eq=False)
class Polyline:
    """A line through points.

    Attributes:
        points: (k, 3) world positions in metres.
        color: RGBA in 0..1.
        width: Thickness, in thousandths of what the picture shows.
    """

    points: ArrayLike
    color: Color = TRAIL
    width: float = 3.0

    def __post_init__(self) -> None:
        _check(self.points, self.color, "width", self.width)

    def described(self) -> dict[str, Any]:
        """Return the mark in terms of JSON."""
        return {"kind": "line", **_described(self.points, self.color), "size": self.width}


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Dots.

    Attributes:
        points: (k, 3) world positions in metres.
        color: RGBA in 0..1.
        size: Diameter, in thousandths of what the picture shows.
    """

    points: ArrayLike
    color: Color = TRAIL
    size: float = 8.0

    def __post_init__(self) -> None:
        _check(self.points, self.color, "size", self.size)

    def described(self) -> dict[str, Any]:
        """Return the mark in terms of JSON."""
        return {"kind": "dots", **_described(self.points, self.color), "size": self.size}


@dataclass(frozen=True, slots=True, eq=False)
class Arrows:
    """Arrows that show directions, such as those of contacts.

    Attributes:
        points: (k, 3) where they begin, in metres.
        directions: (k, 3) unit vectors.
        color: RGBA in 0..1.
        length: In thousandths of what the picture shows.
    """

    points: ArrayLike
    directions: ArrayLike
    color: Color = BAD
    length: float = 60.0

    def __post_init__(self) -> None:
        _check(self.points, self.color, "length", self.length)
        if _triples("directions", self.directions).shape != _triples("points", self.points).shape:
            raise ValueError("there are not as many directions as points")

    def described(self) -> dict[str, Any]:
        """Return the mark in terms of JSON."""
        directions = _triples("directions", self.directions).tolist()
        return {"kind": "arrows", **_described(self.points, self.color), "directions": directions, "size": self.length}


Mark = Polyline | Points | Arrows


def _described(points: ArrayLike, color: Color) -> dict[str, Any]:
    return {"points": _triples("points", points).tolist(), "color": list(color)}


def _check(points: ArrayLike, color: Color, name: str, size: float) -> None:
    """Raise a ValueError or TypeError that names what cannot be drawn."""
    _triples("points", points)
    positive(name, size)
    if len(color) != 4 or not all(0 <= part <= 1 for part in color):
        raise ValueError(f"color is {color!r}; expected RGBA, four numbers from 0 to 1")


def _triples(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return positions or directions, (k, 3)."""
    found = real_array(values, f"array of {name}")
    if found.size and (found.ndim != 2 or found.shape[1] != 3):
        raise ValueError(f"{name} of shape {found.shape}; expected (k, 3)")
    return found.reshape(-1, 3)
