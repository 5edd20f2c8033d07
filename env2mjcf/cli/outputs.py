"""Files that a verb is to write, looked at before time is spent on their content."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from ..errors import ConversionError, DiagnosticLog
from ..formats.path import begins_as_path
from ..options import PathArgument

# Of a file, as much as tells what it is.
_BEGINNING = 4096


def refuse_unwritable(out: PathArgument, code: str, inputs: Sequence[PathArgument] = ()) -> None:
    """Refuse a file that cannot be written.

    Raises:
        ConversionError: It is a folder, one of the inputs, or lies in no folder, or in one that may not be written.
    """
    path = Path(os.fsdecode(out))
    if path.is_dir():
        what = "is a folder"
    elif path.exists() and any(os.path.exists(i) and os.path.samefile(path, i) for i in inputs):
        what = "is an input"
    elif path.exists() and not path.is_file():
        what = "is no regular file"
    elif not path.parent.is_dir():
        what = f"lies in {path.parent}, which is no folder"
    elif not os.access(path.parent, os.W_OK):
        what = f"lies in {path.parent}, which may not be written"
    else:
        return
    DiagnosticLog().fail(
        ConversionError, code, str(path), f"{path} {what}; expected a file to write", hint="name another output"
    )


def refuse_foreign_path(out: Path) -> None:
    """Refuse to replace a file that is no path, such as a scene that was named by mistake.

    Raises:
        ConversionError: It is none.
    """
    if not out.is_file():
        return
    with suppress(OSError), out.open("rb") as file:
        beginning = file.read(_BEGINNING).decode("utf-8", "replace")
        if beginning.strip() and not begins_as_path(beginning):
            DiagnosticLog().fail(
                ConversionError, "CFG553", str(out), f"{out} is no path file, and is not replaced",
                hint="choose another output, or remove the file",
            )  # fmt: skip
