"""How each dialect reads and what it can say, as one table (docs/format/env.md, docs/format/kinematics.md)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

from .environment import BoundaryShape, DHForm, Dialect, Environment, JointType, MultiBodyKind, Recentring


class JointOrder(StrEnum):
    """Which connection the n-th joint value belongs to (docs/format/kinematics.md)."""

    BODY = "body"  # A: the first backward connection of body 1, 2, ...; file order where the robot has loops
    FILE = "file"  # B to D
    PARENT_CHILD = "parent-child"  # E: sorted by (parent, child)


class SurfaceLabels(StrEnum):
    """Whether the original reader takes a label after `Surface` (docs/format/env.md)."""

    NONE = "none"
    OPTIONAL = "optional"
    REQUIRED = "required"


_OBSTACLES = frozenset({MultiBodyKind.PASSIVE, MultiBodyKind.INTERNAL})
_JOINTS = frozenset({JointType.REVOLUTE, JointType.SPHERICAL, JointType.NON_ACTUATED})


@dataclass(frozen=True, slots=True, kw_only=True)
class DialectRules:
    """What differs between dialects; the defaults are those of dialect B, from which C to E grew.

    Attributes:
        dialect: The dialect.
        pose_angle: Radians per unit of a pose angle.
        dh_angle: Radians per unit of a DH angle.
        configuration_angle: Radians per unit of a configuration's angle.
        dh_form: The product that a DH row stands for.
        connection_fields: Order of the fields of a connection, after its two body indices.
        joint_order: Order of joint values in a configuration.
        hinges_are_periodic: Whether every hinge turns freely; else its limits are an interval.
        recentring: What is subtracted from a mesh's vertices by default.
        keyword_case: Whether the original reader compares the case of keywords.
        plural_connections: Whether the original reader insists on `Connections`.
        needs_final_newline: Whether the original reader fails on a file that ends with its last token.
        tests_fixed_base: Whether a robot's fixed base is tested against obstacles.
        boundaries: Shapes of a boundary; none where the file has no boundary.
        brackets: Whether the boundary stands in brackets.
        resolution: Fields of `Resolution`.
        kinds: Multibodies of an environment file; robots of dialect E have files of their own.
        joints: Types of joints.
        limits: Whether joints have limits.
        options: Whether bodies have options: recentring, colour, texture.
        mass: Whether a robot's bodies have masses.
        adjacencies: Whether robots have `Adjacencies`.
        surface_labels: Whether surfaces have labels.
        robot_files: Whether each robot has a file of its own.
        query_index: Whether each configuration of a query or path begins with the index of its robot.
        legacy_layout: Whether multibodies are laid out as in dialect A: obstacles may have many bodies, a free base has
            a pose, and connections have their joints in another line.
    """

    dialect: Dialect
    pose_angle: float = math.pi / 180
    dh_angle: float = 1.0
    configuration_angle: float = math.pi
    dh_form: DHForm = DHForm.CRAIG
    connection_fields: tuple[str, ...] = ("joint", "limits", "to_dh", "dh", "to_body")
    joint_order: JointOrder = JointOrder.FILE
    hinges_are_periodic: bool = False
    recentring: Recentring = Recentring.COM
    keyword_case: bool = False
    plural_connections: bool = False
    needs_final_newline: bool = True
    tests_fixed_base: bool = True
    boundaries: frozenset[BoundaryShape] = frozenset()
    brackets: bool = False
    resolution: tuple[str, ...] = ()
    kinds: frozenset[MultiBodyKind] = _OBSTACLES | {MultiBodyKind.ACTIVE, MultiBodyKind.SURFACE}
    joints: frozenset[JointType] = _JOINTS
    limits: bool = False
    options: bool = False
    mass: bool = False
    adjacencies: bool = False
    surface_labels: SurfaceLabels = SurfaceLabels.NONE
    robot_files: bool = False
    query_index: bool = True
    legacy_layout: bool = False


_TABLE = (
    DialectRules(
        dialect=Dialect.A,
        dh_angle=math.pi / 180,
        configuration_angle=2 * math.pi,
        connection_fields=("actuated", "to_body", "dh", "joint", "to_dh"),
        joint_order=JointOrder.BODY,
        hinges_are_periodic=True,
        keyword_case=True,
        needs_final_newline=False,
        tests_fixed_base=False,
        kinds=_OBSTACLES | {MultiBodyKind.ACTIVE},
        joints=frozenset({JointType.REVOLUTE, JointType.PRISMATIC}),
        query_index=False,
        legacy_layout=True,
    ),
    DialectRules(dialect=Dialect.B),
    DialectRules(
        dialect=Dialect.C,
        boundaries=frozenset({BoundaryShape.BOX, BoundaryShape.SPHERE}),
        kinds=frozenset(MultiBodyKind),
        joints=_JOINTS | {JointType.SMA},
        limits=True,
        surface_labels=SurfaceLabels.OPTIONAL,
    ),
    DialectRules(
        dialect=Dialect.D,
        plural_connections=True,
        boundaries=frozenset(BoundaryShape),
        brackets=True,
        resolution=("position", "position_factor", "orientation", "time", "rd"),
        kinds=frozenset(MultiBodyKind),
        joints=_JOINTS | {JointType.SMA},
        limits=True,
        options=True,
        mass=True,
        adjacencies=True,
        surface_labels=SurfaceLabels.REQUIRED,
    ),
    DialectRules(
        dialect=Dialect.E,
        dh_form=DHForm.STANDARD,
        joint_order=JointOrder.PARENT_CHILD,
        plural_connections=True,
        boundaries=frozenset(BoundaryShape),
        brackets=True,
        resolution=("position", "orientation", "time"),
        kinds=_OBSTACLES,
        limits=True,
        options=True,
        adjacencies=True,
        robot_files=True,
        query_index=False,
    ),
)
RULES: dict[Dialect, DialectRules] = {rules.dialect: rules for rules in _TABLE}


def rules_of(dialect: Dialect, semantics: str = "planner") -> DialectRules:
    """Return a dialect's rules; `page` swaps dialect A's two transforms and takes standard DH rows."""
    rules = RULES[dialect]
    if semantics != "page" or dialect is not Dialect.A:
        return rules
    return replace(rules, connection_fields=("actuated", "to_dh", "dh", "joint", "to_body"), dh_form=DHForm.STANDARD)


def begins_with_robot(environment: Environment) -> bool:
    """Say whether configurations in files begin with the index of their robot.

    They do in dialects B to D, and where there are several robots, which nothing else would tell apart.
    """
    return RULES[environment.dialect].query_index or len(environment.robots) > 1
