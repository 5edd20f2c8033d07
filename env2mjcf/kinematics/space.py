"""The configuration space of a scene: the planner's numbers, all robots one after the other, and MuJoCo's qpos."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..model.dialects import RULES
from ..model.environment import Boundary, Task
from ..options import whole
from ..transforms import Array, angles_from_quaternion, quaternion_from_angles, real_array, wrap
from .forward import RobotKinematics
from .qpos import Slot, layout
from .tree import POSITIONS


def listed(names: Sequence[str]) -> str:
    """Return the first twelve names of degrees of freedom, for a message."""
    return ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")


class ConfigurationSpace:
    """Limits, units and topology of a scene's degrees of freedom.

    Configurations of a wrong shape, or with a value that is not finite, are a ValueError.

    Args:
        robots: All robots.
        names: One name for each degree of freedom.
        homes: The home configuration of each robot.
        boundary: In metres; a base keeps within it.
        scale: Metres per file unit.
        sample_box: Corners of the box that degrees of freedom without limits are drawn from.
        origin: Where the origin of qpos lies, in the frame of q.

    Attributes:
        names: One name for each degree of freedom.
        robot_slices: The columns of each robot.
        lower, upper: (dim,) limits in radians and metres; infinite where there are none.
        periodic: (dim,) whether the degree of freedom is an angle that turns without end.
        home: (dim,) the configuration that the files describe.
        shift: (dim,) what q has more than qpos: the MJCF's origin, at the positions of bases.
        nq: Length of MuJoCo's qpos.
    """

    def __init__(
        self,
        robots: Sequence[RobotKinematics],
        names: Sequence[str],
        homes: Sequence[Array],
        boundary: Boundary | None,
        scale: float,
        sample_box: tuple[Array, Array],
        origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        self.names = tuple(names)
        stops = np.cumsum([0, *(r.dim for r in robots)])
        self.robot_slices = tuple(slice(int(a), int(b)) for a, b in pairwise(stops))
        dofs = [d for r in robots for d in r.dofs]
        self.lower = np.array([d.lower for d in dofs], dtype=np.float64)
        self.upper = np.array([d.upper for d in dofs], dtype=np.float64)
        self.periodic: NDArray[np.bool_] = np.array([d.periodic for d in dofs], dtype=bool)
        self.home = np.concatenate([np.zeros(0), *homes])
        # Radians or metres for one unit of the file's numbers.
        self._units = np.array(
            [
                scale if d.kind.is_length else RULES[r.multibody.dialect].configuration_angle
                for r in robots
                for d in r.dofs
            ],
            dtype=np.float64,
        )
        base = [d.kind if d.connection is None and d.kind.is_length else None for d in dofs]
        self._axis = np.array([-1 if k is None else POSITIONS.index(k) for k in base], dtype=np.int64)
        self.shift = np.where(self._axis < 0, 0.0, np.array(origin)[self._axis])
        self._bound_bases(boundary)
        self._slots, self.nq = layout(robots, self.robot_slices)
        self._shifts = bool(self.shift.any())
        self._sample_box = sample_box
        for array in (self.lower, self.upper, self.periodic, self.home, self.shift, self._units):
            array.setflags(write=False)

    @property
    def dim(self) -> int:
        """Number of degrees of freedom of all robots."""
        return len(self.names)

    @property
    def slots(self) -> tuple[tuple[Slot, ...], ...]:
        """For each robot its joints and free bases, in the order of MuJoCo's qpos."""
        return self._slots

    def check(self, q: ArrayLike) -> Array:
        """Return configurations as a float64 array of shape (dim,) or (n, dim).

        Raises:
            ValueError: The shape is wrong, or a value is not finite; the message names the degree of freedom.
        """
        values = real_array(q, "q", self.names)
        if values.ndim not in (1, 2) or values.shape[-1] != self.dim:
            expected = f"({self.dim},) or (n, {self.dim}): {listed(self.names)}"
            raise ValueError(f"configurations of shape {values.shape}; expected {expected}")
        return values

    def check_row(self, q: ArrayLike) -> Array:
        """Return one configuration as `check` does, (dim,).

        Raises:
            ValueError: As for `check`, or there are several.
        """
        row = self.check(q)
        if row.ndim != 1:
            raise ValueError(f"configurations of shape {row.shape}; expected one of shape ({self.dim},)")
        return row

    def decode(self, cfg: ArrayLike) -> Array:
        """Turn the file's numbers (..., dim) into q: turns (dialect A) or fractions of pi, and raw lengths."""
        return self._last_axis(cfg, "cfg") * self._units

    def encode(self, q: ArrayLike) -> Array:
        """Turn q (..., dim) into the file's numbers."""
        return self._last_axis(q, "q") / self._units

    def in_file_units(self, limits: Array) -> Array:
        """Turn limits (..., dim), which may be infinite, into the file's numbers."""
        return limits / self._units

    def columns(self, robots: Iterable[int]) -> NDArray[np.int64]:
        """Return the columns of some robots, in their order."""
        return np.array([c for i in robots for c in range(self.dim)[self.robot_slices[i]]], dtype=np.int64)

    def standing(self, tasks: Iterable[Task], rest: Array | None = None, *, radians: bool = False) -> Array:
        """Return where robots stand that do not move, (dim,): at the start of their first task, else as in `rest`.

        That is home by default. With `radians`, the tasks' numbers are radians and metres.
        """
        q, unplaced = np.array(self.home if rest is None else rest), np.ones(self.dim, dtype=bool)
        for task in tasks:
            columns = self.columns(task.robots)
            first = unplaced[columns]
            q[columns[first]] = self._rows(task, radians)[0, first]
            unplaced[columns] = False
        return q

    def of_tasks(self, tasks: Sequence[Task], rest: Array | None = None, *, radians: bool = False) -> Iterator[Array]:
        """Yield the configurations of each task, (k, dim), among robots that stand; see `standing`."""
        rest = self.standing(tasks, rest, radians=radians)
        for task in tasks:
            q = np.tile(rest, (len(task.configurations), 1))
            q[:, self.columns(task.robots)] = self._rows(task, radians)
            yield q

    def _rows(self, task: Task, radians: bool) -> Array:
        units = self._units[self.columns(task.robots)]
        return np.array(task.configurations, dtype=np.float64).reshape(-1, len(units)) * (1.0 if radians else units)

    def qpos(self, q: ArrayLike) -> Array:
        """Turn q (..., dim), in the file's frame, into MuJoCo's qpos (..., nq), in the MJCF's."""
        return self.qpos_of_checked(self._last_axis(q, "q"))

    def qpos_of_checked(self, values: Array) -> Array:
        """Return `qpos` of configurations that were checked before: for loops in which every microsecond counts."""
        qpos = np.zeros((*values.shape[:-1], self.nq))
        if self._shifts:
            values = values - self.shift
        for slot in chain.from_iterable(self._slots):
            if not slot.free:
                qpos[..., slot.address] = values[..., slot.columns[0]]
                continue
            x = slot.columns[0]
            qpos[..., slot.address : slot.address + 3] = values[..., x : x + 3]
            angles = (values[..., x + 3], values[..., x + 4], values[..., x + 5])
            qpos[..., slot.address + 3 : slot.address + 7] = quaternion_from_angles(*angles)
        return qpos

    def from_qpos(self, qpos: ArrayLike) -> Array:
        """Turn MuJoCo's qpos (..., nq) into q (..., dim).

        Angles of a free base are the representatives nearest zero; loop-closing degrees of freedom, which qpos does
        not hold, are those of home.
        """
        values = real_array(qpos, "qpos")
        if values.shape[-1:] != (self.nq,):
            raise ValueError(f"qpos of shape {values.shape}; expected (..., {self.nq})")
        q = np.broadcast_to(self.home - self.shift, (*values.shape[:-1], self.dim)).copy()
        for slot in chain.from_iterable(self._slots):
            if not slot.free:
                q[..., slot.columns[0]] = values[..., slot.address]
                continue
            x = slot.columns[0]
            q[..., x : x + 3] = values[..., slot.address : slot.address + 3]
            quaternion = values[..., slot.address + 3 : slot.address + 7]
            q[..., x + 3], q[..., x + 4], q[..., x + 5] = angles_from_quaternion(_unit(quaternion))
        return q + self.shift

    def sample(self, n: int, seed: int) -> Array:
        """Draw n configurations uniformly between the limits, (n, dim); equal seeds give equal draws.

        A degree of freedom without limits is drawn from the box of the obstacles grown by the robots' radius, or
        from twice that radius where there are no obstacles.
        """
        lower, upper = self.sample_limits
        return np.random.default_rng(seed).uniform(lower, upper, size=(whole("n", n, 0), self.dim))

    @property
    def sample_limits(self) -> tuple[Array, Array]:
        """The finite limits that `sample` draws between, (dim,) each."""
        box_lower, box_upper = self._sample_box
        lower, upper = self.lower.copy(), self.upper.copy()
        half = float(np.max(box_upper - box_lower)) / 2
        for i in range(self.dim):
            axis = self._axis[i]
            low, high = (box_lower[axis], box_upper[axis]) if axis >= 0 else (-half, half)
            if not np.isfinite(lower[i]):
                lower[i] = low if np.isinf(upper[i]) else min(low, upper[i] - 2 * half)
            if not np.isfinite(upper[i]):
                upper[i] = high if high > lower[i] else lower[i] + 2 * half
        return lower, upper

    def interpolate(self, q0: ArrayLike, q1: ArrayLike, n: int) -> Array:
        """Return n configurations on the straight way from q0 to q1, (n, dim), both ends included.

        Periodic degrees of freedom go the short way round; the last row equals q1 up to whole turns.

        Raises:
            ValueError: n is below 2, or q0 or q1 is not a configuration.
        """
        if n < 2:
            raise ValueError(f"n is {n}; expected at least 2, for both ends")
        start, end = self.check_row(q0), self.check_row(q1)
        delta = self.difference(start, end)
        return start + np.linspace(0.0, 1.0, n)[:, None] * delta

    def difference(self, q0: ArrayLike, q1: ArrayLike) -> Array:
        """Return the way from q0 to q1, (dim,) or (n, dim): the short way round on periodic degrees of freedom."""
        delta = self.check(q1) - self.check(q0)
        return np.where(self.periodic, wrap(delta), delta)

    def within_limits(self, q: ArrayLike) -> NDArray[np.bool_]:
        """Return whether configurations (..., dim) keep the limits of their joints, closed.

        Periodic angles always do. So do the positions of bases: the boundary is one of vertices, and the origin of a
        body may lie outside its mesh.
        """
        return ~np.any(self.broken(q), axis=-1)

    def broken(self, q: ArrayLike) -> NDArray[np.bool_]:
        """Return which degrees of freedom are beyond their limits, (..., dim); see `within_limits`."""
        values = self._last_axis(q, "q")
        lower, upper = self.joint_limits
        return (values < lower) | (values > upper)

    @property
    def joint_limits(self) -> tuple[Array, Array]:
        """The limits that `within_limits` asks for, (dim,) each: infinite for periodic angles and bases' positions."""
        free = self.periodic | (self._axis >= 0)
        return np.where(free, -np.inf, self.lower), np.where(free, np.inf, self.upper)

    def _bound_bases(self, boundary: Boundary | None) -> None:
        """A base stays within the boundary, as its vertices do."""
        if boundary is None:
            return
        low = boundary.lower or tuple(c - boundary.radius for c in boundary.center)
        high = boundary.upper or tuple(c + boundary.radius for c in boundary.center)
        for axis in range(len(low)):
            self.lower[self._axis == axis] = low[axis]
            self.upper[self._axis == axis] = high[axis]

    def __repr__(self) -> str:
        return f"<ConfigurationSpace of {self.dim} degrees of freedom{': ' * bool(self.dim)}{listed(self.names)}>"

    def _last_axis(self, values: ArrayLike, what: str) -> Array:
        array = real_array(values, what, self.names)
        if array.shape[-1:] != (self.dim,):
            raise ValueError(f"{what} of shape {array.shape}; expected (..., {self.dim})")
        return array


def _unit(quaternion: Array) -> Array:
    """Return unit quaternions; the zero quaternion counts as no rotation, as in MuJoCo."""
    norm = np.linalg.norm(quaternion, axis=-1, keepdims=True)
    return np.where(norm > 0, quaternion / np.where(norm > 0, norm, 1.0), (1.0, 0.0, 0.0, 0.0))
