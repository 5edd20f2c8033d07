"""Splits the text of an env or robot file into words, numbers and punctuation, with their places."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NoReturn, TypeVar

from ..errors import DiagnosticLog, FormatError, Span, did_you_mean
from ..model import Comment
from ..options import Limits
from .source import Source

T = TypeVar("T")

# What C++ stream extraction accepts: no nan, inf or hexadecimal (env-format section 3.2).
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_INTEGER = re.compile(r"[+-]?\d+")
_AFTER_NUMBER = re.compile(r"[\s;:,()\[\]#]|$")
_WORD = re.compile(r"[^\s;\[\]]+")
_CHUNK = re.compile(r"\S+")
_BLANK = re.compile(r"\s+")
_COMMENT = re.compile(r"#[^\r\n]*")
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)\b", re.IGNORECASE)


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
        limits: Bounds on hostile input.
    """

    def __init__(self, source: Source, log: DiagnosticLog, limits: Limits) -> None:
        self.source = source
        self.log = log
        self.limits = limits
        self.comments: list[Comment] = []
        self._position = 0
        self._directives: list[Comment] = []

    # Where the scanner stands.

    @property
    def position(self) -> int:
        """Index of the next character that is neither blank nor comment."""
        self._skip()
        return self._position

    @property
    def end_of_last(self) -> int:
        """Index just behind what was read last."""
        return self._position

    def at_end(self) -> bool:
        """Whether nothing but blanks and comments is left."""
        return self.position >= len(self.source.text)

    def peek(self, ahead: int = 0) -> str:
        """Return the next character (or the one `ahead` of it); empty at the end."""
        at = self.position + ahead
        return self.source.text[at : at + 1]

    def peek_word(self) -> str:
        """Return the next word without reading it; empty at the end."""
        match = _WORD.match(self.source.text, self.position)
        return match.group() if match else self.peek()

    def next_is_number(self) -> bool:
        """Whether a number comes next."""
        match = _NUMBER.match(self.source.text, self.position)
        return match is not None and _AFTER_NUMBER.match(self.source.text, match.end()) is not None

    def span(self, start: int | None = None) -> Span:
        """Return the place from `start` to what was read last, or of the next word."""
        if start is not None:
            return self.source.span(start, self._position)
        match = _CHUNK.match(self.source.text, self.position)
        return self.source.span(self._position, match.end() if match else None)

    def take_directives(self) -> list[Comment]:
        """Return the comments since the last call, for `#VIZMO_...` lines in front of a body."""
        self._skip()
        taken, self._directives = self._directives, []
        return taken

    # What is read.

    def word(self, what: str, *, whole: bool = False) -> Token:
        """Read a word; `whole` keeps brackets and semicolons in it, as file names do."""
        start = self.position
        match = (_CHUNK if whole else _WORD).match(self.source.text, start)
        if match is None:
            self.fail_expected(what)
        if len(match.group()) > self.limits.name_length:
            self.fail(
                "ENV109",
                f"a word of {len(match.group())} characters; at most {self.limits.name_length} are read",
                hint="raise limits=Limits(name_length=...)",
            )
        self._position = match.end()
        return Token(match.group(), start, match.end())

    def number(self, what: str) -> float:
        """Read a finite number."""
        return float(self._numeral(_NUMBER, what, "a number"))

    def numbers(self, names: str) -> tuple[float, ...]:
        """Read one number for each blank-separated name."""
        return tuple(self.number(name) for name in names.split())

    def integer(self, what: str) -> int:
        """Read an integer."""
        return int(self._numeral(_INTEGER, what, "an integer"))

    def count(self, what: str, at_most: int) -> int:
        """Read a count that is neither negative nor beyond a limit."""
        start = self.position
        value = self.integer(what)
        if value < 0 or value > at_most:
            self.fail("ENV110", f"{what} is {value}; expected 0 to {at_most}", span=self.source.span(start, self._position))
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
        token = self.word(what)
        span = self.source.span(token.start, token.end)
        if token.text in choices:
            return choices[token.text]
        folded = {k.lower(): k for k in choices}
        name = folded.get(token.text.lower())
        if name is not None:
            if exact_case:
                self.log.warn(
                    FormatError, "ENV201", token.text, f"{what} {token.text!r} is read as {name!r}",
                    hint="the original reader compares case here", span=span,
                )  # fmt: skip
            return choices[name]
        guess = did_you_mean(token.text, choices)
        near = guess.split("'")[1] if guess else ""
        if near and abs(len(near) - len(token.text)) <= 2 and token.text[:1].lower() == near[:1].lower():
            self.log.warn(
                FormatError, "ENV202", token.text, f"misspelt {what}: {token.text!r} is read as {near!r}", span=span
            )
            return choices[near]
        self.fail(code, f"unknown {what} {token.text!r}; expected {_either(choices)}", hint=guess, span=span)

    def advance(self, position: int) -> None:
        """Step to a position further on."""
        self._position = position

    def rest_of_line(self) -> str:
        """Read the rest of the current line, comments included."""
        match = re.compile(r"[^\r\n]*").match(self.source.text, self._position)
        assert match is not None
        self._position = match.end()
        return match.group()

    def next_line(self) -> None:
        """Step over one line end, if the scanner stands in front of it."""
        match = re.compile(r"\r\n|\n|\r").match(self.source.text, self._position)
        if match:
            self._position = match.end()

    # Faults.

    def fail(self, code: str, message: str, *, hint: str = "", span: Span | None = None) -> NoReturn:
        """Raise a `FormatError`, by default at the next word."""
        self.log.fail(FormatError, code, self.source.path, message, hint=hint, span=span or self.span())

    def fail_expected(self, what: str) -> NoReturn:
        """Raise a `FormatError` that says what was expected and what was found instead."""
        if self.at_end():
            text = self.source.text.rstrip()
            place = self.source.span(max(0, len(text) - 1))
            self.fail("ENV111", f"the file ends where {what} was expected", hint="is the file cut off?", span=place)
        match = _CHUNK.match(self.source.text, self.position)
        found = match.group() if match else self.peek()
        if _NOT_FINITE.match(found):
            self.fail("ENV113", f"expected {what}, found {found!r}", hint="numbers must be finite")
        hint = "write a decimal point, not a comma" if re.fullmatch(r"[+-]?\d+,\d+", found) else ""
        self.fail("ENV112", f"expected {what}, found {found!r}", hint=hint)

    def _numeral(self, pattern: re.Pattern[str], what: str, kind: str) -> str:
        match = pattern.match(self.source.text, self.position)
        if match is None or _AFTER_NUMBER.match(self.source.text, match.end()) is None:
            self.fail_expected(f"{kind} ({what})")
        if abs(float(match.group())) == float("inf"):
            self.fail("ENV113", f"{what} {match.group()} is too large for a number", span=self.span())
        self._position = match.end()
        return match.group()

    def _skip(self) -> None:
        text = self.source.text
        while True:
            blank = _BLANK.match(text, self._position)
            if blank:
                self._position = blank.end()
            comment = _COMMENT.match(text, self._position)
            if not comment:
                return
            kept = Comment(comment.group(), self.source.span(comment.start(), comment.end()))
            self.comments.append(kept)
            self._directives.append(kept)
            self._position = comment.end()


def _either(words: Mapping[str, object]) -> str:
    names = [repr(w) for w in words]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} or {names[-1]}"
