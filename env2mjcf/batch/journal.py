"""The unfinished output of a batch, and the journal that says how much of it is done.

Answers are written to `<output>.partial`; `<output>.journal` says of what and how far. The journal is replaced only
after the answers that it speaks of are on the disk, and the output gets its name when it is whole: a crash at any
moment costs the last seconds, and nothing that is there is wrong.
"""

from __future__ import annotations

import json
import os
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.lib.format import open_memmap, write_array_header_1_0
from numpy.typing import NDArray

from ..errors import ConversionError, DiagnosticLog
from ..locking import LockOutcome, try_lock
from ..opening import open_regular

_FORMAT = 1
_ZEROS = bytes(1 << 20)


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a batch is.

    Attributes:
        job: Digest of the scene, the options and the question.
        rows: Number of all rows.
        done: Number of rows, from the first on, whose answers are written.
        digest: Digest of those rows of the input.
    """

    job: str
    rows: int
    done: int
    digest: str


class Partial:
    """The unfinished output, which no other process may write at the same time.

    Args:
        output: What it will be called.

    Raises:
        ConversionError: It cannot be written, or another process is at it.
    """

    def __init__(self, output: Path) -> None:
        self._output = output
        self._partial = output.with_name(output.name + ".partial")
        self._journal = output.with_name(output.name + ".journal")
        try:
            self._handle = os.open(self._partial, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            self._fail(error)
        if try_lock(self._handle) is LockOutcome.TAKEN or not self._is_ours():
            os.close(self._handle)
            message = f"another process is writing {self._partial}"
            DiagnosticLog().fail(ConversionError, "CFG509", str(output), message, hint="wait, or choose another output")
        self._answers: NDArray[Any] | None = None

    def progress(self) -> Progress | None:
        """Return how far an earlier run came; None if there was none, or its journal cannot be read."""
        try:
            with open_regular(self._journal) as file:
                stored = json.load(file)
            if stored.pop("format") == _FORMAT:
                return Progress(str(stored["job"]), int(stored["rows"]), int(stored["done"]), str(stored["digest"]))
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            pass
        return None

    def resume(self, rows: int, kind: type[np.generic]) -> NDArray[Any] | None:
        """Return the answers of an earlier run, mapped; None if the file is not what the journal speaks of."""
        with suppress(OSError, ValueError):
            answers = open_memmap(self._partial, mode="r+")
            if answers.shape == (rows,) and answers.dtype == kind:
                self._answers = answers
                return answers
        return None

    def begin(self, rows: int, kind: type[np.generic]) -> NDArray[Any]:
        """Return room for answers, mapped.

        Raises:
            ConversionError: The disk has no room.
        """
        try:
            self._journal.unlink(missing_ok=True)
            os.ftruncate(self._handle, 0)
            with open(self._handle, "r+b", closefd=False) as file:
                header = {"descr": np.dtype(kind).str, "fortran_order": False, "shape": (rows,)}
                write_array_header_1_0(file, header)
                # Written out now: a disk that is full is an error here, and kills a process that writes to a mapping.
                left = rows * np.dtype(kind).itemsize
                while left > 0:
                    left -= file.write(_ZEROS[:left])
            answers: NDArray[Any] = open_memmap(self._partial, mode="r+") if rows else np.zeros(0, kind)
        except OSError as error:
            self.discard()
            self._fail(error)
        self._answers = answers
        return answers

    def commit(self, progress: Progress) -> None:
        """Put what is done on the disk, then say so."""
        fresh = self._journal.with_name(self._journal.name + ".new")
        try:
            self._sync()
            with fresh.open("w", encoding="utf-8") as file:
                json.dump({"format": _FORMAT, **asdict(progress)}, file)
                file.flush()
                os.fsync(file.fileno())
            fresh.replace(self._journal)
        except OSError as error:
            with suppress(OSError):
                fresh.unlink()
            self._fail(error)

    def finish(self) -> None:
        """Give the whole output its name."""
        try:
            self._sync()
            self._partial.replace(self._output)
            self._journal.unlink(missing_ok=True)
        except OSError as error:
            self._fail(error)

    def discard(self) -> None:
        """Leave nothing behind."""
        self._journal.unlink(missing_ok=True)
        self._partial.unlink(missing_ok=True)

    def close(self) -> None:
        """Let other processes at it."""
        self._answers = None
        os.close(self._handle)

    def _is_ours(self) -> bool:
        """Return whether the name still means the open file: another process may just have finished, and renamed it."""
        with suppress(OSError):
            return os.path.samestat(os.fstat(self._handle), self._partial.stat())
        return False

    def _sync(self) -> None:
        if isinstance(self._answers, np.memmap):
            self._answers.flush()
        os.fsync(self._handle)

    def _fail(self, error: OSError) -> NoReturn:
        DiagnosticLog().fail(
            ConversionError, "CFG509", str(self._output),
            f"{self._output} cannot be written: {error.strerror or error}", hint="choose another output, or make room",
        )  # fmt: skip
