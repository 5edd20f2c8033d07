"""Text files, opened with care, that can tell the place of every character."""

from __future__ import annotations

import bisect
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, NoReturn

from ..diagnostics import DiagnosticLog
from ..errors import Span, did_you_mean
from ..limits import Limits
from ..options import PathArgument
from ..system.files import open_regular

_LINE_END = re.compile(r"\r\n|\n|\r")
DOTS = "..."
"""Stands where a quoted line is cut."""

# Characters of a line that are quoted at most, and those of them in front of the place.
_LONGEST_QUOTE, _BEFORE = 400, 60
# A mark of UTF-32 begins like one of UTF-16.
_MARKS = {b"\xff\xfe\0\0": "UTF-32", b"\0\0\xfe\xff": "UTF-32", b"\xff\xfe": "UTF-16", b"\xfe\xff": "UTF-16"}
# Of four bytes of such text without a mark, those that are zero, for what is written in the Latin alphabet.
_ZEROS: dict[tuple[int, ...], str] = {(1, 3): "UTF-16", (0, 2): "UTF-16", (1, 2, 3): "UTF-32", (0, 1, 2): "UTF-32"}
# Bytes that are enough to tell.
_ENOUGH = 64
# Bytes that are read at once.
_PART = 1 << 20
_SCENE_EXTENSIONS = (".env", ".xml", ".robot", ".query", ".path", ".map")


@dataclass(frozen=True, slots=True)
class Source:
    """The text of a file.

    Attributes:
        path: The file, as it was named by the caller.
        text: The whole text, without a byte order mark; line ends as in the file.
        limits: What may be in it.
        place: Where all of it stands, if it is not the text of a file but what that text means, as with the value of
            an XML attribute; no part has a place of its own then.
    """

    path: str
    text: str
    limits: Limits = field(default_factory=Limits, repr=False, compare=False)
    place: Span | None = None
    _starts: tuple[int, ...] = field(default=(0,), repr=False, compare=False)

    @classmethod
    def of(cls, path: str, text: str, limits: Limits | None = None) -> Source:
        """Index the lines of a text; a line feed, a carriage return or both end a line."""
        return cls(path, text, limits or Limits(), None, (0, *(m.end() for m in _LINE_END.finditer(text))))

    def lines(self) -> Iterator[tuple[int, str]]:
        """Iterate the lines: where each starts in the text, and what it says without its line end."""
        for row, start in enumerate(self._starts):
            yield start, self._line(row)

    def span(self, start: int, end: int | None = None) -> Span:
        """Return the place of `text[start:end]`, cut at the end of its first line."""
        if self.place is not None:
            return self.place
        row = bisect.bisect_right(self._starts, start) - 1
        begin, stop = self._starts[row], self._line_end(row)
        start = min(start, stop)
        length = 1 if end is None else max(1, min(end, stop) - start)
        first, last = quoted(begin, stop, start)
        text = f"{DOTS * (first > begin)}{self.text[first:last]}{DOTS * (last < stop)}"
        return Span(self.path, row + 1, start - begin + 1, length, text, first - begin - len(DOTS) * (first > begin))

    def line_span(self, line: int, near: str = "") -> Span:
        """Return the place of a line, given from 1; of the word `near` in it where that occurs."""
        row = min(max(line, 1), len(self._starts)) - 1
        text = self._line(row)
        column = text.find(near) if near else -1
        start = self._starts[row]
        if column < 0:
            return self.span(start + len(text) - len(text.lstrip()))
        return self.span(start + column, start + column + len(near))

    def column_span(self, line: int, column: int) -> Span:
        """Return the place of a column of a line, both given from 1; the nearest that there is."""
        row = min(max(line, 1), len(self._starts)) - 1
        start = self._starts[row]
        return self.span(start + max(0, min(column - 1, self._line_end(row) - start)))

    def _line(self, row: int) -> str:
        return self.text[self._starts[row] : self._line_end(row)]

    def _line_end(self, row: int) -> int:
        """Return where a line ends, its line end not counted."""
        begin = self._starts[row]
        end = self._starts[row + 1] if row + 1 < len(self._starts) else len(self.text)
        while end > begin and self.text[end - 1] in "\r\n":
            end -= 1
        return end


def quoted(begin: int, end: int, place: int) -> tuple[int, int]:
    """Return which part of the line from `begin` to `end` is quoted about a place.

    The whole line, unless it is very long: else each of many bodies on one line would keep a copy of it.
    """
    if end - begin <= _LONGEST_QUOTE:
        return begin, end
    first = max(begin, min(place - _BEFORE, end - _LONGEST_QUOTE))
    return first, min(end, first + _LONGEST_QUOTE)


