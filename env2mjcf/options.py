"""Arguments that are numbers: those that are none, or out of range, are refused by name.

MERGED: The options of reading, compiling and loading, in one place.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from numbers import Integral, Real
from os import PathLike
from typing import Any, Literal, get_args

from .errors import did_you_mean
from .limits import Limits


def whole(name: str, value: object, least: int, most: int | None = None) -> int:
    """Return an argument that is a whole number.

    Raises:
        TypeError: It is none (True and 2.0 are not); the message names it.
        ValueError: It is below `least` or above `most`.
    """
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise TypeError(f"{name} is {value!r}; expected a whole number")
    number = int(value)
    if number < least or (most is not None and number > most):
        raise ValueError(f"{name} is {number}; expected {_range(str(least), most)}")
    return number


def positive(name: str, value: object, most: float | None = None) -> float:
    """Return an argument that is a finite number above zero.

    Raises:
        TypeError: It is no number; the message names it.
        ValueError: It is not positive, not finite, or above `most`.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"{name} is {value!r}; expected a number")
    number = float(value)
    if not 0 < number < math.inf or (most is not None and number > most):
        limit = "" if most is None else f" up to {most:g}"
        raise ValueError(f"{name} is {value}; expected a positive number{limit}")
    return number


def _range(least: str, most: int | None) -> str:
    return f"at least {least}" if most is None else f"{least} to {most}"


Semantics = Literal["planner", "page"]
Collision = Literal["auto", "hull", "surface", "solid", "coacd"]
BoundaryStyle = Literal["visual", "solid"]
Actuators = Literal["position"]
Engine = Literal["auto", "exact", "mujoco"]
DialectName = Literal["A", "B", "C", "D", "E"]
PathArgument = str | PathLike[str]


