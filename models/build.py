"""Write the scenes of this folder: `python models/build.py [--check] [--out FOLDER]`.

The numbers of a mesh are rounded, so that the bytes do not depend on the last bit of a sine. Dimensions are in metres.
"""

from __future__ import annotations

import argparse
import itertools
import math
import sys
import textwrap
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
Polygon = tuple[int, ...]
Files = dict[str, str]
Profile = Sequence[tuple[float, float]]

HERE = Path(__file__).resolve().parent
DIGITS = 6  # of a mesh's coordinates: micrometres


# ---------------------------------------------------------------------------------------------------------------
# Meshes


@dataclass(frozen=True, slots=True)
class Mesh:
    """A closed surface of polygons, counter-clockwise from outside.

    Attributes:
        vertices: (n, 3).
        polygons: Indices into `vertices`, from 0.
        parts: Number of polygons of each part, in order.
    """

    vertices: Points
    polygons: tuple[Polygon, ...]
    parts: tuple[int, ...]

    @classmethod
    def of(cls, vertices: Iterable[Sequence[float]], polygons: Iterable[Polygon]) -> Mesh:
        """Build a mesh of one part."""
        kept = tuple(polygons)
        return cls(np.array(list(vertices), dtype=float), kept, (len(kept),))

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Mesh:
        """Translate it."""
        return replace(self, vertices=self.vertices + np.array([x, y, z]))

    def rolled(self, steps: int = 1) -> Mesh:
        """Rename the axes in a circle: after one step, what pointed along z points along x."""
        return replace(self, vertices=np.roll(self.vertices, steps, axis=1))

    def triangulated(self) -> Mesh:
        """Cut each (convex) polygon into a fan."""
        fans = [[(p[0], p[k], p[k + 1]) for k in range(1, len(p) - 1)] for p in self.polygons]
        ends = np.cumsum(self.parts)
        sizes = tuple(sum(map(len, fans[e - n : e])) for e, n in zip(ends, self.parts, strict=True))
        return Mesh(self.vertices, tuple(t for fan in fans for t in fan), sizes)

    def recentred(self) -> tuple[Mesh, tuple[float, float, float]]:
        """Subtract the mean of the vertices, as the planner does on loading; return it as well."""
        x, y, z = (round(float(self.vertices[:, k].mean()), 9) for k in range(3))
        return self.moved(-x, -y, -z), (x, y, z)

    def byu(self) -> str:
        """Return the text of a `.g` file."""
        corners = sum(map(len, self.polygons))
        lines = [f"{len(self.parts)} {len(self.vertices)} {len(self.polygons)} {corners}"]
        first = 1
        for size in self.parts:
            lines.append(f"{first} {first + size - 1}")
            first += size
        lines += [numbers(*v) for v in np.round(self.vertices, DIGITS).tolist()]
        lines += [" ".join(str(i + 1) for i in p[:-1]) + f" -{p[-1] + 1}" for p in self.polygons]
        return "\n".join(lines) + "\n"


def joined(*meshes: Mesh) -> Mesh:
    """Put meshes that do not touch into one, a part each."""
    offsets = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    polygons = [tuple(i + int(o) for i in p) for m, o in zip(meshes, offsets, strict=False) for p in m.polygons]
    return Mesh(np.vstack([m.vertices for m in meshes]), tuple(polygons), tuple(n for m in meshes for n in m.parts))


def blocks(
    xs: Sequence[float],
    ys: Sequence[float],
    zs: Sequence[float],
    filled: Callable[[int, int, int], bool],
    most: float = math.inf,
) -> Mesh:
    """Return the boundary, in quadrilaterals, of the filled cells of a grid with these planes.

    Cells longer than `most` are cut, to keep the quadrilaterals in shape. Cells that meet in a mere edge or corner
    would make it a non-manifold: do not fill such.
    """
    (xs, i), (ys, j), (zs, k) = (_cut(planes, most) for planes in (xs, ys, zs))
    shape = (len(i), len(j), len(k))
    solid = np.pad(np.array([filled(*cell) for cell in itertools.product(i, j, k)]).reshape(shape), 1)
    quads: list[list[tuple[int, ...]]] = []
    for cell in np.ndindex(shape):
        if not solid[cell[0] + 1, cell[1] + 1, cell[2] + 1]:
            continue
        for axis in range(3):
            for side in (0, 1):
                beyond = [c + 1 for c in cell]
                beyond[axis] += 2 * side - 1
                if not solid[tuple(beyond)]:
                    quads.append(_face(cell, axis, side))
    used = sorted({corner for quad in quads for corner in quad})
    index = {corner: k for k, corner in enumerate(used)}
    return Mesh.of(((xs[i], ys[j], zs[k]) for i, j, k in used), (tuple(index[c] for c in q) for q in quads))


