"""Files that are nothing but numbers: found all at once, each with its place."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ...errors import Span
from ..source import DOTS, quoted

_NUMBER = re.compile(rb"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?")
_LINE_END = re.compile(rb"\r\n|\r|\n")
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
_EXPONENTS = _table(b"eEdD")
_FRACTION = _table(b".eEdD")
_ENDS = _table(b"\r\n")
_SPACE = ord(" ")

# Widths of columns, of integers and of other numbers.
_WIDTHS = ((8, 6, 10, 5, 7, 9, 12), (12, 10, 13, 14, 15, 16, 20, 8))


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
    blocks = [_Columns(block) for block in _blocks(data)]
    integers, others = (
        [w for w in widths if all(b.fits(w, kind) for b in blocks) and any(b.cuts(w, kind).size for b in blocks)]
        for kind, widths in enumerate(_WIDTHS)
    )
    # Last of each 0, which cuts nothing.
    for widths in product([*integers, 0], [*others, 0]):
        if any(widths):
            yield b"".join(block.cut(widths) for block in blocks)


def _blocks(data: bytes) -> Iterator[bytes]:
    at = 0
    while at < len(data):
        end = _LINE_END.search(data, at + _CHUNK)
        yield data[at : end.end() if end else len(data)]
        at = end.end() if end else len(data)


class _Columns:
    """Some lines of a text, and where numbers in them may touch.

    Args:
        data: The lines.
    """

    def __init__(self, data: bytes) -> None:
        self._chars = chars = np.frombuffer(data, dtype=np.uint8)
        ends = _ENDS[chars]
        row = np.cumsum(ends, dtype=np.int32) - ends
        begins = np.concatenate([[0], np.flatnonzero(ends) + 1]).astype(np.int32)
        column = np.arange(len(chars), dtype=np.int32) - begins[row]
        filled = ~_BLANK[chars]
        # Fortran aligns to the right, so that a line's length without trailing blanks is a multiple of the width.
        length = np.zeros(len(begins), dtype=np.int32)
        np.maximum.at(length, row[filled], column[filled] + 1)
        kind = np.zeros(len(begins), dtype=np.int8)
        kind[row[_FRACTION[chars]]] = 1
        before = np.concatenate([[False], filled[:-1]])
        before[begins[begins < len(chars)]] = False
        inside = column < length[row]
        # Where a number ends in front of a blank, and where a sign stands that no exponent has.
        gaps = inside & ~filled & before
        signs = _SIGN[chars] & before
        signs[1:] &= ~_EXPONENTS[chars[:-1]]
        self._odd = bool((inside & ~filled & (chars != _SPACE)).any())
        self._begins, self._length, self._kind = begins.astype(np.int64), length, kind
        self._filled = filled
        joints = np.flatnonzero(gaps | signs)
        self._spaced = np.zeros(len(begins), dtype=bool)
        self._spaced[row[joints]] = True
        of_kind = kind[row[joints]]
        self._joints = [column[joints[of_kind == k]] for k in (0, 1)]

    def fits(self, width: int, kind: int) -> bool:
        """Whether every line of a kind (0 integers, 1 other numbers) is columns of a width, or one number."""
        if self._odd or (self._joints[kind] % width).any():
            return False
        # A line of several numbers that is not cut has none of them in columns.
        whole = (self._length % width != 0) & self._spaced & (self._kind == kind)
        last = self.cuts(width, kind) - 1
        return not whole.any() and bool(self._filled[last].all())

    def cuts(self, width: int, kind: int) -> NDArray[np.int64]:
        """Return where columns of a width begin within the lines of a kind."""
        lines = np.flatnonzero((self._length % width == 0) & (self._kind == kind) & (self._length > width))
        counts = self._length[lines] // width - 1
        before = np.cumsum(counts) - counts
        of_line = np.arange(counts.sum()) - np.repeat(before, counts) + 1
        return np.repeat(self._begins[lines], counts) + width * of_line

    def cut(self, widths: tuple[int, int]) -> bytes:
        """Return the lines with a blank in front of every column that does not begin its line."""
        places = [self.cuts(w, kind) for kind, w in enumerate(widths) if w]
        return np.insert(self._chars, np.concatenate(places), _SPACE).tobytes()
