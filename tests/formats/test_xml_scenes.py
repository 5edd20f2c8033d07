"""XML environments, XML robots and the planner's problem files (docs/format/xml.md)."""

from __future__ import annotations

import re
import time
from math import pi
from pathlib import Path

import pytest
from texts import PROBLEM, ROBOT, XML_ENVIRONMENT, XML_ROBOT, B, E, Reader, codes, fault, place, warnings, write

import env2mjcf
from env2mjcf.errors import Severity
from env2mjcf.formats import xml
from env2mjcf.kinematics.forward import RobotKinematics
from env2mjcf.limits import Limits
from env2mjcf.model.environment import BaseKind, BoundaryShape, DHForm, Dialect, JointType, MultiBodyKind, Recentring

# Environments.


def test_an_environment_has_a_boundary_and_obstacles(read: Reader) -> None:
    scene = read(XML_ENVIRONMENT)
    assert scene.dialect is Dialect.E
    assert [m.kind for m in scene.multibodies] == [MultiBodyKind.PASSIVE, MultiBodyKind.INTERNAL]
    assert scene.boundary is not None
    assert (scene.boundary.shape, scene.boundary.lower, scene.boundary.upper) == (
        BoundaryShape.BOX,
        (-2, -3, -0.1),
        (2, 3, 2.5),
    )
    table = scene.obstacles[0].bodies[0]
    assert (table.filename, table.color) == ("table.g", (0.8, 0.7, 0.5, 1))
    assert table.pose is not None
    assert table.pose.position == (1, 0, 0.15)
    assert table.pose.rotation == pytest.approx((0, 0, pi / 2))
    assert not codes(scene)


def test_meshes_are_recentred_only_where_the_file_says_so(read: Reader) -> None:
    assert [m.bodies[0].recentring for m in read(XML_ENVIRONMENT).obstacles] == [Recentring.COM, Recentring.NONE]


def test_attributes_are_kept_and_resolutions_read(read: Reader) -> None:
    scene = read(XML_ENVIRONMENT)
    assert scene.resolution.position == 0.02
    assert scene.resolution.orientation == pytest.approx(0.1 * pi)
    assert dict(scene.attributes) == {"gravity": "0 0 0", "orientationRes": "0.1", "positionRes": "0.02"}


@pytest.mark.parametrize(
    ("shape", "limits", "center", "upper"),
    [
        ("sphere", "[1 -2 3 ; 4]", (1, -2, 3), ()),
        ("sphere2d", "[1 -2;4]", (1, -2), ()),
        ("box2d", "[-1:1;-2:2]", (), (1, 2)),
        ("BOX", "[-1:1;-2:2;-3:3]", (), (1, 2, 3)),
    ],
)
def test_boundaries_have_the_shapes_of_text(
    read: Reader, shape: str, limits: str, center: tuple[float, ...], upper: tuple[float, ...]
) -> None:
    text = XML_ENVIRONMENT.replace('shape="box"', f'shape="{shape}"').replace("[-2:2 ; -3:3 ; -0.1:2.5]", limits)
    boundary = read(text).boundary
    assert boundary is not None
    assert (boundary.center, boundary.upper) == (center, upper)


def test_a_boundary_of_the_configuration_space_yields_to_one_of_the_workspace(read: Reader) -> None:
    cspace = '<Boundary space="cspace" shape="box" limits="[-9:9 ; -9:9]"/>'
    scene = read(XML_ENVIRONMENT.replace("<Boundary", f"{cspace}<Boundary", 1))
    assert scene.boundary is not None
    assert (scene.boundary.space, scene.boundary.upper) == ("workspace", (2, 3, 2.5))
    alone = read(XML_ENVIRONMENT.replace("workspace", "cspace"))
    assert codes(alone) == ["ENV212"]


