"""Pictures and films of scenes; needs the extra `view`, and GL only in processes of its own."""

from __future__ import annotations

from ..system.imports import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__)
