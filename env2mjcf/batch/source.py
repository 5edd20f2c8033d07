"""The configurations of a batch: a NumPy file that is mapped, not read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import DiagnosticLog, FormatError
from ..formats.arrays import coordinates, map_array
from ..space import ConfigurationSpace
from ..transforms import Array

_WHAT_TO_DO = "write it with numpy.save(path, array), an array of floats of shape (n, {dim})"


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """Rows of a NumPy file.

    Attributes:
        path: The file.
        rows: (n, dim) numbers, mapped from the file.
        space: What they are configurations of.
        file_units: Whether they are the env file's own numbers, instead of metres and radians.
    """

    path: str
    rows: NDArray[Any]
    space: ConfigurationSpace
    file_units: bool

    def __len__(self) -> int:
        return len(self.rows)

    def raw(self, start: int, stop: int) -> NDArray[Any]:
        """Return some rows as they stand in the file."""
        return np.ascontiguousarray(self.rows[start:stop])

    def decoded(self, raw: NDArray[Any], start: int) -> Array:
        """Return rows in metres and radians.

        Args:
            raw: Rows as they stand in the file.
            start: Number of the first.

        Raises:
            FormatError: A number is not finite, or too large.
        """
        rows = coordinates(
            raw, self.path, DiagnosticLog(), names=self.space.names, first=start,
            hint="mend the row and run the same command again: what lies before it is kept",
        )  # fmt: skip
        return self.space.decode(rows) if self.file_units else rows


def open_source(path: str, space: ConfigurationSpace, file_units: bool) -> Source:
    """Map a NumPy file.

    Raises:
        FormatError: It is none, or does not hold rows of as many numbers as there are degrees of freedom.
    """
    log, hint = DiagnosticLog(), _WHAT_TO_DO.format(dim=space.dim)
    if not Path(path).is_file():
        what = "is a folder" if Path(path).is_dir() else "does not exist"
        log.fail(FormatError, "CFG505", path, f"{path} {what}; expected a NumPy file of configurations", hint=hint)
    rows = map_array(path, log, hint)
    if rows.ndim != 2 or rows.shape[1] != space.dim:
        names = ", ".join(space.names[:12]) + (", ..." if space.dim > 12 else "")
        if rows.shape == (space.dim,):
            hint = "one configuration is array.reshape(1, -1)"
        log.fail(
            FormatError, "CFG505", path,
            f"{path} holds an array of shape {rows.shape}; expected (n, {space.dim}): {names}", hint=hint,
        )  # fmt: skip
    return Source(path, rows, space, file_units)
