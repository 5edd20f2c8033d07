"""The scenes that are measured, what is expected of each, and what was prepared of it."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from configurations import uniform_and_near
from generated import arm_among_obstacles, cube_among_boxes, maze_copies, snake_among_boxes
from judged import Judged
from table import Case, corpus_cases

import env2mjcf

# Bodies of which Truth keeps the poses at once, and pairs of which it tests containment, are not to be too many.
_PAIRS_TIMES_ROWS = 4_000_000
# Poses that a peer keeps as objects of its own.
_LINKS_TIMES_ROWS = 100_000


@dataclass(frozen=True, slots=True)
class Mark:
    """What a scene is to reach: time as a share of the quicker of coal and python-fcl, and of MuJoCo's C loop."""

    peers: float | None
    c_loop: float


class Subject:
    """A scene under measurement; what it takes is prepared when it is first asked for.

    Args:
        case: The scene.
        mark: What is expected of it.
        count: Configurations of each half, at most.
        seed: Of the configurations.
    """

    def __init__(self, case: Case, mark: Mark, count: int, seed: int = 11) -> None:
        self.name, self.case, self.mark = case.name, case, mark
        self._count, self._seed = count, seed

    @functools.cached_property
    def auto(self) -> env2mjcf.Scene:
        """The scene, closed meshes being solid."""
        return warm(env2mjcf.load(self.case.path, **self.case.options))

    @functools.cached_property
    def surface(self) -> env2mjcf.Scene:
        """The scene, all meshes being surfaces."""
        return warm(env2mjcf.load(self.case.path, collision="surface", **self.case.options))

    @functools.cached_property
    def judged(self) -> Judged:
        """Judges verdicts on the first configurations of each half."""
        least = max(200, _PAIRS_TIMES_ROWS // max(1, len(self.auto.pairs)))
        return Judged(self.auto, {half: self.rows[part][:least] for half, part in self.halves.items()}, self.halves)

    @property
    def rows(self) -> np.ndarray:
        """All configurations, (n, dim)."""
        return self._configurations[0]

    @property
    def halves(self) -> dict[str, slice]:
        """Which configurations are of which half."""
        return self._configurations[1]

    @functools.cached_property
    def _configurations(self) -> tuple[np.ndarray, dict[str, slice]]:
        count = max(400, min(self._count, _LINKS_TIMES_ROWS // len(self.auto.link_names)))
        return uniform_and_near(self.surface, count, self._seed)


def warm(scene: env2mjcf.Scene) -> env2mjcf.Scene:
    """Have a scene compile whatever it compiles, so that nothing of that is measured; return it."""
    if hasattr(scene, "warm_up"):
        scene.warm_up()
    return scene


def has_exact(scene: env2mjcf.Scene) -> bool:
    """Return whether there is an engine of its own for the scene."""
    try:
        scene.in_collision(scene.space.home[None], engine="exact")
    except ValueError:  # numba is not installed
        return False
    return True


_DENSE, _OTHER = 0.3, 1.0
_CORPUS = {
    "alpha1.6.alpha": Mark(0.7, _DENSE),
    "bug_trap1.0.bug-trap": Mark(0.7, _DENSE),
    "Maze.maze": Mark(0.18, _DENSE),
    "SerialWalls.serial": Mark(0.18, _OTHER),
    "Heterogeneous.heterogeneous2D": Mark(0.25, _OTHER),
    "LTunnel.tunnel": Mark(0.25, _OTHER),
    "ZTunnel.tunnel": Mark(0.10, _OTHER),
    "Box.box": Mark(0.05, _OTHER),
    "SimpleObstacle.Obstacle1.obstacle": Mark(0.06, _OTHER),
    "SimpleObstacle.Obstacle2.obstacle": Mark(0.06, _OTHER),
    "SimpleObstacle.Obstacle3.obstacle": Mark(0.06, _OTHER),
    "pmpl-ReachableVolumes.Walls22d.walls5": Mark(None, _OTHER),
}
# Dense walls, or 30 obstacles and more.
_MANY = Mark(None, _DENSE)


def subjects(corpus: Path, folder: Path, count: int) -> dict[str, Subject]:
    """Return all scenes by name, in the order of the tables.

    Args:
        corpus: The folder of real scenes.
        folder: A temporary one for those that are written here.
        count: Configurations of each half, at most.
    """
    real = {case.name: case for case in corpus_cases(corpus)}
    found = [(real[name], mark) for name, mark in _CORPUS.items()]
    found += [(case, _MANY) for case in _written(folder, real["Maze.maze"])]
    return {case.name: Subject(case, mark, count) for case, mark in found}


def _written(folder: Path, maze: Case) -> Iterator[Case]:
    makers: dict[str, Callable[[Path], Case]] = {
        "maze4": lambda f: maze_copies(f, maze, 4),
        "maze16": lambda f: maze_copies(f, maze, 16),
        "boxes50": lambda f: cube_among_boxes(f, 50),
        "boxes500": lambda f: cube_among_boxes(f, 500),
        "boxes5000": lambda f: cube_among_boxes(f, 5000),
        "snake64": snake_among_boxes,
        "arm7": arm_among_obstacles,
    }
    for name, make in makers.items():
        # Scenes of one name each have meshes of their own.
        (folder / name).mkdir()
        yield make(folder / name)
