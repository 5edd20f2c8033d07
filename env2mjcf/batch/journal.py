"""The unfinished output of a batch, and the journal that says how much of it is done.

Answers are written to `<output>.partial`; `<output>.journal` says of what and how far. The journal is there before the
first answer and replaced only after the answers that it speaks of are on the disk, and the output gets its name when it
is whole: a crash at any moment costs the last seconds, and nothing that is there is wrong.

Files of these names may be somebody else's. A journal is ours if it begins as we begin it, or is cut off there; if the
rest is damaged, the work begins anew. A partial output is ours if it is empty or lies beside a journal that is ours.
Other files are kept, and the work is refused.

The partial output is locked as long as a process writes it. A process that creates, renames or removes one of these
files holds the lock of the folder: no other batch begins between a look at a name and what is done to it.

These names must be known to the next run, so they are not the hidden ones of `system.files`.
"""

from __future__ import annotations

import errno
import io
import json
import os
import re
from collections.abc import Generator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.lib.format import write_array_header_1_0
from numpy.typing import NDArray

from ..diagnostics import DiagnosticLog
from ..system.locks import FolderBusyError, LockOutcome, folder_lock, try_lock, unlock

_FORMAT = "env2mjcf batch 1"
_BEGINNING = f'{{"format": "{_FORMAT}"'.encode()
_WHOLE = re.compile(
    re.escape(_BEGINNING) + rb', "job": "(\w+)", "rows": (\d{1,18}), "done": (\d{1,18}), "digest": "(\w+)"\}'
)
# No journal of ours is as long.
_LONGEST = 1024
_ZEROS = bytes(1 << 20)
# Windows has neither links that are followed by mistake nor the flag.
_FLAGS = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)


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


def unfinished_files(output: Path) -> tuple[Path, Path, Path]:
    """Return the files that lie beside an output until it is whole: the partial one, its journal, the next journal."""
    partial, journal, fresh = (output.with_name(output.name + end) for end in (".partial", ".journal", ".journal.new"))
    return partial, journal, fresh


