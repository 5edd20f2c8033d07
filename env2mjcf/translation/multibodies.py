"""Robots, obstacles and surfaces in another dialect."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from ..dialects import RULES, SurfaceLabels
from ..dofs import build_tree
from ..errors import DiagnosticLog
from ..kinematics import RobotKinematics
from ..model import BaseKind, Body, MultiBody, MultiBodyKind
from .bodies import robot_body, static_body
from .connections import connections
from .losses import Losses
from .poses import six_numbers


def robot(source: MultiBody, meets_obstacles: bool, losses: Losses) -> MultiBody:
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
    if source.adjacencies and not losses.vocabulary.adjacencies:
        losses.lost(
            "ENV172", "Adjacencies", f"dialect {losses.dialect} has no adjacencies; these {len(source.adjacencies)} "
            "are lost, so that those links are tested", "exclude them with exclude_pairs", source.span,
        )  # fmt: skip
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
        adjacencies=source.adjacencies if losses.vocabulary.adjacencies else (),
        label=None,
        actuators=(),
        robot_file=None,
    )


def obstacles(source: MultiBody, losses: Losses) -> Iterator[MultiBody]:
    """Yield an obstacle or a surface; dialects B to E have one multibody for each body."""
    if source.dialect is losses.dialect and losses.vocabulary.legacy_layout:
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
    if source.dialect is losses.dialect and losses.vocabulary.legacy_layout:
        return source.bodies
    bases = build_tree(source, DiagnosticLog()).bases
    bodies = [robot_body(b, bases.get(i, BaseKind.JOINT), i == 0, losses) for i, b in enumerate(source.bodies)]
    if losses.vocabulary.legacy_layout:
        fixed = [b.base is BaseKind.FIXED for b in bodies]
        bodies = [replace(b, index=fixed[:i].count(fixed[i])) for i, b in enumerate(bodies)]
    return tuple(bodies)


def _label(source: MultiBody, losses: Losses) -> str | None:
    if source.kind is not MultiBodyKind.SURFACE:
        return None
    labels = losses.vocabulary.surface_labels
    if labels is SurfaceLabels.REQUIRED and source.dialect is not losses.dialect:
        return source.label or "surface"
    if labels is not SurfaceLabels.NONE:
        return source.label
    if source.label is not None:
        losses.lost("ENV170", source.label, f"dialect {losses.dialect} has no labels of surfaces", "", source.span)
    return None


def _without_controls(source: MultiBody, losses: Losses) -> MultiBody:
    if source.kind in losses.vocabulary.kinds or source.kind is MultiBodyKind.ACTIVE:
        return source if source.moves else replace(source, kind=MultiBodyKind.ACTIVE)
    if source.kind is MultiBodyKind.NON_HOLONOMIC:
        losses.lost(
            "ENV173", "NonHolonomic", f"dialect {losses.dialect} has no NonHolonomic robots; written as Active, "
            "without controls and velocity bounds", "", source.span,
        )  # fmt: skip
    return replace(source, kind=MultiBodyKind.ACTIVE, velocity_bounds=None, controls=())


def _report_bases(source: MultiBody, losses: Losses) -> None:
    bases = [b for b in source.bodies if b.base is not BaseKind.JOINT]
    if losses.vocabulary.robot_files and source.dialect is not losses.dialect and len(bases) > 1:
        losses.lost(
            "ENV176", bases[1].filename,
            f"a robot with {len(bases)} bases; the planner of dialect {losses.dialect} takes one", "split the robot",
            bases[1].span,
        )  # fmt: skip


def _report_fixed_base(source: MultiBody, losses: Losses) -> None:
    before, after = RULES[source.dialect].tests_fixed_base, losses.rules.tests_fixed_base
    fixed = next((b for b in source.bodies if b.base is BaseKind.FIXED), None)
    if before != after and fixed is not None:
        change = "is tested" if after else "is not tested"
        losses.lost(
            "ENV175", fixed.filename, f"the fixed base {fixed.filename} {change} against obstacles in dialect "
            f"{losses.dialect}, unlike in dialect {source.dialect}", "", fixed.span,
        )  # fmt: skip
