"""XML, read without entities, network or huge trees, with the place of every attribute."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from lxml import etree

from ..errors import DiagnosticLog, FormatError, Span, did_you_mean
from ..options import Limits
from .lexer import Scanner
from .source import Source

T = TypeVar("T")

# lxml keeps only the line where a start tag ends; the n-th start tag of the text is the n-th element.
_MARKUP = re.compile(
    r"<!--.*?-->|<\?.*?\?>|<!\[CDATA\[.*?\]\]>|<!DOCTYPE[^>\[]*(?:\[.*?\])?\s*>"
    r"|<(?P<tag>[A-Za-z_][\w:.\-]*)(?:[^\"'<>]|\"[^\"]*\"|'[^']*')*>",
    re.DOTALL,
)


@dataclass(frozen=True, slots=True)
class Node:
    """An element and the place of its start tag.

    Attributes:
        element: The parsed element.
        source: The file.
        start, end: Where its start tag lies in the text.
        log: Where findings go.
        limits: Bounds on hostile input.
        places: Where the start tag of every element of the document lies.
    """

    element: Any
    source: Source
    start: int
    end: int
    log: DiagnosticLog
    limits: Limits
    places: Mapping[Any, tuple[int, int]]

    @property
    def tag(self) -> str:
        """Name of the element."""
        return str(self.element.tag)

    @property
    def attributes(self) -> dict[str, str]:
        """All attributes as text."""
        return {str(k): str(v) for k, v in self.element.attrib.items()}

    @property
    def span(self) -> Span:
        """Place of the tag's name."""
        return self.source.span(self.start, self.start + 1 + len(self.tag))

    def children(self, *tags: str) -> Iterator[Node]:
        """Iterate the child elements, of some tags (in any case) or all."""
        wanted = {t.lower() for t in tags}
        for child in self.element:
            if isinstance(child.tag, str) and (not wanted or child.tag.lower() in wanted):
                yield self._node(child)

    def descendants(self, *tags: str) -> Iterator[Node]:
        """Iterate all elements below with one of some tags (in any case)."""
        wanted = {t.lower() for t in tags}
        for child in self.element.iterdescendants():
            if isinstance(child.tag, str) and child.tag.lower() in wanted:
                yield self._node(child)

    def get(self, name: str) -> str | None:
        """Return an attribute's text."""
        value = self.element.get(name)
        return None if value is None else str(value)

    def require(self, name: str) -> str:
        """Return an attribute's text, or fail."""
        value = self.get(name)
        if value is None:
            guess = did_you_mean(name, self.attributes)
            self.fail("ENV141", f"<{self.tag}> has no attribute {name!r}", hint=guess)
        return value

    def span_of(self, name: str) -> Span:
        """Place of an attribute's value."""
        place = self._value(name)
        return self.source.span(*place) if place else self.span

    def scan(self, name: str) -> Scanner:
        """Return a scanner over an attribute's value, which knows its place in the file."""
        self.require(name)
        start, end = self._value(name) or (self.start, self.start)
        cut = Source.of(self.source.path, self.source.text[:end])
        scanner = Scanner(cut, self.log, self.limits)
        scanner.advance(start)
        return scanner

    def number(self, name: str) -> float:
        """Read an attribute as one number."""
        return self._whole(name, lambda scan: scan.number(name))

    def numbers(self, name: str, names: str) -> tuple[float, ...]:
        """Read an attribute as several numbers."""
        return self._whole(name, lambda scan: scan.numbers(names))

    def integer(self, name: str) -> int:
        """Read an attribute as an integer."""
        return self._whole(name, lambda scan: scan.integer(name))

    def choice(self, name: str, choices: Mapping[str, T]) -> T:
        """Read an attribute as one of several words, in any case."""
        text = self.require(name)
        folded = {k.lower(): v for k, v in choices.items()}
        if text.strip().lower() not in folded:
            expected = " or ".join(repr(k) for k in choices)
            self.fail(
                "ENV142", f"unknown {name} {text!r}; expected {expected}", hint=did_you_mean(text, choices), at=name
            )
        return folded[text.strip().lower()]

    def fail(self, code: str, message: str, *, hint: str = "", at: str | None = None) -> Any:
        """Raise a `FormatError` at the element or at one of its attributes."""
        span = self.span_of(at) if at else self.span
        self.log.fail(FormatError, code, f"<{self.tag}>", message, hint=hint, span=span)

    def ignore_other_children(self, *known: str) -> None:
        """Report the child elements that nothing reads."""
        for child in self.children():
            if child.tag.lower() not in {k.lower() for k in known}:
                self.log.info(
                    "ENV307", f"<{child.tag}>", f"<{child.tag}> of <{self.tag}> is not used", span=child.span
                )

    def _whole(self, name: str, read: Callable[[Scanner], T]) -> T:
        scanner = self.scan(name)
        value = read(scanner)
        if not scanner.at_end():
            scanner.fail("ENV143", f"{name} has more than was expected")
        return value

    def _value(self, name: str) -> tuple[int, int] | None:
        pattern = re.compile(rf"[\s\"'](?:{re.escape(name)})\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
        match = pattern.search(self.source.text, self.start, self.end)
        if not match:
            return None
        return match.span(1) if match.group(1) is not None else match.span(2)

    def _node(self, element: Any) -> Node:
        start, end = self.places.get(element, (self.start, self.end))
        return Node(element, self.source, start, end, self.log, self.limits, self.places)


def parse_xml(source: Source, log: DiagnosticLog, limits: Limits) -> Node:
    """Parse XML text into nodes that know their places.

    Raises:
        FormatError: The text is not well-formed, or declares entities.
    """
    if re.search(r"<!ENTITY", source.text):
        line = source.text[: source.text.index("<!ENTITY")].count("\n") + 1
        log.fail(
            FormatError, "ENV144", source.path, "XML entity declarations are not read", hint="write the text itself",
            span=source.line_span(line, "<!ENTITY"),
        )  # fmt: skip
    root = _parse(source, log)
    tags = [m.span() for m in _MARKUP.finditer(source.text) if m.group("tag")]
    elements = [e for e in root.iter() if isinstance(e.tag, str)]
    # lxml elements are proxies: they are equal while one is alive, so the map holds them as keys.
    places = dict(zip(elements, tags, strict=False))
    start, end = places.get(root, (0, 0))
    return Node(root, source, start, end, log, limits, places)


def _parse(source: Source, log: DiagnosticLog) -> Any:
    # The declared encoding is dropped: the text is decoded already, and lxml refuses both.
    text = re.sub(r"^\s*(<\?xml[^>]*?)\s+encoding\s*=\s*[\"'][^\"']*[\"']", r"\1", source.text)
    skipped = len(source.text) - len(source.text.lstrip())
    lines_skipped = source.text.count("\n", 0, skipped)
    try:
        return _from_text(text.lstrip())
    except etree.XMLSyntaxError as error:
        line, column = error.position
        place = source.line_span(line + lines_skipped)
        span = Span(place.path, place.line, max(1, min(column, len(place.text) + 1)), 1, place.text)
        message = f"not well-formed XML: {str(error.msg).rstrip()}"
        rest = _problem_alone(text, line + lines_skipped)
        if rest is None:
            log.fail(FormatError, "ENV140", source.path, message, span=span)
        log.warn(
            FormatError, "ENV214", source.path, f"{message}; only the problem above it is read",
            hint="the planner's library section is not needed, but its collision rules are unknown now", span=span,
        )  # fmt: skip
        return _from_text(rest.lstrip())


def _from_text(text: str) -> Any:
    parser = etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=False, load_dtd=False)
    return etree.fromstring(text.encode("utf-8"), parser)


def _problem_alone(text: str, fault_line: int) -> str | None:
    """Return a problem file cut behind its whole `<Problem>`; None where the fault lies in it.

    Published problem files have ill-formed library sections, which the planner's own parser took.
    """
    opening = re.search(r"<(motion_?planning)\b", text, re.IGNORECASE)
    closing = re.search(r"</(?:MP)?Problem\s*>", text, re.IGNORECASE)
    if not opening or not closing or text.count("\n", 0, closing.end()) + 1 >= fault_line:
        return None
    return f"{text[: closing.end()]}</{opening.group(1)}>"