def test_what_is_not_used_is_reported(read: Reader) -> None:
    text = XML_ENVIRONMENT.replace("</Environment>", "<Light/></Environment>").replace(
        'type="fixed" tr', 'colour="1" tr'
    )
    found = {d.code: d for d in read(text).diagnostics if d.severity is Severity.INFO}
    assert "<Light> of <Environment> is not used" in found["ENV307"].message
    assert "attribute 'colour' of <Base> is not used" in found["ENV311"].message
    assert "did you mean 'color'?" in found["ENV311"].hint


def test_an_obstacle_without_a_place_stands_at_the_origin_with_a_warning(read: Reader) -> None:
    scene = read(XML_ENVIRONMENT.replace(' transform="0.85 0.4 0.4 0 0 0"', ""))
    assert codes(scene) == ["ENV219"]
    pose = scene.obstacles[1].bodies[0].pose
    assert pose is not None
    assert pose.position == (0, 0, 0)


@pytest.mark.parametrize(
    ("old", "new", "code", "message", "at"),
    [
        ('shape="box"', 'shape="cube"', "ENV142", "unknown shape 'cube'; expected 'Box' or", "cube"),
        ('space="workspace"', 'space="outer"', "ENV142", "unknown space 'outer'", "outer"),
        ("[-2:2", "[2:-2", "ENV114", "the x range of the boundary 2:-2 is empty", "2:-2"),
        (
            "[-2:2",
            "[nan:2",
            "ENV113",
            "expected a number (lower end of the x range of the boundary), found 'nan:2'",
            "nan:2",
        ),
        ("[-2:2 ; -3:3 ; -0.1:2.5]", "[-2:2]", "ENV119", "a box with one range", "[-2:2]"),
        ("[-2:2 ; -3:3 ; -0.1:2.5]", "[-2:2 ; -3:3", "ENV111", "the value of limits ends where", '3"/>'),
        ("-0.1:2.5]", "-0.1:2.5] 7", "ENV143", "limits has more than was expected", '7"/>'),
        ("0.8 0.7 0.5 1", "0.8 0.7 0.5", "ENV111", "the value of color ends where a number (alpha)", '5" type'),
        ("1 0 0.15 0 0 90", "1 0 0.15 0 0 90 5", "ENV143", "transform has more than was expected", '5"/>\n  </M'),
        ("1 0 0.15 0 0 90", "1 0 1e999 0 0 90", "ENV113", "z 1e999 is too large", "1e999"),
        ('type="passive"', 'type="active"', "ENV142", "unknown type 'active'; expected 'passive'", "active"),
        ('type="fixed"', 'type="planar"', "ENV123", "an obstacle with a planar base; expected fixed", "planar"),
        ('comAdjustment="com"', 'comAdjustment="centre"', "ENV142", "unknown comAdjustment 'centre'", "centre"),
        ('filename="table.g"', 'file="table.g"', "ENV141", "<Base> has no attribute 'filename'", "<Base"),
        ('positionRes="0.02"', 'positionRes="fine"', "ENV112", "expected a number (positionRes), found 'fine'", "fine"),
        (
            '<Base filename="can.g" type="fixed" transform="0.85 0.4 0.4 0 0 0"/>',
            "",
            "ENV145",
            "has 0 <Base>",
            '<MultiBody type="internal',
        ),
    ],
)
def test_a_bad_environment_is_refused_where_it_stands(
    read: Reader, old: str, new: str, code: str, message: str, at: str
) -> None:
    text = XML_ENVIRONMENT.replace(old, new, 1)
    found = fault(read, text)
    assert found.code == code
    assert message in found.message
    assert (found.span and found.span.line, found.span and found.span.column) == place(text, at)


# Robots.


