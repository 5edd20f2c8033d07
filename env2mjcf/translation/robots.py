"""Robots, obstacles, their bodies, and configurations of robots in another dialect."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from ..diagnostics import DiagnosticLog
from ..kinematics.forward import RobotKinematics
from ..kinematics.tree import Dof, DofKind, build_tree
from ..model.dialects import RULES, SurfaceLabels
from ..model.environment import BaseKind, Body, MultiBody, MultiBodyKind, Pose, Recentring, Task
from ..transforms import Array, wrap
from .connections import connections, six_numbers, swaps_angles
from .scene_parts import Losses


def translate_robot(source: MultiBody, meets_obstacles: bool, losses: Losses) -> MultiBody:
    """Return a robot; its bodies and connections keep their places.

    Args:
        source: The robot.
        meets_obstacles: Whether the scene has obstacles.
        losses: Where losses are reported.

    Raises:
        ConversionError: The dialect cannot express how its links move.
        KinematicsError: A body is neither a base nor reached from one.
    """
    source = _without_controls(source, losses)
    if meets_obstacles:
        _report_fixed_base(source, losses)
    _report_bases(source, losses)
    if source.adjacencies and not losses.rules.adjacencies:
        message = (
            f"dialect {losses.dialect} has no adjacencies; these {len(source.adjacencies)} "
            "are lost, so that those links are tested"
        )
        losses.lost("ENV172", "Adjacencies", message, hint="exclude them with exclude_pairs", span=source.span)
    if source.actuators:
        message = "text files have no actuators; they are lost"
        losses.lost("ENV177", "<Actuator>", message, span=source.actuators[0].span)
    if source.label is not None:
        message = f"text files have no labels of robots; {source.label!r} is lost"
        losses.lost("ENV177", source.label, message, span=source.span)
    return replace(
        source,
        bodies=_bodies(source, losses),
        connections=connections(source, losses),
        dialect=losses.dialect,
        dh_form=losses.rules.dh_form,
        adjacencies=source.adjacencies if losses.rules.adjacencies else (),
        label=None,
        actuators=(),
        robot_file=None,
    )


def translate_obstacles(source: MultiBody, losses: Losses) -> Iterator[MultiBody]:
    """Yield an obstacle or a surface; dialects B to E have one multibody for each body."""
    if source.dialect is losses.dialect and losses.rules.legacy_layout:
        yield replace(source, connections=connections(source, losses), dh_form=losses.rules.dh_form)
        return
    kinematics = RobotKinematics.of(source)
    placed = kinematics.forward(kinematics.home())
    for body, matrix in zip(source.bodies, placed, strict=True):
        fixed = body.base is BaseKind.FIXED and body.pose is not None
        pose = body.pose if fixed and body.pose is not None else six_numbers(matrix)
        yield replace(
            source,
            bodies=(_static_body(body, pose, losses),),
            connections=(),
            dialect=losses.dialect,
            dh_form=losses.rules.dh_form,
            label=_label(source, losses),
        )


def _bodies(source: MultiBody, losses: Losses) -> tuple[Body, ...]:
    if source.dialect is losses.dialect and losses.rules.legacy_layout:
        return source.bodies
    bases = build_tree(source, DiagnosticLog()).bases
    bodies = [_robot_body(b, bases.get(i, BaseKind.JOINT), i == 0, losses) for i, b in enumerate(source.bodies)]
    if losses.rules.legacy_layout:
        fixed = [b.base is BaseKind.FIXED for b in bodies]
        bodies = [replace(b, index=fixed[:i].count(fixed[i])) for i, b in enumerate(bodies)]
    return tuple(bodies)


def _label(source: MultiBody, losses: Losses) -> str | None:
    if source.kind is not MultiBodyKind.SURFACE:
        return None
    labels = losses.rules.surface_labels
    if labels is SurfaceLabels.REQUIRED and source.dialect is not losses.dialect:
        return source.label or "surface"
    if labels is not SurfaceLabels.NONE:
        return source.label
    if source.label is not None:
        losses.lost("ENV170", source.label, f"dialect {losses.dialect} has no labels of surfaces", span=source.span)
    return None


def _without_controls(source: MultiBody, losses: Losses) -> MultiBody:
    if source.kind in losses.rules.kinds or source.kind is MultiBodyKind.ACTIVE:
        return source if source.moves else replace(source, kind=MultiBodyKind.ACTIVE)
    if source.kind is MultiBodyKind.NON_HOLONOMIC:
        message = (
            f"dialect {losses.dialect} has no NonHolonomic robots; written as Active, "
            "without controls and velocity bounds"
        )
        losses.lost("ENV173", "NonHolonomic", message, span=source.span)
    return replace(source, kind=MultiBodyKind.ACTIVE, velocity_bounds=None, controls=())


def _report_bases(source: MultiBody, losses: Losses) -> None:
    bases = [b for b in source.bodies if b.base is not BaseKind.JOINT]
    if losses.rules.robot_files and source.dialect is not losses.dialect and len(bases) > 1:
        message = f"a robot with {len(bases)} bases; the planner of dialect {losses.dialect} takes one"
        losses.lost("ENV176", bases[1].filename, message, hint="split the robot", span=bases[1].span)


def _report_fixed_base(source: MultiBody, losses: Losses) -> None:
    before, after = RULES[source.dialect].tests_fixed_base, losses.rules.tests_fixed_base
    fixed = next((b for b in source.bodies if b.base is BaseKind.FIXED), None)
    if before != after and fixed is not None:
        change = "is tested" if after else "is not tested"
        message = (
            f"the fixed base {fixed.filename} {change} against obstacles in dialect "
            f"{losses.dialect}, unlike in dialect {source.dialect}"
        )
        losses.lost("ENV175", fixed.filename, message, span=fixed.span)


_WORD = re.compile(r"[^\s#]\S*")


def _robot_body(body: Body, base: BaseKind, first: bool, losses: Losses) -> Body:
    """Return one body of a robot.

    Args:
        body: The body.
        base: How it is carried, whatever its tag says.
        first: Whether it is body 0.
        losses: Where losses are reported.
    """
    dressed = _dressed(body, losses)
    if not losses.rules.legacy_layout:
        _report_home(body, base, losses)
        return replace(dressed, base=base, index=None, pose=(body.pose or Pose()) if base is BaseKind.FIXED else None)
    # Dialect A's first FreeBody is a free base, every other one a link.
    free = BaseKind.VOLUMETRIC_ROTATIONAL if first else BaseKind.JOINT
    if base not in (free, BaseKind.FIXED):
        message = (
            f"a {base.value} base of {body.filename}; in dialect A the first body moves "
            "freely or is fixed, and all others hang on connections or are fixed"
        )
        losses.refuse("ENV167", body.filename, message, hint="choose another dialect", span=body.span)
    # A free base has a pose there, its home; other dialects' free bases are at home at the origin.
    return replace(dressed, base=base, pose=body.pose or Pose() if first or base is BaseKind.FIXED else None)


def _static_body(body: Body, pose: Pose, losses: Losses) -> Body:
    """Return the body of an obstacle or a surface."""
    dressed = _dressed(body, losses)
    return replace(dressed, base=BaseKind.FIXED, pose=pose, index=0 if losses.rules.legacy_layout else None)


def _dressed(body: Body, losses: Losses) -> Body:
    """Return a body without the options that the dialect does not have."""
    name, span, dialect = body.filename, body.span, losses.dialect
    if not _WORD.fullmatch(name):
        message = f"the file name {name!r} is not a single word, as names in text files are"
        losses.refuse("ENV178", name, message, hint="rename the mesh file", span=span)
    if body.mass is not None and not losses.rules.mass:
        message = f"dialect {dialect} has no masses; the mass {body.mass:g} of {name} is lost"
        losses.lost("ENV170", name, message, span=span)
        body = replace(body, mass=None)
    if losses.rules.options:
        return body
    if body.recentring is not Recentring.COM:
        message = (
            f"dialect {dialect} always moves the mean of a mesh's vertices to the origin, and {name} has the "
            f"adjustment {body.recentring.value}"
        )
        hint = "move the mean of its vertices into the origin, or choose dialect D or E"
        losses.refuse("ENV169", name, message, hint=hint, span=span)
    return _without_paint(body, losses)


def _without_paint(body: Body, losses: Losses) -> Body:
    """Keep as much of a colour as the visualiser's comment holds."""
    name, color = body.filename, body.color
    if body.texture is not None:
        losses.lost("ENV170", name, f"dialect {losses.dialect} has no textures; {body.texture} is lost", span=body.span)
    if color is not None and not all(0 <= c <= 1 for c in color):
        losses.lost("ENV170", name, "a colour beyond 0 to 1 cannot be written as a comment; it is lost", span=body.span)
        color = None
    if color is not None and color[3] != 1:
        losses.lost("ENV170", name, f"dialect {losses.dialect} has opaque colours only", span=body.span)
        color = (*color[:3], 1.0)
    return replace(body, texture=None, color=color)


