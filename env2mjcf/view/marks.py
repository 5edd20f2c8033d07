"""What is drawn beside the bodies: lines and dots in the world frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

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

    def described(self) -> dict[str, Any]:
        """Return the mark in terms of JSON."""
        directions = np.asarray(self.directions, dtype=np.float64).reshape(-1, 3).tolist()
        return {
            "kind": "arrows",
            **_described(self.points, self.color),
            "directions": directions,
            "size": self.length,
        }


Mark = Polyline | Points | Arrows


def _described(points: ArrayLike, color: Color) -> dict[str, Any]:
    return {"points": np.asarray(points, dtype=np.float64).reshape(-1, 3).tolist(), "color": list(color)}
