"""Robots, obstacles and surfaces in another dialect.

MERGED: Bodies in another dialect.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

from ..diagnostics import DiagnosticLog
from ..kinematics.forward import RobotKinematics
from ..kinematics.tree import build_tree
from ..model.dialects import RULES, SurfaceLabels
from ..model.environment import BaseKind, Body, MultiBody, MultiBodyKind, Pose, Recentring
from .connections import connections, six_numbers
from .losses import Losses


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
        losses.lost(
            "ENV172",
            "Adjacencies",
            f"dialect {losses.dialect} has no adjacencies; these {len(source.adjacencies)} "
            "are lost, so that those links are tested",
            "exclude them with exclude_pairs",
            source.span,
        )
    if source.actuators:
        losses.lost("ENV177", "<Actuator>", "text files have no actuators; they are lost", "", source.actuators[0].span)
    if source.label is not None:
        losses.lost(
            "ENV177", source.label, f"text files have no labels of robots; {source.label!r} is lost", "", source.span
        )
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
            bodies=(static_body(body, pose, losses),),
            connections=(),
            dialect=losses.dialect,
            dh_form=losses.rules.dh_form,
            label=_label(source, losses),
        )


def _bodies(source: MultiBody, losses: Losses) -> tuple[Body, ...]:
    if source.dialect is losses.dialect and losses.rules.legacy_layout:
        return source.bodies
    bases = build_tree(source, DiagnosticLog()).bases
    bodies = [robot_body(b, bases.get(i, BaseKind.JOINT), i == 0, losses) for i, b in enumerate(source.bodies)]
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
        losses.lost("ENV170", source.label, f"dialect {losses.dialect} has no labels of surfaces", "", source.span)
    return None


def _without_controls(source: MultiBody, losses: Losses) -> MultiBody:
    if source.kind in losses.rules.kinds or source.kind is MultiBodyKind.ACTIVE:
        return source if source.moves else replace(source, kind=MultiBodyKind.ACTIVE)
    if source.kind is MultiBodyKind.NON_HOLONOMIC:
        losses.lost(
            "ENV173",
            "NonHolonomic",
            f"dialect {losses.dialect} has no NonHolonomic robots; written as Active, "
            "without controls and velocity bounds",
            "",
            source.span,
        )
    return replace(source, kind=MultiBodyKind.ACTIVE, velocity_bounds=None, controls=())


def _report_bases(source: MultiBody, losses: Losses) -> None:
    bases = [b for b in source.bodies if b.base is not BaseKind.JOINT]
    if losses.rules.robot_files and source.dialect is not losses.dialect and len(bases) > 1:
        losses.lost(
            "ENV176",
            bases[1].filename,
            f"a robot with {len(bases)} bases; the planner of dialect {losses.dialect} takes one",
            "split the robot",
            bases[1].span,
        )


def _report_fixed_base(source: MultiBody, losses: Losses) -> None:
    before, after = RULES[source.dialect].tests_fixed_base, losses.rules.tests_fixed_base
    fixed = next((b for b in source.bodies if b.base is BaseKind.FIXED), None)
    if before != after and fixed is not None:
        change = "is tested" if after else "is not tested"
        losses.lost(
            "ENV175",
            fixed.filename,
            f"the fixed base {fixed.filename} {change} against obstacles in dialect "
            f"{losses.dialect}, unlike in dialect {source.dialect}",
            "",
            fixed.span,
        )


_WORD = re.compile(r"[^\s#]\S*")


def robot_body(body: Body, base: BaseKind, first: bool, losses: Losses) -> Body:
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
        losses.refuse(
            "ENV167",
            body.filename,
            f"a {base.value} base of {body.filename}; in dialect A the first body moves "
            "freely or is fixed, and all others hang on connections or are fixed",
            "choose another dialect",
            body.span,
        )
    # A free base has a pose there, its home; other dialects' free bases are at home at the origin.
    return replace(dressed, base=base, pose=body.pose or Pose() if first or base is BaseKind.FIXED else None)


def static_body(body: Body, pose: Pose, losses: Losses) -> Body:
    """Return the body of an obstacle or a surface."""
    dressed = _dressed(body, losses)
    return replace(dressed, base=BaseKind.FIXED, pose=pose, index=0 if losses.rules.legacy_layout else None)


def _dressed(body: Body, losses: Losses) -> Body:
    """Return a body without the options that the dialect does not have."""
    name, span, dialect = body.filename, body.span, losses.dialect
    if not _WORD.fullmatch(name):
        losses.refuse(
            "ENV178",
            name,
            f"the file name {name!r} is no single word, as names in text files are",
            "rename the mesh file",
            span,
        )
    if body.mass is not None and not losses.rules.mass:
        losses.lost(
            "ENV170", name, f"dialect {dialect} has no masses; the mass {body.mass:g} of {name} is lost", "", span
        )
        body = replace(body, mass=None)
    if losses.rules.options:
        return body
    if body.recentring is not Recentring.COM:
        losses.refuse(
            "ENV169",
            name,
            f"{name} is not to be moved to the mean of its vertices ({body.recentring.value}); dialect "
            f"{dialect} always does",
            "move the mean of its vertices into the origin, or choose dialect D or E",
            span,
        )
    return _without_paint(body, losses)


def _without_paint(body: Body, losses: Losses) -> Body:
    """Keep as much of a colour as the visualiser's comment holds."""
    name, color = body.filename, body.color
    if body.texture is not None:
        losses.lost("ENV170", name, f"dialect {losses.dialect} has no textures; {body.texture} is lost", "", body.span)
    if color is not None and not all(0 <= c <= 1 for c in color):
        losses.lost("ENV170", name, "a colour beyond 0 to 1 cannot be written as a comment; it is lost", "", body.span)
        color = None
    if color is not None and color[3] != 1:
        losses.lost("ENV170", name, f"dialect {losses.dialect} has opaque colours only", "", body.span)
        color = (*color[:3], 1.0)
    return replace(body, texture=None, color=color)


def _report_home(body: Body, base: BaseKind, losses: Losses) -> None:
    if base in (BaseKind.FIXED, BaseKind.JOINT) or body.pose is None or body.pose == Pose():
        return
    losses.lost(
        "ENV168",
        body.filename,
        f"dialect {losses.dialect} has no pose for a free base: {body.filename} is at home at the origin there",
        "a query file holds where the robot starts",
        body.pose.span or body.span,
    )
