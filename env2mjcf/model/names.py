"""Unique, readable names for bodies."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import PurePosixPath

from .environment import Environment

# '/' and ':' are separators in MuJoCo names of this project; '\0' stands for what cannot be seen.
_UNFIT = re.compile(r"[\0/:\s]+|[^\x00-\uffff]")
# What file systems and shells give a meaning to.
_UNFIT_IN_FILES = re.compile(r'[\0<>:"/\\|?*]+')
_RESERVED = re.compile(r"(?:con|prn|aux|nul|com[0-9¹²³]|lpt[0-9¹²³]|conin\$|conout\$)(?= *(?:\.|$))", re.IGNORECASE)
# File systems take 255; what is written beside a file before it gets its name adds some thirty.
_LONGEST_STEM = 160


def mesh_stem(filename: str) -> str:
    """Return the stem of a mesh file's name, fit for a name."""
    return _UNFIT.sub("_", _seen(PurePosixPath(filename.replace("\\", "/")).stem)) or "body"


def file_stem(name: str) -> str:
    """Return a name fit for a file on every system, without an extension.

    What no file name may hold, or cannot be seen, becomes `_`; names that Windows reserves, and a dot, blank or dash in
    front, get one before them; it has 160 bytes at most, and no dot or blank at its end.
    """
    stem = _UNFIT_IN_FILES.sub("_", _seen(name)).encode()[:_LONGEST_STEM].decode(errors="ignore").rstrip(". ")
    return f"_{stem}" if stem[:1] in ("", ".", "-", " ") or _RESERVED.match(stem) else stem


def _seen(text: str) -> str:
    """Return text with a NUL for what cannot be seen: control characters, turns of direction, undecodable bytes."""
    return "".join(c if c.isprintable() else "\0" for c in text)


def unique(stems: Iterable[str]) -> list[str]:
    """Make names unique by `_2`, `_3` in their order; a name that a file already has is passed over.

    `world` is MuJoCo's own: the first of that name is `world_2`.
    """
    stems = list(stems)
    taken = set(stems)
    seen: dict[str, int] = {"world": 1}
    names: list[str] = []
    for stem in stems:
        count = seen.get(stem, 0) + 1
        name = stem
        if count > 1:
            while (name := f"{stem}_{count}") in taken:
                count += 1
            taken.add(name)
        seen[stem] = count
        names.append(name)
    return names


def body_names(environment: Environment) -> dict[int, tuple[str, ...]]:
    """Return the names of every multibody's bodies, by the multibody's place in the file.

    The mesh's stem, unique over the scene in file order; robots are prefixed `robot0/`, `robot1/` where there are
    several.
    """
    stems = [mesh_stem(b.filename) for m in environment.multibodies for b in m.bodies]
    names = iter(unique(stems))
    numbers = robot_numbers(environment)
    result: dict[int, tuple[str, ...]] = {}
    for i, multibody in enumerate(environment.multibodies):
        own = tuple(next(names) for _ in multibody.bodies)
        number = numbers.get(id(multibody))
        if number is not None and len(numbers) > 1:
            own = tuple(f"robot{number}/{n}" for n in own)
        result[i] = own
    return result


def robot_numbers(environment: Environment) -> dict[int, int]:
    """Return which robot a multibody is, by its `id`: equal multibodies are told apart by identity."""
    return {id(robot): number for number, robot in enumerate(environment.robots)}
