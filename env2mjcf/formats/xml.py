"""The elements of an XML file, with the place of every attribute."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, NoReturn, TypeVar

from ..errors import DiagnosticLog, FormatError, Span, did_you_mean
from .lexer import Scanner
from .source import Source

T = TypeVar("T")

_ATTRIBUTE = re.compile(r"(?<=\s)([^\s\"'=<>/]+)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")


@dataclass(frozen=True, slots=True)
class Document:
    """What the nodes of one document share.

    Attributes:
        source: The file.
        log: Where findings go.
        places: Where the start tag of every element lies in the text.
    """

    source: Source
    log: DiagnosticLog
    places: Mapping[Any, tuple[int, int]]


@dataclass(frozen=True, slots=True)
class Node:
    """An element and the place of its start tag."""

    element: Any
    document: Document

    @property
    def source(self) -> Source:
        """The file."""
        return self.document.source

    @property
    def log(self) -> DiagnosticLog:
        """Where findings go."""
        return self.document.log

    @property
    def tag(self) -> str:
        """Name of the element."""
        return str(self.element.tag)

    @property
    def attributes(self) -> dict[str, str]:
        """All attributes as text."""
        # lxml looks each value up among all: many attributes take quadratic time in `items()`.
        return {str(value.attrname): str(value) for value in self.element.xpath("@*")}

    @property
    def names(self) -> list[str]:
        """Names of all attributes."""
        return [str(name) for name in self.element.attrib]

    @property
    def span(self) -> Span:
        """Place of the tag's name."""
        start = self._place[0]
        return self.source.span(start, start + 1 + len(self.tag))

    def children(self, *tags: str) -> Iterator[Node]:
        """Iterate the child elements, of some tags (in any case) or all."""
        return self._nodes(self.element, tags)

    def descendants(self, *tags: str) -> Iterator[Node]:
        """Iterate all elements below with one of some tags (in any case)."""
        return self._nodes(self.element.iterdescendants(), tags)

    def only_child(self, tag: str, code: str) -> Node:
        """Return the one child of a tag, or fail where there are none or several."""
        found = list(self.children(tag))
        if len(found) != 1:
            at = found[1] if found else self
            at.fail(
                code, f"<{self.tag}> has {len(found)} <{tag}> elements; expected one",
                hint="remove the others" if found else f"add a <{tag}>",
            )  # fmt: skip
        return found[0]

    def get(self, name: str) -> str | None:
        """Return an attribute's text."""
        value = self.element.get(name)
        return None if value is None else str(value)

    def require(self, name: str) -> str:
        """Return an attribute's text, or fail."""
        value = self.get(name)
        if value is None:
            hint = did_you_mean(name, self.names) or f'write {name}="..."'
            self.fail("ENV141", f"<{self.tag}> has no attribute {name!r}, which is expected", hint=hint)
        return value

    def span_of(self, name: str) -> Span:
        """Place of an attribute's value."""
        place = self._value(name)
        return self.source.span(*place) if place else self.span

    def read(self, name: str, read: Callable[[Scanner], T]) -> T:
        """Read an attribute's whole text with a scanner that knows its place in the file."""
        text = self.require(name)
        source, (start, end) = self.source, self._value(name) or (self._place[0], self._place[0])
        # Behind references to characters, nothing stands where it does in the file.
        if "&" in source.text[start:end]:
            source = replace(Source.of(source.path, text, source.limits), place=source.span(start, end))
            start, end = 0, len(text)
        scanner = Scanner(source, self.log, start, end, part=f"value of {name}")
        value = read(scanner)
        if not scanner.at_end():
            scanner.fail("ENV143", f"{name} has more than was expected", hint="remove the rest")
        return value

    def number(self, name: str) -> float:
        """Read an attribute as one number."""
        return self.read(name, lambda scan: scan.number(name))

    def integer(self, name: str) -> int:
        """Read an attribute as an integer."""
        return self.read(name, lambda scan: scan.integer(name))

    def choice(self, name: str, choices: Mapping[str, T]) -> T:
        """Read an attribute as one of several words, in any case."""
        text = self.require(name).strip()
        folded = {k.lower(): v for k, v in choices.items()}
        if text.lower() not in folded:
            expected = " or ".join(repr(k) for k in choices)
            self.fail(
                "ENV142", f"unknown {name} {text!r}; expected {expected}",
                hint=did_you_mean(text[:60], choices) or f"write {expected}", at=name,
            )  # fmt: skip
        return folded[text.lower()]

    def fail(self, code: str, message: str, *, hint: str = "", at: str | None = None) -> NoReturn:
        """Raise a `FormatError` at the element or at one of its attributes."""
        span = self.span_of(at) if at else self.span
        self.log.fail(FormatError, code, f"<{self.tag}>", message, hint=hint, span=span)

    def ignore_other_children(self, *known: str) -> None:
        """Report the child elements that nothing reads."""
        folded = {k.lower() for k in known}
        for child in self.children():
            if child.tag.lower() not in folded:
                child.ignore(f"<{child.tag}> of <{self.tag}> is not used")

    def ignore_other_attributes(self, *known: str) -> None:
        """Report the attributes that nothing reads."""
        others = [name for name in self.names if name not in known]
        places = self._values() if others else {}
        for name in others:
            self.log.info(
                "ENV311", f"<{self.tag}>", f"attribute {name!r} of <{self.tag}> is not used",
                hint=did_you_mean(name, known), span=self.source.span(*places[name]) if name in places else self.span,
            )  # fmt: skip

    def ignore(self, message: str) -> None:
        """Report that nothing reads this element."""
        self.log.info("ENV307", f"<{self.tag}>", message, span=self.span)

    @property
    def _place(self) -> tuple[int, int]:
        return self.document.places.get(self.element, (0, 0))

    def _value(self, name: str) -> tuple[int, int] | None:
        return self._values().get(name)

    def _values(self) -> dict[str, tuple[int, int]]:
        """Return where the value of every attribute stands."""
        found = _ATTRIBUTE.finditer(self.source.text, *self._place)
        return {m.group(1): m.span(2) if m.group(2) is not None else m.span(3) for m in found}

    def _nodes(self, elements: Any, tags: tuple[str, ...]) -> Iterator[Node]:
        wanted = {t.lower() for t in tags}
        for element in elements:
            # Comments and processing instructions have no text for a tag.
            if isinstance(element.tag, str) and (not wanted or element.tag.lower() in wanted):
                yield Node(element, self.document)
