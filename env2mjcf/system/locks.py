"""Locks between processes, threads and forks, and an end of the interpreter that waits for compiled code.

A lock on an open file or folder ends with the process that holds it, however that ends. A forked child has only the
thread that forked it: a lock of Python that another thread held at that moment stays locked there for ever. Compiled
code that is at work while the interpreter takes itself apart crashes the process.
"""

from __future__ import annotations

import atexit
import os
import sys
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from enum import Enum
from pathlib import Path
from types import TracebackType
from typing import Any, Generic, TypeVar, overload
from weakref import WeakSet

# Nobody needs more than a moment; a process that is stopped in that moment is not waited for forever.
PATIENCE = 60.0
# Seconds between two looks at a lock, or at what is still at work.
_PAUSE = 0.005


class FolderBusyError(Exception):
    """Another process has kept a folder locked for too long."""


class LockOutcome(Enum):
    """What came of an attempt to lock something."""

    HELD = "held"
    TAKEN = "taken by another process"
    NONE = "the system cannot lock it"


def try_lock(handle: int) -> LockOutcome:
    """Lock an open file or folder without waiting; closing it, or the end of the process, unlocks it.

    Windows cannot lock folders, and some network file systems cannot lock anything.
    """
    if sys.platform == "win32":
        return LockOutcome.NONE
    import fcntl

    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return LockOutcome.TAKEN
    except OSError:
        return LockOutcome.NONE
    return LockOutcome.HELD


def unlock(handle: int) -> None:
    """Unlock what `try_lock` has locked, for processes, too, that were forked meanwhile and have it open."""
    if sys.platform != "win32":
        import fcntl

        with suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_UN)


@contextmanager
def folder_lock(folder: Path) -> Generator[None]:
    """Keep other processes and threads from changing a folder, where the system can lock it.

    Raises:
        FolderBusyError: Another one has kept it locked for too long.
        OSError: The folder cannot be opened.
    """
    if os.name == "nt":  # folders cannot be opened
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        deadline = time.monotonic() + PATIENCE
        while try_lock(handle) is LockOutcome.TAKEN:
            if time.monotonic() > deadline:
                raise FolderBusyError(f"another process has kept {folder} locked for {PATIENCE:g} seconds")
            time.sleep(_PAUSE)
        yield
    finally:
        unlock(handle)
        os.close(handle)


T = TypeVar("T")


class Lock:
    """A reentrant lock that a forked child finds open.

    It must guard nothing that the child would find half done. What is made under it is assigned when it is whole: what
    another thread had begun when the process was forked is simply made again.
    """

    def __init__(self) -> None:
        self._lock = threading.RLock()
        _locks.add(self)

    def reopen(self) -> None:
        """Forget who holds it."""
        self._lock = threading.RLock()

    def __enter__(self) -> None:
        self._lock.acquire()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lock.release()


_locks: WeakSet[Lock] = WeakSet()


def _reopen() -> None:
    for lock in _locks:
        lock.reopen()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_reopen)


class lazy_property(Generic[T]):
    """A property that is worked out when it is first asked for; by two threads at once, twice.

    `functools.cached_property` of Python 3.11 has one lock for all instances of a class: a scene would wait for another
    scene, and a forked child for ever.
    """

    def __init__(self, function: Callable[[Any], T]) -> None:
        self._function = function
        self.__doc__ = function.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, instance: None, owner: type) -> lazy_property[T]: ...
    @overload
    def __get__(self, instance: object, owner: type) -> T: ...
    def __get__(self, instance: object | None, owner: type) -> lazy_property[T] | T:
        if instance is None:
            return self
        # What is found here hides this descriptor, so that it is asked once.
        return instance.__dict__.setdefault(self._name, self._function(instance))


# Without a lock, which a fork might find taken; each step on a set is one of the interpreter's.
_at_work: set[threading.Thread] = set()
_ended = threading.Event()


@contextmanager
def delayed_exit() -> Generator[None]:
    """Keep the interpreter from ending meanwhile; it stops a daemon thread that begins when it is already ending."""
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
