"""Groups and tasks of problem files, and what in problem files and XML scenes nothing reads (docs/format/xml.md)."""

from __future__ import annotations

from pathlib import Path

import pytest
from texts import E, Reader, codes, fault, place, write

import env2mjcf
from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.formats.rows import tasks_alone
from env2mjcf.formats.source import read_source
from env2mjcf.formats.xml import parse_xml
from env2mjcf.limits import Limits

ROBOTS = "".join(f'<Robot label="{name}" filename="{name}.robot"/>\n' for name in "abc")


def point(*numbers: float) -> str:
    return f'<CSpaceConstraint point="{" ".join(map(str, numbers))}"/>'


def task(robot: str, *goals: str, start: str | None = None, label: str = "") -> str:
    begins = "" if start is None else f"<StartConstraints>{start}</StartConstraints>"
    ends = f"<GoalConstraints>{''.join(goals)}</GoalConstraints>" if goals else ""
    return f'<Task label="{label}" robot="{robot}">{begins}{ends}</Task>\n'


@pytest.fixture
def problem(tmp_path: Path) -> Reader:
    """Read the inside of a problem with three robots: a and b in a plane, c on a rail of its own."""
    write(tmp_path, E, "scene.env")
    for name, base in (("a", "Planar Translational"), ("b", "Planar Rotational"), ("c", "Planar Translational")):
        write(tmp_path, f"1\nb.g {base}\nConnections\n0\n", f"{name}.robot")

    def read_text(inside: str, **options: object) -> env2mjcf.Environment:
        text = f'<Problem>\n<Environment filename="scene.env"/>\n{ROBOTS}{inside}</Problem>'
        return env2mjcf.read(write(tmp_path, text, "problem.xml"), **options)

    return read_text


GROUP = '<RobotGroup label="pair" robotLabels="a b"/>\n'


def together(*tasks: str, label: str = "go", group: str = "pair") -> str:
    return f'<GroupTask label="{label}" group="{group}">\n{"".join(tasks)}</GroupTask>\n'


def found(scene: env2mjcf.Environment, *wanted: str) -> list[tuple[str, str]]:
    return [(d.code, d.message) for d in scene.diagnostics if d.code in wanted]


def test_the_robots_of_a_group_have_one_task(problem: Reader) -> None:
    inner = task("b", point(7, 8, 0.5), start=point(4, 5, 6)), task("a", point(3, 4), start=point(1, 2))
    scene = problem(GROUP + together(*inner) + task("c", start=point(9, 9), label="wait"))
    assert [(t.robots, t.robot, t.label) for t in scene.tasks] == [((1, 0), 1, "go"), ((2,), 2, "wait")]
    assert scene.tasks[0].configurations == ((4, 5, 6, 1, 2), (7, 8, 0.5, 3, 4))
    assert not codes(scene)
    alone = list(tasks_alone(scene.tasks[0], [2, 3, 2]))
    assert [(t.robots, t.configurations) for t in alone] == [((1,), ((4, 5, 6), (7, 8, 0.5))), ((0,), ((1, 2), (3, 4)))]


def test_who_is_done_waits_at_its_goal(problem: Reader) -> None:
    inner = (
        task("a", point(3, 4), start=point(1, 2)),
        task("b", *(point(i, 0, 0) for i in (1, 2, 3)), start=point(0, 0, 0)),
    )
    scene = problem(GROUP + together(*inner))
    assert [c[:2] for c in scene.tasks[0].configurations] == [(1, 2), (3, 4), (3, 4), (3, 4)]
    assert found(scene, "ENV187") == [
        ("ENV187", "the robots of the group task 'go' visit 2 to 4 configurations; who is done waits at its goal")
    ]


def test_two_tasks_of_a_robot_in_a_group_come_in_turn(problem: Reader) -> None:
    inner = task("a", point(1, 1), start=point(0, 0)), task("b", start=point(0, 0, 0)), task("a", point(2, 2))
    scene = problem(GROUP + together(*inner))
    assert [c[:2] for c in scene.tasks[0].configurations] == [(0, 0), (1, 1), (2, 2)]


