"""Paths from start to goal, by the planners of OMPL (the extra `planning`) and by one of our own."""

from __future__ import annotations

from ..system.imports import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__)
