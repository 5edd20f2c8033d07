"""`env2mjcf convert`."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro
from tyro.conf import Positional

from ..options import Options
from .arguments import OptionFlags, Output, OutputFlags, keywords
from .program import DONE
from .terminal import listed, one_line, print_diagnostics, print_json, working


@dataclass(frozen=True, slots=True)
class Convert:
    """Write a scene as a folder of MJCF and assets, and print the path of the MJCF file.

    Examples:
      env2mjcf convert serial.env                      serial_mjcf/serial.xml
      env2mjcf convert box.env out/ --robots box.robot
      env2mjcf convert puzzle.env -o out/puzzle.xml --scale 0.01 --actuators position
      python -m mujoco.viewer --mjcf="$(env2mjcf convert serial.env)"

    Attributes:
        scene: An env file, an XML environment or a problem XML.
        out: The folder to write to, or a .xml file in one. Without it: <scene>_mjcf in the current folder.
        output_path: The same, as a flag.
    """

    scene: Annotated[str, tyro.conf.arg(metavar="SCENE"), Positional]
    out: Annotated[str | None, tyro.conf.arg(metavar="[OUT]"), Positional] = None
    output_path: Annotated[str | None, tyro.conf.arg(name="out", aliases=("-o",), metavar="OUT")] = None
    output: OutputFlags = field(default_factory=Output)
    options: OptionFlags = field(default_factory=Options)

    def run(self) -> int:
        """Convert and print where the MJCF lies."""
        from ..conversion import convert
        from ..model.names import file_stem

        if self.out is not None and self.output_path is not None:
            raise ValueError(f"the output is given twice, as {self.out!r} and as --out {self.output_path!r}")
        target = self.out or self.output_path or f"{file_stem(Path(self.scene).stem)}_mjcf"
        with working(f"converting {self.scene}"):
            result = convert(self.scene, target, **keywords(self.options))
        print_diagnostics(result.diagnostics, self.output.verbose)
        if self.output.json:
            print_json(
                {
                    "xml": result.xml,
                    "assets": result.assets,
                    "report": result.report,
                    "diagnostics": listed(result.diagnostics, self.output.verbose),
                }
            )
        else:
            path = os.fspath(result.xml)
            # A script needs the path as it is, a terminal must not see control characters in it.
            print(one_line(path) if sys.stdout.isatty() else path)
        return DONE
