"""Write scenes of boxes, snakes and arms, the same at every run: meshes and env files, and problem files of groups."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from table import Case

Points = np.ndarray

# Of all scenes; each adds a number of its own.
SEED = 20240229
# Edge of the space in which 50 boxes lie; more boxes lie in more space, so that only their number differs.
SIDE_OF_50 = 13.0
# Distance between the middles of two copies of the maze, a little more than its boundary is wide.
MAZE_TILE = (78.0, 71.0)


@dataclass(frozen=True, slots=True)
class Placed:
    """An obstacle: a mesh file, a position, and three angles in degrees, as an env file gives them."""

    mesh: str
    position: Sequence[float]
    angles: Sequence[float] = (0.0, 0.0, 0.0)


def cube_among_boxes(folder: Path, boxes: int) -> Case:
    """Return a free cube among random boxes of one density."""
    side = SIDE_OF_50 * (boxes / 50) ** (1 / 3)
    write_mesh(folder / "cube.g", trimesh.creation.box((1.0, 1.0, 1.0)))
    robot = ["1", "cube.g Volumetric Rotational", "Connections", "0"]
    return scene(folder, f"boxes{boxes}", side, robot, _boxes(folder, boxes, side, boxes))


def snake_among_boxes(folder: Path, links: int = 64, boxes: int = 50) -> Case:
    """Return a chain of boxes with a free base, whose hinges turn about y and z by turns."""
    side, length = 24.0, 0.5
    # The hinge is at the end of one link and the beginning of the next; gaps keep the neighbours of neighbours apart.
    write_mesh(folder / "segment.g", trimesh.creation.box((0.8 * length, 0.2, 0.2)))
    robot = [str(links), "segment.g Volumetric Rotational", *["segment.g Joint"] * (links - 1), "Connections"]
    robot.append(str(links - 1))
    for i in range(links - 1):
        turn = 90 if i % 2 else 0
        # A fifth of a turn at most to either side: a chain of whole turns is a ball that always touches itself.
        robot += [
            f"{i} {i + 1} Revolute -0.4:0.4",
            f"{length / 2} 0 0 {turn} 0 0   0 0 0 0   {length / 2} 0 0 {-turn} 0 0",
        ]
    return scene(folder, "snake64", side, robot, _boxes(folder, boxes, side, 64))


def arm_among_obstacles(folder: Path, obstacles: int = 30) -> Case:
    """Return an arm of seven round links of about 500 triangles on a fixed base, among boxes and balls."""
    length, radius = 0.5, 0.09
    capsule = trimesh.creation.capsule(height=length - 2 * radius - 0.06, radius=radius, count=(18, 16))
    capsule.apply_translation(-capsule.centroid)
    write_mesh(folder / "link.g", capsule)
    write_mesh(folder / "base.g", trimesh.creation.box((0.3, 0.3, 0.2)))
    robot = ["8", "base.g Fixed 0 0 0 0 0 0", *["link.g Joint"] * 7, "Connections", "7"]
    # The links stand along z; hinges are about z for the first one, then about x and y by turns.
    robot += ["0 1 Revolute -1:1", f"0 0 0.12 0 0 0   0 0 0 0   0 0 {length / 2} 0 0 0"]
    for i in range(1, 7):
        angles = ("0 90 0", "0 -90 0") if i % 2 else ("90 0 0", "-90 0 0")
        robot += [
            f"{i} {i + 1} Revolute -0.8:0.8",
            f"0 0 {length / 2} {angles[0]}   0 0 0 0   {_turned(angles[0], length / 2)} {angles[1]}",
        ]
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.25)
    write_mesh(folder / "ball.g", ball)
    rng = np.random.default_rng(SEED + 7)
    placed = []
    for i in range(obstacles):
        direction = rng.normal(size=3)
        direction[2] = abs(direction[2])
        position = direction / np.linalg.norm(direction) * rng.uniform(1.2, 3.2)
        if i % 2:
            placed.append(Placed("ball.g", position))
        else:
            name = f"block{i}.g"
            write_mesh(folder / name, trimesh.creation.box(rng.uniform(0.2, 0.6, 3)))
            placed.append(Placed(name, position, rng.uniform(-180, 180, 3)))
    return scene(folder, "arm7", 9.0, robot, placed)


def robots_in_groups(folder: Path, number: int) -> Case:
    """Return a problem file of two to four boxes, with an arm or without, that move alone and in groups.

    Starts and goals are drawn in one cube, in which three boxes stand: about half of them are free. Some robots have
    several tasks and some none; robots of a group visit different numbers of configurations. The files lie in a folder
    of their own.
    """
    folder = folder / f"groups{number}"
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng((SEED, number))
    count = int(rng.integers(2, 5))
    bases = [str(rng.choice(list(_BASES))) for _ in range(count)]
    arms = [bool(rng.integers(2)) for _ in range(count)]
    problem = ['<Environment filename="scene.env"/>']
    for i, (base, arm) in enumerate(zip(bases, arms, strict=True)):
        sides = rng.uniform(0.3, 1.2, 3)
        write_mesh(folder / f"r{i}.g", trimesh.creation.box(sides))
        robot = [str(1 + arm), f"r{i}.g {base}", *[f"r{i}.g Joint"] * arm, "Connections"]
        half = f"{float(sides[0]) / 2 + 0.05!r} 0 0 0 0 0"
        robot += [str(int(arm)), *["0 1 Revolute -1:1", f"{half}   0 0 0 0   {half}"] * arm]
        (folder / f"r{i}.robot").write_text("\n".join(robot) + "\n", encoding="utf-8")
        problem.append(f'<Robot label="r{i}" filename="r{i}.robot"/>')
    for task in range(int(rng.integers(1, 4))):
        members = rng.permutation(count)[: int(rng.integers(1, count + 1))]
        steps = [
            f'<Task label="t{task}" robot="r{i}">{_constraints(rng, _BASES[bases[i]], arms[i])}</Task>' for i in members
        ]
        if len(members) == 1:
            problem += steps
        else:
            problem.append(f'<RobotGroup label="g{task}" robotLabels="{" ".join(f"r{i}" for i in members)}"/>')
            problem += [f'<GroupTask label="t{task}" group="g{task}">', *steps, "</GroupTask>"]
    lines = ["Boundary Box [-9:9 ; -9:9 ; -9:9]", "Multibodies", "3"]
    for thing in _boxes(folder, 3, 6.0, 1000 + number):
        lines += ["Passive", f"{thing.mesh} {' '.join(repr(float(x)) for x in (*thing.position, *thing.angles))}"]
    (folder / "scene.env").write_text("\n".join(lines) + "\n", encoding="utf-8")
    path = folder / f"groups{number}.xml"
    text = "\n".join(["<MotionPlanning>", "<Problem>", *problem, "</Problem>", "</MotionPlanning>"])
    path.write_text(text + "\n", encoding="utf-8")
    return Case(path.stem, path)


# How many lengths and angles place a base.
_BASES = {"Volumetric Rotational": (3, 3), "Planar Rotational": (2, 1), "Planar Translational": (2, 0)}


def _constraints(rng: np.random.Generator, base: tuple[int, int], arm: bool) -> str:
    """Return a start and up to three goals of a robot."""

    def point() -> str:
        numbers = [*rng.uniform(-3, 3, base[0]), *rng.uniform(-1, 1, base[1] + arm)]
        return f'<CSpaceConstraint point="{" ".join(repr(float(x)) for x in numbers)}"/>'

    goals = "".join(point() for _ in range(int(rng.integers(1, 4))))
    return f"<StartConstraints>{point()}</StartConstraints><GoalConstraints>{goals}</GoalConstraints>"


def rounded_solids(folder: Path, number: int) -> Case:
    """Return a free convex solid among others, turned at random and written in single precision."""
    folder = folder / f"rounded{number}"
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng((SEED, number))
    solids = {
        "box": trimesh.creation.box((1, 0.5, 1.5)),
        "cylinder": trimesh.creation.cylinder(0.4, 1, sections=40),
        "capsule": trimesh.creation.capsule(1, 0.3, count=[8, 8]),
        "ball": trimesh.creation.icosphere(2, 0.6),
    }
    for name, solid in solids.items():
        solid.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
        solid.export(folder / f"{name}.stl")
    robot, *others = *(f"{name}.stl" for name in rng.permutation(list(solids))), "box.stl"
    placed = [Placed(mesh, rng.uniform(-1.5, 1.5, 3), rng.uniform(-180, 180, 3)) for mesh in others]
    return scene(folder, folder.name, 18.0, ["1", f"{robot} Volumetric Rotational", "Connections", "0"], placed)


def maze_copies(folder: Path, maze: Case, copies: int) -> Case:
    """Return the maze with its walls once, 4 or 16 times, side by side; its meshes stay where they are."""
    lines = maze.path.read_text(encoding="utf-8").splitlines()
    # Colours are of no use here, and hold spaces.
    walls = [re.sub(r"-c\(.*?\)", "", line).split() for line in lines if line.startswith("block")]
    edge = round(copies**0.5)
    text = [*_boundary_of_tiles(edge), "", "Multibodies", str(len(walls) * copies), ""]
    for x, y in tile_offsets(copies):
        for mesh, px, py, *rest in walls:
            text += ["Passive", " ".join([mesh, str(float(px) + x), str(float(py) + y), *rest]), ""]
    path = folder / f"maze{copies}.env"
    path.write_text("\n".join(text), encoding="utf-8")
    options: dict[str, Any] = {"robots": maze.options["robots"], "mesh_dirs": [maze.path.parent], "allow_outside": True}
    return Case(f"maze{copies}", path, options)


def tile_offsets(copies: int) -> Points:
    """Return by how much each copy of the maze is moved, (copies, 2); the first ones surround the origin."""
    edge = round(copies**0.5)
    x, y = np.meshgrid(np.arange(edge), np.arange(edge), indexing="ij")
    return np.stack([x.ravel(), y.ravel()], axis=1) * MAZE_TILE


def _boundary_of_tiles(edge: int) -> list[str]:
    x, y = ((edge - 1) * t for t in MAZE_TILE)
    return [f"Boundary Box2D [-38.5:{38.8 + x} ; -35:{35 + y}]"]


def _boxes(folder: Path, count: int, side: float, seed: int) -> Iterable[Placed]:
    """Yield boxes of ten shapes, placed and turned at random in a cube."""
    rng = np.random.default_rng(SEED + seed)
    shapes = min(count, 10)
    for i in range(shapes):
        write_mesh(folder / f"box{i}.g", trimesh.creation.box(rng.uniform(0.5, 2.0, 3)))
    for i in range(count):
        position, angles = rng.uniform(-side / 2, side / 2, 3), rng.uniform(-180, 180, 3)
        yield Placed(f"box{i % shapes}.g", position, angles)


def _turned(angles: str, z: float) -> str:
    """Return the vector (0, 0, z) in a frame turned by one right angle, about x or y."""
    about_x, about_y, _ = (float(a) for a in angles.split())
    return f"0 {z if about_x else 0} {z if not about_x and not about_y else 0}" if not about_y else f"{-z} 0 0"


def scene(folder: Path, name: str, side: float, robot: Sequence[str], obstacles: Iterable[Placed]) -> Case:
    """Write a scene in a cubic boundary, and return it."""
    placed = list(obstacles)
    bounds = " ; ".join([f"{-side / 2!r}:{side / 2!r}"] * 3)
    lines = [f"Boundary Box [{bounds}]", "", "Multibodies", str(1 + len(placed)), "", "Active", *robot, ""]
    for thing in placed:
        numbers = " ".join(repr(float(x)) for x in (*thing.position, *thing.angles))
        lines += ["Passive", f"{thing.mesh} {numbers}", ""]
    path = folder / f"{name}.env"
    path.write_text("\n".join(lines), encoding="utf-8")
    return Case(name, path)


def write_mesh(path: Path, mesh: trimesh.Trimesh) -> None:
    """Write a mesh by its extension, `.g` and `.obj` with all digits and the vertices in their order."""
    vertices, faces = mesh.vertices, mesh.faces + 1
    if path.suffix == ".stl":
        mesh.export(path)
        return
    points = [" ".join(repr(float(x)) for x in v) for v in vertices]
    if path.suffix == ".obj":
        lines = [*(f"v {p}" for p in points), *(f"f {a} {b} {c}" for a, b, c in faces)]
    else:
        lines = [f"1 {len(vertices)} {len(faces)} {faces.size}", f"1 {len(faces)}", *points]
        lines += [f"{a} {b} {-c}" for a, b, c in faces]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
