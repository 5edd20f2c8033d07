"""Approximate convex decomposition by CoACD, in a child process: a crash or a hang there is an error here.

The child runs this file as a script, without the rest of the package.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from .topology import Floats, Ints

THRESHOLD = 0.05
"""How concave a part may stay, in CoACD's measure and its default; 1 is wholly."""

_WORKER = Path(__file__)
_SECONDS = 900.0


class DecompositionError(RuntimeError):
    """CoACD crashed, hung, or gave nothing that can be used."""


def approximate_parts(vertices: Floats, faces: Ints) -> tuple[Floats, ...]:
    """Split a solid into nearly convex parts, and return the corners of each part's convex hull, (k, 3).

    Wei et al., "Approximate convex decomposition for 3D meshes with collision-aware concavity and tree search",
    SIGGRAPH 2022. The seed is fixed and there is one thread, because part order, and now and then the parts, depend
    on the number of threads; parts and corners are sorted.

    Args:
        vertices: (n, 3).
        faces: (m, 3) counter-clockwise from outside.

    Raises:
        ValueError: CoACD is not installed.
        DecompositionError: It crashed, hung, or gave nothing.
    """
    if importlib.util.find_spec("coacd") is None:
        raise ValueError("collision='coacd' needs one more package: pip install 'env2mjcf[decompose]'")
    # CoACD scales meshes to itself; about the origin and of size 1 its numbers are the same wherever the mesh lies.
    center, size = (vertices.min(axis=0) + vertices.max(axis=0)) / 2, float(np.ptp(vertices, axis=0).max())
    with tempfile.TemporaryDirectory(prefix="env2mjcf-") as folder:
        source, target = Path(folder) / "mesh.npz", Path(folder) / "parts.npz"
        np.savez(source, vertices=(vertices - center) / size, faces=faces.astype(np.int32))
        _run([sys.executable, "-P", str(_WORKER), str(source), str(target), repr(THRESHOLD)])
        try:
            with np.load(target, allow_pickle=False) as stored:
                corners, lengths = np.asarray(stored["corners"], dtype=np.float64), stored["lengths"].tolist()
        except (OSError, EOFError, KeyError, ValueError) as error:
            raise DecompositionError(f"CoACD left no parts behind ({type(error).__name__})") from error
    parts = [part for part in np.split(corners, np.cumsum(lengths)[:-1]) if len(part) >= 4]
    if not parts or not np.isfinite(corners).all():
        raise DecompositionError("CoACD gave no parts with a volume")
    parts = [part[np.lexsort(part.T[::-1])] for part in parts]
    return tuple(part * size + center for part in sorted(parts, key=lambda p: p.ravel().tolist()))


def _run(command: list[str]) -> None:
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    try:
        finished = subprocess.run(command, env=environment, capture_output=True, timeout=_SECONDS, check=False)
    except subprocess.TimeoutExpired:
        raise DecompositionError(f"CoACD gave no answer within {_SECONDS:g} seconds") from None
    except OSError as error:
        raise DecompositionError(f"CoACD could not be started: {error}") from error
    if finished.returncode:
        how = f"signal {-finished.returncode}" if finished.returncode < 0 else f"status {finished.returncode}"
        said = [line for line in finished.stderr.decode(errors="replace").splitlines() if line.strip()]
        raise DecompositionError(f"CoACD crashed ({how}){f': {said[-1]}' if said else ''}")


def _decompose(source: str, target: str, threshold: str) -> None:
    """Decompose the mesh of one file into another file of corners, part after part: what the child does."""
    # As Any: it has no type hints.
    coacd: Any = importlib.import_module("coacd")
    coacd.set_log_level("error")
    with np.load(source, allow_pickle=False) as mesh:
        parts = coacd.run_coacd(coacd.Mesh(mesh["vertices"], mesh["faces"]), threshold=float(threshold), seed=0)
    corners = [np.asarray(vertices, dtype=np.float64).reshape(-1, 3) for vertices, _ in parts]
    np.savez(target, corners=np.concatenate([np.zeros((0, 3)), *corners]), lengths=[len(c) for c in corners])


if __name__ == "__main__":
    _decompose(*sys.argv[1:])
