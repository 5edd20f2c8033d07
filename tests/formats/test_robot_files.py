"""Dialect E robot files as text (docs/format/env.md)."""

from __future__ import annotations

from math import pi

import pytest
from texts import ROBOT, B, D, E, Reader, codes, fault, place, write

import env2mjcf
from env2mjcf.kinematics.forward import RobotKinematics
from env2mjcf.kinematics.tree import DofKind
from env2mjcf.model.environment import BaseKind, DHForm, Dialect, JointType


def test_the_sample_reads_without_warnings(read_robot: Reader) -> None:
    scene = read_robot(ROBOT)
    (robot,) = scene.robots
    assert (robot.dialect, robot.dh_form) == (Dialect.E, DHForm.STANDARD)
    assert [b.base for b in robot.bodies] == [BaseKind.PLANAR_TRANSLATIONAL, BaseKind.JOINT, BaseKind.JOINT]
    assert robot.adjacencies == ((0, 2),)
    assert robot.bodies[0].color == (0, 1, 0, 1)
    assert robot.robot_file is not None
    assert robot.robot_file.endswith("rob.robot")
    assert not codes(scene)


def test_robots_come_behind_the_multibodies_of_the_environment(read_robot: Reader) -> None:
    scene = read_robot(ROBOT)
    assert [m.kind for m in scene.multibodies] == ["Passive", "Internal", "Active"]


def test_connections_are_as_in_dialect_d(read_robot: Reader) -> None:
    hinge, ball = read_robot(ROBOT).robots[0].connections
    assert (hinge.previous, hinge.next, hinge.joint) == (1, 2, JointType.REVOLUTE)
    assert (hinge.to_dh.position, hinge.to_body.position) == ((1, 2, 3), (4, 5, 6))
    assert (hinge.dh.alpha, hinge.dh.a, hinge.dh.d, hinge.dh.theta) == (0.1, 0.2, 0.3, 0.4)
    assert [(x.lower, x.upper) for x in ball.limits] == [(-pi / 2, pi / 4), (0, pi)]


def test_joint_values_are_sorted_by_parent_and_child(read_robot: Reader) -> None:
    dofs = RobotKinematics.of(read_robot(ROBOT).robots[0]).dofs
    assert [(d.kind, d.connection) for d in dofs] == [
        (DofKind.X, None),
        (DofKind.Y, None),
        (DofKind.THETA, 1),
        (DofKind.ALPHA, 1),
        (DofKind.THETA, 0),
    ]


def test_comments_and_blank_lines_are_free(read_robot: Reader) -> None:
    text = "# robot\n" + ROBOT.replace("Connections", "\n# joints\nConnections").replace("1 2 Rev", "1 # up\n2 Rev")
    assert read_robot(text) == read_robot(ROBOT)


def test_a_leading_tag_is_a_warning(read_robot: Reader) -> None:
    scene = read_robot("Active\n" + ROBOT)
    assert codes(scene) == ["ENV211"]
    assert scene.robots == read_robot(ROBOT).robots


def test_text_behind_the_last_connection_is_a_warning(read_robot: Reader) -> None:
    assert codes(read_robot(ROBOT + "the end\n")) == ["ENV209"]


@pytest.mark.parametrize("text", [B, D, E])
def test_an_environment_is_no_robot_file(read_robot: Reader, text: str) -> None:
    found = fault(read_robot, text)
    assert found.code == "ENV133"
    assert "is an environment, not a robot file" in found.message
    assert found.span is not None


@pytest.mark.parametrize(
    ("old", "new", "code", "message"),
    [
        ("3\nbase", "three\nbase", "ENV112", "expected an integer (the number of bodies), found 'three'"),
        ("3\nbase", "1000000000\nbase", "ENV110", "the number of bodies is 1000000000"),
        ("1 2 Revolute", "2 2 Revolute", "ENV116", "a connection from body 2 to itself"),
        ("1 2 Revolute", "1 3 Revolute", "ENV115", "body index 3 is out of range"),
        ("Connections", "Joints", "ENV120", "unknown tag 'Joints'"),
        ("-0.5:0.25 0:1", "-0.5:0.25", "ENV112", "expected ':' between the two ends of a joint's limits"),
    ],
)
def test_bad_input_is_refused_where_it_stands(read_robot: Reader, old: str, new: str, code: str, message: str) -> None:
    text = ROBOT.replace(old, new, 1)
    found = fault(read_robot, text)
    assert found.code == code
    assert message in found.message
    assert found.span is not None
    assert found.span.path.endswith("rob.robot")
    assert abs(found.span.line - place(text, new.splitlines()[0])[0]) <= 1


def test_an_empty_robot_file_is_refused(read_robot: Reader) -> None:
    found = fault(read_robot, "")
    assert (found.code, found.message) == (
        "ENV111",
        "the file ends where an integer (the number of bodies) was expected",
    )


def test_several_robots_keep_their_order(tmp_path: object, read_robot: Reader) -> None:
    scene = read_robot(ROBOT)
    folder = scene.directory
    other = write(folder, "1\nother.g Volumetric Translational\nConnections\n0\n", "other.robot")
    both = env2mjcf.read(scene.path, robots=[other, folder / "rob.robot"])
    assert [r.bodies[0].filename for r in both.robots] == ["other.g", "base.g"]