@dataclass(frozen=True, slots=True)
class Options:
    """Everything that may be chosen when a scene is read, compiled or loaded.

    The fields are the keyword arguments of `read`, `convert` and `load`, and the flags of the command line.

    Attributes:
        robots: Dialect E robot files, appended after the file's own Active bodies.
        query: A query file with start and goal configurations; never guessed.
        semantics: Whose reading of a dialect A connection: the planner's, or the web page's.
        dialect: Read the file as this dialect instead of telling it from the text.
        strict: Turn warnings into errors.
        mesh_dirs: More folders in which meshes are looked for.
        allow_outside: May meshes outside the scene's folder and `mesh_dirs` be read.
        collision: How meshes become convex collision shapes.
        primitives: Write exact boxes as box geoms.
        self_collision: Test links of one robot against each other.
        adjacent_links: Links within this many connections of each other are not tested.
        inter_robot: Test links of different robots against each other.
        exclude_pairs: Pairs of body names that are not tested.
        exclude_rest_contacts: Do not test pairs that touch at home.
        boundary: Draw the boundary as a wire box, or build it as walls (which act in simulation only).
        actuators: Add position actuators to every joint.
        density: Density of bodies without a mass of their own, kg per cubic metre.
        gravity: Acceleration of gravity, metres per second squared.
        ground: Add a ground plane below the scene.
        scale: Metres per file unit, applied to every length.
        engine: Which engine answers queries.
        cache: Keep the results of expensive geometry between runs.
        limits: Bounds on hostile input.
    """

    robots: tuple[PathArgument, ...] = ()
    query: PathArgument | None = None
    semantics: Semantics = "planner"
    dialect: DialectName | None = None
    strict: bool = False
    mesh_dirs: tuple[PathArgument, ...] = ()
    allow_outside: bool = False
    collision: Collision = "auto"
    primitives: bool = False
    self_collision: bool = True
    adjacent_links: int = 1
    inter_robot: bool = True
    exclude_pairs: tuple[tuple[str, str], ...] = ()
    exclude_rest_contacts: bool = False
    boundary: BoundaryStyle | None = None
    actuators: Actuators | None = None
    density: float = 1000.0
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    ground: bool = False
    scale: float = 1.0
    engine: Engine = "auto"
    cache: bool = True
    limits: Limits = dataclasses.field(default_factory=Limits)

    @classmethod
    def from_keywords(cls, keywords: Mapping[str, Any]) -> Options:
        """Build options from keyword arguments.

        Raises:
            TypeError: A keyword is not an option; the message lists the valid ones.
            ValueError: A value is not one that the option can take.
        """
        known = {f.name: f for f in dataclasses.fields(cls)}
        for name in keywords:
            if name not in known:
                guess = did_you_mean(name, known)
                raise TypeError(f"unknown option {name!r}{f'; {guess}' if guess else ''} (options: {', '.join(known)})")
        values = dict(keywords)
        for name, value in values.items():
            _check_kind(name, value)
        for name in ("robots", "mesh_dirs"):
            value = values.get(name, ())
            values[name] = (value,) if isinstance(value, (str, PathLike)) else tuple(value)
        if "exclude_pairs" in values:
            values["exclude_pairs"] = tuple(_pair(p) for p in values["exclude_pairs"])
        if "gravity" in values:
            values["gravity"] = tuple(float(g) for g in values["gravity"])
        options = cls(**values)
        options._validate()
        return options

    def _validate(self) -> None:
        _one_of("semantics", self.semantics, get_args(Semantics))
        _one_of("dialect", self.dialect, (None, *get_args(DialectName)))
        _one_of("collision", self.collision, get_args(Collision))
        _one_of("boundary", self.boundary, (None, *get_args(BoundaryStyle)))
        _one_of("actuators", self.actuators, (None, *get_args(Actuators)))
        _one_of("engine", self.engine, get_args(Engine))
        if not (0 < self.scale < float("inf")):
            raise ValueError(f"scale must be a positive number, got {self.scale!r}")
        if not (0 < self.density < float("inf")):
            raise ValueError(f"density must be a positive number, got {self.density!r}")
        if self.adjacent_links < 0:
            raise ValueError(f"adjacent_links must not be negative, got {self.adjacent_links!r}")
        if len(self.gravity) != 3 or not all(abs(g) < float("inf") for g in self.gravity):
            raise ValueError(f"gravity must be three finite numbers, got {self.gravity!r}")


def _one_of(name: str, value: object, allowed: tuple[object, ...]) -> None:
    if value not in allowed:
        guess = did_you_mean(str(value), [str(a) for a in allowed])
        choices = ", ".join(repr(a) for a in allowed)
        raise ValueError(f"{name}={value!r} is not one of {choices}{f'; {guess}' if guess else ''}")


_NUMBERS = ("density", "scale")
_FLAGS = (
    "strict",
    "allow_outside",
    "primitives",
    "self_collision",
    "inter_robot",
    "exclude_rest_contacts",
    "ground",
    "cache",
)
_LISTS = ("gravity", "exclude_pairs")


def _check_kind(name: str, value: Any) -> None:
    """Raise a TypeError that names an option whose value is of a wrong kind."""
    expected = ""
    if name in _FLAGS and not isinstance(value, bool):
        expected = "True or False"
    elif name in _NUMBERS and (isinstance(value, bool) or not isinstance(value, Real)):
        expected = "a number"
    elif name == "adjacent_links" and (isinstance(value, bool) or not isinstance(value, Integral)):
        expected = "an integer"
    elif name == "limits" and not isinstance(value, Limits):
        expected = "Limits(...)"
    elif name in (*_LISTS, "robots", "mesh_dirs") and not isinstance(value, (Iterable, PathLike)):
        expected = "a sequence"
    if expected:
        raise TypeError(f"{name}={value!r}; expected {expected}")


def _pair(value: Any) -> tuple[str, str]:
    if isinstance(value, str) or len(pair := tuple(value)) != 2:
        raise ValueError(f"exclude_pairs holds {value!r}; expected pairs of names, as in [('link1', 'block')]")
    return str(pair[0]), str(pair[1])
