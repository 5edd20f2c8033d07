"""Environments on the disk: the env file, robot files and a query beside it."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from ..dialects import begins_with_robot
from ..errors import ConversionError, Diagnostic, DiagnosticLog
from ..formats.query import query_text
from ..formats.writers import env_text, robot_text
from ..model import Environment
from ..options import PathArgument
from ..writing import output, refuse_unwritable


@dataclass(frozen=True, slots=True)
class Written:
    """The files of an environment.

    Attributes:
        environment: The env file.
        robots: A file for each robot that has one of its own.
        query: Its tasks; None where there are none.
        mesh_dirs: Folders outside that of the env file that meshes lie in; who reads it must allow them.
        notes: What is worth knowing about the files.
    """

    environment: Path
    robots: tuple[Path, ...]
    query: Path | None
    mesh_dirs: tuple[Path, ...] = ()
    notes: tuple[Diagnostic, ...] = ()


def write_environment(
    environment: Environment, file: PathArgument, *, mesh_dirs: Iterable[PathArgument] = (), inputs: Iterable[str] = ()
) -> Written:
    """Write an environment in its own dialect, all files or none.

    Meshes stay where they are: their names are written so that they are found from the new folder.

    Args:
        environment: What to write; `translate` turns it into another dialect, and says what a dialect cannot express.
        file: The env file. Robots of dialect E and a query are written beside it, with its stem.
        mesh_dirs: More folders in which meshes are looked for.
        inputs: Files that must not be replaced.

    Raises:
        ConversionError: A file cannot be written, or is an input; or a mesh cannot be named from there.
    """
    log = DiagnosticLog()
    out = Path(os.fspath(file))
    robots = [m for m in environment.multibodies if m.robot_file is not None]
    names = _robot_files(out, len(robots))
    query = out.with_suffix(".query") if environment.tasks else None
    for path in (out, *names, *([query] if query else [])):
        refuse_unwritable(path, "ENV179", [name for name in (environment.path, *inputs) if name])
    placed, outside = _relocated(environment, out.parent, [environment.directory, *map(Path, mesh_dirs)], log)
    texts = {n: robot_text(m) for n, m in zip(names, (m for m in placed.multibodies if m.robot_file), strict=True)}
    if query is not None:
        texts[query] = query_text(environment.tasks, index=begins_with_robot(environment))
    with ExitStack() as written:
        # All are written before any is renamed, the env file last, as the first that was entered.
        for path, text in {out: env_text(placed), **texts}.items():
            beside = written.enter_context(output(path, "ENV179"))
            beside.write_bytes(text.encode("utf-8", "surrogateescape"))
    return Written(out, tuple(names), query, outside, tuple(log))


def _robot_files(out: Path, count: int) -> list[Path]:
    if count == 1:
        return [out.with_suffix(".robot")]
    return [out.with_name(f"{out.stem}-{i}.robot") for i in range(count)]


def _relocated(
    environment: Environment, folder: Path, folders: Sequence[Path], log: DiagnosticLog
) -> tuple[Environment, tuple[Path, ...]]:
    """Name meshes as seen from another folder, and list the folders outside it that they lie in."""
    here = os.path.realpath(folder)
    if here == os.path.realpath(environment.directory):
        return environment, ()
    names: dict[str, str] = {}
    outside: dict[Path, None] = {}
    for body in (b for m in environment.multibodies for b in m.bodies):
        name = body.filename.replace("\\", "/")
        source = next((f for f in folders if (f / name).is_file()), environment.directory)
        absolute = PurePosixPath(name).is_absolute()
        names[body.filename] = name if absolute else os.path.relpath(os.path.realpath(source / name), here)
        if len(names[body.filename].split()) != 1:
            log.fail(
                ConversionError, "ENV178", body.filename,
                f"the file name {names[body.filename]!r} is no single word, as names in text files are",
                hint="write the environment into another folder", span=body.span,
            )  # fmt: skip
        if absolute or names[body.filename].startswith(".."):
            outside[_shown((folder / names[body.filename]).parent)] = None
    if outside:
        log.info(
            "ENV171", environment.name, f"meshes stay where they are, in {', '.join(map(str, outside))}",
            hint="read it with mesh_dirs=[...] (--mesh-dirs) or allow_outside=True (--allow-outside)",
        )  # fmt: skip
    multibodies = tuple(
        replace(m, bodies=tuple(replace(b, filename=names[b.filename]) for b in m.bodies))
        for m in environment.multibodies
    )
    return replace(environment, multibodies=multibodies), tuple(outside)


def _shown(folder: Path) -> Path:
    """Return a folder as one would name it: from the current folder, if it lies in that."""
    real, current = Path(os.path.realpath(folder)), Path(os.path.realpath(""))
    return real.relative_to(current) if real.is_relative_to(current) else real
