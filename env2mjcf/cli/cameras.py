"""Cameras and sizes of pictures, as words of the command line."""

from __future__ import annotations

import math

from ..view.framing import DIRECTION_NAMES, Direction


def camera_of(word: str | None) -> str | Direction | None:
    """Return the camera that a word stands for: a name, or azimuth and elevation in degrees.

    Raises:
        ValueError: It is neither.
    """
    if word is None or word in DIRECTION_NAMES:
        return word
    try:
        azimuth, elevation = (float(part) for part in word.split(","))
    except ValueError:
        azimuth = elevation = math.nan
    if not (math.isfinite(azimuth) and -90 <= elevation <= 90):
        names = ", ".join(DIRECTION_NAMES)
        raise ValueError(f"--camera is {word}; expected {names}, or azimuth,elevation in degrees, as in 120,-35")
    return Direction(math.radians(azimuth), math.radians(elevation))


def size_of(word: str) -> tuple[int, int]:
    """Return the width and height that a word stands for.

    Raises:
        ValueError: It is no size.
    """
    parts = word.lower().split("x")
    if len(parts) != 2 or not all(p.isascii() and p.isdigit() and len(p) < 9 for p in parts):
        raise ValueError(f"--size is {word}; expected width and height in pixels, as in 1280x960")
    return int(parts[0]), int(parts[1])
