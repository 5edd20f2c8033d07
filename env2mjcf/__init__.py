"""Motion-planning environments of the Parasol Lab in MuJoCo: read, convert, load, simulate, query contacts."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from .system.imports import after_import, lazy_exports

# Nothing is loaded before it is used, so that to import env2mjcf costs next to nothing.
_export, __dir__, __all__ = lazy_exports(__name__)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version(__name__)
    return _export(name)


def _teach_byu(module: Any) -> None:
    import_module(".formats.meshes.byu", __name__).teach(module)


# trimesh reads and writes `.g` and `.byu` meshes, too, once env2mjcf is imported, before trimesh or after it.
after_import("trimesh.exchange.load", _teach_byu)
after_import("trimesh.exchange.export", _teach_byu)
