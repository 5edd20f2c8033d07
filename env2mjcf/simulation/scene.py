"""A scene in MuJoCo: simulate it, place its robots, ask what touches."""

from __future__ import annotations

import copy
import dataclasses
import threading
import time
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from ..contact.queries import ContactQueries
from ..errors import Diagnostic
from ..forking import Lock
from ..model import Environment
from ..pipeline import Compiled
from ..report import Report, report
from ..transforms import Array
from .answers import Answers
from .loading import load_spec


@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """Configurations to be visited in turn.

    Attributes:
        robot: Index of the robot that moves.
        q: (k, dim) start, via and goal configurations, the other robots at home.
        label: Name of the task, where a problem file gives one.
    """

    robot: int
    q: Array
    label: str = ""


class Scene(Answers):
    """A scene loaded into MuJoCo.

    Configurations q are float64, (dim,) or (n, dim), in metres and radians, in the planner's order of the degrees of
    freedom. A single row gives a Python bool or float, n rows an (n,) array. A wrong shape, a NaN or an infinity is a
    ValueError that names the degree of freedom. Queries leave `data` alone and may run in several threads.

    Attributes:
        model: The compiled model.
        space: The configuration space.
        environment: The scene in the words, and units, of its files.
        diagnostics: What all stages found.
    """

    def __init__(self, compiled: Compiled, model: mujoco.MjModel) -> None:
        super().__init__(ContactQueries(compiled, model), compiled.space)
        self.model = model
        self.environment: Environment = compiled.environment
        self.diagnostics: tuple[Diagnostic, ...] = compiled.diagnostics
        self._compiled = compiled
        self._data: mujoco.MjData | None = None
        self._lock = Lock()

    # What the scene is.

    @property
    def data(self) -> mujoco.MjData:
        """The scene's simulation state; at home when it is first asked for."""
        with self._lock:
            if self._data is None:
                self._data = mujoco.MjData(self.model)
                if self.model.nkey:
                    mujoco.mj_resetDataKeyframe(self.model, self._data, 0)
                mujoco.mj_forward(self.model, self._data)
            return self._data

    @property
    def xml(self) -> str:
        """The MJCF text."""
        return self._compiled.document.xml

    @property
    def assets(self) -> dict[str, bytes]:
        """Contents of the files that the MJCF refers to, by path relative to it."""
        return dict(self._compiled.document.assets)

    @property
    def report(self) -> Report:
        """What was converted, in numbers."""
        return report(self._compiled)

    @property
    def extent(self) -> float:
        """Diagonal of the bounding box of all bodies at home, in metres: the unit of every tolerance."""
        return self._compiled.assembly.extent

    @property
    def link_names(self) -> tuple[str, ...]:
        """All robot bodies, in file order."""
        return tuple(p.name for p in self._queries.links)

    @property
    def obstacle_names(self) -> tuple[str, ...]:
        """All obstacle bodies, in file order."""
        return tuple(p.name for p in self._compiled.assembly.obstacles)

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Every tested pair of names."""
        return tuple((p.link, p.other) for p in self._compiled.pairs.tested)

    @property
    def queries(self) -> tuple[Query, ...]:
        """The tasks of the query file or problem XML, decoded."""
        return tuple(Query(t.robot, self.space.of_task(t), t.label) for t in self.environment.tasks)

    def spec(self) -> mujoco.MjSpec:
        """Return the scene as a new MjSpec, to be attached to another one.

        An attached spec takes the options of its parent: give that `filterparent="disable"` and this scene's time step
        where they matter.
        """
        return load_spec(self._compiled.document)

    @property
    def compiled(self) -> Compiled:
        """What the scene was loaded from."""
        return self._compiled

    def with_diagnostics(self, diagnostics: tuple[Diagnostic, ...]) -> Scene:
        """Return the scene with these diagnostics."""
        if diagnostics == self.diagnostics:
            return self
        return Scene(dataclasses.replace(self._compiled, diagnostics=diagnostics), self.model)

    # Where things are.

    def set(self, q: ArrayLike) -> None:
        """Put the robots of `data` at q, at rest, and run `mj_forward`."""
        row = self._row(q)
        data = self.data
        data.qpos[:] = self.space.qpos(row)
        data.qvel[:] = 0
        mujoco.mj_forward(self.model, data)

    def q(self) -> Array:
        """Return the configuration that `data` holds, (dim,)."""
        return self.space.from_qpos(self.data.qpos)

    def obstacle_poses(self) -> Array:
        """Return the world poses of all obstacles, (m, 4, 4)."""
        return np.array([p.pose for p in self._compiled.assembly.obstacles]).reshape(-1, 4, 4)

    def loop_error(self, q: ArrayLike) -> float | Array:
        """Return how far the worst closed loop is from closed, in metres; 0.0 without loops.

        The greatest distance, over the ball around a loop's last link, between where the chain puts a point and where
        the loop-closing connection would.
        """
        rows = self.space.check(q)
        errors = self._loop_errors(np.atleast_2d(rows))
        return errors if rows.ndim == 2 else errors[0].item()

    def warm_up(self, *, wait: bool = True) -> float:
        """Make ready what the first query would have to wait for; return the seconds that it took.

        The exact engine is compiled at its first use, and kept on disk for later ones.

        Args:
            wait: False works in a thread of its own, and returns 0.0 at once.
        """
        if not wait:
            threading.Thread(target=self._queries.warm_up, name="env2mjcf-warm-up", daemon=True).start()
            return 0.0
        start = time.perf_counter()
        self._queries.warm_up()
        return time.perf_counter() - start

    # Pickling: the model and the compiled scene travel, the rest is built again.

    def __getstate__(self) -> dict[str, Any]:
        return {"compiled": self._compiled, "model": self.model}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(state["compiled"], state["model"])

    def __deepcopy__(self, memo: dict[int, Any]) -> Scene:
        return Scene(self._compiled, copy.copy(self.model))

    def __repr__(self) -> str:
        robots = len(self._compiled.assembly.robots)
        return (
            f"<Scene {self.environment.name!r}: {robots} robot{'' if robots == 1 else 's'}, "
            f"{len(self._queries.links)} links, {self.space.dim} degrees of freedom, "
            f"{len(self.obstacle_names)} obstacles>"
        )

    def _loop_errors(self, rows: Array) -> Array:
        worst = np.zeros(len(rows))
        for robot, columns in zip(self._compiled.assembly.robots, self.space.robot_slices, strict=True):
            gaps = robot.kinematics.loop_gaps(rows[:, columns], [p.radius for p in robot.links])
            worst = np.maximum(worst, gaps.max(axis=-1, initial=0.0))
        return worst