def test_a_robot_may_be_in_several_groups(problem: Reader) -> None:
    groups = GROUP + '<RobotGroup label="all" robotLabels="c a b"/>\n'
    first = together(task("a", start=point(0, 0)), task("b", start=point(0, 0, 0)))
    second = together(task("b", start=point(1, 1, 1)), task("c", start=point(2, 2)), group="all", label="then")
    scene = problem(groups + first + second)
    assert [t.robots for t in scene.tasks] == [(0, 1), (1, 2)]
    assert found(scene, "ENV186") == [
        ("ENV186", "robots of group 'all' without a task in the group task 'then': 'a'; they stay")
    ]


def test_a_robot_outside_the_group_moves_with_it_after_a_warning(problem: Reader) -> None:
    scene = problem(GROUP + together(task("a", start=point(0, 0)), task("c", start=point(1, 1))))
    assert scene.tasks[0].robots == (0, 2)
    assert codes(scene) == ["ENV186"]


def test_a_group_task_without_tasks_moves_nobody(problem: Reader) -> None:
    scene = problem(GROUP + together() + together(task("a"), task("b")))
    assert scene.tasks == ()
    assert [m for _, m in found(scene, "ENV307")].count("the group task 'go' moves no robot, and is not used") == 2


def test_virtual_robots_of_groups_are_left_out(problem: Reader) -> None:
    boss = '<Robot label="boss" virtual="true" filename="no.robot"/>'
    group = '<RobotGroup label="pair" robotLabels="boss a"/>'
    scene = problem(boss + group + together(task("boss", start=point(0)), task("a", start=point(1, 2))))
    assert [(t.robots, t.configurations) for t in scene.tasks] == [((0,), ((1, 2),))]
    assert not found(scene, "ENV186")


def test_a_task_goes_on_where_the_one_before_ended(problem: Reader) -> None:
    scene = problem(task("a", point(1, 1), start=point(0, 0)) + task("a", point(2, 2)) + task("c", point(3, 3)))
    assert [t.configurations for t in scene.tasks] == [((0, 0), (1, 1)), ((1, 1), (2, 2)), ((3, 3),)]
    assert [code for code, _ in found(scene, "CFG519")] == ["CFG519", "CFG519"]
    assert codes(scene) == ["CFG519"]


@pytest.mark.parametrize(
    ("inside", "code", "message", "at"),
    [
        (GROUP + together(group="pear"), "ENV184", "for the unknown group 'pear'; expected one of: 'pair'", 'pear">'),
        (GROUP.replace("a b", "a bob"), "ENV184", "group 'pair' has the unknown robot 'bob'", 'a bob"'),
        (GROUP + GROUP, "ENV151", "two groups are called 'pair'", 'pair" robotLabels="a b"/>\n</P'),
        (GROUP + task("pair", start=point(1, 2)), "ENV149", "for the unknown robot 'pair'", 'pair"><Start'),
        (GROUP + together(task("b", start=point(1))), "CFG504", "a point of 1 numbers in task ''; expected 3", "<Task"),
    ],
)
def test_what_names_nothing_is_refused_where_it_stands(
    problem: Reader, tmp_path: Path, inside: str, code: str, message: str, at: str
) -> None:
    wrong = fault(problem, inside)
    assert (wrong.code, message in wrong.message) == (code, True)
    text = (tmp_path / "problem.xml").read_text()
    assert (wrong.span and wrong.span.line, wrong.span and wrong.span.column) == place(text, at)


def test_a_task_for_a_group_is_told_how_groups_move(problem: Reader) -> None:
    assert "<GroupTask group='pair'>" in fault(problem, GROUP + task("pair", start=point(1, 2))).hint


