"""XML, read without entities, network or huge trees, into nodes that know the place of every attribute."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NoReturn, TypeVar

from lxml import etree

from ..diagnostics import DiagnosticLog
from ..errors import Diagnostic, Severity, Span, did_you_mean, enumeration
from ..limits import Limits
from .lexer import Scanner
from .source import Source

T = TypeVar("T")

_ATTRIBUTE = re.compile(r"(?<=\s)([^\s\"'=<>/]+)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
# What stands in front of the root, where quotes may hold anything. What is not closed reaches to the end.
_PROLOG = re.compile(
    r"<!--.*?(?:-->|\Z)|<\?.*?(?:\?>|\Z)|\"[^\"]*\"?|'[^']*'?|(?P<entity><!ENTITY)|(?P<root><[^!?])", re.DOTALL
)
# lxml keeps only the line where a start tag ends; the n-th start tag from the root on is the n-th element.
_MARKUP = re.compile(
    r"<!--.*?-->|<\?.*?\?>|<!\[CDATA\[.*?\]\]>|<(?P<tag>[^\s/>!?\"'=]+)(?:[^\"'<>]|\"[^\"]*\"|'[^']*')*>", re.DOTALL
)
# What names an entity other than the five of XML itself, in the root.
_REFERENCE = re.compile(
    r"<!--.*?(?:-->|\Z)|<\?.*?(?:\?>|\Z)|<!\[CDATA\[.*?(?:\]\]>|\Z)"
    r"|(?P<entity>&(?!(?:amp|lt|gt|quot|apos);)[^\s;&<>\"'#]+;)",
    re.DOTALL,
)
_ENCODING = re.compile(r"^(<\?xml[^>]*?\s)encoding\s*=\s*(?:\"[^\"]*\"|'[^']*')")
# Bytes that are parsed at once; nesting beyond which lxml refuses all but huge trees.
_PART, _LXML_NESTING = 1 << 14, 250
# How the versions of lxml call what is longer than they take.
_TOO_LONG = re.compile("too (?:big|long)|XML_PARSE_HUGE|huge text node|Huge input lookup")
# What collision checkers say about pairs, in lower case.
_PAIR_RULES = re.compile("ignore_?(self_?collision|(i_?)?adjacent_?links|sibling_?collisions)|inter_?robot_?collision")
_PROBLEM_ROOT = re.compile(r"<(motion_?planning)\b", re.IGNORECASE)
_PROBLEM_END = re.compile(r"</(?:MP)?Problem\s*>", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Document:
    """What the nodes of one document share.

    Attributes:
        source: The file.
        log: Where findings go.
        places: Where the start tag of every element lies in the text.
        told: Elements and attributes that were reported as not used, by their names and that of what they stand in.
    """

    source: Source
    log: DiagnosticLog
    places: Mapping[Any, tuple[int, int]]
    told: set[tuple[str, str]] = field(default_factory=set)


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
            hint = "remove the others" if found else f"add a <{tag}>"
            at.fail(code, f"<{self.tag}> has {len(found)} <{tag}> elements; expected one", hint=hint)
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
        place = self._values().get(name)
        return self.source.span(*place) if place else self.span

    def read(self, name: str, read: Callable[[Scanner], T]) -> T:
        """Read an attribute's whole text with a scanner that knows its place in the file."""
        text = self.require(name)
        source, (start, end) = self.source, self._values().get(name, (self._place[0], self._place[0]))
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
            hint = did_you_mean(text[:60], choices) or f"write {expected}"
            self.fail("ENV142", f"unknown {name} {text!r}; expected {expected}", hint=hint, at=name)
        return folded[text.lower()]

    def fail(self, code: str, message: str, *, hint: str = "", at: str | None = None) -> NoReturn:
        """Raise a `FormatError` at the element or at one of its attributes."""
        span = self.span_of(at) if at else self.span
        self.log.fail(code, f"<{self.tag}>", message, hint=hint, span=span)

    def ignore_other_children(self, *known: str) -> None:
        """Report the child elements that nothing reads, one of each kind in a file, all in one diagnostic."""
        folded, children = {k.lower() for k in known}, self.children()
        others = {f"<{c.tag}>": c for c in children if c.tag.lower() not in folded and self._first(f"<{c.tag}>")}
        if others:
            first, one = next(iter(others.values())), len(others) == 1
            message = f"{enumeration(list(others))} of <{self.tag}> {'is' if one else 'are'} not used"
            hint = did_you_mean(first.tag, known) if one else ""
            self.log.info("ENV307", f"<{first.tag}>", message, hint=hint, span=first.span)

    def ignore_other_attributes(self, *known: str) -> None:
        """Report the attributes that nothing reads, once for each name and kind of element in a file."""
        others = [name for name in self.names if name not in known and self._first(name)]
        places = self._values() if others else {}
        for name in others:
            span = self.source.span(*places[name]) if name in places else self.span
            message = f"attribute {name!r} of <{self.tag}> is not used"
            hint = did_you_mean(name, known) if self.log.keeps("ENV311", Severity.INFO) else ""
            if not _PAIR_RULES.fullmatch(name.lower()):
                self.log.info("ENV311", f"<{self.tag}>", message, hint=hint, span=span)
                continue
            if self.tag.lower() != "collisiondetection":
                hint = "write it there, or give the option: self_collision, adjacent_links or inter_robot"
                message += ": it counts on <CollisionDetection>"
            self.log.warn("ENV185", f"<{self.tag}>", message, hint=hint, span=span)

    def _first(self, name: str) -> bool:
        """Whether something of this name in elements of this kind was not told before."""
        told, kind = self.document.told, (self.tag, name)
        return kind not in told and not told.add(kind)

    def ignore(self, message: str) -> None:
        """Report that nothing reads this element."""
        self.log.info("ENV307", f"<{self.tag}>", message, span=self.span)

    @property
    def _place(self) -> tuple[int, int]:
        return self.document.places.get(self.element, (0, 0))

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


