"""Writes pictures one after the other as a film."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .offscreen import RenderError

Pictures = Iterator[NDArray[np.uint8]]
Encode = Callable[[Path, Pictures, int], None]

_COLORS = 128


def encoder(file: str | os.PathLike[str]) -> Encode:
    """Return the function that writes pictures (height, width, 3) as the kind of film that a name ends in.

    Raises:
        ValueError: The name ends in something else than .mp4 or .gif.
        RenderError: What writes such a film is not installed.
    """
    ending = Path(os.fsdecode(file)).suffix.lower()
    if ending not in _ENCODERS:
        raise ValueError(f"{os.fsdecode(file)} ends in {ending or 'nothing'}; expected .mp4 or .gif")
    encode, module = _ENCODERS[ending]
    if importlib.util.find_spec(module) is None:
        raise RenderError("films need more packages: pip install 'env2mjcf[view]'")
    return encode


def _mp4(file: Path, pictures: Pictures, fps: int) -> None:
    import imageio_ffmpeg

    first = next(pictures)
    size = (first.shape[1], first.shape[0])
    writer = imageio_ffmpeg.write_frames(
        # What every browser and every player shows; sharp edges need a little more than the usual quality of 5.
        str(file), size, fps=fps, codec="libx264", quality=7, macro_block_size=2, pix_fmt_out="yuv420p",
        output_params=["-movflags", "+faststart"],
    )  # fmt: skip
    writer.send(None)
    try:
        writer.send(np.ascontiguousarray(first))
        for picture in pictures:
            writer.send(np.ascontiguousarray(picture))
    finally:
        writer.close()


def _gif(file: Path, pictures: Pictures, fps: int) -> None:
    from PIL import Image

    first = Image.fromarray(next(pictures)).quantize(_COLORS, dither=Image.Dither.NONE)
    # One palette for all pictures, so that still parts stay still.
    rest = [Image.fromarray(p).quantize(palette=first, dither=Image.Dither.NONE) for p in pictures]
    # The end is held for a second before the film begins again; a GIF counts in hundredths.
    step = max(20, round(100 / fps) * 10)
    first.save(
        file, format="GIF", save_all=True, append_images=rest, loop=0, optimize=False,
        duration=[step] * len(rest) + [step + 1000],
    )  # fmt: skip


_ENCODERS: dict[str, tuple[Encode, str]] = {".mp4": (_mp4, "imageio_ffmpeg"), ".gif": (_gif, "PIL")}
