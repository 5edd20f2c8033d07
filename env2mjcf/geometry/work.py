"""Bounds the work on one mesh: the parts of a hostile one lie so that everything must be compared with everything."""

from __future__ import annotations

import math
from typing import NoReturn

from ..errors import DiagnosticLog, GeometryError, Span
from ..options import Limits

COSTLY = 10
"""Steps that a comparison counts for which clips polygons."""


class TooMuchWorkError(Exception):
    """More steps were asked for than are allowed."""


class Work:
    """Counts steps, each a comparison of two parts of a mesh: about half a microsecond.

    Args:
        most: How many are allowed.
    """

    def __init__(self, most: float = math.inf) -> None:
        self.most = most
        self.done = 0

    def spend(self, steps: int) -> None:
        """Count steps that are about to be taken.

        Raises:
            TooMuchWorkError: They are more than are left.
        """
        self.done += steps
        if self.done > self.most:
            raise TooMuchWorkError


def refuse_work(limits: Limits, log: DiagnosticLog, subject: str, span: Span | None) -> NoReturn:
    """Raise a `GeometryError` about a mesh that takes too much work."""
    log.fail(
        GeometryError, "GEO273", subject,
        f"{subject} takes too long to repair and to cut into convex pieces: more than {limits.mesh_work} of its parts "
        "would have to be compared",
        hint=f"remove parts that overlap, choose collision='hull' (--collision hull), or {Limits.hint('mesh_work')}",
        span=span,
    )  # fmt: skip
