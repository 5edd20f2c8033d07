"""Loads compiled scenes into MuJoCo, and tells its errors in the words of the env file."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import mujoco

from ..diagnostics import DiagnosticLog
from ..errors import Span
from ..geometry.assembly import Assembly
from ..mjcf.compiler import Document

_NO_MEMORY = ("Could not allocate memory", "out of memory")
_QUOTED = re.compile(r"'([^']+)'")
_LINE = re.compile(r"\bline (\d+)")
_NAME = re.compile(r'\b(?:name|mesh|body1|geom1|joint)="([^"]+)"')


def load_model(document: Document, assembly: Assembly, log: DiagnosticLog) -> mujoco.MjModel:
    """Compile a document in memory.

    Raises:
        ConversionError: MuJoCo refuses it; the error has the line of the env file that the refusal comes from.
    """
    return _compiled(lambda: load_spec(document), document, assembly, log)


def load_spec(document: Document) -> mujoco.MjSpec:
    """Parse a document into a spec that holds its assets, ready to be attached to another one."""
    with mujoco.MjVfs() as vfs:
        vfs["model.xml"] = document.xml.encode("utf-8")
        for name, data in document.assets.items():
            vfs[name] = data
        spec = mujoco.MjSpec.from_file("model.xml", vfs=vfs)
    # Paths of assets are relative to the folder of the model; the dictionary stays with the spec.
    spec.assets = {Path(n).name: d for n, d in document.assets.items() if not n.endswith(".xml")}
    return spec


def load_file(path: Path, document: Document, assembly: Assembly, log: DiagnosticLog) -> mujoco.MjModel:
    """Load a written MJCF file, as a user does.

    Raises:
        ConversionError: MuJoCo refuses it.
    """
    # Loading it without a spec, MuJoCo writes its warnings to a file in the current folder. Bytes, because it takes no
    # text that is not UTF-8.
    name: Any = os.fsencode(path)
    return _compiled(lambda: mujoco.MjSpec.from_file(name), document, assembly, log)


def _compiled(
    spec: Callable[[], mujoco.MjSpec], document: Document, assembly: Assembly, log: DiagnosticLog
) -> mujoco.MjModel:
    try:
        return spec().compile()
    except UserWarning as warning:
        said = " ".join(str(warning).split())
        hint = "correct the scene, or do not have warnings raised (python -W error, PYTHONWARNINGS)"
        log.fail("MJC402", document.name, f"MuJoCo {mujoco.__version__} warns: {said}", hint=hint)
    except ValueError as error:
        said = " ".join(str(error).split())
        if any(words in said for words in _NO_MEMORY):
            message = f"MuJoCo {mujoco.__version__} finds no room for {document.name}: {said}"
            log.fail("MJC404", document.name, message, hint="close other programs, or make the scene smaller")
        _refuse(said, document, assembly, log)


def _refuse(message: str, document: Document, assembly: Assembly, log: DiagnosticLog) -> NoReturn:
    """Raise MuJoCo's refusal as a `ConversionError` about the body that it concerns."""
    subject, span = _culprit(message, document, assembly)
    message = f"MuJoCo {mujoco.__version__} refuses {subject or 'the scene'}: {message}"
    hint = "" if span else "this may be a fault of env2mjcf: please report it with the scene"
    log.fail("MJC401", subject or document.name, message, hint=hint, span=span)


def _culprit(message: str, document: Document, assembly: Assembly) -> tuple[str, Span | None]:
    """Find the body that a message is about: by a name it quotes, else by the line of the MJCF that it gives."""
    spans: dict[str, Span | None] = {p.name: p.body.span for p in assembly.parts()}
    by_mesh = {p.mesh.name: p.body.span for p in assembly.parts()}
    candidates = _QUOTED.findall(message)
    line = _LINE.search(message)
    if line and int(line.group(1)) <= document.xml.count("\n"):
        candidates += _NAME.findall(document.xml.splitlines()[int(line.group(1)) - 1])
    for candidate in candidates:
        for name in (candidate, candidate.rpartition(":")[0], candidate.rpartition(".")[0]):
            if name in spans:
                return name, spans[name]
            if name in by_mesh:
                return name, by_mesh[name]
    return "", None