def test_a_robot_has_a_base_and_links(read_robot: Reader) -> None:
    scene = read_robot(XML_ROBOT)
    (robot,) = scene.robots
    assert [b.base for b in robot.bodies] == [BaseKind.PLANAR_ROTATIONAL, BaseKind.JOINT, BaseKind.JOINT]
    assert (robot.dialect, robot.dh_form, robot.bodies[0].mass) == (Dialect.E, DHForm.STANDARD, 3)
    hinge, ball = robot.connections
    assert (hinge.previous, hinge.next, hinge.joint) == (0, 1, JointType.REVOLUTE)
    assert (hinge.to_dh.position, hinge.to_body.position) == ((1, 2, 3), (4, 5, 6))
    assert (hinge.dh.alpha, hinge.dh.a, hinge.dh.d, hinge.dh.theta) == (0.1, 0.2, 0.3, 0.4)
    assert [(x.lower, x.upper) for c in (hinge, ball) for x in c.limits] == [(-pi / 2, pi / 4), (-pi, pi), (0, pi)]
    assert not codes(scene)


def test_an_xml_robot_moves_as_the_same_robot_in_text(read_robot: Reader) -> None:
    text = """3
base.g -a(None) 3 Planar Rotational
link1.g -a(None) Joint
link2.g -a(None) Joint
Connections
2
0 1 Revolute -0.5:0.25
1 2 3 90 0 0  0.1 0.2 0.3 0.4  4 5 6 0 90 0
0 2 Spherical -1:1 0:1
0 0 0 0 0 0  0 0 0 0  0 0 0 0 0 0
"""
    (in_text,), (in_xml,) = read_robot(text).robots, read_robot(XML_ROBOT).robots
    assert (in_xml.bodies, in_xml.connections) == (in_text.bodies, in_text.connections)


def test_a_missing_range_is_a_whole_turn_with_a_warning(read_robot: Reader) -> None:
    scene = read_robot(XML_ROBOT.replace(' range="-1:1"', ""))
    assert codes(scene) == ["ENV204"]
    theta, alpha = RobotKinematics.of(scene.robots[0]).dofs[-2:]
    assert (theta.lower, theta.upper, alpha.lower, alpha.upper) == (-pi, pi, 0, pi)


def test_a_fixed_base_stands_where_the_file_says(read_robot: Reader) -> None:
    fixed = XML_ROBOT.replace('type="planar" movement="rotational"', 'type="fixed" transform="1 2 3 0 0 90"')
    base = read_robot(fixed).robots[0].bodies[0]
    assert base.pose is not None
    assert (base.base, base.pose.position) == (BaseKind.FIXED, (1, 2, 3))
    assert codes(read_robot(fixed.replace(' transform="1 2 3 0 0 90"', ""))) == ["ENV219"]


def test_actuators_are_kept_and_reported(read_robot: Reader) -> None:
    scene = read_robot(XML_ROBOT.replace("</Robot>", '<Actuator label="forward" limits="0:1"/></Robot>'))
    (actuator,) = scene.robots[0].actuators
    assert (actuator.label, dict(actuator.attributes)["limits"]) == ("forward", "0:1")
    assert "ENV308" in [d.code for d in scene.diagnostics]


