"""The scene as its file describes it: robots, obstacles, boundary, tasks.

Words of the file format stay as they are. Lengths are in file units, angles in radians. Spans are not compared.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

from ..errors import Diagnostic, Span

Vector3 = tuple[float, float, float]
ZERO3: Vector3 = (0.0, 0.0, 0.0)


def _span() -> Any:
    return field(default=None, compare=False, repr=False)


class Dialect(StrEnum):
    """The five dialects of the format (docs/format/env.md)."""

    A = "A"
    B = "B"
    C = "C"
    D = "D"
    E = "E"


class DHForm(StrEnum):
    """Which product of four elementary transforms a DH row stands for."""

    CRAIG = "craig"  # Rx(alpha) Tx(a) Rz(theta) Tz(d)
    STANDARD = "standard"  # Rz(theta) Tz(d) Tx(a) Rx(alpha)


class MultiBodyKind(StrEnum):
    """The role that a multibody's tag gives it."""

    ACTIVE = "Active"
    NON_HOLONOMIC = "NonHolonomic"
    PASSIVE = "Passive"
    INTERNAL = "Internal"
    SURFACE = "Surface"


class BaseKind(StrEnum):
    """How a body is carried: by its own base, by the world, or by a connection."""

    PLANAR_TRANSLATIONAL = "Planar Translational"
    PLANAR_ROTATIONAL = "Planar Rotational"
    VOLUMETRIC_TRANSLATIONAL = "Volumetric Translational"
    VOLUMETRIC_ROTATIONAL = "Volumetric Rotational"
    FIXED = "Fixed"
    JOINT = "Joint"


class JointType(StrEnum):
    """What a connection allows."""

    REVOLUTE = "Revolute"
    PRISMATIC = "Prismatic"
    SPHERICAL = "Spherical"
    NON_ACTUATED = "NonActuated"
    SMA = "SMAJoint"


class Recentring(StrEnum):
    """What is subtracted from a mesh's vertices when it is loaded (docs/format/meshes.md)."""

    COM = "COM"  # the unweighted mean of the vertex list
    SURFACE = "Surface"  # its x and z only
    NONE = "None"


@dataclass(frozen=True, slots=True)
class Pose:
    """`x y z rx ry rz`: position in file units, rotation Rz(rz) Ry(ry) Rx(rx) in radians."""

    position: Vector3 = ZERO3
    rotation: Vector3 = ZERO3
    span: Span | None = _span()


@dataclass(frozen=True, slots=True)
class DHParameters:
    """`alpha a d theta`: angles in radians, lengths in file units."""

    alpha: float = 0.0
    a: float = 0.0
    d: float = 0.0
    theta: float = 0.0
    span: Span | None = _span()


@dataclass(frozen=True, slots=True)
class JointLimits:
    """Closed interval of one joint value: radians, or file units for a slide."""

    lower: float
    upper: float
    span: Span | None = _span()


@dataclass(frozen=True, slots=True)
class SMAShape:
    """The two extra numbers of an SMAJoint: bar length and width."""

    length: float
    width: float


@dataclass(frozen=True, slots=True)
class Connection:
    """A connection from body `previous` to body `next`, indices into the multibody's body list.

    `T_next = T_previous * to_dh * T_DH(dh) * to_body` (docs/format/kinematics.md), whatever the order of the two
    transforms in the file.
    """

    previous: int
    next: int
    joint: JointType
    to_dh: Pose
    dh: DHParameters
    to_body: Pose
    limits: tuple[JointLimits, ...] = ()
    actuated: str | None = None  # dialect A's tag, which no reader ever used
    sma: SMAShape | None = None
    span: Span | None = _span()


@dataclass(frozen=True, slots=True)
class Body:
    """One rigid body and its mesh file.

    Attributes:
        filename: The mesh file as the scene names it.
        base: How the body is carried.
        pose: World pose of a fixed body; the display pose of dialect A's first FreeBody; None where the file has none.
        recentring: What is subtracted from the mesh's vertices.
        color: RGBA in 0..1, from `-c(...)`, a `#VIZMO_COLOR` line or an XML attribute.
        texture, mass: A texture's file name, and the mass, where the file gives them.
        label: The visualiser's `#VIZMO_NAME`.
        index: Dialect A's index field, which no planner used.
    """

    filename: str
    base: BaseKind
    pose: Pose | None = None
    recentring: Recentring = Recentring.COM
    color: tuple[float, float, float, float] | None = None
    texture: str | None = None
    mass: float | None = None
    label: str | None = None
    index: int | None = None
    span: Span | None = _span()


@dataclass(frozen=True, slots=True)
class VelocityBounds:
    """`VelocityBounds` of a NonHolonomic multibody: greatest linear and angular speed."""

    linear: float
    angular: float


@dataclass(frozen=True, slots=True)
class Actuator:
    """An `<Actuator>` of an XML robot: kept, not simulated."""

    label: str
    attributes: tuple[tuple[str, str], ...] = ()
    span: Span | None = _span()


