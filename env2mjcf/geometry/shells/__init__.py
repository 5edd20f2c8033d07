"""Shells: convex cells whose outer faces are exactly the polygons of a closed surface, and which lie inside it."""

from .building import Shells, shells

__all__ = ["Shells", "shells"]
