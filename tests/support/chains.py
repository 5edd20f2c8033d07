"""Chains of equal bars on a fixed base, whose hinges turn about y and z by turns."""

from __future__ import annotations

from pathlib import Path

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