@pytest.mark.parametrize(
    ("old", "new", "code", "message", "at"),
    [
        (
            "</Link>",
            '<Connection parentIndex="2" childIndex="1"/></Link>',
            "ENV147",
            "has 2 <Connection>",
            '<Connection parentIndex="2"',
        ),
        (
            'childIndex="2"',
            'childIndex="1"',
            "ENV147",
            "the connection of link 2 leads to body 1; expected 2",
            '1" joint="spherical',
        ),
        (
            'parentIndex="0" childIndex="2"',
            'parentIndex="2" childIndex="2"',
            "ENV116",
            "from body 2 to itself",
            '2" childIndex="2"',
        ),
        (
            'parentIndex="0" childIndex="2"',
            'parentIndex="3" childIndex="2"',
            "ENV115",
            "body index 3 is out of range",
            '3" childIndex',
        ),
        ('parentIndex="0"', 'parentIndex="-1"', "ENV115", "body index -1 is out of range", '-1" childIndex'),
        ('parentIndex="0"', 'parentIndex="x"', "ENV112", "expected an integer (the index of a body)", 'x" childIndex'),
        ('index="2" filename', 'index="3" filename', "ENV146", "link index 3 where 2 was expected", '3" filename'),
        ('joint="revolute"', 'joint="helical"', "ENV142", "unknown joint 'helical'; expected 'revolute' or", "helical"),
        ('range="-0.5:0.25"', 'range="0.25:-0.5"', "ENV114", "a joint's limits 0.25:-0.5 is empty", "0.25:-0.5"),
        ('type="planar"', 'type="wheeled"', "ENV142", "unknown type 'wheeled'; expected 'planar'", "wheeled"),
        (' movement="rotational"', "", "ENV141", "<Base> has no attribute 'movement'", "<Base"),
        ('mass="3"', 'mass="0"', "ENV118", "mass 0; expected a positive number", '0"/>'),
        ('type="active"', 'type="passive"', "ENV142", "unknown type 'passive'; expected 'active'", "passive"),
        (
            "0.1 0.2 0.3 0.4",
            "0.1 0.2 0.3",
            "ENV111",
            "the value of initialDHParams ends where a number (theta)",
            '3" transformD',
        ),
        (
            'initialDHParams="0.1 0.2 0.3 0.4"',
            "",
            "ENV141",
            "<Connection> has no attribute 'initialDHParams'",
            "<Connection",
        ),
    ],
)
def test_a_bad_robot_is_refused_where_it_stands(
    read_robot: Reader, old: str, new: str, code: str, message: str, at: str
) -> None:
    text = XML_ROBOT.replace(old, new, 1)
    found = fault(read_robot, text)
    assert found.code == code
    assert message in found.message
    assert (found.span and found.span.line, found.span and found.span.column) == place(text, at)


def test_links_in_a_cycle_are_refused(read_robot: Reader) -> None:
    text = XML_ROBOT.replace('parentIndex="0" childIndex="1"', 'parentIndex="2" childIndex="1"')
    text = text.replace('parentIndex="0" childIndex="2"', 'parentIndex="1" childIndex="2"')
    found = fault(read_robot, text)
    assert (found.code, found.span and found.span.line) == ("KIN303", place(text, "link1.g")[0])


def test_environments_and_robots_are_not_mistaken_for_each_other(read: Reader, read_robot: Reader) -> None:
    assert fault(read, XML_ROBOT).code == "ENV131"
    found = fault(read_robot, XML_ENVIRONMENT)
    assert (found.code, "unknown root <Environment>; expected <Robot>" in found.message) == ("ENV130", True)
    assert fault(read, "<html></html>").code == "ENV130"


# Problems.


@pytest.fixture
def problem(tmp_path: Path) -> Reader:
    """Read a problem file beside its environment and robot."""
    write(tmp_path, E, "scene.env")
    write(tmp_path, "1\nb.g Planar Rotational\nConnections\n0\n", "other.robot")
    robot = ROBOT.replace("Adjacencies\n1\n0 2\n", "")
    write(tmp_path, robot, "rob.robot")

    def read_text(text: str, **options: object) -> env2mjcf.Environment:
        return env2mjcf.read(write(tmp_path, text, "problem.xml"), **options)

    return read_text


def test_a_problem_brings_environment_robot_and_task_together(problem: Reader) -> None:
    scene = problem(PROBLEM)
    assert (scene.name, len(scene.obstacles), [r.label for r in scene.robots]) == ("problem", 2, ["rob"])
    (task,) = scene.tasks
    assert (task.label, task.robot, task.configurations) == ("go", 0, ((1, 2, 0.1, 0.2, 0.3), (3, 4, 0.4, 0.5, 0.6)))
    assert (scene.planner_rules.adjacent_links, scene.planner_rules.ignore_self_collision) == (1, False)
    assert not codes(scene)


@pytest.mark.parametrize("root", ["motion_planning", "MOTIONPLANNING"])
def test_older_files_spell_the_root_otherwise(problem: Reader, root: str) -> None:
    assert problem(PROBLEM.replace("MotionPlanning", root)).tasks


