"""How far planning is: a line on a terminal, now and then one in a log."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from rich.console import Console
from rich.status import Status

if TYPE_CHECKING:
    from ..planning.result import Progress

# Seconds between two lines where there is no terminal.
_INTERVAL = 30.0


class PlanningMeter:
    """Shows progress on stderr while it is entered.

    Args:
        seconds: When time is up.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds, self._shown = seconds, 0.0
        self._status: Status | None = None

    def __enter__(self) -> PlanningMeter:
        if sys.stderr.isatty():
            console = Console(file=sys.stderr, highlight=False, markup=False, emoji=False)
            self._status = console.status("planning")
            self._status.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._status is not None:
            self._status.stop()

    def at(self, progress: Progress) -> None:
        """Show how far planning is."""
        leg = f" leg {progress.leg} of {progress.legs}" if progress.legs > 1 else ""
        line = (
            f"{progress.doing}{leg}: {progress.seconds:.0f} of {self._seconds:g} s, {progress.checks:,} checks, "
            f"{progress.motions:,} motions"
        )
        if self._status is not None:
            self._status.update(line)
        elif progress.seconds - self._shown > _INTERVAL:
            self._shown = progress.seconds
            print(f"env2mjcf: {line}", file=sys.stderr)
