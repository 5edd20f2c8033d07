"""Triangles merged into convex polygons."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from meshes import box, channel, corpus_meshes, grid, joined, moved, rotation, turned

from env2mjcf.geometry.analysis import analyse
from env2mjcf.geometry.coplanar import Polygon, convex_polygons
from env2mjcf.geometry.mesh import Mesh


def merged(mesh: Mesh) -> tuple[np.ndarray, np.ndarray, tuple[Polygon, ...]]:
    a = analyse(mesh)
    return a.vertices, a.faces, convex_polygons(a.vertices, a.faces, a.tolerance)


def cross2(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def plane_axes(normal: np.ndarray) -> np.ndarray:
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(normal, first)])


def hull_of(points: np.ndarray) -> np.ndarray:
    """Andrew's monotone chain, counter-clockwise."""

    def chain(order: np.ndarray) -> list[np.ndarray]:
        out: list[np.ndarray] = []
        for p in order:
            while len(out) > 1 and cross2(out[-1] - out[-2], p - out[-2]) <= 0:
                out.pop()
            out.append(p)
        return out[:-1]

    order = points[np.lexsort((points[:, 1], points[:, 0]))]
    return np.array(chain(order) + chain(order[::-1]))


def assert_same_surface(vertices: np.ndarray, faces: np.ndarray, polygons: tuple[Polygon, ...]) -> None:
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    assert sorted(f for p in polygons for f in p.faces) == list(range(len(faces)))
    corners = vertices[faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    rng = np.random.default_rng(0)
    for polygon in polygons:
        points = vertices[list(polygon.loop)]
        assert np.linalg.norm(polygon.normal) == pytest.approx(1)
        # Planar.
        assert np.abs((points - points.mean(axis=0)) @ polygon.normal).max() <= 2e-9 * size
        # Convex and counter-clockwise: all of it, and no corner inside of its hull, but for rounding.
        flat = points @ plane_axes(polygon.normal).T
        hull = hull_of(flat)
        along = np.roll(hull, -1, axis=0) - hull
        left = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)
        depth = flat @ left.T - np.einsum("ej,ej->e", left, hull)
        assert depth.min() >= -1e-12 * size
        assert depth.min(axis=1).max() <= 1e-11 * size
        area = float(cross2(flat, np.roll(flat, -1, axis=0)).sum()) / 2
        assert area == pytest.approx(float(cross2(hull, np.roll(hull, -1, axis=0)).sum()) / 2, abs=1e-8 * size**2)
        # Of the area of its triangles, and each of them within it: then they cover each other.
        members = list(polygon.faces)
        assert area == pytest.approx(areas[members].sum(), rel=1e-7, abs=1e-12 * size**2)
        samples = np.einsum("fk,fkj->fj", rng.dirichlet((1, 1, 1), len(members)), corners[members])
        for at in (samples, corners[members].reshape(-1, 3)):
            inside = at @ plane_axes(polygon.normal).T @ left.T - np.einsum("ej,ej->e", left, hull)
            assert inside.min() >= -1e-9 * size
            assert np.abs((at - points[0]) @ polygon.normal).max() <= 2e-9 * size


def test_a_box_has_six_squares() -> None:
    vertices, faces, polygons = merged(moved(box((1, 2, 3)), rotation(0), (4, 5, 6)))
    assert [len(p.loop) for p in polygons] == [4] * 6
    assert_same_surface(vertices, faces, polygons)


def test_a_channel_has_a_section_of_three_rectangles() -> None:
    # The caps of the U need three convex pieces each at least (two reflex corners), the sides are eight rectangles.
    vertices, faces, polygons = merged(channel())
    assert len(polygons) == 8 + 2 * 3
    assert_same_surface(vertices, faces, polygons)


@pytest.mark.parametrize("n", [1, 2, 5, 20])
def test_a_flat_grid_becomes_few_polygons(n: int) -> None:
    vertices, faces, polygons = merged(grid(n))
    assert_same_surface(vertices, faces, polygons)
    # Merging longest edges first makes squares, then strips.
    assert len(polygons) <= n


def test_a_sheet_that_is_folded_back_stays_two() -> None:
    vertices = [[0, 0, 0], [1, 0, 0], [0.3, 1, 0], [0.6, 0.8, 0]]
    assert len(merged(Mesh.from_arrays("folded", vertices, [[0, 1, 2], [1, 0, 3]]))[2]) == 2


def test_nothing_merges_across_an_edge_with_more_than_two_faces() -> None:
    # A flat square with a fin on its diagonal.
    square = grid(1)
    vertices = np.vstack([square.vertices, [[0.5, 0.5, 1.0]]])
    fin = Mesh.from_arrays("fin", vertices, np.vstack([square.faces, [[0, 3, 4]]]))
    assert len(merged(square)[2]) == 1
    assert len(merged(fin)[2]) == 3


@pytest.mark.parametrize("seed", range(5))
def test_boxes_with_a_common_wall_keep_their_sides_apart(seed: int) -> None:
    # Four faces meet at each edge of the wall, two of them coplanar, and at its diagonal, which stays too.
    both = joined(box(), box((1, 1, 1), (1, 0, 0)))
    shuffled = np.random.default_rng(seed).permutation(both.faces)
    assert len(merged(Mesh.from_arrays("boxes", both.vertices, shuffled))[2]) == 2 * (5 + 2)


