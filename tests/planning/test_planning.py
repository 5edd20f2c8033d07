"""Planning: the space that planners see, what they find in it, and the verb `plan`."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from real_scenes import real_scene, scene_names
from scenes import box_mesh, write_scene
from truth import Truth

import env2mjcf
from env2mjcf.cli.main import main

pytest.importorskip("ompl", reason="no ompl: pip install 'env2mjcf[planning]'")

from env2mjcf.planning import PLANNERS, Plan, plan, plan_through, result
from env2mjcf.planning import planner_space as validity
from env2mjcf.planning.ompl_bridge import state_space
from env2mjcf.planning.planner_space import PlanningSpace, Validity
from env2mjcf.planning.planners import checked_planner
from env2mjcf.planning.result import Progress, Timekeeper
from env2mjcf.planning.segment import shortened

MODELS = Path(__file__).parents[2] / "models"
MAZE = MODELS / "maze" / "maze.xml"

# A cube with edges of 1.
CUBE = """1 8 12 36
1 12
-0.5 -0.5 -0.5  0.5 -0.5 -0.5  0.5 0.5 -0.5  -0.5 0.5 -0.5
-0.5 -0.5 0.5  0.5 -0.5 0.5  0.5 0.5 0.5  -0.5 0.5 0.5
1 3 -2 1 4 -3 5 6 -7 5 7 -8 1 2 -6 1 6 -5 2 3 -7 2 7 -6 3 4 -8 3 8 -7 4 1 -5 4 5 -8
"""
# A cube that slides and turns in a plane with a cube in its middle. A second cube may close the plane.
ROOM = """Boundary Box2D [-4:4; {low}:{high}]
Multibodies
2
Active
1
cube.g Planar Rotational
Connections
0
Passive
cube.g 0 0 0 0 0 0
"""


@pytest.fixture(scope="module")
def maze() -> env2mjcf.Scene:
    """The maze of the models, with its task."""
    return env2mjcf.load(MAZE)


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """A folder with a room that can be crossed, and one that cannot."""
    (tmp_path / "cube.g").write_text(CUBE)
    (tmp_path / "open.env").write_text(ROOM.format(low=-3, high=3))
    # Beside the cube there is room for 0.9 of a cube.
    (tmp_path / "shut.env").write_text(ROOM.format(low=-1.4, high=1.4))
    (tmp_path / "cross.query").write_text("-2 0 0\n2 0 0\n")
    (tmp_path / "in.query").write_text("-2 0 0\n0.3 0 0\n")
    return tmp_path


def space_of(scene: env2mjcf.Scene, robot: int | None = None) -> PlanningSpace:
    columns = np.arange(scene.space.dim)
    return PlanningSpace(
        scene, scene.space.home[None], columns if robot is None else columns[scene.space.robot_slices[robot]]
    )


def along(scene: env2mjcf.Scene, path: np.ndarray, step: float) -> np.ndarray:
    """Configurations on the path of a rigid body, none of whose points moves farther than a step between two."""
    radius = max(np.linalg.norm(p.mesh.vertices, axis=1).max() for p in scene.compiled.assembly.robots[0].links)
    rows = []
    for a, b in pairwise(path):
        delta = scene.space.difference(a, b)
        n = int(np.ceil(np.abs(delta).sum() * max(1.0, radius) / step)) + 2
        rows.append(a + np.linspace(0, 1, n)[:, None] * delta)
    return np.concatenate(rows)


def assert_free_by_triangles(scene: env2mjcf.Scene, path: np.ndarray, step: float) -> None:
    truth = Truth(scene)
    for row in along(scene, path, step):
        assert not truth.collides(row), row


def assert_leads(scene: env2mjcf.Scene, found: Plan, *points: np.ndarray) -> None:
    """A solution begins and ends where it should, and visits what is between in turn."""
    assert found.solved
    at = 0
    for point in points:
        same = np.flatnonzero(np.all(found.path[at:] == point, axis=1))
        assert len(same), point
        at += int(same[0])
    assert np.array_equal(found.path[0], points[0])
    assert np.array_equal(found.path[-1], points[-1])
    assert found.left == 0


# The space.


@pytest.mark.parametrize(
    ("scene", "robot", "kinds"),
    [
        ("maze/maze.xml", None, ["R2", "S1"]),
        ("bug-trap/bug-trap.env", None, ["R3", "S1", "S1", "S1"]),
        ("seed/seed.env", None, ["R3", *["S1"] * 6]),
        ("spherical-arm/spherical-arm.env", None, ["R1"] * 6),
        ("two-robots/two-robots.env", None, ["R2", "S1", "R1", "R1", "R1"]),
        ("two-robots/two-robots.env", 1, ["R1", "R1", "R1"]),
    ],
)
def test_bases_are_positions_and_circles_and_joints_are_intervals(scene: str, robot: int | None, kinds: list[str]):
    space = space_of(env2mjcf.load(MODELS / scene), robot)
    states, _ = state_space(space)
    assert [f"{'S' if p.turns else 'R'}{len(p.columns)}" for p in space.pieces] == kinds
    found = [type(states.getSubspace(i)).__name__ for i in range(states.getSubspaceCount())]
    assert found == [{"R": "RealVectorStateSpace", "S": "SO2StateSpace"}[k[0]] for k in kinds]


@pytest.mark.parametrize("name", ["maze/maze.xml", "seed/seed.env", "two-robots/two-robots.env", "gantry/gantry.env"])
def test_the_distance_is_ompl_s_and_bounds_how_far_any_point_moves(name: str):
    from ompl import base

    scene = env2mjcf.load(MODELS / name)
    space = space_of(scene)
    states, layout = state_space(space)
    information = base.SpaceInformation(states)
    rng = np.random.default_rng(3)
    vertices = [p.mesh.vertices for p in scene.compiled.assembly.parts() if p.name in scene.link_names]
    for a, b in pairwise(space.draw(30, rng)):
        first, second = information.allocState(), information.allocState()
        layout.write(first, a)
        layout.write(second, b)
        assert layout.read(first) == pytest.approx(a, abs=1e-12)
        assert states.distance(first, second) == pytest.approx(space.distance(a, b), rel=1e-9)
        # No way between two places is shorter than the straight line.
        here, there = scene.link_poses(np.array([a, b]))
        for p, q, corners in zip(here, there, vertices, strict=True):
            moved = np.linalg.norm(corners @ (p[:3, :3] - q[:3, :3]).T + p[:3, 3] - q[:3, 3], axis=1)
            assert moved.max() <= space.distance(a, b) * (1 + 1e-9)


def test_ompl_goes_the_way_that_the_scene_proves(maze: env2mjcf.Scene):
    from ompl import base

    space = space_of(maze)
    states, layout = state_space(space)
    information = base.SpaceInformation(states)
    first, second, between = (information.allocState() for _ in range(3))
    a, b = np.array([0.0, 0, 3.0]), np.array([1.0, 2, -3.0])
    layout.write(first, a)
    layout.write(second, b)
    for t in np.linspace(0, 1, 7):
        states.interpolate(first, second, float(t), between)
        there = maze.space.interpolate(a, b, 7)[round(6 * t)]
        assert maze.space.difference(layout.read(between), there) == pytest.approx(0, abs=1e-12)


def test_motions_are_looked_at_everywhere_and_every_look_counts(maze: env2mjcf.Scene):
    space = space_of(maze)
    rows = space.draw(400, np.random.default_rng(0))
    rows = rows[maze.is_valid(rows)]
    for a, b in pairwise(rows[:60]):
        validity = Validity(maze, space, 0.05)
        free = validity.motion(a, b)
        n = int(np.ceil(space.distance(a, b) / 0.05))
        assert free == bool(maze.is_valid(maze.space.interpolate(a, b, n + 1)).all())
        assert validity.checks == n if free else 0 < validity.checks <= n
        assert validity.motions == 1


def test_many_motions_are_judged_as_each_of_them_is(maze: env2mjcf.Scene):
    space = space_of(maze)
    rows = space.draw(600, np.random.default_rng(2))
    rows = rows[maze.is_valid(rows)][:200]
    starts, ends = rows, space.enforced(rows + np.random.default_rng(3).normal(scale=0.3, size=rows.shape))
    together, alone = (Validity(maze, space, 0.05) for _ in range(2))
    verdicts = together.free(starts, ends)
    assert verdicts.tolist() == [alone.motion(a, b) for a, b in zip(starts, ends, strict=True)]
    assert 20 < verdicts.sum() < 180
    assert together.motions == alone.motions == 200


@pytest.mark.slow
def test_the_bug_gets_out_of_its_bottle():
    scene = env2mjcf.load(MODELS / "bug-trap/bug-trap.env", query=MODELS / "bug-trap/bug-trap.query")
    start, goal = scene.queries[0].q
    found = plan(scene, start, goal, planner="BatchEST", time=60)
    assert_leads(scene, found, start, goal)
    assert_free_by_triangles(scene, found.path, 0.01)


def test_what_stays_does_not_move():
    scene = env2mjcf.load(MODELS / "two-robots/two-robots.env", query=MODELS / "two-robots/two-robots.query")
    query = scene.queries[1]
    found = plan(scene, query.q[0], query.q[-1], robot=query.robot, time=20)
    assert_leads(scene, found, query.q[0], query.q[-1])
    car = scene.space.robot_slices[0]
    assert np.array_equal(found.path[:, car], np.tile(scene.space.home[car], (len(found.path), 1)))


# Plans.


def test_the_maze_is_solved_and_triangles_agree(maze: env2mjcf.Scene):
    query = maze.queries[0]
    found = plan(maze, query.q[0], query.q[-1], time=60)
    assert_leads(maze, found, query.q[0], query.q[-1])
    assert found.planner in ("RRTConnect", "BatchEST")
    assert found.certified.all()
    assert maze.edge_is_free(found.path[:-1], found.path[1:]).all()
    assert found.length == pytest.approx(space_of(maze).path_length(found.path))
    assert found.checks > 1000
    assert_free_by_triangles(maze, found.path, 0.02)


@pytest.mark.slow_but("RRTConnect", "BatchEST", "KPIECE", "FMT")
@pytest.mark.parametrize("planner", sorted(set(PLANNERS) - {"auto"}))
def test_every_planner_finds_its_way_round_a_cube(planner: str, room: Path):
    scene = env2mjcf.load(room / "open.env", query=room / "cross.query")
    start, goal = scene.queries[0].q
    found = plan(scene, start, goal, planner=planner.lower(), time=1.5)
    assert found.planner == planner
    assert_leads(scene, found, start, goal)
    assert_free_by_triangles(scene, found.path, 0.05)


def test_equal_seeds_give_equal_paths(room: Path):
    scene = env2mjcf.load(room / "open.env", query=room / "cross.query")
    start, goal = scene.queries[0].q
    first, again, other = (plan(scene, start, goal, seed=s).path for s in (4, 4, 5))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_via_points_are_visited_in_turn(room: Path):
    scene = env2mjcf.load(room / "open.env")
    stops = np.array([[-2.0, 0, 0], [2, 0, 0], [0, 2, 1], [-2, 0, 0]])
    found = plan_through(scene, stops)
    assert_leads(scene, found, *stops)
    assert len(found.certified) == len(found.dense) == len(found.path) - 1
    assert_free_by_triangles(scene, found.path, 0.05)


def test_without_a_solution_the_best_approach_is_told(room: Path):
    scene = env2mjcf.load(room / "shut.env", query=room / "cross.query")
    start, goal = scene.queries[0].q
    for planner in ("RRTConnect", "BKPIECE", "PRM"):
        found = plan(scene, start, goal, planner=planner, time=0.5)
        assert not found.solved
        assert np.array_equal(found.path[0], start)
        # The cube in the middle stops it one cube away.
        assert -2 <= found.path[-1][0] <= -0.99
        assert found.left > 2.9
        assert_free_by_triangles(scene, found.path, 0.05)


@pytest.mark.parametrize("planner", ["RRTConnect", "PRM", "KPIECE", "BatchEST"])
def test_what_is_raised_while_planning_comes_out(planner: str, room: Path):
    scene = env2mjcf.load(room / "shut.env", query=room / "cross.query")
    start, goal = scene.queries[0].q

    def interrupt(progress: Progress) -> None:
        if progress.motions:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        plan(scene, start, goal, planner=planner, time=20, progress=interrupt)


def test_thin_walls_are_not_passed_over(tmp_path: Path):
    # The steps are longer than the wall and the robot together: most motions step over it.
    (tmp_path / "cube.g").write_text(CUBE)
    flat = "\n".join(CUBE.splitlines()[:2]) + "\n"
    flat += "-0.005 -3 -1  0.005 -3 -1  0.005 3 -1  -0.005 3 -1\n-0.005 -3 1  0.005 -3 1  0.005 3 1  -0.005 3 1\n"
    (tmp_path / "wall.g").write_text(flat + CUBE.splitlines()[-1] + "\n")
    text = ROOM.format(low=-6, high=6).replace("[-4:4", "[-6:6").replace("cube.g 0", "wall.g 0")
    (tmp_path / "wall.env").write_text(text)
    scene = env2mjcf.load(tmp_path / "wall.env")
    found = plan(scene, [-2, 0, 0], [2, 0, 0], resolution=3.0, time=30)
    assert found.solved
    assert_free_by_triangles(scene, found.path, 0.02)
    assert np.abs(found.path[:, 1]).max() > 3.4


def test_a_bar_turns_where_the_boundary_leaves_room(tmp_path: Path):
    """Steps are too long to see it leave a ball's edge on its way, and nothing is there that it could touch."""
    text = "Boundary Sphere2D [0 0; 2]\nMultibodies\n1\nActive\n1\nbar.g Planar Rotational\nConnections\n0\n"
    scene = env2mjcf.load(write_scene(tmp_path, text, bar=box_mesh(1, 0.1, 0.1)), engine="mujoco")
    start, goal = np.array([1.2, 0, 1.6]), np.array([1.2, 0, -1.5])
    found = plan(scene, start, goal, resolution=5.0, time=20)
    assert_leads(scene, found, start, goal)
    rows = np.concatenate([scene.space.interpolate(a, b, 400) for a, b in pairwise(found.path)])
    # Each corner's distance from the middle, by algebra.
    corners = np.array([[x, y] for x in (-1, 1) for y in (-0.1, 0.1)])
    c, s = np.cos(rows[:, 2, None]), np.sin(rows[:, 2, None])
    x = rows[:, :1] + c * corners[:, 0] - s * corners[:, 1]
    y = rows[:, 1:2] + s * corners[:, 0] + c * corners[:, 1]
    # Looks are 0.1 apart: no corner is farther than half of that from where it was seen. Straight on, it comes to 2.2.
    assert np.hypot(x, y).max() <= 2.05


