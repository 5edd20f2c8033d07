"""How far convex pieces are from the mesh: against sizes known by algebra."""

from __future__ import annotations

import json
import math
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import trimesh
from meshes import box, channel, grid, joined, tetrahedron
from scenes import MODELS, free_cube, write_scene

import env2mjcf
from env2mjcf.cli.main import main
from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.geometry.analysis import analyse
from env2mjcf.geometry.certificate import Certificate, _pieces, certify
from env2mjcf.geometry.distance import distances, spread
from env2mjcf.geometry.mesh import Mesh
from env2mjcf.geometry.pieces import hull_faces, hull_piece
from env2mjcf.geometry.shapes import CollisionShape, collision_shape

THICKNESS = 1e-5


def certified(mesh: Mesh, strategy: str) -> Certificate:
    return certify(collision_shape(mesh, analyse(mesh), strategy, THICKNESS, DiagnosticLog()), THICKNESS)


def approximated(mesh: Mesh, *parts: Mesh) -> Certificate:
    """Certify these convex parts as if a decomposition had given them."""
    pieces = tuple(hull_piece(part.vertices, THICKNESS) for part in parts)
    return certify(CollisionShape(mesh, "coacd", pieces, False, analyse(mesh), ""), THICKNESS)


class TestDistances:
    def test_agree_with_fcl(self):
        fcl = pytest.importorskip("fcl", reason="no python-fcl to compare with")
        rng = np.random.default_rng(3)
        mesh = channel()
        points = rng.uniform(-1, 5, (300, 3))
        model = fcl.BVHModel()
        model.beginModel(len(mesh.vertices), len(mesh.faces))
        model.addSubModel(mesh.vertices, mesh.faces)
        model.endModel()
        tiny = 1e-6
        body, ball = fcl.CollisionObject(model), fcl.Sphere(tiny)
        expected = []
        for p in points:
            expected.append(fcl.distance(fcl.CollisionObject(ball, fcl.Transform(p)), body) + tiny)
        assert distances(points, mesh.vertices, mesh.faces) == pytest.approx(np.array(expected), abs=1e-4)

    def test_of_slivers_and_points_are_no_nan(self):
        vertices = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0.0]])
        faces = np.array([[0, 1, 2], [1, 1, 1]])
        assert distances(np.array([[1.5, 2, 0], [-3, 0, 4]]), vertices, faces) == pytest.approx([2, 5])

    @pytest.mark.parametrize("count", [10, 100, 5000])
    def test_no_point_of_a_surface_is_farther_from_the_spread_than_said(self, count):
        mesh = joined(channel(), tetrahedron())
        points, gap = spread(mesh.vertices, mesh.faces, count)
        assert len(points) <= max(count, 3 * len(mesh.faces))
        weights = np.random.default_rng(1).dirichlet([1, 1, 1], (len(mesh.faces), 30))
        surface = np.einsum("fsk,fkx->fsx", weights, mesh.vertices[mesh.faces]).reshape(-1, 3)
        apart = np.linalg.norm(surface[:, None] - points, axis=2).min(axis=1)
        assert gap / 5 < apart.max() <= gap
        assert distances(points, mesh.vertices, mesh.faces).max() < 1e-12

    def test_hulls_look_outwards_and_hold_their_points(self):
        clouds = [channel().vertices, np.random.default_rng(0).normal(size=(50, 3)) + 7]
        for points, faces in zip(clouds, hull_faces(clouds), strict=True):
            corners = points[faces]
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            heights = normals @ points.T - np.einsum("ij,ij->i", normals, corners[:, 0])[:, None]
            assert heights.max() < 1e-5
            assert heights.min() < -0.1


