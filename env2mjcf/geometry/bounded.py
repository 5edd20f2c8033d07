"""Tells which mesh it is that takes too much work."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager

from ..errors import DiagnosticLog, GeometryError, Span
from ..options import Limits
from ..work import TooMuchWorkError


@contextmanager
def bounded(limits: Limits, log: DiagnosticLog, subject: str, span: Span | None) -> Generator[None]:
    """Refuse a mesh while which is worked on more steps are asked for than `limits.mesh_work`.

    Args:
        limits: Bounds on hostile input.
        log: Where findings go.
        subject: What the mesh is called.
        span: Where it is named.

    Raises:
        GeometryError: More are asked for.
    """
    try:
        yield
    except TooMuchWorkError:
        log.fail(
            GeometryError, "GEO273", subject,
            f"{subject} takes too long to repair and to cut into convex pieces: more than {limits.mesh_work} of its "
            "parts would have to be compared",
            hint="remove parts that overlap, choose collision='hull' (--collision hull), or "
            + Limits.hint("mesh_work"),
            span=span,
        )  # fmt: skip