def test_a_problem_may_be_the_root(problem: Reader) -> None:
    start, end = PROBLEM.index("<Problem"), PROBLEM.index("</Problem>")
    assert problem(PROBLEM[start:end] + "</Problem>").tasks


def test_the_environment_may_stand_inside(problem: Reader) -> None:
    inside = XML_ENVIRONMENT[XML_ENVIRONMENT.index("<Environment") :]
    scene = problem(PROBLEM.replace('<Environment filename="scene.env"/>', inside))
    assert (len(scene.obstacles), scene.resolution.position) == (2, 0.02)


def test_attributes_of_the_environment_override_the_file(problem: Reader) -> None:
    scene = problem(PROBLEM.replace('filename="scene.env"', 'filename="scene.env" positionRes="7" timeRes="-1"'))
    assert (scene.resolution.position, scene.resolution.time) == (7, None)
    assert dict(scene.attributes)["positionRes"] == "7"


def test_tasks_name_their_robots(problem: Reader) -> None:
    two = PROBLEM.replace("<Robot", '<Robot label="b" filename="other.robot"/><Robot', 1)
    scene = problem(two)
    assert [(t.robot, t.label) for t in scene.tasks] == [(1, "go")]


def test_tasks_of_a_problem_count_behind_the_environments_own_robots(problem: Reader, tmp_path: Path) -> None:
    write(tmp_path, B, "scene.env")
    assert [t.robot for t in problem(PROBLEM).tasks] == [1]
    write(tmp_path, "1\nMultiBody Passive\n1\nFixedBody 0 w.g 0 0 0 0 0 0\nConnection\n0\n", "scene.env")
    scene = problem(PROBLEM)
    assert [t.robot for t in scene.tasks] == [0]
    assert scene.robots[0].label == "rob"


def test_points_may_carry_velocities(problem: Reader) -> None:
    scene = problem(PROBLEM.replace("1 2 0.1 0.2 0.3", "1 2 0.1 0.2 0.3 9 9 9 9 9"))
    assert scene.tasks[0].configurations[0] == (1, 2, 0.1, 0.2, 0.3)


def test_virtual_robots_and_their_tasks_are_reported_and_left_out(problem: Reader) -> None:
    virtual = '<Robot label="boss" virtual="true" filename="none.robot"/><Task label="t" robot="boss"/><Task'
    scene = problem(PROBLEM.replace("<Task", virtual, 1))
    assert (len(scene.robots), len(scene.tasks)) == (1, 1)
    assert [d.code for d in scene.diagnostics].count("ENV307") == 2


def test_older_boundaries_stand_in_the_problem(problem: Reader, tmp_path: Path) -> None:
    write(tmp_path, "1\nMultiBody Active\n1\nFreeBody 0 w.g\nConnection\n0\n", "old.env")
    text = """<motion_planning><MPProblem><Environment input_env="old.env"><boundary type="bbox">
      <parameter Label="X" min="-1" max="2"/><parameter Label="Y" min="-3" max="4"/>
      <parameter Label="Z" min="-5" max="6"/></boundary></Environment></MPProblem></motion_planning>"""
    boundary = problem(text).boundary
    assert boundary is not None
    assert (boundary.lower, boundary.upper) == ((-1, -3, -5), (2, 4, 6))
    assert fault(problem, text.replace('max="4"', 'max="-4"')).code == "ENV114"


def test_an_ill_formed_library_does_not_hide_the_problem(problem: Reader) -> None:
    scene = problem(PROBLEM.replace('ignoreAdjacentLinks="true"', "ignoreAdjacentLinks=true"))
    assert codes(scene) == ["ENV214"]
    assert scene.tasks
    assert scene.planner_rules.adjacent_links is None


