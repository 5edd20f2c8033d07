"""Results, diagnostics and JSON on a terminal or in a pipe, so that no file can play tricks on a terminal.

rich is imported where it is used: the program's help does without.
"""

from __future__ import annotations

import dataclasses
import io
import json
import logging
import math
import re
import sys
import warnings
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from ..diagnostics import DiagnosticLog, few
from ..errors import Diagnostic, Severity, abridged, is_tricky, one_line, printable

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.text import Text

    from ..options import Options
    from ..simulation.scene import Scene

# Reasons of one configuration that are listed.
_REASONS = 8
_COLOURS = {Severity.ERROR: "bold red", Severity.WARNING: "bold yellow", Severity.INFO: "bold cyan"}


def format_diagnostic(diagnostic: Diagnostic) -> str:
    """Return a diagnostic as it is printed, with its source line and caret."""
    span = diagnostic.span
    if span is not None:
        # One character stands for one, so that the caret stays under its column.
        text = "".join("\ufffd" if c != "\t" and is_tricky(c) else c for c in span.text)
        span = dataclasses.replace(span, path=one_line(span.path), text=text)
    safe = dataclasses.replace(
        diagnostic, message=printable(diagnostic.message), hint=printable(diagnostic.hint), span=span
    )
    return str(safe)


class _Printable(logging.Formatter):
    """What libraries log, abridged, with control characters escaped."""

    def format(self, record: logging.LogRecord) -> str:
        return printable(abridged(super().format(record)))


def tame_libraries() -> None:
    """Let what libraries log, and Python's warnings, come out as everything else does; they may quote files."""
    handler = logging.StreamHandler()
    handler.setFormatter(_Printable("%(message)s"))
    logging.basicConfig(handlers=[handler], level=logging.WARNING)
    logging.captureWarnings(True)
    warnings.formatwarning = _without_place


def _without_place(message: Warning | str, category: type[Warning], *_: object) -> str:
    """Say what a warning says, not which line of whose code says it."""
    return f"{category.__name__}: {message}"


def remark(message: str) -> None:
    """Print a line about the work, not its results, to stderr."""
    print(f"env2mjcf: {one_line(abridged(message))}", file=sys.stderr)


def reason_lines(reasons: Sequence[object], every: bool) -> Iterator[Text]:
    """Yield why a configuration is not valid: the first reasons, or every one."""
    from rich.text import Text

    shown = reasons if every else reasons[:_REASONS]
    for reason in shown:
        yield Text(f"    {one_line(abridged(str(reason)))}")
    if len(shown) < len(reasons):
        yield Text(f"    ... and {len(reasons) - len(shown)} more", "dim")


def print_parts(parts: Iterable[RenderableType]) -> None:
    """Print results: in colour and as wide as the terminal, or plain, never folded and without trailing blanks."""
    on_terminal = sys.stdout.isatty()
    text = io.StringIO()
    console = console_on(sys.stdout) if on_terminal else console_on(text, width=10_000, color_system=None)
    for part in parts:
        console.print(part)
    if not on_terminal:
        print("\n".join(line.rstrip() for line in text.getvalue().splitlines()))


def console_on(file: IO[str], **options: Any) -> Console:
    """Return a console of rich that prints text as it is."""
    from rich.console import Console

    return Console(file=file, highlight=False, markup=False, emoji=False, **options)


@contextmanager
def working(what: str) -> Generator[None]:
    """Say on a terminal that something is being done, for as long as it takes."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.text import Text

    with console_on(sys.stderr).status(Text(one_line(what), "dim")):
        yield


def loaded(path: str, options: Options) -> tuple[Scene, DiagnosticLog]:
    """Load a scene, and say so on a terminal; return a log with its findings, too."""
    from ..simulation.loading import prepare

    log = DiagnosticLog(options.strict)
    with working(f"loading {path}"):
        return prepare(path, options, log), log


def listed(diagnostics: Iterable[Diagnostic], verbose: bool) -> tuple[Diagnostic, ...]:
    """Return the diagnostics to show: a few of each code, or all that are kept."""
    return tuple(diagnostics) if verbose else few(diagnostics)


def print_diagnostics(diagnostics: Iterable[Diagnostic], verbose: bool = False, *, notes: bool = False) -> None:
    """Print a few diagnostics of each code to stderr, all on request; notes only where they are asked for."""
    sys.stdout.flush()  # so that results stand before what is said about them
    console = console_on(sys.stderr, soft_wrap=True)
    chosen = (d for d in diagnostics if verbose or notes or d.severity is not Severity.INFO)
    for diagnostic in listed(chosen, verbose):
        print_diagnostic(console, diagnostic)


def print_diagnostic(console: Console, diagnostic: Diagnostic, path: str = "") -> None:
    """Print one diagnostic, in colour where the console has colours.

    Args:
        console: Where to.
        diagnostic: What to print.
        path: The file to name where the diagnostic has no place of its own.
    """
    from rich.text import Text

    place = f"{one_line(path)}: " if path and diagnostic.span is None else ""
    text = Text(place + format_diagnostic(diagnostic))
    colour = _COLOURS[diagnostic.severity]
    text.highlight_regex(rf"(?<![^ ]){diagnostic.severity} {re.escape(diagnostic.code)}:", colour)
    text.highlight_regex(r"(?m)^[ \t]+\^+$", colour)
    text.highlight_regex(r"(?m)^    hint:", "dim")
    console.print(text, soft_wrap=True)


def print_json(value: Any) -> None:
    """Print a value to stdout as one JSON object."""
    print(json.dumps(plain(value), indent=2, ensure_ascii=True, allow_nan=False))


def plain(value: Any) -> Any:
    """Return a value in terms of JSON; what is not finite, which JSON lacks, becomes null."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if (tolist := getattr(value, "tolist", None)) is not None:  # an array or a number of numpy
        return plain(tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, tuple | list):
        return [plain(v) for v in value]
    return str(value) if isinstance(value, Path) else value
