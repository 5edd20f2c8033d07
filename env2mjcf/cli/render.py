"""`env2mjcf render`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import tyro
from rich.text import Text
from tyro.conf import Positional

from ..options import Options
from ..system.files import refuse_unwritable
from .arguments import OptionFlags, Output, OutputFlags, camera_of, size_of
from .program import DONE
from .terminal import listed, loaded, one_line, print_diagnostics, print_json, print_parts, working


@dataclass(frozen=True, slots=True)
class Render:
    """Draw a scene into a PNG file, without a screen.

    The robots stand at --config (numbers in the file's own units), else at the start of the query, its other
    configurations drawn nearly transparent, else at home. The camera has everything in view; unless told, it looks from
    where the robots can be seen, and makes obstacles transparent where they cannot.

    Examples:
      env2mjcf render scene.env -o scene.png
      env2mjcf render serial.env -o hit.png --config -0.5 0 0 0.125 0.25 0 --contacts
      env2mjcf render scene.env -o query.png --query scene.query --camera top
      env2mjcf render scene.env -o way.png --trail scene.path --camera 120,-35

    Attributes:
        scene: An env file, an XML environment or a problem XML.
        out: The PNG file to write.
        config: Numbers of one configuration, of all robots, or of one behind its index.
        radians: Numbers are radians and metres.
        camera: overview, front, back, left, right, top, or azimuth,elevation of the line of sight in degrees.
        contacts: Tint what touches, and show where with arrows along the normals.
        trail: A path file: a line, and robots nearly transparent along it.
        size: Width and height in pixels.
        see_through: Draw obstacles transparent, or --no-see-through: never.
    """

    scene: Annotated[str, tyro.conf.arg(metavar="SCENE"), Positional]
    out: Annotated[str, tyro.conf.arg(aliases=("-o",), metavar="PICTURE.png")]
    config: Annotated[tuple[float, ...], tyro.conf.arg(metavar="NUMBERS")] = ()
    radians: bool = False
    camera: Annotated[str | None, tyro.conf.arg(metavar="NAME|AZIMUTH,ELEVATION")] = None
    contacts: bool = False
    trail: Annotated[str | None, tyro.conf.arg(metavar="PATH")] = None
    size: Annotated[str, tyro.conf.arg(metavar="WIDTHxHEIGHT")] = "1280x960"
    see_through: bool | None = None
    output: OutputFlags = field(default_factory=Output)
    options: OptionFlags = field(default_factory=Options)

    def run(self) -> int:
        """Draw, and say where the picture is."""
        from ..companions.configurations import of_file, of_numbers
        from ..view.pictures import picture

        if not self.out.lower().endswith(".png"):
            raise ValueError(f"--out is {self.out}; expected a file that ends in .png")
        camera, size = camera_of(self.camera), size_of(self.size)
        refuse_unwritable(self.out, "CFG552")
        scene, log = loaded(self.scene, self.options)
        trail = None if self.trail is None else of_file(scene, self.trail, self.radians, self.options.limits, log).q
        print_diagnostics(log, self.output.verbose)
        if self.config:
            rows = of_numbers(scene, [str(x) for x in self.config], self.radians).q
        else:
            rows = scene.queries[0].q if scene.queries else scene.space.home[None]
        with working("drawing"):
            picture(
                scene, rows[0], file=self.out, size=size, camera=camera, contacts=self.contacts, ghosts=rows[1:],
                trail=trail, see_through=self.see_through,
            )  # fmt: skip
        touching = sorted({(c.link, c.other) for c in scene.contacts(rows[0])}) if self.contacts else []
        if self.output.json:
            facts = {"picture": self.out, "size": size, "touching": touching}
            print_json({**facts, "diagnostics": listed(log, self.output.verbose)})
        else:
            lines = [Text(f"    {one_line(a)} touches {one_line(b)}") for a, b in touching]
            print_parts([Text(f"{one_line(self.out)}: {size[0]} x {size[1]} pixels", "bold"), *lines])
        return DONE
