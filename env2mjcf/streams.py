"""The standard streams of the program, so that none of them can change its exit status for another reason than its own.

One that is closed leads nowhere. What cannot be written to stderr is left out: the results and the status say enough.
What cannot be written to stdout is an error of its own.
"""

from __future__ import annotations

import io
import os
import sys
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


class ResultsError(OSError):
    """Results that cannot be written to stdout."""


class _Results(io.FileIO):
    def write(self, data: ReadableBuffer, /) -> int | None:
        try:
            return super().write(data)
        except BrokenPipeError:
            raise  # whoever reads has seen enough
        except OSError as error:
            raise ResultsError(error.errno, error.strerror) from error


class _Remarks(io.FileIO):
    def write(self, data: ReadableBuffer, /) -> int | None:
        try:
            return super().write(data)
        except OSError:
            return memoryview(data).nbytes


def take_over() -> None:
    """Replace the standard streams of this process."""
    # Otherwise the next file that is opened takes a closed one's number, and what libraries print goes into it.
    while (handle := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(handle, True)
    os.close(handle)
    if os.name == "posix":  # consoles of Windows are no files
        sys.stdout = _over(_Results(1, "w", closefd=False), sys.stdout)
        sys.stderr = _over(_Remarks(2, "w", closefd=False), sys.stderr)


def _over(raw: io.FileIO, before: TextIO | None) -> TextIO:
    """Return a stream that encodes as the one before did, and keeps no line back that it did not."""
    if not isinstance(before, io.TextIOWrapper):
        return io.TextIOWrapper(io.BufferedWriter(raw), "utf-8")
    at_once = before.line_buffering or before.write_through
    return io.TextIOWrapper(io.BufferedWriter(raw), before.encoding, before.errors, line_buffering=at_once)
