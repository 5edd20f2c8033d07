"""What repair does to a surface, and what it leaves alone."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from meshes import (
    assert_surface_stays,
    box,
    channel,
    codes,
    corpus_meshes,
    farthest,
    grid,
    joined,
    moved,
    rotation,
    samples,
    soup,
    turned,
)

from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.errors import GeometryError
from env2mjcf.geometry.mesh import Mesh
from env2mjcf.geometry.repair import repair_diagnostics, repaired


def notched_box(*, sides: int = 1) -> Mesh:
    """A unit box of which triangles were cut at the middle of an edge on one side of that edge only."""
    mesh = box()
    vertices, faces = mesh.vertices.tolist(), mesh.faces.tolist()
    for _ in range(sides):
        a, b, c = faces.pop(0)
        middle = ((np.array(vertices[a]) + vertices[b]) / 2).tolist()
        vertices.append(middle)
        n = len(vertices) - 1
        faces += [[a, n, c], [n, b, c]]
    return Mesh.from_arrays("notched", vertices, faces)


def bad_meshes() -> dict[str, Mesh]:
    plain = moved(channel(), rotation(3), (5, -2, 1))
    doubled = Mesh.from_arrays("doubled", plain.vertices, np.vstack([plain.faces, plain.faces]))
    sliver = [[0, 1, 1], [2, 2, 2]]
    return {
        "soup": soup(plain),
        "each face twice": doubled,
        "mixed winding": turned(plain, [1, 4, 7, 11]),
        "inside out": turned(plain),
        "degenerate faces": Mesh.from_arrays("slivers", plain.vertices, np.vstack([plain.faces, sliver])),
        "unused vertices": Mesh.from_arrays("unused", np.vstack([plain.vertices, [[99, 0, 0]]]), plain.faces),
        "t-junctions": moved(notched_box(sides=4), rotation(1)),
        "sheet": grid(3),
        "two pieces": joined(plain, box((1, 1, 1), (20, 0, 0))),
    }


@pytest.mark.parametrize("name", bad_meshes())
def test_the_surface_never_moves(name: str) -> None:
    assert_surface_stays(bad_meshes()[name])


def test_the_distance_test_sees_a_surface_that_moved() -> None:
    mesh = box()
    lifted = mesh.vertices + np.array([0, 0, 1e-6])
    assert farthest(samples(mesh.vertices, mesh.faces), lifted, mesh.faces) == pytest.approx(1e-6, rel=1e-6)


@pytest.mark.parametrize("name", [n for n in bad_meshes() if n not in {"t-junctions", "sheet", "two pieces"}])
def test_a_bad_channel_is_a_closed_solid_of_the_right_volume(name: str) -> None:
    a = repaired(bad_meshes()[name]).analysis
    assert a.solid
    assert a.volume == pytest.approx(28, rel=1e-12)


@pytest.mark.parametrize("sides", [1, 2, 4, 6])
def test_t_junctions_are_cut_and_the_box_closes(sides: int) -> None:
    mesh = notched_box(sides=sides)
    result = repaired(mesh)
    assert result.cut_faces > 0
    assert result.left_open > 0
    assert result.analysis.solid
    assert result.analysis.volume == pytest.approx(1, rel=1e-12)
    assert result.analysis.convex
    assert set(result.analysis.source) <= set(range(len(mesh.faces)))
    assert "GEO242" in codes(mesh)


def test_several_vertices_on_one_edge_are_cut_in_order() -> None:
    mesh = box()
    a, b, c = mesh.faces[0]
    at = np.array([0.3, 0.1, 0.7, 0.5, 0.9])
    extra = mesh.vertices[a] + at[:, None] * (mesh.vertices[b] - mesh.vertices[a])
    chain = [a, *(8 + np.argsort(at)), b]
    fan = [[u, v, c] for u, v in pairwise(chain)]
    result = repaired(Mesh.from_arrays("comb", np.vstack([mesh.vertices, extra]), np.vstack([mesh.faces[1:], fan])))
    assert result.cut_faces == 1
    assert result.analysis.solid
    assert result.analysis.volume == pytest.approx(1, rel=1e-12)


def test_a_cut_face_leads_back_to_the_face_of_the_file() -> None:
    mesh = notched_box()
    result = repaired(mesh)
    a = result.analysis
    for face, source in zip(a.faces, a.source, strict=True):
        corners = mesh.vertices[mesh.faces[source]]
        assert farthest(a.vertices[face], corners, np.array([[0, 1, 2]])) < 1e-12


@pytest.mark.parametrize("mesh", [box(), channel(), grid(4)], ids=lambda m: m.name)
def test_a_mesh_without_t_junctions_is_left_as_it_is(mesh: Mesh) -> None:
    result = repaired(mesh)
    assert result.cut_faces == 0
    assert "GEO242" not in codes(mesh)
    np.testing.assert_array_equal(np.sort(result.analysis.source), np.arange(len(mesh.faces)))


def test_a_mesh_that_stays_open_says_so() -> None:
    mesh = notched_box()
    lid = Mesh.from_arrays("lidless", mesh.vertices, mesh.faces[:-3])
    result = repaired(lid)
    assert not result.analysis.closed
    assert "GEO232" in codes(lid)


def test_a_repair_is_an_error_in_strict_mode() -> None:
    mesh = notched_box()
    with pytest.raises(GeometryError, match="T-junction"):
        repair_diagnostics(mesh, repaired(mesh), DiagnosticLog(strict=True))


@pytest.mark.slow
def test_corpus_surfaces_never_move(corpus: Path) -> None:
    for mesh in corpus_meshes(corpus):
        if len(mesh.faces) <= 200:
            assert_surface_stays(mesh)


def test_real_walls_doubled_robots_and_flat_plates(corpus: Path) -> None:
    by_name = {m.path.name: m for m in corpus_meshes(corpus)}
    for i in range(1, 5):
        wall = repaired(by_name[f"wall{i}.g"]).analysis
        assert wall.solid
        assert wall.crowded_edges > 0
    assert "GEO233" in codes(by_name["wall0.g"])
    stick = by_name["stick-bug.obj"]
    assert "GEO235" in codes(stick)
    assert len(repaired(stick).analysis.faces) * 2 == len(stick.faces)
    assert repaired(by_name["ablock.g"]).analysis.flat
    assert "GEO230" in codes(by_name["ablock.g"])
