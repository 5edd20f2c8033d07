"""`env2mjcf cache`."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Annotated, Literal

from tyro.conf import Positional

from .arguments import Output, OutputFlags
from .program import BAD_INPUT, DONE
from .terminal import one_line, print_json, remark


@dataclass(frozen=True, slots=True)
class Cache:
    """Say what the geometry cache holds, or empty it; or compile the exact engine, once.

    The cache keeps convex pieces of meshes between runs. Its folder is that of the platform, or the one that
    ENV2MJCF_CACHE_DIR names. With --no-cache, a verb that loads scenes leaves it alone.

    The exact engine is compiled by numba at its first use, and kept beside the installed package (else where
    NUMBA_CACHE_DIR says); "warm" does that now instead of at the first query.

    Examples:
      env2mjcf cache info
      env2mjcf cache clear
      env2mjcf cache warm

    Attributes:
        action: What to do.
    """

    action: Annotated[Literal["info", "clear", "warm"], Positional]
    output: OutputFlags = field(default_factory=Output)

    def run(self) -> int:
        """Do it."""
        if self.action == "warm":
            return self._warm()
        from ..geometry.store import GeometryCache, default_folder

        cache = GeometryCache(default_folder())
        before = cache.state()
        if self.action == "clear":
            try:
                cache.clear()
            except OSError as error:
                remark(f"cache: {error}")
                return BAD_INPUT
        if self.output.json:
            print_json(before if self.action == "info" else {"folder": before.folder, "removed": before.entries})
            return DONE
        folder = one_line(os.fspath(before.folder)) if before.folder else "none: there is no home folder"
        size = f"{before.entries} entries, {before.bytes / 2**20:.1f} MiB"
        if self.action == "clear":
            print(f"removed {size} from {folder}")
        else:
            print(f"folder  {folder}\nholds   {size}\nlimit   {before.limit / 2**20:.0f} MiB")
        return DONE

    def _warm(self) -> int:
        from ..contact.exact.engine import compile_all, require

        require()
        seconds = compile_all()
        if self.output.json:
            print_json({"seconds": seconds})
        else:
            print(f"the exact engine is ready ({seconds:.1f} s)")
        return DONE
