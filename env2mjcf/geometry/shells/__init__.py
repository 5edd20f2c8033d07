"""Mitred shells: convex cells whose outer faces are exactly the polygons of a closed surface."""

from .building import Shells, shells

__all__ = ["Shells", "shells"]