def _cut(planes: Sequence[float], most: float) -> tuple[list[float], list[int]]:
    """Return planes at most `most` apart, and for each cell between them the cell that it is of."""
    result, owner = [planes[0]], list[int]()
    for cell, (a, b) in enumerate(itertools.pairwise(planes)):
        pieces = max(1, math.ceil(round((b - a) / most, 9)))
        result += [a + (b - a) * (k + 1) / pieces for k in range(pieces)]
        owner += [cell] * pieces
    return result, owner


def _face(cell: tuple[int, ...], axis: int, side: int) -> list[tuple[int, ...]]:
    """Return the corners of a cell's face, counter-clockwise from outside."""
    corners: list[tuple[int, ...]] = []
    for u, v in ((0, 0), (1, 0), (1, 1), (0, 1)):
        corner = list(cell)
        corner[axis] += side
        corner[(axis + 1) % 3] += u
        corner[(axis + 2) % 3] += v
        corners.append(tuple(corner))
    return corners if side else corners[::-1]


def box(x: float, y: float, z: float) -> Mesh:
    """Return a box with these sides about the origin, in quadrilaterals."""
    return blocks((-x / 2, x / 2), (-y / 2, y / 2), (-z / 2, z / 2), lambda i, j, k: True)


def grid(half: float, *inner: float) -> tuple[float, ...]:
    """Return grid planes that are symmetric about 0, from `-half` to `half`."""
    return (-half, *(-v for v in inner), *reversed(inner), half)


def lathe(profile: Profile, sides: int, *, closed: bool = False) -> Mesh:
    """Turn a profile of (radius, z) about the z axis, with the solid on its left.

    A profile starts and ends on the axis, or is `closed` and stays off it.
    """
    vertices: list[tuple[float, float, float]] = []
    rings: list[list[int]] = []
    for radius, z in profile:
        first = len(vertices)
        if radius == 0:
            vertices.append((0.0, 0.0, z))
            rings.append([first] * sides)
            continue
        turns = [2 * math.pi * (k + 0.5) / sides for k in range(sides)]
        vertices += [(radius * math.cos(t), radius * math.sin(t), z) for t in turns]
        rings.append(list(range(first, first + sides)))
    pairs = list(zip(rings, rings[1:] + rings[:1], strict=True))
    polygons = [_strip(low, high, k) for low, high in (pairs if closed else pairs[:-1]) for k in range(sides)]
    return Mesh.of(vertices, polygons)


def _strip(low: list[int], high: list[int], k: int) -> Polygon:
    """Return the quadrilateral between two rings, or the triangle where one of them is a point."""
    n = (k + 1) % len(low)
    corners = (low[k], low[n], high[n], high[k])
    return tuple(dict.fromkeys(corners))


def barrel(length: float, radius: float, sides: int, waist: float | None = None) -> Mesh:
    """Return a bar along z with chamfered ends, slimmer in the middle where it has a waist."""
    end, c = length / 2, radius * 0.4
    lower = [(0.0, -end), (radius - c, -end), (radius, -end + c)]
    middle: list[tuple[float, float]] = []
    if waist is not None:
        middle = [(radius, -length / 5), (waist, -length / 8), (waist, length / 8), (radius, length / 5)]
    return lathe([*lower, *middle, *((r, -z) for r, z in reversed(lower))], sides)


def ball(radius: float, sides: int) -> Mesh:
    """Return a ball of facets."""
    arc = [math.pi * k / 8 for k in range(1, 8)]
    middle = [(radius * math.sin(t), -radius * math.cos(t)) for t in arc]
    return lathe([(0, -radius), *middle, (0, radius)], sides)


def cylinder(length: float, radius: float, top: float, sides: int) -> Mesh:
    """Return a cylinder, or a cone cut off at radius `top`, along z."""
    return lathe([(0, -length / 2), (radius, -length / 2), (top, length / 2), (0, length / 2)], sides)


def ring(radius: float, thickness: float, sides: int) -> Mesh:
    """Return a hoop about the z axis."""
    angles = [2 * math.pi * k / 8 for k in range(8)]
    profile = [(radius + thickness * math.cos(a), thickness * math.sin(a)) for a in angles]
    return lathe(profile, sides, closed=True)


def bar(length: float, width: float, thickness: float) -> Mesh:
    """Return a link along x with rounded ends: `length` between the pivots, thickness along z."""
    r, h = width / 2, thickness / 2
    end = [(length / 2 + r * math.cos(t), r * math.sin(t)) for t in (math.pi / 10, math.pi / 4, math.pi / 2)]
    pieces = math.ceil(length / 0.4)
    middle = [(length * (k / pieces - 0.5), r) for k in range(1, pieces)]
    stations = [*((-x, y) for x, y in end), *middle, *end[::-1]]
    vertices = [(x, y, z) for x, w in stations for y, z in ((-w, -h), (w, -h), (w, h), (-w, h))]
    last = 4 * (len(stations) - 1)
    around = ((0, 1), (1, 2), (2, 3), (3, 0))
    sides = [(s + a, s + a + 4, s + b + 4, s + b)[::-1] for s in range(0, last, 4) for a, b in around]
    return Mesh.of(vertices, [(3, 2, 1, 0), *sides, tuple(range(last, last + 4))])