class Partial:
    """The unfinished output, which no other process may write at the same time.

    Args:
        output: What it will be called.

    Attributes:
        earlier: How far an earlier run came; None if there was none, or its journal is damaged.

    Raises:
        ConversionError: It cannot be written, another process is at it, or a file that is not ours has its name.
    """

    def __init__(self, output: Path) -> None:
        self._output = output
        self._partial, self._journal, self._fresh = unfinished_files(output)
        self._answers: np.memmap[Any, Any] | None = None
        with self._alone():
            self._read(self._fresh)
            journal = self._read(self._journal)
            self._handle = self._open(self._partial, os.O_RDWR | os.O_CREAT)
            try:
                self._take(journal is not None)
            except BaseException:
                os.close(self._handle)
                raise
        self.earlier = _progress(journal or b"")

    def _read(self, path: Path) -> bytes | None:
        """Return the content of a journal of ours, None if there is none."""
        try:
            handle = self._open(path, os.O_RDONLY)
        except FileNotFoundError:
            return None
        with open(handle, "rb") as file:
            content = file.read(_LONGEST)
        # Of one that a crash cut off there is less than the beginning.
        if content[: len(_BEGINNING)] != _BEGINNING[: len(content)]:
            self._refuse(path)
        return content

    def _open(self, path: Path, flags: int) -> int:
        try:
            return os.open(path, flags | _FLAGS, 0o666)
        except OSError as error:
            if error.errno == errno.ELOOP:
                self._refuse(path)
            raise

    def _take(self, has_journal: bool) -> None:
        """Lock the partial output, if it is ours."""
        # By name, too: where folders cannot be locked, another process may just have finished, and renamed it.
        if try_lock(self._handle) is LockOutcome.TAKEN or not self._is_ours():
            self._stop(f"another process is writing {self._partial}", "wait, or choose another output")
        if not has_journal and os.fstat(self._handle).st_size:
            self._refuse(self._partial)
        self._fresh.unlink(missing_ok=True)

    def resume(self, rows: int, kind: type[np.generic]) -> NDArray[Any] | None:
        """Return the answers of an earlier run, mapped; None if the file is not what the journal speaks of."""
        header = _header(rows, kind)
        with open(self._handle, "r+b", closefd=False) as file:
            file.seek(0)
            whole = file.read(len(header)) == header
        if whole and os.fstat(self._handle).st_size == len(header) + rows * np.dtype(kind).itemsize:
            return self._map(rows, kind)
        return None

    def begin(self, progress: Progress, kind: type[np.generic]) -> NDArray[Any]:
        """Return room for answers of a type, mapped; fail with a ConversionError where the disk has no room."""
        try:
            # The journal comes first: without it, what a crash leaves would be nobody's.
            self.commit(progress)
            os.ftruncate(self._handle, 0)
            with open(self._handle, "r+b", closefd=False) as file:
                file.seek(0)
                file.write(_header(progress.rows, kind))
                # Written out now: a disk that is full is an error here, and kills a process that writes to a mapping.
                left = progress.rows * np.dtype(kind).itemsize
                while left > 0:
                    left -= file.write(_ZEROS[:left])
            return self._map(progress.rows, kind)
        except OSError as error:
            self.discard()
            self._fail(error)
        except BaseException:
            self.discard()
            raise

    def _map(self, rows: int, kind: type[np.generic]) -> NDArray[Any]:
        if not rows:  # which cannot be mapped
            return np.zeros(0, kind)
        with open(self._handle, "r+b", closefd=False) as file:
            self._answers = np.memmap(file, kind, "r+", len(_header(rows, kind)), (rows,))
        return self._answers

    def commit(self, progress: Progress) -> None:
        """Put what is done on the disk, then say so; fail with a ConversionError where the partial output is gone."""
        self._sync()
        with self._mine(), self._fresh.open("x", encoding="utf-8") as file:
            try:
                json.dump({"format": _FORMAT, **asdict(progress)}, file)
                file.flush()
                os.fsync(file.fileno())
                self._fresh.replace(self._journal)
            except BaseException:
                with suppress(OSError):
                    self._fresh.unlink()
                raise

    def finish(self) -> None:
        """Give the whole output its name; fail with a ConversionError where the partial output is gone."""
        self._sync()
        with self._mine():
            self._partial.replace(self._output)
            self._journal.unlink(missing_ok=True)

    def discard(self) -> None:
        """Leave nothing behind."""
        with suppress(OSError, FolderBusyError), folder_lock(self._output.parent):
            if self._is_ours():
                self._partial.unlink()
                self._journal.unlink(missing_ok=True)

    def close(self) -> None:
        """Let other processes at it."""
        self._answers = None
        unlock(self._handle)
        os.close(self._handle)

    @contextmanager
    def _mine(self) -> Generator[None]:
        """Keep other batches out while the files are changed, which are still ours."""
        with self._alone():
            if not self._is_ours():
                message = f"{self._partial} was removed or replaced while it was written"
                self._stop(message, "run the command again, and leave the file alone until it ends")
            yield

    @contextmanager
    def _alone(self) -> Generator[None]:
        try:
            with folder_lock(self._output.parent):
                yield
        except FolderBusyError as error:
            hint = "is a process stopped in the middle of writing there? End it, or choose another output"
            self._stop(str(error), hint)
        except OSError as error:
            self._fail(error)

    def _is_ours(self) -> bool:
        """Return whether the name still means the open file."""
        with suppress(OSError):
            return os.path.samestat(os.fstat(self._handle), self._partial.lstat())
        return False

    def _sync(self) -> None:
        try:
            if self._answers is not None:
                self._answers.flush()
            os.fsync(self._handle)
        except OSError as error:
            self._fail(error)

    def _refuse(self, path: Path) -> NoReturn:
        message = f"{path} was not left by an earlier run of this verb, and is kept"
        self._stop(message, "remove it, or choose another output")

    def _fail(self, error: OSError) -> NoReturn:
        reason = f"{self._output} cannot be written: {error.strerror or error}"
        self._stop(reason, "choose another output, or make room")

    def _stop(self, message: str, hint: str) -> NoReturn:
        DiagnosticLog().fail("CFG509", str(self._output), message, hint=hint)


def _progress(journal: bytes) -> Progress | None:
    if (found := _WHOLE.fullmatch(journal)) is None:
        return None
    job, rows, done, digest = found.groups()
    return Progress(job.decode(), int(rows), int(done), digest.decode())


def _header(rows: int, kind: type[np.generic]) -> bytes:
    header = io.BytesIO()
    write_array_header_1_0(header, {"descr": np.dtype(kind).str, "fortran_order": False, "shape": (rows,)})
    return header.getvalue()