def parse_xml(source: Source, log: DiagnosticLog) -> Node:
    """Parse XML text into nodes that know their places.

    Raises:
        FormatError: The text is not well-formed, or declares or names entities.
    """
    begin = _root_of(source, log)
    root, end = _parse(source, _first(_REFERENCE, source.text, begin), log)
    tags = (m.span() for m in _MARKUP.finditer(source.text, begin, end) if m.group("tag"))
    # lxml elements are proxies: they are equal while one is alive, so the map holds them as keys.
    places = dict(zip((e for e in root.iter() if isinstance(e.tag, str)), tags, strict=False))
    return Node(root, Document(source, log, places))


def _root_of(source: Source, log: DiagnosticLog) -> int:
    """Return where the root begins; a text that declares entities in front of it is refused before it is parsed."""
    found = _first(_PROLOG, source.text)
    if found is None:
        return len(source.text)
    if found.lastgroup == "entity":
        message = "XML entity declarations are not read; expected plain XML"
        hint = "write the text itself where an entity stands"
        log.fail("ENV144", source.path, message, hint=hint, span=source.span(*found.span()))
    return found.start()


def _first(pattern: re.Pattern[str], text: str, start: int = 0) -> re.Match[str] | None:
    """Return the first match that is in one of the pattern's groups; what is in none is skipped."""
    return next((m for m in pattern.finditer(text, start) if m.lastgroup), None)


def _parse(source: Source, entity: re.Match[str] | None, log: DiagnosticLog) -> tuple[Any, int]:
    """Return the root and where the text that was read ends; `entity` is the first that the text names."""
    begin = len(source.text) - len(source.text.lstrip())
    try:
        root = _from_text(source, source.text[begin:], log)
        # Behind a DOCTYPE, lxml takes an entity that is not declared for no text at all.
        fault = None if entity is None else _named(source, entity)
    except etree.XMLSyntaxError as error:
        root, fault = None, _fault(source, begin, error, entity)
    if fault is None:
        return root, len(source.text)
    assert fault.span is not None
    cut = _problem_alone(source, fault.span.line)
    if cut is None:
        _fail(fault, log)
    hint = "the planner's library section is not needed, but its collision rules are unknown now"
    log.warn("ENV214", source.path, f"{fault.message}; only the problem above it is read", hint=hint, span=fault.span)
    closing, end = cut
    try:
        return _from_text(source, source.text[begin:end] + closing, log), end
    except etree.XMLSyntaxError:
        _fail(fault, log)