@pytest.mark.slow_but("RRTConnect")
@pytest.mark.parametrize("planner", ["RRTConnect", "BatchEST"])
def test_a_goal_that_is_whole_turns_away_is_reached_in_its_own_numbers(planner: str, room: Path):
    scene = env2mjcf.load(room / "open.env", engine="mujoco")
    start, goal = np.array([-2, 0, -7.0]), np.array([2, 0, 20.0])
    found = plan(scene, start, goal, planner=planner, time=20, shorten=False)
    assert_leads(scene, found, start, goal)


def test_angles_of_circles_are_brought_within_half_a_turn(maze: env2mjcf.Scene):
    space, angles = space_of(maze), np.array([0.1, -0.1, 3.0, -3.0])
    for turns in (-2, 0, 1):
        rows = np.column_stack([np.zeros((4, 2)), angles + 2 * np.pi * turns])
        np.testing.assert_allclose(space.enforced(rows)[:, 2], angles, atol=1e-12)


def test_parts_of_the_time_end_when_they_should(monkeypatch: pytest.MonkeyPatch):
    now = [100.0]
    monkeypatch.setattr(result.time, "perf_counter", lambda: now[0])
    watch = Timekeeper(10.0, 1, None)
    part, longer = watch.stop_within(3.0), watch.stop_within(30.0)
    for seconds, expected in ((0.0, [False, False, False]), (2.9, [False, False, False]), (3.1, [False, True, False]),
                              (9.9, [False, True, False]), (10.1, [True, True, True])):  # fmt: skip
        now[0] = 100.0 + seconds
        assert [watch.stop(), part(), longer()] == expected
        assert watch.left == pytest.approx(10.0 - seconds)


