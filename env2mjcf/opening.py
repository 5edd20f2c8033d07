"""Opens files that somebody else has made, or may have put something else in the place of."""

from __future__ import annotations

import errno
import os
import stat
from typing import IO

from .options import PathArgument


class NoRegularFileError(OSError):
    """A pipe, a socket or a device where a file was expected: it may keep its reader waiting for ever."""

    def __init__(self, path: PathArgument) -> None:
        super().__init__(errno.EINVAL, "it is no regular file but a pipe, a socket or a device", os.fspath(path))


def open_regular(path: PathArgument) -> IO[bytes]:
    """Open a regular file to read from it, and wait for nothing.

    Raises:
        NoRegularFileError: It is a pipe, a socket or a device.
        OSError: It is a folder, or cannot be opened.
        ValueError: There is a NUL character in its name.
    """
    file = open(path, "rb", opener=_without_waiting)  # noqa: SIM115  who asks closes it
    # Asked of what is open: whatever bears the name by now may be another.
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        file.close()
        raise NoRegularFileError(path)
    return file


def _without_waiting(path: str, flags: int) -> int:
    """Open a file; a pipe would be waited for until somebody writes to it."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
