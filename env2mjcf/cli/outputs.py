"""Files that a verb is to write, looked at before time is spent on their content."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from ..errors import ConversionError, DiagnosticLog
from ..options import PathArgument


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
    elif not path.parent.is_dir():
        what = f"lies in {path.parent}, which is no folder"
    elif not os.access(path.parent, os.W_OK):
        what = f"lies in {path.parent}, which may not be written"
    else:
        return
    DiagnosticLog().fail(
        ConversionError, code, str(path), f"{path} {what}; expected a file to write", hint="name another output"
    )
