"""Refuses chains of links that no MJCF can hold: MuJoCo nests the bodies of a chain, and its parser has a bound.

MERGED: Says what a scene holds that has no meaning in its MJCF: nothing is dropped in silence.
"""

from __future__ import annotations

from ..diagnostics import DiagnosticLog
from ..kinematics.tree import build_tree
from ..model.environment import Environment, MultiBody
from ..options import Options
from .scenery import gravity_of_file

# MuJoCo's XML parser refuses the 500th element within others: <mujoco> and <worldbody> are around the bodies, and
# geoms in the last.
_MOST_LINKS = 496


def refuse_long_chains(environment: Environment, log: DiagnosticLog) -> None:
    """Make sure that no link has too many others before it.

    Raises:
        ConversionError: One has.
        KinematicsError: The bodies of a robot do not hang together.
    """
    for robot in environment.robots:
        _refuse(robot, log)


def _refuse(robot: MultiBody, log: DiagnosticLog) -> None:
    # The readers have said already what is doubtful about it.
    tree = build_tree(robot, DiagnosticLog())
    depth: dict[int, int] = {}
    for body in tree.order:
        k = tree.parent[body]
        depth[body] = 1 if k is None else depth[robot.connections[k].previous] + 1
        if k is not None and depth[body] > _MOST_LINKS:
            name = robot.bodies[body].filename
            message = (
                f"this connection leads to link {depth[body]} of a chain; MuJoCo's XML parser reads at most "
                f"{_MOST_LINKS} bodies within each other"
            )
            hint = "make the chain shorter, or a robot of its own of a part"
            log.fail("MJC403", name, message, hint=hint, span=robot.connections[k].span)


# Attributes of an <Environment> node that concern the planner's own simulation.
_PHYSICS = ("gravity", "frictionCoefficient")


def report_unused(environment: Environment, options: Options, log: DiagnosticLog) -> None:
    """Report textures, controls and physical attributes, which are kept and not written, and options without effect."""
    if options.boundary is not None and environment.boundary is None:
        log.info("MJC415", environment.name, f"boundary={options.boundary!r} has no effect: the scene has no boundary")
    attributes = dict(environment.attributes)
    for name in _PHYSICS:
        followed = name == "gravity" and options.gravity is None and any(gravity_of_file(environment) or ())
        if name in attributes and not followed:
            log.info(
                "MJC412",
                name,
                f"{name}={attributes[name]!r} of the file is the planner's, and is not written",
                hint="give gravity=(x, y, z) (--gravity)" if name == "gravity" else "",
            )
    for multibody in environment.multibodies:
        if multibody.controls or multibody.velocity_bounds:
            log.info(
                "MJC413",
                "NonHolonomic",
                f"{len(multibody.controls)} controls and the velocity bounds of the robot are kept, not written",
                span=multibody.span,
            )
        for body in multibody.bodies:
            if body.texture is not None:
                log.info("MJC414", body.filename, f"texture {body.texture!r} is kept, not drawn", span=body.span)
