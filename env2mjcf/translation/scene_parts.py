"""What a dialect cannot express, and how that is said; boundary and step sizes in another dialect."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NoReturn

from ..diagnostics import DiagnosticLog
from ..errors import Span
from ..formats.writers import settled
from ..model.dialects import RULES, DialectRules
from ..model.environment import Boundary, BoundaryShape, Dialect, Environment, Resolution

_FLAT = {BoundaryShape.BOX: BoundaryShape.BOX2D, BoundaryShape.SPHERE: BoundaryShape.SPHERE2D}
_SOLID = {flat: solid for solid, flat in _FLAT.items()}
# File units; wide enough for any scene that was met, and narrow enough to draw samples from.
_WIDE = 1e6


@dataclass(frozen=True, slots=True)
class Losses:
    """Collects what is lost on the way into a dialect; in strict mode the first loss is an error.

    Attributes:
        dialect: The dialect that is written.
        log: Where findings go.
    """

    dialect: Dialect
    log: DiagnosticLog

    @property
    def rules(self) -> DialectRules:
        """How the dialect reads, and what it can express."""
        return RULES[self.dialect]

    def lost(self, code: str, subject: str, message: str, *, hint: str = "", span: Span | None = None) -> None:
        """Report what is left out or changed, while poses of links stay as they are."""
        self.log.warn(code, subject, message, hint=hint, span=span)

    def refuse(self, code: str, subject: str, message: str, *, hint: str = "", span: Span | None = None) -> NoReturn:
        """Refuse what would move links if it were left out, with a ConversionError."""
        self.log.fail(code, subject, message, hint=hint, span=span)


def translated_boundary(environment: Environment, losses: Losses) -> Boundary | None:
    """Return the boundary, or what the dialect has in its place."""
    found, dialect = environment.boundary, losses.dialect
    if found is None:
        return _wide(environment, losses) if losses.rules.boundaries else None
    if found.space != "workspace":
        losses.lost("ENV177", "Boundary", f"text files bound the workspace, not the {found.space}", span=found.span)
    fitting = replace(_fitting(found, environment, losses), space="workspace")
    flat_ball = fitting.shape is BoundaryShape.SPHERE and len(fitting.center) == 2 and not losses.rules.brackets
    if fitting.shape in losses.rules.boundaries and not flat_ball:
        return fitting
    if not losses.rules.boundaries:
        message = f"dialect {dialect} has no boundary in its file; it is lost"
        hint = "its planner takes one on the command line or in XML"
        losses.lost("ENV160", "Boundary", message, hint=hint, span=found.span)
        return None
    message = f"dialect {dialect} has no {found.shape.value}; the boundary is lost"
    losses.lost("ENV160", "Boundary", message, span=found.span)
    return _wide(environment, losses)


def translated_resolution(environment: Environment, losses: Losses) -> Resolution:
    """Return the step sizes that the dialect can express."""
    found, kept = environment.resolution, losses.rules.resolution
    names = ("position", "position_factor", "orientation", "time", "rd")
    given = [name for name in names if getattr(found, name) is not None]
    lost = [name for name in given if name not in kept]
    if lost:
        listed = ", ".join(lost)
        message = f"dialect {losses.dialect} has no resolution in its file for {listed}; lost"
        losses.lost("ENV162", "resolution", message)
    values = {name: getattr(found, name) for name in given if name in kept}
    if "orientation" in values:
        values["orientation"] = settled(values["orientation"], losses.rules.configuration_angle)
    return Resolution(**values)


def _fitting(found: Boundary, environment: Environment, losses: Losses) -> Boundary:
    """Name a boundary as the dialect does by the number of its axes."""
    axes = len(found.lower or found.center)
    shapes = losses.rules.boundaries
    if axes == 3 or found.shape not in shapes:
        return replace(found, shape=_SOLID.get(found.shape, found.shape))
    flat = _FLAT.get(found.shape, found.shape)
    same = environment.dialect is losses.dialect
    return found if same or flat not in shapes else replace(found, shape=flat)


def _wide(environment: Environment, losses: Losses) -> Boundary:
    longest = max((abs(x) for x in _lengths(environment)), default=0.0)
    half = max(_WIDE, 10.0 ** math.ceil(math.log10(1000 * longest))) if longest > 0 else _WIDE
    message = f"dialect {losses.dialect} must have a boundary; written as a box from {-half:g} to {half:g}"
    hint = "give the boundary that is meant: boundary=Boundary(...) (--box X0 X1 Y0 Y1 Z0 Z1)"
    losses.lost("ENV161", "Boundary", message, hint=hint)
    return Boundary(BoundaryShape.BOX, (-half,) * 3, (half,) * 3)


def _lengths(environment: Environment) -> Iterator[float]:
    for multibody in environment.multibodies:
        for body in multibody.bodies:
            yield from body.pose.position if body.pose is not None else ()
        for connection in multibody.connections:
            yield from (*connection.to_dh.position, *connection.to_body.position, connection.dh.a, connection.dh.d)
