"""Tells the dialect of an env file from its text (env-format section 2)."""

from __future__ import annotations

import re

from ..errors import DiagnosticLog, FormatError, did_you_mean
from ..model import Dialect
from .source import Source

_COMMENT = re.compile(r"#[^\r\n]*")
_ROBOT_TAGS = re.compile(r"^\s*(active|nonholonomic|surface)\b", re.IGNORECASE | re.MULTILINE)
_LIMITS = re.compile(r"\b(revolute|spherical)\s+\S+:", re.IGNORECASE)
_LATER_TAGS = ("Active", "Passive", "Internal", "Surface", "NonHolonomic")


def is_xml(source: Source) -> bool:
    """Whether the text is XML."""
    return source.text.lstrip().startswith("<")


def is_robot_file(source: Source) -> bool:
    """Whether the text is a dialect E robot file: a count, then a mesh file."""
    words = _COMMENT.sub("", source.text).split(maxsplit=2)
    return len(words) > 1 and words[0].isdigit() and "." in words[1]


def detect(source: Source, log: DiagnosticLog) -> Dialect:
    """Return the dialect of an environment's text.

    Raises:
        FormatError: The text is none of them.
    """
    text = _COMMENT.sub("", source.text)
    words = text.split(maxsplit=2)
    if not words:
        log.fail(FormatError, "ENV130", source.path, f"{source.path} is empty", span=source.span(0))
    first = words[0]
    if first.lower() == "boundary" or did_you_mean(first, ("Boundary",)):
        return _with_boundary(text)
    if re.fullmatch(r"\d+", first) and len(words) > 1:
        second = words[1]
        if did_you_mean(second, ("MultiBody",)):
            return Dialect.A
        if second.lower() in {t.lower() for t in _LATER_TAGS} or did_you_mean(second, _LATER_TAGS):
            return Dialect.C if _LIMITS.search(text) else Dialect.B
        if "." in second:
            log.fail(
                FormatError, "ENV131", source.path, f"{source.path} is a robot file, not an environment",
                hint="read the environment, and give this file as robots=[...] (--robots)",
                span=source.line_span(1 + source.text[: source.text.find(second)].count("\n"), second),
            )  # fmt: skip
    at = source.text.find(first)
    log.fail(
        FormatError, "ENV130", source.path,
        f"{source.path} is no environment: it begins with {first[:40]!r}; expected a number of multibodies, "
        "'Boundary' or XML",
        span=source.span(at, at + len(first)),
    )  # fmt: skip


def _with_boundary(text: str) -> Dialect:
    bracket = re.match(r"\s*\S+\s+(?:[A-Za-z]\w*\s*)?(\[)?", text)
    if bracket and not bracket.group(1):
        return Dialect.C
    return Dialect.D if _ROBOT_TAGS.search(text) else Dialect.E
