"""What the process of the program `env2mjcf` takes over, and its exit statuses; a library leaves all of that alone.

Signals: Ctrl-C, SIGTERM and SIGHUP end the program at once until its verb runs, for while numpy is imported they may
become an error of another kind, or a traceback. Then they raise a KeyboardInterrupt, so that files are tidied up.

Streams: none can change the exit status for another reason than its own. One that is closed leads nowhere. What cannot
be written to stderr is left out: the results and the status say enough. What cannot be written to stdout is an error.
"""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
import threading
import traceback
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

DONE = 0
"""Done, free or valid."""
FINDING = 1
"""A collision, an invalid configuration, an error that lint found; never a failure."""
WRONG_USAGE = 2
BAD_INPUT = 3
"""Something cannot be read, or what was asked for cannot be written."""
FAULT = 4
"""A fault of env2mjcf, or too little memory, or too many open files."""
BROKEN_PIPE = 141
"""What shells report for a program that is stopped by SIGPIPE."""

interrupted = 0
"""The signal that was to end the program: what goes wrong afterwards may go wrong because of it."""

_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
_ours: tuple[signal.Signals, ...] = ()
_swallowed = False
# Seconds; by then the callback has returned.
_SOON = 0.05


def begin() -> None:
    """Take this process over, before anything is imported that may fail."""
    global _ours  # noqa: PLW0603  a process has one handler
    _take_over_streams()
    sys.excepthook = _end
    # What is ignored, as nohup has it, stays ignored.
    _ours = tuple(s for s in _SIGNALS if signal.getsignal(s) in (signal.default_int_handler, signal.SIG_DFL))
    end_at_once()


def end_at_once() -> None:
    """Let signals end the process without a word."""
    for number in _ours:
        signal.signal(number, signal.SIG_DFL)


def end_tidily() -> None:
    """Let signals raise a KeyboardInterrupt."""
    for number in _ours:
        signal.signal(number, _interrupt)
    if _ours:
        sys.unraisablehook = _unraisable


def interrupted_status() -> int:
    """Return the exit status of a program that was interrupted."""
    return 128 + (interrupted or signal.SIGINT)  # as shells report it


def _interrupt(number: int, _frame: FrameType | None) -> None:
    global interrupted, _swallowed
    if number == interrupted != signal.SIGINT and not _swallowed:
        return  # a terminal that is closed sends SIGHUP, and so does its shell: that must not end the tidying up
    interrupted, _swallowed = interrupted or number, False
    raise KeyboardInterrupt


def _unraisable(found: sys.UnraisableHookArgs) -> None:
    """Interrupt once more where a library's callback, such as one of numba's compiler, has swallowed it."""
    global _swallowed  # noqa: PLW0603  a process is interrupted once
    if issubclass(found.exc_type, KeyboardInterrupt):
        _swallowed = True
        threading.Timer(_SOON, _press_again).start()
    else:
        sys.__unraisablehook__(found)


def _press_again() -> None:
    number = interrupted or signal.SIGINT
    if hasattr(signal, "pthread_kill"):
        # To the thread that is to be woken.
        signal.pthread_kill(threading.main_thread().ident or 0, number)
    else:
        signal.raise_signal(number)


def _end(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """End the process with the status of a fault: Python's own is that of a finding."""
    try:
        if "--debug" in sys.argv or os.environ.get("ENV2MJCF_DEBUG") == "1":
            sys.__excepthook__(kind, error, trace)
        sys.stderr.write(f"env2mjcf: {describe(error)}\n")
        sys.stderr.flush()
    finally:
        os._exit(FAULT)


class ResultsError(OSError):
    """Results that cannot be written to stdout."""


class _Results(io.FileIO):
    def write(self, data: ReadableBuffer, /) -> int | None:
        try:
            return super().write(data)
        except BrokenPipeError:
            raise  # the reader has seen enough
        except OSError as error:
            raise ResultsError(error.errno, error.strerror) from error


class _Remarks(io.FileIO):
    def write(self, data: ReadableBuffer, /) -> int | None:
        try:
            return super().write(data)
        except OSError:
            return memoryview(data).nbytes


def _take_over_streams() -> None:
    # Otherwise the next file that is opened takes a closed one's number, and what libraries print goes into it.
    while (handle := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(handle, True)
    os.close(handle)
    if os.name == "posix":  # consoles of Windows are not files
        sys.stdout = _over(_Results(1, "w", closefd=False), sys.stdout)
        sys.stderr = _over(_Remarks(2, "w", closefd=False), sys.stderr)


def _over(raw: io.FileIO, before: TextIO | None) -> TextIO:
    """Return a stream with the encoding and the buffering of the one before."""
    if not isinstance(before, io.TextIOWrapper):
        return io.TextIOWrapper(io.BufferedWriter(raw), "utf-8")
    at_once = before.line_buffering or before.write_through
    return io.TextIOWrapper(io.BufferedWriter(raw), before.encoding, before.errors, line_buffering=at_once)


def describe(error: BaseException) -> str:
    """Return a sentence: what the machine lacks, else that env2mjcf is at fault."""
    number = error.errno if isinstance(error, OSError) else None
    # An import that fails for lack of memory says so in words only.
    if isinstance(error, MemoryError) or number == errno.ENOMEM or os.strerror(errno.ENOMEM) in str(error):
        return "there is not enough memory"
    if number in (errno.EMFILE, errno.ENFILE):
        return f"{os.strerror(number)}: ask for more of them (ulimit -n)"
    from ..errors import abridged

    said = abridged("".join(traceback.format_exception_only(error)).strip()).replace("\n", "; ")
    return f"a fault of env2mjcf, please report it: {said} (--debug shows where)"
