"""`env2mjcf play`."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.text import Text
from tqdm import tqdm
from tyro.conf import Positional

from ..options import Options
from ..system.files import refuse_unwritable
from .arguments import OptionFlags, Output, OutputFlags, camera_of, size_of
from .program import DONE
from .terminal import listed, loaded, one_line, print_diagnostics, print_json, print_parts

if TYPE_CHECKING:
    from ..contact.types import Contact
    from ..view.films import Film

# Stretches of contact that are listed.
_LISTED = 20


@dataclass(frozen=True, slots=True)
class Play:
    """Film the robots as they follow a path, without a screen.

    They move at constant speed, whatever the distances between the path's configurations; what touches is tinted, and
    shown with arrows. The path is a .path file, or a .csv or .npy file of rows in the file's own units. Exit status 0
    says that the film is written; the contacts are listed, and `env2mjcf check` judges.

    Examples:
      env2mjcf play serial.env serial.path -o serial.mp4
      env2mjcf play serial.env serial.path -o serial.gif --size 480x360 --fps 12
      env2mjcf play scene.env way.npy --radians -o way.mp4 --seconds 8 --camera top

    Attributes:
        scene: An env file, an XML environment or a problem XML.
        path: What the robots follow.
        out: The .mp4 or .gif file to write.
        radians: Numbers of a .csv or .npy file are radians and metres.
        seconds: Length of the film; by default 3 to 10 seconds, by the length of the path.
        fps: Pictures per second.
        camera: overview, front, back, left, right, top, or azimuth,elevation of the line of sight in degrees.
        ghosts: Draw the way as a line, and robots nearly transparent along it.
        size: Width and height in pixels.
        see_through: Draw obstacles transparent, or --no-see-through: never.
    """

    scene: Annotated[str, tyro.conf.arg(metavar="SCENE"), Positional]
    path: Annotated[str, tyro.conf.arg(metavar="PATH"), Positional]
    out: Annotated[str, tyro.conf.arg(aliases=("-o",), metavar="FILM.mp4|.gif")]
    radians: bool = False
    seconds: Annotated[float | None, tyro.conf.arg(metavar="S")] = None
    fps: Annotated[int, tyro.conf.arg(metavar="N")] = 25
    camera: Annotated[str | None, tyro.conf.arg(metavar="NAME|AZIMUTH,ELEVATION")] = None
    ghosts: bool = True
    size: Annotated[str, tyro.conf.arg(metavar="WIDTHxHEIGHT")] = "960x720"
    see_through: bool | None = None
    output: OutputFlags = field(default_factory=Output)
    options: OptionFlags = field(default_factory=Options)

    def run(self) -> int:
        """Write the film, and say what touches in it."""
        from ..companions.configurations import of_file
        from ..view.films import encoder, film
        from ..view.shots import checked_size

        camera, size = camera_of(self.camera), size_of(self.size)
        encoder(self.out, self.fps)
        checked_size(size, least=2)
        refuse_unwritable(self.out, "CFG552")
        options = dataclasses.replace(self.options, query=None)
        scene, log = loaded(self.scene, options)
        path = of_file(scene, self.path, self.radians, self.options.limits, log).q
        print_diagnostics(log, self.output.verbose)
        with tqdm(unit="picture", delay=1, leave=False, disable=not sys.stderr.isatty()) as bar:

            def advance(done: int, total: int) -> None:
                bar.total = total
                bar.update(done - bar.n)

            made = film(
                scene, path, self.out, seconds=self.seconds, fps=self.fps, size=size, camera=camera,
                ghosts=self.ghosts, see_through=self.see_through, advance=advance,
            )  # fmt: skip
        if self.output.json:
            touching = [sorted({(c.link, c.other) for c in found}) for found in made.touching]
            facts = {"film": self.out, "pictures": len(made.q), "fps": made.fps, "configurations": made.q}
            print_json({**facts, "touching": touching, "diagnostics": listed(log, self.output.verbose)})
        else:
            print_parts(_lines(made))
        return DONE


def _lines(made: Film) -> Iterator[Text]:
    count = len(made.q)
    yield Text(f"{one_line(str(made.file))}: {count} pictures, {count / made.fps:g} seconds", "bold")
    stretches = [
        (names, [i for i, _ in group])
        for names, group in groupby(enumerate(made.touching), lambda item: _names(item[1]))
        if names
    ]
    if not stretches:
        yield Text("    nothing touches", "green")
    for names, numbers in stretches[:_LISTED]:
        first, last = numbers[0] / made.fps, numbers[-1] / made.fps
        when = f"at {first:.2f} s" if len(numbers) == 1 else f"from {first:.2f} to {last:.2f} s"
        yield Text(f"    {when}: {names}", "red")
    if len(stretches) > _LISTED:
        yield Text(f"    ... and {len(stretches) - _LISTED} more stretches", "dim")


def _names(contacts: tuple[Contact, ...]) -> str:
    pairs = sorted({(c.link, c.other) for c in contacts})
    return ", ".join(f"{one_line(a)} touches {one_line(b)}" for a, b in pairs)
