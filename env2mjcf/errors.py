"""Exceptions, the diagnostics that explain them, and text that is safe to show."""

from __future__ import annotations

import difflib
import errno
import os
import re
import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import islice


class Severity(StrEnum):
    """How much a diagnostic matters."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


@dataclass(frozen=True, slots=True)
class Span:
    """A piece of one line of a source file.

    Attributes:
        path: The file, as it was named by the caller.
        line: Line number, from 1.
        column: Column of the first character, from 1.
        length: Number of characters, at least 1; a span never leaves its line.
        text: The source line without its line end; of a very long one the part around the place, between dots.
        skipped: How many columns of the line `text` leaves out in front; column `skipped + 1` is its first.
    """

    path: str
    line: int
    column: int
    length: int = 1
    text: str = ""
    skipped: int = 0

    def __str__(self) -> str:
        return f"{self.path}:{self.line}:{self.column}"

    def excerpt(self) -> str:
        """Return the source line with a caret line under it."""
        # Tabs stay tabs in the caret line, so that the caret stands under its column.
        before = self.column - 1 - self.skipped
        indent = "".join("\t" if c == "\t" else " " for c in self.text[:before])
        length = max(1, min(self.length, len(self.text) - before))
        return f"    {self.text}\n    {indent}{'^' * length}"


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One finding about an input: what was found, where, and what to do.

    Attributes:
        code: Stable code, listed with its meaning in `env2mjcf.diagnostics.CATALOGUE`.
        severity: How much it matters.
        subject: What it is about: a body, a mesh file, a connection.
        message: What was found and what was expected.
        hint: What to do about it; may be empty.
        span: Where in the source, if it has a place.
        times: How many findings it stands for: more than one in the last of a code that was found very often.

    What files say is quoted in `subject`, `message` and `hint`: they are abridged, however long that is.
    """

    code: str
    severity: Severity
    subject: str
    message: str
    hint: str = ""
    span: Span | None = None
    times: int = 1

    def __post_init__(self) -> None:
        for name in ("subject", "message", "hint"):
            text = getattr(self, name)
            if len(text) > _LONGEST_WORD:
                object.__setattr__(self, name, abridged(text))

    def __str__(self) -> str:
        place = f"{self.span}: " if self.span else ""
        lines = [f"{place}{self.severity} {self.code}: {self.message}"]
        if self.span and self.span.text:
            lines.append(self.span.excerpt())
        if self.hint:
            lines.append(f"    hint: {self.hint}")
        return "\n".join(lines)


class Env2MjcfError(Exception):
    """Base of every error that env2mjcf raises on bad input.

    Attributes:
        diagnostic: The finding that stopped the work.
        diagnostics: All findings up to it, itself last.
    """

    def __init__(self, diagnostic: Diagnostic, diagnostics: Iterable[Diagnostic] = ()) -> None:
        super().__init__(str(diagnostic))
        self.diagnostic = diagnostic
        self.diagnostics = (*diagnostics, diagnostic)

    @property
    def code(self) -> str:
        """The stable code of the finding."""
        return self.diagnostic.code

    @property
    def span(self) -> Span | None:
        """Where in the source it was found."""
        return self.diagnostic.span

    def __reduce__(self) -> tuple[type[Env2MjcfError], tuple[Diagnostic, tuple[Diagnostic, ...]]]:
        return type(self), (self.diagnostic, self.diagnostics[:-1])


class FormatError(Env2MjcfError):
    """A text file (env, robot, XML, query) that cannot be read."""


class GeometryError(Env2MjcfError):
    """A mesh that is missing, unreadable or unusable."""


class FileError(Env2MjcfError, OSError):
    """A file that the system does not give: an `OSError`, too, of the kind that opening it would raise.

    Attributes:
        errno, strerror, filename: As of an `OSError`.
    """

    number: int

    def __init__(self, diagnostic: Diagnostic, diagnostics: Iterable[Diagnostic] = ()) -> None:
        super().__init__(diagnostic, diagnostics)
        self.errno, self.strerror, self.filename = self.number, os.strerror(self.number), diagnostic.subject

    def __str__(self) -> str:
        return str(self.diagnostic)


