"""Paths as something that plays: places along them, and the clock that moves on."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np

from ...diagnostics import DiagnosticLog
from ...simulation.scene import Scene
from ...transforms import Array
from ..trails import PARTS_OF_AN_EDGE, fine, lengths

# Playing through takes as long as it takes to cross the scene so often, and no less or more than these.
_SECONDS_PER_EXTENT = 5.0
_LEAST_SECONDS, _MOST_SECONDS = 3.0, 60.0
_TICK = 1 / 30


class Track:
    """A path that can be asked for any place between its ends.

    The way between two configurations is straight, the short way round on periodic degrees of freedom. Equal parts of
    the track are equally long for the corner that moves furthest (see `trails.lengths`).

    Args:
        scene: The scene.
        q: (k, dim) configurations, at least one.
    """

    def __init__(self, scene: Scene, q: Array) -> None:
        self.q = scene.space.check(q)
        self._rows = fine(scene, self.q)
        self._far = lengths(scene, self._rows)
        # Where nothing moves, time stands still.
        self._keep = np.concatenate([[True], np.diff(self._far) > 0])
        wished = _SECONDS_PER_EXTENT * self.length / scene.extent
        self.seconds = float(np.clip(wished, _LEAST_SECONDS, _MOST_SECONDS))

    @property
    def length(self) -> float:
        """Metres."""
        return float(self._far[-1])

    def at(self, fraction: float) -> Array:
        """Return the configuration at a fraction of the length, (dim,); at both ends exactly the path's own."""
        if fraction <= 0 or self.length == 0:
            return self.q[0].copy()
        if fraction >= 1:
            return self.q[-1].copy()
        place, far = fraction * self.length, self._far[self._keep]
        return np.array([np.interp(place, far, column) for column in self._rows[self._keep].T])

    def index(self, fraction: float) -> int:
        """Return which configuration was the last one passed at a fraction of the length."""
        if fraction >= 1:
            return len(self.q) - 1
        # Places that are sums of many parts are a rounding error before where they should be.
        place = fraction * self.length * (1 + 1e-12)
        return (int(np.searchsorted(self._far, place, side="right")) - 1) // PARTS_OF_AN_EDGE


def report_doubtful(scene: Scene, q: Array, file: str, log: DiagnosticLog) -> None:
    """Report what is doubtful about a path, (k, dim), that somebody wants to see."""
    if len(q) == 1:
        log.warn("CFG551", file, f"{file} holds one configuration; expected a path of two at least")
    broken = scene.space.broken(q)
    if not broken.any():
        return
    row, i = (int(x) for x in np.argwhere(broken)[0])
    number, lower, upper = (scene.space.in_file_units(v)[i] for v in (q[row], scene.space.lower, scene.space.upper))
    message = (
        f"{int(broken.any(axis=1).sum())} of {len(q)} configurations of {file} are beyond the limits; in number "
        f"{row + 1} {scene.space.names[i]} is {number:.6g}, its limits are {lower:.6g} to {upper:.6g}"
    )
    log.warn("CFG550", file, message, hint="are its numbers in the units of the scene's file?")


class Player:
    """Moves along a track while it plays, in a thread of its own.

    Args:
        seconds: How long the whole track takes at speed 1.
        show: Called with the fraction of the track, at every tick.
        ended: Called when playing has come to the end.
    """

    def __init__(self, seconds: float, show: Callable[[float], None], ended: Callable[[], None]) -> None:
        self._seconds, self._show, self._ended = seconds, show, ended
        self._playing = threading.Event()
        self._closed = False
        self.fraction = 0.0
        self.speed = 1.0
        self.loop = False
        threading.Thread(target=self._run, name="env2mjcf-player", daemon=True).start()

    @property
    def playing(self) -> bool:
        """Whether it moves."""
        return self._playing.is_set()

    def play(self) -> None:
        """Go on, from the beginning where the end was reached."""
        if self.fraction >= 1.0:
            self.fraction = 0.0
        self._playing.set()

    def pause(self) -> None:
        """Stay where it is."""
        self._playing.clear()

    def close(self) -> None:
        """End the thread."""
        self._closed = True
        self._playing.set()

    def _run(self) -> None:
        before = 0.0
        while True:
            if not self._playing.is_set():
                self._playing.wait()
                before = time.monotonic()
            if self._closed:
                return
            now = time.monotonic()
            fraction = self.fraction + self.speed * (now - before) / self._seconds
            before = now
            if fraction >= 1.0:
                fraction = fraction % 1.0 if self.loop else 1.0
            self.fraction = fraction
            self._show(fraction)
            if fraction >= 1.0:
                self._playing.clear()
                self._ended()
            time.sleep(max(0.0, _TICK - (time.monotonic() - now)))