def test_short_cuts_keep_ends_and_never_lengthen(maze: env2mjcf.Scene):
    space = space_of(maze)
    path = space.draw(12, np.random.default_rng(8))
    asked: list[tuple[np.ndarray, np.ndarray]] = []

    def good(a: np.ndarray, b: np.ndarray) -> bool:
        asked.append((a, b))
        return len(asked) % 3 == 0

    short = shortened(path, space, good, np.random.default_rng(1), 50, lambda: False)
    assert np.array_equal(short[[0, -1]], path[[0, -1]])
    assert space.path_length(short) < space.path_length(path)
    everywhere = shortened(path, space, lambda a, b: True, np.random.default_rng(1), 50, lambda: False)
    assert space.path_length(everywhere) == pytest.approx(space.distance(path[0], path[-1]))


# What cannot be planned.


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"planner": None}, "^planner is None; expected one of auto"),
        ({"seed": 1.5}, "^seed is 1.5; expected a whole number"),
        ({"robot": 0.0}, "^robot is 0.0; expected a whole number"),
        ({"time": "60"}, "^time is '60'; expected a number"),
        ({"resolution": "fine"}, "^resolution is 'fine'"),
    ],
)
def test_an_argument_of_a_wrong_kind_is_named(arguments: dict[str, Any], message: str, room: Path):
    with pytest.raises(TypeError, match=message):
        plan(env2mjcf.load(room / "open.env"), [-2, 0, 0], [2, 0, 0], **arguments)


