"""Batches that are stopped, and what they leave."""

from __future__ import annotations

import json
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from scenes import free_cube

import env2mjcf
from env2mjcf.batch import run

# A cube between two others.
CUBES = free_cube("2 0 0 0 0 0", "-2 0 0 0 0 0")
JOURNAL, PARTIAL = Path("v.npy.journal"), Path("v.npy.partial")


class Stop(Exception):
    pass


def saved(scene: env2mjcf.Scene, n: int, name: str = "q.npy") -> np.ndarray:
    q = scene.space.sample(n, seed=0)
    q[:, :3] *= 0.2, 0.08, 0.08
    np.save(name, q)
    return q


def left(folder: Path) -> set[str]:
    return {p.name for p in folder.iterdir() if p.name.startswith("v.npy")}


def stopped(scene: env2mjcf.Scene, after: int, **how) -> list[int]:
    """Start a batch, and stop it after so many rows; return what it reported."""
    seen: list[int] = []

    def advance(done: int, _rows: int) -> None:
        seen.append(done)
        if done >= after:
            raise Stop

    with pytest.raises(Stop):
        run(scene, "q.npy", "v.npy", advance=advance, **how)
    return seen


def wait_for_progress(child: subprocess.Popen[bytes]) -> None:
    """Return when a batch in another process has kept some of its answers."""
    deadline = time.monotonic() + 60
    while not JOURNAL.exists() or not json.loads(JOURNAL.read_text())["done"]:
        assert child.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)
