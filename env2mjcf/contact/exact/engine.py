"""The exact engine: verdicts, distances and edges on triangles, by compiled code without Python's lock.

The compiled functions are imported late, compiled anew where what is kept of them is damaged, and safe at forks.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from multiprocessing import parent_process
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from ...geometry.assembly import Assembly
from ...geometry.topology import Bools
from ...kinematics.space import ConfigurationSpace
from ...pairs import Pair
from ...transforms import Array
from ..surfaces import Surfaces
from .instructions import scene_tables
from .tables import WIDTHS, Tables, packed


def available() -> bool:
    """Return whether numba, which compiles the engine, is installed."""
    return find_spec("numba") is not None


def require() -> None:
    """Raise a ValueError that says what to install, unless the engine is available."""
    if not available():
        raise ValueError("engine='exact' needs one more package: pip install 'env2mjcf[fast]'")


class ExactEngine:
    """Answers for rows of configurations; safe to share between threads.

    Args:
        assembly: The scene.
        space: Its configuration space.
        pairs: The tested pairs that move.
        surfaces: Of all bodies.

    Raises:
        ValueError: Numba is not installed.
    """

    def __init__(
        self, assembly: Assembly, space: ConfigurationSpace, pairs: Sequence[Pair], surfaces: Surfaces
    ) -> None:
        require()
        self._tables = scene_tables(assembly, space, pairs, surfaces)
        self._entries = entries()
        self._collisions, self._validities = self._entries.collisions, self._entries.validities

    def collisions(self, q: Array) -> Bools:
        """Return whether any pair touches, (n,), at configurations (n, dim)."""
        out = np.empty(len(q), dtype=np.bool_)
        # Without a further call: this may be one verdict of less than a microsecond.
        try:
            self._collisions(*self._tables, _plain(q), out)
        except Exception:
            call(self._collisions, *self._tables, _plain(q), out)
        return out

    def validities(self, q: Array) -> Bools:
        """Return whether configurations are within limits and the boundary, and no pair touches, (n,)."""
        out = np.empty(len(q), dtype=np.bool_)
        # As above.
        try:
            self._validities(*self._tables, _plain(q), out)
        except Exception:
            call(self._validities, *self._tables, _plain(q), out)
        return out

    def distances(self, q: Array) -> Array:
        """Return the least distance of any pair, (n,); inf without pairs, -1 where any touches."""
        out = np.empty(len(q))
        call(self._entries.distances, *self._tables, _plain(q), out)
        return out

    def edges_collide(self, start: Array, delta: Array, steps: NDArray[np.int64]) -> Bools:
        """Return whether any pair touches at one of so many steps, (e,), of ways from (e, dim) by (e, dim)."""
        out = np.empty(len(start), dtype=np.bool_)
        start, delta = _plain(start), _plain(delta)
        call(self._entries.edges_collide, *self._tables, start, delta, steps, out)
        return out

    def edges_are_free(
        self, start: Array, delta: Array, speeds: Array, drifts: Array, turns: Array, pair_speeds: Array, band: float
    ) -> Bools:
        """Return whether bodies provably stay apart on ways from (e, dim) by (e, dim), (e,).

        Args:
            start: (e, dim).
            delta: (e, dim).
            speeds: (e, links) bounds of how far each link moves.
            drifts: (e, links, 3) what of that is a translation with its base.
            turns: (e, links) bounds of the rest.
            pair_speeds: (e, pairs of links) bounds of how much nearer two links come.
            band: Bodies as near as this may touch.
        """
        out = np.empty(len(start), dtype=np.bool_)
        start, delta = _plain(start), _plain(delta)
        call(self._entries.edges_are_free, *self._tables, start, delta, speeds, drifts, turns, pair_speeds, band, out)
        return out


def _plain(rows: Array) -> Array:
    """Return rows as an array that may be written: numba would compile all kernels again for one that may not."""
    return rows if rows.flags.carray else np.array(rows, order="C")


def compile_all() -> float:
    """Compile everything, or take it from the disk, and return the seconds that it took.

    What is compiled is the same for every scene: tables of any kind will do, such as empty ones.
    """
    start = time.perf_counter()
    kernels, tables = entries(), packed(Tables(*(np.zeros(0) for _ in WIDTHS))._replace(counts=np.zeros(3)))
    _announce().seconds = _SECONDS_OF_ALL
    rows, answers, floats = np.zeros((0, 0)), np.zeros(0, dtype=np.bool_), np.zeros(0)
    for kernel, out in ((kernels.collisions, answers), (kernels.validities, answers), (kernels.distances, floats)):
        call(kernel, *tables, rows, out)
    call(kernels.edges_collide, *tables, rows, rows, np.zeros(0, dtype=np.int64), answers)
    call(kernels.edges_are_free, *tables, rows, rows, rows, np.zeros((0, 0, 3)), rows, rows, 0.0, answers)
    return time.perf_counter() - start


class _Loading:
    """Held while the engine is imported; a process is not forked before that is done, nor while numba compiles.

    Numba's lock, and Python's own of modules that are being imported, would stay locked in the child. Unlike what
    `system.locks.Lock` guards, what they guard cannot be begun anew.
    """

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self._compiling: Any = None

    def before_fork(self) -> None:
        """Wait until nothing is imported or compiled, and keep it so."""
        self.lock.acquire()
        # Where it is not imported, nothing compiles.
        module = sys.modules.get("numba.core.compiler_lock")
        self._compiling = getattr(module, "global_compiler_lock", None)
        if self._compiling is not None:
            self._compiling.acquire()

    def after_fork(self) -> None:
        """Go on, in the parent and in the child."""
        if self._compiling is not None:
            self._compiling.release()
        self.lock.release()


_loading = _Loading()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(
        before=_loading.before_fork, after_in_parent=_loading.after_fork, after_in_child=_loading.after_fork
    )


def entries() -> Any:
    """Return the module of compiled functions; imported when first used: numba is slow to import, and an extra.

    Raises:
        ValueError: numba finds no folder to keep them.
    """
    with _loading.lock:
        try:
            found = import_module(".kernels.entries", __package__)
            _announce()
            return found
        except RuntimeError as error:
            if "cannot cache" not in str(error):
                raise
            raise ValueError(
                "the exact engine finds no folder to keep what it compiles: name one that may be written with "
                "NUMBA_CACHE_DIR, or choose engine='mujoco'"
            ) from error


# On a core of 2020: for verdicts alone, after which proofs, distances and edges follow when they are asked for; and for
# everything.
_SECONDS, _SECONDS_OF_ALL = 6, 15


@cache
def _announce() -> Any:
    """Let whoever waits for numba be told so; nothing is said where compiled code comes from the disk.

    Once in a process, and not by workers: they would all say the same.

    Returns:
        The listener, whose `seconds` are how long it says that it takes.
    """
    events: Any = import_module("numba.core.event")

    class Told(events.Listener):
        """Says on stderr that compiling has begun, and on a terminal how far it is."""

        def __init__(self) -> None:
            self.seconds = _SECONDS
            self._said = False
            self._bar: Any = None
            self._entry: Any = None

        def on_start(self, event: Any) -> None:
            if parent_process() is not None:  # asked here, because a worker may be forked with this listener
                return
            dispatcher = event.data["dispatcher"]
            if dispatcher.py_func.__module__ != f"{__package__}.kernels.entries" or self._entry is not None:
                return
            if not hasattr(dispatcher.stats, "cache_path") or dispatcher.stats.cache_path is None:
                return  # a part of an entry
            self._entry = dispatcher
            if not self._said and sys.stderr is not None:
                self._said = True
                about = f"compiling the collision engine, once on this machine, about {self.seconds} s"
                sys.stderr.write(f"env2mjcf: {about}\n")
                sys.stderr.flush()
            if sys.stderr is not None and sys.stderr.isatty():
                self._bar = tqdm(unit=" functions", desc="compiling", leave=False)

        def on_end(self, event: Any) -> None:
            if self._bar is not None:
                self._bar.update()
            if event.data["dispatcher"] is self._entry:
                self._entry = None
                if self._bar is not None:
                    self._bar.close()
                    self._bar = None

    told = Told()
    events.register("numba:compile", told)
    return told


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


def kept_files() -> tuple[Path | None, list[Path]]:
    """Return where numba keeps what it compiles, and the files there that are of the engine, of older sources, too.

    The folder is None where nothing is kept: numba is not installed, or finds no folder.
    """
    if not available():
        return None, []
    try:
        path = entries().collisions.stats.cache_path
    except ValueError:
        return None, []
    # Beside the package the folder is Python's own __pycache__.
    return (Path(path), sorted(Path(path).glob("entries.*.nb[ci]"))) if path else (None, [])
