"""Splits the text of an env or robot file into words, numbers and punctuation, with their places."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import NoReturn, TypeVar

from ..diagnostics import DiagnosticLog
from ..errors import Span, did_you_mean
from ..limits import Limits
from ..model.environment import Comment
from .source import Source

T = TypeVar("T")

# What C++ stream extraction accepts: no nan, inf or hexadecimal. A number may be followed
# by a comment, but 1.#INF is how some C++ libraries print infinity.
_END = r"(?=[\s;:()\[\]]|#(?!INF|IND|QNAN|SNAN)|\Z)"
# Digits belong to one part of the pattern only: else a long run of them is split in every way before it is refused.
_NUMBER = re.compile(rf"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?{_END}")
_INTEGER = re.compile(rf"[+-]?[0-9]+{_END}")
_WORD = re.compile(r"[^\s;\[\]]+")
_CHUNK = re.compile(r"\S+")
_BLANK = re.compile(r"\s+")
_REST_OF_LINE = re.compile(r"([^\r\n]*)(?:\r\n|\n|\r)?")
_COMMENT = re.compile(r"#[^\r\n]*")
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|[0-9.]+#(INF|IND|QNAN|SNAN))", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"[+-]?[0-9]+,[0-9]+")
_HEXADECIMAL = re.compile(r"[+-]?0x", re.IGNORECASE)


def parse_number(word: str) -> float | None:
    """Return the finite number that a word is, as C++ reads it; None where it is not one."""
    if not _NUMBER.fullmatch(word):
        return None
    value = float(word)
    return value if math.isfinite(value) else None


def parse_integer(word: str) -> int | None:
    """Return the integer that a word is; None where it is not one, or too large for a number."""
    if not _INTEGER.fullmatch(word) or math.isinf(float(word)):
        return None
    # Python takes a limited number of digits, and counts leading zeros among them.
    size = int(word.lstrip("+-").lstrip("0") or "0")
    return -size if word.startswith("-") else size


def number_hint(word: str) -> str:
    """Return what to do about a word that should be a number; empty where it does not look like one."""
    if _DECIMAL_COMMA.match(word):
        return "write a decimal point, not a comma"
    if _HEXADECIMAL.match(word):
        return "write a decimal number; hexadecimal ones are not read"
    overflows = _NUMBER.fullmatch(word) and math.isinf(float(word))
    return "numbers must be finite" if overflows or _NOT_FINITE.match(word) else ""


@dataclass(frozen=True, slots=True)
class Token:
    """A word and its place."""

    text: str
    start: int
    end: int


class Scanner:
    """Reads a source from left to right.

    Comments (`#` to the end of the line, wherever a token may begin) are skipped and kept.

    Args:
        source: The text.
        log: Where findings go.
        start, end: The part of the text to read; all of it by default.
        part: What that part is called in messages.
    """

    def __init__(
        self, source: Source, log: DiagnosticLog, start: int = 0, end: int | None = None, part: str = "file"
    ) -> None:
        self.source = source
        self.log = log
        self.limits = source.limits
        self.comments: list[Comment] = []
        self._part = part
        self._start = start
        self._position = start
        self._end = len(source.text) if end is None else end
        self._directives: list[Comment] = []

    # Where the scanner stands.

    @property
    def position(self) -> int:
        """Index of the next character that is neither blank nor comment."""
        self._skip()
        return self._position

    def at_end(self) -> bool:
        """Whether nothing but blanks and comments is left."""
        return self.position >= self._end

    def peek(self) -> str:
        """Return the next character; empty at the end."""
        at = self.position
        return self.source.text[at] if at < self._end else ""

    def peek_word(self) -> str:
        """Return the next word without reading it; empty at the end."""
        match = self.next_matches(_WORD)
        return match.group() if match else self.peek()

    def next_matches(self, pattern: re.Pattern[str]) -> re.Match[str] | None:
        """Match a pattern with what comes next, without reading it."""
        return pattern.match(self.source.text, self.position, self._end)

    def next_is_number(self) -> bool:
        """Whether a number comes next."""
        return self.next_matches(_NUMBER) is not None

    def span(self, start: int | None = None) -> Span:
        """Return the place from `start` to what was read last, or of the next word."""
        if start is not None:
            return self.source.span(start, self._position)
        match = self.next_matches(_CHUNK)
        return self.source.span(self._position, match.end() if match else None)

    def take_directives(self) -> list[Comment]:
        """Return the comments since the last call, for `#VIZMO_...` lines in front of a body."""
        self._skip()
        taken, self._directives = self._directives, []
        return taken

    # What is read.

    def word(self, what: str, *, whole: bool = False) -> Token:
        """Read a word; `whole` keeps brackets and semicolons in it, as file names do."""
        match = self.next_matches(_CHUNK if whole else _WORD)
        if match is None:
            self.fail_expected(what)
        length = match.end() - match.start()
        if length > self.limits.name_length:
            message = f"a word of {length} characters; at most {self.limits.name_length} are read"
            self.fail("ENV109", message, hint=Limits.hint("name_length"))
        self._position = match.end()
        return Token(match.group(), match.start(), match.end())

    def number(self, what: str) -> float:
        """Read a finite number."""
        return self._numeral(_NUMBER, parse_number, f"a number ({what})", what)

    def numbers(self, names: str) -> tuple[float, ...]:
        """Read one number for each blank-separated name."""
        return tuple(self.number(name) for name in names.split())

    def integer(self, what: str) -> int:
        """Read an integer."""
        return self._numeral(_INTEGER, parse_integer, f"an integer ({what})", what)

    def count(self, what: str, limit: str) -> int:
        """Read a count that is neither negative nor beyond a limit, one of the fields of `Limits`."""
        start, at_most = self.position, getattr(self.limits, limit)
        value = self.integer(what)
        if not 0 <= value <= at_most:
            hint = Limits.hint(limit) if value > 0 else "write how many follow"
            self.fail("ENV110", f"{what} is {value}; expected 0 to {at_most}", hint=hint, span=self.span(start))
        return value

    def punctuation(self, char: str, what: str) -> None:
        """Read one given character."""
        if self.peek() != char:
            self.fail_expected(f"{char!r} {what}")
        self._position += 1

    def keyword(self, choices: Mapping[str, T], what: str, *, code: str = "ENV120", exact_case: bool = False) -> T:
        """Read one of several words, forgiving case and slight misspelling.

        Args:
            choices: Canonical spelling to value.
            what: What the word is, for messages.
            code: Code of the error for a word that is none of them.
            exact_case: Whether the original reader compared case: another case is a warning then.
        """
        token = self.word(f"{what} {_either(choices)}")
        if token.text in choices:
            return choices[token.text]
        span = self.source.span(token.start, token.end)
        name = next((k for k in choices if k.lower() == token.text.lower()), None)
        if name is not None:
            if exact_case:
                hint = "the original reader compares case here"
                self.log.warn("ENV201", token.text, f"{what} {token.text!r} is read as {name!r}", hint=hint, span=span)
            return choices[name]
        name = misspelling(token.text, choices)
        if name is not None:
            message = f"misspelt {what}: {token.text!r} is read as {name!r}"
            self.log.warn("ENV202", token.text, message, hint=f"write {name}", span=span)
            return choices[name]
        hint = did_you_mean(token.text, choices) or f"write {_either(choices)} here"
        found = _shortened(token.text)
        self.fail(code, f"unknown {what} {found!r}; expected {_either(choices)}", hint=hint, span=span)

    def advance(self, position: int) -> None:
        """Step to a position further on."""
        self._position = position

    def line(self) -> Scanner:
        """Return a scanner over the rest of the current line, and step behind its end."""
        match = _REST_OF_LINE.match(self.source.text, self._position, self._end)
        assert match is not None
        rest = Scanner(self.source, self.log, match.start(), match.end(1), part="line")
        rest.comments = self.comments
        self._position = match.end()
        return rest

    def behind_last_line(self) -> bool:
        """Whether not even an empty line is left."""
        return self._position >= self._end

    # Faults.

    def fail(self, code: str, message: str, *, hint: str = "", span: Span | None = None) -> NoReturn:
        """Raise a `FormatError`, by default at the next word."""
        self.log.fail(code, self.source.path, message, hint=hint, span=span or self.span())

    def fail_expected(self, what: str) -> NoReturn:
        """Raise a `FormatError` that says what was expected and what was found instead."""
        match = self.next_matches(_CHUNK)
        if match is None:
            length = len(self.source.text[self._start : self._end].rstrip())
            place = self.source.span(self._start + max(0, length - 1))
            hint = "is the file cut off?" if self._part == "file" else f"write {what}"
            self.fail("ENV111", f"the {self._part} ends where {what} was expected", hint=hint, span=place)
        found = _shortened(match.group())
        hint = number_hint(found)
        code = "ENV113" if _NOT_FINITE.match(found) else "ENV112"
        self.fail(code, f"expected {what}, found {found!r}", hint=hint or f"write {what} here")

    def _numeral(self, pattern: re.Pattern[str], parse: Callable[[str], T | None], expected: str, what: str) -> T:
        match = self.next_matches(pattern)
        if match is None:
            self.fail_expected(expected)
        value = parse(match.group())
        if value is None:
            found = _shortened(match.group())
            self.fail("ENV113", f"{what} {found} is too large for a number", hint="numbers must be finite")
        self._position = match.end()
        return value

    def _skip(self) -> None:
        text, end = self.source.text, self._end
        while self._position < end:
            char = text[self._position]
            pattern = _COMMENT if char == "#" else _BLANK
            if char != "#" and not char.isspace():
                return
            match = pattern.match(text, self._position, end)
            assert match is not None
            self._position = match.end()
            if char == "#":
                kept = Comment(match.group(), self.source.span(match.start(), match.end()))
                self.comments.append(kept)
                self._directives.append(kept)


def misspelling(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that a word is a slip of; None where it may well be meant."""
    if len(word) > 2 * max(map(len, known), default=0):
        return None
    folded = {k.lower(): k for k in known}
    near = difflib.get_close_matches(word.lower(), folded, n=1, cutoff=0.6)
    if not near or abs(len(near[0]) - len(word)) > 2 or word[:1].lower() != near[0][:1]:
        return None
    return folded[near[0]]


def _shortened(word: str) -> str:
    return word if len(word) <= 60 else f"{word[:60]}..."


def _either(words: Mapping[str, object]) -> str:
    names = [repr(w) for w in words]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} or {names[-1]}"