def tube(path: Points, radius: float, sides: int) -> Mesh:
    """Sweep a circle along a path, with frames that do not twist."""
    tangents = np.gradient(path, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    normal = np.cross(tangents[0], (0.0, 1.0, 0.0))
    vertices: list[Points] = []
    turns = 2 * math.pi * np.arange(sides) / sides
    for point, tangent in zip(path, tangents, strict=True):
        normal = normal - tangent * (normal @ tangent)
        normal = normal / np.linalg.norm(normal)
        vertices += list(
            point + radius * (np.outer(np.cos(turns), normal) + np.outer(np.sin(turns), np.cross(tangent, normal)))
        )
    rings = [list(range(k * sides, (k + 1) * sides)) for k in range(len(path))]
    rings = [[len(vertices)] * sides, *rings, [len(vertices) + 1] * sides]
    vertices += [path[0], path[-1]]
    return Mesh.of(
        [v.tolist() for v in vertices], [_strip(a, b, k) for a, b in itertools.pairwise(rings) for k in range(sides)]
    )


# ---------------------------------------------------------------------------------------------------------------
# Text


def numbers(*values: float) -> str:
    """Return numbers as text that reads back to the same doubles."""
    return " ".join(str(int(v)) if v == int(v) else repr(float(v)) for v in values)


def page(text: str) -> str:
    """Return an indented text as a file."""
    return textwrap.dedent(text).lstrip("\n")


STEEL = "0.45 0.5 0.56"
ORANGE = "0.95 0.5 0.1"
BLUE = "0.15 0.4 0.75"
GREEN = "0.2 0.6 0.35"
RED = "0.8 0.2 0.2"
SAND = "0.82 0.74 0.58"
DARK = "0.25 0.27 0.3"


def tag(name: str, *children: str, **attributes: str) -> str:
    """Return an XML element, its children indented."""
    head = name + "".join(f" {k}={quoteattr(v)}" for k, v in attributes.items())
    if not children:
        return f"<{head}/>"
    inner = "\n".join("  " + line for child in children for line in child.split("\n"))
    return f"<{head}>\n{inner}\n</{name}>"


def xml(*elements: str) -> str:
    """Return an XML file."""
    return "\n".join(('<?xml version="1.0" encoding="UTF-8"?>', *elements)) + "\n"


def problem(environment: str, robot: str, *points: Sequence[float]) -> str:
    """Return a problem file of dialect E: a scene, its robot, one task, and a plain PRM that solves it."""
    start, goal = (tag("CSpaceConstraint", point=numbers(*p)) for p in points)
    task = tag("Task", tag("StartConstraints", start), tag("GoalConstraints", goal), label="query", robot="robot")
    scene = tag(
        "Problem",
        tag("Environment", filename=environment),
        tag("Robot", label="robot", filename=robot),
        task,
        baseFilename=Path(environment).stem,
    )
    prm = tag(
        "BasicPRM",
        tag("Sampler", label="uniform", number="50", attempts="1"),
        tag("Connector", label="closest"),
        tag("Evaluator", label="solved"),
        label="prm",
        querySampler="uniform",
    )
    checker = tag("CollisionDetection", label="rapid", method="RAPID", ignoreAdjacentLinks="true")
    nearest = tag("BruteForceNF", label="nearest", dmLabel="euclidean", unconnected="false", k="8")
    connector = tag("NeighborhoodConnector", label="closest", nfLabel="nearest", lpLabel="line", checkIfSameCC="false")
    library = tag(
        "Library",
        tag("DistanceMetrics", tag("Euclidean", label="euclidean")),
        tag("ValidityCheckers", checker),
        tag("NeighborhoodFinders", nearest),
        tag("Samplers", tag("UniformRandomSampler", label="uniform", vcLabel="rapid")),
        tag("LocalPlanners", tag("StraightLine", label="line", vcLabel="rapid", binaryEvaluation="true")),
        tag("Connectors", connector),
        tag("MapEvaluators", tag("QueryMethod", label="solved", graphSearchAlg="dijkstras")),
        tag("MPStrategies", prm),
        tag("Solver", mpStrategyLabel="prm", seed="1", baseFilename=Path(environment).stem),
    )
    return xml(tag("MotionPlanning", scene, library))


def meshes(folder: str = "", /, **solids: Mesh) -> Files:
    """Return `.g` files of triangles."""
    return {f"{folder}{name}.g": mesh.triangulated().byu() for name, mesh in solids.items()}


# ---------------------------------------------------------------------------------------------------------------
# Scenes


def seed() -> Files:
    """The example of the Parasol Lab's page on the format, to the letter (dialect A)."""
    environment = page("""
        3
        MultiBody Active
        4
        FreeBody 0 cube.g 0 0 0 0 0 0
        FreeBody 1 link1.g
        FreeBody 2 link2.g
        FreeBody 3 link3.g
        Connection
        3
        0 1 Actuated
        0.2 0 0 -90 0 0 90 0.2 0 30 Revolute 0 0 0 0 0 0
        1 2 Actuated
        0.2 0 0 -90 0 0 90 0.2 0 30 Revolute 0 0 0 0 0 0
        2 3 Actuated
        0.2 0 0 -90 0 0 90 0.2 0 30 Revolute 0 0 0 0 0 0
        MultiBody Passive
        1
        FixedBody 0 block.g 0 2.0 0 0 0 0
        Connection
        0
        MultiBody Passive
        1
        FixedBody 0 block.g 0 2.0 0 0 0 0
        Connection
        0
    """)
    query = page("""
        0 0 0 0 0 0 0.125 0.875 0.125
        0 4 0.5 0 0 0.5 0.1 0.1 0.9
    """)
    # Half a link is 0.2 long: the pivots of the connections are its ends.
    links = {f"link{k}": barrel(0.4, r, 8).rolled() for k, r in ((1, 0.1), (2, 0.085), (3, 0.07))}
    solids = meshes(cube=box(0.4, 0.4, 0.4), block=box(2.4, 0.5, 2.4), **links)
    return {"seed.env": environment, "seed.query": query, **solids}


def gantry() -> Files:
    """Three slides and a wrist on a fixed frame (dialect A); the frame is of quadrilaterals."""
    legs_and_rails = blocks(
        grid(1.6, 1.48),
        grid(1.2, 1.06),
        (0, 1.68, 1.8),
        lambda i, j, k: (i, j) != (1, 1) if k == 1 else i != 1 and j != 1,
        most=1,
    )
    frame, (_, _, frame_z) = legs_and_rails.recentred()
    fork = blocks(grid(0.15, 0.1), (-0.05, 0.05), (-0.24, -0.06, 0), lambda i, j, k: k == 1 or i != 1)
    gripper, (_, _, gripper_z) = fork.recentred()
    solids = meshes(
        bridge=blocks(grid(0.2, 0.12), grid(1.2, 1.06), (-0.06, 0.06), lambda i, j, k: (i, j) != (1, 1), most=0.8),
        trolley=blocks(grid(0.2, 0.08), grid(0.2, 0.08), (-0.06, 0.06), lambda i, j, k: (i, j) != (1, 1)),
        column=box(0.12, 0.12, 1.6),
        gripper=gripper,
        table=box(2.6, 1.9, 0.3),
        crate=box(0.4, 0.3, 0.2),
    )
    # A connection's numbers: DH frame to body, DH row, kind, body to DH frame. The slide is the DH frame's z axis.
    environment = page(f"""
        3
        MultiBody Active
        5
        #VIZMO_COLOR {STEEL}
        FixedBody 0 frame.g 0 0 {frame_z} 0 0 0
        #VIZMO_COLOR {ORANGE}
        FreeBody 1 bridge.g
        #VIZMO_COLOR {DARK}
        FreeBody 2 trolley.g
        #VIZMO_COLOR {BLUE}
        FreeBody 3 column.g
        #VIZMO_COLOR {RED}
        FreeBody 4 gripper.g
        Connection
        4
        0 1 Actuated
        0 0 0 0 -90 0  0 0 0.4 0  Prismatic  0 0 {round(1.88 - frame_z, 9)} 0 90 0
        1 2 Actuated
        0 0 0 90 0 0  -90 0 -0.3 0  Prismatic  0 0 0.14 0 0 0
        2 3 Actuated
        0 0 0 0 0 0  0 0 -0.4 0  Prismatic  0 0 0 0 0 0
        3 4 Actuated
        0 0 {gripper_z} 0 0 0  0 0 0 45  Revolute  0 0 -0.82 0 0 0
        MultiBody Passive
        1
        #VIZMO_COLOR {SAND}
        FixedBody 0 table.g 0 0 0.15 0 0 0
        Connection
        0
        MultiBody Passive
        3
        #VIZMO_COLOR {GREEN}
        FixedBody 0 crate.g -0.7 0.4 0.4 0 0 0
        #VIZMO_COLOR {GREEN}
        FixedBody 1 crate.g -0.7 0.38 0.6 0 0 15
        #VIZMO_COLOR {GREEN}
        FixedBody 2 crate.g 0.7 -0.5 0.4 0 0 60
        Connection
        0
    """)
    query = page("""
        -0.6 -0.4 -0.5 0
        0.9 0.5 -0.5 0.25
    """)
    return {"gantry.env": environment, "gantry.query": query, "frame.g": frame.byu(), **solids}


def spherical_arm() -> Files:
    """An arm with three joints of two degrees of freedom each, and a hoop to reach through (dialect C)."""
    fork = blocks(grid(0.14, 0.09), (-0.04, 0.04), (0, 0.05, 0.2), lambda i, j, k: k == 0 or i != 1)
    hand, (_, _, hand_z) = fork.recentred()
    # The DH frame's y axis lies along the arm: alpha bends about x, theta about z; both are joint values.
    environment = page(f"""
        Boundary Box -3:3 -3:3 -0.2:4

        Multibodies
        5

        Active
        5
        #VIZMO_COLOR {DARK}
        meshes/pedestal.g Fixed 0 0 0.25 0 0 0
        #VIZMO_COLOR {ORANGE}
        meshes/upper.g Joint
        #VIZMO_COLOR {STEEL}
        meshes/middle.g Joint
        #VIZMO_COLOR {ORANGE}
        meshes/fore.g Joint
        #VIZMO_COLOR {RED}
        meshes/hand.g Joint
        Connections
        4
        0 1 Spherical -0.4:0.4 -0.6:0.6
        0 0 0.25 90 0 0   -0.4 0 0 0.2   0 0.4 0 -90 0 0
        1 2 Spherical -0.4:0.4 -0.6:0.6
        0 0 0.4 90 0 0   -0.5 0 0 -0.3   0 0.35 0 -90 0 0
        2 3 Spherical -0.4:0.4 -0.6:0.6
        0 0 0.35 90 0 0   -0.4 0 0 0.25   0 0.3 0 -90 0 0
        3 4 NonActuated
        0 0 0.3 0 0 0   0 0 0 0   0 0 {hand_z} 0 0 0

        Passive
        #VIZMO_COLOR {SAND}
        meshes/floor.g 0 0 -0.16 0 0 0

        Passive
        #VIZMO_COLOR {BLUE}
        meshes/hoop.g 0 -1.35 0.9 90 0 0

        Passive
        #VIZMO_COLOR {BLUE}
        meshes/post.g 0 -1.35 0.21 0 0 0

        Passive
        #VIZMO_COLOR {GREEN}
        meshes/ball.g 0.9 0.9 0.35 0 0 0
    """)
    query = page("""
        0 0.2 -0.1 0 -0.2 0 -0.1
        0 0 0.38 0 0.1 0 0.03
    """)
    solids = meshes(
        "meshes/",
        pedestal=cylinder(0.5, 0.35, 0.2, 16),
        upper=barrel(0.8, 0.1, 12),
        middle=barrel(0.7, 0.085, 12),
        fore=barrel(0.6, 0.07, 12),
        hand=hand,
        floor=box(4, 4, 0.3),
        hoop=ring(0.42, 0.06, 24),
        post=box(0.12, 0.12, 0.42),
        ball=ball(0.35, 16),
    )
    return {"spherical-arm.env": environment, "spherical-arm.query": query, **solids}


GROUND, CRANK, COUPLER, ROCKER = 2.0, 0.4, 0.8 * math.sqrt(2), 1.2 * math.sqrt(2)


def closed_chain() -> Files:
    """A crank and rocker whose coupler gives the rocker its second parent (dialect D), closed at home.

    The crank stands upright at home, the coupler rises and the rocker falls at 45 degrees: with the lengths above
    the loop closes exactly.
    """
    stand, (_, y, _) = blocks(
        grid(1.16, 0.84), (-0.75, -0.08, 0.08), (-0.04, 0.04), lambda i, j, k: j == 1 or i != 1, most=0.6
    ).recentred()
    quarter, half = math.pi / 4, math.pi / 2
    # The stand's y axis points up; the links lie in layers 0.1 apart.
    environment = page(f"""
        Boundary Box [-3:3 ; -2:2 ; -0.2:4]
        PositionRes 0.02

        MultiBodies
        2

        Active
        4
        meshes/stand.g -c({DARK} 1) Fixed 0 0 {numbers(0.75 + y)} 90 0 0
        meshes/crank.g -c({RED} 1) Joint
        meshes/coupler.g -c({BLUE} 1) Joint
        meshes/rocker.g -c({ORANGE} 1) Joint
        Connections
        4
        0 1 Revolute -1:1
        {numbers(-GROUND / 2, -y)} 0 0 0 0   0 0 0.1 {half}   {numbers(CRANK / 2)} 0 0 0 0 0
        1 2 Revolute -1:1
        {numbers(CRANK / 2)} 0 0 0 0 0   0 0 0.1 {-quarter}   {numbers(COUPLER / 2)} 0 0 0 0 0
        0 3 Revolute -1:1
        {numbers(GROUND / 2, -y)} 0 0 0 0   0 0 0.1 {3 * quarter}   {numbers(ROCKER / 2)} 0 0 0 0 0
        2 3 Revolute -1:1
        {numbers(COUPLER / 2)} 0 0 0 0 0   0 0 -0.1 {half}   {numbers(-ROCKER / 2)} 0 0 0 0 0

        Passive
        meshes/floor.g -c({SAND} 1) 0 0 -0.12 0 0 0
    """)
    query = "".join(f"0 {numbers(*crank_and_rocker(angle))}\n" for angle in (half, -0.75 * math.pi))
    solids = meshes(
        "meshes/",
        stand=stand,
        crank=bar(CRANK, 0.16, 0.08),
        coupler=bar(COUPLER, 0.16, 0.08),
        rocker=bar(ROCKER, 0.16, 0.08),
        floor=box(3, 1.2, 0.2),
    )
    return {"closed-chain.env": environment, "closed-chain.query": query, **solids}


def crank_and_rocker(crank: float) -> list[float]:
    """Return the joint values (in units of pi) of the closed chain at an angle of its crank."""
    tip = CRANK * complex(math.cos(crank), math.sin(crank))
    across = GROUND - tip
    reach = abs(across)
    bend = math.acos((COUPLER**2 + reach**2 - ROCKER**2) / (2 * COUPLER * reach))
    coupler = math.atan2(across.imag, across.real) + bend
    joint = tip + COUPLER * complex(math.cos(coupler), math.sin(coupler)) - GROUND
    rocker = math.atan2(joint.imag, joint.real)
    angles = (crank, coupler - crank, rocker, rocker - coupler)
    return [round(math.remainder(angle / math.pi, 2), 13) for angle in angles]


MAZE = """
###############
#...#.........#
#.###.###.###.#
#...#.#.#...#.#
#.#.#.#.###.###
#.#.......#...#
#.#######.###.#
#.#.#...#.#...#
#.#.#.#####.#.#
#...#...#...#.#
#######.#.###.#
#.......#...#.#
#.#########.#.#
#...........#..
###############
"""


def maze() -> Files:
    """A bent robot in a maze that is one mesh (dialect E: environment, robot and problem file)."""
    rows = MAZE.strip().split("\n")[::-1]
    cell, wall = 1.0, 0.15
    planes = [(k // 2) * cell + (k % 2) * wall - (7 * cell + wall) / 2 for k in range(16)]
    walls, (x, y, _) = blocks(planes, planes, (-0.25, 0.25), lambda i, j, k: rows[j][i] == "#").recentred()
    bent = blocks((-0.25, -0.1, 0.25), (-0.25, -0.1, 0.25), (-0.15, 0.15), lambda i, j, k: i == 0 or j == 0)
    robot, _ = bent.recentred()
    environment = page(f"""
        Boundary Box [-5:5 ; -5:5 ; -1:1]
        PositionRes 0.05

        Multibodies
        1

        Passive
        meshes/maze.g -c({STEEL} 1) {numbers(x, y)} 0 0 0 0
    """)
    robot_file = page(f"""
        1
        meshes/bent.g -c({ORANGE} 1) Planar Rotational
        Connections
        0
    """)
    start, goal = (0, 0, 0), (4.2, -3, 0.5)
    return {
        "maze.env": environment,
        "maze.robot": robot_file,
        "maze.xml": problem("maze.env", "maze.robot", start, goal),
        "maze.query": f"{numbers(*start)}\n{numbers(*goal)}\n",
        **meshes("meshes/", maze=walls, bent=robot),
    }


def alpha() -> Files:
    """A puzzle of two linked bent tubes of one shape (dialect D)."""
    loop, (_, _, z) = tube(alpha_curve(48), 0.15, 8).recentred()
    # One hangs in the other: nose in loop, 0.6 deep, the upper one upside down and turned across.
    top = 4.0
    environment = page(f"""
        Boundary Box [-8:8 ; -8:8 ; -8:8]
        PositionRes 0.05

        MultiBodies
        2

        Active
        1
        alpha.g -c({ORANGE} 1) Volumetric Rotational
        Connections
        0

        Passive
        alpha.g -c({BLUE} 1) 0 0 {numbers(top)} 180 0 90
    """)
    query = page(f"""
        0 0 0 {numbers(round(top + 2 * z + 0.6, 6))} 0 0 0
        0 2.5 1 0.5 0.25 0 0.5
    """)
    return {"alpha.env": environment, "alpha.query": query, **meshes(alpha=loop)}


def alpha_curve(sections: int) -> Points:
    """Return points at equal distances on an open curve that crosses over itself once, like the letter."""
    t = np.linspace(-1.3, 1.3, 4001)
    dense = np.stack([0.32 * t, 1.5 * t * (1 - t * t), -1.6 * t * t], axis=1)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(dense, axis=0), axis=1))])
    stops = np.linspace(0.0, float(length[-1]), sections)
    return np.stack([np.interp(stops, length, dense[:, k]) for k in range(3)], axis=1)


