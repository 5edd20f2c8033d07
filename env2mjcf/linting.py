"""Everything doubtful in scenes, robots and meshes, also after the first error."""

from __future__ import annotations

import dataclasses
import os
import re
import sys
import traceback
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from tqdm import tqdm

from .diagnostics import DiagnosticLog
from .errors import Diagnostic, Env2MjcfError, GeometryError, Severity, one_line
from .formats import xml_scene
from .formats.detect import is_robot_file, is_xml
from .formats.env import read_robot
from .formats.lexer import Scanner
from .formats.problem import PROBLEM_TAGS
from .formats.reading import read_scene
from .formats.source import read_source
from .formats.xml import parse_xml
from .geometry.mesh import READABLE, load_mesh
from .geometry.repair import repair_diagnostics, repaired
from .geometry.resolve import resolve_all
from .kinematics.forward import RobotKinematics
from .limits import Work, bounded
from .model.environment import Body, Environment, MultiBody, MultiBodyKind
from .options import Options, PathArgument
from .system.files import open_regular

# What is skipped is never tried in another way: comments could end at each of the marks behind their own.
_ROOT_TAG = re.compile(rb"(?>(?:<\?.*?\?>|<!--.*?-->|<!DOCTYPE[^>]*>|\s)*)<([A-Za-z_][\w:.\-]*)", re.DOTALL)
_SCENE_TAGS = ("environment", *PROBLEM_TAGS)
_MOST_SAID = 500
_OPTIONS = tuple(f.name for f in dataclasses.fields(Options))
_SNIFFED_BYTES = 1 << 16


class Kind(StrEnum):
    """What a file is taken for."""

    SCENE = "scene"
    ROBOT = "robot"
    MESH = "mesh"
    OTHER = "other"


@dataclass(frozen=True, slots=True)
class _Found:
    """A file to look at, and whether it lies, links resolved, in what was named."""

    path: str
    inside: bool


@dataclass(frozen=True, slots=True)
class LintResult:
    """What was found in one file and in the files that it names.

    Attributes:
        path: The file.
        kind: What it was taken for.
        diagnostics: The findings; each place is reported once, for the first file that leads to it.
    """

    path: str
    kind: Kind
    diagnostics: tuple[Diagnostic, ...]

    def count(self, severity: Severity) -> int:
        """Return the number of findings of one severity."""
        return sum(d.times for d in self.diagnostics if d.severity is severity)


def lint(
    paths: Iterable[PathArgument], options: Options | None = None, *, progress: bool = False
) -> tuple[LintResult, ...]:
    """Look for everything doubtful.

    Scenes are read, their meshes analysed, and loaded into MuJoCo to see what touches at home. After an error the
    other meshes of the scene, and the other files, are still looked at.

    Args:
        paths: Scenes, robot files, meshes, no pipes; folders are searched for `.env`, `.robot` and `.xml` files. Links
            in them that lead out of all of these, and of `mesh_dirs`, are not followed, unless `allow_outside`.
        options: How to read and load; `strict` is ignored, so that a warning does not end a file.
        progress: Show a progress bar on a terminal.

    Raises:
        ValueError: An option has a value that it cannot take.
    """
    chosen = dataclasses.replace(options or Options(), strict=False)
    files = _files(paths, chosen)
    results: list[LintResult] = []
    seen: set[Diagnostic] = set()
    bar = tqdm(files, unit="file", delay=1, leave=False, disable=not (progress and sys.stderr.isatty()))
    for file in bar:
        path, kind = file.path, _kind(file.path) if file.inside else Kind.OTHER
        found = dict.fromkeys(_lint_file(path, kind, chosen) if file.inside else [_leads_out(path)])
        # What has no place of its own belongs to the file; several scenes may well lack a robot.
        fresh = tuple(d for d in found if d.span is None or d not in seen)
        seen.update(fresh)
        results.append(LintResult(path, kind, fresh))
    return tuple(results)


def _files(paths: Iterable[PathArgument], options: Options) -> list[_Found]:
    """Return the files to look at, each once."""
    named = [os.fspath(path) for path in paths]
    roots = [Path(os.path.realpath(path)) for path in (*named, *options.mesh_dirs)]
    files: dict[str, _Found] = {}
    for path in named:
        for file in sorted(_search(path)) if os.path.isdir(path) else [path]:
            real = os.path.realpath(file)
            inside = options.allow_outside or any(Path(real).is_relative_to(root) for root in roots)
            if not os.path.isdir(path) or not inside or _kind(file) is not Kind.OTHER:
                files.setdefault(real, _Found(file, inside))
    return list(files.values())


def _search(folder: str) -> Iterator[str]:
    for where, folders, names in os.walk(folder):
        folders[:] = [f for f in folders if not f.startswith(".")]
        for name in names:
            if os.path.splitext(name)[1].lower() in (".env", ".robot", ".xml"):
                yield os.path.normpath(os.path.join(where, name))


def _leads_out(path: str) -> Diagnostic:
    message = f"{path} is a link that leads out of what is searched, and is not read"
    hint = "name its folder, too, or allow it with allow_outside=True (--allow-outside)"
    return Diagnostic("ENV152", Severity.ERROR, path, message, hint)


