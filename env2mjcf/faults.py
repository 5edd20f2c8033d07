"""What is said of an error that nobody expected."""

from __future__ import annotations

import errno
import os
import traceback


def describe(error: BaseException) -> str:
    """Return a sentence: what the machine lacks, else that env2mjcf is at fault."""
    number = error.errno if isinstance(error, OSError) else None
    # What is imported says it of a library in words only.
    if isinstance(error, MemoryError) or number == errno.ENOMEM or os.strerror(errno.ENOMEM) in str(error):
        return "there is not enough memory"
    if number in (errno.EMFILE, errno.ENFILE):
        return f"{os.strerror(number)}: ask for more of them (ulimit -n)"
    said = "".join(traceback.format_exception_only(error)).strip().replace("\n", "; ")
    return f"a fault of env2mjcf, please report it: {said} (--debug shows where)"
