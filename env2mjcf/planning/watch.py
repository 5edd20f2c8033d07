"""How long planning may take, and who wants to know how far it is."""

from __future__ import annotations

import time
from collections.abc import Callable

from .result import Progress
from .validity import Validity

# Seconds between two reports.
_INTERVAL = 0.2


class Watch:
    """Tells planners when to stop, reports now and then, and adds up what was checked.

    Args:
        seconds: When time is up, counted from now.
        legs: Number of legs.
        report: Called now and then.

    Attributes:
        leg: Which leg is being planned.
        doing: What is being done.
    """

    def __init__(self, seconds: float, legs: int, report: Callable[[Progress], None] | None) -> None:
        self._began = time.perf_counter()
        self._end = self._began + seconds
        self._legs, self._report = legs, report
        self._next = self._began
        self._counted: list[Validity] = []
        self.leg, self.doing = 1, "planning"

    def counts(self, validity: Validity) -> Validity:
        """Let what is checked there count, and return it."""
        self._counted.append(validity)
        return validity

    @property
    def checks(self) -> int:
        """How many configurations were looked at."""
        return sum(v.checks for v in self._counted)

    @property
    def left(self) -> float:
        """Seconds that are left."""
        return self._end - time.perf_counter()

    def stop(self) -> bool:
        """Return whether time is up; report, if it is time for that."""
        now = time.perf_counter()
        if self._report is not None and now >= self._next:
            self._next = now + _INTERVAL
            motions = sum(v.motions for v in self._counted)
            self._report(Progress(self.leg, self._legs, self.doing, now - self._began, self.checks, motions))
        return now >= self._end

    def stop_within(self, seconds: float) -> Callable[[], bool]:
        """Return a condition that holds after so many seconds, or when time is up."""
        end = time.perf_counter() + seconds
        return lambda: self.stop() or time.perf_counter() >= end
