"""Writes a scene as a folder of MJCF and assets, whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Unpack

from .diagnostics import DiagnosticLog
from .errors import Diagnostic
from .mjcf.folder import Staged
from .mjcf.markup import is_mjcf
from .model.environment import Environment
from .options import OptionKeywords, Options, PathArgument
from .report import Report
from .simulation.loading import prepare
from .simulation.mujoco_model import load_file
from .simulation.scene import Scene
from .system.files import refuse_foreign
from .system.locks import FolderBusyError


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
    assets: tuple[Path, ...] = field(repr=False)
    environment: Environment
    diagnostics: tuple[Diagnostic, ...] = field(repr=False)
    report: Report = field(repr=False)


def convert(path: PathArgument, out: PathArgument, **options: Unpack[OptionKeywords]) -> Conversion:
    """Convert a scene to MJCF.

    Assets are written first, the MJCF file is checked by loading it, and renamed into place last: until then the
    folder holds the scene that it held before. Assets that only the previous scene used are then removed; so is, after
    an hour, what a killed process left there. Several processes may convert to one folder: the last one's scene stays.

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
    with _explaining_write_errors(folder, log):
        # Such as the XML environment that is being converted; any comments may stand above what tells what it is.
        hint = "choose another output folder, or name the file: out/scene.xml"
        refuse_foreign(folder / f"{name}.xml", "MJC423", "MJCF", is_mjcf, -1, hint)
        assets = _write(scene, folder, name, log)
    return Conversion(folder / f"{name}.xml", assets, scene.environment, scene.diagnostics, scene.report)


def _write(scene: Scene, folder: Path, name: str, log: DiagnosticLog) -> tuple[Path, ...]:
    document = scene.compiled.document
    staged = Staged(folder, name, document.xml.encode("utf-8"), document.assets)
    try:
        load_file(staged.path, document, scene.compiled.assembly, log)
        staged.commit()
    except BaseException:
        staged.discard()
        raise
    return staged.assets


@contextmanager
def _explaining_write_errors(folder: Path, log: DiagnosticLog) -> Generator[None]:
    try:
        yield
    except (FileExistsError, NotADirectoryError):
        log.fail("MJC421", str(folder), f"{folder} is, or lies under, a file; expected a folder to write to")
    except FolderBusyError as error:
        hint = "is one stopped in the middle of writing there? End it, or choose another output folder"
        log.fail("MJC424", str(folder), str(error), hint=hint)
    except PermissionError as error:
        hint = "choose another output folder, or change its permissions"
        log.fail("MJC420", str(folder), f"{error.filename or folder} may not be written", hint=hint)
    except OSError as error:
        hint = "choose another output folder, or make room"
        log.fail("MJC422", str(folder), f"{folder} cannot be written: {error.strerror or error}", hint=hint)
