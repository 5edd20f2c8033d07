"""Chains of equal bars on a fixed base, whose hinges turn about y and z by turns, and closed loops of bars."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenes import box_mesh, write_scene


def write_chain(folder: Path, hinges: int, length: float = 0.5, width: float = 0.1) -> Path:
    """Write a chain in dialect D that lies along x at home."""
    half = length / 2
    bars = ["bar.g Fixed 0 0 0 0 0 0", *["bar.g Joint"] * hinges, "Connections", str(hinges)]
    for i in range(hinges):
        turn = 90 if i % 2 else 0
        bars += [f"{i} {i + 1} Revolute -1:1", f"{half} 0 0 {turn} 0 0   0 0 0 0   {half} 0 0 {-turn} 0 0"]
    text = "\n".join(["Boundary Box [-999:999 ; -999:999 ; -999:999]", "Multibodies", "1", "Active", str(hinges + 1)])
    return write_scene(folder, "\n".join([text, *bars]) + "\n", bar=box_mesh(0.4 * length, width / 2, width / 2))


def write_loop(folder: Path, seed: int) -> Path:
    """Write a loop of 4 to 9 bars in dialect D: an upright polygon of random corners, whose first bar is fixed."""
    rng = np.random.default_rng(seed)
    n = 4 + seed % 6
    around = np.arange(n) * (2 * np.pi / n) + rng.uniform(-0.3, 0.3, n) * (2 * np.pi / n)
    corners = rng.uniform(0.7, 1.0, n) * np.exp(1j * around)
    bars = np.roll(corners, -1) - corners
    lengths = np.abs(bars).tolist()
    turns = np.angle(np.roll(bars, -1) / bars).tolist()
    meshes = {f"bar{i}": box_mesh(0.4 * lengths[i], 0.04, 0.04) for i in range(n)}
    lines = ["bar0.g Fixed 0 0 0 90 0 0", *(f"bar{i}.g Joint" for i in range(1, n)), "Connections", str(n)]
    for i in range(n):
        k = (i + 1) % n
        # The turn that closes the loop is listed from the first body to the last, as the others are.
        lines += [f"{i} {k} Revolute -1:1"]
        lines += [f"{lengths[i] / 2!r} 0 0 0 0 0   0 0 0 {turns[i]!r}   {lengths[k] / 2!r} 0 0 0 0 0"]
    head = f"Boundary Box [-99:99 ; -99:99 ; -99:99]\nMultibodies\n1\nActive\n{n}\n"
    return write_scene(folder, head + "\n".join(lines) + "\n", **meshes)
