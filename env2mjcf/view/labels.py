"""Which body each pixel of a picture shows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..simulation.scene import Scene
from .framing import Camera, Viewpoint
from .offscreen import read_exactly
from .shots import Frame, Shot, checked_size, taken


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
    with taken(shot) as (answer, stream):
        geoms = np.frombuffer(read_exactly(stream, width * height * 4), dtype=np.int32).reshape(height, width)
    label_of = np.full(scene.model.ngeom + 1, -1, dtype=np.int32)
    for i, name in enumerate(names):
        label_of[scene.model.geom(f"{name}:visual").id] = i
    return Segmentation(label_of[geoms], names, answer.camera)
