"""The compiled functions of the exact engine: imported late, compiled anew where the disk is damaged, safe at forks."""

from __future__ import annotations

import os
import sys
import threading
from importlib import import_module
from pathlib import Path
from typing import Any


class _Loading:
    """Held while the engine is imported; a process is not forked before that is done, nor while numba compiles.

    Numba's lock, and Python's own of modules that are being imported, would stay locked in the child. Unlike what
    `forking.Lock` guards, what they guard cannot be begun anew.
    """

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._compiling: Any = None

    def __enter__(self) -> None:
        self._lock.acquire()

    def __exit__(self, *_: object) -> None:
        self._lock.release()

    def before_fork(self) -> None:
        """Wait until nothing is imported or compiled, and keep it so."""
        self._lock.acquire()
        # Not imported by anybody: then nothing compiles.
        module = sys.modules.get("numba.core.compiler_lock")
        self._compiling = getattr(module, "global_compiler_lock", None)
        if self._compiling is not None:
            self._compiling.acquire()

    def after_fork(self) -> None:
        """Go on, in the parent and in the child."""
        if self._compiling is not None:
            self._compiling.release()
        self._lock.release()


_loading = _Loading()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(
        before=_loading.before_fork, after_in_parent=_loading.after_fork, after_in_child=_loading.after_fork
    )


def entries() -> Any:
    """Return the module of compiled functions; imported when asked for: numba is slow to import, and an extra.

    Raises:
        ValueError: numba finds no folder to keep them.
    """
    with _loading:
        try:
            return import_module(".kernels.entries", __package__)
        except RuntimeError as error:
            if "cannot cache" not in str(error):
                raise
            raise ValueError(
                "the exact engine finds no folder to keep what it compiles: name one that may be written with "
                "NUMBA_CACHE_DIR, or choose engine='mujoco'"
            ) from error


def call(entry: Any, *arguments: Any) -> None:
    """Call a compiled function; if that fails, forget what is kept of it on the disk, and compile it anew.

    Compiled functions raise nothing; what numba has written to the disk may be damaged, and then numba says so in words
    of its own. It has no checksum, so damage that can still be read is not found.
    """
    try:
        entry(*arguments)
    except Exception:
        kept = list(Path(entry.stats.cache_path).glob(f"entries.*.{entry.__name__}-*.nbi"))
        if not kept:
            raise
        for file in kept:
            file.unlink(missing_ok=True)
        entry(*arguments)
