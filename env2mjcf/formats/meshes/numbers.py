"""Files that are nothing but numbers: found all at once, each with its place."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import Span
from ..source import DOTS, quoted

_NUMBER = re.compile(rb"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?")
_LINE_END = re.compile(rb"\r\n|\r|\n")
_FIELD = re.compile(rb" *[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eEdD][+-]?\d+)?")
_POINT = re.compile(rb"[.eEdD]")
_D_TO_E = bytes.maketrans(b"dD", b"eE")
_LINE = re.compile(rb"[^\r\n]+")
_BLANKS = re.compile(rb"\s")

# Bytes that are split into words at once, so that the words of a large file never lie in memory together.
_CHUNK = 1 << 20


def _table(characters: bytes) -> NDArray[np.bool_]:
    table = np.zeros(256, dtype=bool)
    table[np.frombuffer(characters, dtype=np.uint8)] = True
    return table


_BLANK = _table(b" \t\n\v\f\r")
# Neither letters of `nan` and `inf` nor the underscore that Python allows in numbers.
_NUMERIC = _table(b" \t\n\v\f\r0123456789+-.eE")
_SIGN = _table(b"+-")
_EXPONENT = _table(b"eE")
_FRACTION = _table(b".eEdD")


@dataclass(frozen=True, slots=True)
class Numbers:
    """The numbers of a text.

    Attributes:
        data: The text.
        starts: Offset of each token in `data`.
        values: Value of each token; shorter than `starts` where a token is not a finite number, which is then
            token `len(values)`.
    """

    data: bytes
    starts: NDArray[np.int64]
    values: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.values)

    @property
    def complete(self) -> bool:
        """Whether every token is a finite number."""
        return len(self.values) == len(self.starts)

    def extent(self, token: int) -> tuple[int, int]:
        """Return the offsets at which a token begins and ends."""
        start = int(self.starts[token])
        limit = int(self.starts[token + 1]) if token + 1 < len(self.starts) else len(self.data)
        return start, start + len(self.data[start:limit].rstrip())

    def text(self, token: int) -> str:
        """Return a token as it stands in the text."""
        start, end = self.extent(token)
        return self.data[start:end].decode("latin-1")

    def first_fraction(self, first: int, last: int) -> int | None:
        """Return the first of the tokens `first` to `last - 1` that is not written as an integer."""
        if first >= last:
            return None
        start, end = int(self.starts[first]), self.extent(last - 1)[1]
        hits = np.flatnonzero(_FRACTION[np.frombuffer(self.data, np.uint8)[start:end]])
        if not len(hits):
            return None
        return int(np.searchsorted(self.starts, start + int(hits[0]), side="right")) - 1


def find_numbers(data: bytes, *, fortran: bool = False) -> Numbers:
    """Find all numbers of a text.

    Args:
        data: Numbers with blanks between them.
        fortran: Accept what Fortran prints: exponents with `D`, and no blank in front of a sign.
    """
    # One letter for another, so that offsets stay those of `data`.
    text = data.translate(_D_TO_E) if fortran else data
    chars = np.frombuffer(text, dtype=np.uint8)
    blank = _BLANK[chars]
    first = ~blank
    first[1:] &= blank[:-1]
    if fortran and len(chars):
        glued = _SIGN[chars[1:]] & ~blank[:-1] & ~_EXPONENT[chars[:-1]]
        first[1:] |= glued
        if glued.any():
            text = np.insert(chars, np.flatnonzero(glued) + 1, ord(" ")).tobytes()
    starts = np.flatnonzero(first).astype(np.int64)
    plain = bool(_NUMERIC[chars].all())
    values: list[NDArray[np.float64]] = []
    for chunk in _token_chunks(text):
        converted = _converted(chunk, plain)
        values.append(converted)
        if len(converted) < len(chunk):
            break
    return Numbers(data, starts, np.concatenate(values) if values else np.empty(0))


def _token_chunks(text: bytes) -> Iterator[list[bytes]]:
    at = 0
    while at < len(text):
        blank = _BLANKS.search(text, at + _CHUNK)
        end = blank.start() if blank else len(text)
        yield text[at:end].split()
        at = end


def _converted(tokens: list[bytes], plain: bool) -> NDArray[np.float64]:
    """Return the values of the tokens in front of the first that is not a finite number."""
    if plain:
        try:
            values = np.array(tokens, dtype=np.float64)
        except ValueError:
            values = None
        if values is not None and np.isfinite(values).all():
            return values
    good: list[float] = []
    for token in tokens:
        if not _NUMBER.fullmatch(token) or abs(float(token)) == float("inf"):
            break
        good.append(float(token))
    return np.array(good, dtype=np.float64)


def span_of(path: str, data: bytes, start: int, end: int) -> Span:
    """Return the place of `data[start:end]`, which lies within one line."""
    head = data[:start]
    begin = max(head.rfind(b"\n"), head.rfind(b"\r")) + 1
    line = len(_LINE_END.findall(head)) + 1
    match = _LINE.match(data, begin)
    stop = match.end() if match else begin
    first, last = quoted(begin, stop, start)
    left, right = DOTS * (first > begin), DOTS * (last < stop)
    skipped = len(data[begin:first].decode("utf-8", "replace"))
    column = skipped + len(data[first:start].decode("utf-8", "replace")) + 1
    text = f"{left}{data[first:last].decode('utf-8', 'replace')}{right}"
    return Span(path, line, column, max(1, end - start), text, skipped - len(left))


def column_layouts(data: bytes) -> Iterator[bytes]:
    """Guess where numbers printed in columns of fixed width touch, and yield the text with blanks between them.

    Fortran's `10I6` prints 100000 100001 as `100000100001`. Lines of integers have one width, lines of other
    numbers another. Each pair of widths that every line fits gives one text; the widths of MOVIE.BYU come first.
    """
    lines = _LINE_END.split(data)
    integers = [line for line in lines if line.strip() and not _POINT.search(line)]
    others = [line for line in lines if _POINT.search(line)]
    for integer_width in _widths(integers, (8, 6, 10, 5, 7, 9, 12)):
        for other_width in _widths(others, (12, 10, 13, 14, 15, 16, 20, 8)):
            if integer_width or other_width:
                yield b"\n".join(
                    b" ".join(_columns(x, other_width if _POINT.search(x) else integer_width)) for x in lines
                )


def _widths(lines: list[bytes], candidates: tuple[int, ...]) -> Iterator[int]:
    """Yield the widths of which every line is made; last 0, which cuts nothing."""
    for width in candidates:
        if lines and all(all(_FIELD.fullmatch(field) for field in _columns(line, width)) for line in lines):
            yield width
    yield 0


def _columns(line: bytes, width: int) -> list[bytes]:
    line = line.rstrip()
    # Fortran aligns to the right, so that a line's length without trailing blanks is a multiple of the width.
    if width and len(line) % width:
        return [line]
    return [line[i : i + width] for i in range(0, len(line), width)] if width else [line]