class TestHull:
    def test_of_a_convex_mesh_is_the_mesh(self):
        proof = certified(box(), "hull")
        assert (proof.exact, proof.volume_added, proof.volume_lost, proof.band) == (True, 0, 0, THICKNESS)

    def test_of_a_channel_claims_what_is_between_its_walls(self):
        proof = certified(channel(4.0), "hull")
        assert not proof.exact
        assert proof.volume_added == pytest.approx(8, rel=1e-5)
        assert proof.fraction_added == pytest.approx(8 / 28, rel=1e-5)
        # The middle of the groove is 0.5 from both walls.
        assert 0.45 <= proof.reach_added <= 0.5 + 1e-9
        assert (proof.volume_lost, proof.reach_lost) == (0, 0)
        assert proof.band == proof.reach_added
        assert proof.samples > 1000
        assert "claims 28.6 % of its volume" in str(proof)
        assert "misses no collision" in str(proof)

    def test_of_two_boxes_claims_what_is_between_them(self):
        proof = certified(joined(box(), box(center=(3, 0, 0))), "hull")
        assert proof.volume_added == pytest.approx(2, rel=0.02)
        assert 0.9 <= proof.reach_added <= 1 + 1e-9

    def test_sees_a_cavity_that_no_face_of_the_hull_comes_near_to(self):
        inner = box((2, 2, 2))
        hollow = joined(box((3, 3, 3)), Mesh.from_arrays("inner", inner.vertices, inner.faces[:, ::-1]))
        proof = certified(hollow, "hull")
        assert 0.8 <= proof.reach_added <= 1 + 1e-9
        assert proof.volume_added == pytest.approx(8, rel=0.02)

    def test_of_a_sheet_has_no_fractions(self):
        mesh = Mesh.from_arrays("v", [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2], [0, 2, 3]])
        proof = certified(mesh, "hull")
        assert (proof.fraction_added, proof.volume_lost) == (None, None)
        assert proof.volume_added == pytest.approx(1 / 6, rel=0.1)
        # The corner (1, 0, 0) and (0, 0, 1) are joined by an edge whose middle is 0.5 from both triangles.
        assert 0.45 <= proof.reach_added <= 0.5 + 1e-9


class TestApproximateParts:
    def test_that_lose_a_wall_say_so(self):
        floor = box((4, 3, 1), (2, 1.5, 0.5))
        wall = box((4, 1, 2), (2, 0.5, 2))
        proof = approximated(channel(4.0), floor, wall)
        assert proof.volume_lost == pytest.approx(8, rel=0.02)
        assert proof.fraction_lost == pytest.approx(8 / 28, rel=0.02)
        assert proof.reach_lost == pytest.approx(2, rel=1e-6)  # the top of the wall over the floor
        assert (proof.volume_added, proof.reach_added) == (0, 0)
        assert "claims nothing that is not the mesh" in str(proof)
        assert "collisions there are called free" in str(proof)

    def test_that_stick_out_say_how_far(self):
        proof = approximated(channel(4.0), box((4, 3, 3.25), (2, 1.5, 1.375)))  # a quarter below the floor
        # Between the walls it is 0.5; the corners below are a quarter off.
        assert 0.45 <= proof.reach_added <= 0.5 + 1e-9
        assert proof.volume_added == pytest.approx(8 + 3, rel=0.02)
        assert proof.reach_lost == 0

    def test_that_fit_are_no_approximation(self):
        walls = [box((4, 1, 2), (2, y, 2)) for y in (0.5, 2.5)]
        proof = approximated(channel(4.0), box((4, 3, 1), (2, 1.5, 0.5)), *walls)
        assert (proof.volume_added, proof.volume_lost, proof.reach_added, proof.reach_lost) == (0, 0, 0, 0)
        assert proof.band == THICKNESS


class TestFaithful:
    @pytest.mark.parametrize("strategy", ["auto", "surface"])
    def test_is_exact_by_construction(self, strategy):
        proof = certified(channel(), strategy)
        assert (proof.exact, proof.samples, proof.band) == (True, 0, THICKNESS)

    def test_surface_says_that_a_solid_loses_its_inside(self):
        assert certified(channel(4.0), "surface").volume_lost == pytest.approx(28)
        assert "wholly inside is called free" in str(certified(channel(), "surface"))
        assert certified(channel(), "auto").volume_lost == 0
        assert certified(grid(3), "surface").volume_lost == 0

    def test_hulls_of_convex_components_are_exact_if_each_has_its_own(self):
        two = joined(box(), box(center=(3, 0, 0)))
        assert certified(two, "auto").exact
        assert not certified(two, "hull").exact