def test_robots_that_do_not_move_are_judged_where_they_stay(tmp_path: Path):
    robot = "Active\n1\ncube.g Planar Translational\nConnections\n0\n"
    text = f"Boundary Box2D [-9:9; -9:9]\nMultibodies\n2\n{robot}{robot}"
    scene = env2mjcf.load(write_scene(tmp_path, text), engine="mujoco")
    # At the goal of both, they would touch; the second one stays away.
    found = plan(scene, [-3, 0, 0, 5], [3, 0, 3, 0], robot=0)
    assert found.solved
    assert found.path[-1].tolist() == [3, 0, 0, 5]
    # And where the second one stays in the way, it does not help that it is to be elsewhere.
    with pytest.raises(ValueError, match="the goal is not valid"):
        plan(scene, [-3, 0, 3, 0], [3, 0, 0, 5], robot=0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"goal": [0.3, 0, 0]}, r"the goal is not valid: cube and cube_2 \(obstacle\)"),
        ({"start": [-3.9, 0, 0]}, r"the start is not valid: cube reaches .* outside the boundary"),
        ({"planner": "RRTConect"}, r"did you mean 'RRTConnect'\? \(planners: auto, RRTConnect, .*BFMT, BatchEST\)"),
        ({"robot": 1}, "there is no robot 1; the scene has 1"),
        ({"time": 0}, "time is 0"),
        ({"seed": -1}, "seed is -1"),
        ({"resolution": 0.0}, "resolution is 0.0"),
    ],
)
def test_what_cannot_be_planned_is_said(arguments: dict[str, Any], message: str, room: Path):
    scene = env2mjcf.load(room / "open.env")
    given = {"start": [-2, 0, 0], "goal": [2, 0, 0], **arguments}
    with pytest.raises(ValueError, match=message):
        plan(scene, given.pop("start"), given.pop("goal"), **given)


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("RRTC", "RRTConnect"),
        ("rrt-connect", "RRTConnect"),
        ("RRT*", "RRTstar"),
        ("prm*", "PRMstar"),
        ("PRM_star", "PRMstar"),
        ("EST", "BatchEST"),
        ("connect", "RRTConnect"),
        ("BKP", "BKPIECE"),
        ("fmtt", "FMT"),
    ],
)
def test_short_forms_of_planners_are_known(name: str, meant: str):
    with pytest.raises(ValueError, match=re.escape(f"there is no planner {name!r}; did you mean {meant!r}?")):
        checked_planner(name)


