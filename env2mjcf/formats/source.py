"""Text files, opened with care, that can tell the place of every character."""

from __future__ import annotations

import bisect
import os
from dataclasses import dataclass, field
from pathlib import Path

from ..errors import DiagnosticLog, FormatError, Span, did_you_mean
from ..options import Limits, PathArgument

_UTF16_MARKS = (b"\xff\xfe", b"\xfe\xff")


@dataclass(frozen=True, slots=True)
class Source:
    """The text of a file.

    Attributes:
        path: The file, as it was named by the caller.
        text: The whole text, without a byte order mark; line ends as in the file.
    """

    path: str
    text: str
    _starts: tuple[int, ...] = field(default=(), repr=False, compare=False)

    @classmethod
    def of(cls, path: str, text: str) -> Source:
        """Index the lines of a text; `\\n`, `\\r\\n` and a lone `\\r` end a line."""
        starts = [0]
        for i, c in enumerate(text):
            if c == "\n" or (c == "\r" and text[i + 1 : i + 2] != "\n"):
                starts.append(i + 1)
        return cls(path, text, tuple(starts))

    def span(self, start: int, end: int | None = None) -> Span:
        """Return the place of `text[start:end]`, cut at the end of its first line."""
        row = bisect.bisect_right(self._starts, start) - 1
        begin = self._starts[row]
        line = self._line(row)
        column = min(start - begin, len(line)) + 1
        length = 1 if end is None else max(1, min(end - start, len(line) - column + 1))
        return Span(self.path, row + 1, column, length, line)

    def line_span(self, line: int, near: str = "") -> Span:
        """Return the place of a line, given from 1; of the word `near` in it where that occurs."""
        row = min(max(line, 1), len(self._starts)) - 1
        text = self._line(row)
        column = text.find(near) if near else -1
        if column < 0:
            column = len(text) - len(text.lstrip())
        return Span(self.path, row + 1, column + 1, max(1, len(near)), text)

    def _line(self, row: int) -> str:
        end = self._starts[row + 1] if row + 1 < len(self._starts) else len(self.text)
        return self.text[self._starts[row] : end].rstrip("\r\n")


def read_source(path: PathArgument, log: DiagnosticLog, limits: Limits) -> Source:
    """Read a text file.

    UTF-8 with or without a byte order mark; Latin-1 with a warning.

    Raises:
        FormatError: The file is missing, a folder, unreadable, too large, UTF-16, or not text.
    """
    name = os.fspath(path)
    data = _read_bytes(name, log, limits)
    if data.startswith(_UTF16_MARKS):
        log.fail(
            FormatError, "ENV106", name, f"{name} is UTF-16 text; expected UTF-8 or Latin-1", hint="save it as UTF-8"
        )
    if b"\0" in data:
        line = data.count(b"\n", 0, data.index(b"\0")) + 1
        log.fail(
            FormatError,
            "ENV107",
            name,
            f"{name} is not a text file: line {line} holds a NUL byte; expected an environment, robot or query file",
            span=Span(name, line, 1),
        )
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        text = data.decode("latin-1")
        line = data.count(b"\n", 0, error.start) + 1
        log.warn(
            FormatError,
            "ENV108",
            name,
            f"{name} is not UTF-8 (byte {data[error.start]:#04x} on line {line}); read as Latin-1",
            hint="save it as UTF-8",
            span=Source.of(name, text).line_span(line),
        )
    return Source.of(name, text)


def _read_bytes(name: str, log: DiagnosticLog, limits: Limits) -> bytes:
    if "\0" in name:
        log.fail(FormatError, "ENV101", repr(name), f"the path {name!r} holds a NUL byte")
    try:
        size = os.stat(name).st_size
        if os.path.isdir(name):
            inside = sorted(p.name for p in Path(name).iterdir() if p.suffix in (".env", ".xml", ".robot", ".query"))
            hint = f"it holds {', '.join(inside[:8])}" if inside else ""
            log.fail(FormatError, "ENV102", name, f"{name} is a folder; expected a file", hint=hint)
        if size > limits.file_bytes:
            log.fail(
                FormatError,
                "ENV105",
                name,
                f"{name} has {size} bytes; at most {limits.file_bytes} are read",
                hint="raise limits=Limits(file_bytes=...)",
            )
        with open(name, "rb") as file:
            return file.read()
    except FileNotFoundError:
        folder = Path(name).parent
        others = sorted(p.name for p in folder.iterdir()) if folder.is_dir() else []


        log.fail(FormatError, "ENV101", name, f"there is no file {name}", hint=did_you_mean(Path(name).name, others))
    except PermissionError:
        log.fail(FormatError, "ENV103", name, f"{name} may not be read", hint="check its permissions")
    except OSError as error:
        log.fail(FormatError, "ENV104", name, f"{name} cannot be read: {error.strerror}")
