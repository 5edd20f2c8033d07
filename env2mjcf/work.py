"""Bounds the work on one mesh: the parts of a hostile one lie so that everything must be compared with everything."""

from __future__ import annotations

import math

COSTLY = 10
"""Steps that a comparison counts for which clips polygons."""


class TooMuchWorkError(Exception):
    """More steps were asked for than are allowed.

    Args:
        part: Index of the part of the mesh that they were asked for, where it is one.
    """

    def __init__(self, part: int = 0) -> None:
        super().__init__(part)
        self.part = part


class Work:
    """Counts steps, each a comparison of two parts of a mesh: about half a microsecond.

    Args:
        most: How many are allowed.
    """

    def __init__(self, most: float = math.inf) -> None:
        self.most = most
        self.done = 0

    def spend(self, steps: int, part: int = 0) -> None:
        """Count steps that are about to be taken, for a part of the mesh where they are for one.

        Raises:
            TooMuchWorkError: They are more than are left.
        """
        self.done += steps
        if self.done > self.most:
            raise TooMuchWorkError(part)
