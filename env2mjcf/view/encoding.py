"""Writes pictures one after the other as a film."""

from __future__ import annotations

import importlib.util
import itertools
import os
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from ..arguments import whole
from .offscreen import RenderError

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
        TypeError: fps is no whole number.
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
    first.save(
        file, format="GIF", save_all=True, append_images=rest, loop=0, optimize=False,
        duration=steps,
    )  # fmt: skip


_ENCODERS: dict[str, tuple[Encode, str]] = {".mp4": (_mp4, "imageio_ffmpeg"), ".gif": (_gif, "PIL")}
