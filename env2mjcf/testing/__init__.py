"""Headless tests of scenes: assertions that say who touches whom, and a pytest plugin that loads scenes."""

from __future__ import annotations

from ..system.imports import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__)
