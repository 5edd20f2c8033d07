"""From a compiled scene to the tables of the exact engine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...geometry.assembly import Assembly
from ...geometry.topology import Floats, Ints
from ...kinematics.space import ConfigurationSpace
from ...model.environment import Boundary
from ...pairs import Pair
from ...transforms import inverse, shifted, transform
from ..containment import boundary_slack
from ..surfaces import Surfaces
from .motions import Motions
from .tables import LANES, BoundaryKind, Tables, packed
from .wide_tree import box_tree, depth, wide_tree


def scene_tables(
    assembly: Assembly, space: ConfigurationSpace, pairs: Sequence[Pair], surfaces: Surfaces
) -> tuple[Ints, Floats]:
    """Return the tables of a scene, see `tables.packed`.

    Args:
        assembly: The scene.
        space: Its configuration space.
        pairs: The tested pairs that move.
        surfaces: Of all bodies.
    """
    shapes = _Shapes(surfaces)
    parts = assembly.links
    motions = Motions()
    steps: list[int] = []
    for robot, columns in zip(assembly.robots, space.robot_slices, strict=True):
        frames = [shifted(np.eye(4), p.mesh.center) @ shapes.frame(p.name) for p in robot.links]
        steps += motions.add(robot.kinematics, columns.start, frames)
    obstacles = _Obstacles(assembly, shapes)
    number = {p.name: i for i, p in enumerate(parts)}
    links = [
        (step, shapes.number(name), obstacles.root([p.other for p in pairs if p.link == name and p.kind == "obstacle"]))
        for name, step in zip(number, steps, strict=True)
    ]
    vertices = [_into(shapes.frame(p.name), p.mesh.used_vertices) for p in parts]
    first = np.cumsum([0, *map(len, vertices)])
    constants, of_steps = motions.arrays()
    kind, bounds = _bounds(assembly.boundary, boundary_slack(assembly))
    rows, halves, children = shapes.rows()
    tables = Tables(
        steps=of_steps,
        links=[(*link, first[i], first[i + 1]) for i, link in enumerate(links)],
        shapes=rows,
        children=children,
        obstacles=obstacles.shapes,
        top_children=_joined(obstacles.child),
        pairs=[(number[p.link], number[p.other]) for p in pairs if p.kind != "obstacle"],
        counts=(int(kind), obstacles.stack, shapes.stack),
        constants=constants,
        halves=halves,
        boxes=_joined([t.boxes for t in shapes.trees]),
        blocks=_joined([t.blocks for t in shapes.trees]),
        points=_joined(shapes.points),
        poses=[p[:3].ravel() for p in obstacles.poses],
        top_boxes=_joined(obstacles.boxes),
        limits=np.stack(space.joint_limits, axis=1),
        vertices=_joined(vertices),
        boundary=bounds,
    )
    return packed(tables)


def _bounds(boundary: Boundary | None, slack: float) -> tuple[BoundaryKind, Floats]:
    """Return what links must stay within, as `Tables.boundary` has it, with room for rounding."""
    bounds = np.array([[-np.inf] * 3, [np.inf] * 3])
    if boundary is None:
        return BoundaryKind.NONE, bounds
    if boundary.lower:
        axes = len(boundary.lower)
        bounds[0, :axes], bounds[1, :axes] = np.array(boundary.lower) - slack, np.array(boundary.upper) + slack
        return BoundaryKind.BOX, bounds
    bounds[:] = 0.0
    bounds[0, : len(boundary.center)] = boundary.center
    bounds[1, :2] = boundary.radius + slack, len(boundary.center)
    return BoundaryKind.BALL, bounds


class _Shapes:
    """The distinct meshes, each in a frame in which its box is small."""

    def __init__(self, surfaces: Surfaces) -> None:
        self._surfaces = surfaces
        count = len(surfaces.trees.roots)
        self._frames = [_frame(surfaces, k) for k in range(count)]
        placed = [_into(self._frames[k], surfaces.surface(k).triangles) for k in range(count)]
        self.points = [_into(self._frames[k], surfaces.surface(k).points) for k in range(count)]
        # A tree over each shape; after them, one over the closed pieces of each that has open ones, too.
        self.trees = [wide_tree(t) for t in placed]
        self._enclosing = list(range(count))
        for k in range(count):
            rows = surfaces.surface(k).enclosing
            if 0 < len(rows) < len(placed[k]):
                self._enclosing[k] = len(self.trees)
                self.trees.append(wide_tree(placed[k][rows]))
        # Walks over two trees hold two numbers for each place, and at most one lane less than a node's on each level.
        deepest = max((depth(t.child) for t in self.trees), default=1)
        self.stack = 2 * LANES * (2 * deepest + 1)

    def number(self, name: str) -> int:
        """Return the shape of a body; -1 for none."""
        index = self._surfaces.index.get(name)
        return -1 if index is None else int(self._surfaces.tree[index])

    def frame(self, name: str) -> Floats:
        """Return the pose of a shape's frame in its body's, (4, 4)."""
        number = self.number(name)
        return np.eye(4) if number < 0 else self._frames[number]

    def box(self, number: int) -> Floats:
        """Return the half sizes of a shape's box."""
        box = self._surfaces.surface(number).box
        return self.trees[number].boxes[0, 3:, 0] if box is None else np.sort(box.half_sizes)[::-1]

    def rows(self) -> tuple[list[tuple[int, ...]], list[tuple[float, ...]], NDArray[Any]]:
        """Return the tables of shapes, of half sizes, and of the children of the trees' nodes."""
        nodes = np.cumsum([0, *(len(t.child) for t in self.trees)])
        blocks = np.cumsum([0, *(len(t.blocks) for t in self.trees)])
        points = np.cumsum([0, *map(len, self.points)])
        children: list[Ints] = []
        starts: list[int] = []
        for k, tree in enumerate(self.trees):
            child = np.where(tree.child > 0, tree.child + nodes[k], tree.child)
            children.append(np.where(tree.child < 0, tree.child - blocks[k], child))
            # The root has one lane, the whole, which is tested before walks begin; unless that is all there is.
            starts.append(int(nodes[k] + max(int(tree.child[0, 0]), 0)))
        rows: list[tuple[int, ...]] = []
        halves: list[tuple[float, ...]] = []
        for k, enclosing in enumerate(self._enclosing):
            surface = self._surfaces.surface(k)
            kind = (int(surface.box is not None), surface.solid * (1 if surface.alike else 2))
            rows.append((int(nodes[k]), starts[k], *kind, int(points[k]), int(points[k + 1]), starts[enclosing]))
            # The least diagonal of a component's box, where it is known.
            size = float(np.linalg.norm(np.ptp(surface.corners, axis=0))) if len(surface.points) == 1 else 0.0
            halves.append((*self.box(k), size))
        return rows, halves, _joined(children)