@pytest.mark.parametrize(
    ("old", "new", "code", "message", "at"),
    [
        ('<Environment filename="scene.env"/>', "", "ENV148", "<Problem> has no <Environment>", "<Problem"),
        ('filename="scene.env"', 'filename="scnee.env"', "ENV101", "there is no file", "scnee.env"),
        ('filename="rob.robot"', 'filename="bob.robot"', "ENV101", "there is no file", "bob.robot"),
        ('filename="rob.robot"', 'filename="../rob.robot"', "ENV150", "../rob.robot lies outside the folder", "../rob"),
        ('filename="rob.robot"', 'filename="/etc/passwd"', "ENV150", "/etc/passwd lies outside the folder", "/etc"),
        ('filename="rob.robot"', "", "ENV141", "<Robot> has no attribute 'filename'", "<Robot"),
        ('robot="rob"', 'robot="bob"', "ENV149", "for the unknown robot 'bob'; expected one of: 'rob'", 'bob">'),
        ("1 2 0.1 0.2 0.3", "1 2 0.1", "CFG504", "a point of 3 numbers in task 'go'; expected 5", "<Task"),
        ("1 2 0.1 0.2 0.3", "1 2 0.1 0.2 nan", "ENV113", "expected a number (point), found 'nan'", "nan"),
        ("<Problem base", "<Problem base=1 base", "ENV140", "not well-formed XML", "1 base"),
        (
            "<Robot",
            '<Robot label="rob" filename="other.robot"/><Robot',
            "ENV151",
            "two robots are called 'rob'",
            'rob" filename="rob',
        ),
    ],
)
def test_a_bad_problem_is_refused_where_it_stands(
    problem: Reader, old: str, new: str, code: str, message: str, at: str
) -> None:
    text = PROBLEM.replace(old, new, 1)
    found = fault(problem, text)
    assert found.code == code
    assert message in found.message
    assert (found.span and found.span.line, found.span and found.span.column) == place(text, at)


def test_files_outside_the_folder_are_read_on_request(problem: Reader, tmp_path: Path) -> None:
    (tmp_path / "inner").mkdir()
    text = PROBLEM.replace('"scene.env"', '"../scene.env"').replace('"rob.robot"', '"../rob.robot"')
    path = write(tmp_path / "inner", text, "problem.xml")
    assert fault(env2mjcf.read, str(path)).code == "ENV150"
    assert env2mjcf.read(path, allow_outside=True).tasks


def test_a_link_that_leads_outside_is_outside(problem: Reader, tmp_path: Path) -> None:
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "scene.env").symlink_to(tmp_path / "scene.env")
    path = write(tmp_path / "inner", PROBLEM, "problem.xml")
    assert fault(env2mjcf.read, str(path)).code == "ENV150"


@pytest.mark.parametrize("name", ["ignoreIAdjacentLinks", "ignore_i_adjacent_links"])
def test_fewer_links_than_none_are_refused(problem: Reader, name: str) -> None:
    found = fault(problem, PROBLEM.replace('ignoreAdjacentLinks="true"', f'{name}="-5"'))
    assert (found.code, found.span and found.span.text[found.span.column - 1 :][:2]) == ("ENV110", "-5")


@pytest.mark.parametrize(
    ("word", "meant"), [("true", True), ("TRUE", True), (" 1 ", True), ("False", False), ("0", False), ("yes", None)]
)
def test_flags_are_words_or_digits(problem: Reader, word: str, meant: bool | None) -> None:
    scene = problem(PROBLEM.replace('ignoreSelfCollision="false"', f'ignoreSelfCollision="{word}"'))
    assert scene.planner_rules.ignore_self_collision is meant
    assert ("ENV213" in codes(scene)) is (meant is None)


def test_leading_zeros_do_not_make_a_number_large(problem: Reader) -> None:
    scene = problem(PROBLEM.replace('ignoreAdjacentLinks="true"', f'ignoreIAdjacentLinks="{"0" * 5000}2"'))
    assert scene.planner_rules.adjacent_links == 2


# The text itself.


