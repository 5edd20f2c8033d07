"""`env2mjcf translate`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

import tyro
from rich.text import Text
from tyro.conf import Positional

from ..diagnostics import DiagnosticLog
from ..errors import counted
from ..limits import LARGEST, Limits
from ..options import DialectName, PathArgument, Semantics
from .arguments import Output, OutputFlags
from .program import DONE
from .terminal import listed, one_line, print_diagnostics, print_json, print_parts

if TYPE_CHECKING:
    from ..model.environment import Boundary, Environment
    from ..translation import Written


@dataclass(frozen=True, slots=True)
class Translate:
    """Write a scene in another dialect of the format.

    Links, limits, tested pairs and boundary stay what they are; what the dialect cannot express is reported, and what
    would move links is refused. In dialect E each robot gets a file of its own beside the env file: new.env and
    new.robot. Configurations of --query are turned into the dialect's numbers: new.query. Meshes stay where they are.
    An older new.env is replaced, with its new.robot and new.query; nothing else is.

    Examples:
      env2mjcf translate serial.env -o new.env --dialect D --box -10 10 -10 10 -10 10
      env2mjcf translate serial.env -o new.env --dialect E --query serial.query
      env2mjcf translate box.env -o old.env --dialect C --robots box.robot
      env2mjcf translate page.env -o page-as-meant.env --dialect A --semantics page

    Attributes:
        scene: An env file, an XML environment or a problem XML.
        out: The env file to write.
        dialect: The dialect to write: A (1998), B (May 2012), C (2013), D (2014) or E (2016).
        robots: Dialect E robot files of the scene.
        query: A query file to translate, too.
        semantics: Whose reading of a dialect A connection: the planner's, or the web page's.
        read_as: Read the scene as this dialect instead of telling it from the text.
        mesh_dirs: More folders in which meshes are looked for.
        allow_outside: Let a problem, or its scene, name files outside their folder.
        box: A boundary for a scene that has none, in file units; dialects C to E must have one.
        strict: Refuse whatever would be lost.
        limits: Bounds on hostile input.
    """

    scene: Annotated[str, tyro.conf.arg(metavar="SCENE"), Positional]
    out: Annotated[str, tyro.conf.arg(aliases=("-o",), metavar="NEW.env")]
    dialect: DialectName
    robots: tuple[PathArgument, ...] = ()
    query: PathArgument | None = None
    semantics: Semantics = "planner"
    read_as: DialectName | None = None
    mesh_dirs: tuple[PathArgument, ...] = ()
    allow_outside: bool = False
    box: Annotated[tuple[float, float, float, float, float, float] | None, tyro.conf.arg(metavar="X0 X1 ... Z1")] = None
    strict: bool = False
    limits: Limits = field(default_factory=Limits)
    output: OutputFlags = field(default_factory=Output)

    def run(self) -> int:
        """Translate, and say what was written."""
        from ..formats.reading import read
        from ..translation import translate, write_environment

        if not self.out.lower().endswith(".env"):
            raise ValueError(f"--out is {self.out}; expected a file that ends in .env")
        scene = read(self.scene, **self._options())
        result = translate(scene, self.dialect, strict=self.strict, boundary=self._boundary())
        written = write_environment(
            result.environment, self.out, mesh_dirs=self.mesh_dirs, allow_outside=self.allow_outside
        )
        log = DiagnosticLog()
        for found in (scene.diagnostics, result.notes, written.notes):
            log.extend(found)
        print_diagnostics(log, self.output.verbose)
        if self.output.json:
            files = {name: getattr(written, name) for name in ("environment", "robots", "query", "mesh_dirs")}
            print_json({"dialect": self.dialect, **files, "diagnostics": listed(log, self.output.verbose)})
        else:
            print_parts(_lines(result.environment, written))
        return DONE

    def _boundary(self) -> Boundary | None:
        from ..model.environment import Boundary, BoundaryShape

        if self.box is None:
            return None
        lower, upper = self.box[::2], self.box[1::2]
        if not all(a < b for a, b in zip(lower, upper, strict=True)):
            raise ValueError("--box is empty; expected the lower and the upper end of x, y and z")
        if max(map(abs, self.box)) > LARGEST:
            raise ValueError(f"--box is larger than {LARGEST:g}, so that nothing could read the file")
        return Boundary(BoundaryShape.BOX, lower, upper)

    def _options(self) -> dict[str, Any]:
        names = ("robots", "query", "semantics", "strict", "mesh_dirs", "allow_outside", "limits")
        return {"dialect": self.read_as, **{name: getattr(self, name) for name in names}}


def _lines(scene: Environment, written: Written) -> Iterator[Text]:
    bodies = f"{counted(len(scene.robots), 'robot')}, {counted(len(scene.obstacles), 'obstacle')}"
    yield Text(f"{one_line(str(written.environment))}: dialect {scene.dialect}, {bodies}", "bold")
    for robot in written.robots:
        yield Text(f"{one_line(str(robot))}: a robot")
    if written.query is not None:
        count = sum(len(t.configurations) for t in scene.tasks)
        yield Text(f"{one_line(str(written.query))}: {count} configurations")
    if written.mesh_dirs:
        folders = " ".join(one_line(str(f)) for f in written.mesh_dirs)
        yield Text(f"its meshes stay where they are; to read it: --mesh-dirs {folders}")
