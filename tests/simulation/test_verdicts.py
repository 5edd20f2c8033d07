"""Verdicts with reasons, paths against row-by-row checks, what calls refuse, and copies that keep their simulation."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from scenes import free_cube, write_scene

import env2mjcf
from env2mjcf import Scene
from env2mjcf.simulation.scene import Query

ARM = (
    "2\ncube.g Planar Rotational\ncube.g Joint\nConnections\n1\n"
    "0 1 Revolute -0.5:0.5\n0.6 0 0 0 0 0  0 0 0 0  0.6 0 0 0 0 0\n"
)


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """A car (x, y, turn) with a cube on a hinge, a box at (5, 5), and a boundary at 10."""
    text = free_cube("5 5 0 0 0 0", boundary="Boundary Box2D [-10:10 ; -10:10]", robot=ARM)
    return env2mjcf.load(write_scene(tmp_path_factory.mktemp("arm"), text), engine="mujoco")


class TestExplain:
    def test_nothing_is_wrong_with_what_is_valid(self, arm: Scene) -> None:
        verdict = arm.explain([0, 0, 0, 0.5])
        assert isinstance(verdict, env2mjcf.Verdict)
        assert (verdict.valid, verdict.reasons, verdict.q.tolist()) == (True, (), [0, 0, 0, 0.5])

    def test_each_reason_says_which_where_and_how_much(self, arm: Scene) -> None:
        (touch,) = arm.explain([4.25, 5, np.pi / 2, 0]).reasons
        assert (touch.link, touch.other, touch.kind) == ("cube", "cube_3", "obstacle")
        assert touch.distance == pytest.approx(-0.25, abs=1e-6)
        assert str(touch).startswith("cube and cube_3 (obstacle): 0.25 m deep at (4.")

        (limit,) = arm.explain([0, 0, 0, 2.0]).reasons
        assert (limit.name, limit.value, limit.upper) == ("cube_2.theta", 2.0, np.pi / 2)
        assert str(limit) == "cube_2.theta is 2; limits -1.5708 to 1.5708"

        # The farther cube ends 1.7 m before the base: at x = 8.5 its far side is at 10.2.
        (outside,) = arm.explain([8.5, 0, 0, 0]).reasons
        assert outside.link == "cube_2"
        assert outside.distance == pytest.approx(0.2)
        assert outside.position[0] == pytest.approx(10.2)
        assert str(outside).startswith("cube_2 reaches 0.2 m outside the boundary, to (10.2, ")

    def test_the_vertex_is_the_one_that_is_farthest_outside(self, tmp_path: Path) -> None:
        text = free_cube("1 0 0 0 0 0", boundary="Boundary Sphere [ 0 0 0 ; 9 ]")
        scene = env2mjcf.load(write_scene(tmp_path, text), engine="mujoco")
        (outside,) = scene.explain([-9, 0.1, 0.2, 0, 0, 0]).reasons
        np.testing.assert_allclose(outside.position, [-9.5, 0.6, 0.7])
        assert outside.distance == pytest.approx(np.linalg.norm([9.5, 0.6, 0.7]) - 9)
        mesh = scene.compiled.assembly.robots[0].links[0].mesh
        np.testing.assert_allclose(mesh.vertices[outside.vertex] + [-9, 0.1, 0.2], outside.position)

    def test_all_that_is_wrong_is_told_at_once(self, arm: Scene) -> None:
        verdict = arm.explain([9.8, 0, 0, 2.0])
        assert verdict.summary == "out of limits, outside the boundary"
        assert [r.name for r in verdict.limits] == ["cube_2.theta"]
        assert verdict.outside == ("cube", "cube_2")

    def test_the_verdict_is_that_of_is_valid(self, arm: Scene) -> None:
        q = arm.space.sample(300, seed=3) * 1.3
        told = [arm.explain(row).valid for row in q]
        assert 30 < sum(told) < 270
        assert told == arm.is_valid(q).tolist()

    def test_each_pair_is_told_once_by_its_deepest_contact(self, arm: Scene) -> None:
        for row in arm.space.sample(200, seed=4):
            every = arm.contacts(row)
            best = {(c.link, c.other): min(d.distance for d in every if d.other == c.other and d.link == c.link)
                    for c in every}  # fmt: skip
            assert {(c.link, c.other): c.distance for c in arm.explain(row).contacts} == best

    def test_takes_one_row_and_a_known_engine(self, arm: Scene) -> None:
        with pytest.raises(ValueError, match="expected one"):
            arm.explain(np.zeros((2, 4)))
        with pytest.raises(ValueError, match="'nonsense' is not one of"):
            arm.explain(np.zeros(4), engine="nonsense")


class TestCheckPath:
    @pytest.mark.parametrize("resolution", [None, 0.3])
    @pytest.mark.parametrize("seed", range(6))
    def test_is_what_looking_at_every_row_says(self, arm: Scene, seed: int, resolution: float | None) -> None:
        path = arm.space.sample(12, seed) * np.array([1.1, 1.1, 1.0, 1.2])
        if seed >= 3:  # short edges, that begin where all is well
            path = np.array([-8, -8, 0, 0]) + np.cumsum(np.random.default_rng(seed).normal(0, 0.5, (12, 4)), axis=0)
        report = arm.check_path(path, resolution)
        good, edges, faults = arm.is_valid(path), [], []
        for i, (a, b) in enumerate(pairwise(path)):
            count = len(arm.edge_rows(a, b, resolution))
            rows = a + np.linspace(0.0, 1.0, count)[:, None] * arm.space.difference(a, b)
            valid = np.array([arm.is_valid(row) for row in rows])
            edges.append(bool(valid.all()))
            faults += [(i, a)] if not good[i] else [(i, rows[np.argmin(valid)])] if not edges[i] else []
        faults += [(11, path[11])] if not good[11] else []
        assert report.configurations.tolist() == good.tolist()
        assert report.edges.tolist() == edges
        assert (report.valid, report.first_invalid) == (not faults, faults[0][0] if faults else None)
        if faults:
            np.testing.assert_array_equal(report.invalid_q, faults[0][1])
            assert [c.other for c in report.contacts] == [c.other for c in arm.contacts(faults[0][1])]

    def test_threads_and_engines_change_nothing(self, arm: Scene) -> None:
        path = arm.space.sample(30, seed=0)
        for work in ({"threads": 2}, {"engine": "exact"}):
            found, expected = arm.check_path(path, **work), arm.check_path(path)
            assert found.edges.tolist() == expected.edges.tolist()
            np.testing.assert_array_equal(found.invalid_q, expected.invalid_q)

    def test_few_configurations_have_no_edges(self, arm: Scene) -> None:
        for count in (0, 1):
            report = arm.check_path(np.zeros((count, 4)))
            assert (report.valid, len(report.configurations), len(report.edges)) == (True, count, 0)


ENGINES: dict[str, Callable[[Scene, Any], Any]] = {
    "in_collision": lambda s, e: s.in_collision(np.zeros((0, 4)), engine=e),
    "is_valid": lambda s, e: s.is_valid(np.zeros(4), engine=e),
    "contacts": lambda s, e: s.contacts(np.zeros(4), engine=e),
    "packed_contacts": lambda s, e: s.packed_contacts(np.zeros((0, 4)), engine=e),
    "edge_in_collision": lambda s, e: s.edge_in_collision(np.zeros(4), np.ones(4), engine=e),
    "check_path": lambda s, e: s.check_path(np.zeros((0, 4)), engine=e),
}


@pytest.mark.parametrize("call", ENGINES)
def test_an_engine_that_does_not_exist_is_refused(arm: Scene, call: str) -> None:
    with pytest.raises(ValueError, match="'nonsense' is not one of 'auto', 'exact', 'mujoco'"):
        ENGINES[call](arm, "nonsense")
    ENGINES[call](arm, "mujoco")


def test_an_edge_is_checked_by_the_engine_of_the_call(arm: Scene) -> None:
    q = arm.space.sample(40, seed=1)
    found = [arm.edge_in_collision(q[:20], q[20:], engine=e).tolist() for e in ("mujoco", "exact")]
    assert found[0] == found[1]
    assert 0 < sum(found[0]) < 20


OF_SCENE = (
    "in_collision", "is_valid", "clearance", "contacts", "explain", "out_of_bounds", "link_poses", "loop_error", "set"
)  # fmt: skip
OF_SPACE = ("check", "decode", "encode", "qpos", "within_limits", "broken")
CALLS: dict[str, Callable[[Scene, Any], Any]] = {
    **{name: (lambda s, q, name=name: getattr(s, name)(q)) for name in OF_SCENE},
    **{name: (lambda s, q, name=name: getattr(s.space, name)(q)) for name in OF_SPACE},
    "packed_contacts": lambda s, q: s.packed_contacts(np.array([q, q])),
    "edge_in_collision": lambda s, q: s.edge_in_collision(np.zeros(4), q),
    "edge_is_free": lambda s, q: s.edge_is_free(q, np.zeros(4)),
    "edge_rows": lambda s, q: s.edge_rows(np.zeros(4), q),
    "check_path": lambda s, q: s.check_path(np.array([q, q])),
    "interpolate": lambda s, q: s.space.interpolate(np.zeros(4), q, 3),
    "difference": lambda s, q: s.space.difference(q, np.zeros(4)),
    "from_qpos": lambda s, q: s.space.from_qpos(q),
    "contacts_of_poses": lambda s, q: s.contacts_of_poses(np.multiply.outer(q, np.ones((2, 4)))[:2]),
    "write_path": lambda s, q: env2mjcf.write_path(s, np.array([q, q]), "never.path"),
    "write_query": lambda s, q: env2mjcf.write_query(s, Query(0, np.array([q, q])), "never.query"),
}


@pytest.mark.parametrize("call", CALLS)
def test_numbers_that_are_not_finite_are_refused(arm: Scene, call: str, tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    for bad in (np.nan, np.inf, -np.inf):
        with pytest.raises(ValueError, match="expected a finite number"):
            CALLS[call](arm, np.array([0, bad, 0, 0]))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "call", [*OF_SCENE, *OF_SPACE, "edge_in_collision", "edge_is_free", "edge_rows", "interpolate", "from_qpos"]
)
@pytest.mark.parametrize(
    "bad",
    [
        ["0", "0", "0", "0"],
        np.array(["0.5"] * 4),
        np.ma.masked_array([0.0, 1.0, 2.0, 3.0], mask=[0, 0, 1, 0]),
        np.array([0j, 1, 2, 3]),
        np.array([0.0, 1, 2, 3], dtype=object),
        [0.0, None, 2.0, 3.0],
        np.array([0, 1, 2, 3], dtype="datetime64[s]"),
    ],
    ids=["texts", "array of texts", "masked", "complex", "objects", "None", "dates"],
)
def test_what_is_not_real_numbers_is_refused(arm: Scene, call: str, bad: Any) -> None:
    with pytest.raises(ValueError, match=r"expected real numbers|masked array"):
        CALLS[call](arm, bad)


def test_poses_are_refused_as_configurations_are(arm: Scene) -> None:
    poses = np.tile(np.eye(4), (2, 1, 1))
    for bad in (poses.astype(str), poses + 0j, np.ma.masked_array(poses, mask=poses > 0), poses.astype(object)):
        with pytest.raises(ValueError, match=r"poses .* expected"):
            arm.contacts_of_poses(bad)


def test_whole_numbers_and_lists_are_numbers(arm: Scene) -> None:
    for q in ([0, 0, 0, 0], (0.0, 0, 0, 0), np.zeros(4, dtype=np.int8), np.zeros(4, dtype=np.float16)):
        assert arm.space.check(q).dtype == np.float64
        assert arm.is_valid(q) is True


def test_a_space_says_what_it_is(arm: Scene) -> None:
    assert repr(arm.space) == ("<ConfigurationSpace of 4 degrees of freedom: cube.x, cube.y, cube.rz, cube_2.theta>")


class TestCopies:
    COPIES: tuple[Callable[[Scene], Scene], ...] = (copy.deepcopy, lambda s: pickle.loads(pickle.dumps(s)))

    @pytest.fixture
    def falling(self, tmp_path: Path) -> Scene:
        scene = env2mjcf.load(write_scene(tmp_path, free_cube("0 0 -3 0 0 0")), engine="mujoco", ground=True)
        scene.set([0.1, 0, 1, 0.3, 0.2, 0.1])
        scene.data.qvel[:3] = 0.5, 0.2, 0.0
        for _ in range(300):
            mujoco.mj_step(scene.model, scene.data)
        return scene

    @pytest.mark.parametrize("way", COPIES, ids=["deepcopy", "pickle"])
    def test_a_copy_goes_on_where_the_scene_is(self, falling: Scene, way: Callable[[Scene], Scene]) -> None:
        falling.model.opt.gravity[2] = -3.0
        twin = way(falling)
        assert twin.data.time == falling.data.time > 0
        assert twin.model.opt.gravity[2] == -3.0
        np.testing.assert_array_equal(twin.data.xpos, falling.data.xpos)
        for _ in range(500):
            for scene in (falling, twin):
                mujoco.mj_step(scene.model, scene.data)
        np.testing.assert_array_equal(twin.data.qpos, falling.data.qpos)
        np.testing.assert_array_equal(twin.q(), falling.q())

    @pytest.mark.parametrize("way", COPIES, ids=["deepcopy", "pickle"])
    def test_a_copy_moves_by_itself(self, falling: Scene, way: Callable[[Scene], Scene]) -> None:
        twin, before = way(falling), falling.q()
        twin.set([5, 5, 5, 0, 0, 0])
        twin.model.opt.gravity[2] = 0.0
        np.testing.assert_array_equal(falling.q(), before)
        assert falling.model.opt.gravity[2] < 0

    @pytest.mark.parametrize("way", COPIES, ids=["deepcopy", "pickle"])
    def test_a_scene_that_was_not_simulated_is_at_home(self, tmp_path: Path, way: Callable[[Scene], Scene]) -> None:
        scene = env2mjcf.load(write_scene(tmp_path, free_cube("5 0 0 0 0 0")), engine="mujoco")
        twin = way(scene)
        assert twin.data.time == 0
        np.testing.assert_allclose(twin.q(), scene.space.home)
