"""The web server of the viewer, which this machine alone can reach."""

from __future__ import annotations

import importlib.util
import socket
from collections.abc import Generator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import viser

HOST = "127.0.0.1"
FIRST_PORT = 8080
_PORTS = range(1, 65536)


def require() -> None:
    """Make sure that the web page can be shown.

    Raises:
        ValueError: viser is not installed.
    """
    if importlib.util.find_spec("viser") is None:
        raise ValueError("the web page needs viser: pip install 'env2mjcf[view]'")


def free_port(wish: int | None = None) -> int:
    """Return a port of the loopback interface that nobody listens on: the wished one, else the first from 8080 on.

    Raises:
        ValueError: The wished port is in use, may not be used, or is not one.
    """
    if wish is None:
        return next(p for p in range(FIRST_PORT, _PORTS.stop) if _is_free(p))
    if wish not in _PORTS:
        raise ValueError(f"port {wish}; expected {_PORTS.start} to {_PORTS.stop - 1}")
    if not _is_free(wish):
        raise ValueError(f"port {wish} is in use, or may not be used; leave --port out to take a free one")
    return wish


@contextmanager
def serving(port: int, label: str) -> Generator[viser.ViserServer]:
    """Serve an empty page on 127.0.0.1 for as long as the context lasts.

    Args:
        port: A free port, see `free_port`.
        label: Title of the page.
    """
    import rich
    import viser

    class LoopbackServer(viser.ViserServer):
        """Never asks the service that hands out public addresses."""

        def request_share_url(self, verbose: bool = True) -> None:
            return None

    # viser prints a banner and a farewell, and stdout is for results.
    console = rich.get_console()
    was_quiet, console.quiet = console.quiet, True
    server: viser.ViserServer | None = None
    try:
        server = LoopbackServer(host=HOST, port=port, label=label, verbose=False)
        yield server
    finally:
        if server is not None:
            server.stop()
        console.quiet = was_quiet


def _is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError:
            return False
        return True
