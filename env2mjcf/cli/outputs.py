"""What a verb does not write over."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from ..errors import ConversionError, DiagnosticLog
from ..formats.path import begins_as_path
from ..opening import open_regular

# Of a file, as much as tells what it is.
_BEGINNING = 4096


def refuse_foreign_path(out: Path) -> None:
    """Refuse to replace a file that is no path, such as a scene that was named by mistake.

    Raises:
        ConversionError: It is none.
    """
    with suppress(OSError), open_regular(out) as file:
        beginning = file.read(_BEGINNING).decode("utf-8", "replace")
        if beginning.strip() and not begins_as_path(beginning):
            DiagnosticLog().fail(
                ConversionError, "CFG553", str(out), f"{out} is no path file, and is not replaced",
                hint="choose another output, or remove the file",
            )  # fmt: skip