@dataclass(frozen=True, slots=True)
class MultiBody:
    """A robot or an obstacle: bodies and the connections between them.

    Attributes:
        kind: Role by tag.
        bodies, connections: In file order.
        dialect: Which dialect's rules its numbers follow (a scene may mix an environment and a newer robot file).
        dh_form: Which product a DH row stands for.
        adjacencies: Pairs of body indices that count as connected.
        label: Label of a Surface body, or of a robot in a problem file.
        velocity_bounds, controls: A NonHolonomic multibody's extra blocks.
        actuators: An XML robot's actuators.
        robot_file: The separate robot file that it came from.
    """

    kind: MultiBodyKind
    bodies: tuple[Body, ...]
    connections: tuple[Connection, ...] = ()
    dialect: Dialect = Dialect.A
    dh_form: DHForm = DHForm.CRAIG
    adjacencies: tuple[tuple[int, int], ...] = ()
    label: str | None = None
    velocity_bounds: VelocityBounds | None = None
    controls: tuple[tuple[float, ...], ...] = ()
    actuators: tuple[Actuator, ...] = ()
    robot_file: str | None = None
    span: Span | None = _span()

    @property
    def moves(self) -> bool:
        """Whether its tag makes it a robot."""
        return self.kind in (MultiBodyKind.ACTIVE, MultiBodyKind.NON_HOLONOMIC)


class BoundaryShape(StrEnum):
    """The word after `Boundary`."""

    BOX = "Box"
    BOX2D = "Box2D"
    SPHERE = "Sphere"
    SPHERE2D = "Sphere2D"


@dataclass(frozen=True, slots=True)
class Boundary:
    """The region that every vertex of a robot stays in, closed.

    Attributes:
        shape: Box or ball, 2-D or 3-D.
        lower, upper: Corners of a box, one entry per bounded axis; empty for a ball.
        center, radius: Those of a ball, the centre with one entry per bounded axis; empty and 0 for a box.
        space: `workspace`, or `cspace` where an XML file says so.
    """

    shape: BoundaryShape
    lower: tuple[float, ...] = ()
    upper: tuple[float, ...] = ()
    center: tuple[float, ...] = ()
    radius: float = 0.0
    space: str = "workspace"
    span: Span | None = _span()


@dataclass(frozen=True, slots=True)
class Resolution:
    """The planner's step sizes, each None where the file has none.

    Attributes:
        position: `PositionRes`, file units.
        orientation: `Orientation`, radians.
        position_factor, time, rd: `PositionResFactor`, `TimeRes`, `RDRes`.
        span: Where `position` stands.
    """

    position: float | None = None
    position_factor: float | None = None
    orientation: float | None = None
    time: float | None = None
    rd: float | None = None
    span: Span | None = _span()


@dataclass(frozen=True, slots=True)
class Task:
    """Configurations in the file's numbers that `robots` (indices) visit in turn, together: theirs side by side."""

    robots: tuple[int, ...]
    configurations: tuple[tuple[float, ...], ...]
    label: str = ""
    span: Span | None = _span()

    @property
    def robot(self) -> int:
        """The first of its robots."""
        return self.robots[0]


@dataclass(frozen=True, slots=True)
class Comment:
    """A comment line, kept so that it can be written back."""

    text: str
    span: Span | None = _span()


@dataclass(frozen=True, slots=True)
class PlannerRules:
    """What a problem XML says about collision pairs; None where it says nothing."""

    ignore_self_collision: bool | None = None
    adjacent_links: int | None = None


@dataclass(frozen=True, slots=True)
class Environment:
    """A whole scene in the words of its files.

    Attributes:
        name: Stem of the file that it was read from.
        dialect: The dialect that the environment file is written in.
        multibodies: In file order; robots of separate files come last.
        boundary: None in dialects A and B.
        resolution: The planner's step sizes.
        tasks: From a query file or a problem XML.
        semantics: Whose reading of a dialect A connection was applied.
        declared_multibodies: The count that the file declares.
        attributes: Attributes of an `<Environment>` node, as text.
        planner_rules: What a problem XML says about collision pairs.
        comments: All comment lines.
        directory: Folder that mesh files are relative to.
        path: The file, as it was named by the caller.
        sources: All files that it was read from, robots and queries, too; nothing that is written replaces one.
        diagnostics: What the readers found.
        xml: Whether the file that describes the environment is XML.
    """

    name: str
    dialect: Dialect
    multibodies: tuple[MultiBody, ...] = field(repr=False)
    boundary: Boundary | None = field(default=None, repr=False)
    resolution: Resolution = field(default=Resolution(), repr=False)
    tasks: tuple[Task, ...] = field(default=(), repr=False)
    semantics: str = "planner"
    declared_multibodies: int | None = None
    attributes: tuple[tuple[str, str], ...] = field(default=(), repr=False)
    planner_rules: PlannerRules = field(default=PlannerRules(), repr=False)
    comments: tuple[Comment, ...] = field(default=(), compare=False, repr=False)
    directory: Path = field(default=Path(), compare=False, repr=False)
    path: str = field(default="", compare=False)
    sources: tuple[str, ...] = field(default=(), compare=False, repr=False)
    diagnostics: tuple[Diagnostic, ...] = field(default=(), compare=False, repr=False)
    xml: bool = field(default=False, compare=False)

    @property
    def robots(self) -> tuple[MultiBody, ...]:
        """The robots: every Active multibody; without one, multibody 0 of a dialect A file."""
        moving = tuple(m for m in self.multibodies if m.moves)
        return self.multibodies[:1] if not moving and self.dialect is Dialect.A else moving

    @property
    def obstacles(self) -> tuple[MultiBody, ...]:
        """Everything that is neither a robot nor a Surface."""
        others = {id(m) for m in (*self.robots, *self.surfaces)}
        return tuple(m for m in self.multibodies if id(m) not in others)

    @property
    def surfaces(self) -> tuple[MultiBody, ...]:
        """Surface multibodies: drawn, never collided with."""
        return tuple(m for m in self.multibodies if m.kind is MultiBodyKind.SURFACE)
