"""Edges between configurations: where they fail, and why; against analytic scenes and single queries."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenes import box_mesh, free_cube, write_scene

import env2mjcf
from env2mjcf import Scene
from env2mjcf.simulation.edge_verdicts import Edges, EdgeVerdicts
from env2mjcf.simulation.verdicts import Verdicts

WALL = box_mesh(0.5, 5.0, 5.0)


def load(folder: Path, text: str) -> Scene:
    return env2mjcf.load(write_scene(folder, text, wall=WALL), engine="mujoco")


def at(*x: float) -> np.ndarray:
    """Return configurations of the cube at these places on the x axis."""
    q = np.zeros((len(x), 6))
    q[:, 0] = x
    return q


def edges(q: np.ndarray, *ends: tuple[int, int], between: tuple[np.ndarray, ...] = ()) -> Edges:
    return Edges(q, np.array(ends, dtype=np.int64).reshape(-1, 2), between, [f"{i}-{j}" for i, j in ends])


def test_an_edge_fails_at_the_first_step_that_touches(tmp_path: Path) -> None:
    # The cube meets the wall, half a metre thick on either side of x = 3, at x = 2.
    scene = load(tmp_path, free_cube("wall.g 3 0 0 0 0 0"))
    judge = EdgeVerdicts(scene, edges(at(-2, 0, 6), (0, 1), (1, 2), (0, 2), (2, 0)), resolution=0.1)
    assert judge.valid.tolist() == [True, False, False, False]
    assert judge.verdict(0).at is None
    one = judge.verdict(1)
    assert one.fraction == pytest.approx(2 / 6, abs=0.1 / 6)
    assert one.at is not None
    assert [(c.link, c.other) for c in one.at.contacts] == [("cube", "wall")]
    assert one.at.q[0] == pytest.approx(2.0, abs=0.1)
    assert judge.verdict(2).fraction == pytest.approx(4 / 8, abs=0.1 / 8)
    # From the other side it meets it at x = 4.
    assert judge.verdict(3).fraction == pytest.approx(2 / 8, abs=0.1001 / 8)


def test_steps_that_are_too_long_pass_over_a_wall_and_a_proof_does_not(tmp_path: Path) -> None:
    scene = load(tmp_path, free_cube("wall.g 3 0 0 0 0 0"))
    found = EdgeVerdicts(scene, edges(at(-2, 0, 8), (0, 1), (1, 2)), resolution=100.0)
    assert found.valid.tolist() == [True, True]
    found = EdgeVerdicts(scene, edges(at(-2, 0, 8), (0, 1), (1, 2)), resolution=100.0, certified=True)
    assert found.valid.tolist() == [True, False]
    verdict = found.verdict(1)
    assert (verdict.proved, verdict.fraction, verdict.at) == (False, None, None)
    assert found.verdict(0).proved is True


def test_an_edge_goes_through_its_intermediates(tmp_path: Path) -> None:
    scene = load(tmp_path, free_cube("wall.g 3 0 0 0 0 0", boundary="Boundary Box [-20:20 ; -20:20 ; -20:20]"))
    q = at(0, 6)
    around = np.array([[0, 7, 0, 0, 0, 0], [6, 7, 0, 0, 0, 0]], dtype=float)
    short = np.array([[0, 5, 0, 0, 0, 0], [6, 5, 0, 0, 0, 0]], dtype=float)
    judge = EdgeVerdicts(scene, edges(q, (0, 1), (0, 1), between=(around, short)), resolution=0.05)
    assert judge.valid.tolist() == [True, False]
    # 5 m up, and 2 of the 6 m across, of 16 m in all.
    assert judge.verdict(1).fraction == pytest.approx(7 / 16, abs=0.01)


def test_an_edge_keeps_to_the_boundary_and_the_limits(tmp_path: Path) -> None:
    scene = load(tmp_path, free_cube(boundary="Boundary Box [-5:5 ; -5:5 ; -5:5]"))
    judge = EdgeVerdicts(scene, edges(at(0, 4, 6), (0, 1), (1, 2)), resolution=0.1)
    assert judge.valid.tolist() == [True, False]
    verdict = judge.verdict(1)
    assert verdict.at is not None
    assert verdict.at.outside == ("cube",)
    assert verdict.fraction == pytest.approx(0.25, abs=0.051)
    # The corners of a cube leave a boundary that it fits into while it turns.
    scene = load(tmp_path, free_cube(boundary="Boundary Box [-0.55:0.55 ; -5:5 ; -5:5]"))
    q = np.zeros((2, 6))
    q[1, 5] = np.pi / 2
    assert scene.is_valid(q).all()
    assert not EdgeVerdicts(scene, edges(q, (0, 1)), resolution=0.05).valid.any()


def test_turns_go_the_short_way(tmp_path: Path) -> None:
    # Turned by 18 degrees a cube reaches 0.63 m, by 45 degrees 0.71 m; the other one begins at 0.66 m.
    scene = load(tmp_path, free_cube("cube.g 1.16 0 0 0 0 0"))
    q = np.zeros((2, 6))
    q[:, 5] = np.radians([342, 18])
    half = np.array([[0, 0, 0, 0, 0, np.pi]])
    judge = EdgeVerdicts(scene, edges(q, (0, 1), (0, 1), between=(half[:0], half)), resolution=0.01)
    assert judge.valid.tolist() == [True, False]


def test_blocks_of_work_do_not_change_answers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = load(tmp_path, free_cube("wall.g 3 0 0 0 0 0", "cube.g -2 1 0 10 20 30"))
    q = scene.space.sample(40, seed=5)
    pairs = [tuple(p) for p in np.random.default_rng(0).integers(0, 40, (80, 2)).tolist()]
    whole = EdgeVerdicts(scene, edges(q, *pairs), resolution=0.3)
    monkeypatch.setattr("env2mjcf.contact.queries._BLOCK", 7)
    cut = EdgeVerdicts(scene, edges(q, *pairs), resolution=0.3)
    assert 0 < whole.valid.sum() < len(pairs)
    assert (whole.valid == cut.valid).all()
    assert [whole.verdict(i).fraction for i in range(80)] == [cut.verdict(i).fraction for i in range(80)]


def test_edges_agree_with_check_path(tmp_path: Path) -> None:
    scene = load(tmp_path, free_cube("wall.g 3 0 0 0 0 0", "cube.g -2 1 0 10 20 30"))
    q = scene.space.sample(60, seed=6)
    report = scene.check_path(q, resolution=0.2)
    judge = EdgeVerdicts(scene, edges(q, *((i, i + 1) for i in range(59))), resolution=0.2)
    assert judge.valid.tolist() == report.edges.tolist()


def test_edges_that_are_not_to_be_looked_at_are_not_valid(tmp_path: Path) -> None:
    scene = load(tmp_path, free_cube())
    judge = EdgeVerdicts(scene, edges(at(0, 1, 2), (0, 1), (1, 2)), checked=np.array([True, False]))
    assert (judge.valid.tolist(), judge.verdict(1).checked) == ([True, False], False)


def test_no_edges_are_no_trouble(tmp_path: Path) -> None:
    scene = load(tmp_path, free_cube())
    for q in (at(), at(1)):
        assert len(EdgeVerdicts(scene, edges(q), certified=True).valid) == 0


def test_steps_without_end_are_refused(tmp_path: Path) -> None:
    scene = load(tmp_path, free_cube())
    for resolution in (1e-12, 1e-300):
        with pytest.raises(ValueError, match="too many checks"):
            EdgeVerdicts(scene, edges(at(0, 5), (0, 1)), resolution=resolution)
    with pytest.raises(ValueError, match="positive"):
        EdgeVerdicts(scene, edges(at(0, 5), (0, 1)), resolution=0.0)


def test_links_that_a_file_places_are_judged_where_they_are(tmp_path: Path) -> None:
    scene = load(tmp_path, free_cube("cube.g 3 0 0 0 0 0", boundary="Boundary Box [-5:5 ; -5:5 ; -5:5]"))
    poses = np.tile(np.eye(4), (4, 1, 1, 1))
    poses[:, 0, 0, 3] = 0, 2.5, 3.0, -8
    judge = Verdicts(scene, at(0, 0, 0, 0), list("abcd"), poses, np.array([False] * 4))
    assert judge.in_collision.tolist() == [False, True, True, False]
    assert judge.inside.tolist() == [True, True, True, False]
    assert [(c.link, c.other) for c in judge.verdict(1).contacts] == [("cube", "cube_2")]
    assert judge.verdict(1).contacts[0].distance == pytest.approx(-0.5)
    assert judge.verdict(3).outside == ("cube",)
    fitting = Verdicts(scene, at(0, 0, 0, 0), list("abcd"), poses, np.array([True] * 4))
    assert fitting.valid.all()


def test_contacts_of_poses_are_those_of_the_configuration_that_has_them(tmp_path: Path) -> None:
    scene = load(tmp_path, free_cube("cube.g 1 0 0 0 0 0", "wall.g -2 0 0 0 0 0"))
    for q in scene.space.sample(60, seed=2):
        touching = {(c.link, c.other) for c in scene.contacts_of_poses(scene.link_poses(q))}
        assert bool(touching) == scene.in_collision(q)
        assert touching == {(c.link, c.other) for c in scene.contacts(q)}
    with pytest.raises(ValueError, match=r"expected \(1, 4, 4\)"):
        scene.contacts_of_poses(np.eye(4))
