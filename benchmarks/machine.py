"""What a benchmark ran on, and what else ran there."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import time
from pathlib import Path

_PACKAGES = ("numpy", "numba", "mujoco", "coal", "python-fcl", "pin", "trimesh", "ompl")


def machine() -> str:
    """Return a sentence on processor, system and versions."""
    fields = [line.partition(":") for line in Path("/proc/cpuinfo").read_text().splitlines()]
    models = {value.strip() for key, _, value in fields if key.strip() == "model name"}
    gigabytes = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    versions = ", ".join(f"{name} {_version(name)}" for name in _PACKAGES)
    return (
        f"{os.cpu_count()} cores of {' and '.join(sorted(models)) or platform.machine()}, {gigabytes:.0f} GiB, "
        f"{platform.system()} {platform.release()}, Python {platform.python_version()}; {versions}."
    )


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "missing"


class ForeignLoad:
    """What other processes take of the machine, from now on; processes of this one count when they have ended."""

    def __init__(self) -> None:
        self._start, self._busy, self._own = time.perf_counter(), _busy(), _own()

    def share(self) -> float:
        """Return their share of all processors' time."""
        elapsed = (time.perf_counter() - self._start) * (os.cpu_count() or 1)
        return max(0.0, (_busy() - self._busy - (_own() - self._own)) / elapsed)


def _busy() -> float:
    """Return seconds in which the machine's processors were not idle, since it started."""
    user, nice, system, _, _, irq, softirq, steal = map(int, Path("/proc/stat").read_text().split()[1:9])
    return (user + nice + system + irq + softirq + steal) / os.sysconf("SC_CLK_TCK")


def _own() -> float:
    """Return seconds that this process and those that it has waited for have taken."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system
