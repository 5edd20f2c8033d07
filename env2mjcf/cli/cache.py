"""`env2mjcf cache`."""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional

from .arguments import Output, OutputFlags
from .program import BAD_INPUT, DONE
from .terminal import one_line, plain, print_json, remark


@dataclass(frozen=True, slots=True)
class _Compiled:
    """What is kept of the exact engine: where, how many compiled functions, how many bytes."""

    folder: Path | None
    functions: int
    bytes: int


@dataclass(frozen=True, slots=True)
class Cache:
    """Say what is kept between runs, or remove it; or compile the exact engine, once.

    Convex pieces of meshes are in the geometry cache. Its folder is that of the platform, or the one that
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
        from ..contact.exact.engine import kept_files
        from ..geometry.store import GeometryCache, default_folder

        cache, clearing = GeometryCache(default_folder()), self.action == "clear"
        before = cache.state()
        code, files = kept_files()
        compiled = _Compiled(code, sum(f.suffix == ".nbi" for f in files), sum(map(_size, files)))
        if clearing:
            try:
                cache.clear()
                for file in files:
                    file.unlink(missing_ok=True)
            except OSError as error:
                remark(f"cache: {error}")
                return BAD_INPUT
        if self.output.json:
            removed = {"folder": before.folder, "removed": before.entries}
            print_json({**(removed if clearing else plain(before)), "compiled": compiled})
            return DONE
        folder = one_line(os.fspath(before.folder)) if before.folder else "none: there is no home folder"
        size = f"{before.entries} entries, {before.bytes / 2**20:.1f} MiB"
        engine = f"{compiled.functions} compiled functions, {compiled.bytes / 2**20:.1f} MiB"
        where = one_line(os.fspath(code)) if code else "nowhere: numba is not installed, or has no folder"
        if clearing:
            print(f"removed {size} from {folder}")
            print(f"removed {engine} from {where}")
        else:
            print(f"folder  {folder}\nholds   {size}\nlimit   {before.limit / 2**20:.0f} MiB")
            print(f"engine  {engine}\nkept    {where}")
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


def _size(file: Path) -> int:
    with suppress(FileNotFoundError):  # another process may have removed it since
        return file.stat().st_size
    return 0
