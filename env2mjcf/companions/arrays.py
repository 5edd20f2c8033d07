"""NumPy files of configurations, mapped and not read: one that declares more than it has takes no memory."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..diagnostics import DiagnosticLog
from ..formats.source import read_source
from ..kinematics.space import ConfigurationSpace, listed
from ..limits import LARGEST, Limits
from ..system.files import open_regular
from ..transforms import Array

_WHAT_TO_DO = "write it with numpy.save(path, array), an array of floats of shape (n, {dim})"


@dataclass(frozen=True, slots=True, eq=False)
class MappedRows:
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
        """Return rows, as they stand in the file from `start` on, in metres and radians.

        Raises:
            FormatError: A number is not finite, or too large.
        """
        hint = "mend the row and run the same command again: what lies before it is kept"
        rows = coordinates(raw, self.path, DiagnosticLog(), names=self.space.names, first=start, hint=hint)
        return self.space.decode(rows) if self.file_units else rows


def open_rows(path: str, space: ConfigurationSpace, file_units: bool) -> MappedRows:
    """Map a NumPy file.

    Raises:
        FormatError: It is not one, or does not hold rows of as many numbers as there are degrees of freedom.
    """
    log, hint = DiagnosticLog(), _WHAT_TO_DO.format(dim=space.dim)
    if not Path(path).is_file():
        read_source(path, log, Limits(), regular=True)  # says what is wrong
    rows = map_array(path, log, hint)
    if rows.ndim != 2 or rows.shape[1] != space.dim:
        if rows.shape == (space.dim,):
            hint = "one configuration is array.reshape(1, -1)"
        message = f"{path} holds an array of shape {rows.shape}; expected (n, {space.dim}): {listed(space.names)}"
        log.fail("CFG505", path, message, hint=hint)
    return MappedRows(path, rows, space, file_units)


# A header of version 3.0 is one of 2.0 in UTF-8, which only names of fields need.
_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
    (3, 0): np.lib.format.read_array_header_2_0,
}


def map_array(path: str, log: DiagnosticLog, hint: str = "") -> NDArray[Any]:
    """Map a NumPy file of integers or floats, of any shape.

    Args:
        path: The file, which is there.
        log: Where findings go.
        hint: What to do where it is not one.

    Raises:
        FormatError: It is not such a file, or shorter than its header says.
    """
    try:
        shape, dtype = _header(Path(path))
        array: Any = None if dtype.kind not in "fiu" else np.load(path, mmap_mode="r", allow_pickle=False)
    except Exception as error:  # NumPy's reader raises whatever it stumbles over
        why = str(error)[:200] or type(error).__name__
        log.fail("CFG505", path, f"{path} is not a NumPy file (.npy), or cut off: {why}", hint=hint)
    if array is None:
        found = f"{dtype} values in an array of shape {shape}"
        log.fail("CFG505", path, f"{path} holds {found}; expected floats", hint=hint)
    return array


def coordinates(
    rows: NDArray[Any], path: str, log: DiagnosticLog, *, names: Sequence[str], first: int = 0, hint: str = ""
) -> Array:
    """Return rows as doubles that can be computed with.

    Args:
        rows: (n, width) numbers.
        path: The file that they stand in.
        log: Where findings go.
        names: What the columns are called; not used where there are more or fewer.
        first: Number of the first row.
        hint: What to do where a number cannot be used.

    Raises:
        FormatError: A number is not finite, or too large.
    """
    with np.errstate(over="ignore"):
        values = np.array(rows, dtype=np.float64)
    good = np.abs(values) <= LARGEST
    if not good.all():
        row, column = (int(i) for i in np.argwhere(~good)[0])
        name = names[column] if len(names) == rows.shape[1] else f"number {column + 1}"
        message = (
            f"row {first + row} of {path}: {name} is {rows[row, column]}; "
            f"expected a finite number, not larger than {LARGEST:g}"
        )
        log.fail("CFG505", path, message, hint=hint)
    return values


def _header(path: Path) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Return the shape and the type that a file declares, or raise what NumPy does."""
    with open_regular(path) as file:
        shape, _, dtype = _HEADERS[np.lib.format.read_magic(file)](file)
        length = os.path.getsize(path) - file.tell()
    if min(shape, default=1) < 0 or math.prod(shape) * dtype.itemsize > length:
        raise ValueError(f"{dtype} of shape {shape} in {length} bytes")
    return shape, dtype
