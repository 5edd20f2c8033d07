"""Films of robots that follow a path."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import positive
from ..contact.types import Contact
from ..simulation.scene import Scene
from ..transforms import Array
from ..writing import output
from .encoding import encoder
from .framing import Camera, Viewpoint
from .marks import TRAIL, Polyline
from .offscreen import read_exactly
from .pictures import touched, trail_marks
from .shots import Frame, Shot, checked_size, taken
from .trails import paced, reference_points

# A way as long as the scene takes four seconds; none takes less than three or more than ten.
_SECONDS_PER_EXTENT, _SHORTEST, _LONGEST = 4.0, 3.0, 10.0
_GHOSTS = 5
# All pictures are described before the first is drawn.
_MOST_PICTURES, _WAY_POINTS = 10_000, 300
# The way that is still to go is drawn thinner than the way behind.
_AHEAD, _BEHIND = 1.5, 4.0


@dataclass(frozen=True, slots=True, eq=False)
class Film:
    """A film that was written.

    Attributes:
        file: Where.
        q: (n, dim) the configuration of each picture.
        fps: Pictures per second.
        touching: The contacts of each picture's configuration; empty where it is free.
        camera: Where it was taken from.
    """

    file: Path
    q: Array
    fps: int
    touching: tuple[tuple[Contact, ...], ...]
    camera: Viewpoint

    @property
    def in_contact(self) -> NDArray[np.bool_]:
        """(n,) whether something touches."""
        return np.array([bool(contacts) for contacts in self.touching], dtype=bool)


def film(
    scene: Scene,
    path: ArrayLike,
    file: str | os.PathLike[str],
    *,
    seconds: float | None = None,
    fps: int = 25,
    size: tuple[int, int] = (960, 720),
    camera: Camera | None = None,
    ghosts: bool = True,
    see_through: bool | None = None,
    advance: Callable[[int, int], None] | None = None,
) -> Film:
    """Film the robots as they follow a path at constant speed, the bodies that touch tinted.

    Args:
        scene: The scene.
        path: (k, dim) configurations; between them the way is straight, the short way round on periodic angles.
        file: An .mp4 or .gif file to write.
        seconds: How long the film is; by default as the path is long, from 3 to 10 seconds.
        fps: Pictures per second; at most 50 in a .gif.
        size: Width and height in pixels; odd ones are rounded down.
        camera: As for `picture`.
        ghosts: Draw the way as a line, and robots nearly transparent along it.
        see_through: As for `picture`.
        advance: Called with the number of pictures that are done, and of all.

    Raises:
        ConversionError: The film cannot be written.
        TypeError: A number, or the size, is of a wrong kind.
        ValueError: The path, the file's ending, or a number is not what it should be, or there would be more than
            10,000 pictures.
        RenderError: It cannot be drawn here, or the extra `view`, which writes films, is not installed.
    """
    encode = encoder(file, fps)
    width, height = (n // 2 * 2 for n in checked_size(size, least=2))  # films of odd sizes play nowhere
    length = _duration(scene, path) if seconds is None else positive("seconds", seconds)
    if length * fps > _MOST_PICTURES:
        raise ValueError(
            f"seconds is {length:g}, at {fps} pictures a second; expected a film of at most {_MOST_PICTURES} pictures"
        )
    count = max(2, round(length * fps))
    q, _ = paced(scene, path, count)
    touching = tuple(
        tuple(scene.contacts(row)) if hit else () for row, hit in zip(q, scene.in_collision(q), strict=True)
    )
    ways = reference_points(scene, q) if ghosts else np.zeros((0, count, 3))
    frames = [_frame(row, ways[:, _thinned(i + 1)], touching[i]) for i, row in enumerate(q)]
    marks = tuple(_ahead(mark) for mark in trail_marks(scene, path)) if ghosts else ()
    shades = paced(scene, path, _GHOSTS)[0] if ghosts else np.zeros((0, scene.space.dim))
    shot = Shot(scene, frames, (width, height), camera, shades, marks, see_through)
    with taken(shot) as (answer, stream), output(file, "CFG552") as beside:
        encode(beside, _pictures(stream, width, height, count, advance), fps)
    return Film(Path(os.fsdecode(file)), q, fps, touching, answer.camera)


def _duration(scene: Scene, path: ArrayLike) -> float:
    length = paced(scene, path, 2)[1]
    return min(max(_SECONDS_PER_EXTENT * length / scene.extent, _SHORTEST), _LONGEST)


def _thinned(count: int) -> NDArray[np.int64]:
    """Return the indices of the points that stand for so many, both ends included."""
    return np.unique(np.linspace(0, count - 1, min(count, _WAY_POINTS)).round().astype(np.int64))


def _frame(q: Array, ways: Array, contacts: Sequence[Contact]) -> Frame:
    """Return one picture: the ways (robots, n, 3) behind the robots, and what touches."""
    names, arrows = touched(contacts)
    behind = [Polyline(way, TRAIL, _BEHIND) for way in ways if np.ptp(way, axis=0).any()]
    return Frame(q, names, (*behind, *arrows))


def _ahead(mark: Polyline) -> Polyline:
    return Polyline(mark.points, TRAIL, _AHEAD)


def _pictures(
    stream: IO[bytes], width: int, height: int, count: int, advance: Callable[[int, int], None] | None
) -> Iterator[NDArray[np.uint8]]:
    for i in range(count):
        data = read_exactly(stream, width * height * 3)
        yield np.frombuffer(data, dtype=np.uint8).reshape(height, width, 3)
        if advance is not None:
            advance(i + 1, count)
