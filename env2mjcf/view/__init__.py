"""Pictures and films of scenes; needs the extra `view`, and GL only in processes of its own."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .film import Film as Film
    from .film import film as film
    from .framing import Direction as Direction
    from .framing import Viewpoint as Viewpoint
    from .marks import Points as Points
    from .marks import Polyline as Polyline
    from .offscreen import RenderError as RenderError
    from .picture import picture as picture
    from .segmentation import Segmentation as Segmentation
    from .segmentation import segmentation as segmentation

# Each is imported when it is first used, so that asking for one thing does not import what another needs.
_LAZY = {
    "Film": ".film",
    "film": ".film",
    "Direction": ".framing",
    "Viewpoint": ".framing",
    "Points": ".marks",
    "Polyline": ".marks",
    "RenderError": ".offscreen",
    "picture": ".picture",
    "Segmentation": ".segmentation",
    "segmentation": ".segmentation",
}


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    # A module of the same name is set on the package by its import; the function is what is meant.
    value = getattr(import_module(_LAZY[name], __name__), name)
    globals()[name] = value
    return value
