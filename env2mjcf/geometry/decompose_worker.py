"""Runs CoACD on one mesh; a script of `decompose`: mesh.npz, parts.npz, threshold."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Any

import numpy as np


def main(source: str, target: str, threshold: str) -> None:
    """Decompose a mesh file into a file of corners, part after part."""
    # As Any: it has no type hints.
    coacd: Any = import_module("coacd")
    coacd.set_log_level("error")
    with np.load(source, allow_pickle=False) as mesh:
        parts = coacd.run_coacd(coacd.Mesh(mesh["vertices"], mesh["faces"]), threshold=float(threshold), seed=0)
    corners = [np.asarray(vertices, dtype=np.float64).reshape(-1, 3) for vertices, _ in parts]
    np.savez(target, corners=np.concatenate([np.zeros((0, 3)), *corners]), lengths=[len(c) for c in corners])


if __name__ == "__main__":
    main(*sys.argv[1:])
