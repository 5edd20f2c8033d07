"""Configurations in the numbers of another dialect."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..dialects import RULES
from ..dofs import Dof, DofKind
from ..kinematics import RobotKinematics
from ..model import MultiBody, Task
from ..transforms import Array, wrap
from .dh import swaps_angles

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
                # Turns go from 0 to 1, and pi units from -1 to 1 (env-format section 9.5).
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
