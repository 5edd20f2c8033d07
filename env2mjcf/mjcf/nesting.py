"""Refuses chains of links that no MJCF can hold: MuJoCo nests the bodies of a chain, and its parser has a bound."""

from __future__ import annotations

from ..dofs import build_tree
from ..errors import ConversionError, DiagnosticLog
from ..model import Environment, MultiBody

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
            log.fail(
                ConversionError, "MJC403", name,
                f"this connection leads to link {depth[body]} of a chain; MuJoCo's XML parser reads at most "
                f"{_MOST_LINKS} bodies within each other",
                hint="make the chain shorter, or a robot of its own of a part", span=robot.connections[k].span,
            )  # fmt: skip
