"""The options of reading, compiling and loading, and how numbers that come in as arguments are checked."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from numbers import Integral, Real
from os import PathLike
from typing import Any, Literal, TypedDict, get_args

from .errors import did_you_mean
from .limits import LARGEST, Limits

Semantics = Literal["planner", "page"]
Collision = Literal["auto", "hull", "surface", "solid", "coacd"]
BoundaryStyle = Literal["visual", "solid"]
Actuators = Literal["position", "velocity", "motor"]
Engine = Literal["auto", "exact", "mujoco"]
DialectName = Literal["A", "B", "C", "D", "E"]
PathArgument = str | PathLike[str]


@dataclass(frozen=True, slots=True)
class Options:
    """Everything that may be chosen when a scene is read, compiled or loaded.

    The fields are the keyword arguments of `read`, `convert` and `load`, and the flags of the command line. They are
    checked however the options are made: a value of a wrong kind is a TypeError, one out of range a ValueError. A list
    may stand for a tuple, and one file or folder for several.

    Attributes:
        robots: Dialect E robot files, appended after the file's own Active bodies.
        query: A query file with start and goal configurations; never guessed.
        semantics: Whose reading of a dialect A connection: the planner's, or the web page's.
        dialect: Read the file as this dialect instead of telling it from the text.
        strict: Turn warnings into errors.
        mesh_dirs: More folders in which meshes are looked for.
        allow_outside: Read files outside the scene's folder and `mesh_dirs`, too, that a scene or problem XML names.
        collision: How meshes become convex collision shapes.
        primitives: Write exact boxes as box geoms, where solids collide.
        self_collision: Test links of one robot against each other; unless given, what a problem XML says, else True.
        adjacent_links: Links within this many connections of each other are not tested; unless given, what a problem
            XML says, else 1.
        inter_robot: Test links of different robots against each other.
        exclude_pairs: Pairs of body names that are not tested.
        exclude_rest_contacts: Do not test pairs that touch at home.
        boundary: Draw the boundary as a wire box, or build it as walls (which act in simulation only).
        actuators: Drive every hinge and slide: by "position", "velocity" or as a "motor", with bounded forces.
        sensors: Add sensors of joint positions and velocities, and a site `tool` at the last link of each robot.
        density: Density of bodies without a mass of their own, kg per cubic metre.
        gravity: Acceleration of gravity, metres per second squared; unless given, the file's where that is not zero,
            times `scale`, else (0, 0, -9.81).
        ground: Add a ground plane below the scene.
        scale: Metres per file unit, applied to every length.
        origin: Where the MJCF's origin lies, metres in the file's frame; unless given, a round point amid the bodies
            where they are more than a thousand extents from the file's origin, else (0, 0, 0), which keeps its frame.
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
    self_collision: bool | None = None
    adjacent_links: int | None = None
    inter_robot: bool = True
    exclude_pairs: tuple[tuple[str, str], ...] = ()
    exclude_rest_contacts: bool = False
    boundary: BoundaryStyle | None = None
    actuators: Actuators | None = None
    sensors: bool = False
    density: float = 1000.0
    gravity: tuple[float, float, float] | None = None
    ground: bool = False
    scale: float = 1.0
    origin: tuple[float, float, float] | None = None
    engine: Engine = "auto"
    cache: bool = True
    limits: Limits = dataclasses.field(default_factory=Limits)

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            object.__setattr__(self, field.name, _checked(field.name, getattr(self, field.name)))

    @classmethod
    def from_keywords(cls, keywords: Mapping[str, Any]) -> Options:
        """Build options from keyword arguments.

        Raises:
            TypeError: A keyword is not an option; the message lists the valid ones. Or a value is of a wrong kind.
            ValueError: A value is not one that the option can take.
        """
        known = [f.name for f in dataclasses.fields(cls)]
        for name in keywords:
            if name not in known:
                guess = did_you_mean(name, known)
                raise TypeError(f"unknown option {name!r}{f'; {guess}' if guess else ''} (options: {', '.join(known)})")
        return cls(**keywords)

    # What a problem XML may say, too, where an option leaves it to the file.

    def tests_self(self, ignored: bool | None) -> bool:
        """Return whether links of one robot are tested against each other; `ignored` is what the file says."""
        return not ignored if self.self_collision is None else self.self_collision

    def untested_steps(self, of_file: int | None) -> int:
        """Return within how many connections links are not tested."""
        given = of_file if self.adjacent_links is None else self.adjacent_links
        return 1 if given is None else given

    def acceleration(self, of_file: tuple[float, float, float] | None) -> tuple[float, float, float]:
        """Return gravity in metres per second squared; the file's is in its own units of length."""
        if self.gravity is not None:
            return self.gravity
        if of_file is None or not any(of_file):
            return 0.0, 0.0, -9.81
        x, y, z = (g * self.scale for g in of_file)
        return x, y, z


