"""Small random environments of every dialect, for properties."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import strategies as st

from env2mjcf.dialects import RULES, VOCABULARIES
from env2mjcf.model import (
    BaseKind,
    Body,
    Boundary,
    BoundaryShape,
    Connection,
    DHParameters,
    Dialect,
    Environment,
    JointLimits,
    JointType,
    MultiBody,
    MultiBodyKind,
    Pose,
    Recentring,
)

LENGTHS = st.floats(-100, 100)
# What a file can say: some number times the unit.
DEGREES = st.floats(-360, 360).map(lambda x: x * (math.pi / 180))
TRIPLES = st.tuples(LENGTHS, LENGTHS, LENGTHS)
POSES = st.builds(Pose, TRIPLES, st.tuples(DEGREES, DEGREES, DEGREES))
NAMES = st.sampled_from(["cube.g", "link.obj", "arm/link 1.g".replace(" ", "_"), "Wall.G"])
COLORS = st.none() | st.tuples(*[st.floats(0, 1)] * 4)
FREE = [k for k in BaseKind if k not in (BaseKind.FIXED, BaseKind.JOINT)]


def environments() -> st.SearchStrategy[Environment]:
    """Return environments that their own dialect can express, each with one robot and up to three obstacles."""
    return st.sampled_from(list(Dialect)).flatmap(_environments)


@st.composite
def _environments(draw: Any, dialect: Dialect) -> Environment:
    vocabulary = VOCABULARIES[dialect]
    obstacles = draw(st.lists(_obstacles(dialect), max_size=3))
    robot = draw(_robots(dialect))
    multibodies = (*obstacles, robot) if vocabulary.robot_files else (robot, *obstacles)
    return Environment(
        "scene",
        dialect,
        multibodies,
        boundary=draw(_boundaries(vocabulary.boundaries)) if vocabulary.boundaries else None,
        declared_multibodies=sum(m.robot_file is None for m in multibodies),
    )


@st.composite
def _boundaries(draw: Any, shapes: frozenset[BoundaryShape]) -> Boundary:
    shape = draw(st.sampled_from(sorted(shapes)))
    axes = 2 if shape in (BoundaryShape.BOX2D, BoundaryShape.SPHERE2D) else 3
    center = tuple(draw(LENGTHS) for _ in range(axes))
    size = draw(st.floats(0.1, 100))
    if shape in (BoundaryShape.BOX, BoundaryShape.BOX2D):
        return Boundary(shape, tuple(c - size for c in center), tuple(c + size for c in center))
    return Boundary(shape, center=center, radius=size)


@st.composite
def _dressed(draw: Any, dialect: Dialect, base: BaseKind, pose: Pose | None, index: int, mass: bool = False) -> Body:
    vocabulary = VOCABULARIES[dialect]
    color = draw(COLORS)
    opaque = None if color is None else (*color[:3], 1.0)
    return Body(
        draw(NAMES),
        base,
        pose,
        draw(st.sampled_from(list(Recentring))) if vocabulary.options else Recentring.COM,
        color if vocabulary.options else opaque,
        draw(st.sampled_from([None, "wood.png"])) if vocabulary.options else None,
        draw(st.none() | st.floats(0.1, 10)) if mass and vocabulary.mass else None,
        draw(st.sampled_from([None, "a name"])),
        index if dialect is Dialect.A else None,
    )


@st.composite
def _obstacles(draw: Any, dialect: Dialect) -> MultiBody:
    kind = draw(st.sampled_from([MultiBodyKind.PASSIVE, MultiBodyKind.INTERNAL]))
    body = draw(_dressed(dialect, BaseKind.FIXED, draw(POSES), 0))
    return MultiBody(kind, (body,), dialect=dialect, dh_form=RULES[dialect].dh_form)


@st.composite
def _robots(draw: Any, dialect: Dialect) -> MultiBody:
    """Draw a tree, in which each link hangs on an earlier body."""
    legacy = dialect is Dialect.A
    fixed = draw(st.booleans())
    free = BaseKind.VOLUMETRIC_ROTATIONAL if legacy else draw(st.sampled_from(FREE))
    bodies = [
        draw(_dressed(dialect, BaseKind.FIXED if fixed else free, draw(POSES) if fixed or legacy else None, 0, True))
    ]
    connections: list[Connection] = []
    for i in range(1, 1 + draw(st.integers(0, 3))):
        bodies.append(draw(_dressed(dialect, BaseKind.JOINT, None, i - fixed, True)))
        connections.append(draw(_connections(dialect, draw(st.integers(0, i - 1)), i)))
    return MultiBody(
        MultiBodyKind.ACTIVE,
        tuple(bodies),
        tuple(connections),
        dialect=dialect,
        dh_form=RULES[dialect].dh_form,
        robot_file="0.robot" if VOCABULARIES[dialect].robot_files else None,
    )


@st.composite
def _connections(draw: Any, dialect: Dialect, previous: int, following: int) -> Connection:
    vocabulary, rules = VOCABULARIES[dialect], RULES[dialect]
    joint = draw(st.sampled_from(sorted(vocabulary.joints - {JointType.SMA})))
    angles = st.floats(-3, 3).map(lambda x: x * rules.dh_angle)
    count = {JointType.REVOLUTE: 1, JointType.SPHERICAL: 2}.get(joint, 0) if vocabulary.limits else 0
    return Connection(
        previous,
        following,
        joint,
        draw(POSES),
        DHParameters(draw(angles), draw(LENGTHS), draw(LENGTHS), draw(angles)),
        draw(POSES),
        tuple(JointLimits(-draw(st.floats(0, 1)) * math.pi, draw(st.floats(0, 1)) * math.pi) for _ in range(count)),
        actuated="Actuated" if dialect is Dialect.A else None,
    )
