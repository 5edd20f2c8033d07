"""`env2mjcf view`."""

from __future__ import annotations

import signal
import sys
import threading
import webbrowser
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

import tyro
from tyro.conf import Positional

from ..diagnostics import DiagnosticLog
from ..options import Options, PathArgument
from . import program
from .arguments import OptionFlags, Output, OutputFlags
from .program import DONE
from .terminal import listed, loaded, one_line, print_diagnostics, print_json

if TYPE_CHECKING:
    from ..simulation.scene import Scene
    from ..transforms import Array


@dataclass(frozen=True, slots=True)
class View:
    """Show a scene on a web page: a slider for each degree of freedom, live contacts, and paths that play.

    The page is served to this machine alone (127.0.0.1); its address is printed. Sliders have the file's own units.
    Ctrl-C ends it.

    Examples:
      env2mjcf view serial.env --query serial.query
      env2mjcf view serial.env --path serial.path
      env2mjcf view problem.xml --no-browser --port 8090
      env2mjcf view serial.env --native

    Attributes:
        scene: An env file, an XML environment or a problem XML.
        path: A path to be played: a .path file, or a .csv or .npy file of rows in the file's own units.
        port: Where the page is served; a free port from 8080 on if it is not given.
        browser: Open the page in a browser.
        native: Open MuJoCo's own viewer instead of the page.
    """

    scene: Annotated[str, tyro.conf.arg(metavar="SCENE"), Positional]
    path: PathArgument | None = None
    port: int | None = None
    browser: bool = True
    native: bool = False
    output: OutputFlags = field(default_factory=Output)
    options: OptionFlags = field(default_factory=Options)

    def run(self) -> int:
        """Show the scene until Ctrl-C."""
        from ..view import native
        from ..view.web import server

        if self.native:
            native.require_display()
            if self.path is not None:
                raise ValueError("--native plays no path: leave one of --native and --path out")
        else:
            server.require()
        scene, log = loaded(self.scene, self.options)
        path = None if self.path is None else self._path(scene, log)
        print_diagnostics(log, self.output.verbose)
        if self.native:
            native.show(scene, scene.queries[0].q[0] if scene.queries else scene.space.home)
            return DONE
        return self._serve(scene, path, log)

    def _path(self, scene: Scene, log: DiagnosticLog) -> Array:
        from ..companions.configurations import of_file
        from ..view.web.playback import report_doubtful

        found = of_file(scene, str(self.path), False, self.options.limits, log)
        if found.graph is not None and found.graph.kind != "path":
            raise ValueError(f"{self.path} is a {found.graph.kind}; --path plays paths")
        report_doubtful(scene, found.q, str(self.path), log)
        return found.q

    def _serve(self, scene: Scene, path: Array | None, log: DiagnosticLog) -> int:
        from ..view.web import server
        from ..view.web.viewer import Viewer

        port = server.free_port(self.port)
        try:
            with server.serving(port, f"env2mjcf: {one_line(scene.environment.name)}") as page:
                viewer = Viewer(page, scene, path)
                self._announce(page.get_port(), log)
                try:
                    threading.Event().wait()
                finally:
                    viewer.close()
        except KeyboardInterrupt:
            pass
        return DONE if program.interrupted in (0, signal.SIGINT) else program.interrupted_status()

    def _announce(self, port: int, log: DiagnosticLog) -> None:
        from ..view.native import has_display

        url = f"http://127.0.0.1:{port}"
        if self.output.json:
            print_json({"url": url, "port": port, "diagnostics": listed(log, self.output.verbose)})
        else:
            print(url)
        sys.stdout.flush()
        print("the page is served to this machine alone; Ctrl-C ends", file=sys.stderr)
        # Without a display, a browser of text might take over the terminal.
        if self.browser and has_display():
            webbrowser.open(url)
