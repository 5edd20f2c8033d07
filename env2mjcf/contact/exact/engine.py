"""The exact engine: verdicts on triangles."""

from __future__ import annotations

import numpy as np

from ...transforms import Array


class ExactEngine:
    def __init__(self, assembly, space, pairs, surfaces):
        from .program import program
        self.integers, self.floats = program(assembly, space, pairs, surfaces)

    def collisions(self, q: Array):
        from .kernels.verdicts import verdicts
        out = np.zeros(len(q), dtype=np.bool_)
        verdicts(self.integers, self.floats, q, np.sin(q), np.cos(q), out)
        return out
