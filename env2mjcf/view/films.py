"""Films of robots that follow a path: what each picture shows, and how pictures become an .mp4 or .gif file."""

from __future__ import annotations

import importlib.util
import itertools
import os
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..contact.types import Contact
from ..options import positive, whole
from ..simulation.scene import Scene
from ..system.files import output
from ..transforms import Array
from .cameras import Camera, Viewpoint
from .marks import TRAIL, Polyline
from .offscreen import RenderError, read_exactly
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
        file: The .mp4 or .gif file.
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
        seconds: Length of the film; by default 3 to 10, by the length of the path.
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
    if seconds is None:
        way = paced(scene, path, 2)[1]
        length = min(max(_SECONDS_PER_EXTENT * way / scene.extent, _SHORTEST), _LONGEST)
    else:
        length = positive("seconds", seconds)
    if length * fps > _MOST_PICTURES:
        raise ValueError(
            f"seconds is {length:g}, at {fps} pictures a second; expected a film of at most {_MOST_PICTURES} pictures"
        )
    count = max(2, round(length * fps))
    q, _ = paced(scene, path, count)
    touching = tuple(tuple(scene.contacts(row)) for row in q)
    ways = reference_points(scene, q) if ghosts else np.zeros((0, count, 3))
    frames = [_frame(row, ways[:, _thinned(i + 1)], touching[i]) for i, row in enumerate(q)]
    marks = tuple(Polyline(mark.points, TRAIL, _AHEAD) for mark in trail_marks(scene, path)) if ghosts else ()
    shades = paced(scene, path, _GHOSTS)[0] if ghosts else np.zeros((0, scene.space.dim))
    shot = Shot(scene, frames, (width, height), camera, shades, marks, see_through)
    with taken(shot) as (choice, stream), output(file, "CFG552") as beside:
        encode(beside, _pictures(stream, width, height, count, advance), fps)
    return Film(Path(os.fsdecode(file)), q, fps, touching, choice.camera)


def _thinned(count: int) -> NDArray[np.int64]:
    """Return the indices of the points that stand for so many, both ends included."""
    return np.unique(np.linspace(0, count - 1, min(count, _WAY_POINTS)).round().astype(np.int64))


def _frame(q: Array, ways: Array, contacts: Sequence[Contact]) -> Frame:
    """Return one picture: the ways (robots, n, 3) behind the robots, and what touches."""
    names, arrows = touched(contacts)
    behind = [Polyline(way, TRAIL, _BEHIND) for way in ways if np.ptp(way, axis=0).any()]
    return Frame(q, names, (*behind, *arrows))


def _pictures(
    stream: IO[bytes], width: int, height: int, count: int, advance: Callable[[int, int], None] | None
) -> Iterator[NDArray[np.uint8]]:
    for i in range(count):
        data = read_exactly(stream, width * height * 3)
        yield np.frombuffer(data, dtype=np.uint8).reshape(height, width, 3)
        if advance is not None:
            advance(i + 1, count)


Pictures = Iterator[NDArray[np.uint8]]
Encode = Callable[[Path, Pictures, int], None]

_COLORS = 128
_FASTEST = 1000
# Players show pictures of a GIF for a fiftieth of a second at least: what asks for less, they slow down.
_FASTEST_GIF = 50


def encoder(file: str | os.PathLike[str], fps: int) -> Encode:
    """Return the function that writes pictures (height, width, 3) as the kind of film that a name ends in.

    Args:
        file: Its name.
        fps: Pictures per second.

    Raises:
        TypeError: fps is not a whole number.
        ValueError: The name ends in something else than .mp4 or .gif, or such a film cannot be so quick.
        RenderError: What writes such a film is not installed.
    """
    ending = Path(os.fsdecode(file)).suffix.lower()
    if ending not in _ENCODERS:
        raise ValueError(f"{os.fsdecode(file)} ends in {ending or 'nothing'}; expected .mp4 or .gif")
    if whole("fps", fps, 1, _FASTEST) > _FASTEST_GIF and ending == ".gif":
        raise ValueError(
            f"fps is {fps}; a .gif has at most {_FASTEST_GIF} pictures a second: ask for fewer, or for an .mp4"
        )
    encode, module = _ENCODERS[ending]
    if importlib.util.find_spec(module) is None:
        raise RenderError("films need more packages: pip install 'env2mjcf[view]'")
    return encode


def _mp4(file: Path, pictures: Pictures, fps: int) -> None:
    from imageio_ffmpeg import get_ffmpeg_exe

    first = next(pictures)
    height, width = first.shape[:2]
    command = [
        str(get_ffmpeg_exe()), "-y", "-loglevel", "error",
        "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-framerate", str(fps), "-i", "-",
        # What every browser and every player shows; sharp edges need a little more than the usual quality of 25.
        "-an", "-codec:v", "libx264", "-crf", "15", "-pix_fmt", "yuv420p", "-movflags", "+faststart", f"file:{file}",
    ]  # fmt: skip
    # Run here and not by imageio_ffmpeg, which does not say that ffmpeg failed: a full disk left half a film.
    # Ctrl-C is for this process, which stops the encoder.
    group = 0 if os.name == "posix" else None
    with tempfile.TemporaryFile() as errors:
        encoder = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=errors, process_group=group
        )
        try:
            assert encoder.stdin is not None
            _fed(encoder.stdin, itertools.chain([first], pictures))
            status = encoder.wait()
        finally:
            encoder.kill()
            encoder.wait()
        if status:
            errors.seek(0)
            said = errors.read().decode("utf-8", "replace").split("\n")
            how = f"signal {-status}" if status < 0 else f"status {status}"
            # The first line is the cause, the others follow from it.
            raise OSError(f"ffmpeg ended with {how}: {said[0] or 'it does not say why'}")


def _fed(stdin: IO[bytes], pictures: Pictures) -> None:
    try:
        with stdin:
            for picture in pictures:
                stdin.write(np.ascontiguousarray(picture).data)
    except BrokenPipeError:
        pass  # the encoder has ended, and its own words say why


def _gif(file: Path, pictures: Pictures, fps: int) -> None:
    from PIL import Image

    first = Image.fromarray(next(pictures)).quantize(_COLORS, dither=Image.Dither.NONE)
    # One palette for all pictures, so that still parts stay still.
    rest = [Image.fromarray(p).quantize(palette=first, dither=Image.Dither.NONE) for p in pictures]
    # A GIF counts in hundredths: sums are rounded, so that the whole is as long as it should be.
    ends = [round(100 * (i + 1) / fps) * 10 for i in range(len(rest) + 1)]
    steps = [b - a for a, b in pairwise([0, *ends])]
    steps[-1] += 1000  # the end is held before the film begins again
    first.save(file, format="GIF", save_all=True, append_images=rest, loop=0, optimize=False, duration=steps)


_ENCODERS: dict[str, tuple[Encode, str]] = {".mp4": (_mp4, "imageio_ffmpeg"), ".gif": (_gif, "PIL")}
