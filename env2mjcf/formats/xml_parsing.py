"""XML, read without entities, network or huge trees."""

from __future__ import annotations

import re
from typing import Any, NoReturn

from lxml import etree

from ..errors import Diagnostic, DiagnosticLog, FormatError, Severity
from ..options import Limits
from .source import Source
from .xml import Document, Node

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
_PROBLEM_ROOT = re.compile(r"<(motion_?planning)\b", re.IGNORECASE)
_PROBLEM_END = re.compile(r"</(?:MP)?Problem\s*>", re.IGNORECASE)


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
        log.fail(
            FormatError, "ENV144", source.path, "XML entity declarations are not read; expected plain XML",
            hint="write the text itself where an entity stands", span=source.span(*found.span()),
        )  # fmt: skip
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
    log.warn(
        FormatError, "ENV214", source.path, f"{fault.message}; only the problem above it is read",
        hint="the planner's library section is not needed, but its collision rules are unknown now", span=fault.span,
    )  # fmt: skip
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
    log.fail(FormatError, fault.code, fault.subject, fault.message, hint=fault.hint, span=fault.span)


def _from_text(source: Source, text: str, log: DiagnosticLog) -> Any:
    """Parse text part by part, so that a hostile one is refused before it is a tree.

    Raises:
        FormatError: Too many elements, or too many within each other.
        etree.XMLSyntaxError: The text is not well-formed.
    """
    # The declared encoding is dropped: the text is decoded already, and lxml would decode it once more.
    data = _ENCODING.sub(r"\1", text).encode("utf-8")
    parser: Any = etree.XMLPullParser(
        ("start", "end"), resolve_entities=False, no_network=True, load_dtd=False,
        huge_tree=source.limits.nesting > _LXML_NESTING,
    )  # fmt: skip
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
    most = getattr(source.limits, what)
    found = f"more than {most} elements lie within each other" if what == "nesting" else f"more than {most} elements"
    log.fail(
        FormatError, "ENV180", source.path, f"{found}; at most so many are read", hint=Limits.hint(what),
        span=source.line_span(line),
    )  # fmt: skip


def _problem_alone(source: Source, fault_line: int) -> tuple[str, int] | None:
    """Return how to cut a problem file behind its `<Problem>`: what closes it, and where.

    None where the fault lies in the problem itself. Published problem files have ill-formed library sections, which
    the planner's own parser took.
    """
    opening, closing = _PROBLEM_ROOT.search(source.text), _PROBLEM_END.search(source.text)
    if not opening or not closing or source.span(closing.end()).line >= fault_line:
        return None
    return f"</{opening.group(1)}>", closing.end()
