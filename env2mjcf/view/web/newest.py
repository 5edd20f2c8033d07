"""Verdicts while somebody looks on: always about the newest configuration, never in its way."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class Newest(Generic[T]):
    """Works on what was handed in last, in a thread of its own; what has been overtaken meanwhile is dropped.

    Args:
        work: What to do. It is handed a function, too, that says whether something newer waits.
    """

    def __init__(self, work: Callable[[T, Callable[[], bool]], None]) -> None:
        self._work = work
        self._waiting: T | None = None
        self._changed = threading.Condition()
        self._closed = False
        threading.Thread(target=self._run, name="env2mjcf-judge", daemon=True).start()

    def submit(self, item: T) -> None:
        """Hand in something newer."""
        with self._changed:
            self._waiting = item
            self._changed.notify()

    def close(self) -> None:
        """End the thread after what it is working on."""
        with self._changed:
            self._closed = True
            self._changed.notify()

    def _overtaken(self) -> bool:
        return self._waiting is not None or self._closed

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(self._overtaken)
                if self._closed:
                    return
                item, self._waiting = self._waiting, None
            assert item is not None
            self._work(item, self._overtaken)
