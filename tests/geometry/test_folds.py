"""Flat parts of closed surfaces that are folded over themselves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from meshes import assert_surface_stays, box, channel, codes, corpus_meshes, joined, moved, rotation, turned
from scenes import box_mesh, free_cube, write_scene
from solids import assert_inside_and_covering, crossing_prism, height, lined, shelled

import env2mjcf
from env2mjcf.geometry import folds
from env2mjcf.geometry.analysis import analyse
from env2mjcf.geometry.folds import unfolded
from env2mjcf.geometry.mesh import Mesh
from env2mjcf.geometry.orientation import winding_numbers
from env2mjcf.geometry.planar import triangulated
from env2mjcf.geometry.repair import repaired
from env2mjcf.geometry.topology import face_areas


def with_cap(cap: list[list[int]], extra: list[list[float]] | None = None) -> Mesh:
    """The channel (8 corners at x = 0, then 8 at x = 4) with other triangles at x = 4; `extra` are their y and z."""
    mesh = channel()
    vertices = np.vstack([mesh.vertices, [[4.0, *yz] for yz in extra or []]]) if extra else mesh.vertices
    return Mesh.from_arrays("folded", vertices, np.vstack([mesh.faces[:6], np.array(cap) + 8, mesh.faces[12:]]))


def folded_within() -> Mesh:
    """Two vertices in the triangle 0 1 4 of the cap stand the wrong way round: two faces lie under three others."""
    cap = [[0, 1, 9], [1, 8, 9], [8, 0, 9], [1, 4, 8], [4, 0, 8], [0, 4, 5], [1, 2, 3], [1, 3, 4], [0, 5, 6], [0, 6, 7]]
    return with_cap(cap, [[1.7, 0.2], [1.8, 0.5]])


def folded_beyond() -> Mesh:
    """A fan over the whole section: 0 3 4 takes away what 0 2 3 covers of the opening."""
    return with_cap([[0, i, i + 1] for i in range(1, 7)])


def crumpled_box(seed: int, n: int = 5) -> Mesh:
    """A box whose top is a grid with inner vertices anywhere in it."""
    rng = np.random.default_rng(seed)
    x, y = (g.astype(float) for g in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
    inner = np.s_[1:-1, 1:-1]
    x[inner], y[inner] = rng.uniform(0.1, n - 0.1, (2, n - 1, n - 1))
    grid = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = (g.ravel() for g in (grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]))
    top = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    rim = np.concatenate([grid[:-1, 0], grid[-1, :-1], grid[:0:-1, -1], grid[0, :0:-1]])
    m, bottom = len(rim), (n + 1) ** 2
    i, j = np.arange(m), (np.arange(m) + 1) % m
    walls = np.concatenate([np.stack([bottom + i, bottom + j, rim[j]], 1), np.stack([bottom + i, rim[j], rim[i]], 1)])
    floor = np.stack([bottom + j, bottom + i, np.full(m, bottom + m)], 1)
    flat = np.column_stack([x.ravel(), y.ravel()])
    low = np.vstack([flat[rim], [[n / 2, n / 2]]])
    vertices = np.vstack([np.column_stack([flat, np.full(len(flat), 2.0)]), np.column_stack([low, np.zeros(len(low))])])
    return Mesh.from_arrays("crumpled", vertices, np.concatenate([top, walls, floor]))


FOLDED = {
    "within": folded_within(),
    "beyond": folded_beyond(),
    "turned": moved(folded_within(), rotation(4), (30, -2, 7)),
    "turned beyond": moved(folded_beyond(), rotation(5), (30, -2, 7)),
    "inside out": turned(folded_within()),
    "two solids": joined(folded_within(), moved(folded_beyond(), np.eye(3), (20, 0, 0))),
}
SHEETS = {"beyond": 1, "turned beyond": 1, "two solids": 1}


def edges_folded(mesh: Mesh) -> int:
    """Number of edges with two faces that lie upon each other."""
    a = repaired(mesh).analysis
    tri = trimesh.Trimesh(a.vertices, a.faces, process=False)
    across = np.einsum("ij,ij->i", *(tri.face_normals[tri.face_adjacency[:, k]] for k in (0, 1)))
    return int((across < -0.999999).sum())


@pytest.mark.parametrize("name", FOLDED)
def test_the_solid_and_its_surface_stay(name: str) -> None:
    mesh = FOLDED[name]
    result = repaired(mesh)
    a, before = result.analysis, analyse(mesh)
    assert result.folded_faces > 0
    assert result.sheets == SHEETS.get(name, 0)
    assert "GEO244" in codes(mesh)
    assert a.solid
    assert a.volume == pytest.approx(28 * a.components, rel=1e-12)
    assert_surface_stays(mesh)
    low, high = a.vertices.min(axis=0), a.vertices.max(axis=0)
    points = np.random.default_rng(1).uniform(low - 0.1, high + 0.1, (2000, 3))
    np.testing.assert_allclose(
        winding_numbers(points, a.vertices, a.faces), winding_numbers(points, before.vertices, before.faces), atol=1e-9
    )


@pytest.mark.parametrize("name", ["within", "turned", "inside out"])
def test_a_fold_within_the_cap_leaves_a_plain_channel(name: str) -> None:
    mesh = FOLDED[name]
    a = repaired(mesh).analysis
    tri = trimesh.Trimesh(a.vertices, a.faces, process=False)
    assert tri.is_watertight
    assert tri.is_winding_consistent
    assert tri.volume == pytest.approx(28, rel=1e-12)
    assert a.area == pytest.approx(analyse(channel()).area, rel=1e-12)
    assert (len(a.vertices), len(a.faces), a.crowded_edges, edges_folded(mesh)) == (16, 28, 0, 0)
    if name == "within":
        for x in (1e-6, 2, 4 - 1e-6):
            cut = trimesh.intersections.mesh_plane(tri, [1, 0, 0], [x, 0, 0])
            assert np.linalg.norm(cut[:, 1] - cut[:, 0], axis=1).sum() == pytest.approx(16, rel=1e-9)
            points = np.column_stack([np.full(500, x), np.random.default_rng(2).uniform(-0.1, 3.1, (500, 2))])
            inside, expected = (winding_numbers(points, m.vertices, m.faces) for m in (a, channel()))
            np.testing.assert_allclose(inside, expected, atol=1e-9)


@pytest.mark.parametrize("name", ["within", "turned", "inside out"])
def test_cells_of_a_folded_cap_are_as_thick_as_any(name: str) -> None:
    mesh = FOLDED[name]
    assert_inside_and_covering(mesh)
    found = shelled(mesh)
    assert found.pinned == 0
    # The walls of the channel are 1 thick, so that cells from both sides meet in their middle.
    assert found.thinnest == pytest.approx(0.5, rel=1e-9)


def test_only_a_sheet_beyond_the_solid_is_thin() -> None:
    """What touches the triangle in the opening collides: it stays, and thick cells cover the cap."""
    assert_inside_and_covering(folded_beyond(), pinned=2)
    shape, pieces = lined(folded_beyond())
    a = shape.analysis
    thick = [p for p in pieces if height(shape, p) > 0.01 * a.diagonal]
    faces = [f for p in thick for f in p.polygon.faces]
    assert face_areas(a.vertices, a.faces[faces]).sum() == pytest.approx(analyse(channel()).area, rel=1e-12)
    sheet = np.setdiff1d(np.arange(len(a.faces)), faces)
    assert len(sheet) == 2
    np.testing.assert_array_equal(*(np.sort(a.faces[f]) for f in sheet))


@pytest.mark.parametrize("seed", range(6))
def test_a_crumpled_top_gets_its_outline_back(seed: int) -> None:
    mesh = crumpled_box(seed)
    found = unfolded(analyse(mesh))
    assert found is not None
    assert found.rebuilt == 50
    assert found.sheets == 0
    top = (mesh.vertices[found.faces, 2] == 2).all(axis=1)
    assert top.sum() == 18
    tri = trimesh.Trimesh(mesh.vertices, found.faces, process=False)
    assert tri.is_watertight
    assert tri.volume == pytest.approx(50, rel=1e-12)
    assert tri.area_faces[top].sum() == pytest.approx(25, rel=1e-12)
    assert (tri.face_normals[top, 2] > 0.999).all()


@pytest.mark.parametrize("mesh", [box(), channel(), crossing_prism(0), crumpled_box(0), joined(channel(), channel())])
def test_what_is_not_folded_or_not_simple_is_left_alone(mesh: Mesh) -> None:
    result = repaired(mesh)
    assert result.folded_faces == 0
    assert "GEO244" not in codes(mesh)
    np.testing.assert_array_equal(result.analysis.faces, analyse(mesh).faces)


def byu(mesh: Mesh) -> str:
    vertices = "\n".join(" ".join(map(repr, v)) for v in mesh.vertices.tolist())
    faces = "\n".join(f"{a + 1} {b + 1} {-c - 1}" for a, b, c in mesh.faces.tolist())
    n = len(mesh.faces)
    return f"1 {len(mesh.vertices)} {n} {3 * n}\n1 {n}\n{vertices}\n{faces}\n"


@pytest.mark.parametrize(("mesh", "touched"), [(channel(), False), (folded_beyond(), True), (folded_within(), False)])
@pytest.mark.parametrize("collision", ["solid", "surface"])
def test_verdicts_at_the_sheet(mesh: Mesh, touched: bool, collision: str, tmp_path: Path) -> None:
    """A cube of 0.1 in the opening, in the plane of the cap, 1e-4 before it, behind it, and in the solid."""
    scene_file = write_scene(tmp_path, free_cube("cap.g 0 0 0 0 0 0"), cube=box_mesh(0.05, 0.05, 0.05), cap=byu(mesh))
    scene = env2mjcf.load(scene_file, collision=collision)
    placed = next(p.mesh for p in scene.compiled.assembly.parts() if p.name == scene.obstacle_names[0])
    shift = placed.vertices[0] - mesh.vertices[0]
    places = np.array([[4, 1.9, 1.8], [4.0501, 1.9, 1.8], [3.9499, 1.9, 1.8], [4.0499, 1.5, 0.5]])
    q = np.column_stack([places + shift, np.zeros((4, 3))])
    assert [bool(scene.in_collision(row)) for row in q] == [touched, False, False, True]


@pytest.mark.parametrize(("limit", "most", "too_many"), [("_MOST_EDGES", 20, 19), ("_MOST_FACES", 50, 49)])
def test_what_would_take_too_long_is_left_alone(
    limit: str, most: int, too_many: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(folds, limit, most)
    assert unfolded(analyse(crumpled_box(0))) is not None
    monkeypatch.setattr(folds, limit, too_many)
    assert unfolded(analyse(crumpled_box(0))) is None


def test_new_faces_lead_to_faces_of_the_same_plane() -> None:
    mesh = folded_beyond()
    a = repaired(mesh).analysis
    old, new = (
        trimesh.Trimesh(m.vertices, f, process=False).face_normals for m, f in ((mesh, mesh.faces), (a, a.faces))
    )
    np.testing.assert_allclose(np.abs(np.einsum("ij,ij->i", old[a.source], new)), 1, rtol=1e-12)


def test_is_deterministic() -> None:
    one, two = (unfolded(analyse(crumpled_box(3))) for _ in range(2))
    assert one is not None
    assert two is not None
    assert one.faces.tobytes() == two.faces.tobytes()
    assert one.source.tobytes() == two.source.tobytes()


def ring(corners: list[list[float]] | np.ndarray, first: int = 0) -> np.ndarray:
    i = np.arange(len(corners))
    return first + np.stack([i, np.roll(i, -1)], axis=1)


def area(points: np.ndarray, triangles: np.ndarray) -> float:
    u, v = points[triangles[:, 1]] - points[triangles[:, 0]], points[triangles[:, 2]] - points[triangles[:, 0]]
    return float((u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum() / 2)


SQUARE = np.array([[0.0, 0], [4, 0], [4, 4], [0, 4]])


class TestTriangulated:
    """Regions that are given by their boundaries."""

    def test_holes_stay_open(self) -> None:
        points = np.vstack([SQUARE, 1 + SQUARE / 8, 2 + SQUARE / 8])
        boundary = np.vstack([ring(SQUARE), ring(SQUARE, 4)[:, ::-1], ring(SQUARE, 8)[:, ::-1]])
        found = triangulated(points, boundary, 1e-9)
        assert found is not None
        assert area(points, found) == pytest.approx(15.5, rel=1e-12)

    def test_parts_that_touch_in_a_vertex(self) -> None:
        points = np.vstack([SQUARE, [[8, 4], [8, 8], [4, 8]]])
        boundary = np.vstack([ring(SQUARE), [[2, 4], [4, 5], [5, 6], [6, 2]]])
        found = triangulated(points, boundary, 1e-9)
        assert found is not None
        assert len(found) == 4
        assert area(points, found) == pytest.approx(32, rel=1e-12)

    def test_vertices_on_straight_sides_are_used(self) -> None:
        points = np.array([[0.0, 0], [1, 0], [2, 0], [4, 0], [4, 4], [3, 4], [0, 4]])
        found = triangulated(points, ring(points), 1e-9)
        assert found is not None
        assert len(found) == 5
        assert set(found.ravel()) == set(range(7))

    @pytest.mark.parametrize(
        ("points", "boundary"),
        [
            (SQUARE[[0, 2, 1, 3]], ring(SQUARE)),
            (SQUARE, ring(SQUARE)[:, ::-1]),
            (np.vstack([SQUARE, 1 + SQUARE / 4]), np.vstack([ring(SQUARE), ring(SQUARE, 4)])),
            (SQUARE, ring(SQUARE)[:3]),
        ],
        ids=["crossing", "clockwise", "wound twice", "open"],
    )
    def test_refuses_what_is_no_region(self, points: np.ndarray, boundary: np.ndarray) -> None:
        assert triangulated(points, boundary, 1e-9) is None

    @settings(max_examples=60, deadline=None)
    @given(st.integers(3, 24), st.integers(0, 10**6))
    def test_stars_of_any_kind(self, n: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        angle = (np.arange(n) + rng.uniform(-0.3, 0.3, n)) * 2 * np.pi / n
        points = rng.uniform(0.2, 3.0, n)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        found = triangulated(points, ring(points), 1e-9)
        assert found is not None
        assert len(found) == n - 2
        following = np.roll(points, -1, axis=0)
        gauss = (points[:, 0] * following[:, 1] - points[:, 1] * following[:, 0]).sum() / 2
        assert area(points, found) == pytest.approx(gauss, rel=1e-9)


def test_the_real_folded_cap(corpus: Path) -> None:
    """Its folds reach beyond the solid by a triangle of 0.05 on either side: a sheet, which stays."""
    mesh = next(m for m in corpus_meshes(corpus) if m.path.name == "S2Dharder1.obj")
    result = repaired(mesh)
    assert (result.folded_faces, result.sheets) == (46, 2)
    a = result.analysis
    assert a.volume == pytest.approx(analyse(mesh).volume, rel=1e-12)
    assert_surface_stays(mesh)
    shape, pieces = lined(mesh)
    thin = {f for p in pieces if height(shape, p) < 0.001 * a.diagonal for f in p.polygon.faces}
    # Two sides of two triangles, which are most of all on the thick cells of the cap.
    assert len(thin) == 4
    assert face_areas(a.vertices, a.faces[sorted(thin)]).sum() < 0.01 * a.area
