"""The exit statuses of the program."""

from __future__ import annotations

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


def of_signal(number: int) -> int:
    """Return what shells report for a program that is stopped by a signal."""
    return 128 + number
