"""The exact engine on whole scenes: against triangles, against MuJoCo's engine, against coal, and against itself."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from extras import needs
from meshes import channel
from scenes import MODELS, box_mesh, free_cube, write_scene
from truth import Truth, bisected, near_obstacles

import env2mjcf
import env2mjcf.contact.exact.engine as exact_engine
from env2mjcf.formats.meshes.byu import export_byu

needs_numba = needs("fast")

# With obstacles, and with a free side to bisect from.
SCENES = ("alpha/alpha", "bug-trap/bug-trap", "maze/maze", "spherical-arm/spherical-arm", "two-robots/two-robots")


def load(name: str, **options: object) -> env2mjcf.Scene:
    path = MODELS / f"{name}.env"
    return env2mjcf.load(path, robots=tuple(path.parent.glob("*.robot")), **options)


@pytest.fixture(scope="module", params=SCENES)
def model(request: pytest.FixtureRequest) -> env2mjcf.Scene:
    return load(request.param)


def rows(scene: env2mjcf.Scene, count: int, seed: int) -> np.ndarray:
    return np.concatenate([scene.space.sample(count, seed), near_obstacles(scene, count, seed)])


@needs_numba
class TestVerdicts:
    @pytest.mark.slow_but("alpha", "bug-trap")
    def test_are_those_of_the_triangles(self, model: env2mjcf.Scene) -> None:
        truth = Truth(model)
        q = np.concatenate([rows(model, 100, 1), bisected(model, truth, 30, 40, seed=2)])
        for row, verdict in zip(q, model.in_collision(q, engine="exact"), strict=True):
            assert not truth.wrong(row, bool(verdict), 1e-9 * model.extent)

    def test_are_those_of_mujoco_outside_the_band(self, model: env2mjcf.Scene) -> None:
        q = rows(model, 300, 3)
        exact, mujoco = (model.in_collision(q, engine=e) for e in ("exact", "mujoco"))
        differ = q[exact != mujoco]
        assert len(differ) < 20
        assert (np.abs(model.clearance(differ)) < 1e-5 * model.extent).all()
        assert 0.02 < exact.mean() < 0.98

    def test_of_validity_are_those_of_mujoco_too(self, model: env2mjcf.Scene) -> None:
        q = rows(model, 200, 4)
        # Some rows beyond limits, some beyond the boundary.
        q = np.concatenate([q, 1.3 * q])
        exact, mujoco = (model.is_valid(q, engine=e) for e in ("exact", "mujoco"))
        assert (np.abs(model.clearance(q[exact != mujoco])) < 1e-5 * model.extent).all()
        assert 0.02 < exact.mean() < 0.98

    def test_are_the_same_for_one_row_many_rows_and_two_threads(self, model: env2mjcf.Scene) -> None:
        q = rows(model, 6000, 5)
        together = model.in_collision(q, threads=1)
        np.testing.assert_array_equal(model.in_collision(q, threads=2), together)
        assert [model.in_collision(row) for row in q[:50]] == together[:50].tolist()
        assert isinstance(model.in_collision(q[0]), bool)
        # Rows that do not lie one after the other in memory.
        np.testing.assert_array_equal(model.in_collision(np.asfortranarray(q)[::7]), together[::7])

    @pytest.mark.slow_but("alpha", "bug-trap")
    def test_go_with_contacts(self, model: env2mjcf.Scene) -> None:
        for row in bisected(model, Truth(model), 20, 45, seed=6):
            assert bool(model.contacts(row)) == model.in_collision(row)

    @pytest.mark.parametrize("engine", ["exact", "mujoco"])
    def test_of_a_base_walled_in_are_always_collisions(self, tmp_path: Path, engine: str) -> None:
        """It cannot move, and no surface touches it: the floor of a channel is around it."""
        mesh = channel()
        middle = mesh.vertices.mean(axis=0)
        solid = export_byu(trimesh.Trimesh(mesh.vertices - middle, mesh.faces, process=False))
        within, above = np.array([2, 1.5, 0.5]) - middle, np.array([2, 1.5, 2.5]) - middle
        for place, expected in ((within, True), (above, False)):
            pose = " ".join(map(str, place))
            robot = f"1\ncube.g Fixed {pose} 0 0 0\nConnections\n0\n"
            scene = env2mjcf.load(
                write_scene(
                    tmp_path, free_cube("solid.g 0 0 0 0 0 0", robot=robot), cube=box_mesh(0.1, 0.1, 0.1), solid=solid
                )
            )
            q = np.zeros((2, 0))
            assert scene.in_collision(q, engine=engine).tolist() == [expected] * 2
            assert scene.is_valid(q, engine=engine).tolist() == [not expected] * 2

    def test_of_surfaces_know_no_inside(self, tmp_path: Path) -> None:
        path = write_scene(
            tmp_path, free_cube("room.g 0 0 0 0 0 0"), cube=box_mesh(0.2, 0.2, 0.2), room=box_mesh(2, 2, 2)
        )
        inside, across, outside = np.zeros(6), np.array([1.9, 0, 0, 0, 0, 0]), np.array([3, 0, 0, 0, 0, 0.0])
        q = np.array([inside, across, outside])
        assert env2mjcf.load(path, collision="solid").in_collision(q).tolist() == [True, True, False]
        assert env2mjcf.load(path, collision="surface").in_collision(q).tolist() == [False, True, False]

    @pytest.mark.parametrize("collision", ["auto", "surface", "hull"])
    def test_of_a_small_body_in_a_large_one_and_round_it(self, tmp_path: Path, collision: str) -> None:
        """The box around may be the link as well as the obstacle, and either may be another shape."""
        octahedron = "1 6 8 24\n1 8\n" + "".join(f"{x} {y} {z}\n" for x, y, z in 0.3 * np.array(_OCTAHEDRON)) + _FACES
        shell = free_cube("inner.g 0 0 0 0 0 0")
        path = write_scene(tmp_path, shell, cube=box_mesh(1, 1, 1), inner=octahedron)
        scene = env2mjcf.load(path, collision=collision)
        verdict = scene.in_collision(np.array([np.zeros(6), [0.9, 0, 0, 0, 0, 0], [1.31, 0, 0, 0, 0, 0]]))
        assert verdict.tolist() == [collision != "surface", True, False]


_OCTAHEDRON = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
_FACES = "1 3 -5\n3 2 -5\n2 4 -5\n4 1 -5\n3 1 -6\n2 3 -6\n4 2 -6\n1 4 -6\n"


@needs_numba
class TestClearance:
    def test_is_that_of_coal(self, model: env2mjcf.Scene) -> None:
        coal = pytest.importorskip("coal", reason="no coal to compare with")
        parts = {p.name: p for p in model.compiled.assembly.parts()}
        meshes = {}
        for name in {n for pair in model.pairs for n in pair}:
            analysis, mesh = parts[name].analysis, coal.BVHModelOBBRSS()
            mesh.beginModel(len(analysis.faces), len(analysis.vertices))
            mesh.addVertices(analysis.vertices)
            mesh.addTriangles(analysis.faces)
            mesh.endModel()
            meshes[name] = mesh
        q = rows(model, 150, 7)
        q = q[~model.in_collision(q)][:60]
        truth = Truth(model)
        for row, found in zip(q, model.clearance(q), strict=True):
            at = {n: coal.Transform3s(p[:3, :3], p[:3, 3]) for n, p in truth.poses(row).items()}
            expected = min(
                coal.distance(meshes[a], at[a], meshes[b], at[b], coal.DistanceRequest(), coal.DistanceResult())
                for a, b in model.pairs
            )
            assert found == pytest.approx(expected, abs=1e-6 * model.extent)

    @pytest.mark.slow_but("bug-trap")
    def test_is_positive_just_where_nothing_touches(self, model: env2mjcf.Scene) -> None:
        q = rows(model, 300, 8)
        hits = model.in_collision(q)
        assert (model.clearance(q[~hits]) > 0).all()
        # Depths are searched for in numpy, which takes its time.
        assert (model.clearance(q[hits][:6]) <= 0).all()

    @pytest.mark.slow_but("gantry", "maze", "spherical")
    def test_of_a_row_does_not_depend_on_the_others(self, model: env2mjcf.Scene) -> None:
        q = rows(model, 40, 17)
        q = q[np.argsort(~model.in_collision(q), kind="stable")][:6]
        assert model.clearance(q).tolist() == [model.clearance(row) for row in q]

    def test_is_that_of_the_arrays(self, model: env2mjcf.Scene) -> None:
        """The numpy search, which answers where numba is not installed."""
        q = rows(model, 60, 9)
        q = q[~model.in_collision(q)][:10]
        arrays = model._solver._triangles.clearance.signed(model._solver._poses_by_name(q), len(q))
        np.testing.assert_allclose(model.clearance(q), arrays, atol=1e-9 * model.extent)


@needs_numba
class TestEdges:
    def test_hit_where_one_of_their_steps_does(self, model: env2mjcf.Scene) -> None:
        q0, q1 = rows(model, 60, 10), rows(model, 60, 11)
        q1 = q0 + 0.2 * model.space.difference(q0, q1)
        expected = [
            model.in_collision(model._solver.steps.rows(a, b, 0.02 * model.extent)).any()
            for a, b in zip(q0, q1, strict=True)
        ]
        found = model.edge_in_collision(q0, q1, 0.02 * model.extent)
        assert found.tolist() == expected
        assert 0 < found.sum() < len(found)

    def test_that_are_certified_hold_no_collision(self, model: env2mjcf.Scene) -> None:
        q0 = rows(model, 400, 12)
        q0 = q0[~model.in_collision(q0)]
        q1 = q0 + 0.15 * model.space.difference(q0, np.roll(q0, 1, axis=0))
        certified = model.edge_is_free(q0, q1)
        assert 20 < certified.sum() < len(q0)
        for a, d in zip(q0[certified][:60], model.space.difference(q0, q1)[certified][:60], strict=True):
            assert not model.in_collision(a + np.linspace(0, 1, 400)[:, None] * d).any()

    def test_that_are_clear_by_more_than_the_band_are_certified(self, model: env2mjcf.Scene) -> None:
        q0 = rows(model, 100, 13)
        q0 = q0[~model.in_collision(q0)]
        q0 = q0[model.clearance(q0) > 1e-3 * model.extent][:40]
        delta = 0.05 * model.space.difference(q0, np.roll(q0, 1, axis=0))
        proved = 0
        for a, d in zip(q0, delta, strict=True):
            between = a + np.linspace(0, 1, 100)[:, None] * d
            if not model.in_collision(between).any() and model.clearance(between).min() > 5e-4 * model.extent:
                assert model.edge_is_free(a, a + d)
                proved += 1
        assert proved > 5

    def test_are_certified_as_the_arrays_say(self, model: env2mjcf.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
        q0 = rows(model, 12, 14)
        q0 = q0[~model.in_collision(q0)][:8]
        q1 = q0 + 0.1 * model.space.difference(q0, np.roll(q0, 1, axis=0))
        compiled = model.edge_is_free(q0, q1)
        monkeypatch.setattr(model._solver, "_default", "mujoco")
        monkeypatch.setattr(model._solver, "_ready", None)
        assert compiled.tolist() == model.edge_is_free(q0, q1).tolist()

    def test_are_none_if_there_are_none(self) -> None:
        for name in ("gantry/gantry", "maze/maze"):
            scene = load(name)
            none = np.zeros((0, scene.space.dim))
            assert scene.edge_is_free(none, none).shape == scene.edge_in_collision(none, none).shape == (0,)

    def test_past_a_thin_wall_are_not_certified(self, tmp_path: Path) -> None:
        """A wall that any fixed step would jump over, and one just beside the way."""
        wall = box_mesh(1e-4, 3, 3)
        for y, expected in ((0.0, False), (3.0 + 0.5 + 1e-3, True), (3.0 + 0.5 - 1e-3, False)):
            scene = env2mjcf.load(
                write_scene(tmp_path, free_cube("wall.g 0 0 0 0 0 0"), cube=box_mesh(0.5, 0.5, 0.5), wall=wall)
            )
            ends = np.array([[-5, y, 0.1, 0, 0, 0], [5, y, 0.1, 0, 0, 0.0]])
            assert scene.edge_is_free(*ends) is expected


class TestEngines:
    def test_without_numba_mujoco_answers(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(exact_engine, "find_spec", lambda name: None)
        scene = load("maze/maze")
        q = scene.space.sample(200, 15)
        assert scene._solver._chosen("auto") is None
        np.testing.assert_array_equal(scene.in_collision(q), scene.in_collision(q, engine="mujoco"))
        with pytest.raises(ValueError, match=r"pip install 'env2mjcf\[fast\]'"):
            scene.in_collision(q, engine="exact")
        with pytest.raises(ValueError, match=r"pip install 'env2mjcf\[fast\]'"):
            load("maze/maze", engine="exact")

    @needs_numba
    def test_nothing_imports_numba_before_it_is_needed(self) -> None:
        code = (
            "import sys, env2mjcf\n"
            f"scene = env2mjcf.load({str(MODELS / 'maze/maze.env')!r}, robots=[{str(MODELS / 'maze/maze.robot')!r}])\n"
            "assert 'numba' not in sys.modules, 'numba is imported'\n"
            "scene.in_collision(scene.space.home)\n"
            "assert 'numba' in sys.modules\n"
        )
        subprocess.run([sys.executable, "-c", code], check=True)

    @needs_numba
    def test_a_warm_scene_says_how_long_it_took(self) -> None:
        scene = load("maze/maze")
        assert scene.warm_up() > 0
        assert scene.warm_up() < 0.1
        assert load("maze/maze").warm_up(wait=False) == 0.0

    @needs_numba
    def test_the_command_line_compiles_ahead(self, capsys: pytest.CaptureFixture[str]) -> None:
        from env2mjcf.cli.main import main

        assert main(["cache", "warm"]) == 0
        assert capsys.readouterr().out.startswith("the exact engine is ready")

    @needs_numba
    def test_what_is_kept_on_disk_belongs_to_these_sources(self) -> None:
        from env2mjcf.contact.exact.kernels import compiling, entries

        for name in ("collisions", "validities", "distances", "edges_collide", "edges_are_free"):
            closure = getattr(entries, name).py_func.__closure__
            assert compiling.SOURCES in [cell.cell_contents for cell in closure]

    def test_an_unknown_engine_is_refused(self) -> None:
        with pytest.raises(ValueError, match="'exakt'"):
            load("maze/maze").in_collision([0.0, 0.0, 0.0], engine="exakt")

    def test_a_scene_without_pairs_is_free_everywhere(self, tmp_path: Path) -> None:
        scene = env2mjcf.load(write_scene(tmp_path, free_cube(), cube=box_mesh(1, 1, 1)))
        q = scene.space.sample(5, 16)
        assert not scene.in_collision(q).any()
        assert np.isinf(scene.clearance(q)).all()
        assert scene.edge_is_free(q, q[::-1].copy()).all()