@pytest.fixture
def hulled(tmp_path: Path) -> Path:
    """A free cube and a channel."""
    mesh = channel()
    lines = [f"1 {len(mesh.vertices)} {len(mesh.faces)} {3 * len(mesh.faces)}", f"1 {len(mesh.faces)}"]
    lines += [" ".join(map(repr, v)) for v in mesh.vertices.tolist()]
    lines += [f"{a} {b} -{c}" for a, b, c in (mesh.faces + 1).tolist()]
    return write_scene(tmp_path, free_cube("channel.g 9 0 0 0 0 0"), channel="\n".join(lines) + "\n")


def test_report_info_and_mjcf_tell(hulled, tmp_path, capsys):
    result = env2mjcf.convert(hulled, tmp_path / "out", collision="hull")
    by_file = {m.file: m for m in result.report.meshes}
    proof = by_file["channel.g"].certificate
    assert proof.volume_added == pytest.approx(8, rel=1e-5)
    assert by_file["cube.g"].certificate.exact
    head = result.xml.read_text().partition("-->")[0]
    assert str(proof) in head
    assert main(["info", str(hulled), "--collision", "hull"]) == 0
    assert str(proof) in capsys.readouterr().out
    assert main(["info", str(hulled), "--collision", "hull", "--json"]) == 0
    told = {m["file"]: m["certificate"] for m in json.loads(capsys.readouterr().out)["meshes"]}
    assert told["channel.g"]["fraction_added"] == proof.fraction_added
    assert math.isclose(told["channel.g"]["band"], proof.band)


def test_a_certificate_is_kept_like_a_shape(tmp_path, monkeypatch):
    monkeypatch.setenv("ENV2MJCF_CACHE_DIR", str(tmp_path))
    scene = MODELS / "bug-trap" / "bug-trap.env"
    cold = env2mjcf.load(scene, collision="hull").report
    monkeypatch.setattr("env2mjcf.geometry.certificate._measured", lambda *_: pytest.fail("it was measured again"))
    warm = env2mjcf.load(scene, collision="hull").report
    assert cold == warm


def test_a_scene_is_certain_beyond_the_band_of_two_meshes() -> None:
    path = MODELS / "alpha/alpha.env"
    exact, hull = env2mjcf.load(path).report, env2mjcf.load(path, collision="hull").report
    assert exact.band == pytest.approx(1e-5 * exact.extent)
    assert hull.band > 0.1 * hull.extent
    assert "Verdicts are certain beyond 8e-05 m" in env2mjcf.load(path).xml


@pytest.mark.parametrize("sections", [70, pytest.param(120, marks=pytest.mark.slow)])
def test_a_hull_about_very_many_triangles_needs_little_memory(sections: int) -> None:
    """A torus of 19,600 or 57,600 faces: heights of vertices over all facets of its hull would be 0.8 or 6.6 GB."""
    torus = trimesh.creation.torus(2, 0.5, major_sections=2 * sections, minor_sections=sections)
    mesh = Mesh.from_arrays("torus", torus.vertices, torus.faces)
    tracemalloc.start()
    try:
        shape = collision_shape(mesh, analyse(mesh), "hull", THICKNESS, DiagnosticLog())
        held = _pieces(shape).inside(np.array([[0, 0, 0], [2.49, 0, 0], [2.51, 0, 0], [0, 0, 0.51]]))
        peak = tracemalloc.get_traced_memory()[1]
        assert held.tolist() == [True, True, False, False]
        assert peak < 4e8
        if sections > 100:
            proof = certify(shape, THICKNESS)
            assert tracemalloc.get_traced_memory()[1] < 1e9
            # Pappus: the hull adds a disc of radius 2 and height 1, without the inner half of the tube.
            added = 4 * np.pi - np.pi * 0.5**2 / 2 * 2 * np.pi * (2 - 4 * 0.5 / (3 * np.pi))
            assert proof.volume_added == pytest.approx(added, rel=0.01)
            # The middle of the disc is the farthest from the circle in the middle of the tube.
            assert 1.3 < proof.reach_added <= np.hypot(2, 0.5) - 0.5 + 0.01
    finally:
        tracemalloc.stop()
