"""Forward kinematics against golden vectors, recorded files of the original planner, and algebra."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import env2mjcf
from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.formats.path import read_path
from env2mjcf.formats.source import read_source
from env2mjcf.kinematics.forward import RobotKinematics
from env2mjcf.limits import Limits
from env2mjcf.transforms import rotation_matrix

SEED_ROBOT = """1
MultiBody Active
4
FreeBody 0 link2.g 0 0 0 0 0 0
FreeBody 1 link2.g
FreeBody 2 link3.g
FreeBody 3 link3.g
Connection
3
0 1 Actuated
0.2 0 0 -90 0 0  90 0.2 0 30  Revolute  0 0 0 0 0 0
1 2 Actuated
0.2 0 0 -90 0 0  90 0.2 0 30  Revolute  0 0 0 0 0 0
2 3 Actuated
0.2 0 0 -90 0 0  90 0.2 0 30  Revolute  0 0 0 0 0 0
"""


def robot_of(tmp_path: Path, text: str, **options: object) -> RobotKinematics:
    path = tmp_path / "scene.env"
    path.write_text(text)
    return RobotKinematics.of(env2mjcf.read(path, **options).robots[0])


def test_the_seed_robot_stands_where_the_specification_says(tmp_path: Path) -> None:
    # Dialect A, angles in turns; these numbers were made without this package.
    robot = robot_of(tmp_path, SEED_ROBOT)
    units = np.array([1, 1, 1] + [2 * math.pi] * 6)
    poses = robot.forward(np.array([2, 2, 1.5, 0, 0, 0, 0.4, 0.7, 0.3]) * units)
    expected = [[2, 2, 1.5], [2.038197, 2, 1.617557], [2.038197, 2, 1.852671], [2.038197, 2, 2.087785]]
    np.testing.assert_allclose(poses[:, :3, 3], expected, atol=5e-7)
    turned = [[-0.809017, 0, -0.587785], [0, 1, 0], [0.587785, 0, -0.809017]]
    np.testing.assert_allclose(poses[1, :3, :3], turned, atol=5e-7)
    poses = robot.forward(np.array([1, 2, 3, 0.1, 0.2, 0.3, 0.25, 0, 0.5]) * units)
    expected = [
        [1, 2, 3],
        [1.045152, 2.241458, 2.859789],
        [1.173653, 2.606818, 2.959789],
        [1.173653, 2.606818, 2.959789],
    ]
    np.testing.assert_allclose(poses[:, :3, 3], expected, atol=5e-7)


def test_a_later_dialect_counts_angles_in_fractions_of_pi(tmp_path: Path) -> None:
    # The same robot in the words of dialects C and D.
    text = """Boundary Box [-9:9 ; -9:9 ; -9:9]
MultiBodies
1
Active
4
link2.g Volumetric Rotational
link2.g Joint
link3.g Joint
link3.g Joint
Connections
3
0 1 Revolute -1:1
0.2 0 0 0 0 0  0 0 0 0  0.2 0 0 0 0 0
1 2 Revolute -1:1
0.2 0 0 0 0 0  0 0 0 0  0.2 0 0 0 0 0
2 3 Revolute -1:1
0.2 0 0 0 0 0  0 0 0 0  0.2 0 0 0 0 0
"""
    robot = robot_of(tmp_path, text)
    poses = robot.forward(np.array([0, 0, 0, 0, 0, 0, 0.4, 0.7, 0.3]) * ([1] * 3 + [math.pi] * 6))
    heading = np.cumsum([0, 0.4, 0.7, 0.3]) * math.pi
    tips = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    expected = np.vstack([[0, 0], np.cumsum(0.2 * (tips[:-1] + tips[1:]), axis=0)])
    np.testing.assert_allclose(poses[:, :2, 3], expected, atol=1e-14)
    np.testing.assert_allclose(poses[:, 2, 3], 0, atol=1e-14)


def test_the_page_reading_turns_the_other_way(tmp_path: Path) -> None:
    """The page's labels put the same pivot on the mirrored axis."""
    planner, page = robot_of(tmp_path, SEED_ROBOT), robot_of(tmp_path, SEED_ROBOT, semantics="page")
    q = np.zeros(9)
    q[6] = 0.3
    mirrored = q.copy()
    mirrored[6] = -0.3
    np.testing.assert_allclose(planner.forward(q)[:2, :3, 3], page.forward(mirrored)[:2, :3, 3], atol=1e-12)
    assert np.abs(planner.forward(q)[1] - page.forward(q)[1]).max() > 0.05


def test_link_poses_that_the_planner_recorded_are_met(corpus: Path) -> None:
    """2loop: 300 configurations of 12 links in two closed loops, printed with six digits."""
    folder = corpus / "scenes" / "old-2loop.2loop_13con"
    robot = RobotKinematics.of(env2mjcf.read(folder / "2loop_13con.env").robots[0])
    assert robot.dim == 19
    cfg = np.loadtxt(folder / "prm.path.cfg")
    recorded = read_path(read_source(folder / "prm.path", DiagnosticLog(), Limits()), [19], [12], DiagnosticLog()).poses
    assert recorded is not None
    assert recorded.shape == (300, 12, 6)
    poses = robot.forward(cfg * ([1] * 3 + [2 * math.pi] * 16))
    assert np.abs(poses[..., :3, 3] - recorded[..., :3]).max() < 6e-5
    angles = 2 * math.pi * recorded[..., 3:]
    rotations = rotation_matrix(angles[..., 0], angles[..., 1], angles[..., 2])
    assert np.abs(poses[..., :3, :3] - rotations).max() < 6e-5


