"""What kind of surface a mesh is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from meshes import box, channel, corpus_meshes, grid, joined, moved, rotation, soup, tetrahedron, turned

from env2mjcf.diagnostics import CATALOGUE, DiagnosticLog
from env2mjcf.errors import GeometryError, Severity
from env2mjcf.geometry.analysis import analyse, mesh_diagnostics
from env2mjcf.geometry.convexity import is_convex
from env2mjcf.geometry.mesh import Mesh
from env2mjcf.geometry.orientation import winding_numbers


def findings(mesh: Mesh) -> list[str]:
    log = DiagnosticLog()
    mesh_diagnostics(mesh, analyse(mesh), log)
    assert all(d.code in CATALOGUE for d in log)
    return [d.code for d in log]


def bumpy_sphere(seed: int, bump: float) -> Mesh:
    ball = trimesh.creation.icosphere(2)
    radius = 1 + bump * np.random.default_rng(seed).random(len(ball.vertices))
    return Mesh.from_arrays("ball", ball.vertices * radius[:, None], ball.faces)


def test_a_box_is_closed_convex_and_a_box() -> None:
    a = analyse(box((1, 2, 3), (5, 6, 7)))
    assert a.closed
    assert a.consistent
    assert a.convex
    assert not a.inverted
    assert a.dimension == 3
    assert a.area == pytest.approx(2 * (2 + 3 + 6), rel=1e-14)
    assert a.volume == a.signed_volume == pytest.approx(6, rel=1e-14)
    assert a.diagonal == pytest.approx(np.sqrt(14), rel=1e-14)
    assert a.box is not None
    np.testing.assert_allclose(a.box.half_sizes, (0.5, 1, 1.5), rtol=1e-14)
    np.testing.assert_allclose(a.box.center, (5, 6, 7), rtol=1e-14)
    np.testing.assert_array_equal(a.box.rotation, np.eye(3))
    assert findings(box()) == []


@pytest.mark.parametrize("seed", range(5))
def test_the_pose_of_a_box_brings_its_corners_back(seed: int) -> None:
    mesh = moved(box((1, 2, 3)), rotation(seed), (10, -20, 30))
    found = analyse(mesh).box
    assert found is not None
    assert np.linalg.det(found.rotation) == pytest.approx(1)
    assert (np.diag(found.rotation) > 0).all()
    local = (mesh.vertices - found.center) @ found.rotation
    np.testing.assert_allclose(np.abs(local), np.tile(found.half_sizes, (8, 1)), atol=1e-12)
    np.testing.assert_allclose(np.sort(found.half_sizes), (0.5, 1, 1.5), atol=1e-12)


def test_eight_corners_are_not_enough_for_a_box() -> None:
    vertices = box().vertices.copy()
    vertices[vertices[:, 2] > 0, :2] *= 0.5
    a = analyse(Mesh.from_arrays("frustum", vertices, box().faces))
    assert a.convex
    assert a.box is None


def test_a_soup_of_triangles_is_welded() -> None:
    a = analyse(soup(box()))
    assert a.closed
    assert a.convex
    assert a.box is not None
    assert a.vertices.shape == (8, 3)


@pytest.mark.parametrize(("noise", "closed"), [(1e-10, True), (1e-7, False)])
def test_vertices_weld_within_a_billionth_of_the_diagonal(noise: float, closed: bool) -> None:
    mesh = soup(moved(box(), rotation(1), (0.3, 0.4, 0.5)))
    shift = np.random.default_rng(0).uniform(-1, 1, mesh.vertices.shape) * noise
    a = analyse(Mesh.from_arrays("noisy", mesh.vertices + shift, mesh.faces))
    assert a.closed is closed
    assert (len(a.vertices) == 8) is closed


def test_welding_sees_across_the_cells_of_any_grid() -> None:
    rng = np.random.default_rng(0)
    points = rng.random((3000, 3))
    pairs = np.vstack([points, points + rng.uniform(-0.4e-9, 0.4e-9, points.shape)])
    far = rng.uniform((3, 0, 0), (4, 1, 1), (3000, 3))
    index = np.arange(3000)
    a = analyse(
        Mesh.from_arrays("pairs", np.vstack([pairs, far]), np.column_stack([index, index + 3000, index + 6000]))
    )
    assert a.degenerate_faces == 3000


def test_an_inverted_box_is_turned_round() -> None:
    mesh = turned(box((2, 2, 2)))
    a = analyse(mesh)
    assert a.inverted
    assert a.consistent
    assert a.convex
    assert a.signed_volume == pytest.approx(-8)
    assert a.volume == pytest.approx(8)
    assert findings(mesh) == ["GEO233"]


@pytest.mark.parametrize("inside_out", [False, True])
def test_a_cavity_stays_a_cavity(inside_out: bool) -> None:
    mesh = joined(box((3, 3, 3)), turned(box()))
    a = analyse(turned(mesh) if inside_out else mesh)
    assert a.closed
    assert not a.convex
    assert a.inverted is inside_out
    np.testing.assert_allclose(a.component_volumes, [27, -1])
    probes = np.array([[0, 0, 0], [1.0, 0, 0], [2, 0, 0]])
    np.testing.assert_allclose(winding_numbers(probes, a.vertices, a.faces), [0, 1, 0], atol=1e-12)


def test_of_two_boxes_only_the_inverted_one_is_turned_round() -> None:
    a = analyse(joined(box(), turned(box((2, 2, 2), (5, 0, 0)))))
    assert a.inverted
    np.testing.assert_allclose(a.component_volumes, [1, 8])


@pytest.mark.parametrize("seed", range(4))
def test_mixed_winding_is_made_to_agree(seed: int) -> None:
    which = np.random.default_rng(seed).permutation(len(channel().faces))[:9]
    mesh = turned(channel(), which)
    a = analyse(mesh)
    assert a.closed
    assert not a.consistent
    assert a.oriented
    assert a.solid
    assert a.volume == pytest.approx(7 * 4)
    assert "GEO234" in findings(mesh)


def test_a_one_sided_closed_surface_has_no_outside() -> None:
    # The six-vertex triangulation of the projective plane, with its vertices at arbitrary places.
    faces = [
        [0, 1, 2],
        [0, 2, 3],
        [0, 3, 4],
        [0, 4, 5],
        [0, 5, 1],
        [1, 2, 4],
        [2, 3, 5],
        [3, 4, 1],
        [4, 5, 2],
        [5, 1, 3],
    ]
    mesh = Mesh.from_arrays("plane", np.random.default_rng(0).random((6, 3)), faces)
    a = analyse(mesh)
    assert a.closed
    assert not a.oriented
    assert not a.solid
    assert a.volume == 0
    log = DiagnosticLog()
    mesh_diagnostics(mesh, a, log)
    assert ["not certain" in d.hint for d in log if d.code == "GEO234"] == [True]


def test_a_box_without_a_side_is_open() -> None:
    mesh = Mesh.from_arrays("tray", box().vertices, box().faces[2:])
    a = analyse(mesh)
    assert not a.closed
    assert not a.convex
    assert a.consistent
    assert a.dimension == 3
    assert a.open_edges == 4
    assert findings(mesh) == ["GEO232"]


def test_copies_and_faces_of_no_height_are_dropped() -> None:
    faces = np.vstack([box().faces, box().faces[:3], [[0, 0, 1]]])
    mesh = Mesh.from_arrays("box", box().vertices, faces)
    a = analyse(mesh)
    assert (a.duplicate_faces, a.degenerate_faces) == (3, 1)
    assert a.closed
    assert a.convex
    assert a.volume == pytest.approx(1)
    assert sorted(findings(mesh)) == ["GEO235", "GEO236"]
    np.testing.assert_array_equal(a.source, np.arange(12))


def test_a_needle_may_close_a_t_junction() -> None:
    # The side x = 0.5 is split at the middle of its upper edge, the side above is not: the needle fills the slit.
    vertices = np.vstack([box().vertices, [[0.5, 0.0, 0.5]]])
    faces = np.vstack([np.delete(box().faces, [2, 3], axis=0), [[4, 6, 8], [6, 7, 8], [4, 8, 5], [5, 8, 7]]])
    a = analyse(Mesh.from_arrays("box", vertices, faces))
    assert a.closed
    assert a.degenerate_faces == 1
    assert a.volume == pytest.approx(1)
    assert not analyse(Mesh.from_arrays("box", vertices, faces[:-1])).closed


def test_a_wall_shared_by_two_boxes_keeps_both_copies() -> None:
    both = joined(box(), box((1, 1, 1), (1, 0, 0)))
    a = analyse(both)
    assert a.closed
    assert a.solid
    assert a.duplicate_faces == 0
    assert a.volume == pytest.approx(2)
    assert a.crowded_edges == 5  # four sides of the wall, and its diagonal


def test_a_sheet_with_two_sides_is_not_closed() -> None:
    sheet = channel()
    sheet = Mesh.from_arrays("sheet", sheet.vertices, sheet.faces[12:])
    double = Mesh.from_arrays("sheet", sheet.vertices, np.vstack([sheet.faces, sheet.faces[:, ::-1]]))
    a = analyse(double)
    assert not a.closed
    assert a.duplicate_faces == len(sheet.faces)
    assert a.area == pytest.approx(analyse(sheet).area)


@pytest.mark.parametrize("seed", range(3))
def test_a_tilted_sheet_is_flat(seed: int) -> None:
    turn = rotation(seed)
    mesh = moved(grid(3), turn, (7, 8, 9))
    a = analyse(mesh)
    assert a.flat
    assert not a.closed
    assert abs(a.normal @ turn[:, 2]) == pytest.approx(1, abs=1e-12)
    assert findings(mesh) == ["GEO230"]


@pytest.mark.parametrize(
    ("points", "dimension"), [([[0, 0, 0], [1, 2, 3], [2, 4, 6]], 1), ([[1, 1, 1]] * 3, 0)], ids=["line", "point"]
)
def test_a_line_or_a_point_is_refused(points: list[list[float]], dimension: int) -> None:
    mesh = Mesh.from_arrays("m", points, [[0, 1, 2]])
    assert analyse(mesh).dimension == dimension
    with pytest.raises(GeometryError) as error:
        mesh_diagnostics(mesh, analyse(mesh), DiagnosticLog())
    assert error.value.code == "GEO231"


def test_an_empty_mesh_is_a_point() -> None:
    assert analyse(Mesh.from_arrays("m", np.zeros((0, 3)), np.zeros((0, 3)))).dimension == 0


def test_unused_vertices_change_nothing_but_their_count() -> None:
    mesh = Mesh.from_arrays("box", np.vstack([[[9, 9, 9]], box().vertices]), box().faces + 1)
    a = analyse(mesh)
    assert a.unused_vertices == 1
    assert a.convex
    assert a.diagonal == pytest.approx(np.sqrt(3))
    assert findings(mesh) == ["GEO238"]


@pytest.mark.parametrize(("dent", "convex"), [(1e-11, True), (1e-7, False), (-1e-7, True)])
def test_convex_to_a_billionth_of_the_diagonal(dent: float, convex: bool) -> None:
    faces = np.vstack([box().faces[:10], [[1, 5, 8], [5, 7, 8], [7, 3, 8], [3, 1, 8]]])
    mesh = Mesh.from_arrays("box", np.vstack([box().vertices, [[0, 0, 0.5 - dent]]]), faces)
    assert analyse(mesh).closed
    assert analyse(mesh).convex is convex


@pytest.mark.parametrize("bump", [0.0, 1e-3, 0.02, 0.3])
@pytest.mark.parametrize("seed", range(3))
def test_convexity_is_every_vertex_behind_every_face(seed: int, bump: float) -> None:
    mesh = bumpy_sphere(seed, bump)
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    heights = normals @ mesh.vertices.T - np.einsum("ij,ij->i", normals, corners[:, 0])[:, None]
    assert analyse(mesh).convex is bool((heights <= 1e-9).all())


def test_convexity_looks_beyond_the_neighbours() -> None:
    # Every edge of two boxes, one within the other, is convex; only the planes of the inner one tell.
    nested = joined(box(), box((3, 3, 3)))
    assert not is_convex(nested.vertices, nested.faces, 1e-9)


def test_components_count_and_report() -> None:
    mesh = joined(box(), tetrahedron(), channel())
    assert analyse(mesh).components == 3
    np.testing.assert_array_equal(np.bincount(analyse(mesh).component), [12, 4, 28])
    assert findings(mesh) == ["GEO237"]


def test_warnings_are_errors_in_strict_mode() -> None:
    log = DiagnosticLog(strict=True)
    with pytest.raises(GeometryError) as error:
        mesh_diagnostics(grid(1), analyse(grid(1)), log)
    assert error.value.diagnostic.severity is Severity.ERROR


def test_arrays_are_read_only_and_the_mesh_is_untouched() -> None:
    mesh = turned(box())
    before = mesh.faces.copy()
    a = analyse(mesh)
    for array in (a.vertices, a.faces, a.source, a.component, a.component_volumes, a.normal):
        assert not array.flags.writeable
    np.testing.assert_array_equal(mesh.faces, before)


def test_corpus_meshes_agree_with_trimesh(corpus: Path) -> None:
    for mesh in corpus_meshes(corpus):
        a = analyse(mesh)
        other = trimesh.Trimesh(a.vertices, a.faces, process=False)
        assert a.area == pytest.approx(other.area, rel=1e-9), mesh.path
        if a.solid:
            assert a.volume == pytest.approx(other.volume, rel=1e-9), mesh.path
            assert a.volume > 0
        if other.is_watertight and other.is_winding_consistent:
            assert a.solid, mesh.path
        if a.components == 1 and other.is_watertight:
            assert a.convex <= other.is_convex, mesh.path


def test_corpus_meshes_load_with_warnings_only(corpus: Path) -> None:
    meshes = corpus_meshes(corpus)
    assert len(meshes) > 100
    codes = {code for mesh in meshes for code in findings(mesh)}
    # What the real files hold: flat plates, inverted walls, walls with crowded edges, copied faces.
    assert codes >= {"GEO230", "GEO233", "GEO235", "GEO237", "GEO239"}
