"""Robots that move together: what queries, keyframes and verdicts say, against the text, algebra and python-fcl."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from scenes import box_mesh
from scipy.spatial.transform import Rotation

import env2mjcf
from env2mjcf import Query

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

BASES = {"Volumetric Rotational": 6, "Planar Rotational": 3, "Planar Translational": 2}


def numbers(task: ElementTree.Element) -> list[np.ndarray]:
    return [np.array(c.get("point", "").split(), dtype=float) for c in task.iter("CSpaceConstraint")]


class Text:
    """A problem file of `robots_in_groups`, read by other means."""

    def __init__(self, path: Path) -> None:
        problem = ElementTree.parse(path).getroot().find("Problem")
        assert problem is not None
        self.robots = [(path.parent / r.get("filename", "")).read_text() for r in problem.findall("Robot")]
        self.bases = [next(b for b in BASES if b in text) for text in self.robots]
        self.widths = [BASES[b] + ("Revolute" in text) for b, text in zip(self.bases, self.robots, strict=True)]
        self.tasks: list[dict[int, list[np.ndarray]]] = []
        for node in problem:
            if node.tag in ("Task", "GroupTask"):
                inner = node.findall("Task") or [node]
                self.tasks.append({int(t.get("robot", "")[1:]): numbers(t) for t in inner})

    def rows(self, task: int) -> list[list[np.ndarray]]:
        """Configurations of a task, robot by robot, in the file's numbers."""
        rest = [np.zeros(w) for w in self.widths]
        for own in reversed(self.tasks):
            for robot, points in own.items():
                rest[robot] = points[0]
        moving = self.tasks[task]
        count = max(map(len, moving.values()))
        return [
            [moving[i][min(k, len(moving[i]) - 1)] if i in moving else rest[i] for i in range(len(rest))]
            for k in range(count)
        ]

    def poses(self, row: list[np.ndarray]) -> np.ndarray:
        """World poses of all links, by algebra."""
        found = []
        for text, base, values in zip(self.robots, self.bases, row, strict=True):
            pose = np.eye(4)
            if base.startswith("Volumetric"):
                pose[:3, 3] = values[:3]
                pose[:3, :3] = Rotation.from_euler("xyz", values[3:6] * np.pi).as_matrix()
            else:
                pose[:2, 3] = values[:2]
                if base == "Planar Rotational":
                    pose[:3, :3] = Rotation.from_euler("z", values[2] * np.pi).as_matrix()
            found.append(pose)
            if "Revolute" in text:
                half, turn = np.eye(4), np.eye(4)
                half[0, 3] = float(text.splitlines()[-1].split()[0])
                turn[:3, :3] = Rotation.from_euler("z", values[-1] * np.pi).as_matrix()
                found.append(pose @ half @ turn @ half)
        return np.array(found)


@pytest.mark.slow_but("00", "01")
@pytest.mark.parametrize("number", range(40), ids=lambda n: f"{n:02}")
def test_random_groups_start_together(number: int, tmp_path: Path) -> None:
    generated, triangles = (pytest.importorskip(name) for name in ("generated", "triangles"))
    path = generated.robots_in_groups(tmp_path, number).path
    text, scene = Text(path), env2mjcf.load(path, cache=False)
    truth = triangles.Truth(scene)
    assert [q.robots for q in scene.queries] == [tuple(t) for t in text.tasks]
    for task, query in enumerate(scene.queries):
        rows = text.rows(task)
        assert np.array_equal(query.q, [scene.space.decode(np.concatenate(row)) for row in rows])
        poses = np.array([text.poses(row) for row in rows])
        np.testing.assert_allclose(scene.link_poses(query.q), poses, atol=1e-12)
        # The truth is told of the poses of the text.
        fixed = np.broadcast_to(scene.obstacle_poses(), (len(rows), len(scene.obstacle_names), 4, 4))
        with pytest.MonkeyPatch.context() as patch:
            both = np.concatenate([poses, fixed], axis=1)
            patch.setattr(truth, "poses", lambda _, both=both: both)
            _, touching = truth.verdicts(query.q)
        for engine in ("mujoco", "exact"):
            assert scene.in_collision(query.q, engine=engine).tolist() == touching.tolist()
    qpos = {name: scene.model.key(name).qpos for name in ("start", "goal")}
    assert np.array_equal(qpos["start"], scene.space.qpos(scene.queries[0].q[0]))
    assert np.array_equal(qpos["goal"], scene.space.qpos(scene.queries[0].q[-1]))


