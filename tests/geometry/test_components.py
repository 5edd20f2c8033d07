"""Which triangles are one piece, and which pieces are closed: what touches a piece neither opens nor closes it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from meshes import box, channel, codes, grid, joined, moved, rotation, soup, turned

from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.geometry.analysis import Analysis, mesh_diagnostics
from env2mjcf.geometry.mesh import Mesh, load_mesh
from env2mjcf.geometry.orientation import winding_numbers
from env2mjcf.geometry.repair import repaired
from env2mjcf.limits import Limits

SHARED = {"wall": (2, 0, 0), "edge": (2, 2, 0), "vertex": (2, 2, 2)}
CUBE = box((2, 2, 2))
FIN = Mesh.from_arrays("fin", [[1, 1, -1], [1, 1, 1], [2, 2, 0]], [[0, 1, 2]])


def pieces(mesh: Mesh) -> Analysis:
    return repaired(mesh).analysis


def closed(mesh: Mesh) -> list[bool]:
    return pieces(mesh).closed_components.tolist()


def without(mesh: Mesh, face: int) -> Mesh:
    return Mesh.from_arrays(mesh.name, mesh.vertices, np.delete(mesh.faces, face, axis=0))


def merged(mesh: Mesh) -> Mesh:
    """Equal vertices once: all that a file without separate vertices says."""
    vertices, index = np.unique(mesh.vertices, axis=0, return_inverse=True)
    return Mesh.from_arrays(mesh.name, vertices, index.reshape(-1)[mesh.faces])


def through_file(mesh: Mesh, path: Path) -> Mesh:
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(path)
    return load_mesh(path, DiagnosticLog(), Limits())


@pytest.mark.parametrize("extension", ["g", "obj", "stl"])
@pytest.mark.parametrize("shared_indices", [False, True])
@pytest.mark.parametrize("contact", SHARED)
def test_an_open_box_does_not_open_the_one_that_it_touches(
    tmp_path: Path, contact: str, shared_indices: bool, extension: str
) -> None:
    """Whichever of its triangles is missing, and whichever way both are wound."""
    import env2mjcf  # noqa: F401  # trimesh writes .g files

    for face in range(12):
        both = joined(CUBE, without(box((2, 2, 2), SHARED[contact]), face))
        for mesh in (both, turned(both)):
            read = through_file(merged(mesh) if shared_indices else mesh, tmp_path / f"mesh.{extension}")
            a = pieces(read)
            assert a.closed_components.tolist() == [True, False], (contact, face)
            assert a.volume == pytest.approx(8)
            centres = np.array([[0, 0, 0], SHARED[contact]])
            np.testing.assert_allclose(winding_numbers(centres, a.vertices, a.enclosing), [1, 0], atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("contact", SHARED)
def test_closed_boxes_that_touch_stay_two(contact: str, seed: int) -> None:
    mesh = moved(joined(CUBE, box((2, 2, 2), SHARED[contact])), rotation(seed) * 10.0 ** (3 * seed - 4), (5, 6, 7))
    for form in (mesh, merged(mesh), turned(merged(mesh)), soup(mesh)):
        a = pieces(form)
        assert a.closed_components.tolist() == [True, True]
        np.testing.assert_allclose(a.component_volumes, 8 * 10.0 ** (9 * seed - 12))


def test_a_fin_is_a_sheet_on_a_solid_box() -> None:
    """Three triangles meet at its edge."""
    for mesh in (joined(CUBE, FIN), merged(joined(CUBE, FIN)), merged(joined(FIN, turned(CUBE)))):
        a = pieces(mesh)
        assert sorted(a.closed_components.tolist()) == [False, True]
        assert a.volume == pytest.approx(8)


def test_copies_of_a_closed_box_are_one_whatever_touches_it() -> None:
    lid = without(box((2, 2, 2), (2, 2, 0)), 0)
    for copy in (CUBE, turned(CUBE)):
        for mesh in (joined(CUBE, copy, lid), merged(joined(CUBE, copy, lid))):
            a = pieces(mesh)
            assert a.closed_components.tolist() == [True, False]
            assert a.duplicate_faces == 12


def test_solids_that_share_a_wall_that_is_not_there_are_one() -> None:
    """Ten triangles of each of two cubes: neither is closed alone."""
    left = Mesh.from_arrays("m", CUBE.vertices, CUBE.faces[(CUBE.vertices[CUBE.faces][:, :, 0] < 1).any(axis=1)])
    right = moved(left, np.diag([-1.0, -1.0, 1.0]), (2, 0, 0))
    a = pieces(joined(left, right))
    assert a.closed_components.tolist() == [True]
    assert a.volume == pytest.approx(16)


def test_a_sheet_with_two_sides_encloses_nothing_beside_a_solid() -> None:
    sheet = moved(grid(1), np.eye(3), (3, 0, 0))
    two_sided = Mesh.from_arrays("m", sheet.vertices, np.vstack([sheet.faces, sheet.faces[:, ::-1]]))
    assert closed(joined(CUBE, two_sided)) == [True, False]


def test_a_hole_in_either_of_two_nested_boxes_leaves_the_other_solid() -> None:
    outer, inner = box((4, 4, 4)), CUBE
    probes = np.array([[0, 0, 0], [1.5, 0, 0]])
    for cavity in (inner, turned(inner)):
        a = pieces(joined(without(outer, 3), cavity))
        # An open box holds no cavity: what is in it is a solid of its own.
        assert a.closed_components.tolist() == [False, True]
        np.testing.assert_allclose(winding_numbers(probes, a.vertices, a.enclosing), [1, 0], atol=1e-9)
        a = pieces(joined(outer, without(cavity, 3)))
        assert a.closed_components.tolist() == [True, False]
        np.testing.assert_allclose(winding_numbers(probes, a.vertices, a.enclosing), [1, 1], atol=1e-9)


def test_a_cavity_stays_one_beside_an_open_sheet() -> None:
    sheet = moved(grid(2), np.eye(3), (-1, -1, 5))
    for mesh in (joined(sheet, box((4, 4, 4)), turned(CUBE)), joined(sheet, turned(box((4, 4, 4))), CUBE)):
        a = pieces(mesh)
        assert a.closed_components.tolist() == [False, True, True]
        assert a.volume == pytest.approx(64 - 8)


def test_a_box_that_shares_a_wall_is_not_a_cavity_of_the_other() -> None:
    """Wound inside out, and its first triangle lies in a wall of the other, about which that winds half."""
    first = box((2, 2, 2), (2, 0, 0))
    on_wall = (first.vertices[first.faces][:, :, 0] == 1).all(axis=1)
    order = np.argsort(~on_wall, kind="stable")
    a = pieces(joined(CUBE, turned(Mesh.from_arrays("m", first.vertices, first.faces[order]))))
    np.testing.assert_allclose(a.component_volumes, [8, 8])


def test_t_junctions_of_one_piece_are_mended_beside_a_closed_and_an_open_one() -> None:
    """One side of a box is cut at the middle of an edge, its neighbour is not."""
    vertices = np.vstack([CUBE.vertices, [[1, 1, 0]]])
    on_edge = (vertices[CUBE.faces][:, :, :2] == 1).all(axis=2).sum(axis=1) == 2
    face = CUBE.faces[np.flatnonzero(on_edge)[0]]
    k = next(k for k in range(3) if {tuple(vertices[face[k]][:2]), tuple(vertices[face[k - 2]][:2])} == {(1.0, 1.0)})
    a, b, c = np.roll(face, -k)
    rest = np.delete(CUBE.faces, np.flatnonzero(on_edge)[0], axis=0)
    cut = Mesh.from_arrays("m", vertices, np.vstack([rest, [[a, 8, c], [8, b, c]]]))
    assert closed(cut) == [True]
    mesh = joined(box((2, 2, 2), (2, 2, 0)), cut, without(box((2, 2, 2), (9, 0, 0)), 0))
    for form in (mesh, merged(mesh)):
        found = pieces(form)
        assert sorted(found.closed_components.tolist()) == [False, True, True]
        assert found.volume == pytest.approx(16)
        assert "GEO242" in codes(form)


def test_a_flat_cap_is_unfolded_beside_an_open_piece() -> None:
    """Folds of solids are mended whatever else is in the mesh: a cap covered thrice, once the other way."""
    cap = Mesh.from_arrays("m", CUBE.vertices, CUBE.faces)
    u = cap.vertices[:, 2] > 0
    corners = np.flatnonzero(u)
    top = (cap.vertices[cap.faces][:, :, 2] > 0).all(axis=1)
    middle = np.array([[0.2, 0.1, 1.0], [-3.0, 0.4, 1.0]])
    ring = [corners[0], corners[2], corners[3], corners[1]]
    # A fan about a point outside of the square: some of its triangles are wound the other way.
    fan = np.array([[a, b, 9] for a, b in zip(ring, np.roll(ring, -1), strict=True)])
    folded = Mesh.from_arrays("m", np.vstack([cap.vertices, middle]), np.vstack([cap.faces[~top], fan]))
    alone, beside = (repaired(m) for m in (folded, joined(folded, without(box((1, 1, 1), (9, 0, 0)), 0))))
    assert alone.folded_faces > 0
    assert beside.folded_faces == alone.folded_faces
    assert beside.analysis.volume == pytest.approx(8)


def test_the_finding_says_how_many_pieces_are_open_and_where() -> None:
    walls = [box((1, 1, 1), (3 * i, 0, 0)) for i in range(19)]
    walls[7] = without(walls[7], int(np.flatnonzero((walls[7].vertices[walls[7].faces][:, :, 2] > 0).all(axis=1))[0]))
    log, mesh = DiagnosticLog(), joined(*walls)
    mesh_diagnostics(mesh, pieces(mesh), log)
    found = {d.code: d for d in log}
    assert found["GEO237"].message == "the mesh is in 19 pieces, 18 closed and 1 open"
    message, where = found["GEO232"].message.split(", one of them at (")
    assert message == "1 of 19 pieces is open: 3 edges border an odd number of triangles"
    x, _, z = map(float, where.split(")")[0].split(", "))
    assert 20.5 <= x <= 21.5
    assert z == 0.5
    assert "the closed pieces are solid" in found["GEO232"].hint


@pytest.mark.parametrize("seed", range(3))
def test_pieces_that_are_not_convex_are_told_apart_too(seed: int) -> None:
    mesh = joined(
        channel(), without(moved(channel(), rotation(seed), (2, 2, 5)), seed), moved(channel(), np.eye(3), (4, 0, 0))
    )
    assert closed(mesh) == [True, False, True]
    assert closed(merged(mesh)) == [True, False, True]
