"""Pictures and films of scenes; needs the extra `view`, and GL only in processes of its own."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .films import Film as Film
    from .films import film as film
    from .framing import Direction as Direction
    from .framing import Viewpoint as Viewpoint
    from .labels import Segmentation as Segmentation
    from .labels import segmentation as segmentation
    from .marks import Points as Points
    from .marks import Polyline as Polyline
    from .offscreen import RenderError as RenderError
    from .pictures import picture as picture

# Each is imported when it is first used, so that asking for one thing does not import what another needs.
_LAZY = {
    "Film": ".films",
    "film": ".films",
    "Direction": ".framing",
    "Viewpoint": ".framing",
    "Points": ".marks",
    "Polyline": ".marks",
    "RenderError": ".offscreen",
    "picture": ".pictures",
    "Segmentation": ".labels",
    "segmentation": ".labels",
}


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_LAZY[name], __name__), name)
    globals()[name] = value
    return value
