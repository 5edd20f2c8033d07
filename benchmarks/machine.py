"""What a benchmark ran on."""

from __future__ import annotations

import importlib.metadata
import os
import platform
from pathlib import Path

_PACKAGES = ("numpy", "numba", "mujoco", "coal", "python-fcl", "pin", "trimesh")


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
