"""Lets the interpreter end while daemon threads ask: it waits for the rows that they are at, and not for all of them.

Compiled code that is at work while the interpreter takes itself apart crashes the process.
"""

from __future__ import annotations

import atexit
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager

# Without a lock, which a fork might find taken; each step on a set is one of the interpreter's.
_at_work: set[threading.Thread] = set()
_ended = threading.Event()
# Seconds between two looks at who is still at work.
_PAUSE = 0.005


@contextmanager
def working() -> Generator[None]:
    """Keep the interpreter from ending meanwhile; a daemon thread that comes when it does goes no further."""
    this = threading.current_thread()
    _at_work.add(this)
    try:
        if this.daemon and _ended.is_set():
            _at_work.discard(this)
            threading.Event().wait()
        yield
    finally:
        _at_work.discard(this)


@atexit.register
def _end() -> None:
    _ended.set()
    while any(thread.is_alive() and thread.daemon for thread in tuple(_at_work)):
        time.sleep(_PAUSE)
