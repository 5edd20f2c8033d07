"""Files of a translation, and what they do not replace."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import NoReturn

from ..errors import ConversionError, DiagnosticLog, Env2MjcfError
from ..formats.detect import detect
from ..formats.lexer import Scanner
from ..formats.robot import read_robot
from ..formats.rows import number_lines
from ..formats.source import Source, read_source
from ..options import Limits


class Kind(StrEnum):
    """What a file of a translation is."""

    ENVIRONMENT = "env file"
    ROBOT = "robot file"
    QUERY = "query"


@dataclass(frozen=True, slots=True)
class Output:
    """A file to be written."""

    path: Path
    kind: Kind
    text: str


_READERS: dict[Kind, Callable[[Source, DiagnosticLog], object]] = {
    Kind.ENVIRONMENT: detect,
    Kind.ROBOT: lambda source, log: read_robot(Scanner(source, log)),
    Kind.QUERY: number_lines,
}


def refuse_no_translation(environment: Output, companions: Sequence[Output]) -> None:
    """Refuse to replace what is no older translation.

    The env file has been named, and may be replaced if it begins as one. Its companions have not: they must read as
    what they are without a warning, beside an older env file. What is empty, or says the same, may always be replaced.

    Raises:
        ConversionError: Something else stands where a file would be written.
    """
    for output in (environment, *companions):
        if not output.path.exists():
            continue
        old = _read(output.path)
        if old is not None and old.text.strip() in ("", output.text.strip()):
            continue
        if old is None or not _reads_as(output.kind, old):
            _refuse(output, f"is no {output.kind}")
        if not environment.path.exists():
            _refuse(output, f"is there without {environment.path}")


def _read(path: Path) -> Source | None:
    try:
        return read_source(path, DiagnosticLog(), Limits())
    except Env2MjcfError:
        return None


def _reads_as(kind: Kind, source: Source) -> bool:
    try:
        return bool(_READERS[kind](source, DiagnosticLog(strict=True)))
    except Env2MjcfError:
        return False


def _refuse(output: Output, why: str) -> NoReturn:
    DiagnosticLog().fail(
        ConversionError, "ENV190", str(output.path), f"{output.path} {why}, and is not replaced",
        hint="name another output, or remove the file",
    )  # fmt: skip