def _kind(path: str) -> Kind:
    extension = Path(path).suffix.lower()
    if extension in READABLE:
        return Kind.MESH
    if extension == ".robot":
        return Kind.ROBOT
    return _xml_kind(path) if extension == ".xml" else Kind.SCENE


def _xml_kind(path: str) -> Kind:
    try:
        with open_regular(path) as file:
            start = file.read(_SNIFFED_BYTES)
    except OSError:
        return Kind.SCENE  # its reader says what is wrong
    root = _ROOT_TAG.match(start.removeprefix(b"\xef\xbb\xbf"))
    tag = root.group(1).decode("ascii", "replace").lower() if root else ""
    if tag in _SCENE_TAGS:
        return Kind.SCENE
    # A URDF file has a <robot>, too.
    return Kind.ROBOT if tag == "robot" and b"<multibody" in start.lower() else Kind.OTHER


FAULT = "MJC407"
"""Code of the findings that are faults of env2mjcf or of the machine, and not of the file."""


def _fault(path: str, error: Exception) -> Diagnostic:
    """Return a finding of what must not happen, so that it hides none of the others."""
    if isinstance(error, MemoryError):
        return Diagnostic(FAULT, Severity.ERROR, path, f"there is not enough memory to look at {path}")
    said = one_line(" ".join(traceback.format_exception_only(error)))
    where = traceback.extract_tb(error.__traceback__)[-1]
    message = f"{path} could not be looked at: {said[:_MOST_SAID]} ({Path(where.filename).name}:{where.lineno})"
    return Diagnostic(FAULT, Severity.ERROR, path, message, "a fault of env2mjcf: please report it with the file")


def _lint_file(path: str, kind: Kind, options: Options) -> Sequence[Diagnostic]:
    log = DiagnosticLog()
    try:
        if kind is Kind.SCENE:
            return _lint_scene(path, options, log)
        if kind is Kind.ROBOT:
            _lint_robot(path, options, log)
        elif kind is Kind.MESH:
            _lint_mesh(Path(path), options, log)
        else:
            log.info("ENV132", path, f"{path} is XML, but neither a scene nor a robot; skipped")
    except Env2MjcfError as error:
        return error.diagnostics
    except Exception as error:  # the other files, and what was found in this one, are worth telling
        # Errors about an option begin with its name; it is as wrong for the other files.
        if type(error) is ValueError and str(error).startswith(_OPTIONS):
            raise
        return *log, _fault(path, error)
    return tuple(log)


def _lint_scene(path: str, options: Options, log: DiagnosticLog) -> Sequence[Diagnostic]:
    # Imported here because MuJoCo is slow to import, and robots and meshes do not need it.
    from .simulation.loading import prepare

    try:
        if is_robot_file(read_source(path, DiagnosticLog(), options.limits, regular=True)):
            _lint_robot(path, options, log)
            return tuple(log)
        environment = read_scene(path, options, log)
    except Env2MjcfError as error:
        return error.diagnostics
    try:
        return prepare(environment, options, log).diagnostics
    except GeometryError as error:
        # The first bad mesh ends the loading, so that each has to be looked at alone.
        return [*error.diagnostics[:-1], *_lint_meshes(environment, options, error)]
    except Env2MjcfError as error:
        return error.diagnostics


def _lint_meshes(environment: Environment, options: Options, error: GeometryError) -> list[Diagnostic]:
    bodies = {b.filename: b for m in environment.multibodies for b in m.bodies}
    found: list[Diagnostic] = []
    for body in bodies.values():
        log = DiagnosticLog()
        try:
            _lint_mesh(_resolved(environment, body, options, log), options, log, body)
        except Env2MjcfError as wrong:
            found += wrong.diagnostics
        except Exception as wrong:
            found += (*log, _fault(body.filename, wrong))
        else:
            found += log
    if any(d.severity is Severity.ERROR for d in found):
        return found
    return [*found, error.diagnostic]


def _resolved(environment: Environment, body: Body, options: Options, log: DiagnosticLog) -> Path:
    alone = dataclasses.replace(environment, multibodies=(MultiBody(MultiBodyKind.PASSIVE, (body,)),))
    return resolve_all(alone, options, log)[body.filename]


def _lint_robot(path: str, options: Options, log: DiagnosticLog) -> None:
    source = read_source(path, log, options.limits, regular=True)
    robot = xml_scene.read_robot(parse_xml(source, log)) if is_xml(source) else read_robot(Scanner(source, log))
    RobotKinematics.of(robot, log).home(log)


def _lint_mesh(path: Path, options: Options, log: DiagnosticLog, body: Body | None = None) -> None:
    mesh = load_mesh(path, log, options.limits)
    subject, span = (body.filename, body.span) if body else (str(path), None)
    with bounded(options.limits, log, subject, span):
        result = repaired(mesh, Work(options.limits.mesh_work))
    repair_diagnostics(mesh, result, log, subject=subject, span=span)