@pytest.mark.parametrize("declaration", ['<!ENTITY a "b">', '<!ENTITY x SYSTEM "file:///etc/passwd">'])
def test_entities_are_refused(read: Reader, declaration: str) -> None:
    text = XML_ENVIRONMENT.replace("<Environment", f"<!DOCTYPE e [{declaration}]>\n<Environment", 1)
    found = fault(read, text)
    assert (found.code, found.span and found.span.line) == ("ENV144", 2)


HIDDEN = [
    "<!DOCTYPE e SYSTEM '<!--' [{}]><!-- -->",
    "<!DOCTYPE e [<!ATTLIST e a CDATA '<!--'>{}]><!-- -->",
    "<!-- -->\n<!DOCTYPE e [{}]>",
]


@pytest.mark.parametrize("prolog", HIDDEN)
def test_entities_are_not_hidden_by_what_only_looks_like_a_comment(read: Reader, prolog: str) -> None:
    declared = prolog.format('<!ENTITY a "b">')
    assert fault(read, XML_ENVIRONMENT.replace("<Environment", f"{declared}<Environment", 1)).code == "ENV144"


@pytest.mark.parametrize("where", ["<Environment", "</Environment>"])
@pytest.mark.parametrize("harmless", ["<!-- <!ENTITY x 'y'> \" &foo; -->", "<?note <!ENTITY x 'y'> ' &foo;?>"])
def test_comments_declare_and_name_nothing(read: Reader, where: str, harmless: str) -> None:
    assert not codes(read(XML_ENVIRONMENT.replace(where, f"{harmless}\n{where}", 1)))


@pytest.mark.parametrize("prolog", ["", '<!DOCTYPE e SYSTEM "e.dtd">', '<!DOCTYPE e SYSTEM "<!--">'])
def test_an_entity_that_a_text_names_is_refused_where_it_stands(read: Reader, prolog: str) -> None:
    text = XML_ENVIRONMENT.replace("<Environment", f"{prolog}<Environment", 1).replace("table.g", "a&foo;b", 1)
    found = fault(read, text)
    assert (found.code, found.span and found.span.line) == ("ENV144", text[: text.index("&foo;")].count("\n") + 1)
    assert found.span is not None
    assert found.span.text[found.span.column - 1 :].startswith("&foo;")
    assert "'&foo;'" in found.message


def test_the_first_fault_is_told(read: Reader) -> None:
    found = fault(read, "<Environment>\n<a></b>\n<c d='&foo;'/>\n</Environment>")
    assert (found.code, found.span and found.span.line) == ("ENV140", 2)
    found = fault(read, "<Environment>\n<c d='&foo;'/>\n<a></b>\n</Environment>")
    assert (found.code, found.span and found.span.line) == ("ENV144", 2)


def test_characters_may_be_written_as_references(read: Reader) -> None:
    plain = read(XML_ENVIRONMENT).multibodies
    digits = [m.start(1) for m in re.finditer(r'transform="([0-9])', XML_ENVIRONMENT)]
    assert digits
    text = XML_ENVIRONMENT
    for at in reversed(digits):
        text = f"{text[:at]}&#{ord(text[at])};{text[at + 1 :]}"
    named = read(text).multibodies
    assert [b.pose for m in named for b in m.bodies] == [b.pose for m in plain for b in m.bodies]


def test_what_is_wrong_with_them_has_the_place_of_the_attribute(read: Reader) -> None:
    text = re.sub(r'transform="[^"]*"', 'transform="&#48; wrong 0 0 0 0"', XML_ENVIRONMENT, count=1)
    found = fault(read, text)
    at = text.index("&#48;")
    assert found.code == "ENV112"
    assert "'wrong'" in found.message
    assert found.span is not None
    assert (found.span.line, found.span.column) == (text[:at].count("\n") + 1, at - text.rindex("\n", 0, at))


@pytest.mark.parametrize("text", ["<Environment>{}</Environment>", "<Environment a='{}'/>", "<!--{}--><Environment/>"])
def test_texts_that_no_scene_has_are_called_so(read: Reader, text: str) -> None:
    assert fault(read, text.format("x" * 10_500_000)).code == "ENV181"