# Groups.

SWAP = """<MotionPlanning><Problem><Environment filename="group.env"/>
{robots}<RobotGroup label="pair" robotLabels="a b"/>
<GroupTask label="swap" group="pair">
  <Task robot="b"><StartConstraints><CSpaceConstraint point="2 0"/></StartConstraints>
    <GoalConstraints><CSpaceConstraint point="-2 0"/></GoalConstraints></Task>
  <Task robot="a"><StartConstraints><CSpaceConstraint point="-2 0"/></StartConstraints>
    <GoalConstraints><CSpaceConstraint point="2 0"/></GoalConstraints></Task>
</GroupTask>
<Task label="aside" robot="c"><StartConstraints><CSpaceConstraint point="0 3"/></StartConstraints>
  <GoalConstraints><CSpaceConstraint point="3 3"/></GoalConstraints></Task>
</Problem></MotionPlanning>"""


@pytest.fixture
def swap(tmp_path: Path) -> Path:
    """Two cubes that change places, which neither can alone; a third has a task of its own."""
    (tmp_path / "cube.g").write_text(CUBE)
    (tmp_path / "cube.robot").write_text("1\ncube.g Planar Translational\nConnections\n0\n")
    (tmp_path / "group.env").write_text("Boundary Box2D [-5:5 ; -5:5]\nMultibodies\n1\nPassive\ncube.g 0 0 4 0 0 0\n")
    robots = "".join(f'<Robot label="{name}" filename="cube.robot"/>\n' for name in "abc")
    (tmp_path / "swap.xml").write_text(SWAP.format(robots=robots))
    return tmp_path / "swap.xml"


