"""Paths of a scene, out of configurations or of recorded poses of every link."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..diagnostics import DiagnosticLog
from ..errors import Diagnostic
from ..formats import path as text
from ..formats.source import Source, read_source
from ..kinematics.forward import configuration_of_poses
from ..limits import Limits
from ..model.dialects import begins_with_robot
from ..model.environment import BaseKind, Dialect
from ..options import PathArgument
from ..simulation.scene import Scene
from ..transforms import Array, pose_gaps, rotation_matrix, transform
from .query_files import configurations, dofs_of, file_numbers, from_turns, standing, write

# What the planner divided angles by to write turns: its files fit twice as well as with 2 pi.
_TURN = 6.2832
# Poses are printed with six decimals: so much of a file unit, and of a radian at the end of a robot, is rounding.
_PRINTED_UNIT, _PRINTED_ANGLE = 2e-6, 3e-5


@dataclass(frozen=True, slots=True, eq=False)
class PathRecord:
    """A path file, read for a scene.

    Attributes:
        file: Its name.
        version: Of the format, such as 2012.
        q: (k, dim) configurations in metres and radians; other robots stand at the start of their query, else at home.
        robots: (k,) index of the robot that each belongs to; -1 for all at once.
        lines: (k,) line of the file that each begins on.
        poses: (k, nlinks, 4, 4) world poses of all links, where the file holds poses; else None. `q` is recovered
            from them.
        pose_errors: (k,) metres that a point of a link is away at most from where the file has it, when the links are
            placed with `q`; zero where the file holds configurations.
        fits: (k,) whether `q` places the links as the file says, but for rounding.
        diagnostics: What was found.
    """

    file: str
    version: int
    q: Array
    robots: NDArray[np.int64]
    lines: NDArray[np.int64]
    poses: Array | None
    pose_errors: Array
    fits: NDArray[np.bool_]
    diagnostics: tuple[Diagnostic, ...] = ()

    @property
    def pose_error(self) -> float:
        """The greatest of `pose_errors`, in metres."""
        return float(self.pose_errors.max(initial=0.0))

    def __len__(self) -> int:
        return len(self.q)

    def __repr__(self) -> str:
        return f"<PathRecord {self.file!r}: {len(self)} configurations>"


def read_path(scene: Scene, file: PathArgument, *, limits: Limits | None = None, strict: bool = False) -> PathRecord:
    """Read a path file of any version for a scene.

    Recorded poses of links are turned into configurations, and the links are placed with these to see how far off
    that is; where the poses belong to no configuration of the robot, there is a diagnostic.

    Args:
        scene: Whose path it is.
        file: A path file.
        limits: Bounds on hostile input.
        strict: Whether warnings are errors.

    Raises:
        FormatError: The file cannot be read, is cut off, or is the path of another robot.
    """
    log = DiagnosticLog(strict)
    return path_record(scene, read_source(file, log, limits or Limits()), log)


def path_record(scene: Scene, source: Source, log: DiagnosticLog) -> PathRecord:
    """Read a path from a text; see `read_path`."""
    found = text.read_path(source, dofs_of(scene), _pose_counts(scene), log)
    lines = np.array(found.lines, dtype=np.int64)
    if found.poses is not None:
        return _of_poses(scene, source, found, found.poses, log)
    rows: list[tuple[int, Sequence[float]]] = [(row.robot, row.configuration) for row in found.rows]
    if found.version in text.OF_TURNS:
        rows = from_turns(scene, rows, source.path, source.line_span(1), log)
    q = configurations(scene, rows)
    robots = np.array([row.robot for row in found.rows], dtype=np.int64)
    none = np.zeros(len(q))
    return PathRecord(source.path, found.version, q, robots, lines, None, none, none == 0, tuple(log))


def write_path(scene: Scene, q: ArrayLike, file: PathArgument, robot: int | None = 0) -> Path:
    """Write a path as the newest planner reads it, whole or not at all; for dialect A, as its viewer did.

    Numbers have 17 digits: reading them back gives the same doubles for lengths, and for angles that were read from a
    file; any other angle may differ in its last bit.

    Args:
        scene: Whose path it is.
        q: (k, dim) configurations in metres and radians.
        file: The file to write; replaced if it exists.
        robot: Whose numbers are written; None writes those of all robots, behind a 0 where rows have an index.

    Raises:
        ConversionError: The file cannot be written.
        TypeError: The robot is not a whole number.
        ValueError: q has a wrong shape or a value that is not finite, or there is no such robot.
    """
    rows = file_numbers(scene, q, robot)
    version = text.TURNS if scene.environment.dialect is Dialect.A else text.CURRENT
    index = (robot or 0) if begins_with_robot(scene.environment) else None
    return write(file, text.path_text(rows, version, index))


def _pose_counts(scene: Scene) -> list[int]:
    """Return how many poses a configuration of robot 0 may have: the planner left fixed bases out."""
    robots = scene.environment.robots
    if not robots:
        return []
    every = len(robots[0].bodies)
    return [every, every - sum(b.base is BaseKind.FIXED for b in robots[0].bodies)]


def _of_poses(scene: Scene, source: Source, found: text.PathFile, numbers: Array, log: DiagnosticLog) -> PathRecord:
    robot = scene.compiled.assembly.robots[0]
    scale = scene.compiled.options.scale
    angles = _TURN * numbers[..., 3:]
    recorded = transform(rotation_matrix(*np.moveaxis(angles, -1, 0)), scale * numbers[..., :3])
    k, n = len(recorded), len(robot.links)
    # Links of robot 0 come first.
    rest = standing(scene)
    poses = np.tile(scene.link_poses(rest), (k, 1, 1, 1))
    moving = [i for i, b in enumerate(robot.kinematics.multibody.bodies) if b.base is not BaseKind.FIXED]
    poses[:, list(range(n)) if recorded.shape[1] == n else moving] = recorded
    q = np.tile(rest, (k, 1))
    q[:, scene.space.robot_slices[0]] = configuration_of_poses(robot.kinematics, poses[:, :n])
    radii = np.array([p.radius for p in robot.links])
    errors = pose_gaps(scene.link_poses(q)[:, :n], poses[:, :n], radii).max(axis=1, initial=0.0)
    fits = errors <= _PRINTED_UNIT * scale + _PRINTED_ANGLE * robot.radius
    _report_misfits(source, found, errors, fits, log)
    robots, lines = np.zeros(k, dtype=np.int64), np.array(found.lines, dtype=np.int64)
    return PathRecord(source.path, found.version, q, robots, lines, poses, errors, fits, tuple(log))


def _report_misfits(
    source: Source, found: text.PathFile, errors: Array, fits: NDArray[np.bool_], log: DiagnosticLog
) -> None:
    if fits.all():
        return
    worst, first = float(errors.max()), int(np.argmin(fits))
    message = (
        f"{int((~fits).sum())} of {len(fits)} recorded poses belong to no configuration of the robot: links are up to "
        f"{worst:.3g} m away from where they should be"
    )
    hint = "is it the path of another robot? Links are checked where the file has them"
    log.warn("CFG518", source.path, message, hint=hint, span=source.line_span(found.lines[first]))