def _fault(source: Source, begin: int, error: etree.XMLSyntaxError, entity: re.Match[str] | None) -> Diagnostic:
    """Return what is wrong with a text that lxml, given it from `begin` on, refuses."""
    line, column = error.position
    place = source.line_span(line + source.span(begin).line - 1)
    span = source.column_span(place.line, column)
    # lxml goes on behind an entity that is not declared, and raises something else, in the end without a place.
    if entity and (not line or source.span(entity.start()).line <= place.line):
        return _named(source, entity)
    message, hint = f"not well-formed XML: {str(error.msg).rstrip()}", "is the file cut off, or a tag not closed?"
    if not _TOO_LONG.search(message):
        return Diagnostic("ENV140", Severity.ERROR, source.path, message, hint, span)
    message = "a text of more than ten million characters, or a name of more than fifty thousand, is not read"
    hint = "what is read in it are names and numbers"
    return Diagnostic("ENV181", Severity.ERROR, source.path, message, hint, span)


def _named(source: Source, entity: re.Match[str]) -> Diagnostic:
    message = f"the XML entity {entity[0][:60]!r} is not read; expected plain XML"
    hint = "write the text itself where the entity stands"
    return Diagnostic("ENV144", Severity.ERROR, source.path, message, hint, source.span(*entity.span()))


def _fail(fault: Diagnostic, log: DiagnosticLog) -> NoReturn:
    log.fail(fault.code, fault.subject, fault.message, hint=fault.hint, span=fault.span)


def _from_text(source: Source, text: str, log: DiagnosticLog) -> Any:
    """Parse text part by part, so that a hostile one is refused before it is a tree.

    Raises:
        FormatError: Too many elements, or too many within each other.
        etree.XMLSyntaxError: The text is not well-formed.
    """
    # The declared encoding is dropped: the text is decoded already, and lxml would decode it once more.
    data = _ENCODING.sub(r"\1", text).encode("utf-8")
    huge = source.limits.nesting > _LXML_NESTING
    parser: Any = etree.XMLPullParser(
        ("start", "end"), resolve_entities=False, no_network=True, load_dtd=False, huge_tree=huge
    )
    depth = count = 0
    for at in range(0, max(1, len(data)), _PART):
        try:
            parser.feed(data[at : at + _PART])
        finally:
            for event, element in parser.read_events():
                depth += 1 if event == "start" else -1
                count += event == "start"
                for what, found in (("nesting", depth), ("elements", count)):
                    if found > getattr(source.limits, what):
                        _refuse(source, element.sourceline, what, log)
    return parser.close()


def _refuse(source: Source, line: int, what: str, log: DiagnosticLog) -> NoReturn:
    within = " lie within each other" if what == "nesting" else ""
    message = f"more than {getattr(source.limits, what)} elements{within}; no more are read"
    log.fail("ENV180", source.path, message, hint=Limits.hint(what), span=source.line_span(line))


def _problem_alone(source: Source, fault_line: int) -> tuple[str, int] | None:
    """Return how to cut a problem file behind its `<Problem>`: what closes it, and where.

    None where the fault lies in the problem itself. Published problem files have ill-formed library sections, which
    the planner's own parser took.
    """
    opening, closing = _PROBLEM_ROOT.search(source.text), _PROBLEM_END.search(source.text)
    if not opening or not closing or source.span(closing.end()).line >= fault_line:
        return None
    return f"</{opening.group(1)}>", closing.end()