class OptionKeywords(TypedDict, total=False):
    """The fields of `Options` as the keyword arguments of `read`, `convert` and `load`, for type checkers."""

    robots: PathArgument | Iterable[PathArgument]
    query: PathArgument | None
    semantics: Semantics
    dialect: DialectName | None
    strict: bool
    mesh_dirs: PathArgument | Iterable[PathArgument]
    allow_outside: bool
    collision: Collision
    primitives: bool
    self_collision: bool | None
    adjacent_links: int | None
    inter_robot: bool
    exclude_pairs: Iterable[tuple[str, str]]
    exclude_rest_contacts: bool
    boundary: BoundaryStyle | None
    actuators: Actuators | None
    sensors: bool
    density: float
    gravity: Iterable[float] | None
    ground: bool
    scale: float
    origin: Iterable[float] | None
    engine: Engine
    cache: bool
    limits: Limits


_CHOICES: dict[str, tuple[str | None, ...]] = {
    "semantics": get_args(Semantics),
    "dialect": (None, *get_args(DialectName)),
    "collision": get_args(Collision),
    "boundary": (None, *get_args(BoundaryStyle)),
    "actuators": (None, *get_args(Actuators)),
    "engine": get_args(Engine),
}
_KINDS: dict[str, tuple[type | tuple[type, ...], str]] = {
    **dict.fromkeys(("robots", "mesh_dirs"), ((Iterable, PathLike), "a sequence")),
    **dict.fromkeys(("gravity", "origin", "exclude_pairs"), (Iterable, "a sequence")),
    "query": ((str, PathLike), "a path"),
    "limits": (Limits, "Limits(...)"),
}
# None leaves to a problem XML what it may say, too.
_OPTIONAL = ("query", "self_collision", "adjacent_links", "gravity", "origin")


def _checked(name: str, given: object) -> object:
    """Return the value of an option, lists as tuples.

    Raises:
        TypeError: It is of a wrong kind.
        ValueError: It is not one that the option can take.
    """
    if name in _CHOICES:
        return _one_of(name, given, _CHOICES[name])
    if given is None and name in _OPTIONAL:
        return None
    if name == "adjacent_links":
        return whole(name, given, 0)
    if name in ("density", "scale"):
        return positive(name, given)
    kind, expected = _KINDS.get(name, (bool, "True or False"))
    if not isinstance(given, kind) or (isinstance(given, bool) and kind is not bool):
        raise TypeError(f"{name}={given!r}; expected {expected}")
    value: Any = given
    if name in ("robots", "mesh_dirs"):
        paths = (value,) if isinstance(value, (str, PathLike)) else tuple(value)
        if wrong := [path for path in paths if not isinstance(path, (str, PathLike))]:
            raise TypeError(f"{name} holds {wrong[0]!r}; expected paths")
        return paths
    if name == "exclude_pairs":
        return tuple(_pair(pair) for pair in value)
    return _vector(name, value) if name in ("gravity", "origin") else value


def _one_of(name: str, value: object, allowed: tuple[str | None, ...]) -> object:
    if not isinstance(value, str | None) or value not in allowed:
        guess = did_you_mean(str(value), [str(a) for a in allowed])
        choices = ", ".join(repr(a) for a in allowed)
        raise ValueError(f"{name}={value!r} is not one of {choices}{f'; {guess}' if guess else ''}")
    return value


def _pair(value: Any) -> tuple[str, str]:
    if isinstance(value, str) or not isinstance(value, Iterable) or len(pair := tuple[Any, ...](value)) != 2:
        raise ValueError(f"exclude_pairs holds {value!r}; expected pairs of names, as in [('link1', 'block')]")
    return str(pair[0]), str(pair[1])


def _vector(name: str, value: Iterable[Any]) -> tuple[float, ...]:
    values: tuple[Any, ...] = tuple(value)
    three = len(values) == 3 and all(isinstance(g, Real) for g in values)
    if not (three and all(abs(g) <= LARGEST for g in values)):
        raise ValueError(f"{name} must be three finite numbers, got {values!r}")
    return tuple(float(g) for g in values)


def whole(name: str, value: object, least: int, most: int | None = None) -> int:
    """Return an argument that is a whole number.

    Raises:
        TypeError: It is not one (True and 2.0 are not, either); the message names it.
        ValueError: It is below `least` or above `most`.
    """
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise TypeError(f"{name} is {value!r}; expected a whole number")
    number = int(value)
    expected = f"at least {least}" if most is None else f"{least} to {most}"
    if number < least or (most is not None and number > most):
        raise ValueError(f"{name} is {number}; expected {expected}")
    return number


def positive(name: str, value: object) -> float:
    """Return an argument that is a finite number above zero.

    Raises:
        TypeError: It is not a number; the message names it.
        ValueError: It is not positive, or not finite.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"{name} is {value!r}; expected a number")
    number: Any = value  # not a float yet: an integer may be larger than any
    if not 0 < number <= sys.float_info.max:
        raise ValueError(f"{name} is {value}; expected a positive number")
    return float(number)