def test_the_recorded_loops_are_closed(corpus: Path) -> None:
    folder = corpus / "scenes" / "old-2loop.2loop_13con"
    robot = RobotKinematics.of(env2mjcf.read(folder / "2loop_13con.env").robots[0])
    q = np.loadtxt(folder / "prm.path.cfg") * ([1] * 3 + [2 * math.pi] * 16)
    gaps = robot.loop_gaps(q, [0.1] * 12)
    assert gaps.shape == (300, 2)
    assert gaps.max() < 1e-4
    opened = q.copy()
    opened[:, 8] += 0.5
    assert robot.loop_gaps(opened, [0.1] * 12).max(axis=1).min() > 1e-2


def test_branchs_at_zero_is_the_scene_that_its_authors_placed_by_hand(corpus: Path) -> None:
    folder = corpus / "scenes" / "old-testBranchs.branchs"
    robot = RobotKinematics.of(env2mjcf.read(folder / "branchs.env").robots[0])
    placed = env2mjcf.read(corpus / "scenes" / "old-testBranchs.vizmo.branchs" / "vizmo.branchs.env")
    q = np.zeros(robot.dim)
    q[2] = 30
    expected = [m.bodies[0].pose.position for m in placed.robots if m.bodies[0].pose]
    assert len(expected) == 6
    np.testing.assert_allclose(robot.forward(q)[:, :3, 3], expected, atol=1e-12)


def test_home_reduces_whole_turns_and_clips_with_a_diagnostic(tmp_path: Path) -> None:
    text = """Boundary Box [-9:9 ; -9:9 ; -9:9]
MultiBodies
1
Active
3
a.g Fixed 0 0 0 0 0 0
b.g Joint
c.g Joint
Connections
2
0 1 Revolute -1:1
1 0 0 0 0 0  0 0 0 7.0  0 0 0 0 0 0
1 2 Revolute -0.25:0.25
1 0 0 0 0 0  0 0 0 2.0  0 0 0 0 0 0
"""
    robot, log = robot_of(tmp_path, text), DiagnosticLog()
    home = robot.home(log)
    np.testing.assert_allclose(home, [7.0 - 2 * math.pi, math.pi / 4], atol=1e-15)
    assert [d.code for d in log] == ["KIN310"]
    assert next(iter(log)).span is not None
    assert next(iter(log)).span.line == 14


def test_a_prismatic_value_replaces_d(tmp_path: Path) -> None:
    text = SEED_ROBOT.replace("90 0.2 0 30  Revolute", "90 0.2 5 30  Prismatic", 1)
    robot = robot_of(tmp_path, text)
    assert [d.kind for d in robot.dofs[6:]] == ["d", "theta", "theta"]
    q = np.zeros(9)
    near, far = robot.forward(q), robot.forward(q + np.eye(9)[6])
    # The DH z axis is the base's -y (docs/format/readings.md); a metre of d is a metre of travel.
    np.testing.assert_allclose(far[1:, :3, 3] - near[1:, :3, 3], [[0, -1, 0]] * 3, atol=1e-12)
    assert robot.home()[6] == 5.0


@pytest.mark.parametrize("dof", range(9))
def test_no_point_moves_further_than_its_lever_says(tmp_path: Path, dof: int) -> None:
    robot = robot_of(tmp_path, SEED_ROBOT)
    radii = [0.25] * 4
    rng = np.random.default_rng(dof)
    points = rng.normal(size=(64, 3))
    points *= 0.25 / np.linalg.norm(points, axis=1, keepdims=True)
    levers = robot.levers(radii, [0.0] * 9)
    q0 = rng.uniform(-3, 3, size=(50, 9))
    q1 = q0.copy()
    q1[:, dof] += 1e-4
    before, after = robot.forward(q0), robot.forward(q1)
    moved = np.einsum("nbij,pj->nbpi", after[..., :3, :3] - before[..., :3, :3], points)
    moved += (after[..., :3, 3] - before[..., :3, 3])[:, :, None]
    farthest = np.linalg.norm(moved, axis=-1).max(axis=(0, 2))
    assert (farthest <= levers[dof] * 1e-4 * (1 + 1e-6) + 1e-15).all()
    assert farthest.max() > 0.1 * levers[dof].max() * 1e-4


TRIANGLE = """Boundary Box [-9:9 ; -9:9 ; -9:9]
Multibodies
1
Active
3
cube.g Fixed 0 0 0 0 0 0
cube.g Joint
cube.g Joint
Connections
3
0 1 Revolute -1:1
1 0 0 0 0 0  0 0 0 0  0 0 0 0 0 0
0 2 NonActuated
-1 0 0 0 0 0  0 0 0 0  0 0 0 0 0 0
1 2 NonActuated
-2 0 0 0 0 0  0 0 0 0  0 0 0 0 0 0
"""


@pytest.mark.parametrize("angle", [0.0, 1e-3, 0.7, math.pi])
def test_a_loop_is_open_by_what_its_end_is_away_and_turned(tmp_path: Path, angle: float) -> None:
    """The loop's last body lies two units from a hinge: its place there moves by a chord, and it turns by as much."""
    robot = robot_of(tmp_path, TRIANGLE)
    assert robot.loop_gaps(np.array([angle]), [0, 0, 0.3]) == pytest.approx(2 * (2 + 0.3) * math.sin(angle / 2))
