"""What Ctrl-C does to the program `env2mjcf`, from its first import on; a library leaves that alone.

While numpy is imported Ctrl-C may become an error of another kind, or a traceback; so it ends the program at once,
which has done nothing yet, until there is something that may have to be tidied up.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from types import FrameType

interrupted = False
"""Whether Ctrl-C was pressed: what goes wrong afterwards may go wrong because of it."""

_ours = False
# Seconds; by then the callback has returned.
_SOON = 0.05


def is_program() -> bool:
    """Return whether Python was started to run the program, and is still importing it."""
    first, words = (sys.argv or [""])[0], sys.orig_argv
    if first == "-m":
        return "-m" in words and words[words.index("-m") + 1 :][:1] == ["env2mjcf"]
    return os.path.basename(first) in ("env2mjcf", "env2mjcf.exe")


def end_at_once() -> None:
    """Let Ctrl-C end the process without a word; what is ignored stays ignored."""
    global _ours  # noqa: PLW0603  a process has one handler
    if signal.getsignal(signal.SIGINT) in (signal.default_int_handler, _interrupt):
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        _ours = True


def end_tidily() -> None:
    """Let Ctrl-C raise a KeyboardInterrupt again, if `end_at_once` has changed that."""
    if _ours and signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
        signal.signal(signal.SIGINT, _interrupt)
        sys.unraisablehook = _unraisable


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    global interrupted  # noqa: PLW0603  a process has one Ctrl-C
    interrupted = True
    raise KeyboardInterrupt


def _unraisable(found: sys.UnraisableHookArgs) -> None:
    """Interrupt once more where a library's callback, such as one of numba's compiler, has swallowed it."""
    if issubclass(found.exc_type, KeyboardInterrupt):
        threading.Timer(_SOON, _press_again).start()
    else:
        sys.__unraisablehook__(found)


def _press_again() -> None:
    if hasattr(signal, "pthread_kill"):
        # To the thread that is to be woken.
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
    else:
        signal.raise_signal(signal.SIGINT)