def test_a_document_type_alone_is_no_fault(read: Reader) -> None:
    assert not codes(read(XML_ENVIRONMENT.replace("<Environment", "<!DOCTYPE Environment>\n<Environment", 1)))


@pytest.mark.parametrize("encoding", ["utf-8", "ISO-8859-1"])
def test_the_declared_encoding_does_not_matter(read: Reader, encoding: str) -> None:
    text = XML_ENVIRONMENT.replace("UTF-8", encoding).replace("table.g", "tïsch.g")
    data = text.encode("latin-1" if encoding != "utf-8" else "utf-8")
    assert read(data).obstacles[0].bodies[0].filename == "tïsch.g"


def test_places_are_right_behind_comments_and_single_quotes(read: Reader) -> None:
    text = XML_ENVIRONMENT.replace("<Boundary", "<!-- <Boundary limits='x'> -->\n<?note <Base ?>\n  <Boundary")
    text = text.replace('limits="[-2:2', "\n   limits = '[-2:oops").replace('2.5]"', "2.5]'")
    found = fault(read, text)
    assert (found.span and found.span.line, found.span and found.span.column) == place(text, "oops")


def test_an_attribute_named_in_anothers_text_is_not_mistaken(read: Reader) -> None:
    text = XML_ENVIRONMENT.replace("<Base filename", "<Base label=\" color='x' \" filename", 1).replace(
        "0.8 0.7", "0.8 x"
    )
    found = fault(read, text)
    assert (found.span and found.span.line, found.span and found.span.column) == place(text, "x 0.5")


@pytest.mark.parametrize("text", ["<Environment>", "<", "<Environment", "<a></b>", "<a b=1/>", "<Environment/><x/>"])
def test_what_is_not_well_formed_is_refused(read: Reader, text: str) -> None:
    found = fault(read, text)
    assert found.code == "ENV140"
    assert found.span is not None
    assert found.span.line == 1


def test_deep_nesting_is_refused_not_recursed(read: Reader) -> None:
    assert fault(read, "<Environment>" + "<a>" * 100_000 + "</a>" * 100_000 + "</Environment>").code == "ENV180"


@pytest.mark.parametrize("text", ["<a>" * 100_000, "<Environment>" + "<a/>" * 100_000])
def test_a_hostile_text_is_refused_before_most_of_it_is_parsed(
    read: Reader, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    fed: list[int] = []
    parser = xml.etree.XMLPullParser

    class Counting:
        def __init__(self, *arguments: object, **options: object) -> None:
            self.parser = parser(*arguments, **options)
            self.read_events, self.close = self.parser.read_events, self.parser.close

        def feed(self, data: bytes) -> None:
            fed.append(len(data))
            self.parser.feed(data)

    monkeypatch.setattr(xml.etree, "XMLPullParser", Counting)
    assert fault(read, text, limits=Limits(elements=1000)).code == "ENV180"
    assert sum(fed) < len(text) / 10


def test_an_xml_file_cannot_be_forced_into_another_dialect(read: Reader) -> None:
    with pytest.raises(ValueError, match="is XML, which is dialect E"):
        read(XML_ENVIRONMENT, dialect="A")
    with pytest.raises(ValueError, match="concerns dialect A only"):
        read(XML_ENVIRONMENT, semantics="page")


def test_limits_bound_the_scene(read: Reader) -> None:
    assert fault(read, XML_ENVIRONMENT, limits=Limits(bodies=1)).code == "ENV110"


def test_thousands_of_bodies_read_quickly(read: Reader) -> None:
    body = '<MultiBody type="passive"><Base filename="x.g" type="fixed" transform="0 0 0 0 0 0"/></MultiBody>\n'
    start = time.perf_counter()
    scene = read(f"<Environment>\n{body * 5000}</Environment>")
    assert len(scene.obstacles) == 5000
    assert time.perf_counter() - start < 5
    assert warnings(scene) == []
