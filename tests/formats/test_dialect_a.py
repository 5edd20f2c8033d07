"""Dialect A, the planner of 1998 to 2012: every angle in degrees, `to_body` before `to_dh`."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import pytest
from scenes import write_scene
from texts import LEGACY, LEGACY_FIXED, Reader, codes, fault, place, warnings

import env2mjcf
from env2mjcf.kinematics.forward import RobotKinematics
from env2mjcf.limits import Limits
from env2mjcf.model.environment import BaseKind, DHForm, Dialect, JointType, MultiBodyKind, Recentring

DEGREE = pi / 180


def test_the_whole_sample_reads_without_warnings(read: Reader) -> None:
    scene = read(LEGACY)
    assert scene.dialect is Dialect.A
    assert (len(scene.robots), len(scene.obstacles), scene.declared_multibodies) == (1, 1, 2)
    assert scene.boundary is None
    assert not codes(scene)


def test_the_first_six_numbers_lead_to_the_body_and_the_last_six_to_the_dh_frame(read: Reader) -> None:
    first, second = read(LEGACY).robots[0].connections
    assert first.to_body.position == (0.2, 0, 0)
    assert first.to_body.rotation == pytest.approx((-90 * DEGREE, 0, 0))
    assert first.to_dh.position == (0.5, 0, 0)
    assert first.to_dh.rotation == pytest.approx((0, 0, 45 * DEGREE))
    assert (second.to_body.position[0], second.to_dh.position[0]) == (0.6, 0.9)


def test_the_page_reads_the_two_transforms_the_other_way_round(read: Reader) -> None:
    planner, page = read(LEGACY).robots[0], read(LEGACY, semantics="page").robots[0]
    assert [c.to_dh for c in page.connections] == [c.to_body for c in planner.connections]
    assert [c.to_body for c in page.connections] == [c.to_dh for c in planner.connections]
    assert (planner.dh_form, page.dh_form) == (DHForm.CRAIG, DHForm.STANDARD)


def test_dh_rows_are_alpha_a_d_theta_in_degrees(read: Reader) -> None:
    dh = read(LEGACY).robots[0].connections[0].dh
    assert (dh.alpha, dh.a, dh.d, dh.theta) == pytest.approx((pi / 2, 0.3, 0.4, pi / 6))


def test_poses_are_in_degrees_with_x_first(read: Reader) -> None:
    pose = read(LEGACY).robots[0].bodies[0].pose
    assert pose is not None
    assert pose.position == (1, 2, 3)
    assert pose.rotation == pytest.approx((10 * DEGREE, 20 * DEGREE, 30 * DEGREE))


def test_every_mesh_is_recentred(read: Reader) -> None:
    scene = read(LEGACY)
    assert {b.recentring for m in scene.multibodies for b in m.bodies} == {Recentring.COM}


def test_the_first_free_body_carries_the_robot_and_the_others_hang_on_joints(read: Reader) -> None:
    bases = [b.base for b in read(LEGACY).robots[0].bodies]
    assert bases == [BaseKind.VOLUMETRIC_ROTATIONAL, BaseKind.JOINT, BaseKind.JOINT]


def test_a_robot_on_a_fixed_body_does_not_move_its_base(read: Reader) -> None:
    robot = read(LEGACY_FIXED).robots[0]
    assert [b.base for b in robot.bodies] == [BaseKind.FIXED, BaseKind.JOINT]
    assert RobotKinematics.of(robot).dim == 1


def test_the_tag_of_a_connection_is_kept_but_not_used(read: Reader) -> None:
    robot = read(LEGACY).robots[0]
    assert [c.actuated for c in robot.connections] == ["Actuated", "NonActuated"]
    assert [c.joint for c in robot.connections] == [JointType.REVOLUTE, JointType.PRISMATIC]


def test_a_slide_is_reported_because_the_planner_turned_it(read: Reader) -> None:
    (found,) = [d for d in read(LEGACY).diagnostics if d.code == "ENV304"]
    assert "turned it by theta" in found.message
    assert found.span is not None
    assert (found.span.line, found.span.column) == place(LEGACY, "Prismatic")


def test_connections_have_no_limits(read: Reader) -> None:
    assert all(not c.limits for c in read(LEGACY).robots[0].connections)


def test_the_index_field_is_kept(read: Reader) -> None:
    text = LEGACY.replace("FreeBody 2 link2.g", "FreeBody 77 link2.g")
    assert read(text).robots[0].bodies[2].index == 77


@pytest.mark.parametrize("pose", ["", " 0 0 0 0 0 0", " -0.5 .5 1. 1e1 +2 -3E-1"])
def test_the_first_free_body_may_have_a_pose(read: Reader, pose: str) -> None:
    body = read(LEGACY.replace("cube.g 1 2 3 10 20 30", f"cube.g{pose}")).robots[0].bodies[0]
    assert (body.pose is None) == (not pose)
    if "e1" in pose:
        assert body.pose is not None
        assert body.pose.position == (-0.5, 0.5, 1.0)
        assert body.pose.rotation == pytest.approx((10 * DEGREE, 2 * DEGREE, -0.3 * DEGREE))


def test_a_pose_of_a_later_free_body_is_kept_and_reported(read: Reader) -> None:
    scene = read(LEGACY.replace("link1.g", "link1.g 7 8 9 0 0 0"))
    pose = scene.robots[0].bodies[1].pose
    assert pose is not None
    assert pose.position == (7, 8, 9)
    assert [d.message for d in scene.diagnostics if d.code == "ENV301"] == [
        "a connection places FreeBody 1 (link1.g); its own pose is not used"
    ]


@pytest.mark.parametrize(("pose", "place"), [("", "the origin"), (" 5 0 0 0 0 90", "its own pose")])
def test_a_second_free_body_that_nothing_leads_to_is_told_of_once(tmp_path: Path, pose: str, place: str) -> None:
    text = f"1\nMultiBody Active\n2\nFreeBody 0 cube.g 0 0 0 0 0 0\nFreeBody 1 cube.g{pose}\nConnection\n0\n"
    scene = env2mjcf.load(write_scene(tmp_path, text))
    told = [d.message for d in scene.diagnostics if d.code in ("ENV301", "KIN302")]
    assert told == [f"no connection leads to FreeBody 1 (cube.g): it is a base of its own, at home at {place}"]
    assert scene.space.home[6:].tolist() == ([5, 0, 0, 0, 0, np.pi / 2] if pose else [0] * 6)


def test_obstacles_of_free_bodies_are_told_of_once_and_stand_at_their_poses(tmp_path: Path) -> None:
    obstacle = "MultiBody Passive\n2\nFreeBody 0 cube.g 1 0 9 0 0 0\nFreeBody 1 cube.g 4 5 6 0 0 0\nConnection\n0\n"
    robot = "MultiBody Active\n1\nFreeBody 0 cube.g 0 0 0 0 0 0\nConnection\n0\n"
    scene = env2mjcf.load(write_scene(tmp_path, f"2\n{robot}{obstacle}"))
    assert [d.code for d in scene.diagnostics if d.code in ("ENV301", "KIN302")] == ["KIN302"]
    assert scene.obstacle_poses()[:, :3, 3].tolist() == [[1, 0, 9], [4, 5, 6]]


def test_a_fixed_body_needs_its_pose(read: Reader) -> None:
    text = LEGACY.replace("wall.g 0 2 0 0 0 90", "wall.g")
    found = fault(read, text)
    assert found.code == "ENV112"
    assert "expected a number (x), found 'Connection'" in found.message
    assert found.span is not None
    assert (found.span.line, found.span.column) == place(text, "Connection", 2)


def test_an_obstacle_may_have_several_bodies(read: Reader) -> None:
    text = LEGACY.replace(
        "1\nFixedBody 0 wall.g 0 2 0 0 0 90\n", "2\nFixedBody 0 wall.g 0 2 0 0 0 90\nFixedBody 1 w2.g 1 1 1 0 0 0\n"
    )
    assert [b.filename for b in read(text).obstacles[0].bodies] == ["wall.g", "w2.g"]


def test_the_active_multibody_is_the_robot_wherever_it_stands(read: Reader) -> None:
    robot, obstacle = LEGACY[LEGACY.index("MultiBody Active") :].split("MultiBody Passive")
    scene = read(f"2\nMultiBody Passive{obstacle}{robot}")
    assert scene.robots[0].bodies[0].filename == "cube.g"
    assert scene.obstacles[0].bodies[0].filename == "wall.g"


def test_without_an_active_multibody_the_first_one_is_the_robot(read: Reader) -> None:
    scene = read(LEGACY.replace("Active", "Passive"))
    assert (scene.robots, scene.obstacles) == (scene.multibodies[:1], scene.multibodies[1:])


@pytest.mark.parametrize(
    ("tag", "kind"),
    [
        ("Passive Internal", MultiBodyKind.INTERNAL),
        ("Passive\ninternal", MultiBodyKind.INTERNAL),
        ("Internal", MultiBodyKind.INTERNAL),
        ("Surface", MultiBodyKind.SURFACE),
    ],
)
def test_obstacles_may_be_internal_or_surfaces(read: Reader, tag: str, kind: MultiBodyKind) -> None:
    assert read(LEGACY.replace("Passive", tag)).multibodies[1].kind is kind


def test_an_internal_robot_stays_a_robot(read: Reader) -> None:
    assert read(LEGACY.replace("Active", "Active Internal")).multibodies[0].kind is MultiBodyKind.ACTIVE


@pytest.mark.parametrize("wrong", ["Pasive", "Passve", "Passiv"])
def test_a_misspelt_tag_is_read_with_a_warning(read: Reader, wrong: str) -> None:
    text = LEGACY.replace("Passive", wrong)
    scene = read(text)
    (warning,) = warnings(scene)
    assert (warning.code, warning.hint) == ("ENV202", "write Passive")
    assert f"{wrong!r} is read as 'Passive'" in warning.message
    assert (warning.span and warning.span.line, warning.span and warning.span.column) == place(text, wrong)
    assert scene == read(LEGACY)


def test_a_misspelt_fixed_body_stays_fixed(read: Reader) -> None:
    scene = read(LEGACY.replace("FixedBody", "FixdBody"))
    assert scene.obstacles[0].bodies[0].base is BaseKind.FIXED
    assert codes(scene) == ["ENV202"]


@pytest.mark.parametrize("word", ["freebody", "FREEBODY", "fixedbody", "revolute"])
def test_the_case_of_compared_words_matters_to_the_original_only(read: Reader, word: str) -> None:
    proper = {"freebody": "FreeBody", "fixedbody": "FixedBody", "revolute": "Revolute"}[word.lower()]
    scene = read(LEGACY.replace(proper, word, 1))
    assert codes(scene) == ["ENV201"]
    assert scene == read(LEGACY)


@pytest.mark.parametrize("word", ["multibody", "active", "CONNECTION", "connections", "Connections"])
def test_the_case_of_words_that_are_never_compared_is_free(read: Reader, word: str) -> None:
    proper = {"m": "MultiBody", "a": "Active", "c": "Connection"}[word[0].lower()]
    scene = read(LEGACY.replace(proper, word, 1))
    assert not codes(scene)
    assert scene == read(LEGACY)


def test_another_word_for_connection_is_taken_as_the_original_takes_it(read: Reader) -> None:
    scene = read(LEGACY.replace("Connection\n2", "Joints\n2"))
    assert codes(scene) == ["ENV202"]
    assert len(scene.robots[0].connections) == 2


def test_line_breaks_are_free(read: Reader) -> None:
    words = LEGACY.split("\n", 1)[1].replace("#VIZMO_COLOR 0.5 0.25 1\n", "").split()
    loose = read("\n".join(words) + "\n")
    assert [c.dh for c in loose.robots[0].connections] == [c.dh for c in read(LEGACY).robots[0].connections]


def test_comments_may_stand_anywhere_between_words(read: Reader) -> None:
    text = LEGACY.replace("0 1 Actuated", "0 # parent\n 1 # child\nActuated # unused")
    scene = read(text)
    assert scene.robots == read(LEGACY).robots
    assert "# child" in [c.text for c in scene.comments]


def test_infinity_as_some_libraries_print_it_is_no_comment(read: Reader) -> None:
    found = fault(read, LEGACY.replace("90 0.3 0.4 30", "1.#INF 0.3 0.4 30"))
    assert (found.code, found.hint) == ("ENV113", "numbers must be finite")


def test_vizmo_lines_colour_and_name_the_body_behind_them(read: Reader) -> None:
    scene = read(LEGACY.replace("FreeBody 1 link1.g", "#VIZMO_NAME left arm\nFreeBody 1 link1.g"))
    cube, link1, link2 = scene.robots[0].bodies
    assert (cube.color, cube.label) == ((0.5, 0.25, 1, 1), None)
    assert (link1.color, link1.label) == (None, "left arm")
    assert (link2.color, link2.label) == (None, None)


@pytest.mark.parametrize("color", ["", "1 0", "1 0 blue", "255 0 0", "nan 0 0"])
def test_a_vizmo_colour_that_is_none_is_not_used(read: Reader, color: str) -> None:
    scene = read(LEGACY.replace("0.5 0.25 1", color))
    assert scene.robots[0].bodies[0].color is None
    assert codes(scene) == ["ENV215"]


@pytest.mark.parametrize(("version", "expected"), [("0", []), ("20001022", []), ("20020327", []), ("2", ["ENV208"])])
def test_an_unknown_version_in_the_header_is_a_warning(read: Reader, version: str, expected: list[str]) -> None:
    assert codes(read(LEGACY.replace("20020327", version))) == expected


@pytest.mark.parametrize(("header", "expected"), [("#Cfg_free_tree 2", []), ("#Cfg_fixed_PRR", ["ENV218"])])
def test_a_configuration_class_with_a_layout_of_its_own_is_a_warning(
    read: Reader, header: str, expected: list[str]
) -> None:
    assert codes(read(f"{header}\n{LEGACY}")) == expected


def test_a_missing_final_newline_is_worth_knowing_but_no_fault(read: Reader) -> None:
    scene = read(LEGACY.rstrip())
    assert "ENV210" in [d.code for d in scene.diagnostics]
    assert not codes(scene)


def test_text_behind_the_last_multibody_is_ignored_with_a_warning(read: Reader) -> None:
    text = LEGACY + "and so on\n"
    (warning,) = warnings(read(text))
    assert (warning.code, warning.span and warning.span.line) == ("ENV209", len(text.splitlines()))


@pytest.mark.parametrize(
    ("old", "new", "declared", "what", "at"),
    [
        ("20020327\n2\n", "20020327\n1\n", 1, "the file declares 1 multibody and has 2; read 2", 2),
        ("20020327\n2\n", "20020327\n9\n", 9, "the file declares 9 multibodies and has 2; read 2", 2),
        ("Active\n3\n", "Active\n2\n", 2, "the file declares 2 bodies and has 3; read 3", 4),
        ("Active\n3\n", "Active\n30\n", 30, "the file declares 30 bodies and has 3; read 3", 4),
        ("Connection\n2\n", "Connection\n0\n", 0, "the file declares 0 connections and has 2; read 2", 10),
        ("Connection\n2\n", "Connection\n5\n", 5, "the file declares 5 connections and has 2; read 2", 10),
    ],
)
def test_a_wrong_count_is_a_warning_and_the_file_is_believed(
    read: Reader, old: str, new: str, declared: int, what: str, at: int
) -> None:
    scene = read(LEGACY.replace(old, new, 1))
    (warning,) = warnings(scene)
    assert (warning.code, warning.message) == ("ENV203", what)
    assert (warning.span and warning.span.line, warning.span and warning.span.column) == (at, 1)
    assert scene.multibodies == read(LEGACY).multibodies


@pytest.mark.parametrize(
    ("old", "new", "code", "message", "hint"),
    [
        ("Active\n3", "Active\n-3", "ENV110", "the number of bodies is -3; expected 0 to 20000", "how many"),
        ("Active\n3", "Active\n1000000000", "ENV110", "the number of bodies is 1000000000", "Limits(bodies=...)"),
        ("Connection\n2", "Connection\n1000000000", "ENV110", "number of connections is", "Limits(connections=...)"),
        ("20020327\n2", "20020327\n1000000000", "ENV110", "number of multibodies is", "Limits(bodies=...)"),
        ("Active\n3", "Active\n3.0", "ENV112", "expected an integer (the number of bodies), found '3.0'", "write"),
        ("Active\n3", "Active\n" + "9" * 5000, "ENV113", "too large for a number", "finite"),
        ("0 1 Actuated", "0 3 Actuated", "ENV115", "body index 3 is out of range", "counted from 0"),
        ("0 1 Actuated", "-1 1 Actuated", "ENV115", "this multibody has 3 bodies, 0 to 2", "counted from 0"),
        ("0 1 Actuated", "1 1 Actuated", "ENV116", "a connection from body 1 to itself", "parent"),
        ("Revolute", "Helical", "ENV121", "unknown joint type 'Helical'; expected 'Revolute' or 'Prismatic'", "write"),
        ("FixedBody", "Wall", "ENV122", "unknown body tag 'Wall'; expected 'FreeBody' or 'FixedBody'", "write"),
        ("MultiBody Passive", "MultiBody Obstacle", "ENV120", "unknown multibody tag 'Obstacle'; expected", "write"),
        ("90 0.3 0.4 30", "90 nan 0.4 30", "ENV113", "expected a number (a), found 'nan'", "finite"),
        ("90 0.3 0.4 30", "-inf 0.3 0.4 30", "ENV113", "expected a number (alpha), found '-inf'", "finite"),
        ("90 0.3 0.4 30", "90 0x1F 0.4 30", "ENV112", "expected a number (a), found '0x1F'", "decimal number"),
        ("90 0.3 0.4 30", "90 0,3 0.4 30", "ENV112", "expected a number (a), found '0,3'", "decimal point"),
        ("90 0.3 0.4 30", "90 1e999 0.4 30", "ENV113", "a 1e999 is too large for a number", "finite"),
        ("90 0.3 0.4 30", "90 0.3 0.4 ٣", "ENV112", "expected a number (theta), found '٣'", "write"),
        ("90 0.3 0.4 30", "90 0.3.4 30", "ENV112", "expected a number (a), found '0.3.4'", "write"),
        ("FreeBody 1 link1.g", "FreeBody link1.g", "ENV112", "expected an integer (the index of the body)", "write"),
    ],
)
def test_bad_input_says_what_was_found_and_expected_and_where(
    read: Reader, old: str, new: str, code: str, message: str, hint: str
) -> None:
    text = LEGACY.replace(old, new, 1)
    found = fault(read, text)
    assert found.code == code
    assert message in found.message
    assert hint in found.hint
    changed = next(i for i, (a, b) in enumerate(zip(LEGACY, text, strict=False)) if a != b)
    assert found.span is not None
    assert found.span.line == text[: changed + 1].count("\n") + 1


def test_a_multibody_without_bodies_is_refused(read: Reader) -> None:
    found = fault(read, LEGACY.replace("1\nFixedBody 0 wall.g 0 2 0 0 0 90\n", "0\n"))
    assert (found.code, found.span and found.span.line) == ("ENV117", 16)


def test_a_second_connection_to_a_body_closes_a_loop(read: Reader) -> None:
    third = "0 2 Actuated\n0 0 0 0 0 0 0 0 0 0 Revolute 0 0 0 0 0 0\nMultiBody Passive"
    scene = read(LEGACY.replace("Connection\n2", "Connection\n3").replace("MultiBody Passive", third))
    assert RobotKinematics.of(scene.robots[0]).tree.loops == (2,)


def test_the_kinematic_chain_must_begin_at_a_base(read: Reader) -> None:
    text = LEGACY.replace("0 1 Actuated", "2 1 Actuated")
    found = fault(read, text)
    assert (found.code, "cycle of connections" in found.message) == ("KIN303", True)
    assert (found.span and found.span.line, found.span and found.span.column) == place(text, "link1.g")


def test_a_free_body_without_a_connection_flies_on_its_own(read: Reader) -> None:
    scene = read(LEGACY_FIXED.replace("Connection\n1\n", "Connection\n0\n").split("0 1 Actuated")[0])
    assert codes(scene) == ["KIN302"]
    assert RobotKinematics.of(scene.robots[0]).dim == 6


def test_limits_bound_the_whole_scene(read: Reader) -> None:
    assert fault(read, LEGACY, limits=Limits(bodies=3)).code == "ENV110"
    assert fault(read, LEGACY, limits=Limits(connections=1)).code == "ENV110"
    assert fault(read, LEGACY, limits=Limits(name_length=8)).code == "ENV109"
    assert read(LEGACY, limits=Limits(bodies=4, connections=2)).robots


def test_strict_turns_a_warning_into_an_error(read: Reader) -> None:
    found = fault(read, LEGACY.replace("Passive", "Pasive"), strict=True)
    assert (found.code, found.severity) == ("ENV202", "error")
