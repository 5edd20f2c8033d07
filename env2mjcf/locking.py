"""Locks on open files and folders that end with the process that holds them, however it ends."""

from __future__ import annotations

import sys
from contextlib import suppress
from enum import Enum


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
