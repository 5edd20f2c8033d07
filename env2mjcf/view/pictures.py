"""One picture of a scene, and which body each of its pixels shows."""

from __future__ import annotations

import io
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..contact.types import Contact
from ..simulation.scene import Scene
from ..system.files import output
from .cameras import Camera, Viewpoint
from .marks import BAD, Arrows, Mark, Points, Polyline
from .offscreen import RenderError, read_exactly
from .shots import Frame, Shot, checked_size, taken
from .trails import paced, reference_points

# Robots along a trail.
_GHOSTS = 6
_TRAIL_POINTS = 160
# One arrow for each place: MuJoCo gives several contacts for a pair.
_MOST_ARROWS = 60


def picture(
    scene: Scene,
    q: ArrayLike | None = None,
    *,
    file: str | os.PathLike[str] | None = None,
    size: tuple[int, int] = (960, 720),
    camera: Camera | None = None,
    contacts: bool = False,
    ghosts: ArrayLike | None = None,
    trail: ArrayLike | None = None,
    marks: Sequence[Mark] = (),
    see_through: bool | None = None,
) -> NDArray[np.uint8]:
    """Draw a scene.

    Args:
        scene: The scene.
        q: (dim,) where the robots are; home by default.
        file: A PNG file to write, too.
        size: Width and height in pixels.
        camera: A `Viewpoint`; or a `Direction` or one of overview, front, back, left, right, top, which have everything
            in view; by default a direction is chosen from which the robots can be seen.
        contacts: Tint the bodies that touch, and show where with arrows along the normals.
        ghosts: (k, dim) configurations that are drawn nearly transparent.
        trail: (k, dim) a path: a line, and ghosts along it.
        marks: Lines and dots.
        see_through: Draw obstacles transparent; by default only where they would hide the robots.

    Returns:
        (height, width, 3) uint8, RGB.

    Raises:
        ConversionError: The file cannot be written.
        TypeError: The size or the camera is of a wrong kind.
        ValueError: q, ghosts, trail, size, camera or the file's ending are not what they should be.
        RenderError: It cannot be drawn here, or pillow, which writes files, is not installed.
    """
    width, height = checked_size(size)
    if file is not None and not os.fsdecode(file).lower().endswith(".png"):
        raise ValueError(f"file is {os.fsdecode(file)}; expected one that ends in .png")
    row = scene.space.home if q is None else scene.space.check(q)
    if row.ndim != 1:
        raise ValueError(f"q has shape {row.shape}; expected ({scene.space.dim},): others can be ghosts")
    shades = np.zeros((0, scene.space.dim)) if ghosts is None else np.atleast_2d(scene.space.check(ghosts))
    lines: list[Mark] = list(marks)
    if trail is not None:
        lines += trail_marks(scene, trail)
        shades = np.concatenate([shades, paced(scene, trail, _GHOSTS)[0]])
    touching, arrows = touched(scene.contacts(row)) if contacts else (frozenset[str](), ())
    frame = Frame(row, touching, arrows)
    shot = Shot(scene, [frame], (width, height), camera, shades, tuple(lines), see_through)
    with taken(shot) as (_, stream):
        data = read_exactly(stream, width * height * 3)
    pixels = np.frombuffer(data, dtype=np.uint8).reshape(height, width, 3)
    if file is not None:
        write_png(pixels, file)
    return pixels


def trail_marks(scene: Scene, path: ArrayLike) -> list[Polyline]:
    """Return a path as one line for each robot that it moves."""
    ways = reference_points(scene, paced(scene, path, _TRAIL_POINTS)[0])
    return [Polyline(way) for way in ways if np.ptp(way, axis=0).any()]


def touched(contacts: Sequence[Contact]) -> tuple[frozenset[str], tuple[Mark, ...]]:
    """Return the names of the bodies that touch, and marks that show where."""
    if not contacts:
        return frozenset(), ()
    names = frozenset(name for c in contacts for name in (c.link, c.other))
    some = contacts[:_MOST_ARROWS]
    places = np.array([c.position for c in some])
    return names, (Points(places, BAD, size=10.0), Arrows(places, [c.normal for c in some]))


def write_png(pixels: NDArray[np.uint8], file: str | os.PathLike[str]) -> None:
    """Write pixels, (height, width, 3) or (height, width, 4), as a PNG file, whole or not at all.

    Raises:
        ConversionError: It cannot be written.
        RenderError: Pillow is not installed.
    """
    try:
        from PIL import Image
    except ImportError:
        raise RenderError("files of pictures need one more package: pip install 'env2mjcf[view]'") from None
    # 256 colours are enough for shaded solids, and a third of the size.
    image = Image.fromarray(pixels).quantize(256, kmeans=1, dither=Image.Dither.FLOYDSTEINBERG)
    buffer = io.BytesIO()
    image.save(buffer, format="PNG", optimize=True)
    with output(file, "CFG552") as beside:
        beside.write_bytes(buffer.getvalue())


@dataclass(frozen=True, slots=True, eq=False)
class Segmentation:
    """The bodies in a picture.

    Attributes:
        labels: (height, width) int32, index into `names`; -1 where there is no body.
        names: Links, obstacles and surfaces.
        camera: Where the picture was taken from.
    """

    labels: NDArray[np.int32]
    names: tuple[str, ...]
    camera: Viewpoint


def segmentation(
    scene: Scene,
    q: ArrayLike | None = None,
    *,
    size: tuple[int, int] = (960, 720),
    camera: Camera | None = None,
    only: Iterable[str] | None = None,
) -> Segmentation:
    """Tell which body each pixel of `picture(scene, q)` shows.

    Args:
        scene: The scene.
        q: (dim,) where the robots are; home by default.
        size: Width and height in pixels.
        camera: As for `picture`.
        only: Names of the bodies that are drawn; all by default.

    Raises:
        TypeError: The size or the camera is of a wrong kind.
        ValueError: q, size, camera or a name are not what they should be.
        RenderError: It cannot be drawn here.
    """
    names = tuple(p.name for p in scene.compiled.assembly.parts())
    chosen = None if only is None else frozenset(only)
    if chosen is not None and (unknown := sorted(chosen - set(names))):
        raise ValueError(f"there is no body {unknown[0]!r}; expected some of {', '.join(names)}")
    row = scene.space.home if q is None else scene.space.check(q)
    width, height = checked_size(size)
    shot = Shot(scene, [Frame(row)], (width, height), camera, see_through=False, segmentation=True, only=chosen)
    with taken(shot) as (choice, stream):
        geoms = np.frombuffer(read_exactly(stream, width * height * 4), dtype=np.int32).reshape(height, width)
    label_of = np.full(scene.model.ngeom + 1, -1, dtype=np.int32)
    for i, name in enumerate(names):
        label_of[scene.model.geom(f"{name}:visual").id] = i
    return Segmentation(label_of[geoms], names, choice.camera)