def assert_boxes_apart(path: np.ndarray) -> None:
    """Unit cubes that are not turned touch where they overlap along both axes; looked at much closer than they move."""
    dense = np.concatenate([np.linspace(a, b, 400) for a, b in pairwise(path)])
    for i, j in ((0, 1), (0, 2), (1, 2)):
        between = np.abs(dense[:, 2 * i : 2 * i + 2] - dense[:, 2 * j : 2 * j + 2])
        assert (between.max(axis=1) > 1).all()


def test_robots_of_a_query_are_planned_for_together(swap: Path):
    scene = env2mjcf.load(swap)
    query = scene.queries[0]
    assert query.robots == (1, 0)
    found = plan(scene, query.q[0], query.q[-1], robot=query.robots, time=20)
    assert_leads(scene, found, query.q[0], query.q[-1])
    assert found.path[0].tolist() == [-2, 0, 2, 0, 0, 3]
    assert found.path[-1].tolist() == [2, 0, -2, 0, 0, 3]
    assert (found.path[:, 4:] == [0, 3]).all()
    assert_boxes_apart(found.path)
    # The other one stays in the way of one that goes alone.
    with pytest.raises(ValueError, match="the goal is not valid"):
        plan(scene, query.q[0], query.q[-1], robot=0)
    for wrong in ((), (0, 3), (-1,)):
        with pytest.raises(ValueError, match=r"there is no robot|robot is -1"):
            plan(scene, query.q[0], query.q[-1], robot=wrong)