def bug_trap() -> Files:
    """A bottle with a narrow inlet and a bug inside (dialect B)."""
    outside = [(0, -1.5), (0.6, -1.5), (1.1, -1.5), (1.2, -1.4), (1.2, -0.7), (1.2, 0), (1.2, 0.7), (1.05, 1.1)]
    inlet = [(0.75, 1.38), (0.5, 1.42), (0.36, 1.2), (0.28, 0.7)]
    inside = [(0.38, 0.66), (0.48, 1.1), (0.7, 1.2), (0.95, 0.98), (1.06, 0.65), (1.06, 0), (1.06, -0.65)]
    floor = [(1.06, -1.34), (0.55, -1.36), (0, -1.36)]
    bottle, (_, _, z) = lathe([*outside, *inlet, *inside, *floor], 24).recentred()
    environment = page(f"""
        2

        Active
        1
        #VIZMO_COLOR {ORANGE}
        bug.g Volumetric Rotational
        Connections
        0

        Passive
        #VIZMO_COLOR {GREEN}
        bottle.g 0 0 {z} 0 0 0
    """)
    query = page("""
        0 0 0 0 0 0 0
        0 2.5 0 1.5 0.25 0.5 0
    """)
    bug = barrel(1.0, 0.16, 12, waist=0.08).rolled()
    return {"bug-trap.env": environment, "bug-trap.query": query, **meshes(bug=bug, bottle=bottle)}


