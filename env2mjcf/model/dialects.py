"""How each dialect reads, as a table (env-format sections 2, 9 and 12)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from .environment import BoundaryShape, DHForm, Dialect, Environment, JointType, MultiBodyKind, Recentring


class JointOrder(StrEnum):
    """Which connection the n-th joint value belongs to (docs/format/kinematics.md)."""

    BODY = "body"  # A: the first backward connection of body 1, 2, ...; file order where the robot has loops
    FILE = "file"  # B to D
    PARENT_CHILD = "parent-child"  # E: sorted by (parent, child)


@dataclass(frozen=True, slots=True)
class DialectRules:
    """What differs between dialects.

    Attributes:
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
    """

    pose_angle: float
    dh_angle: float
    configuration_angle: float
    dh_form: DHForm
    connection_fields: tuple[str, ...]
    joint_order: JointOrder
    hinges_are_periodic: bool
    recentring: Recentring
    keyword_case: bool
    plural_connections: bool
    needs_final_newline: bool
    tests_fixed_base: bool


_LATER_FIELDS = ("joint", "limits", "to_dh", "dh", "to_body")


def _later(joint_order: JointOrder, dh_form: DHForm, plural: bool) -> DialectRules:
    return DialectRules(
        pose_angle=math.pi / 180,
        dh_angle=1.0,
        configuration_angle=math.pi,
        dh_form=dh_form,
        connection_fields=_LATER_FIELDS,
        joint_order=joint_order,
        hinges_are_periodic=False,
        recentring=Recentring.COM,
        keyword_case=False,
        plural_connections=plural,
        needs_final_newline=True,
        tests_fixed_base=True,
    )


RULES: dict[Dialect, DialectRules] = {
    Dialect.A: DialectRules(
        pose_angle=math.pi / 180,
        dh_angle=math.pi / 180,
        configuration_angle=2 * math.pi,
        dh_form=DHForm.CRAIG,
        connection_fields=("actuated", "to_body", "dh", "joint", "to_dh"),
        joint_order=JointOrder.BODY,
        hinges_are_periodic=True,
        recentring=Recentring.COM,
        keyword_case=True,
        plural_connections=False,
        needs_final_newline=False,
        tests_fixed_base=False,
    ),
    Dialect.B: _later(JointOrder.FILE, DHForm.CRAIG, plural=False),
    Dialect.C: _later(JointOrder.FILE, DHForm.CRAIG, plural=False),
    Dialect.D: _later(JointOrder.FILE, DHForm.CRAIG, plural=True),
    Dialect.E: _later(JointOrder.PARENT_CHILD, DHForm.STANDARD, plural=True),
}


class SurfaceLabels(StrEnum):
    """Whether the original reader takes a label after `Surface` (docs/format/env.md)."""

    NONE = "none"
    OPTIONAL = "optional"
    REQUIRED = "required"


@dataclass(frozen=True, slots=True)
class Vocabulary:
    """What the original reader of a dialect takes, beyond meshes, poses and connections.

    Attributes:
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

    boundaries: frozenset[BoundaryShape]
    brackets: bool
    resolution: tuple[str, ...]
    kinds: frozenset[MultiBodyKind]
    joints: frozenset[JointType]
    limits: bool
    options: bool
    mass: bool
    adjacencies: bool
    surface_labels: SurfaceLabels = SurfaceLabels.NONE
    robot_files: bool = False
    query_index: bool = True
    legacy_layout: bool = False


_LATER_JOINTS = frozenset({JointType.REVOLUTE, JointType.SPHERICAL, JointType.NON_ACTUATED})
_OBSTACLES = frozenset({MultiBodyKind.PASSIVE, MultiBodyKind.INTERNAL})
_LATER_KINDS = _OBSTACLES | {MultiBodyKind.ACTIVE, MultiBodyKind.SURFACE}

VOCABULARIES: dict[Dialect, Vocabulary] = {
    Dialect.A: Vocabulary(
        boundaries=frozenset(),
        brackets=False,
        resolution=(),
        kinds=_OBSTACLES | {MultiBodyKind.ACTIVE},
        joints=frozenset({JointType.REVOLUTE, JointType.PRISMATIC}),
        limits=False,
        options=False,
        mass=False,
        adjacencies=False,
        query_index=False,
        legacy_layout=True,
    ),
    Dialect.B: Vocabulary(
        boundaries=frozenset(),
        brackets=False,
        resolution=(),
        kinds=_LATER_KINDS,
        joints=_LATER_JOINTS,
        limits=False,
        options=False,
        mass=False,
        adjacencies=False,
    ),
    Dialect.C: Vocabulary(
        boundaries=frozenset({BoundaryShape.BOX, BoundaryShape.SPHERE}),
        brackets=False,
        resolution=(),
        kinds=frozenset(MultiBodyKind),
        joints=_LATER_JOINTS | {JointType.SMA},
        limits=True,
        options=False,
        mass=False,
        adjacencies=False,
        surface_labels=SurfaceLabels.OPTIONAL,
    ),
    Dialect.D: Vocabulary(
        boundaries=frozenset(BoundaryShape),
        brackets=True,
        resolution=("position", "position_factor", "orientation", "time", "rd"),
        kinds=frozenset(MultiBodyKind),
        joints=_LATER_JOINTS | {JointType.SMA},
        limits=True,
        options=True,
        mass=True,
        adjacencies=True,
        surface_labels=SurfaceLabels.REQUIRED,
    ),
    Dialect.E: Vocabulary(
        boundaries=frozenset(BoundaryShape),
        brackets=True,
        resolution=("position", "orientation", "time"),
        kinds=_OBSTACLES,
        joints=_LATER_JOINTS,
        limits=True,
        options=True,
        mass=False,
        adjacencies=True,
        robot_files=True,
        query_index=False,
    ),
}


def begins_with_robot(environment: Environment) -> bool:
    """Say whether configurations in files begin with the index of their robot.

    They do in dialects B to D, and where there are several robots, which nothing else would tell apart.
    """
    return VOCABULARIES[environment.dialect].query_index or len(environment.robots) > 1
