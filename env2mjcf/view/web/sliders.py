"""Degrees of freedom as sliders in the file's own numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...model.dialects import RULES, DialectRules
from ...simulation.scene import Scene
from ...transforms import Array

# A slider has about so many steps.
_STEPS = 1000


@dataclass(frozen=True, slots=True)
class Slider:
    """A degree of freedom as a slider.

    Attributes:
        name: Its name in the space.
        label: The same without the robot's own prefix.
        length: Whether it is a length.
        unit: What its numbers are in the file.
        low, high: Ends of the slider, in the file's numbers.
        step: Distance of two places of the slider; a power of ten, or 2 or 5 times one.
        limits: What is said about its limits.
    """

    name: str
    label: str
    length: bool
    unit: str
    low: float
    high: float
    step: float
    limits: str


class Sliders:
    """All degrees of freedom of a scene as sliders.

    Args:
        scene: The scene.
        rows: (n, dim) configurations that the sliders must be able to show.

    Attributes:
        robots: Those of each robot, in the order of the space.
    """

    def __init__(self, scene: Scene, rows: Array) -> None:
        space = scene.space
        self._space = space
        lower, upper = space.sample_limits
        shown = np.vstack([space.home[None], rows])
        self._low = space.encode(np.minimum(lower, shown.min(axis=0)))
        self._high = space.encode(np.maximum(upper, shown.max(axis=0)))
        self._limits = [space.in_file_units(ends) for ends in space.joint_limits]
        self._steps = np.array([_step(b - a) for a, b in zip(self._low, self._high, strict=True)])
        self.robots: tuple[tuple[Slider, ...], ...] = tuple(
            tuple(self._slider(scene, r, i) for i in range(columns.start, columns.stop))
            for r, columns in enumerate(space.robot_slices)
        )

    def values(self, q: Array) -> list[float]:
        """Return the file's numbers of a configuration, (dim,).

        Angles that turn without end, and go on steadily along a path, are reduced by whole turns to what a slider has.
        """
        numbers = self._space.encode(q)
        turn = self._space.encode(np.full(self._space.dim, 2 * np.pi))
        outside = (numbers < self._low - self._steps) | (numbers > self._high + self._steps)
        reduced = self._low + np.mod(numbers - self._low, turn)
        return np.where(self._space.periodic & outside, reduced, numbers).tolist()

    def configuration(self, values: list[float]) -> Array | None:
        """Return the configuration that sliders stand for, (dim,); None where a number is not finite.

        The ends of a slider are whole steps, limits need not be: what is beyond a limit by less than a step means it.
        """
        numbers = np.array(values, dtype=np.float64)
        if not np.isfinite(numbers).all():
            return None
        q = self._space.decode(numbers)
        lower, upper = self._space.joint_limits
        slack = self._space.decode(self._steps)
        q = np.where((q < lower) & (q > lower - slack), lower, q)
        return np.where((q > upper) & (q < upper + slack), upper, q)

    def _slider(self, scene: Scene, robot: int, i: int) -> Slider:
        parts = scene.compiled.assembly.robots[robot]
        column = i - self._space.robot_slices[robot].start
        length = parts.kinematics.dofs[column].kind.is_length
        unit = "lengths" if length else _angle_unit(RULES[parts.kinematics.multibody.dialect])
        name, step = self._space.names[i], float(self._steps[i])
        low, high = math.floor(self._low[i] / step + 1e-9) * step, math.ceil(self._high[i] / step - 1e-9) * step
        bounds = [f"{float(ends[i]):.6g}" for ends in self._limits]
        limits = f"limits {bounds[0]} to {bounds[1]}" if np.isfinite(self._limits[0][i]) else "no limits"
        label = name.removeprefix(f"robot{robot}/")
        digits = _digits(step)
        return Slider(name, label, length, unit, round(low, digits), round(high, digits), step, limits)


def _angle_unit(rules: DialectRules) -> str:
    return "turns" if math.isclose(rules.configuration_angle, 2 * math.pi) else "fractions of pi"


def _step(span: float) -> float:
    """Return 1, 2 or 5 times a power of ten, of which about a thousand make the span."""
    if not span > 0:
        return 1e-3
    rough = span / _STEPS
    power = 10.0 ** math.floor(math.log10(rough))
    nice = max(m for m in (1, 2, 5) if m * power <= rough * (1 + 1e-9))
    return float(f"{nice * power:.0e}")


def _digits(step: float) -> int:
    return max(0, -math.floor(math.log10(step)))