def test_waiting_robots_do_not_pass_the_limits(problem: Reader) -> None:
    inner = task("a", *(point(i, i) for i in range(30)), start=point(0, 0)), task("b", start=point(0, 0, 0))
    assert problem(GROUP + together(*inner), limits=Limits(rows=62)).tasks
    assert fault(problem, GROUP + together(*inner), limits=Limits(rows=61)).code == "ENV182"


# What nothing reads.


@pytest.mark.parametrize(
    "name", ["ignoreIAdjacentLinks", "ignoreAdjacentLinks", "ignoreSelfCollision", "interRobotCollision"]
)
def test_rules_about_pairs_count_on_collision_checkers_only(problem: Reader, tmp_path: Path, name: str) -> None:
    old = '<Robot label="b"'
    wrong = ROBOTS.replace(old, f'<Robot {name}="true" label="b"')
    text = f'<MotionPlanning><Problem><Environment filename="scene.env"/>\n{wrong}</Problem></MotionPlanning>'
    scene = env2mjcf.read(write(tmp_path, text, "problem.xml"))
    assert found(scene, "ENV185") == [
        ("ENV185", f"attribute {name!r} of <Robot> is not used: it counts on <CollisionDetection>")
    ]
    assert codes(scene) == ["ENV185"]
    assert (scene.planner_rules.ignore_self_collision, scene.planner_rules.adjacent_links) == (None, None)


@pytest.mark.parametrize(
    ("name", "known"), [("IgnoreAdjacentLinks", "ignoreAdjacentLinks"), ("interRobotCollision", "")]
)
def test_rules_that_no_collision_checker_knows_are_a_warning(tmp_path: Path, name: str, known: str) -> None:
    write(tmp_path, E, "scene.env")
    checker = f'<CollisionDetection method="RAPID" {name}="true"/>'
    text = f'<MotionPlanning><Problem><Environment filename="scene.env"/></Problem>{checker}</MotionPlanning>'
    scene = env2mjcf.read(write(tmp_path, text, "problem.xml"))
    (warning,) = (d for d in scene.diagnostics if d.code == "ENV185")
    assert warning.message == f"attribute {name!r} of <CollisionDetection> is not used"
    assert known in warning.hint
    assert scene.planner_rules.adjacent_links is None


def test_commas_between_the_robots_of_a_group_are_told(problem: Reader) -> None:
    error = fault(problem, '<RobotGroup label="pair" robotLabels="a, b"/>')
    assert error.code == "ENV184"
    assert "no commas" in error.hint


# Every element that a reader knows, with an attribute and an element in it that none reads.
KNOWN = """<MotionPlanning{x}><Problem{x}>
<Environment{x}>
  <Boundary{x} shape="box" limits="[-9:9 ; -9:9]">{y}</Boundary>
  <MultiBody{x} type="passive"><Base{x} filename="a.g" type="fixed" transform="0 0 0 0 0 0">{y}</Base>{y}</MultiBody>{y}
</Environment>
<Robot{x} label="a" filename="a.xml">{y}</Robot>
<RobotGroup{x} label="pair" robotLabels="a">{y}</RobotGroup>
<GroupTask{x} label="go" group="pair">
  <Task{x} robot="a">
    <StartConstraints{x}><CSpaceConstraint{x} point="1 2 3 4">{y}</CSpaceConstraint>{y}</StartConstraints>{y}
    <GoalConstraints{x}><CSpaceConstraint point="1 2 3 4"/></GoalConstraints>
  </Task>{y}
</GroupTask>{y}
</Problem>
<Library><CollisionDetection{x} method="RAPID"/></Library>{y}
</MotionPlanning>"""
ROBOT = """<Robot{x}>
  <MultiBody{x} type="active">
    <Base{x} filename="a.g" type="planar" movement="rotational">{y}</Base>
    <Link{x} index="1" type="joint" filename="a.g">
      <Connection{x} joint="revolute" range="-1:1" parentIndex="0" childIndex="1"
        transformParentToDH="0 0 0 0 0 0" initialDHParams="0 0 0 0" transformDHToChild="0 0 0 0 0 0">{y}</Connection>{y}
    </Link>{y}
  </MultiBody>{y}
</Robot>"""


