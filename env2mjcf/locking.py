"""Locks on open files and folders that end with the process that holds them, however it ends."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from enum import Enum
from pathlib import Path

# Nobody needs more than a moment; a process that is stopped in that moment is not waited for forever.
PATIENCE = 60.0
_PAUSE = 0.005


class FolderBusyError(Exception):
    """Another process has kept a folder locked for too long."""


class LockOutcome(Enum):
    """What came of an attempt to lock something."""

    HELD = "held"
    TAKEN = "taken by another process"
    NONE = "the system cannot lock it"


def try_lock(handle: int) -> LockOutcome:
    """Lock an open file or folder for whoever opened it, without waiting; closing it, or a death, unlocks it.

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
def alone(folder: Path) -> Generator[None]:
    """Keep other processes and threads from changing a folder, where the system can lock it.

    Raises:
        FolderBusyError: Another one does not let anybody in.
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
