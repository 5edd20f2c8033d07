"""A scene in MuJoCo: simulate it, place its robots, ask what touches."""

from __future__ import annotations

import copy
import dataclasses
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from math import isfinite
from typing import Any, TypedDict, Unpack, get_args, overload

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..contact.arena import lack, new_data, refuse
from ..contact.edges import even_rows
from ..contact.queries import ContactQueries, joined
from ..contact.tasks import Question
from ..contact.threads import ask, thread_count
from ..contact.types import Contact, OneRow, PackedContacts, PathReport, Reason, Rows, UnknownShape, Verdict
from ..errors import Diagnostic
from ..kinematics.space import ConfigurationSpace
from ..model.environment import Environment, Task
from ..options import Engine
from ..pipeline import Compiled
from ..report import Report, report
from ..system.locks import Lock
from ..transforms import Array, real_array, translated
from .mujoco_model import load_spec

_ENGINES = get_args(Engine)
_FLOAT = np.dtype(np.float64)
Bools = NDArray[np.bool_]


class Work(TypedDict, total=False):
    """How rows are worked on, see `Scene.in_collision`."""

    threads: int | None
    executor: Executor | None
    progress: bool


class VerdictWork(Work, total=False):
    """How rows are worked on, and by which engine, see `Scene.in_collision`."""

    engine: Engine | None


@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """Configurations to be visited in turn.

    Attributes:
        robot: Index of the robot that moves; of several, the first.
        q: (k, dim) start, via and goal configurations. Robots that do not move stand at the start of their own first
            query, those without one at home.
        label: Name of the task, where a problem file gives one.
        robots: Indices of all robots that move, together.
    """

    robot: int
    q: Array
    label: str = ""
    robots: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "robots", tuple(self.robots) or (self.robot,))
        if self.robots[0] != self.robot:
            raise ValueError(f"robots={self.robots} do not begin with robot={self.robot}")


