"""Tells the dialect of an env file from its text (docs/format/env.md)."""

from __future__ import annotations

import re

from ..diagnostics import DiagnosticLog
from ..errors import Span, did_you_mean
from ..model.environment import Dialect
from .lexer import misspelling
from .source import Source

_COMMENT = re.compile(r"#[^\r\n]*")
_COUNT = re.compile(r"[0-9]+")
# Every tag is at most this long, so that a longer word need not be compared with them.
_LONGEST_TAG = 16
_TAG_LIKE = re.compile(rf"(?<!\S)[AaNnSs][A-Za-z]{{3,{_LONGEST_TAG}}}(?!\S)")
# One that is not closed reaches to the end of its line: those behind it are not tried each.
_OPTION = re.compile(r"-[A-Za-z]\([^)\r\n]*\)?")
_BOUNDARY = re.compile(r"\s*\S+\s+(?:[A-Za-z]\w*\s*)?(\[)?")
_LIMITS = re.compile(r"\b(revolute|spherical)\s+[^\s:]+:", re.IGNORECASE)
_ROBOT_TAGS = ("Active", "NonHolonomic", "Surface")
_LATER_TAGS = (*_ROBOT_TAGS, "Passive", "Internal")


def is_xml(source: Source) -> bool:
    """Whether the text is XML."""
    return source.text.lstrip().startswith("<")


def is_robot_file(source: Source) -> bool:
    """Whether the text is a dialect E robot file: a count, then a mesh file."""
    words = _first_words(_COMMENT.sub("", source.text))
    return bool(_COUNT.fullmatch(words[0])) and "." in words[1]


def detect(source: Source, log: DiagnosticLog) -> Dialect:
    """Return the dialect of an environment's text.

    Raises:
        FormatError: The text is not in any dialect.
    """
    text = _COMMENT.sub("", source.text)
    first, second = _first_words(text)
    if not first:
        message = f"{source.path} is empty; expected an environment"
        log.fail("ENV130", source.path, message, hint="was it saved?", span=source.span(0))
    if _means(first, ("Boundary",)):
        return _with_boundary(text)
    if _COUNT.fullmatch(first):
        if _means(second, ("MultiBody",)):
            return Dialect.A
        if _means(second, _LATER_TAGS):
            return Dialect.C if _LIMITS.search(text) else Dialect.B
        if "." in second:
            message = f"{source.path} is a robot file, not an environment: a mesh file follows its count"
            hint = "read the environment, and give this file as robots=[...] (--robots)"
            log.fail("ENV131", source.path, message, hint=hint, span=_place(source, second))
        expected = "'MultiBody', 'Active', 'Passive', 'Internal' or 'Surface' behind the number of multibodies"
        wrong = second or first
    else:
        expected = "a number of multibodies, 'Boundary' or XML"
        wrong = first
    message = f"{source.path} is not an environment: found {wrong[:40]!r}; expected {expected}"
    hint = "name an environment, or choose its dialect with dialect= (--dialect)"
    log.fail("ENV130", source.path, message, hint=hint, span=_place(source, wrong))


def _first_words(text: str) -> tuple[str, str]:
    words = (*text.split(maxsplit=2)[:2], "", "")
    return words[0], words[1]


def _means(word: str, tags: tuple[str, ...]) -> bool:
    return len(word) <= _LONGEST_TAG and bool(did_you_mean(word, tags))


def _place(source: Source, word: str) -> Span:
    for start, line in source.lines():
        at = _COMMENT.sub("", line).find(word)
        if at >= 0:
            return source.span(start + at, start + at + len(word))
    return source.span(0)


def _with_boundary(text: str) -> Dialect:
    match = _BOUNDARY.match(text)
    if match and not match.group(1):
        return Dialect.C
    # `-a( Surface )` is not a tag.
    words = set(_TAG_LIKE.findall(_OPTION.sub("", text)))
    return Dialect.D if any(map(_is_robot_tag, words)) else Dialect.E


def _is_robot_tag(word: str) -> bool:
    # A misspelt tag counts, so that its robot keeps the kinematics of its dialect.
    return misspelling(word, _LATER_TAGS) in _ROBOT_TAGS
