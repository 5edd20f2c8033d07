"""Boundary and resolution in another dialect.

MERGED: Configurations in the numbers of another dialect.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ..formats.writers import settled
from ..kinematics.forward import RobotKinematics
from ..kinematics.transforms import Array, wrap
from ..kinematics.tree import Dof, DofKind
from ..model.dialects import RULES
from ..model.environment import Boundary, BoundaryShape, Environment, MultiBody, Resolution, Task
from .connections import swaps_angles
from .losses import Losses

_FLAT = {BoundaryShape.BOX: BoundaryShape.BOX2D, BoundaryShape.SPHERE: BoundaryShape.SPHERE2D}
_SOLID = {flat: solid for solid, flat in _FLAT.items()}
# File units; wide enough for any scene that was met, and narrow enough to draw samples from.
_WIDE = 1e6


def boundary(environment: Environment, losses: Losses) -> Boundary | None:
    """Return the boundary, or what the dialect has in its place."""
    found, dialect = environment.boundary, losses.dialect
    if found is None:
        return _wide(environment, losses) if losses.rules.boundaries else None
    if found.space != "workspace":
        losses.lost("ENV177", "Boundary", f"text files bound the workspace, not the {found.space}", "", found.span)
    fitting = replace(_fitting(found, environment, losses), space="workspace")
    flat_ball = fitting.shape is BoundaryShape.SPHERE and len(fitting.center) == 2 and not losses.rules.brackets
    if fitting.shape in losses.rules.boundaries and not flat_ball:
        return fitting
    if not losses.rules.boundaries:
        message = "its planner takes one on the command line or in XML"
        losses.lost(
            "ENV160", "Boundary", f"dialect {dialect} has no boundary in its file; it is lost", message, found.span
        )
        return None
    losses.lost(
        "ENV160", "Boundary", f"dialect {dialect} has no {found.shape.value}; the boundary is lost", "", found.span
    )
    return _wide(environment, losses)


def resolution(environment: Environment, losses: Losses) -> Resolution:
    """Return the step sizes that the dialect can express."""
    found, kept = environment.resolution, losses.rules.resolution
    names = ("position", "position_factor", "orientation", "time", "rd")
    given = [name for name in names if getattr(found, name) is not None]
    lost = [name for name in given if name not in kept]
    if lost:
        listed = ", ".join(lost)
        losses.lost(
            "ENV162", "resolution", f"dialect {losses.dialect} has no resolution in its file for {listed}; lost"
        )
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
    losses.lost(
        "ENV161",
        "Boundary",
        f"dialect {losses.dialect} must have a boundary; written as a box from {-half:g} to {half:g}",
        "give the boundary that is meant: boundary=Boundary(...) (--box X0 X1 Y0 Y1 Z0 Z1)",
    )
    return Boundary(BoundaryShape.BOX, (-half,) * 3, (half,) * 3)


def _lengths(environment: Environment) -> Iterator[float]:
    for multibody in environment.multibodies:
        for body in multibody.bodies:
            yield from body.pose.position if body.pose is not None else ()
        for connection in multibody.connections:
            yield from (*connection.to_dh.position, *connection.to_body.position, connection.dh.a, connection.dh.d)


_OTHER = {DofKind.THETA: DofKind.ALPHA, DofKind.ALPHA: DofKind.THETA}


@dataclass(frozen=True, slots=True)
class DofMap:
    """From a robot's configurations to those of its translation.

    Attributes:
        source, target: The robot before and after.
        order: For each degree of freedom of the target, which one of the source it is.
    """

    source: RobotKinematics
    target: RobotKinematics
    order: tuple[int, ...]

    @classmethod
    def of(cls, source: MultiBody, target: MultiBody) -> DofMap:
        """Pair the degrees of freedom of a robot and its translation."""
        before, after = RobotKinematics.of(source), RobotKinematics.of(target)
        places = {(d.connection, d.body, d.kind): i for i, d in enumerate(before.dofs)}
        return cls(before, after, tuple(places[_key(d, source, target)] for d in after.dofs))

    def q(self, q: ArrayLike) -> Array:
        """Turn configurations (..., dim), in radians and lengths, into those of the target.

        Angles that turned without end and now have limits are reduced by whole turns.
        """
        values = np.array(q, dtype=np.float64)[..., list(self.order)]
        for i, (dof, old) in enumerate(zip(self.target.dofs, self.order, strict=True)):
            if self.source.dofs[old].periodic and not dof.periodic:
                values[..., i] = wrap(values[..., i])
        return values

    def numbers(self, configuration: Sequence[float]) -> tuple[float, ...]:
        """Turn one configuration from the source's own numbers into the target's."""
        before, after = (RULES[k.multibody.dialect].configuration_angle for k in (self.source, self.target))
        ratio, half_turn = before / after, math.pi / after
        found: list[float] = []
        for dof, old in zip(self.target.dofs, self.order, strict=True):
            value = float(configuration[old])
            if not dof.kind.is_length:
                value *= ratio
                # Turns go from 0 to 1, and pi units from -1 to 1.
                if ratio > 1 and self.source.dofs[old].periodic:
                    value -= 2 * half_turn * math.floor(value / (2 * half_turn) + 0.5)
                    # 1.8 - 2 is not quite -0.2.
                    near = round(value, 12)
                    value = near if abs(near - value) < 4e-16 else value
            found.append(value)
        return tuple(found)

    def task(self, task: Task) -> Task:
        """Turn a task's configurations into the target's numbers."""
        return Task(task.robot, tuple(self.numbers(c) for c in task.configurations), task.label, task.span)


def _key(dof: Dof, source: MultiBody, target: MultiBody) -> tuple[int | None, int, DofKind]:
    if dof.connection is None:
        return None, dof.body, dof.kind
    swapped = swaps_angles(source.connections[dof.connection], source.dh_form, target.dh_form)
    return dof.connection, dof.body, _OTHER[dof.kind] if swapped else dof.kind
