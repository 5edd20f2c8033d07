"""The exact engine: verdicts, distances and edges on triangles, by compiled code without Python's lock."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...geometry.assembly import Assembly
from ...pairs import Pair
from ...space import ConfigurationSpace
from ...transforms import Array
from ..surfaces import Surfaces
from .program import program

Bools = NDArray[np.bool_]


def available() -> bool:
    """Return whether numba, which compiles the engine, is installed."""
    return find_spec("numba") is not None


def require() -> None:
    """Raise a ValueError that says what to install, unless the engine is available."""
    if not available():
        raise ValueError("engine='exact' needs one more package: pip install 'env2mjcf[fast]'")


def _entries() -> Any:
    # Imported here, because numba takes its time to import, and is an extra.
    return import_module(".kernels.entries", __package__)


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
        self._tables = program(assembly, space, pairs, surfaces)
        self._links, self._pairs = sum(len(r.links) for r in assembly.robots), sum(p.kind != "obstacle" for p in pairs)
        self._home = np.ascontiguousarray(space.home[None])
        self._entries = _entries()

    def collisions(self, q: Array) -> Bools:
        """Return whether any pair touches, (n,), at configurations (n, dim)."""
        out = np.empty(len(q), dtype=np.bool_)
        self._entries.collisions(*self._tables, np.ascontiguousarray(q), out)
        return out

    def validities(self, q: Array) -> Bools:
        """Return whether configurations are within limits and the boundary, and no pair touches, (n,)."""
        out = np.empty(len(q), dtype=np.bool_)
        self._entries.validities(*self._tables, np.ascontiguousarray(q), out)
        return out

    def distances(self, q: Array) -> Array:
        """Return the least distance of any pair, (n,); inf without pairs, -1 where any touches."""
        out = np.empty(len(q))
        self._entries.distances(*self._tables, np.ascontiguousarray(q), out)
        return out

    def edges_collide(self, start: Array, delta: Array, steps: NDArray[np.int64]) -> Bools:
        """Return whether any pair touches at one of so many steps, (e,), of ways from (e, dim) by (e, dim)."""
        out = np.empty(len(start), dtype=np.bool_)
        start, delta = np.ascontiguousarray(start), np.ascontiguousarray(delta)
        self._entries.edges_collide(*self._tables, start, delta, steps, out)
        return out

    def edges_are_free(self, start: Array, delta: Array, speeds: Array, pair_speeds: Array, band: float) -> Bools:
        """Return whether bodies provably stay apart on ways from (e, dim) by (e, dim), (e,).

        Args:
            start: (e, dim).
            delta: (e, dim).
            speeds: (e, links) bounds of how far each link moves.
            pair_speeds: (e, pairs of links) bounds of how much nearer two links come.
            band: Bodies as near as this may touch.
        """
        out = np.empty(len(start), dtype=np.bool_)
        start, delta = np.ascontiguousarray(start), np.ascontiguousarray(delta)
        self._entries.edges_are_free(*self._tables, start, delta, speeds, pair_speeds, band, out)
        return out

    def warm_up(self) -> None:
        """Compile everything, or take it from the disk."""
        q = self._home
        self.collisions(q)
        self.validities(q)
        self.distances(q)
        self.edges_collide(q, q, np.array([2]))
        self.edges_are_free(q, q, np.zeros((1, self._links)), np.zeros((1, self._pairs)), 0.0)
