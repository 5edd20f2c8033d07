"""Mesh files, named as they are found from another folder."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from ..errors import ConversionError, DiagnosticLog, GeometryError
from ..geometry.resolve import find_all
from ..model import Environment
from ..options import Options


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
        # What the scene may not read is there all the same; who reads what is written has to allow it.
        if problem.path is not None:
            found[name] = problem.path
            continue
        log.warn(
            GeometryError, problem.code, name, f"{problem.message}; its name stays", hint=problem.hint,
            span=problem.span,
        )  # fmt: skip
    names: dict[str, str] = {}
    outside: dict[Path, None] = {}
    here = Path(os.path.realpath(folder))
    for body in (b for m in environment.multibodies for b in m.bodies):
        name = names[body.filename] = _name_from(here, body.filename, found.get(body.filename))
        if len(name.split()) != 1:
            log.fail(
                ConversionError, "ENV178", body.filename,
                f"the file name {name!r} is no single word, as names in text files are",
                hint="write the environment into another folder, or rename the file", span=body.span,
            )  # fmt: skip
        if body.filename in found:
            holder = Path(os.path.realpath(found[body.filename])).parent
            if not holder.is_relative_to(here):
                outside[_shown(holder)] = None
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


def _name_from(here: Path, name: str, found: Path | None) -> str:
    if found is None:
        return name
    same = os.path.isfile(here / name) and os.path.samefile(here / name, found)
    return name if same else os.path.relpath(os.path.realpath(found), here)


def _shown(folder: Path) -> Path:
    """Return a folder as one would name it: from the current folder, if it lies in that."""
    current = Path(os.path.realpath(""))
    return folder.relative_to(current) if folder.is_relative_to(current) else folder
