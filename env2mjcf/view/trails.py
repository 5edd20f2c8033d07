"""The way of a robot as a line through space, and places along it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..simulation.scene import Scene
from ..transforms import Array
from .cameras import box_corners

# An edge is cut so finely to be measured, drawn and played.
PARTS_OF_AN_EDGE = 16


def reference_points(scene: Scene, q: ArrayLike) -> Array:
    """Return one point of each robot, (robots, n, 3) in metres, whose ways show how the robots move.

    The middle of the base's box; of the last link's where the base is fixed.

    Args:
        scene: The scene.
        q: Configurations, (n, dim).
    """
    poses = scene.link_poses(np.atleast_2d(scene.space.check(q)))
    points: list[Array] = []
    first = 0
    for robot in scene.compiled.assembly.robots:
        i = 0 if any(d.connection is None for d in robot.kinematics.dofs) else len(robot.links) - 1
        used = robot.links[i].used_vertices
        middle = (used.min(axis=0) + used.max(axis=0)) / 2
        own = poses[:, first + i]
        points.append(own[:, :3, :3] @ middle + own[:, :3, 3])
        first += len(robot.links)
    return np.array(points).reshape(-1, len(poses), 3)


def fine(scene: Scene, path: ArrayLike) -> Array:
    """Return a path with every edge cut into equal parts, ((k - 1) * PARTS_OF_AN_EDGE + 1, dim).

    Angles that turn without end go on steadily: they may leave -pi..pi.
    """
    rows = scene.space.check(path)
    if rows.ndim != 2 or not len(rows):
        raise ValueError(f"a path of shape {rows.shape}; expected (k, {scene.space.dim}), k > 0")
    steps = scene.space.difference(rows[:-1], rows[1:])
    unwound = rows[0] + np.concatenate([np.zeros((1, scene.space.dim)), np.cumsum(steps, axis=0)])
    at = np.arange((len(rows) - 1) * PARTS_OF_AN_EDGE + 1) / PARTS_OF_AN_EDGE
    knots = np.arange(len(rows), dtype=np.float64)
    return _interpolated(at, knots, unwound)


def lengths(scene: Scene, rows: Array) -> Array:
    """Return how far the robots have come at each row, (n,), in metres.

    The way from one row to the next is that of the corner, of all links' boxes, that moves furthest.

    Args:
        scene: The scene.
        rows: Configurations close to each other, (n, dim).
    """
    moved = np.zeros(max(len(rows) - 1, 0))
    poses = scene.link_poses(rows)
    links = scene.compiled.assembly.links
    for i, part in enumerate(links):
        used = part.used_vertices
        for corner in box_corners(used.min(axis=0), used.max(axis=0)):
            way = poses[:, i, :3, :3] @ corner + poses[:, i, :3, 3]
            moved = np.maximum(moved, np.linalg.norm(np.diff(way, axis=0), axis=1))
    return np.concatenate([[0.0], np.cumsum(moved)])


def paced(scene: Scene, path: ArrayLike, count: int) -> tuple[Array, float]:
    """Return configurations that follow a path at constant speed, (count, dim), and its length in metres.

    The first and the last are the path's ends. Speed is that of the corner that moves furthest (see `lengths`).

    Raises:
        ValueError: The path is not a (k, dim) array of finite numbers, or the count is below 2.
    """
    if count < 2:
        raise ValueError(f"{count} configurations; expected at least 2, for both ends")
    rows = fine(scene, path)
    far = lengths(scene, rows)
    if far[-1] == 0:
        return np.repeat(rows[:1], count, axis=0), 0.0
    # Where nothing moves, time stands still.
    keep = np.concatenate([[True], np.diff(far) > 0])
    at = np.linspace(0.0, far[-1], count)
    return _interpolated(at, far[keep], rows[keep]), float(far[-1])


def _interpolated(at: Array, knots: Array, rows: Array) -> Array:
    """Return rows between those at the knots, (len(at), d)."""
    between = np.empty((len(at), rows.shape[1]))
    for i, column in enumerate(rows.T):
        between[:, i] = np.interp(at, knots, column)
    return between