@pytest.mark.parametrize("task", [1, 2])
def test_a_path_of_several_robots_is_checked_as_it_was_planned(
    swap: Path, task: int, capsys: pytest.CaptureFixture[str]
):
    out = swap.with_name("swap.path")
    assert main(["plan", str(swap), "--task", str(task), "-o", str(out), "--time", "20"]) == 0
    scene = env2mjcf.load(swap)
    read = env2mjcf.read_path(scene, out)
    query = scene.queries[task - 1]
    assert set(read.robots.tolist()) == {-1}
    assert np.array_equal(read.q[0], query.q[0])
    assert np.array_equal(read.q[-1], query.q[-1])
    assert_boxes_apart(read.q)
    capsys.readouterr()
    assert main(["check", str(swap), str(out)]) == 0
    assert "invalid" not in capsys.readouterr().out


# The verb.


def test_the_help_and_the_documentation_name_every_planner():
    from env2mjcf.cli.plan import Plan as Verb

    page = (MODELS.parent / "docs" / "planning.md").read_text(encoding="utf-8")
    for name in PLANNERS:
        assert re.search(rf"\b{name}\b", Verb.__doc__ or "")
        assert f"`{name}`" in page


def rows_of(path: Path) -> np.ndarray:
    """The configurations of a path file, read as its format says; of three numbers, behind the robot's index if any."""
    header, links, count, *rows = path.read_text().splitlines()
    assert re.fullmatch(r"VIZMO_PATH_FILE   Path Version \d+", header)
    assert (links, int(count)) == ("1", len(rows))
    return np.array([[float(x) for x in row.split()[-3:]] for row in rows])