def wide_encoding(data: bytes) -> str:
    """Return which of the encodings with two or four bytes a character a text is in; nothing where it is in none."""
    for mark, name in _MARKS.items():
        if data.startswith(mark):
            return name
    begin = data[: min(_ENOUGH, len(data) // 4 * 4)]
    return _ZEROS.get(tuple(i for i in range(4) if begin and not any(begin[i::4])), "")


def read_source(
    path: PathArgument, log: DiagnosticLog, limits: Limits, named_at: Span | None = None, *, regular: bool = False
) -> Source:
    """Read a text file.

    UTF-8 with or without a byte order mark; Latin-1 with a warning.

    Args:
        path: The file.
        log: Where findings go.
        limits: Bounds on hostile input.
        named_at: Where another file names this one, for messages.
        regular: Whether it has to be a regular file. The user may name a pipe and wait for it; a file may not.

    Raises:
        FormatError: The file is missing, a folder, unreadable, too large, UTF-16 or UTF-32, or not text.
    """
    name = os.fsdecode(path)
    data = _read_bytes(name, log, limits, named_at, regular)
    wide = wide_encoding(data)
    if wide:
        hint = "save it as UTF-8"
        log.fail("ENV106", name, f"{name} is {wide} text; expected UTF-8 or Latin-1", hint=hint, span=Span(name, 1, 1))
    if b"\0" in data:
        before = data[: data.index(b"\0")].decode("latin-1")
        place = Source.of(name, before).span(len(before))
        message = (
            f"{name} is not a text file: line {place.line} holds a NUL byte; "
            "expected an environment, robot or query file"
        )
        hint = "name the scene's text file, not a mesh or an archive"
        log.fail("ENV107", name, message, hint=hint, span=Span(name, place.line, place.column))
    try:
        return Source.of(name, data.decode("utf-8-sig"), limits)
    except UnicodeDecodeError as error:
        source = Source.of(name, data.decode("latin-1"), limits)
        place = source.span(error.start)
        message = f"{name} is not UTF-8 (byte {data[error.start]:#04x} on line {place.line}); read as Latin-1"
        log.warn("ENV108", name, message, hint="save it as UTF-8", span=place)
        return source


def _read_bytes(name: str, log: DiagnosticLog, limits: Limits, named_at: Span | None, regular: bool) -> bytes:
    def fail(code: str, message: str, hint: str) -> NoReturn:
        log.fail(code, name, message, hint=hint, span=named_at)

    if "\0" in name:
        fail("ENV104", f"{name!r} cannot be read: no file has a NUL character in its name", "check the name")
    if os.path.isdir(name):
        inside = [n for n in _names_in(name) if n.endswith(_SCENE_EXTENSIONS)]
        holds = f"; it holds {', '.join(inside[:8])}" if inside else ""
        fail("ENV102", f"{name} is a folder; expected a file", f"name the file in it{holds}")
    try:
        with open_regular(name, or_pipe=not regular) as file:
            # One more than allowed: the size that the system states does not bound pipes and devices.
            data = read_at_most(file, limits.file_bytes + 1)
    except FileNotFoundError:
        if os.path.islink(name):
            fail("ENV101", f"there is no file {name}", f"it is a link to {os.readlink(name)}, which does not exist")
        others = _names_in(Path(name).parent)
        fail("ENV101", f"there is no file {name}", did_you_mean(Path(name).name, others) or "check the name")
    except PermissionError:
        fail("ENV103", f"{name} may not be read", "check its permissions")
    except OSError as error:
        fail("ENV104", f"{name} cannot be read: {error.strerror}", "check the name and the disk")
    if len(data) > limits.file_bytes:
        fail("ENV105", f"{name} has more than {limits.file_bytes} bytes; no more are read", Limits.hint("file_bytes"))
    return data


def read_at_most(file: IO[bytes], count: int) -> bytes:
    """Read at most `count` bytes of a file, part by part: `file.read` would make room for all of them at once."""
    parts: list[bytes] = []
    while count > 0 and (part := file.read(min(count, _PART))):
        parts.append(part)
        count -= len(part)
    return b"".join(parts)


def _names_in(folder: str | Path) -> list[str]:
    try:
        return sorted(os.listdir(folder))
    except OSError:
        return []