def test_attributes_and_elements_that_nothing_reads_are_named(tmp_path: Path) -> None:
    """Each element has its own wrong word, which must come back in a diagnostic about it."""

    def text(form: str, used: bool) -> str:
        return form.format(x=' colour="1"' * used, y="<Light/>" * used)

    write(tmp_path, text(ROBOT, True), "a.xml")
    scene = env2mjcf.read(write(tmp_path, text(KNOWN, True), "problem.xml"))
    told = [d.message for d in scene.diagnostics if d.code in ("ENV307", "ENV311")]
    for name in ("problem.xml", "a.xml"):
        root = parse_xml(read_source(tmp_path / name, DiagnosticLog(), Limits()), DiagnosticLog())
        for node in (root, *root.descendants()):
            if node.get("colour") is not None:
                assert f"attribute 'colour' of <{node.tag}> is not used" in told, (name, node.tag)
            if any(node.children("Light")):
                assert f"<Light> of <{node.tag}> is not used" in told, (name, node.tag)
    write(tmp_path, text(ROBOT, False), "a.xml")
    plain = env2mjcf.read(write(tmp_path, text(KNOWN, False), "problem.xml"))
    assert [d for d in plain.diagnostics if d.code in ("ENV307", "ENV311")] == []
    assert plain.tasks[0].robots == (0,)


def test_what_nothing_reads_is_told_once_for_each_kind(tmp_path: Path) -> None:
    body = (
        '<MultiBody type="passive"><Base filename="a.g" colour="1" transform="0 0 0 0 0 0"/><Light/><Lamp/></MultiBody>'
    )
    scene = env2mjcf.read(write(tmp_path, f"<Environment>{body * 300}</Environment>", "a.xml"))
    told = [d.message for d in scene.diagnostics if d.code in ("ENV307", "ENV311")]
    assert sorted(told) == ["<Light>, <Lamp> of <MultiBody> are not used", "attribute 'colour' of <Base> is not used"]


@pytest.mark.parametrize(
    ("attribute", "hint"),
    [
        ('positonRes="1"', "did you mean 'positionRes'?"),
        ('gravty="0 0 -1"', "did you mean 'gravity'?"),
        ('saveDofs="1"', ""),
    ],
)
def test_attributes_of_an_environment_are_kept_and_told(tmp_path: Path, attribute: str, hint: str) -> None:
    scene = env2mjcf.read(write(tmp_path, f"<Environment {attribute}/>", "a.xml"))
    assert [d.hint for d in scene.diagnostics if d.code == "ENV311"] == [hint]
    assert dict(scene.attributes)[attribute.partition("=")[0]]


def test_a_pose_of_what_is_not_fixed_is_told(tmp_path: Path) -> None:
    write(tmp_path, E, "scene.env")
    text = ROBOT.format(x="", y="").replace('movement="rotational"', 'movement="rotational" transform="1 2 3 0 0 0"')
    scene = env2mjcf.read(tmp_path / "scene.env", robots=[write(tmp_path, text, "a.xml")])
    assert [m for _, m in found(scene, "ENV311")] == ["attribute 'transform' of <Base> is not used"]


def test_of_two_boundaries_the_environments_is_used_and_that_is_told(problem: Reader, tmp_path: Path) -> None:
    axes = "".join(f'<parameter Label="{k}" min="-1" max="2"/>' for k in "XYZ")
    text = f"""<MotionPlanning><Problem><Environment filename="scene.env"><boundary type="bbox">{axes}</boundary>
    </Environment></Problem></MotionPlanning>"""
    scene = env2mjcf.read(write(tmp_path, text, "old.xml"))
    assert scene.boundary is not None
    assert scene.boundary.upper == (10, 20, 30)
    assert [m for _, m in found(scene, "ENV307")] == [
        "the boundary of the problem is not used: the environment has its own"
    ]
