"""What ends the program `env2mjcf`, and how, from its first import on; a library leaves all of that alone.

Ctrl-C, SIGTERM and SIGHUP: while numpy is imported they may become an error of another kind, or a traceback; so they
end the program at once, which has done nothing yet, until there is something that may have to be tidied up.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from types import FrameType, TracebackType

from . import faults, statuses, streams

interrupted = 0
"""The signal that was to end the program: what goes wrong afterwards may go wrong because of it."""

_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
_ours: tuple[signal.Signals, ...] = ()
_swallowed = False
# Seconds; by then the callback has returned.
_SOON = 0.05


def is_program() -> bool:
    """Return whether Python was started to run the program; with -m, that is known while it is imported only."""
    first, words = (sys.argv or [""])[0], sys.orig_argv
    if first == "-m":
        return "-m" in words and words[words.index("-m") + 1 :][:1] == ["env2mjcf"]
    return os.path.basename(first) in ("env2mjcf", "env2mjcf.exe")


def begin() -> None:
    """Take this process over, before anything is imported that may fail."""
    global _ours  # noqa: PLW0603  a process has one handler
    streams.take_over()
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
    return statuses.of_signal(interrupted or signal.SIGINT)


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
        sys.stderr.write(f"env2mjcf: {faults.describe(error)}\n")
        sys.stderr.flush()
    finally:
        os._exit(statuses.FAULT)
