"""Closed meshes that are not convex, and what is asked of their cells."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from meshes import box, channel, joined, moved, rotation, turned

from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.geometry.mesh import Mesh, load_mesh
from env2mjcf.geometry.orientation import winding_numbers
from env2mjcf.geometry.pieces import ConvexPiece, hull_volume
from env2mjcf.geometry.repair import repaired
from env2mjcf.geometry.shapes import CollisionShape, collision_shape
from env2mjcf.geometry.shells import Shells, shells
from env2mjcf.limits import Limits

PIN = 5e-6  # of the diagonal


CORPUS_MESHES = [
    "tunnel.g", "block1.obj", "block2.obj", "block3.obj", "wall0.g", "wall1.g", "wall2.g", "wall3.g", "wall4.g",
    "alphaobstacle.obj", "alpharobot.obj", "trap.obj", "S2Dharder1.obj", "S2Dharder2.obj", "clutter7.obj",
 "ztunnel3.obj", "Ztunnel_wsides.obj", "block.g", "mywall_leftlower.g", "bright_122.obj",
]  # fmt: skip


def of_trimesh(name: str, mesh: trimesh.Trimesh) -> Mesh:
    return Mesh.from_arrays(name, mesh.vertices, mesh.faces)


def bumpy(subdivisions: int, bump: float, seed: int = 0) -> Mesh:
    ball = trimesh.creation.icosphere(subdivisions)
    radius = 1 + bump * np.random.default_rng(seed).random(len(ball.vertices))
    return Mesh.from_arrays("bumpy", ball.vertices * radius[:, None], ball.faces)


def hollow_box() -> Mesh:
    return joined(box((4, 4, 4)), turned(box((2, 2, 2))))


def edge_sharing_steps() -> Mesh:
    """Two L-shaped channels that meet in one edge only: closed, and four faces at that edge."""
    a = channel(1.0)
    b = moved(a, np.diag([1.0, -1.0, -1.0]), (0, 6, 6))
    return joined(a, turned(turned(b)), moved(a, np.eye(3), (0, -3, -3)))


def star(points: int = 7) -> Mesh:
    """A spiked prism: sharp convex edges next to deep reflex ones."""
    angle = np.arange(2 * points) * np.pi / points
    radius = np.where(np.arange(2 * points) % 2, 0.2, 1.0)
    outline = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    n = 2 * points
    vertices = np.vstack([np.column_stack([outline, np.full(n, z)]) for z in (0.0, 0.3)] + [[[0, 0, 0], [0, 0, 0.3]]])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    sides = np.concatenate([np.stack([i, j, j + n], 1), np.stack([i, j + n, i + n], 1)])
    caps = np.concatenate([np.stack([j, i, np.full(n, 2 * n)], 1), np.stack([i + n, j + n, np.full(n, 2 * n + 1)], 1)])
    return Mesh.from_arrays("star", vertices, np.concatenate([sides, caps]))


def thin_bottom(gap: float) -> Mesh:
    """A block with a pit that leaves `gap` of it at the bottom."""
    section = np.array([[0, 0], [3, 0], [3, 3], [2, 3], [2, gap], [1, gap], [1, 3], [0, 3]], dtype=float)
    mesh = channel()
    return Mesh.from_arrays(
        "pit", np.vstack([np.column_stack([np.full(8, x), section]) for x in (0.0, 4.0)]), mesh.faces
    )


MESHES = {
    "channel": channel(),
    "turned channel": moved(channel(), rotation(2), (100, -50, 20)),
    "hollow box": hollow_box(),
    "torus": of_trimesh("torus", trimesh.creation.torus(1.0, 0.3, major_sections=16, minor_sections=8)),
    "annulus": of_trimesh("annulus", trimesh.creation.annulus(0.5, 1.0, 0.4, sections=16)),
    "bumpy": bumpy(2, 0.4),
    "spiky": bumpy(2, 3.0),
    "star": star(),
    "sharing an edge": edge_sharing_steps(),
    "thin bottom": thin_bottom(0.01),
    "thinner than a pin": thin_bottom(1e-5),
    "overlapping": joined(channel(), moved(channel(), rotation(5), (1, 1, 0.5))),
}  # fmt: skip


MODEL_MESHES = [
    "alpha/alpha.g", "bug-trap/bottle.g", "bug-trap/bug.g", "maze/meshes/maze.g", "maze/meshes/bent.g",
]  # fmt: skip


def crossing_prism(seed: int) -> Mesh:
    """A prism whose outline crosses itself: some parts of it are wound the wrong way round, some twice."""
    outline = np.random.default_rng(seed).normal(size=(7, 2))
    n = len(outline)
    middle = outline.mean(axis=0)
    levels = [np.column_stack([outline, np.full(n, z)]) for z in (0.0, 0.3)]
    vertices = np.vstack([*levels, [[*middle, 0.0], [*middle, 0.3]]])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    sides = np.concatenate([np.stack([i, j, j + n], 1), np.stack([i, j + n, i + n], 1)])
    caps = np.concatenate([np.stack([j, i, np.full(n, 2 * n)], 1), np.stack([i + n, j + n, np.full(n, 2 * n + 1)], 1)])
    return Mesh.from_arrays("crossing", vertices, np.concatenate([sides, caps]))


def loaded(path: Path) -> Mesh:
    return load_mesh(path, DiagnosticLog(), Limits())


def lined(mesh: Mesh) -> tuple[CollisionShape, list[ConvexPiece]]:
    """The shape, and its pieces that stand for polygons."""
    a = repaired(mesh).analysis
    shape = collision_shape(mesh, a, "solid", PIN * a.diagonal, DiagnosticLog())
    return shape, [p for p in shape.pieces if p.polygon is not None]


def shelled(mesh: Mesh) -> Shells:
    a = repaired(mesh).analysis
    return shells(a, np.arange(len(a.faces)), PIN * a.diagonal)


def height(shape: CollisionShape, piece: ConvexPiece) -> float:
    assert piece.polygon is not None
    return float(np.ptp(piece.vertices @ piece.polygon.normal))


def protrusion(shape: CollisionShape, pieces: list[ConvexPiece], *, samples: int = 10) -> float:
    """Greatest distance from the solid of the pieces' corners and points between them, in units of the diagonal."""
    rng = np.random.default_rng(0)
    points = [p.center + np.vstack([np.eye(n), rng.dirichlet(np.ones(n), samples)]) @ p.vertices
              for p in pieces for n in [len(p.vertices)]]  # fmt: skip
    cloud = np.concatenate(points)
    if len(cloud) > 6000:
        cloud = cloud[rng.choice(len(cloud), 6000, replace=False)]
    a = shape.analysis
    outside = cloud[winding_numbers(cloud, a.vertices, a.faces) < 0.5][:400]
    if len(outside) == 0:
        return 0.0
    surface = trimesh.Trimesh(a.vertices, a.faces, process=False)
    return float(np.abs(trimesh.proximity.closest_point_naive(surface, outside)[1]).max() / a.diagonal)