def two_robots() -> Files:
    """A car and an arm in one hall with a floor that is only drawn (dialect D).

    The car's mesh is one file of several parts and keeps its own origin: its wheels stand on z = -0.2.
    """
    hull = blocks((-0.36, -0.2, 0.1, 0.36), (-0.2, 0.2), (-0.1, 0.04, 0.16), lambda i, j, k: k == 0 or i == 1)
    wheel = cylinder(0.06, 0.1, 0.1, 12).rolled(2)
    wheels = [wheel.moved(x, y, -0.1) for x in (-0.22, 0.22) for y in (-0.25, 0.25)]
    environment = page(f"""
        Boundary Box [-3:3 ; -3:3 ; -1:3]
        PositionRes 0.05
        Orientation 0.05

        MultiBodies
        6

        Active
        1
        meshes/car.g -a(None) -c({RED} 1) Planar Rotational
        Connections
        0

        Active
        4
        meshes/pedestal.g -c({DARK} 1) Fixed 1.2 1.2 0 0 0 0
        meshes/turret.g -c({ORANGE} 1) Joint
        meshes/upper.g -c({STEEL} 1) Joint
        meshes/fore.g -c({ORANGE} 1) Joint
        Connections
        3
        0 1 Revolute -1:1
        0 0 0.2 0 0 0   0 0 0.14 -2.2   0 0 0 0 0 0
        1 2 Revolute -0.1:0.9
        0 -0.28 0 90 0 0   0 0 0 1.1   0.4 0 0 0 0 0
        2 3 Revolute -0.8:0.8
        -0.4 0 0 0 0 0   0 0.8 0.12 -1.3   0.35 0 0 0 0 0

        Passive
        meshes/crate.g -c({SAND} 1) -0.9 1.4 0.1 0 0 20

        Passive
        meshes/crate.g -c({SAND} 1) -1.6 -0.6 0.1 0 0 -35

        Internal
        meshes/pillar.g -c({STEEL} 1) 1.3 -1.2 0.5 0 0 0

        Surface floor
        meshes/floor.g -c({GREEN} 1) 0 0 -0.4 0 0 0
    """)
    query = page("""
        0 0 0 0
        0 -2.2 2.2 0.75
        1 -0.7 0.35 -0.4
        1 0.5 0.2 0.3
    """)
    solids = meshes(
        "meshes/",
        car=joined(hull, *wheels),
        pedestal=cylinder(0.4, 0.28, 0.2, 16),
        turret=cylinder(0.24, 0.18, 0.18, 16),
        upper=bar(0.8, 0.2, 0.1),
        fore=bar(0.7, 0.16, 0.1),
        crate=box(0.6, 0.6, 0.6),
        pillar=cylinder(1.4, 0.22, 0.22, 12),
        floor=box(6, 6, 0.4),
    )
    return {"two-robots.env": environment, "two-robots.query": query, **solids}


