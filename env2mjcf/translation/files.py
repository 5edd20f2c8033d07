"""Environments on the disk: the env file, robot files and a query beside it."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ..dialects import begins_with_robot
from ..errors import ConversionError, Diagnostic, DiagnosticLog
from ..formats.query import query_text
from ..formats.writers import env_text, robot_text
from ..model import Environment, MultiBody
from ..options import Options, PathArgument
from ..writing import refuse_unwritable, write_together
from .meshes import named_from
from .outputs import Kind, Output, refuse_no_translation


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
    environment: Environment,
    file: PathArgument,
    *,
    mesh_dirs: Iterable[PathArgument] = (),
    allow_outside: bool = False,
) -> Written:
    """Write an environment in its own dialect, all files or, where one cannot be written, none.

    Meshes stay where they are: their names are written so that they are found from the new folder.

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
    log = DiagnosticLog()
    out = Path(os.fspath(file))
    names = _robot_files(out, len(_apart(environment)))
    query = out.with_suffix(".query") if environment.tasks else None
    if out in (*names, query):
        log.fail(
            ConversionError, "ENV179", str(out), f"{out} is what a robot or query beside it is called",
            hint="name a file that ends in .env",
        )  # fmt: skip
    for path in (out, *names, *([query] if query else [])):
        refuse_unwritable(path, "ENV179", environment.sources)
    options = Options.from_keywords({"mesh_dirs": mesh_dirs, "allow_outside": allow_outside})
    placed, outside = named_from(out.parent, environment, options, log)
    companions = [Output(n, Kind.ROBOT, robot_text(m)) for n, m in zip(names, _apart(placed), strict=True)]
    if query is not None:
        rows = query_text(environment.tasks, index=begins_with_robot(environment))
        companions.append(Output(query, Kind.QUERY, rows))
    scene = Output(out, Kind.ENVIRONMENT, env_text(placed))
    refuse_no_translation(scene, companions)
    write_together({o.path: o.text.encode("utf-8", "surrogateescape") for o in (*companions, scene)}, "ENV179")
    return Written(out, tuple(names), query, outside, tuple(log))


def _apart(environment: Environment) -> list[MultiBody]:
    """Return the robots that have files of their own."""
    return [m for m in environment.multibodies if m.robot_file is not None]


def _robot_files(out: Path, count: int) -> list[Path]:
    if count == 1:
        return [out.with_suffix(".robot")]
    return [out.with_name(f"{out.stem}-{i}.robot") for i in range(count)]
