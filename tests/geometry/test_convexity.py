"""Which closed surfaces are convex, and by how much: against hulls of scipy's, and sizes known by algebra."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
import trimesh
from meshes import Floats, box, moved, rotation
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.geometry.analysis import Analysis, analyse
from env2mjcf.geometry.certificate import certify
from env2mjcf.geometry.convexity import concavity
from env2mjcf.geometry.mesh import Mesh, load_mesh
from env2mjcf.geometry.repair import repaired
from env2mjcf.geometry.shapes import CollisionShape, collision_shape
from env2mjcf.geometry.topology import Ints
from env2mjcf.limits import Limits

BAND = 1e-5
SHARE = BAND / 10
"""How far a convex surface may lie inside its hull, in units of the extent."""

SOLIDS = {
    "box": trimesh.creation.box((2, 1, 3)),
    "plate": trimesh.creation.box((2, 1, 0.004)),
    "cut box": trimesh.creation.box((2, 1, 3)).subdivide().subdivide().subdivide(),
    "cylinder": trimesh.creation.cylinder(0.7, 2, sections=100),
    "cut cylinder": trimesh.creation.cylinder(0.7, 2, sections=24).subdivide().subdivide(),
    "cone": trimesh.creation.cone(0.7, 2, sections=100),
    "needle": trimesh.creation.cone(0.02, 3, sections=40),
    "capsule": trimesh.creation.capsule(2, 0.5, count=[16, 16]),
    "ball": trimesh.creation.icosphere(2, 1.3),
    "globe": trimesh.creation.uv_sphere(1.2, count=[20, 20]),
    "lens": trimesh.creation.icosphere(2).apply_scale((1.5, 1.5, 0.01)),
    "stone": trimesh.convex.convex_hull(np.random.default_rng(5).standard_normal((300, 3))),
}


def text_of(vertices: Floats, faces: Ints, suffix: str) -> str:
    """A mesh with six digits behind the point, as most programs print it."""
    if suffix == ".obj":
        lines = [
            *("v {:.6f} {:.6f} {:.6f}".format(*v) for v in vertices),
            *("f {} {} {}".format(*f + 1) for f in faces),
        ]
        return "\n".join(lines) + "\n"
    head = [f"1 {len(vertices)} {len(faces)} {3 * len(faces)}", f"1 {len(faces)}"]
    lines = [*("{:.6f} {:.6f} {:.6f}".format(*v) for v in vertices), *("{} {} -{}".format(*f + 1) for f in faces)]
    return "\n".join([*head, *lines]) + "\n"


def rounded(solid: trimesh.Trimesh, suffix: str, folder: Path, seed: int) -> Mesh:
    """Turn, enlarge and move a solid, and write and load it."""
    rng = np.random.default_rng(seed)
    vertices = solid.vertices @ Rotation.random(random_state=rng).as_matrix().T * rng.uniform(0.8, 3)
    vertices = vertices + rng.uniform(-3, 3, 3)
    path = folder / f"solid{suffix}"
    if suffix == ".stl":
        trimesh.Trimesh(vertices, solid.faces, process=False).export(path)
    else:
        path.write_text(text_of(vertices, np.asarray(solid.faces), suffix))
    return load_mesh(path, DiagnosticLog(), Limits())


def shaped(mesh: Mesh, extent: float) -> tuple[Analysis, CollisionShape]:
    analysis = repaired(mesh, concave=SHARE * extent).analysis
    return analysis, collision_shape(mesh, analysis, "auto", BAND / 2 * extent, DiagnosticLog())


def deepest(vertices: Floats, faces: Ints) -> float:
    """Return how deep inside their hull points of triangles lie: corners, five to an edge, and inside."""
    i, j = (x.ravel() for x in np.meshgrid(np.arange(5), np.arange(5)))
    weights = np.stack([4 - i - j, i, j], axis=1)[i + j <= 4] / 4
    points = np.unique(np.einsum("sk,fki->fsi", weights, vertices[faces]).reshape(-1, 3), axis=0)
    # Moved to the origin, or rounding of the planes' offsets counts.
    middle = vertices.mean(axis=0)
    planes = np.unique(ConvexHull(vertices - middle).equations, axis=0)
    blocks = np.array_split(points - middle, 1 + len(points) * len(planes) // 4_000_000)
    return max(float((-(p @ planes[:, :3].T + planes[:, 3])).min(axis=1).max()) for p in blocks)


@pytest.mark.slow_but("box-.stl", "needle-.g", "globe-.obj")
@pytest.mark.parametrize("suffix", [".stl", ".g", ".obj"])
@pytest.mark.parametrize("name", SOLIDS)
def test_rounded_convex_meshes_are_one_hull(name: str, suffix: str, tmp_path: Path) -> None:
    for seed in range(3):
        mesh = rounded(SOLIDS[name], suffix, tmp_path, seed)
        analysis, shape = shaped(mesh, mesh.diagonal)
        assert analysis.convex
        assert (len(shape.pieces), shape.needs_containment) == (1, False)
        deep = deepest(analysis.vertices, analysis.faces)
        assert deep <= analysis.concavity + 1e-12 <= SHARE * mesh.diagonal
        assert shape.note == f"convex to {analysis.concavity:.2g} m: one hull" or deep <= 1e-9 * mesh.diagonal
        proof = certify(shape, BAND / 2 * mesh.diagonal)
        assert proof.exact
        assert proof.reach_added >= deep


def test_the_figure_of_a_box_in_single_precision(tmp_path: Path) -> None:
    # Rounding moves each corner by half a unit in the last place, 1.2e-7 up to 2 and 2.4e-7 up to 4.
    mesh = rounded(SOLIDS["box"], ".stl", tmp_path, 1)
    analysis, shape = shaped(mesh, mesh.diagonal)
    deep = deepest(analysis.vertices, analysis.faces)
    assert 1e-9 < deep < 8e-7
    assert deep <= analysis.concavity < 8e-7
    assert shape.note.startswith("convex to ")
    assert not analyse(mesh).convex  # nothing is given: to a billionth of the diagonal


def dented(depth: float) -> Mesh:
    """A cube with a vertex in the middle of its top, so far down."""
    faces = np.vstack([box().faces[:10], [[1, 5, 8], [5, 7, 8], [7, 3, 8], [3, 1, 8]]])
    return Mesh.from_arrays("dented", np.vstack([box().vertices, [[0, 0, 0.5 - depth]]]), faces)


def twisted(angle: float, bulging: bool) -> Mesh:
    """A prism on a square whose top is turned: each side is two triangles, which meet in a valley or a ridge."""
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], dtype=float)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    vertices = np.vstack([np.column_stack([c, np.full(4, z)]) for c, z in ((corners, 0.0), (corners @ turn.T, 1.0))])
    faces = [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]]
    for a in range(4):
        b = (a + 1) % 4
        split = [[a, b, 4 + b], [a, 4 + b, 4 + a]], [[a, b, 4 + a], [b, 4 + b, 4 + a]]
        faces += split[bulging]
    return Mesh.from_arrays("twisted", vertices, faces)


def hollow(mesh: trimesh.Trimesh, kept: Ints, wall: float) -> Mesh:
    """A shell with a hole in it: these faces, once more inside, and a rim between the two."""
    outer = np.asarray(mesh.faces)[kept]
    sides = np.concatenate([outer[:, [0, 1]], outer[:, [1, 2]], outer[:, [2, 0]]])
    walked = {tuple(s) for s in sides.tolist()}
    n = len(mesh.vertices)
    rim = [f for a, b in walked if (b, a) not in walked for f in ([b, a, a + n], [b, a + n, b + n])]
    vertices = np.vstack([mesh.vertices, mesh.vertices * (1 - wall)])
    return Mesh.from_arrays("hollow", vertices, np.vstack([outer, outer[:, ::-1] + n, rim]))


def test_a_dent_of_a_tenth_of_the_band_is_nothing_and_one_of_three_tenths_is_concave() -> None:
    extent = 3**0.5
    for share, convex in ((0.5, True), (0.9, True), (1.1, False), (3.0, False)):
        mesh = dented(share * SHARE * extent)
        analysis, shape = shaped(mesh, extent)
        assert analysis.convex is convex
        assert (len(shape.pieces) == 1) is convex
        if convex:
            assert analysis.concavity == pytest.approx(share * SHARE * extent, rel=1e-3)
    # In a larger scene the same dent is nothing.
    assert shaped(dented(3 * SHARE * extent), 4 * extent)[0].convex


@pytest.mark.parametrize("angle", [1e-6, 1e-5, 1e-3, 0.1])
def test_a_twisted_prism_has_its_vertices_on_its_hull_and_is_concave(angle: float) -> None:
    valley, ridge = twisted(angle, bulging=False), twisted(angle, bulging=True)
    one, other = (deepest(m.vertices, m.faces) for m in (valley, ridge))
    deep, flat, way = (one, other, (valley, ridge)) if one > other else (other, one, (ridge, valley))
    assert flat < 1e-12 * max(1, 1 / angle)
    assert deep > 0.2 * angle
    hull = ConvexHull(valley.vertices)
    assert len(np.unique(hull.simplices)) == 8
    for factor, convex in ((0.9, False), (1.2, True)):
        found = concavity(way[0].vertices, way[0].faces, factor * deep)
        assert (found < np.inf) is convex
        assert concavity(way[1].vertices, way[1].faces, factor * deep) <= factor * deep
        if convex:
            assert deep * (1 - 1e-6) <= found <= factor * deep


def test_what_lies_all_near_its_hull_and_is_hollow_is_not_convex() -> None:
    ball = trimesh.creation.icosphere(3)
    down = np.flatnonzero(ball.triangles_center[:, 2] < 0)
    balloon, bowl = hollow(ball, np.arange(1, len(ball.faces)), 1e-8), hollow(ball, down, 1e-8)
    for mesh in (balloon, bowl):
        assert analyse(mesh).closed
        assert analyse(mesh).components == 1
        # Each layer is near the other, and one of them on the hull.
        assert concavity(mesh.vertices, mesh.faces, 1e-3) == np.inf
    assert concavity(ball.vertices, np.asarray(ball.faces), 1e-3) < 1e-12


@pytest.mark.slow_but("0]", "5]")
@pytest.mark.parametrize("seed", range(22))
def test_noise_is_judged_as_by_points_on_the_surface(seed: int) -> None:
    rng = np.random.default_rng(seed)
    solid = SOLIDS[list(SOLIDS)[seed % len(SOLIDS)]]
    solid = trimesh.Trimesh(*trimesh.remesh.subdivide(solid.vertices, solid.faces)) if len(solid.faces) < 50 else solid
    vertices, faces = solid.vertices + 1e-5 * rng.standard_normal(solid.vertices.shape), np.asarray(solid.faces)
    deep = deepest(vertices, faces)
    if deep < 1e-12:  # a hull stays one
        assert concavity(vertices, faces, 1e-9) < 1e-12
        return
    assert concavity(vertices, faces, 0.999 * deep) == np.inf
    assert deep * (1 - 1e-9) <= concavity(vertices, faces, 1.3 * deep) <= 1.3 * deep


def test_an_l_is_concave() -> None:
    section = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=float)
    vertices = np.vstack([np.column_stack([section, np.full(6, z)]) for z in (0.0, 1.0)])
    cap = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    sides = [f for i in range(6) for f in ([i, (i + 1) % 6, 6 + (i + 1) % 6], [i, 6 + (i + 1) % 6, 6 + i])]
    faces = np.vstack([cap[:, ::-1], cap + 6, sides])
    assert concavity(vertices, faces, 0.3) == np.inf


def test_components_are_judged_alike(tmp_path: Path) -> None:
    first, second = (rounded(SOLIDS[name], ".stl", tmp_path, 2) for name in ("box", "cylinder"))
    away = second.vertices + np.array([50, 0, 0])
    both = Mesh.from_arrays(
        "both", np.vstack([first.vertices, away]), np.vstack([first.faces, second.faces + len(first.vertices)])
    )
    assert len(shaped(both, both.diagonal)[1].pieces) == 2


def test_a_rounded_box_may_stand_as_a_box_but_is_none_for_the_exact_engine(tmp_path: Path) -> None:
    mesh = rounded(SOLIDS["box"], ".stl", tmp_path, 0)
    analysis, shape = shaped(mesh, mesh.diagonal)
    assert analysis.box is None
    assert shape.box is not None
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * shape.box.half_sizes
    corners = corners @ shape.box.rotation.T + shape.box.center
    apart = np.linalg.norm(corners[:, None] - analysis.vertices, axis=2).min(axis=1)
    assert 0 < apart.max() < 2 * SHARE * mesh.diagonal
    assert shaped(dented(0.5 * SHARE), 3**0.5)[1].box is not None
    assert shaped(Mesh.from_arrays("ball", SOLIDS["ball"].vertices, SOLIDS["ball"].faces), 3.0)[1].box is None


@pytest.mark.slow
def test_a_large_rounded_ball_takes_seconds() -> None:
    ball = trimesh.creation.icosphere(6)
    vertices = (ball.vertices @ Rotation.random(random_state=0).as_matrix().T).astype(np.float32).astype(np.float64)
    began = time.process_time()
    assert concavity(vertices, np.asarray(ball.faces), 2 * SHARE) < SHARE
    assert time.process_time() - began < 30


@pytest.mark.parametrize("degrees", [60, 30, 8, 4, 2])
@pytest.mark.parametrize("share", [0.02, 0.3, 0.9])
def test_a_dent_in_the_edge_of_a_knife_lets_the_hull_reach_far_beyond_it(degrees: float, share: float) -> None:
    """A dent of depth d below both sides of a wedge of angle w is d / sin(w / 2) below its edge."""
    half = np.radians(degrees) / 2
    tolerance = SHARE * float(np.linalg.norm([2 * np.tan(half), 1, 1]))
    claimed = share * tolerance / np.sin(half)
    height = np.array([1, 1 - claimed, 1])
    rows = [[[-np.tan(half), y, 0], [np.tan(half), y, 0], [0, y, z]] for y, z in zip((0, 0.5, 1), height, strict=True)]
    sides = [(3 * k + i, 3 * k + j) for k in range(2) for i, j in ((0, 2), (2, 1), (1, 0))]
    faces = [f for a, b in sides for f in ([a, b, b + 3], [a, b + 3, a + 3])] + [[0, 1, 2], [6, 8, 7]]
    for turn in (np.eye(3), rotation(3)):
        mesh = moved(Mesh.from_arrays("knife", np.concatenate(rows), faces), turn)
        a = analyse(mesh, concave=tolerance)
        assert a.solid
        # Half of the band: as far as other pieces leave the surface.
        assert a.convex is bool(claimed <= 5 * tolerance)
