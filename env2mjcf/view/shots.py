"""What a picture, or each picture of a film, shows; and how that is told to the process that draws."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from numbers import Integral
from pathlib import Path
from typing import IO, Any

import mujoco
import numpy as np

from ..geometry.assembly import Part
from ..geometry.mesh import FAR
from ..kinematics.tree import DofKind
from ..mjcf.scenery import boundary_lines
from ..options import whole
from ..simulation.scene import Scene
from ..transforms import Array
from .cameras import FIELD_OF_VIEW, Camera, Direction, Viewpoint, box_corners, candidates, fitted, named_direction
from .marks import BAD, WIRE, Mark, Polyline
from .offscreen import RenderError, drawn

# A boundary that is so much larger than all bodies is drawn as far as the picture reaches.
_FAR_BOUNDARY = 2.0
# Up to so many configurations are framed by all their vertices, more of them by the boxes of their links.
_FEW = 4
_TINT = 0.65
_LARGEST = 8192


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One picture of a shot.

    Attributes:
        q: (dim,) the configuration.
        touching: Names of bodies that are tinted, because they touch.
        marks: Drawn in this picture only.
    """

    q: Array
    touching: frozenset[str] = frozenset()
    marks: tuple[Mark, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """Pictures from one camera.

    Attributes:
        scene: The scene.
        frames: At least one picture.
        size: Width and height in pixels.
        camera: Where to look from: a viewpoint, a direction or the name of one; None to choose.
        ghosts: (k, dim) configurations that are drawn nearly transparent, in every picture.
        marks: Drawn in every picture.
        see_through: Whether obstacles are transparent; None: where they would hide the robots.
        segmentation: Return which geom each pixel shows, instead of colours.
        only: Names of the bodies that are drawn; None for all.
    """

    scene: Scene
    frames: Sequence[Frame]
    size: tuple[int, int]
    camera: Camera | None = None
    ghosts: Array = field(default_factory=lambda: np.zeros((0, 0)))
    marks: tuple[Mark, ...] = ()
    see_through: bool | None = None
    segmentation: bool = False
    only: frozenset[str] | None = None


@dataclass(frozen=True, slots=True)
class Choice:
    """What the process that draws has chosen.

    Attributes:
        camera: Where it looks from.
        see_through: Whether obstacles are drawn transparent.
    """

    camera: Viewpoint
    see_through: bool


def checked_size(size: object, least: int = 1) -> tuple[int, int]:
    """Return the width and height of a picture in pixels.

    Raises:
        TypeError: It is not a pair of whole numbers.
        ValueError: One of them is out of range.
    """
    pair: tuple[object, ...] = tuple(size) if isinstance(size, Iterable) and not isinstance(size, str) else ()
    if len(pair) != 2 or any(isinstance(n, bool) or not isinstance(n, Integral) for n in pair):
        raise TypeError(f"size is {size!r}; expected width and height, two whole numbers of pixels")
    width, height = (whole("size", n, -sys.maxsize) for n in pair)
    if not least <= min(width, height) <= max(width, height) <= _LARGEST:
        raise ValueError(
            f"size is {width} x {height} pixels; expected at least {least} x {least}, "
            f"and at most {_LARGEST} x {_LARGEST}"
        )
    return width, height


@contextmanager
def taken(shot: Shot) -> Generator[tuple[Choice, IO[bytes]]]:
    """Draw a shot in a process of its own.

    Yields:
        What was chosen, and the stream that the pictures come out of; see `worker`.

    Raises:
        TypeError: The size or the camera is of a wrong kind.
        ValueError: The camera has an unknown name, or the size is out of range.
        RenderError: It cannot be drawn here.
    """
    checked_size(shot.size)
    points = _in_view(shot)
    views = _views(shot, points)
    with tempfile.TemporaryDirectory(prefix="env2mjcf-") as folder:
        model = Path(folder) / "scene.mjb"
        _save(shot.scene.model, model)
        with drawn(_request(shot, views, points, model)) as (head, stream):
            yield Choice(views[head["camera"]], head["see_through"]), stream


def _save(model: mujoco.MjModel, file: Path) -> None:
    """Write a model for the process that draws.

    Raises:
        RenderError: There is no room for it.
    """
    # MuJoCo would only warn, in a log in the current folder.
    content = np.zeros(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, content)
    try:
        file.write_bytes(content.data)
    except OSError as error:
        raise RenderError(f"cannot draw: {file} cannot be written: {error.strerror or error}") from error


def _views(shot: Shot, points: Array) -> list[Viewpoint]:
    """Return the viewpoints that may be chosen from."""
    if not isinstance(shot.camera, Viewpoint | Direction | str | None):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise TypeError(f"camera is {shot.camera!r}; expected a Viewpoint, a Direction or the name of one")
    if isinstance(shot.camera, Viewpoint):
        return [shot.camera]
    aspect = shot.size[0] / shot.size[1]
    if shot.camera is None:
        return [fitted(points, direction, aspect) for direction in candidates(_is_planar(shot.scene))]
    direction = named_direction(shot.camera) if isinstance(shot.camera, str) else shot.camera
    return [fitted(points, direction, aspect)]


def _request(shot: Shot, views: Sequence[Viewpoint], points: Array, model: Path) -> dict[str, Any]:
    scene, assembly = shot.scene, shot.scene.compiled.assembly
    center = (points.min(axis=0) + points.max(axis=0)) / 2 - scene.origin
    geoms = {p.name: scene.model.geom(f"{p.name}:visual").id for p in assembly.parts()}
    hidden = [] if shot.only is None else [g for name, g in geoms.items() if name not in shot.only]
    return {
        "model": str(model),
        "size": list(shot.size),
        "field_of_view": FIELD_OF_VIEW,
        "center": center.tolist(),
        "extent": max(_diagonal(points), 1e-9),
        "cameras": [{"position": (v.position - scene.origin).tolist(), "forward": v.forward} for v in views],
        "watched": [geoms[name] for name in _watched(shot)],
        "obstacles": [geoms[p.name] for p in (*assembly.obstacles, *assembly.surfaces)],
        "hidden": hidden,
        "see_through": shot.see_through,
        "segmentation": shot.segmentation,
        "ghosts": scene.space.qpos(shot.ghosts).tolist() if len(shot.ghosts) else [],
        "marks": [_described(mark, scene) for mark in (*_boundary_marks(scene), *shot.marks)],
        "frames": [_frame(shot, frame, geoms) for frame in shot.frames],
    }


def _watched(shot: Shot) -> list[str]:
    """Return the links that the camera is to see: those that touch in a single picture, else all."""
    touching = shot.frames[0].touching if len(shot.frames) == 1 else frozenset[str]()
    return [n for n in shot.scene.link_names if n in touching] or list(shot.scene.link_names)


def _frame(shot: Shot, frame: Frame, geoms: Mapping[str, int]) -> dict[str, Any]:
    tints: list[tuple[int, list[float]]] = []
    for name in sorted(frame.touching):
        own = shot.scene.model.geom_rgba[geoms[name]]
        tinted = (1 - _TINT) * own[:3] + _TINT * np.array(BAD[:3])
        tints.append((geoms[name], [*tinted.tolist(), float(own[3])]))
    qpos = shot.scene.space.qpos(frame.q).tolist()
    return {"qpos": qpos, "tints": tints, "marks": [_described(mark, shot.scene) for mark in frame.marks]}


def _described(mark: Mark, scene: Scene) -> dict[str, Any]:
    """Return a mark in terms of JSON, about the origin of the model."""
    described = mark.described()
    return {**described, "points": (np.reshape(described["points"], (-1, 3)) - scene.origin).tolist()}


def _is_planar(scene: Scene) -> bool:
    """Whether every robot that moves about does so in the plane."""
    robots = scene.compiled.assembly.robots
    bases = [{d.kind for d in r.kinematics.dofs if d.connection is None} for r in robots]
    return any(bases) and not any(DofKind.Z in kinds for kinds in bases)


def _boundary_marks(scene: Scene) -> list[Mark]:
    boundary = scene.compiled.assembly.boundary
    # One that is asked for is part of the model.
    if boundary is None or scene.compiled.options.boundary is not None:
        return []
    lines = boundary_lines(boundary, scene.compiled.assembly)
    return [Polyline(np.array(line) + scene.origin, WIRE, width=1.5) for line in lines]


def _in_view(shot: Shot) -> Array:
    """Return the points that the camera must see, (n, 3)."""
    assembly = shot.scene.compiled.assembly
    fixed = (*assembly.obstacles, *assembly.surfaces)
    points = [_moved(_vertices(p), p.pose[None]) + assembly.origin for p in fixed]
    rows = np.stack([frame.q for frame in shot.frames])
    rows = np.concatenate([rows, shot.ghosts]) if len(shot.ghosts) else rows
    poses = shot.scene.link_poses(rows)
    shape = _vertices if len(rows) <= _FEW else _box
    points += [_near(_moved(shape(p), poses[:, i]), shot.scene) for i, p in enumerate(assembly.links)]
    points += [np.asarray(mark.points, dtype=np.float64).reshape(-1, 3) for mark in shot.marks]
    bodies = np.concatenate([np.zeros((0, 3)), *points])
    if not len(bodies):
        bodies = np.array([assembly.lower, assembly.upper]) + assembly.origin
    wires = np.concatenate([np.zeros((0, 3)), *(np.array(mark.points) for mark in _boundary_marks(shot.scene))])
    near = len(wires) and _diagonal(wires) < _FAR_BOUNDARY * _diagonal(bodies)
    return np.concatenate([bodies, wires]) if near else bodies


def _near(points: Array, scene: Scene) -> Array:
    """Return points, (n, 3), without those of robots whose place, far from all else, does not count in the extent."""
    assembly = scene.compiled.assembly
    away = np.linalg.norm(
        points - np.clip(points, *(np.array([assembly.lower, assembly.upper]) + assembly.origin)), axis=1
    )
    return points[away <= FAR * assembly.extent]


def _vertices(part: Part) -> Array:
    """Return the vertices that a body's triangles use, (n, 3), in its own frame."""
    return part.used_vertices


def _box(part: Part) -> Array:
    """Return the corners of the box around a body, (8, 3), in its own frame."""
    used = _vertices(part)
    return box_corners(used.min(axis=0), used.max(axis=0))


def _diagonal(points: Array) -> float:
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def _moved(points: Array, poses: Array) -> Array:
    """Return points (k, 3) at each of n poses (n, 4, 4), (n * k, 3)."""
    return (points @ np.swapaxes(poses[:, :3, :3], -1, -2) + poses[:, None, :3, 3]).reshape(-1, 3)