def xml_arm() -> Files:
    """An arm of five hinges, environment and robot in XML (dialect E), with textbook DH rows."""
    fork = blocks((-0.03, 0.03), grid(0.11, 0.07), (0, 0.04, 0.18), lambda i, j, k: k == 0 or j != 1)
    open_shelf = blocks(
        (0, 0.04, 0.5), grid(0.5, 0.46), (0, 0.04, 0.5, 0.54), lambda i, j, k: i == 0 or j != 1 or k != 1, most=0.5
    )
    shelf, (depth, _, height) = open_shelf.recentred()
    solids = meshes(
        "meshes/",
        base=cylinder(0.3, 0.22, 0.16, 16),
        tower=box(0.2, 0.36, 0.18).moved(y=-0.07),
        upper=bar(0.6, 0.18, 0.12),
        fore=bar(0.5, 0.14, 0.1),
        wrist=box(0.1, 0.1, 0.16),
        flange=cylinder(0.08, 0.06, 0.06, 12),
        fork=fork,
        table=box(0.7, 1.4, 0.3),
        can=cylinder(0.2, 0.06, 0.06, 12),
        shelf=shelf,
    )
    obstacles = [
        ("table", SAND, (1.0, 0, 0.15, 0, 0, 0)),
        ("can", GREEN, (0.85, 0.4, 0.4, 0, 0, 0)),
        ("shelf", BLUE, (0, depth - 1.4, height, 0, 0, 90)),
    ]
    environment = tag(
        "Environment",
        tag("Boundary", space="workspace", shape="box", limits="[-2:2 ; -2:2 ; -0.1:2.5]"),
        *(
            tag("MultiBody", tag("Base", **_drawn(name, rgb), type="fixed", transform=numbers(*pose)), type="passive")
            for name, rgb, pose in obstacles
        ),
        frictionCoefficient="0",
        gravity="0 0 0",
        positionRes="0.02",
        orientationRes="0.05",
    )
    half = math.pi / 2
    links = [
        # mesh, colour, its recentring, joint, limits, parent to DH, alpha a d theta, DH to child
        ("tower", DARK, "none", "revolute", "-1:1", (0, 0, 0.15), (half, 0, 0.26, 0.4), (0, 0, 0)),
        ("upper", ORANGE, "com", "revolute", "0:1", (0, 0, 0.16), (0, 0.6, 0, 1.1), (-0.3, 0, 0)),
        ("fore", STEEL, "com", "revolute", "-0.9:0.9", (0.3, 0, -0.12), (0, 0.5, 0, -1.5), (-0.25, 0, 0)),
        ("wrist", DARK, "com", "revolute", "-0.9:0.9", (0.25, 0, 0), (half, 0, 0, 0.4), (0, 0, 0)),
        ("flange", RED, "com", "revolute", "-1:1", (0, 0, 0), (0, 0, 0.13, 0), (0, 0, 0)),
        ("fork", RED, "none", "nonactuated", "", (0, 0, 0.05), (0, 0, 0, 0), (0, 0, 0)),
    ]
    robot = tag(
        "Robot",
        tag(
            "MultiBody",
            tag("Base", **_drawn("base", STEEL), type="fixed", transform="0 0 0.15 0 0 0"),
            *(_link(index, *link) for index, link in enumerate(links, 1)),
            type="active",
        ),
    )
    # From above the can, tool down, to the inside of the shelf, tool level.
    start, goal = (0.14, 0.2355, -0.2766, 0.0411, 0), (-0.5, 0.118, -0.473, 0.855, 0.5)
    return {
        "xml-arm.xml": problem("xml-arm-environment.xml", "xml-arm-robot.xml", start, goal),
        "xml-arm-environment.xml": xml(environment),
        "xml-arm-robot.xml": xml(robot),
        **solids,
    }