def assert_inside_and_covering(mesh: Mesh, *, pinned: int = 0) -> None:
    shape, pieces = lined(mesh)
    a = shape.analysis
    assert shape.strategy == "solid"
    assert shape.needs_containment
    # A height about the pins' own: cells that deserve the name are a good deal thicker.
    cells = [p for p in pieces if height(shape, p) > 1.5 * PIN * a.diagonal]
    assert len(pieces) - len(cells) <= pinned
    # Polygons may be bent by a tenth of a pin's height, and cells be off by as much at their tops and sides.
    loops = [(a.vertices[list(p.polygon.loop)], p.polygon.normal) for p in pieces]
    bend = max(float(np.abs((loop - loop.mean(axis=0)) @ normal).max()) for loop, normal in loops)
    assert bend <= 0.1 * PIN * a.diagonal
    tolerance = max(1e-9 * a.diagonal, 2 * bend)
    assert protrusion(shape, cells) * a.diagonal <= tolerance
    parts: dict[tuple[int, ...], list[ConvexPiece]] = {}
    for piece in pieces:
        parts.setdefault(piece.polygon.faces, []).append(piece)
    area = 0.0
    for same in parts.values():
        corners = a.vertices[list(same[0].polygon.loop)]
        area += area_of(corners)
        if all(piece in cells for piece in same):
            assert_outer_faces_are(same, corners, tolerance)
    assert area == pytest.approx(a.area, rel=1e-9)
    if len(pieces) == len(shape.pieces):
        assert sorted(f for faces in parts for f in faces) == list(range(len(a.faces)))


def area_of(corners: np.ndarray) -> float:
    return float(
        np.linalg.norm(np.cross(corners - corners[0], np.roll(corners, -1, axis=0) - corners[0]).sum(axis=0)) / 2
    )


def assert_outer_faces_are(cells: list[ConvexPiece], corners: np.ndarray, tolerance: float) -> None:
    """One cell has the polygon for its outer face; the outer faces of several are in it, and make up its area."""
    normal = cells[0].polygon.normal
    outer = []
    for cell in cells:
        points = cell.vertices + cell.center
        above = (points - corners.mean(axis=0)) @ normal
        assert above.max() <= tolerance
        outer.append(points[above > -tolerance])
    if len(cells) == 1:
        assert_same_outline(outer[0], corners, normal, tolerance)
        return
    sides = np.cross(normal, np.roll(corners, -1, axis=0) - corners)
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    for points in outer:
        assert (np.einsum("ej,pej->pe", sides, points[:, None] - corners) >= -tolerance).all()
    # A slab of height one over each face has the face's area for its volume.
    slabs = [hull_volume(np.vstack([points, points - normal]) - points[0]) for points in outer]
    assert sum(slabs) == pytest.approx(area_of(corners), rel=1e-6)


def assert_same_outline(found: np.ndarray, corners: np.ndarray, normal: np.ndarray, tolerance: float) -> None:
    """Both point sets lie in one plane and have the same convex hull; the corners go round it in order."""
    apart = np.linalg.norm(found[:, None] - corners[None], axis=2)
    assert apart.min(axis=1).max() <= tolerance
    for a, b, missing in zip(corners, np.roll(corners, -1, axis=0), apart.min(axis=0) > tolerance, strict=True):
        side = np.cross(normal, b - a)
        side /= np.linalg.norm(side)
        # Every edge supports the points found, on both of its ends unless those are left out as collinear.
        assert abs(((found - a) @ side).min()) <= tolerance
        assert not missing or len(found) < len(corners)