@pytest.mark.parametrize("order", [(0, 1, 2, 3, 4, 5), (3, 2, 1, 0, 4, 5), (1, 3, 0, 2, 5, 4), (2, 0, 3, 1, 4, 5)])
def test_a_chain_of_collinear_edges_goes_as_a_whole(order: tuple[int, ...]) -> None:
    # A rhombus of two fans that meet along a line of three edges.
    vertices = np.array([[0, 0, 0], [0, 1, 0], [0, 2, 0], [0, 3, 0], [-1, 1.5, 0], [1, 1.5, 0]])
    faces = np.array([[4, i, i + 1] for i in range(3)] + [[5, i + 1, i] for i in range(3)])
    place = np.argsort(order)
    kept, _, polygons = merged(Mesh.from_arrays("rhombus", vertices[list(order)], place[faces]))
    assert [len(p.loop) for p in polygons] == [4]
    assert {tuple(kept[v]) for v in polygons[0].loop} == {(0, 0, 0), (0, 3, 0), (-1, 1.5, 0), (1, 1.5, 0)}


def test_a_sheet_that_bends_slowly_is_cut_into_planar_pieces() -> None:
    sheet = grid(60)
    bent = sheet.vertices + np.array([0, 0, 1e-8]) * sheet.vertices[:, :1] ** 2
    vertices, faces, polygons = merged(Mesh.from_arrays("bent", bent, sheet.faces))
    # Neighbouring strips are coplanar within the tolerance, the whole sheet is not.
    assert len(polygons) > 1
    assert_same_surface(vertices, faces, polygons)


def test_a_bend_of_a_millionth_is_not_flat() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    faces = [[0, 1, 2], [0, 2, 3]]
    assert len(merged(Mesh.from_arrays("m", vertices, faces))[2]) == 1
    vertices[3, 2] = 1e-5
    assert len(merged(Mesh.from_arrays("m", vertices, faces))[2]) == 2


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.integers(3, 30))
def test_any_flat_triangulation_keeps_its_surface(seed: int, n: int) -> None:
    """Cells of a grid knocked out at random, so that the sheet has holes, reflex corners and touching corners."""
    rng = np.random.default_rng(seed)
    sheet = grid(min(n, 8))
    shear = np.array([[1, rng.normal(), 0], [0, 1, 0], [0, 0, 1]])
    faces = sheet.faces[rng.random(len(sheet.faces)) < rng.uniform(0.3, 1)]
    if len(faces) == 0:
        return
    mesh = moved(Mesh.from_arrays("m", sheet.vertices, faces), rotation(seed) @ shear)
    assert_same_surface(*merged(mesh))


def test_winding_and_orientation_carry_over() -> None:
    vertices, faces, polygons = merged(turned(joined(box(), box((1, 1, 1), (3, 0, 0)))))
    assert_same_surface(vertices, faces, polygons)
    for polygon in polygons:
        points = vertices[list(polygon.loop)]
        center = np.array([0.0 if points[:, 0].mean() < 1.5 else 3.0, 0, 0])
        assert polygon.normal @ (points.mean(axis=0) - center) > 0


def test_the_result_does_not_depend_on_the_run() -> None:
    loops = [[p.loop for p in merged(channel())[2]] for _ in range(2)]
    assert loops[0] == loops[1]


@pytest.mark.slow
def test_corpus_surfaces_are_kept(corpus: Path) -> None:
    for mesh in corpus_meshes(corpus):
        vertices, faces, polygons = merged(mesh)
        assert_same_surface(vertices, faces, polygons)


def test_a_curved_mesh_stays_as_it_is() -> None:
    ball = trimesh.creation.icosphere(2)
    assert len(merged(Mesh.from_arrays("ball", ball.vertices, ball.faces))[2]) == len(ball.faces)


@pytest.mark.parametrize("seed", range(3))
def test_a_sheet_that_is_flat_to_the_tolerance_is_as_good_as_flat(seed: int) -> None:
    sheet, tolerance = grid(8), 1e-6
    rough = sheet.vertices + np.random.default_rng(seed).uniform(-0.5, 0.5, (81, 1)) * [0, 0, tolerance]
    polygons = convex_polygons(rough, sheet.faces, tolerance)
    assert len(polygons) <= 8
    assert sorted(f for p in polygons for f in p.faces) == list(range(128))
    flat = [sheet.vertices[list(p.loop)] for p in polygons]
    areas = [np.cross(p, np.roll(p, -1, axis=0)).sum(axis=0)[2] / 2 for p in flat]
    assert sum(areas) == pytest.approx(np.prod(np.ptp(sheet.vertices, axis=0)[:2]), rel=1e-12)
    # Ten times as rough, it is not.
    assert len(convex_polygons(sheet.vertices + 10 * (rough - sheet.vertices), sheet.faces, tolerance)) > 8


@pytest.mark.parametrize("bend", [0.5, 12.0])
def test_a_corner_is_off_the_plane_by_no_more_than_the_tolerance(bend: float) -> None:
    """A strip that bends evenly: cut where the chord of its parabola is as high as the tolerance allows."""
    n, tolerance = 40, 1e-5
    x = np.arange(n + 1.0)
    vertices = np.array([[a, b, bend * tolerance * (a / n) ** 2] for a in x for b in (0.0, 1.0)])
    first = 2 * np.arange(n)
    faces = np.concatenate(
        [np.column_stack([first, first + 2, first + 3]), np.column_stack([first, first + 3, first + 1])]
    )
    polygons = convex_polygons(vertices, faces, tolerance)
    assert (len(polygons) == 1) == (bend < 1)
    for polygon in polygons:
        corners = vertices[list(polygon.loop)]
        # The plane that fits best, by its singular values.
        local = corners - corners.mean(axis=0)
        normal = np.linalg.svd(local)[2][2]
        assert np.abs(local @ normal).max() <= 1.01 * tolerance
