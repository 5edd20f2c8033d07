"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replaced(file: str | os.PathLike[str]) -> Generator[Path]:
    """Let a file be written beside its place, then rename it there; remove it where writing fails.

    Yields:
        The path to write to; it ends as the file does.
    """
    path = Path(os.fsdecode(file))
    beside = path.with_name(f".{secrets.token_hex(8)}-{path.name}")
    try:
        yield beside
        os.replace(beside, path)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise
