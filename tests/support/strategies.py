"""Small random environments of every dialect, texts that say the same in another layout, and meshes; for properties."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from random import Random
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import strategies as st
from meshes import voxels

from env2mjcf.model.dialects import RULES
from env2mjcf.model.environment import (
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
    Resolution,
    SMAShape,
    VelocityBounds,
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
    return st.sampled_from(list(Dialect)).flatmap(lambda dialect: _environments(dialect, rich=False))


def rich_environments() -> st.SearchStrategy[Environment]:
    """Return environments with all that their own dialect can express.

    Several robots with several bases, closed loops, every kind of base and joint, controls, adjacencies, surfaces,
    resolutions, masses, options.
    """
    return st.sampled_from(list(Dialect)).flatmap(lambda dialect: _environments(dialect, rich=True))


@st.composite
def _environments(draw: Any, dialect: Dialect, rich: bool) -> Environment:
    rules = RULES[dialect]
    obstacles = draw(st.lists(_obstacles(dialect, rich), max_size=3))
    robots = [draw(_robots(dialect, rich, i)) for i in range(draw(st.integers(1, 3)) if rich else 1)]
    multibodies = [*obstacles, *robots] if rules.robot_files else [*robots, *obstacles]
    if rich and not rules.robot_files:
        multibodies = draw(st.permutations(multibodies))
    return Environment(
        "scene",
        dialect,
        tuple(multibodies),
        boundary=draw(_boundaries(rules.boundaries)) if rules.boundaries else None,
        resolution=draw(_resolutions(rules.resolution)) if rich else Resolution(),
        declared_multibodies=sum(m.robot_file is None for m in multibodies),
    )


@st.composite
def _resolutions(draw: Any, fields: tuple[str, ...]) -> Resolution:
    steps = {name: draw(st.none() | st.floats(1e-3, 1)) for name in fields}
    if "position_factor" in steps:
        # The one that may be nothing.
        steps["position_factor"] = draw(st.none() | st.just(0.0) | st.floats(-1, 1))
    if steps.get("orientation") is not None:
        steps["orientation"] *= math.pi
    return Resolution(**steps)


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
    rules = RULES[dialect]
    color = draw(COLORS)
    opaque = None if color is None else (*color[:3], 1.0)
    return Body(
        draw(NAMES),
        base,
        pose,
        draw(st.sampled_from(list(Recentring))) if rules.options else Recentring.COM,
        color if rules.options else opaque,
        draw(st.sampled_from([None, "wood.png"])) if rules.options else None,
        draw(st.none() | st.floats(0.1, 10)) if mass and rules.mass else None,
        draw(st.sampled_from([None, "a name"])),
        index if dialect is Dialect.A else None,
    )


@st.composite
def _obstacles(draw: Any, dialect: Dialect, rich: bool) -> MultiBody:
    kinds = RULES[dialect].kinds if rich else {MultiBodyKind.PASSIVE, MultiBodyKind.INTERNAL}
    kind = draw(st.sampled_from(sorted(kinds - {MultiBodyKind.ACTIVE, MultiBodyKind.NON_HOLONOMIC})))
    bodies = [draw(_dressed(dialect, BaseKind.FIXED, draw(POSES), 0))]
    if rich and RULES[dialect].legacy_layout:
        bodies += [draw(_dressed(dialect, BaseKind.FIXED, draw(POSES), 1 + i)) for i in range(draw(st.integers(0, 2)))]
    labelled = kind is MultiBodyKind.SURFACE and dialect is not Dialect.B
    label = draw(st.sampled_from([None, "floor"])) if labelled else None
    return MultiBody(kind, tuple(bodies), dialect=dialect, dh_form=RULES[dialect].dh_form, label=label)


@st.composite
def _robots(draw: Any, dialect: Dialect, rich: bool, number: int) -> MultiBody:
    """Draw a tree, in which each link hangs on an earlier body; a rich one has more bases, and closed loops."""
    rules = RULES[dialect]
    legacy = dialect is Dialect.A
    fixed = draw(st.booleans())
    free = BaseKind.VOLUMETRIC_ROTATIONAL if legacy else draw(st.sampled_from(FREE))
    bodies = [
        draw(_dressed(dialect, BaseKind.FIXED if fixed else free, draw(POSES) if fixed or legacy else None, 0, True))
    ]
    connections: list[Connection] = []
    for i in range(1, 1 + draw(st.integers(0, 5 if rich else 3))):
        if rich and draw(st.integers(0, 5)) == 0:
            bodies.append(draw(_dressed(dialect, BaseKind.FIXED, draw(POSES), i, True)))
            continue
        bodies.append(draw(_dressed(dialect, BaseKind.JOINT, None, i - fixed, True)))
        connections.append(draw(_connections(dialect, draw(st.integers(0, i - 1)), i, rich)))
    if rich and len(bodies) > 1:
        for _ in range(draw(st.integers(0, 2))):
            ends = draw(st.permutations(range(len(bodies))))[:2]
            connections.append(draw(_connections(dialect, *ends, rich)))
    robot = MultiBody(
        MultiBodyKind.ACTIVE,
        tuple(bodies),
        tuple(connections),
        dialect=dialect,
        dh_form=RULES[dialect].dh_form,
        robot_file=f"{number}.robot" if rules.robot_files else None,
    )
    if rich and rules.adjacencies:
        pairs = st.tuples(*[st.integers(0, len(bodies) - 1)] * 2)
        robot = replace(robot, adjacencies=tuple(draw(st.lists(pairs, max_size=2))))
    if rich and MultiBodyKind.NON_HOLONOMIC in rules.kinds and draw(st.integers(0, 3)) == 0:
        controls = draw(st.lists(st.tuples(LENGTHS, LENGTHS), max_size=3))
        bounds = VelocityBounds(draw(st.floats(0, 9)), draw(st.floats(0, 9)))
        robot = replace(robot, kind=MultiBodyKind.NON_HOLONOMIC, velocity_bounds=bounds, controls=tuple(controls))
    return robot


@st.composite
def _connections(draw: Any, dialect: Dialect, previous: int, following: int, rich: bool) -> Connection:
    rules = RULES[dialect]
    joint = draw(st.sampled_from(sorted(rules.joints if rich else rules.joints - {JointType.SMA})))
    angles = st.floats(-3, 3).map(lambda x: x * rules.dh_angle)
    count = {JointType.REVOLUTE: 1, JointType.SPHERICAL: 2, JointType.SMA: 1}.get(joint, 0) if rules.limits else 0
    return Connection(
        previous,
        following,
        joint,
        draw(POSES),
        DHParameters(draw(angles), draw(LENGTHS), draw(LENGTHS), draw(angles)),
        draw(POSES),
        tuple(JointLimits(-draw(st.floats(0, 1)) * math.pi, draw(st.floats(0, 1)) * math.pi) for _ in range(count)),
        actuated="Actuated" if dialect is Dialect.A else None,
        sma=SMAShape(draw(st.floats(0.1, 9)), draw(st.floats(0.1, 9))) if joint is JointType.SMA else None,
    )


_GAPS = (" ", "  ", "\t", "\n", "\r\n", "\n\n  ", " # a note\n", "\n#\n", "\t# 1 2 3 Passive\r\n")
_ENDS = ("\n", " \n", "\r\n", "\n\n", " # the end of a line\n")
_DECIMAL = re.compile(r"-?[0-9]+\.[0-9]+")


def laid_out(text: str, random: Random) -> str:
    """Return a text that says the same: other blanks and line ends, comments between words, numbers spelt anew."""
    lines: list[str] = []
    verbatim = 0
    for line in text.splitlines():
        words = line.split()
        if verbatim or line.startswith("#") or not words:
            # A directive ends with its line; so does a control.
            lines.append(f"{line}\n")
            verbatim = max(0, verbatim - 1)
        elif words[0] == "Controls":
            lines.append(f"{line}\n")
            verbatim = int(words[1])
        else:
            spelt = [_spelt(w, random) for w in words]
            lines.append("".join(f"{w}{random.choice(_GAPS)}" for w in spelt[:-1]) + spelt[-1] + random.choice(_ENDS))
    return "".join(lines)


def _spelt(word: str, random: Random) -> str:
    if not _DECIMAL.fullmatch(word):
        return word
    sign = "+" if word[0] != "-" and random.random() < 0.3 else ""
    return sign + word + random.choice(("", "0", "000", "e0", "E+00"))


# Meshes.


@dataclass(frozen=True, slots=True)
class Solid:
    """A closed mesh with its volume.

    Attributes:
        vertices: (n, 3), about the size of 1.
        faces: (m, 3), counter-clockwise from outside.
        volume: By another way than from the faces.
    """

    vertices: np.ndarray
    faces: np.ndarray
    volume: float


@st.composite
def solids(draw: Any) -> Solid:
    """Draw a hull of random points, or a heap of the cells of a grid with uneven spacing."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    if draw(st.booleans()):
        spatial = pytest.importorskip("scipy.spatial", reason="no scipy to make hulls with")
        hull = trimesh.convex.convex_hull(rng.normal(size=(draw(st.integers(5, 30)), 3)))
        # By its planes and their areas, not by sums over its corners as readers do.
        planes = spatial.ConvexHull(hull.vertices)
        return Solid(np.array(hull.vertices), np.array(hull.faces), float(planes.volume))
    planes = [np.cumsum(rng.uniform(0.2, 1, size=draw(st.integers(2, 4)))) for _ in range(3)]
    filled = rng.random([len(p) - 1 for p in planes]) < draw(st.sampled_from([0.3, 0.6, 1.0]))
    filled.flat[0] = True
    cells = np.einsum("i,j,k->ijk", *(np.diff(p) for p in planes))
    mesh = voxels(planes, filled)
    return Solid(np.array(mesh.vertices), np.array(mesh.faces), float(cells[filled].sum()))


def mesh_text(solid: Solid, random: Random, kind: str) -> str:
    """Return a solid as BYU or OBJ text in some layout."""
    gap = random.choice((" ", "  ", "\t"))
    rows = [gap.join(map(repr, row)) for row in solid.vertices.tolist()]
    faces = solid.faces + 1
    if kind == "obj":
        corner = random.choice(("{}", "{}//1", "{0}/{0}")).format
        lines = [f"v{gap}{row}" for row in rows]
        lines += [f"f {gap.join(corner(i) for i in face)}" for face in faces.tolist()]
        return random.choice(("", "# a mesh\n", "mtllib none.mtl\no thing\n")) + "\n".join(lines) + "\n"
    faces[:, 2] *= -1
    end = random.choice(("\n", "\r\n", " "))
    numbers = [gap.join(map(str, face)) for face in faces.tolist()]
    head = f"1 {len(rows)} {len(faces)} {faces.size}{end}1 {len(faces)}{end}"
    return head + end.join(rows) + end + end.join(numbers) + "\n"
