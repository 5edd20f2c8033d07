"""How each dialect reads, as a table (env-format sections 2, 9 and 12)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from .model import DHForm, Dialect, Recentring


class JointOrder(StrEnum):
    """Which connection the n-th joint value belongs to (env-format sections 8.4 and 9.5)."""

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
        tests_fixed_base: Whether a robot's fixed base is tested against obstacles (section 11).
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