class _Obstacles:
    """Trees over the obstacles that links are tested with: one for each set of them."""

    def __init__(self, assembly: Assembly, shapes: _Shapes) -> None:
        self._names = [p.name for p in assembly.obstacles]
        self.shapes = [shapes.number(n) for n in self._names]
        places = [p.mesh_pose for p in assembly.obstacles]
        self.poses = [m @ shapes.frame(p.name) for p, m in zip(assembly.obstacles, places, strict=True)]
        corners = [
            p.analysis.vertices @ m[:3, :3].T + m[:3, 3] for p, m in zip(assembly.obstacles, places, strict=True)
        ]
        self._low = np.array([c.min(axis=0) for c in corners]).reshape(-1, 3)
        self._high = np.array([c.max(axis=0) for c in corners]).reshape(-1, 3)
        self._roots: dict[frozenset[str], int] = {frozenset(): -1}
        self.boxes: list[Floats] = []
        self.child: list[Ints] = []
        self.stack = LANES

    def root(self, names: Sequence[str]) -> int:
        """Return the root of the tree over these obstacles; -1 for none."""
        key = frozenset(names)
        if key not in self._roots:
            rows = np.array([i for i, n in enumerate(self._names) if n in key], dtype=np.int64)
            boxes, child = box_tree(self._low[rows], self._high[rows])
            self.stack = max(self.stack, LANES * (depth(child) + 1))
            first = sum(map(len, self.child))
            # The root has one lane, the whole; walks begin below it, unless that is all there is.
            start = first + max(int(child[0, 0]), 0)
            leaf = child < 0
            child[leaf] = ~rows[~child[leaf]]
            child[child > 0] += first
            self._roots[key] = start
            self.boxes.append(boxes)
            self.child.append(child)
        return self._roots[key]


def _frame(surfaces: Surfaces, number: int) -> Floats:
    """Return the pose of a mesh's box in the mesh's frame, (4, 4): the box that it is, else a small one around it.

    z is its shortest side: rays along it pass the fewest triangles.
    """
    box, trees = surfaces.surface(number).box, surfaces.trees
    root = trees.roots[number]
    center, axes, half = (
        (trees.center[root], trees.frame[root], trees.half[root])
        if box is None
        else (box.center, box.rotation, box.half_sizes)
    )
    axes = axes[:, np.argsort(-half, kind="stable")]
    return transform(axes * np.array([1.0, 1.0, np.sign(np.linalg.det(axes))]), center)


def _into(frame: Floats, points: Floats) -> Floats:
    """Return points, (..., 3), in a frame."""
    back = inverse(frame)
    return points @ back[:3, :3].T + back[:3, 3]


def _joined(arrays: Sequence[Floats] | Sequence[Ints]) -> NDArray[Any]:
    return np.concatenate(arrays) if len(arrays) else np.zeros(0)