def queries_of(
    space: ConfigurationSpace, tasks: Sequence[Task], rest: Array | None = None, *, radians: bool = False
) -> tuple[Query, ...]:
    """Return tasks as queries; see `ConfigurationSpace.of_tasks`."""
    decoded = zip(tasks, space.of_tasks(tasks, rest, radians=radians), strict=True)
    return tuple(Query(t.robot, q, t.label, t.robots) for t, q in decoded)


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
        self._solver = ContactQueries(compiled, model)
        self._one_row = (compiled.space.dim,)
        self._data: mujoco.MjData | None = None
        self._lock = Lock()

    # What the scene is.

    @property
    def data(self) -> mujoco.MjData:
        """The scene's simulation state; at home at first."""
        with self._lock:
            if self._data is None:
                data = new_data(self.model)
                if self.model.nkey:
                    mujoco.mj_resetDataKeyframe(self.model, data, 0)
                # Where its memory cannot hold home, as loading has reported, links are placed all the same.
                if lack(mujoco.mj_forward, self.model, data):
                    mujoco.mj_kinematics(self.model, data)
                self._data = data
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
        """Diagonal of the bounding box of all bodies at home, in metres: the unit of every tolerance.

        A robot that travels and is at home far from all else counts by its size, not by its place.
        """
        return self._compiled.assembly.extent

    @property
    def origin(self) -> Array:
        """Where the origin of `model` and `data` lies in the file's frame, which q and poses are in: (3,), metres."""
        return np.array(self._compiled.assembly.origin)

    @property
    def link_names(self) -> tuple[str, ...]:
        """All robot bodies, in file order."""
        return tuple(p.name for p in self._solver.links)

    @property
    def obstacle_names(self) -> tuple[str, ...]:
        """All obstacle bodies, in file order."""
        return tuple(p.name for p in self._compiled.assembly.obstacles)

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """The names of every tested pair: a link, and the obstacle or link that it may touch."""
        return tuple((p.link, p.other) for p in self._compiled.pairs.tested)

    @property
    def queries(self) -> tuple[Query, ...]:
        """The tasks of the query file or problem XML, decoded."""
        return queries_of(self.space, self.environment.tasks)

    def spec(self) -> mujoco.MjSpec:
        """Return the scene as a new MjSpec, to be attached to another one.

        An attached spec takes the options of its parent: give that `filterparent="disable"`, this scene's time step and
        its `memory` where they matter.
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
        """Put the robots of `data` at q, (dim,), at rest, and run `mj_forward`.

        Raises:
            ValueError: q is not one configuration.
            ConversionError: So much touches at q that MuJoCo's memory cannot hold it; links are there, all the same.
        """
        row = self.space.check_row(q)
        data = self.data
        data.qpos[:] = self.space.qpos(row)
        data.qvel[:] = 0
        said = lack(mujoco.mj_forward, self.model, data)
        if said:
            mujoco.mj_kinematics(self.model, data)
            refuse("this configuration", said)

    def q(self) -> Array:
        """Return the configuration that `data` holds, (dim,), in metres and radians."""
        return self.space.from_qpos(self.data.qpos)

    def link_poses(self, q: ArrayLike, *, threads: int | None = None) -> Array:
        """Return the world poses of all robot bodies out of MuJoCo's kinematics, (nlinks, 4, 4) or (n, nlinks, 4, 4).

        Args:
            q: Configurations, (dim,) or (n, dim).
            threads: As for `in_collision`.

        Raises:
            ValueError: q has a wrong shape or a value that is not finite, or threads is below 1.
        """
        columns, shape = (self.space.check(q),), (len(self._solver.links), 4, 4)
        return self._rows(ContactQueries.link_poses, columns, threads, None, False, kind=np.float64, shape=shape)

    def obstacle_poses(self) -> Array:
        """Return the world poses of all obstacles, (m, 4, 4)."""
        poses = np.array([p.pose for p in self._compiled.assembly.obstacles]).reshape(-1, 4, 4)
        return translated(poses, self._compiled.assembly.origin)

    def loop_error(self, q: ArrayLike) -> float | Array:
        """Return how far the worst loop is from closed, in metres: a float, or (n,) floats; 0.0 without loops.

        The greatest distance, over the ball around a loop's last link, between where the chain puts a point and where
        the loop-closing connection would.

        Raises:
            ValueError: q, (dim,) or (n, dim), has a wrong shape or a value that is not finite.
        """
        rows = self.space.check(q)
        worst = np.zeros(len(np.atleast_2d(rows)))
        for robot, columns in zip(self._compiled.assembly.robots, self.space.robot_slices, strict=True):
            gaps = robot.kinematics.loop_gaps(np.atleast_2d(rows)[:, columns], [p.radius for p in robot.links])
            worst = np.maximum(worst, gaps.max(axis=-1, initial=0.0))
        return worst if rows.ndim == 2 else worst[0].item()

    # Verdicts.

    @overload
    def in_collision(self, q: UnknownShape, **work: Unpack[VerdictWork]) -> bool | Bools: ...
    @overload
    def in_collision(self, q: OneRow, **work: Unpack[VerdictWork]) -> bool: ...
    @overload
    def in_collision(self, q: Rows, **work: Unpack[VerdictWork]) -> Bools: ...
    @overload
    def in_collision(self, q: ArrayLike, **work: Unpack[VerdictWork]) -> bool | Bools: ...
    def in_collision(
        self,
        q: ArrayLike,
        *,
        threads: int | None = None,
        executor: Executor | None = None,
        progress: bool = False,
        engine: Engine | None = None,
    ) -> bool | Bools:
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
            ValueError: q has a wrong shape or a value that is not finite, the engine is unknown or not installed, or
                threads is below 1.
            TypeError: The executor is not an Executor, or threads is not a whole number.
            concurrent.futures.BrokenExecutor: A worker process died, and the executor does not replace it.
        """
        if engine is executor is threads is None and (one := self._at_once(q)) is not None:
            return self._solver.collisions(one).item()
        return self._verdicts(ContactQueries.collisions, q, threads, executor, progress, engine)

    @overload
    def is_valid(self, q: UnknownShape, **work: Unpack[VerdictWork]) -> bool | Bools: ...
    @overload
    def is_valid(self, q: OneRow, **work: Unpack[VerdictWork]) -> bool: ...
    @overload
    def is_valid(self, q: Rows, **work: Unpack[VerdictWork]) -> Bools: ...
    @overload
    def is_valid(self, q: ArrayLike, **work: Unpack[VerdictWork]) -> bool | Bools: ...
    def is_valid(
        self,
        q: ArrayLike,
        *,
        threads: int | None = None,
        executor: Executor | None = None,
        progress: bool = False,
        engine: Engine | None = None,
    ) -> bool | Bools:
        """Return whether q is within limits, every vertex is inside the boundary, and nothing collides.

        Arguments, result and errors are those of `in_collision`.
        """
        if engine is executor is threads is None and (one := self._at_once(q)) is not None:
            return self._solver.validities(one).item()
        return self._verdicts(ContactQueries.validities, q, threads, executor, progress, engine)

    def valid_rows(self, rows: Array) -> Bools:
        """Return `is_valid`, (n,), of rows (n, dim) that are known to be finite float64, in this thread.

        Nothing is checked or shared out, which for a few rows takes longer than the verdicts: for planners' loops.
        """
        return self._solver.validities(rows)

    def explain(self, q: ArrayLike, *, engine: Engine | None = None) -> Verdict:
        """Return whether one configuration, (dim,), is valid, and all that is wrong with it.

        Args:
            q: The configuration.
            engine: Override the scene's engine.

        Returns:
            The verdict. Its reasons are the deepest `Contact` of each pair that touches, each limit that is broken and
            each link that reaches beyond the boundary; `str(reason)` says a reason in words.

        Raises:
            ValueError: q has a wrong shape or a value that is not finite, or the engine is unknown or not installed.
        """
        return self._solver.explain(self.space.check_row(q), _known(engine))

    def out_of_bounds(self, q: ArrayLike) -> tuple[Reason, ...]:
        """Return the reasons of `explain`, for q (dim,), without the contacts, which take longest to find.

        Raises:
            ValueError: q is not one configuration.
        """
        return self._solver.out_of_bounds(self.space.check_row(q))

    @overload
    def clearance(self, q: UnknownShape, **work: Unpack[Work]) -> float | Array: ...
    @overload
    def clearance(self, q: OneRow, **work: Unpack[Work]) -> float: ...
    @overload
    def clearance(self, q: Rows, **work: Unpack[Work]) -> Array: ...
    @overload
    def clearance(self, q: ArrayLike, **work: Unpack[Work]) -> float | Array: ...
    def clearance(
        self, q: ArrayLike, *, threads: int | None = None, executor: Executor | None = None, progress: bool = False
    ) -> float | Array:
        """Return the least distance over the tested pairs, in metres; the boundary is not counted.

        Free: the distance of the triangles, exact but for rounding; +inf without pairs.
        In collision: zero or less, minus the depth of the deepest pair. The depth is the length of the shortest push,
        of those tried, that takes one body clear of the other: it really separates them, so it never falls short of
        the shortest translation that does. For two convex bodies it is that translation, and for others that are
        pressed a little into flat walls or corners. It fades to zero as bodies come free.

        What collides is what is measured: with `collision="hull"` (and "coacd") the hulls instead of the triangles,
        with "surface" the triangles alone (a body wholly inside another has a distance from it), else also the inside
        of closed meshes.

        q, threads, executor, progress and errors are as for `in_collision`; the answer is a float, or (n,) floats.
        """
        columns = (self.space.check(q),)
        return self._rows(ContactQueries.clearances, columns, threads, executor, progress, kind=np.float64)

    # Contacts.

    def contacts(self, q: ArrayLike, *, engine: Engine | None = None) -> list[Contact]:
        """Return the contacts of one configuration, (dim,): a few for each pair that touches, the deepest first.

        There are some exactly where `in_collision` is True. Pairs that cannot move are included. The deepest of a pair
        is as deep as the pair, by `clearance`'s measure: moved back along its normal by its depth, the link is clear of
        the other. Places, normals and depths do not depend on which engine says that there are any.

        Raises:
            ValueError: As for `explain`.
        """
        return self._solver.contacts(self.space.check_row(q), _known(engine))

    def touching_pairs(self, q: ArrayLike) -> tuple[tuple[str, str], ...]:
        """Return those of `pairs` that touch at one configuration, (dim,), in their order, as MuJoCo's engine says.

        For non-convex bodies much quicker than `contacts`, which say where, and how deep. Cannot be interrupted while
        MuJoCo looks: where millions of cells meet, that is many seconds.

        Raises:
            ValueError: q is not one configuration.
        """
        return tuple((p.link, p.other) for p in self._solver.touching_pairs(self.space.check_row(q)))

    def contacts_of_poses(self, poses: ArrayLike) -> list[Contact]:
        """Return the contacts of links placed by hand, whether or not any configuration puts them there.

        Args:
            poses: World poses of all links in the order of `link_names`, (nlinks, 4, 4).

        Raises:
            ValueError: poses have a wrong shape or a value that is not finite.
        """
        placed = real_array(poses, "poses")
        if placed.shape != (len(self._solver.links), 4, 4):
            raise ValueError(f"poses of shape {placed.shape}; expected ({len(self._solver.links)}, 4, 4)")
        return self._solver.contacts_of_poses(placed)

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

        Contacts are found by Python code, one row at a time: processes make them quicker, threads hardly do. q is
        (n, dim); the other arguments and errors are as for `in_collision`.
        """
        rows = self.space.check(q)
        if rows.ndim != 2:
            raise ValueError(f"configurations of shape {rows.shape}; expected many, (n, {self.space.dim})")
        parts: dict[int, PackedContacts] = {}

        def store(where: slice, answers: PackedContacts) -> None:
            parts[where.start] = answers

        question = Question(ContactQueries.packed_contacts, (rows,), (_known(engine),), self._solver.row_bytes())
        ask(self._solver, question, store, threads, executor, progress)
        return joined([parts[start] for start in sorted(parts)] or [self._solver.packed_contacts(rows)])

    # Edges and paths.

    @overload
    def edge_in_collision(
        self, q0: UnknownShape, q1: UnknownShape, resolution: float | None = None, **work: Unpack[VerdictWork]
    ) -> bool | Bools: ...
    @overload
    def edge_in_collision(
        self, q0: OneRow, q1: OneRow, resolution: float | None = None, **work: Unpack[VerdictWork]
    ) -> bool: ...
    @overload
    def edge_in_collision(
        self, q0: Rows, q1: Rows, resolution: float | None = None, **work: Unpack[VerdictWork]
    ) -> Bools: ...
    @overload
    def edge_in_collision(
        self, q0: ArrayLike, q1: ArrayLike, resolution: float | None = None, **work: Unpack[VerdictWork]
    ) -> bool | Bools: ...
    def edge_in_collision(
        self,
        q0: ArrayLike,
        q1: ArrayLike,
        resolution: float | None = None,
        *,
        threads: int | None = None,
        executor: Executor | None = None,
        progress: bool = False,
        engine: Engine | None = None,
    ) -> bool | Bools:
        """Return whether anything touches on the straight way between two configurations, ends included.

        Args:
            q0: Where the edges begin, (dim,) or (n, dim).
            q1: Where they end, of the same shape.
            resolution: Greatest distance in metres that any point of a robot moves between two checks; None takes
                the file's PositionRes, else 0.01 extent.
            threads: As for `in_collision`; edges count as rows.
            executor: As for `in_collision`.
            progress: Show a progress bar on a terminal.
            engine: Override the scene's engine.

        Raises:
            ValueError: As for `in_collision`; or q0 and q1 differ in shape, or the resolution is not positive, or too
                small for such edges.
            TypeError: As for `in_collision`.
        """
        extras = self._solver.steps.resolution(resolution), _known(engine)
        return self._rows(ContactQueries.edges_collide, self._way(q0, q1), threads, executor, progress, extras)

    @overload
    def edge_is_free(self, q0: UnknownShape, q1: UnknownShape, **work: Unpack[Work]) -> bool | Bools: ...
    @overload
    def edge_is_free(self, q0: OneRow, q1: OneRow, **work: Unpack[Work]) -> bool: ...
    @overload
    def edge_is_free(self, q0: Rows, q1: Rows, **work: Unpack[Work]) -> Bools: ...
    @overload
    def edge_is_free(self, q0: ArrayLike, q1: ArrayLike, **work: Unpack[Work]) -> bool | Bools: ...
    def edge_is_free(
        self,
        q0: ArrayLike,
        q1: ArrayLike,
        *,
        threads: int | None = None,
        executor: Executor | None = None,
        progress: bool = False,
    ) -> bool | Bools:
        """Return whether it is proved that nothing touches anywhere on the straight way between two configurations.

        True is a proof: distances along the way are compared with how far bodies can move (bounded as for
        `edge_in_collision`), so nothing is passed over. False means that bodies touch, or come nearer to each other
        than 1e-5 of the extent. Joint values in between are not rounded to any step. Arguments, result and errors are
        as for `edge_in_collision`.
        """
        return self._rows(ContactQueries.edges_are_free, self._way(q0, q1), threads, executor, progress)

    def check_path(
        self,
        path: ArrayLike,
        resolution: float | None = None,
        *,
        threads: int | None = None,
        executor: Executor | None = None,
        progress: bool = False,
        engine: Engine | None = None,
    ) -> PathReport:
        """Check the validity of a path's configurations, (k, dim), and of the straight edges between them.

        The other arguments, and errors, are as for `edge_in_collision`.
        """
        rows = self.space.check(path)
        if rows.ndim != 2:
            raise ValueError(f"a path of shape {rows.shape}; expected (k, {self.space.dim})")
        work: VerdictWork = {"threads": threads, "executor": executor, "progress": progress, "engine": engine}
        good = np.asarray(self.is_valid(rows, **work))
        start, delta = rows[:-1], self.space.difference(rows[:-1], rows[1:])
        counts = self._solver.steps.bounded_counts(start, delta, resolution)
        failed = self.first_invalid_steps(start, delta, counts, **work)
        bad = np.flatnonzero(~good | np.append(failed >= 0, False)[: len(rows)])
        if not len(bad):
            return PathReport(True, good, failed < 0, None, None, ())
        i = int(bad[0])
        edge = slice(i, i + 1)
        q = even_rows(start[edge], delta[edge], counts[edge], failed[edge])[0] if good[i] else rows[i].copy()
        return PathReport(False, good, failed < 0, i, q, tuple(self._solver.contacts(q, engine)))

    def first_invalid_steps(
        self, start: Array, delta: Array, counts: NDArray[np.int64], **work: Unpack[VerdictWork]
    ) -> NDArray[np.int64]:
        """Return which step of each straight way is the first that is not valid, (e,), counted from 0; -1 for none.

        Args:
            start: Where the ways begin, (e, dim), known to be finite.
            delta: Where they lead from there, (e, dim), as `space.difference` gives it.
            counts: How many even steps each has, both ends included, (e,).
            **work: As for `in_collision`.
        """
        threads, executor, progress = work.get("threads"), work.get("executor"), work.get("progress", False)
        if executor is None:
            threads = thread_count(threads, int(counts.sum()))
        columns, extras = (start, delta, counts), (_known(work.get("engine")),)
        return self._rows(ContactQueries.first_invalid, columns, threads, executor, progress, extras, kind=np.int64)

    def resolution(self, resolution: float | None = None) -> float:
        """Return the step in metres that a resolution means: itself, else the file's PositionRes, else 0.01 extent.

        Raises:
            TypeError: The resolution is not a number.
            ValueError: It is not positive, or not finite.
        """
        return self._solver.steps.resolution(resolution)

    def edge_rows(self, q0: ArrayLike, q1: ArrayLike, resolution: float | None = None) -> Array:
        """Return the configurations, (n, dim), that `edge_in_collision` looks at from q0 to q1, (dim,), ends included.

        Raises:
            ValueError: q0 or q1 is not a configuration, or the resolution is not positive, or too small for the edge.
        """
        return self._solver.steps.rows(q0, q1, resolution)

    def warm_up(self, *, wait: bool = True) -> float:
        """Make ready what the first query would have to wait for; return the seconds that it took.

        The exact engine is compiled at its first use, and kept on disk for later ones.

        Args:
            wait: False works in a thread of its own, and returns 0.0 at once.

        Raises:
            ValueError: There is no folder to keep what is compiled.
        """
        if not wait:
            threading.Thread(target=self._solver.warm_up, name="env2mjcf-warm-up", daemon=True).start()
            return 0.0
        start = time.perf_counter()
        self._solver.warm_up()
        return time.perf_counter() - start

    # Copies and pickles: the compiled scene, the model and the state of `data` travel, the rest is built again.

    def __getstate__(self) -> dict[str, Any]:
        # Data holds its model, and a copy of data holds a copy of it.
        return {"compiled": self._compiled, "simulation": self.model if self._data is None else self._data}

    def __setstate__(self, state: dict[str, Any]) -> None:
        held: mujoco.MjModel | mujoco.MjData = state["simulation"]
        self.__init__(state["compiled"], held.model if isinstance(held, mujoco.MjData) else held)
        self._data = held if isinstance(held, mujoco.MjData) else None

    def __deepcopy__(self, memo: dict[int, Any]) -> Scene:
        state = self.__getstate__()
        twin = Scene.__new__(Scene)
        twin.__setstate__({**state, "simulation": copy.deepcopy(state["simulation"], memo)})
        return twin

    def __repr__(self) -> str:
        robots = len(self._compiled.assembly.robots)
        return (
            f"<Scene {self.environment.name!r}: {robots} robot{'' if robots == 1 else 's'}, "
            f"{len(self._solver.links)} links, {self.space.dim} degrees of freedom, "
            f"{len(self.obstacle_names)} obstacles>"
        )

    # How rows are worked on.

    def _rows(
        self,
        function: Callable[..., Any],
        columns: tuple[NDArray[Any], ...],
        threads: int | None,
        executor: Executor | None,
        progress: bool,
        extras: tuple[Any, ...] = (),
        *,
        kind: type[np.generic] = np.bool_,
        shape: tuple[int, ...] = (),
        row_bytes: int | None = None,
    ) -> Any:
        """Return an answer for each row, each an array of this kind and shape; for a single row the answer itself."""
        one = columns[0].ndim == 1
        given = tuple(c[None] for c in columns) if one else columns
        answers = np.empty((len(given[0]), *shape), dtype=kind)

        def store(where: slice, some: NDArray[Any]) -> None:
            answers[where] = some

        question = Question(function, given, extras, row_bytes or self._solver.row_bytes())
        ask(self._solver, question, store, threads, executor, progress)
        return answers if not one else answers[0] if shape else answers[0].item()

    def _at_once(self, q: ArrayLike) -> Array | None:
        """Return a single good row as (1, dim), within a microsecond; None for all else, which takes the long way."""
        # A finite sum has finite terms; finite terms whose sum overflows take the long way, too.
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
    ) -> bool | Bools:
        rows, engine = self.space.check(q), _known(engine)
        row_bytes = self._solver.row_bytes(engine, verdicts=True)
        return self._rows(function, (rows,), threads, executor, progress, (engine,), row_bytes=row_bytes)

    def _way(self, q0: ArrayLike, q1: ArrayLike) -> tuple[Array, Array]:
        """Return where ways begin, and where they lead from there."""
        start, end = self.space.check(q0), self.space.check(q1)
        if start.shape != end.shape:
            raise ValueError(f"q0 has shape {start.shape} and q1 {end.shape}; expected equal shapes")
        return start, self.space.difference(start, end)


def _known(engine: Engine | None) -> Engine | None:
    """Return an engine, or raise a ValueError if it does not exist."""
    if engine is not None and engine not in _ENGINES:
        raise ValueError(f"engine={engine!r} is not one of {', '.join(map(repr, _ENGINES))}")
    return engine
