"""Writes a scene as a folder of MJCF and assets, whole or not at all."""

from __future__ import annotations

import os
import re
import secrets
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .errors import ConversionError, Diagnostic, DiagnosticLog
from .model import Environment
from .options import Options, PathArgument
from .report import Report
from .simulation.loading import load_file
from .simulation.preparing import prepare
from .simulation.scene import Scene
from .writing import replaced

_ASSET = re.compile(r'\bfile="(?:assets/)?([^"/\\]+-[0-9a-f]{12}\.(?:stl|obj|xml))"')


@dataclass(frozen=True, slots=True)
class Conversion:
    """What `convert` wrote.

    Attributes:
        xml: The MJCF file.
        assets: The files that it refers to.
        environment: The scene in the words of its files.
        diagnostics: What all stages found.
        report: The scene in numbers.
    """

    xml: Path
    assets: tuple[Path, ...]
    environment: Environment
    diagnostics: tuple[Diagnostic, ...]
    report: Report


def convert(path: PathArgument, out: PathArgument, **options: Any) -> Conversion:
    """Convert a scene to MJCF.

    Assets are written first, the MJCF file is checked by loading it, and renamed into place last: until then the
    folder holds the scene that it held before. Assets that only the previous scene used are then removed.

    Args:
        path: An env file of any dialect, an XML environment, or the planner's problem XML.
        out: The folder to write to, which is made if need be; or a `.xml` file in one.
        **options: Fields of `Options`.

    Raises:
        ConversionError: The folder cannot be written, or MuJoCo refuses the scene.
        FormatError, GeometryError, KinematicsError: The input cannot be used.
        TypeError, ValueError: An option cannot.
    """
    chosen = Options.from_keywords(options)
    log = DiagnosticLog(chosen.strict)
    scene = prepare(path, chosen, log)
    target = Path(os.fspath(out))
    if target.suffix == ".xml":
        folder, name = target.parent, target.stem
    else:
        folder, name = target, scene.compiled.document.name
    with _clear_write_errors(folder, log):
        _refuse_foreign(folder / f"{name}.xml", log)
        assets = _write(scene, folder, name, log)
    return Conversion(folder / f"{name}.xml", assets, scene.environment, scene.diagnostics, scene.report)


def _refuse_foreign(final: Path, log: DiagnosticLog) -> None:
    """Refuse to replace a file that is no MJCF, such as the XML environment that is being converted."""
    if not final.is_file():
        return
    text = re.sub(r"<\?.*?\?>|<!--.*?-->", "", final.read_text(encoding="utf-8", errors="replace"), flags=re.DOTALL)
    if not text.lstrip().startswith("<mujoco"):
        log.fail(
            ConversionError, "MJC423", str(final), f"{final} is no MJCF, and is not replaced",
            hint="choose another output folder, or name the file: out/scene.xml",
        )  # fmt: skip


def _write(scene: Scene, folder: Path, name: str, log: DiagnosticLog) -> tuple[Path, ...]:
    document = scene.compiled.document
    final = folder / f"{name}.xml"
    (folder / "assets").mkdir(parents=True, exist_ok=True)
    before = _named_assets(final)
    staged = folder / f".{name}-{secrets.token_hex(8)}.xml"
    made: list[Path] = []
    try:
        for relative, data in document.assets.items():
            path = folder / relative
            # The name holds the hash of the content: what is there and whole is right.
            if not path.exists() or path.stat().st_size != len(data):
                with replaced(path) as beside:
                    beside.write_bytes(data)
                made.append(path)
        staged.write_bytes(document.xml.encode("utf-8"))
        load_file(staged, document, scene.compiled.assembly, log)
        os.replace(staged, final)
    except BaseException:
        staged.unlink(missing_ok=True)
        _remove(folder, {p.name for p in made})
        raise
    written = tuple(folder / relative for relative in document.assets)
    _remove(folder, before - {p.name for p in written})
    return written


def _remove(folder: Path, names: set[str]) -> None:
    """Remove assets that no scene of the folder names."""
    for scene in folder.glob("*.xml"):
        names = names - _named_assets(scene)
    for name in names:
        (folder / "assets" / name).unlink(missing_ok=True)


def _named_assets(xml: Path) -> set[str]:
    """Return the asset files that an earlier conversion's MJCF names."""
    try:
        return set(_ASSET.findall(xml.read_text(encoding="utf-8", errors="replace")))
    except FileNotFoundError:
        return set()


@contextmanager
def _clear_write_errors(folder: Path, log: DiagnosticLog) -> Generator[None]:
    try:
        yield
    except (FileExistsError, NotADirectoryError):
        log.fail(
            ConversionError,
            "MJC421",
            str(folder),
            f"{folder} is, or lies under, a file; expected a folder to write to",
        )
    except PermissionError as error:
        log.fail(
            ConversionError, "MJC420", str(folder), f"{error.filename or folder} may not be written",
            hint="choose another output folder, or change its permissions",
        )  # fmt: skip
    except OSError as error:
        log.fail(ConversionError, "MJC422", str(folder), f"{folder} cannot be written: {error.strerror or error}")
