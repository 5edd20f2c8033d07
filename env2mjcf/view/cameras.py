"""Where to look from: cameras that have everything in view."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from ..mjcf.scenery import OVERVIEW
from ..transforms import Array

# Vertical field of view in radians: narrow, so that parallels stay nearly so.
FIELD_OF_VIEW = math.radians(36.0)
# Share of the picture that stays free on each side.
_MARGIN = 0.04


@dataclass(frozen=True, slots=True)
class Direction:
    """A line of sight; how far away the camera is follows from what it is to see.

    Attributes:
        azimuth: Radians; 0 looks along x, pi/2 along y.
        elevation: Radians; negative looks down.
    """

    azimuth: float
    elevation: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.azimuth) and math.isfinite(self.elevation)):
            raise ValueError(f"a direction of {self.azimuth}, {self.elevation}; expected finite angles")

    def forward(self) -> Array:
        """Return the unit vector, (3,)."""
        # Straight down has no azimuth: a thousandth of a radian less has one.
        e = math.copysign(min(abs(self.elevation), math.pi / 2 - 1e-3), self.elevation)
        return np.array([math.cos(e) * math.cos(self.azimuth), math.cos(e) * math.sin(self.azimuth), math.sin(e)])


@dataclass(frozen=True, slots=True)
class Viewpoint:
    """A camera without roll: the world's z axis points up in the picture.

    Attributes:
        position: World position in metres.
        forward: Unit vector of the line of sight.
    """

    position: tuple[float, float, float]
    forward: tuple[float, float, float]

    def __post_init__(self) -> None:
        for name, value in (("position", self.position), ("forward", self.forward)):
            if len(value) != 3 or not all(math.isfinite(x) for x in value):
                raise ValueError(f"{name} is {value!r}; expected three finite numbers")


# As the camera of that name in the MJCF.
_OVERVIEW = Direction(math.atan2(-OVERVIEW[1], -OVERVIEW[0]), -math.atan2(OVERVIEW[2], math.hypot(*OVERVIEW[:2])))
_NAMED = {
    "overview": _OVERVIEW,
    "front": Direction(math.pi / 2, -0.2),
    "back": Direction(-math.pi / 2, -0.2),
    "left": Direction(0.0, -0.2),
    "right": Direction(math.pi, -0.2),
    "top": Direction(math.pi / 2, -math.pi / 2),
}
DIRECTION_NAMES = tuple(_NAMED)

# What a camera may be chosen by.
Camera = Viewpoint | Direction | str


def named_direction(name: str) -> Direction:
    """Return the line of sight that a name stands for.

    Raises:
        ValueError: There is no such name.
    """
    if name not in _NAMED:
        raise ValueError(f"there is no camera {name!r}; expected one of {', '.join(_NAMED)}")
    return _NAMED[name]


def candidates(planar: bool) -> list[Direction]:
    """Return lines of sight in the order of preference.

    Args:
        planar: Whether robots move in the plane only, so that walls stand around them: looked at from further above.
    """
    elevations = (-1.1, _OVERVIEW.elevation, -1.45) if planar else (_OVERVIEW.elevation, -1.0, -0.25, 0.3)
    turns = (0.0, -0.9, 0.9, math.pi, math.pi - 0.9, math.pi + 0.9)
    return [Direction(_OVERVIEW.azimuth + t, e) for e in elevations for t in turns]


def fitted(points: Array, direction: Direction, aspect: float) -> Viewpoint:
    """Return the nearest camera that looks in a direction and sees all points.

    In the camera's frame the four sides of its pyramid are planes, so that the nearest position follows from the
    greatest distance of a point along the normal of each.

    Args:
        points: (n, 3) world positions, n > 0.
        direction: The line of sight.
        aspect: Width of the picture divided by its height.
    """
    forward = direction.forward()
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    x, y, depth = points @ right, points @ up, points @ forward
    tangent = math.tan(FIELD_OF_VIEW / 2) * (1 - 2 * _MARGIN)
    across, back_x = _centred(x, depth, tangent * aspect)
    along, back_y = _centred(y, depth, tangent)
    # Even a single point is seen from a distance.
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    back = max(back_x, back_y, 1e-3 * size - float(depth.min()) + 1e-9)
    position = across * right + along * up - back * forward
    return Viewpoint(_triple(position), _triple(forward))


def box_corners(lower: Array, upper: Array) -> Array:
    """Return the corners of a box, (8, 3)."""
    return np.array(list(itertools.product(*zip(lower, upper, strict=True))))


def _centred(side: Array, depth: Array, tangent: float) -> tuple[float, float]:
    """Return where a camera is to stand sideways, and how far behind the origin, to see points between two planes."""
    most, least = float((side - tangent * depth).max()), float((-side - tangent * depth).max())
    return (most - least) / 2, (most + least) / (2 * tangent)


def _triple(vector: Array) -> tuple[float, float, float]:
    return float(vector[0]), float(vector[1]), float(vector[2])
