"""Hides the packages that ENV2MJCF_TEST_WITHOUT names, as if they were not installed.

Python imports this at every start while this folder is on PYTHONPATH, so that the children of a test miss them too.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType

HIDDEN = frozenset(name for name in os.environ.get("ENV2MJCF_TEST_WITHOUT", "").split(",") if name)


class Seeing(PathFinder):
    """Finds everything but what is hidden; an import of that fails, and `find_spec` gives None."""

    @classmethod
    def find_spec(
        cls, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname.partition(".")[0] in HIDDEN:
            return None
        return super().find_spec(fullname, path, target)


if HIDDEN:
    sys.meta_path[:] = [Seeing if finder is PathFinder else finder for finder in sys.meta_path]
