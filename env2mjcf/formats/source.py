"""Text files, opened with care, that can tell the place of every character."""

from __future__ import annotations

import bisect
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from ..errors import DiagnosticLog, FormatError, Span, did_you_mean
from ..options import Limits, PathArgument

_LINE_END = re.compile(r"\r\n|\n|\r")
_UTF16_MARKS = (b"\xff\xfe", b"\xfe\xff")
# Longer lines are not quoted: a scene on one line would be quoted whole by every body in it.
_LONGEST_QUOTE = 1000
_SCENE_EXTENSIONS = (".env", ".xml", ".robot", ".query", ".path", ".map")


@dataclass(frozen=True, slots=True)
class Source:
    """The text of a file.

    Attributes:
        path: The file, as it was named by the caller.
        text: The whole text, without a byte order mark; line ends as in the file.
    """

    path: str
    text: str
    _starts: tuple[int, ...] = field(default=(0,), repr=False, compare=False)

    @classmethod
    def of(cls, path: str, text: str) -> Source:
        """Index the lines of a text; a line feed, a carriage return or both end a line."""
        return cls(path, text, (0, *(m.end() for m in _LINE_END.finditer(text))))

    def lines(self) -> Iterator[tuple[int, str]]:
        """Iterate the lines: where each starts in the text, and what it says without its line end."""
        for row, start in enumerate(self._starts):
            yield start, self._line(row)

    def span(self, start: int, end: int | None = None) -> Span:
        """Return the place of `text[start:end]`, cut at the end of its first line; long lines are not quoted."""
        row = bisect.bisect_right(self._starts, start) - 1
        begin, stop = self._starts[row], self._line_end(row)
        start = min(start, stop)
        length = 1 if end is None else max(1, min(end, stop) - start)
        quote = self.text[begin:stop] if stop - begin <= _LONGEST_QUOTE else ""
        return Span(self.path, row + 1, start - begin + 1, length, quote)

    def line_span(self, line: int, near: str = "") -> Span:
        """Return the place of a line, given from 1; of the word `near` in it where that occurs."""
        row = min(max(line, 1), len(self._starts)) - 1
        text = self._line(row)
        column = text.find(near) if near else -1
        if column < 0:
            return Span(self.path, row + 1, len(text) - len(text.lstrip()) + 1, 1, text)
        return Span(self.path, row + 1, column + 1, len(near), text)

    def _line(self, row: int) -> str:
        return self.text[self._starts[row] : self._line_end(row)]

    def _line_end(self, row: int) -> int:
        """Return where a line ends, its line end not counted."""
        begin = self._starts[row]
        end = self._starts[row + 1] if row + 1 < len(self._starts) else len(self.text)
        while end > begin and self.text[end - 1] in "\r\n":
            end -= 1
        return end


def read_source(path: PathArgument, log: DiagnosticLog, limits: Limits, named_at: Span | None = None) -> Source:
    """Read a text file.

    UTF-8 with or without a byte order mark; Latin-1 with a warning.

    Args:
        path: The file.
        log: Where findings go.
        limits: Bounds on hostile input.
        named_at: Where another file names this one, for messages.

    Raises:
        FormatError: The file is missing, a folder, unreadable, too large, UTF-16, or not text.
    """
    name = os.fsdecode(path)
    data = _read_bytes(name, log, limits, named_at)
    if data.startswith(_UTF16_MARKS):
        log.fail(
            FormatError, "ENV106", name, f"{name} is UTF-16 text; expected UTF-8 or Latin-1",
            hint="save it as UTF-8", span=Span(name, 1, 1),
        )  # fmt: skip
    if b"\0" in data:
        before = data[: data.index(b"\0")].decode("latin-1")
        place = Source.of(name, before).span(len(before))
        log.fail(
            FormatError, "ENV107", name,
            f"{name} is not a text file: line {place.line} holds a NUL byte; "
            "expected an environment, robot or query file",
            hint="name the scene's text file, not a mesh or an archive", span=Span(name, place.line, place.column),
        )  # fmt: skip
    try:
        return Source.of(name, data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        source = Source.of(name, data.decode("latin-1"))
        place = source.span(error.start)
        log.warn(
            FormatError, "ENV108", name,
            f"{name} is not UTF-8 (byte {data[error.start]:#04x} on line {place.line}); read as Latin-1",
            hint="save it as UTF-8", span=place,
        )  # fmt: skip
        return source


def _read_bytes(name: str, log: DiagnosticLog, limits: Limits, named_at: Span | None) -> bytes:
    def fail(code: str, message: str, hint: str) -> NoReturn:
        log.fail(FormatError, code, name, message, hint=hint, span=named_at)

    if "\0" in name:
        fail("ENV104", f"{name!r} cannot be read: no file has a NUL character in its name", "check the name")
    try:
        if os.path.isdir(name):
            inside = [n for n in _names_in(name) if n.endswith(_SCENE_EXTENSIONS)]
            holds = f"; it holds {', '.join(inside[:8])}" if inside else ""
            fail("ENV102", f"{name} is a folder; expected a file", f"name the file in it{holds}")
        with open(name, "rb") as file:
            # One more than allowed: the size that the system states is no bound for pipes and devices.
            data = file.read(limits.file_bytes + 1)
    except FileNotFoundError:
        others = _names_in(Path(name).parent)
        fail("ENV101", f"there is no file {name}", did_you_mean(Path(name).name, others) or "check the name")
    except PermissionError:
        fail("ENV103", f"{name} may not be read", "check its permissions")
    except OSError as error:
        fail("ENV104", f"{name} cannot be read: {error.strerror}", "check the name and the disk")
    if len(data) > limits.file_bytes:
        fail(
            "ENV105",
            f"{name} has more than {limits.file_bytes} bytes; at most so many are read",
            "raise limits=Limits(file_bytes=...)",
        )
    return data


def _names_in(folder: str | Path) -> list[str]:
    try:
        return sorted(os.listdir(folder))
    except OSError:
        return []
