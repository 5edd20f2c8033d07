"""Unique, readable names for bodies and degrees of freedom."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import PurePosixPath

from .dofs import Dof
from .model import Environment, MultiBody

# Control characters cannot stand in XML; '/' and ':' are separators in MuJoCo names of this project.
_UNFIT = re.compile(r"[\x00-\x1f\x7f-\x9f/:\s\ud800-\udfff]+|[^\x00-\uffff]")


def mesh_stem(filename: str) -> str:
    """Return the stem of a mesh file's name, fit for a name."""
    return _UNFIT.sub("_", PurePosixPath(filename.replace("\\", "/")).stem) or "body"


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
    robots = environment.robots
    result: dict[int, tuple[str, ...]] = {}
    for i, multibody in enumerate(environment.multibodies):
        own = tuple(next(names) for _ in multibody.bodies)
        number = robot_index(robots, multibody)
        if number is not None and len(robots) > 1:
            own = tuple(f"robot{number}/{n}" for n in own)
        result[i] = own
    return result


def robot_index(robots: tuple[MultiBody, ...], multibody: MultiBody) -> int | None:
    """Return which robot a multibody is, or None; equal multibodies are told apart by identity."""
    return next((k for k, r in enumerate(robots) if r is multibody), None)


def dof_name(link: str, dof: Dof) -> str:
    """Return the name of a degree of freedom: `link.theta`, or `link.theta(loop)` where it moves nothing."""
    return f"{link}.{dof.kind}{'(loop)' if dof.loop else ''}"


def dof_names(links: tuple[str, ...], dofs: Iterable[Dof]) -> tuple[str, ...]:
    """Return unique names for a robot's degrees of freedom."""
    return tuple(unique(dof_name(links[d.body], d) for d in dofs))
