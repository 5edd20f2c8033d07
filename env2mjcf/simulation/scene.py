"""A scene in MuJoCo: simulate it, place its robots, ask what touches."""

from __future__ import annotations

import copy
import dataclasses
import threading
import time
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from math import isfinite
from typing import Any, get_args

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..contact.edges import check_path
from ..contact.queries import ContactQueries, joined, packed
from ..contact.tasks import Question
from ..contact.threads import ask
from ..contact.types import Contact, PackedContacts, PathReport
from ..errors import Diagnostic
from ..kinematics.space import ConfigurationSpace
from ..kinematics.transforms import Array
from ..model.environment import Environment
from ..options import Engine
from ..pipeline import Compiled
from ..report import Report, report
from ..system.locks import Lock
from .mujoco_model import load_spec

_ENGINES = get_args(Engine)
_FLOAT = np.dtype(np.float64)


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


class Scene:
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
        self.space: ConfigurationSpace = compiled.space
        self.model = model
        self.environment: Environment = compiled.environment
        self.diagnostics: tuple[Diagnostic, ...] = compiled.diagnostics
        self._compiled = compiled
        self._queries = ContactQueries(compiled, model)
        self._one_row = (compiled.space.dim,)
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

    def link_poses(self, q: ArrayLike, *, threads: int | None = None) -> Array:
        """Return the world poses of all robot bodies out of MuJoCo's kinematics, (..., nlinks, 4, 4).

        Args:
            q: Configurations, (dim,) or (n, dim).
            threads: As for `in_collision`.
        """
        rows = self.space.check(q)
        shape = (len(self._queries.links), 4, 4)
        poses = self._rows(ContactQueries.link_poses, (np.atleast_2d(rows),), threads, None, False, shape=shape)
        return poses if rows.ndim == 2 else poses[0]

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

    # Verdicts.

    def in_collision(
        self,
        q: ArrayLike,
        *,
        threads: int | None = None,
        executor: Executor | None = None,
        progress: bool = False,
        engine: Engine | None = None,
    ) -> Any:
        """Return whether any tested pair touches.

        The answers are the same with every number of threads and with every executor.

        Args:
            q: Configurations, (dim,) or (n, dim).
            threads: Number of threads; None is 1 below 10,000 rows, else all cores. With an executor: how many of its
                workers to keep busy, None for all.
            executor: Where to work: any `concurrent.futures.Executor`, threads, processes, or
                `dask.distributed.Client(...).get_executor()`. It stays the caller's, who shuts it down.
            progress: Show a progress bar on a terminal.
            engine: Override the scene's engine.

        Returns:
            A bool, or (n,) bools.

        Raises:
            ValueError: q has a wrong shape or a value that is not finite, or the engine is unknown or not installed.
            TypeError: The executor is none.
            concurrent.futures.BrokenExecutor: A worker process died, and the executor does not replace it.
        """
        if engine is executor is threads is None and (one := self._at_once(q)) is not None:
            return self._queries.collisions(one).item()
        return self._verdicts(ContactQueries.collisions, q, threads, executor, progress, engine)

    def is_valid(
        self,
        q: ArrayLike,
        *,
        threads: int | None = None,
        executor: Executor | None = None,
        progress: bool = False,
        engine: Engine | None = None,
    ) -> Any:
        """Return whether q is within limits, every vertex is inside the boundary, and nothing collides.

        Arguments, result and errors are those of `in_collision`.
        """
        if engine is executor is threads is None and (one := self._at_once(q)) is not None:
            return self._queries.validities(one).item()
        return self._verdicts(ContactQueries.validities, q, threads, executor, progress, engine)

    def valid_rows(self, rows: Array) -> NDArray[np.bool_]:
        """Return `is_valid` of rows, (n, dim), that are known to be finite float64, in this thread.

        Nothing is checked or shared out, which for a few rows takes longer than the verdicts: for planners' loops.
        """
        return self._queries.validities(rows)

    def clearance(
        self, q: ArrayLike, *, threads: int | None = None, executor: Executor | None = None, progress: bool = False
    ) -> Any:
        """Return the least distance over the tested pairs, in metres; the boundary is not counted.

        Free: the distance of the triangles, exact but for rounding; +inf without pairs.
        In collision: zero or less, minus the depth of the deepest pair. The depth is the length of the shortest push,
        of those tried, that takes one body clear of the other: it really separates them, so it never falls short of
        the shortest translation that does. For two convex bodies of few faces it is that translation (for many faces,
        not always). It fades to zero as bodies come free.

        What collides is what is measured: with `collision="hull"` (and "coacd") the hulls instead of the triangles,
        with "surface" the triangles alone (a body wholly inside another has a distance from it), else also the inside
        of closed meshes.

        Args:
            q: Configurations, (dim,) or (n, dim).
            threads: As for `in_collision`.
            executor: As for `in_collision`.
            progress: Show a progress bar on a terminal.

        Returns:
            A float, or (n,) floats.

        Raises:
            ValueError: q has a wrong shape or a value that is not finite.
        """
        rows = self.space.check(q)
        found = self._rows(
            ContactQueries.clearances, (np.atleast_2d(rows),), threads, executor, progress, kind=np.float64
        )
        return found if rows.ndim == 2 else found[0].item()

    # Contacts.

    def contacts(self, q: ArrayLike, *, engine: Engine | None = None) -> list[Contact]:
        """Return the contacts of one configuration, (dim,): a few for each pair that touches, the deepest first.

        There are some just where `in_collision` says so. Pairs that cannot move are included. Places, normals and
        depths come from MuJoCo and from triangles, whichever engine says that there are any.
        """
        return self._queries.contacts(self._row(q), engine)

    def contacts_of_poses(self, poses: ArrayLike) -> list[Contact]:
        """Return the contacts of links placed by hand, whether or not any configuration puts them there.

        Args:
            poses: World poses of all links in the order of `link_names`, (nlinks, 4, 4).

        Raises:
            ValueError: The shape is another.
        """
        placed = np.asarray(poses, dtype=np.float64)
        if placed.shape != (len(self._queries.links), 4, 4):
            raise ValueError(f"poses of shape {placed.shape}; expected ({len(self._queries.links)}, 4, 4)")
        return self._queries.contacts_of_poses(placed)

    def packed_contacts(
        self,
        q: ArrayLike,
        *,
        threads: int | None = None,
        executor: Executor | None = None,
        progress: bool = False,
        engine: Engine | None = None,
    ) -> PackedContacts:
        """Return the contacts of many configurations as arrays: those of `contacts`, row by row, in its order.

        Contacts are found by Python code, one row at a time: processes make them quicker, threads hardly do.

        Args:
            q: Configurations, (n, dim).
            threads: As for `in_collision`.
            executor: As for `in_collision`.
            progress: Show a progress bar on a terminal.
            engine: Override the scene's engine.

        Raises:
            ValueError: q has a wrong shape or a value that is not finite.
        """
        rows = self.space.check(q)
        if rows.ndim != 2:
            raise ValueError(f"configurations of shape {rows.shape}; expected many, (n, {self.space.dim})")
        parts: dict[int, PackedContacts] = {}

        def store(where: slice, answers: PackedContacts) -> None:
            parts[where.start] = answers

        question = Question(packed, (rows,), (engine,), self._queries.row_bytes())
        ask(self._queries, question, store, threads, executor, progress)
        return joined([parts[start] for start in sorted(parts)])

    # Edges and paths.

    def edge_in_collision(
        self,
        q0: ArrayLike,
        q1: ArrayLike,
        resolution: float | None = None,
        *,
        threads: int | None = None,
        executor: Executor | None = None,
        progress: bool = False,
    ) -> Any:
        """Return whether anything touches on the straight way between two configurations, ends included.

        Args:
            q0: Where the edges begin, (dim,) or (n, dim).
            q1: Where they end, of the same shape.
            resolution: Greatest distance in metres that any point of a robot moves between two checks; None takes
                the file's PositionRes, else 0.01 extent.
            threads: As for `in_collision`; edges count as rows.
            executor: As for `in_collision`.
            progress: Show a progress bar on a terminal.

        Raises:
            ValueError: q0 and q1 differ in shape, or the resolution is not positive, or too small for such edges.
        """
        start, delta = self._way(q0, q1)
        extras = (self._queries.steps.resolution(resolution),)
        columns = np.atleast_2d(start), np.atleast_2d(delta)
        hits = self._rows(ContactQueries.edges_collide, columns, threads, executor, progress, extras)
        return hits if start.ndim == 2 else hits[0].item()

    def edge_is_free(
        self,
        q0: ArrayLike,
        q1: ArrayLike,
        *,
        threads: int | None = None,
        executor: Executor | None = None,
        progress: bool = False,
    ) -> Any:
        """Return whether nothing touches anywhere on the straight way between two configurations, proved.

        True is a proof: distances along the way are compared with how far bodies can move (bounded as for
        `edge_in_collision`), so nothing is passed over. False means that bodies touch, or come nearer to each other
        than 1e-5 of the extent. Joint values in between are not rounded to any step.

        Args:
            q0: Where the edges begin, (dim,) or (n, dim).
            q1: Where they end, of the same shape.
            threads: As for `in_collision`; edges count as rows.
            executor: As for `in_collision`.
            progress: Show a progress bar on a terminal.

        Raises:
            ValueError: q0 and q1 differ in shape.
        """
        start, delta = self._way(q0, q1)
        columns = np.atleast_2d(start), np.atleast_2d(delta)
        free = self._rows(ContactQueries.edges_are_free, columns, threads, executor, progress)
        return free if start.ndim == 2 else free[0].item()

    def check_path(self, path: ArrayLike, resolution: float | None = None) -> PathReport:
        """Check the validity of a path's configurations and of the straight edges between them.

        Args:
            path: (k, dim).
            resolution: As for `edge_in_collision`.

        Raises:
            ValueError: The path has a wrong shape, or the resolution is not positive, or too small for such edges.
        """
        queries = self._queries
        return check_path(path, queries.steps, queries.validities, queries.contacts, self.space, resolution)

    def step(self, resolution: float | None = None) -> float:
        """Return the step in metres that a resolution means: itself, else the file's PositionRes, else 0.01 extent.

        Raises:
            ValueError: The resolution is not positive.
        """
        return self._queries.steps.resolution(resolution)

    def edge_rows(self, q0: ArrayLike, q1: ArrayLike, resolution: float | None = None) -> Array:
        """Return the configurations that `edge_in_collision` looks at on one edge, both ends included, (n, dim).

        Raises:
            ValueError: q0 or q1 is no configuration, or the resolution is not positive, or too small for such an edge.
        """
        return self._queries.steps.rows(q0, q1, resolution)

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

    # How rows are answered.

    def _rows(
        self,
        function: Callable[..., Any],
        columns: tuple[Array, ...],
        threads: int | None,
        executor: Executor | None,
        progress: bool,
        extras: tuple[Any, ...] = (),
        *,
        kind: type[np.generic] = np.bool_,
        shape: tuple[int, ...] | None = None,
        row_bytes: int | None = None,
    ) -> NDArray[Any]:
        """Return one answer for each row, each a `kind`, or an array of floats of this shape."""
        count = len(columns[0])
        answers = np.empty((count, *shape) if shape else count, dtype=np.float64 if shape else kind)

        def store(where: slice, some: NDArray[Any]) -> None:
            answers[where] = some

        question = Question(function, columns, extras, row_bytes or self._queries.row_bytes())
        ask(self._queries, question, store, threads, executor, progress)
        return answers

    def _row(self, q: ArrayLike) -> Array:
        row = self.space.check(q)
        if row.ndim != 1:
            raise ValueError(f"configurations of shape {row.shape}; expected one of shape ({self.space.dim},)")
        return row

    def _at_once(self, q: ArrayLike) -> Array | None:
        """Return a single good row as (1, dim); None for anything else, which takes the long way.

        A verdict may take less than a microsecond: this check is what of it can be made quick.
        """
        # A sum is finite if its terms are; the few that are not although theirs are take the long way, too.
        if type(q) is np.ndarray and q.shape == self._one_row and q.dtype is _FLOAT and isfinite(sum(q.tolist())):
            return q[None]
        return None

    def _verdicts(
        self,
        function: Callable[..., Any],
        q: ArrayLike,
        threads: int | None,
        executor: Executor | None,
        progress: bool,
        engine: Engine | None,
    ) -> Any:
        if engine is not None and engine not in _ENGINES:
            raise ValueError(f"engine={engine!r} is not one of {', '.join(map(repr, _ENGINES))}")
        rows = self.space.check(q)
        row_bytes = self._queries.row_bytes(engine, verdicts=True)
        found = self._rows(
            function, (np.atleast_2d(rows),), threads, executor, progress, (engine,), row_bytes=row_bytes
        )
        return found if rows.ndim == 2 else found[0].item()

    def _way(self, q0: ArrayLike, q1: ArrayLike) -> tuple[Array, Array]:
        """Return where ways begin, and where they lead from there."""
        start, end = self.space.check(q0), self.space.check(q1)
        if start.shape != end.shape:
            raise ValueError(f"q0 has shape {start.shape} and q1 {end.shape}; expected equal shapes")
        return start, self.space.difference(start, end)

    def _loop_errors(self, rows: Array) -> Array:
        worst = np.zeros(len(rows))
        for robot, columns in zip(self._compiled.assembly.robots, self.space.robot_slices, strict=True):
            gaps = robot.kinematics.loop_gaps(rows[:, columns], [p.radius for p in robot.links])
            worst = np.maximum(worst, gaps.max(axis=-1, initial=0.0))
        return worst
