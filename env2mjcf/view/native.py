"""MuJoCo's own viewer, for those who sit before a screen; apart, because `mujoco.viewer` opens GL when imported."""

from __future__ import annotations

import os
import sys

from ..simulation.scene import Scene
from ..transforms import Array


def has_display() -> bool:
    """Return whether a window can be opened; only on Linux it may not."""
    return not sys.platform.startswith("linux") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def require_display() -> None:
    """Make sure that a window can be opened.

    Raises:
        ValueError: There is no display.
    """
    if not has_display():
        raise ValueError("--native opens a window, and there is no display: leave it out for the web page")


def show(scene: Scene, q: Array) -> None:
    """Open a window on a scene that begins at q, (dim,), and wait until it is closed."""
    from mujoco import viewer

    scene.set(q)
    viewer.launch(scene.model, scene.data)
