"""What can be said about a scene from its text alone, without meshes."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .kinematics.forward import RobotKinematics
from .kinematics.space import ConfigurationSpace
from .kinematics.tree import dof_names
from .model.dialects import RULES
from .model.environment import Boundary, DHForm, Dialect, Environment, MultiBody, Resolution
from .model.names import body_names
from .model.scaling import scaled
from .options import Options
from .transforms import Array

_TOLD_BY = {
    Dialect.A: "begins with a count, then 'MultiBody'",
    Dialect.B: "begins with a count, then a multibody's tag, and its joints have no limits",
    Dialect.C: "its boundary has no brackets, or its joints have limits but it has no boundary",
    Dialect.D: "its boundary has brackets, and it holds Active, NonHolonomic or Surface multibodies",
    Dialect.E: "its boundary has brackets, and robots live in files of their own",
}


@dataclass(frozen=True, slots=True)
class DofSummary:
    """One degree of freedom: in the file's own numbers, then in radians or metres."""

    name: str
    unit: str
    periodic: bool
    lower: float
    upper: float
    home: float
    lower_si: float
    upper_si: float
    home_si: float


@dataclass(frozen=True, slots=True)
class RobotSummary:
    """One robot: its label and file where it has them, its base, bodies and degrees of freedom."""

    label: str | None
    file: str | None
    base: str
    links: tuple[str, ...]
    dofs: tuple[DofSummary, ...]


@dataclass(frozen=True, slots=True)
class QuerySummary:
    """A task: which robots move (`robot` is the first), and how many configurations they visit."""

    robot: int
    label: str
    configurations: int
    robots: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class SceneSummary:
    """A scene as its files describe it. Boundary and resolution are in file units."""

    path: str
    name: str
    dialect: str
    told_by: str
    semantics: str
    readings: Readings | None
    metres_per_unit: float
    boundary: Boundary | None
    resolution: Resolution
    robots: tuple[RobotSummary, ...]
    obstacles: tuple[str, ...]
    surfaces: tuple[str, ...]
    queries: tuple[QuerySummary, ...]


def describe(environment: Environment, options: Options) -> SceneSummary:
    """Sum up what a scene's text says.

    Args:
        environment: The scene, in file units.
        options: What it was read with.
    """
    names = body_names(environment)
    return SceneSummary(
        path=environment.path,
        name=environment.name,
        dialect=environment.dialect.value,
        told_by=_told_by(environment, options),
        semantics=environment.semantics,
        readings=compare_readings(environment, options.scale),
        metres_per_unit=float(options.scale),
        boundary=environment.boundary,
        resolution=environment.resolution,
        robots=tuple(_robots(environment, float(options.scale))),
        obstacles=_names_of(environment, environment.obstacles, names),
        surfaces=_names_of(environment, environment.surfaces, names),
        queries=tuple(QuerySummary(t.robot, t.label, len(t.configurations), t.robots) for t in environment.tasks),
    )


def _names_of(environment: Environment, some: tuple[Any, ...], names: Mapping[int, tuple[str, ...]]) -> tuple[str, ...]:
    """Return the names of the bodies of some multibodies, which are told apart by identity."""
    chosen = {id(m) for m in some}
    return tuple(n for i, m in enumerate(environment.multibodies) if id(m) in chosen for n in names[i])


def _robots(environment: Environment, metres: float) -> list[RobotSummary]:
    in_metres = scaled(environment, metres)
    kinematics = [RobotKinematics.of(r) for r in in_metres.robots]
    names = body_names(environment)
    by_identity = {id(m): names[i] for i, m in enumerate(environment.multibodies)}
    links = [by_identity[id(r)] for r in environment.robots]
    space = ConfigurationSpace(
        kinematics,
        [n for own, k in zip(links, kinematics, strict=True) for n in dof_names(own, k.dofs)],
        [k.home() for k in kinematics],
        in_metres.boundary,
        metres,
        sample_box=(np.zeros(3), np.zeros(3)),  # nothing is drawn, and the obstacles' box needs their meshes
    )
    lower, upper, home = (space.in_file_units(v) for v in (space.lower, space.upper, space.home))
    summaries: list[RobotSummary] = []
    for robot, k, own, columns in zip(environment.robots, kinematics, links, space.robot_slices, strict=True):
        turns = RULES[robot.dialect].configuration_angle > 4
        dofs = tuple(
            DofSummary(
                space.names[i],
                "length" if d.kind.is_length else "turns" if turns else "pi",
                bool(space.periodic[i]),
                *(float(v[i]) for v in (lower, upper, home, space.lower, space.upper, space.home)),
            )
            for i, d in enumerate(k.dofs, columns.start)
        )
        bases = ", ".join(k.tree.bases[b].value for b in sorted(k.tree.bases))
        summaries.append(RobotSummary(robot.label, robot.robot_file, bases, own, dofs))
    return summaries


def _told_by(environment: Environment, options: Options) -> str:
    of_text = "as --dialect says" if options.dialect else _TOLD_BY[environment.dialect]
    reason = "XML" if environment.xml else of_text
    # A problem XML names the file that describes the environment, and may give the boundary itself.
    own = [m.span for m in environment.multibodies if m.robot_file is None]
    spans = [environment.boundary.span if environment.boundary else None, *own]
    named = [s.path for s in spans if s is not None and s.path != environment.path]
    return f"{named[0]}: {reason}" if named else reason


@dataclass(frozen=True, slots=True)
class Readings:
    """How far the planner's and the page's reading put a link's origin from each other at home, in metres."""

    other: str
    distance: float
    link: str


def compare_readings(environment: Environment, scale: float) -> Readings | None:
    """Return how far apart the two readings of dialect A's connections put the links at home; None elsewhere."""
    if environment.dialect is not Dialect.A or not any(r.connections for r in environment.robots):
        return None
    other = "page" if environment.semantics == "planner" else "planner"
    changed = dataclasses.replace(environment, multibodies=tuple(map(_read_otherwise, environment.multibodies)))
    here, there = (_origins_at_home(scaled(e, scale)) for e in (environment, changed))
    apart = np.linalg.norm(here - there, axis=1)
    worst = int(apart.argmax())
    return Readings(
        other, float(apart[worst]), _names_of(environment, environment.robots, body_names(environment))[worst]
    )


def _read_otherwise(multibody: MultiBody) -> MultiBody:
    """Return a multibody of dialect A in the other reading, which swaps the transforms and the DH form."""
    swapped = (dataclasses.replace(c, to_dh=c.to_body, to_body=c.to_dh) for c in multibody.connections)
    form = DHForm.STANDARD if multibody.dh_form is DHForm.CRAIG else DHForm.CRAIG
    return dataclasses.replace(multibody, connections=tuple(swapped), dh_form=form)


def _origins_at_home(environment: Environment) -> Array:
    robots = [RobotKinematics.of(r) for r in environment.robots]
    return np.concatenate([r.forward(r.home())[:, :3, 3] for r in robots])
