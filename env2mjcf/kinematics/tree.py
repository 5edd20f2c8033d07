"""Which body hangs on which, and which numbers of a configuration move what."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from ..diagnostics import DiagnosticLog
from ..model.dialects import RULES, JointOrder
from ..model.environment import BaseKind, Connection, Dialect, JointType, MultiBody
from ..model.names import unique


class DofKind(StrEnum):
    """What one number of a configuration is."""

    X = "x"
    Y = "y"
    Z = "z"
    RX = "rx"
    RY = "ry"
    RZ = "rz"
    THETA = "theta"
    ALPHA = "alpha"
    D = "d"

    @property
    def is_length(self) -> bool:
        """Whether it is a length; else it is an angle."""
        return self in (*POSITIONS, DofKind.D)


POSITIONS = (DofKind.X, DofKind.Y, DofKind.Z)
ROTATIONS = (DofKind.RX, DofKind.RY, DofKind.RZ)


@dataclass(frozen=True, slots=True)
class Dof:
    """One number of a robot's configuration.

    Attributes:
        kind: What it is.
        body: Index of the body that it moves, and is named after.
        connection: Index of its connection; None for a base.
        loop: Whether its connection only closes a loop, so that it moves nothing.
        lower, upper: Limits in radians or lengths; infinite where there are none.
        periodic: Whether it is an angle that may turn without end.
    """

    kind: DofKind
    body: int
    connection: int | None = None
    loop: bool = False
    lower: float = -math.inf
    upper: float = math.inf
    periodic: bool = False


@dataclass(frozen=True, slots=True)
class Tree:
    """How the bodies of a robot hang together (docs/format/kinematics.md).

    Attributes:
        parent: For each body the index of the connection that places it; None for a root.
        loops: Indices of the connections that place no body.
        order: Bodies so that each comes after its parent.
        bases: How each root is carried, by body index.
    """

    parent: tuple[int | None, ...]
    loops: tuple[int, ...]
    order: tuple[int, ...]
    bases: dict[int, BaseKind]


_BASE_DOFS: dict[BaseKind, tuple[DofKind, ...]] = {
    BaseKind.PLANAR_TRANSLATIONAL: (DofKind.X, DofKind.Y),
    BaseKind.PLANAR_ROTATIONAL: (DofKind.X, DofKind.Y, DofKind.RZ),
    BaseKind.VOLUMETRIC_TRANSLATIONAL: POSITIONS,
    BaseKind.VOLUMETRIC_ROTATIONAL: POSITIONS + ROTATIONS,
    BaseKind.FIXED: (),
}

# A spherical joint owns theta, then alpha.
_JOINT_DOFS: dict[JointType, tuple[DofKind, ...]] = {
    JointType.REVOLUTE: (DofKind.THETA,),
    JointType.PRISMATIC: (DofKind.D,),
    JointType.SPHERICAL: (DofKind.THETA, DofKind.ALPHA),
    JointType.NON_ACTUATED: (),
    JointType.SMA: (DofKind.THETA,),
}


def build_tree(multibody: MultiBody, log: DiagnosticLog) -> Tree:
    """Find what places each body: its first backward connection, unless it is a base.

    Bases are protected: a connection that leads back to one closes a loop.

    Raises:
        KinematicsError: A body is neither a base nor reached from one.
    """
    parent: list[int | None] = [None] * len(multibody.bodies)
    bases = {i: b.base for i, b in enumerate(multibody.bodies) if b.base is not BaseKind.JOINT}
    loops: list[int] = []
    for k, connection in enumerate(multibody.connections):
        if connection.next in bases or parent[connection.next] is not None:
            loops.append(k)
        else:
            parent[connection.next] = k
    for i, k in enumerate(parent):
        if k is None and i not in bases:
            _adopt_stray(multibody, i, bases, log)
    return Tree(tuple(parent), tuple(loops), _order(multibody, parent, bases, log), bases)


def degrees_of_freedom(multibody: MultiBody, tree: Tree) -> tuple[Dof, ...]:
    """List the numbers of a robot's configuration in the planner's order (docs/format/kinematics.md)."""
    rules = RULES[multibody.dialect]
    dofs = [
        Dof(kind, body, periodic=not kind.is_length, lower=-_unlimited(kind), upper=_unlimited(kind))
        for body in sorted(tree.bases)
        for kind in _BASE_DOFS[tree.bases[body]]
    ]
    loops = frozenset(tree.loops)
    for k in _joint_order(multibody, tree, rules.joint_order):
        dofs += _joint_dofs(multibody.connections[k], k, k in loops, rules.hinges_are_periodic)
    return tuple(dofs)


def _unlimited(kind: DofKind) -> float:
    return math.inf if kind.is_length else math.pi


def _adopt_stray(multibody: MultiBody, index: int, bases: dict[int, BaseKind], log: DiagnosticLog) -> None:
    body = multibody.bodies[index]
    if multibody.dialect is not Dialect.A:
        message = f"body {index} ({body.filename}) is a Joint, but no connection leads to it"
        hint = "add a connection, or give it a base (Planar, Volumetric, Fixed)"
        log.fail("KIN301", body.filename, message, hint=hint, span=body.span)
    place = "the origin" if body.pose is None else "its own pose"
    message = f"no connection leads to FreeBody {index} ({body.filename}): it is a base of its own, at home at {place}"
    hint = "the original planner has no numbers for it in a configuration; is a connection missing?"
    log.warn("KIN302", body.filename, message, hint=hint, span=body.span)
    bases[index] = BaseKind.VOLUMETRIC_ROTATIONAL


def _order(
    multibody: MultiBody, parent: list[int | None], bases: dict[int, BaseKind], log: DiagnosticLog
) -> tuple[int, ...]:
    children: dict[int, list[int]] = {}
    for i, k in enumerate(parent):
        if k is not None:
            children.setdefault(multibody.connections[k].previous, []).append(i)
    order = sorted(bases)
    for body in order:  # grows while it is walked
        order += children.get(body, [])
    if len(order) < len(multibody.bodies):
        reached = set(order)
        lost = next(i for i in range(len(multibody.bodies)) if i not in reached)
        body = multibody.bodies[lost]
        message = f"body {lost} ({body.filename}) hangs in a cycle of connections that no base belongs to"
        hint = "let one connection of the cycle come from a base"
        log.fail("KIN303", body.filename, message, hint=hint, span=body.span)
    return tuple(order)


def _joint_order(multibody: MultiBody, tree: Tree, order: JointOrder) -> list[int]:
    connections = multibody.connections
    if order is JointOrder.PARENT_CHILD:
        return sorted(range(len(connections)), key=lambda k: (connections[k].previous, connections[k].next))
    if order is JointOrder.BODY and not tree.loops:
        return [k for k in tree.parent if k is not None]
    return list(range(len(connections)))


def _joint_dofs(connection: Connection, index: int, loop: bool, periodic: bool) -> list[Dof]:
    dofs: list[Dof] = []
    for n, kind in enumerate(_JOINT_DOFS[connection.joint]):
        lower, upper = -_unlimited(kind), _unlimited(kind)
        if n < len(connection.limits):
            lower, upper = connection.limits[n].lower, connection.limits[n].upper
        dofs.append(Dof(kind, connection.next, index, loop, lower, upper, periodic and not kind.is_length))
    return dofs


def dof_names(links: tuple[str, ...], dofs: Iterable[Dof]) -> tuple[str, ...]:
    """Return unique names for a robot's degrees of freedom: `link.theta`, or `link.theta(loop)` if it moves nothing."""
    return tuple(unique(f"{links[d.body]}.{d.kind}{'(loop)' if d.loop else ''}" for d in dofs))