def _report_home(body: Body, base: BaseKind, losses: Losses) -> None:
    if base in (BaseKind.FIXED, BaseKind.JOINT) or body.pose is None or body.pose == Pose():
        return
    message = f"dialect {losses.dialect} has no pose for a free base: {body.filename} is at home at the origin there"
    hint = "a query file holds where the robot starts"
    losses.lost("ENV168", body.filename, message, hint=hint, span=body.pose.span or body.span)


_OTHER = {DofKind.THETA: DofKind.ALPHA, DofKind.ALPHA: DofKind.THETA}


@dataclass(frozen=True, slots=True)
class DofMap:
    """From a robot's configurations to those of its translation.

    Attributes:
        source, target: The robot before and after.
        order: For each degree of freedom of the target, which one of the source it is.
    """

    source: RobotKinematics = field(repr=False)
    target: RobotKinematics = field(repr=False)
    order: tuple[int, ...]

    @classmethod
    def of(cls, source: MultiBody, target: MultiBody) -> DofMap:
        """Pair the degrees of freedom of a robot and its translation."""
        before, after = RobotKinematics.of(source), RobotKinematics.of(target)
        places = {(d.connection, d.body, d.kind): i for i, d in enumerate(before.dofs)}
        return cls(before, after, tuple(places[_key(d, source, target)] for d in after.dofs))

    def q(self, q: ArrayLike) -> Array:
        """Turn configurations (..., dim), in radians and lengths, into those of the target.

        Angles that turned without end and now have limits are reduced by whole turns.
        """
        values = np.array(q, dtype=np.float64)[..., list(self.order)]
        for i, (dof, old) in enumerate(zip(self.target.dofs, self.order, strict=True)):
            if self.source.dofs[old].periodic and not dof.periodic:
                values[..., i] = wrap(values[..., i])
        return values

    def numbers(self, configuration: Sequence[float]) -> tuple[float, ...]:
        """Turn one configuration from the source's own numbers into the target's."""
        before, after = (RULES[k.multibody.dialect].configuration_angle for k in (self.source, self.target))
        ratio, half_turn = before / after, math.pi / after
        found: list[float] = []
        for dof, old in zip(self.target.dofs, self.order, strict=True):
            value = float(configuration[old])
            if not dof.kind.is_length:
                value *= ratio
                # Turns go from 0 to 1, and pi units from -1 to 1.
                if ratio > 1 and self.source.dofs[old].periodic:
                    value -= 2 * half_turn * math.floor(value / (2 * half_turn) + 0.5)
                    # 1.8 - 2 is not quite -0.2.
                    near = round(value, 12)
                    value = near if abs(near - value) < 4e-16 else value
            found.append(value)
        return tuple(found)

    def task(self, task: Task) -> Task:
        """Turn the configurations of a task of this robot alone into the target's numbers."""
        return Task(task.robots, tuple(self.numbers(c) for c in task.configurations), task.label, task.span)


def _key(dof: Dof, source: MultiBody, target: MultiBody) -> tuple[int | None, int, DofKind]:
    if dof.connection is None:
        return None, dof.body, dof.kind
    swapped = swaps_angles(source.connections[dof.connection], source.dh_form, target.dh_form)
    return dof.connection, dof.body, _OTHER[dof.kind] if swapped else dof.kind
