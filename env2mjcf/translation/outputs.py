"""Environments on the disk: the env file, robots and a query beside it, meshes named as they are found from there."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

from ..diagnostics import DiagnosticLog
from ..errors import Diagnostic, Env2MjcfError
from ..formats.detect import detect
from ..formats.env import read_robot
from ..formats.lexer import Scanner
from ..formats.reading import robot_dofs
from ..formats.rows import number_lines, query_text, tasks_alone
from ..formats.source import Source, read_source
from ..formats.writers import env_text, robot_text
from ..geometry.resolve import find_all
from ..limits import Limits
from ..model.dialects import begins_with_robot
from ..model.environment import Environment, MultiBody
from ..options import Options, PathArgument
from ..system.files import made_folder, refuse_replacement, refuse_unwritable, write_together


class Kind(StrEnum):
    """What a file of a translation is."""

    ENVIRONMENT = "an env file"
    ROBOT = "a robot file"
    QUERY = "a query"


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


def refuse_foreign_outputs(environment: Output, companions: Sequence[Output]) -> None:
    """Refuse to replace what is not an older translation.

    The caller has named the env file, which may be replaced if it begins as one. Its companions were not named: they
    must read as what they are without a warning, beside an older env file. What is empty, or says the same, may always
    be replaced.

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
            refuse_replacement(output.path, "ENV190", f"is not {output.kind}")
        if not environment.path.exists():
            refuse_replacement(output.path, "ENV190", f"is there without {environment.path}")


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


@dataclass(frozen=True, slots=True)
class Written:
    """The files of an environment.

    Attributes:
        environment: The env file.
        robots: A file for each robot that has one of its own.
        query: Its tasks; None where there are none.
        mesh_dirs: Folders outside that of the env file that meshes lie in; they must be allowed when it is read.
        notes: What is worth knowing about the files.
    """

    environment: Path
    robots: tuple[Path, ...]
    query: Path | None
    mesh_dirs: tuple[Path, ...] = ()
    notes: tuple[Diagnostic, ...] = ()


def write_environment(
    environment: Environment, file: PathArgument, *, mesh_dirs: Iterable[PathArgument] = (), allow_outside: bool = False
) -> Written:
    """Write an environment in its own dialect, all files or, where one cannot be written, none.

    The folder is made if need be. Meshes stay where they are: their names are written so that they are found from
    there.

    An older env file is replaced, and so are a robot file and a query of its stem; nothing else is. No file system
    renames several files at once: a process that is killed meanwhile may leave new robots and queries beside the old
    env file, which is renamed last. Writing once more puts that right.

    Args:
        environment: What to write; `translate` turns it into another dialect, and says what a dialect cannot express.
        file: The env file. Robots of dialect E and a query are written beside it, with its stem.
        mesh_dirs: More folders in which meshes are looked for.
        allow_outside: Whether the scene may be read with meshes outside its folder and `mesh_dirs`.

    Raises:
        ConversionError: A file cannot be written, is one that the environment was read from, or would replace something
            else; or a mesh cannot be named from there.
    """
    out = Path(os.fspath(file))
    with made_folder(out.parent, "ENV179"):
        return _write_environment(environment, out, mesh_dirs, allow_outside)


def _write_environment(
    environment: Environment, out: Path, mesh_dirs: Iterable[PathArgument], allow_outside: bool
) -> Written:
    log = DiagnosticLog()
    names = _robot_files(out, len(_apart(environment)))
    query = out.with_suffix(".query") if environment.tasks else None
    if out in (*names, query):
        hint = "name a file that ends in .env"
        log.fail("ENV179", str(out), f"{out} is what a robot or query beside it is called", hint=hint)
    for path in (out, *names, *([query] if query else [])):
        refuse_unwritable(path, "ENV179", environment.sources)
    options = Options.from_keywords({"mesh_dirs": mesh_dirs, "allow_outside": allow_outside})
    placed, outside = named_from(out.parent, environment, options, log)
    companions = [Output(n, Kind.ROBOT, robot_text(m)) for n, m in zip(names, _apart(placed), strict=True)]
    if query is not None:
        dofs = robot_dofs(environment, DiagnosticLog())
        alone = [own for task in environment.tasks for own in tasks_alone(task, dofs)]
        rows = query_text(alone, index=begins_with_robot(environment))
        companions.append(Output(query, Kind.QUERY, rows))
    scene = Output(out, Kind.ENVIRONMENT, env_text(placed))
    refuse_foreign_outputs(scene, companions)
    write_together({o.path: o.text.encode("utf-8", "surrogateescape") for o in (*companions, scene)}, "ENV179")
    return Written(out, tuple(names), query, outside, tuple(log))


def _apart(environment: Environment) -> list[MultiBody]:
    """Return the robots that have files of their own."""
    return [m for m in environment.multibodies if m.robot_file is not None]


def _robot_files(out: Path, count: int) -> list[Path]:
    if count == 1:
        return [out.with_suffix(".robot")]
    return [out.with_name(f"{out.stem}-{i}.robot") for i in range(count)]


def named_from(
    folder: Path, environment: Environment, options: Options, log: DiagnosticLog
) -> tuple[Environment, tuple[Path, ...]]:
    """Name meshes so that they are found from a folder, and list the folders outside it that they lie in.

    A name that leads to its mesh from there, too, stays; so does that of a mesh that is missing, with a warning.

    Raises:
        ConversionError: A name would be more than one word.
    """
    found, problems = find_all(environment, options, log)
    for name, problem in problems.items():
        # What the scene may not read is there all the same; it must be allowed when the new file is read.
        if problem.path is not None:
            found[name] = problem.path
            continue
        log.warn(problem.code, name, f"{problem.message}; its name stays", hint=problem.hint, span=problem.span)
    names: dict[str, str] = {}
    outside: dict[Path, None] = {}
    here = Path(os.path.realpath(folder))
    for body in (b for m in environment.multibodies for b in m.bodies):
        name = names[body.filename] = _name_from(here, body.filename, found.get(body.filename))
        if len(name.split()) != 1:
            message = f"the file name {name!r} is not a single word, as names in text files are"
            hint = "write the environment into another folder, or rename the file"
            log.fail("ENV178", body.filename, message, hint=hint, span=body.span)
        if body.filename in found:
            holder = Path(os.path.realpath(found[body.filename])).parent
            if not holder.is_relative_to(here):
                outside[_shown(holder)] = None
    if outside:
        message = f"meshes stay where they are, in {', '.join(map(str, outside))}"
        hint = "read it with mesh_dirs=[...] (--mesh-dirs) or allow_outside=True (--allow-outside)"
        log.info("ENV171", environment.name, message, hint=hint)
    multibodies = tuple(
        replace(m, bodies=tuple(replace(b, filename=names[b.filename]) for b in m.bodies))
        for m in environment.multibodies
    )
    return replace(environment, multibodies=multibodies), tuple(outside)


def _name_from(here: Path, name: str, found: Path | None) -> str:
    if found is None:
        return name
    same = os.path.isfile(here / name) and os.path.samefile(here / name, found)
    return name if same else os.path.relpath(os.path.realpath(found), here)


def _shown(folder: Path) -> Path:
    """Return a folder as one would name it: from the current folder, if it lies in that."""
    current = Path(os.path.realpath(""))
    return folder.relative_to(current) if folder.is_relative_to(current) else folder