class MissingFileError(FileError, FormatError, FileNotFoundError):
    """A text file that does not exist."""

    number = errno.ENOENT


class FolderGivenError(FileError, FormatError, IsADirectoryError):
    """A folder where a text file was expected."""

    number = errno.EISDIR


class ForbiddenFileError(FileError, FormatError, PermissionError):
    """A text file that may not be read."""

    number = errno.EACCES


class MissingMeshError(FileError, GeometryError, FileNotFoundError):
    """A mesh file that does not exist."""

    number = errno.ENOENT


class KinematicsError(Env2MjcfError):
    """Bodies and connections that do not make a robot."""


class ConversionError(Env2MjcfError):
    """A scene that cannot be expressed in, or is refused by, MuJoCo; or output that cannot be written."""


# Characters of a word, and of a line, of a message at most; lines of a message at most.
_LONGEST_WORD, _LONGEST_LINE, _MOST_LINES = 240, 1000, 25
_LONG_WORD = re.compile(rf"\S{{{_LONGEST_WORD + 1},}}")
# Characters that are looked at, at either end, of a text however long.
_LOOKED_AT = 1 << 15


def abridged(text: str, lines: int = _MOST_LINES) -> str:
    """Return a text for people without the middle of long words and lines, and of so many lines at most."""
    if len(text) <= _LONGEST_WORD:
        return text
    if len(text) > 2 * _LOOKED_AT:
        text = f"{text[:_LOOKED_AT]}...{text[-_LOOKED_AT:]}"
    listed = _LONG_WORD.sub(lambda m: _without_middle(m[0], _LONGEST_WORD), text).split("\n")
    if len(listed) > lines:
        listed[lines - 1 :] = [f"... and {len(listed) - lines + 1} more lines"]
    return "\n".join(_without_middle(line, _LONGEST_LINE) for line in listed)


def _without_middle(text: str, most: int) -> str:
    # What was expected stands behind what was found.
    return text if len(text) <= most else f"{text[: most - most // 3]}...{text[3 - most // 3 :]}"


def enumeration(names: Sequence[str], most: int = 12) -> str:
    """Return the first of some names, with commas between them, and how many more there are."""
    return ", ".join(names[:most]) + (f", and {len(names) - most} more" if len(names) > most else "")


# Names that a word is compared with at most.
_COMPARED = 1000


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return `did you mean 'x'?` for the nearest known word, of very many one of the first, else an empty string."""
    # Words that are alike enough are not twice as long as each other, or half as long.
    alike = (k for k in known if 0.4 <= len(k) / (len(word) or 1) <= 2.5)
    by_folded = {k.lower(): k for k in islice(alike, _COMPARED)}
    near = difflib.get_close_matches(word.lower(), by_folded, n=1, cutoff=0.6)
    return f"did you mean {by_folded[near[0]]!r}?" if near else ""


def counted(count: int, what: str) -> str:
    """Return a number of things, in the plural where there is not one."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def robots_named(robots: Sequence[int]) -> str:
    """Return `robot 0`, or `robots 0, 1, 2`; of more than twelve the first ones."""
    return f"robot{'s' * (len(robots) > 1)} {', '.join(map(str, robots[:12]))}{', ...' * (len(robots) > 12)}"


# Control, format (among them the ones that turn the direction of text), surrogates, line and paragraph separators.
_TRICKY = ("Cc", "Cf", "Cs", "Zl", "Zp")


def is_tricky(character: str) -> bool:
    """Return whether a character may play tricks on a terminal or a page: it is invisible, or moves others."""
    return unicodedata.category(character) in _TRICKY


def printable(text: str) -> str:
    """Return text with control characters escaped; line feeds and tabs stay."""
    return "".join(c if c in "\n\t" else one_line(c) for c in text)


def one_line(text: str) -> str:
    """Return text with every control character escaped."""
    return "".join(c.encode("unicode_escape").decode("ascii") if is_tricky(c) else c for c in text)