def test_a_path_is_written_and_leads_from_start_to_goal(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "maze.path"
    assert main(["plan", str(MAZE), "-o", str(out), "--planner", "BFMT"]) == 0
    shown = capsys.readouterr().out
    assert re.search(r"solved by BFMT in [\d.]+ s", shown)
    assert re.search(r"checks: [\d,]+ configurations, [\d,]+ a second", shown)
    edges = re.search(r"certified edges: (\d+) of (\d+)", shown)
    assert edges is not None
    assert edges[1] == edges[2]
    assert f"written: {out}" in shown
    numbers = rows_of(out)
    assert numbers[0].tolist() == [0, 0, 0]
    assert numbers[-1] == pytest.approx([4.2, -3, 0.5])
    scene = env2mjcf.load(MAZE)
    q = scene.space.decode(numbers)
    assert scene.check_path(q).valid
    # The file's PositionRes is 0.05.
    assert np.linalg.norm(np.diff(q[:, :2], axis=0), axis=1).max() <= 0.05 + 1e-9


def test_the_path_that_json_tells_is_that_of_the_file(tmp_path: Path, room: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "room.path"
    words = [
        "plan",
        str(room / "open.env"),
        "--query",
        str(room / "cross.query"),
        "-o",
        str(out),
        "--corners",
        "--json",
    ]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["solved"] is True
    assert told["file"] == str(out)
    assert rows_of(out) * [1, 1, np.pi] == pytest.approx(np.array(told["path"]), abs=1e-12)
    assert told["checks"] > 0
    assert all(told["certified"])
    assert [d["code"] for d in told["diagnostics"]] == ["KIN312"]


def test_without_a_solution_the_status_is_1_and_the_approach_is_written(room: Path, capsys: pytest.CaptureFixture[str]):
    words = ["plan", str(room / "shut.env"), "--query", str(room / "cross.query"), "--time", "0.5"]
    assert main([*words, "-o", str(room / "shut.path")]) == 1
    shown = capsys.readouterr().out
    assert "not solved by RRTConnect and BatchEST" in shown
    assert "left to the goal: " in shown
    assert not (room / "shut.path").exists()
    assert rows_of(room / "shut.approach.path")[0].tolist() == [-2, 0, 0]


def test_a_goal_in_collision_is_a_finding_that_names_who_touches(room: Path, capsys: pytest.CaptureFixture[str]):
    words = ["plan", str(room / "open.env"), "--query", str(room / "in.query"), "-o", str(room / "a.path")]
    assert main(words) == 1
    shown = capsys.readouterr().out
    assert re.search(r"goal: not valid\n +cube and cube_2 \(obstacle\)", shown)
    assert not list(room.glob("*.path"))
    assert main([*words, "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert list(told["invalid"]) == ["goal"]
    assert [d["code"] for d in told["diagnostics"]] == ["KIN312"]


def test_wrong_words_are_told_before_anything_is_planned(room: Path, capsys: pytest.CaptureFixture[str]):
    scene, query = str(room / "open.env"), str(room / "cross.query")
    assert main(["plan", scene, "--query", query, "--planner", "dijkstra"]) == 2
    assert "planners: auto, RRTConnect" in capsys.readouterr().err
    assert main(["plan", scene, "--query", query, "--task", "2"]) == 2
    assert "--task is 2: there is 1 task, counted from 1" in capsys.readouterr().err
    assert main(["plan", scene]) == 3
    assert "CFG540" in capsys.readouterr().err
    assert main(["plan", scene, "--query", query, "-o", str(room / "no" / "a.path")]) == 3
    assert "CFG542" in capsys.readouterr().err


@pytest.mark.slow
def test_other_verbs_do_without_ompl_and_a_run_ends_in_silence(room: Path):
    code = "import sys, env2mjcf.cli.plan, env2mjcf.cli.check; from env2mjcf import planning; planning.plan; "
    code += "sys.exit('ompl' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
    words = [sys.executable, "-m", "env2mjcf", "plan", str(room / "open.env"), "--query", str(room / "cross.query")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
@pytest.mark.parametrize("planner", ["RRTConnect", "PRM"])
def test_the_collector_may_run_at_any_time(planner: str, room: Path):
    """Freed memory is filled, so that code that looks at it crashes."""
    code = (
        "import gc, env2mjcf\nfrom env2mjcf.planning import plan\n"
        f"scene = env2mjcf.load({str(room / 'open.env')!r}, query={str(room / 'cross.query')!r}, engine='mujoco')\n"
        "query = scene.queries[0]\n"
        "for _ in range(2):\n"
        f"    assert plan(scene, query.q[0], query.q[-1], planner={planner!r}, time=60).solved\n"
        "    gc.collect()\n"
    )
    checked = {**os.environ, "PYTHONMALLOC": "debug"}
    done = subprocess.run([sys.executable, "-c", code], env=checked, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


# Real scenes.


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["SimpleObstacle.Obstacle1.obstacle", "ZTunnel.tunnel", "LTunnel.tunnel", "alpha1.6.alpha"]
)
def test_benchmarks_are_solved_and_triangles_agree(name: str):
    if name not in scene_names():
        pytest.skip("ENV2MJCF_CORPUS names no folder with this scene")
    row = real_scene(name)
    scene = env2mjcf.load(row.env, query=row.query, **row.keywords)
    query = scene.queries[0]
    found = plan(scene, query.q[0], query.q[-1], robot=query.robot, time=120)
    assert_leads(scene, found, query.q[0], query.q[-1])
    assert_free_by_triangles(scene, found.path, 0.01 * scene.extent)


def test_long_motions_leave_nothing_in_memory() -> None:
    kept = validity._remembered.cache_info().currsize
    for steps in range(5000, 5100):
        assert sorted(validity._bisecting(steps)[:, 0] * steps) == pytest.approx(range(1, steps + 1))
    assert validity._remembered.cache_info().currsize == kept
    assert validity._remembered.cache_info().maxsize * 8 * validity._SHORT < 4e6
