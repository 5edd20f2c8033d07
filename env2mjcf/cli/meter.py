"""How far a long job is: a bar or a line on a terminal, now and then a line in a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

from .terminal import console_on, remark

if TYPE_CHECKING:
    from ..planning.result import Progress

# Seconds between two lines.
_INTERVAL = 30.0


class Meter:
    """Shows progress on stderr while it is entered."""

    def __init__(self) -> None:
        self._bar: Any = None
        self._began = self._shown = 0.0
        self._first = self._done = self._rows = 0

    def __enter__(self) -> Meter:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()
        elif self._began:
            self._line()

    def at(self, done: int, rows: int) -> None:
        """Show that so many of the rows are done; those of the first call have cost nothing."""
        now = time.monotonic()
        if not self._began:
            self._began, self._shown, self._first = now, now, done
            if sys.stderr.isatty():
                self._bar = tqdm(total=rows, initial=done, unit=" rows", unit_scale=True, mininterval=0.2)
        self._done, self._rows = done, rows
        if self._bar is not None:
            self._bar.update(done - self._bar.n)
        elif now - self._shown > _INTERVAL:
            self._shown = now
            self._line()

    def _line(self) -> None:
        rate = (self._done - self._first) / max(time.monotonic() - self._began, 1e-9)
        remark(f"{self._done:,} of {self._rows:,} rows, {rate:,.0f} a second")


@contextmanager
def planning_meter(seconds: float) -> Generator[Callable[[Progress], None]]:
    """Return a function that shows progress on stderr; time is up after so many seconds."""
    status = console_on(sys.stderr).status("planning") if sys.stderr.isatty() else None
    shown = 0.0

    def show(progress: Progress) -> None:
        nonlocal shown
        leg = f" leg {progress.leg} of {progress.legs}" if progress.legs > 1 else ""
        line = (
            f"{progress.doing}{leg}: {progress.seconds:.0f} of {seconds:g} s, {progress.checks:,} checks, "
            f"{progress.motions:,} motions"
        )
        if status is not None:
            status.update(line)
        elif progress.seconds - shown > _INTERVAL:
            shown = progress.seconds
            remark(line)

    with status or nullcontext():
        yield show
