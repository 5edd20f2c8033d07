"""What a verb does not write over."""

from __future__ import annotations

from pathlib import Path

from ..formats.path import begins_as_path
from ..writing import refuse_foreign


def refuse_foreign_path(out: Path) -> None:
    """Refuse to replace a file that is no path, such as a scene that was named by mistake.

    Raises:
        ConversionError: It is none.
    """
    refuse_foreign(out, "CFG553", "path file", lambda beginning: begins_as_path(beginning.decode("utf-8", "replace")))