def _drawn(name: str, rgb: str, adjustment: str = "com") -> dict[str, str]:
    """Return the attributes of a body's mesh."""
    return {"filename": f"meshes/{name}.g", "comAdjustment": adjustment, "color": f"{rgb} 1"}


def _link(
    index: int,
    name: str,
    rgb: str,
    adjustment: str,
    joint: str,
    limits: str,
    to_dh: Sequence[float],
    dh: Sequence[float],
    to_child: Sequence[float],
) -> str:
    """Return a `<Link>`; all transforms here are translations."""
    connection = tag(
        "Connection",
        joint=joint,
        **({"range": limits} if limits else {}),
        parentIndex=str(index - 1),
        childIndex=str(index),
        transformParentToDH=numbers(*to_dh, 0, 0, 0),
        initialDHParams=numbers(*dh),
        transformDHToChild=numbers(*to_child, 0, 0, 0),
    )
    return tag("Link", connection, index=str(index), type="joint", **_drawn(name, rgb, adjustment))


SCENES: dict[str, Callable[[], Files]] = {
    "seed": seed,
    "gantry": gantry,
    "spherical-arm": spherical_arm,
    "closed-chain": closed_chain,
    "maze": maze,
    "alpha": alpha,
    "bug-trap": bug_trap,
    "two-robots": two_robots,
    "xml-arm": xml_arm,
}


# ---------------------------------------------------------------------------------------------------------------
# Output


def build() -> dict[str, bytes]:
    """Return every file of every scene by its path below this folder."""
    return {f"{scene}/{name}": text.encode() for scene, make in SCENES.items() for name, text in make().items()}


def write(folder: Path) -> None:
    """Write every scene into a folder."""
    for name, content in build().items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def differences(folder: Path) -> list[str]:
    """Return the files that a folder lacks, has in another state, or has in a scene without need."""
    built = build()
    found = {p.relative_to(folder).as_posix(): p for s in SCENES for p in (folder / s).rglob("*") if p.is_file()}
    wrong = [name for name, content in built.items() if name not in found or found[name].read_bytes() != content]
    return sorted([*wrong, *(found.keys() - built.keys())])


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the scenes, or compare; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 if the files differ")
    parser.add_argument("--out", type=Path, default=HERE, help="folder to write to or compare with")
    options = parser.parse_args(arguments)
    if not options.check:
        write(options.out)
        return 0
    wrong = differences(options.out)
    for name in wrong:
        print(f"{name}: differs from what build.py writes", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
