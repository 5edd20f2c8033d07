"""How far apart the planner's and the web page's reading of dialect A put things."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..formats.reading import read
from ..kinematics import RobotKinematics
from ..model import Dialect, Environment
from ..names import body_names
from ..scaling import scaled
from ..transforms import Array


@dataclass(frozen=True, slots=True)
class Readings:
    """How far the planner's and the page's reading put a link's origin from each other at home, in metres."""

    other: str
    distance: float
    link: str


def compare_readings(environment: Environment, options: Mapping[str, Any]) -> Readings | None:
    """Return how far apart the two readings of dialect A's connections put the links at home; None elsewhere."""
    if environment.dialect is not Dialect.A or not any(r.connections for r in environment.robots):
        return None
    other = "page" if environment.semantics == "planner" else "planner"
    changed = read(environment.path, **{**options, "semantics": other, "strict": False})
    here, there = (_origins_at_home(scaled(e, options["scale"])) for e in (environment, changed))
    apart = np.linalg.norm(here - there, axis=1)
    worst = int(apart.argmax())
    return Readings(other, float(apart[worst]), _robot_links(environment)[worst])


def _origins_at_home(environment: Environment) -> Array:
    robots = [RobotKinematics.of(r) for r in environment.robots]
    return np.concatenate([r.forward(r.home())[:, :3, 3] for r in robots])


def _robot_links(environment: Environment) -> list[str]:
    names = body_names(environment)
    places = (next(i for i, m in enumerate(environment.multibodies) if m is r) for r in environment.robots)
    return [n for i in places for n in names[i]]
