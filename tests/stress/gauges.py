"""What a process holds: memory, descriptors, threads, children, files; and how fast it grows. Linux only."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import threading
import time
from dataclasses import dataclass, fields
from pathlib import Path

import mujoco
import numpy as np

_PAGE = os.sysconf("SC_PAGE_SIZE")


@dataclass(frozen=True, slots=True)
class Reading:
    """What was held at one moment, between two operations.

    Attributes:
        seconds: When.
        operations: How many operations were done by then.
        memory: Resident bytes of this process.
        children_memory: The same of all its children.
        descriptors, threads, children: How many are open, or alive.
        files: How many files and folders lie in the folder for temporary ones.
        objects: How many objects the garbage collector knows.
    """

    seconds: float
    operations: int
    memory: int
    children_memory: int
    descriptors: int
    threads: int
    children: int
    files: int
    objects: int


# What must not change at all, however long a process lives.
COUNTS = ("descriptors", "threads", "children", "files")


class Gauges:
    """Reads what this process holds.

    Args:
        temporary: The folder of temporary files.

    Attributes:
        largest_cache: Bytes that MuJoCo's own cache of assets held at most.
    """

    def __init__(self, temporary: Path) -> None:
        self._temporary = temporary
        self._began = time.monotonic()
        self._libc = ctypes.CDLL(None)
        self.largest_cache = 0

    def read(self, operations: int) -> Reading:
        """Return a reading, after all garbage is collected and given back."""
        gc.collect()
        # MuJoCo keeps the assets of every folder that a model was loaded from, up to 500 MiB: its cache, and bounded.
        self.largest_cache = max(self.largest_cache, mujoco.mj_getCacheSize(mujoco.mj_getCache()))
        mujoco.mj_clearCache(mujoco.mj_getCache())
        # Without this, freed memory that the C library keeps for later looks like a leak, and comes and goes.
        if hasattr(self._libc, "malloc_trim"):
            self._libc.malloc_trim(0)
        children = child_processes()
        return Reading(
            time.monotonic() - self._began,
            operations,
            _resident(os.getpid()),
            sum(map(_resident, children)),
            # The listing itself holds one.
            len(os.listdir("/proc/self/fd")) - 1,
            threading.active_count(),
            len(children),
            sum(1 for _ in self._temporary.rglob("*")),
            len(gc.get_objects()),
        )


def child_processes() -> list[int]:
    """Return the children of this process, whichever thread of it started them."""
    found: list[int] = []
    for task in Path("/proc/self/task").iterdir():
        with contextlib.suppress(FileNotFoundError):  # the thread has ended
            found += map(int, (task / "children").read_text().split())
    return found


def _resident(process: int) -> int:
    try:
        return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * _PAGE
    except (FileNotFoundError, ProcessLookupError):
        return 0


def slope(readings: list[Reading], name: str, per: str = "operations") -> float:
    """Return how much of something each operation (or second) adds: the median over all pairs of readings.

    One reading in the middle of a burst does not tilt it, as it would the line of least squares.
    """
    x = np.array([getattr(r, per) for r in readings], dtype=float)
    y = np.array([getattr(r, name) for r in readings], dtype=float)
    i, j = np.triu_indices(len(x), 1)
    apart = x[j] > x[i]
    return float(np.median((y[j] - y[i])[apart] / (x[j] - x[i])[apart])) if apart.any() else 0.0


def steady_slope(readings: list[Reading], name: str) -> float:
    """Return how much of something each operation adds in either half: what comes once, and stays, is not a leak."""
    middle = len(readings) // 2
    return min(slope(readings[: middle + 1], name), slope(readings[middle:], name))


def grown(readings: list[Reading]) -> list[str]:
    """Return a sentence on each count that is higher in every late reading than in any early one."""
    quarter = max(1, len(readings) // 4)
    early, late = readings[:quarter], readings[-quarter:]
    found: list[str] = []
    for name in COUNTS:
        most, least = max(getattr(r, name) for r in early), min(getattr(r, name) for r in late)
        if least > most:
            found.append(f"{name} grew from {most} to {least}")
    return found


def table(readings: list[Reading]) -> str:
    """Return the readings as tab-separated text."""
    names = [f.name for f in fields(Reading)]
    rows = [[f"{getattr(r, n):.1f}" if n == "seconds" else str(getattr(r, n)) for n in names] for r in readings]
    return "\n".join("\t".join(row) for row in [names, *rows]) + "\n"