TWO = """<MotionPlanning><Problem>
<Environment filename="room.env"/>
<Robot label="a" filename="cube.robot"/><Robot label="b" filename="cube.robot"/><Robot label="c" filename="cube.robot"/>
<RobotGroup label="pair" robotLabels="a b"/>
<GroupTask label="swap" group="pair">
  <Task robot="a"><StartConstraints><CSpaceConstraint point="-2 0"/></StartConstraints>
    <GoalConstraints><CSpaceConstraint point="2 0"/></GoalConstraints></Task>
  <Task robot="b"><StartConstraints><CSpaceConstraint point="2 0"/></StartConstraints>
    <GoalConstraints><CSpaceConstraint point="2 2"/><CSpaceConstraint point="-2 0"/></GoalConstraints></Task>
</GroupTask>
<Task label="aside" robot="c"><StartConstraints><CSpaceConstraint point="0 3"/></StartConstraints>
  <GoalConstraints><CSpaceConstraint point="3 3"/></GoalConstraints></Task>
</Problem></MotionPlanning>"""


@pytest.fixture
def swap(tmp_path: Path) -> Path:
    """Two cubes that change places together, and a third with a task of its own; homes are one on the other."""
    (tmp_path / "cube.g").write_text(box_mesh(0.5, 0.5, 0.5))
    (tmp_path / "cube.robot").write_text("1\ncube.g Planar Translational\nConnections\n0\n")
    (tmp_path / "room.env").write_text("Boundary Box2D [-5:5 ; -5:5]\nMultibodies\n1\nPassive\ncube.g 0 0 4 0 0 0\n")
    (tmp_path / "swap.xml").write_text(TWO)
    return tmp_path / "swap.xml"


def test_robots_of_a_group_move_together_and_others_stand_at_their_starts(swap: Path) -> None:
    scene = env2mjcf.load(swap)
    together, alone = scene.queries
    assert (together.robot, together.robots, together.label) == (0, (0, 1), "swap")
    assert together.q.tolist() == [[-2, 0, 2, 0, 0, 3], [2, 0, 2, 2, 0, 3], [2, 0, -2, 0, 0, 3]]
    assert (alone.robot, alone.robots) == (2, (2,))
    assert alone.q.tolist() == [[-2, 0, 2, 0, 0, 3], [-2, 0, 2, 0, 3, 3]]
    assert scene.is_valid(together.q).all()
    assert scene.is_valid(alone.q).all()
    # At home all three lie on each other.
    assert scene.in_collision(scene.space.home)
    data = mujoco.MjData(scene.model)
    mujoco.mj_resetDataKeyframe(scene.model, data, scene.model.key("start").id)
    mujoco.mj_forward(scene.model, data)
    assert not data.ncon


def test_a_query_says_who_moves() -> None:
    assert Query(1, np.zeros((2, 3))).robots == (1,)
    assert Query(1, np.zeros((2, 3)), robots=(1, 0)).robots == (1, 0)
    with pytest.raises(ValueError, match=re.escape("robots=(0, 1) do not begin with robot=1")):
        Query(1, np.zeros((2, 3)), robots=(0, 1))


def test_a_robot_stands_at_the_start_of_its_first_task(swap: Path) -> None:
    later = """<Task robot="a"><StartConstraints><CSpaceConstraint point="-3 -3"/></StartConstraints></Task>
    <Task label="on" robot="c"><GoalConstraints><CSpaceConstraint point="4 4"/></GoalConstraints></Task>"""
    swap.write_text(TWO.replace("</Problem>", f"{later}</Problem>"))
    scene = env2mjcf.load(swap)
    assert scene.queries[1].q[0].tolist() == [-2, 0, 2, 0, 0, 3]
    assert scene.queries[2].q.tolist() == [[-3, -3, 2, 0, 0, 3]]
    # Without a start it goes on where it was.
    assert scene.queries[3].q.tolist() == [[-2, 0, 2, 0, 3, 3], [-2, 0, 2, 0, 4, 4]]
