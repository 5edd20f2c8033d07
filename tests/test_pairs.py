"""Which pairs are tested: the planner's rules, and that MuJoCo tests exactly those."""

from __future__ import annotations

from pathlib import Path

import pytest
from scenes import MODELS, box_mesh, free_cube, write_scene

import env2mjcf

ARM = """Boundary Box [-10:10 ; -10:10 ; -10:10]
Multibodies
2
Active
4
base.g Fixed 0 0 0 0 0 0
a.g Joint
b.g Joint
c.g Joint
{extra}Connections
3
0 1 Revolute -1:1
0 0 0 0 0 0  0 0 0 0  0 0 0 0 0 0
1 2 {second}
0 0 0 0 0 0  0 0 0 0  0 0 0 0 0 0
2 3 Revolute -1:1
0 0 0 0 0 0  0 0 0 0  0 0 0 0 0 0
Passive
cube.g {pose}
"""


def arm(folder: Path, *, second: str = "Revolute -1:1", extra: str = "", pose: str = "0 0 0 0 0 0") -> Path:
    """An arm of four boxes that all overlap, and a cube."""
    text = ARM.format(second=second, extra=extra, pose=pose)
    return write_scene(folder, text, **{n: box_mesh(0.4, 0.4, 0.4) for n in ("base", "a", "b", "c")})


def pairs(scene: env2mjcf.Scene) -> set[frozenset[str]]:
    return {frozenset(p) for p in scene.pairs}


def touching(scene: env2mjcf.Scene) -> set[frozenset[str]]:
    return {frozenset((c.link, c.other)) for c in scene.contacts(scene.space.home)}


def named(*names: str) -> set[frozenset[str]]:
    return {frozenset(n.split("-")) for n in names}


OBSTACLE = named("base-cube", "a-cube", "b-cube", "c-cube")
SELF = named("base-b", "base-c", "a-c")


@pytest.mark.parametrize("collision", ["hull", "surface", "auto"])
def test_connected_links_are_not_tested_and_all_else_is(tmp_path: Path, collision: str) -> None:
    # Surfaces of equal boxes coincide, so that every tested pair touches.
    scene = env2mjcf.load(arm(tmp_path), collision=collision)
    assert pairs(scene) == OBSTACLE | SELF
    if collision != "surface":
        assert touching(scene) == pairs(scene)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"adjacent_links": 0}, OBSTACLE | SELF | named("base-a", "a-b", "b-c")),
        ({"adjacent_links": 2}, OBSTACLE | named("base-c")),
        ({"adjacent_links": 3}, OBSTACLE),
        ({"self_collision": False}, OBSTACLE),
        ({"exclude_pairs": [("cube", "b"), ("a", "c")]}, (OBSTACLE | SELF) - named("b-cube", "a-c")),
        ({"exclude_rest_contacts": True}, set()),
    ],
)
def test_options_change_the_pairs(tmp_path: Path, options: dict, expected: set[frozenset[str]]) -> None:
    scene = env2mjcf.load(arm(tmp_path), collision="hull", **options)
    assert pairs(scene) == expected
    assert touching(scene) == expected


def test_adjacencies_count_as_connections(tmp_path: Path) -> None:
    scene = env2mjcf.load(arm(tmp_path, extra="Adjacencies\n1\n0 3\n"), collision="hull")
    # 0-3 is given, and brings no other pair within one step.
    assert pairs(scene) == OBSTACLE | named("base-b", "a-c")
    assert touching(scene) == pairs(scene)


def test_a_weld_does_not_hide_a_pair(tmp_path: Path) -> None:
    """MuJoCo's own filters skip bodies of one weld group and the parents of it; the planner tests them."""
    scene = env2mjcf.load(arm(tmp_path, second="NonActuated"), collision="hull")
    assert pairs(scene) == OBSTACLE | SELF
    assert touching(scene) == pairs(scene)


def test_mujoco_is_told_of_pairs_that_move_alone(tmp_path: Path) -> None:
    """Bodies that are welded to each other MuJoCo never tests, so that nothing need be said of them."""
    scene = env2mjcf.load(arm(tmp_path, second="NonActuated"), collision="hull")
    assert {frozenset((p.link, p.other)) for p in scene.compiled.pairs.excluded} == named("base-a", "b-c")
    assert scene.model.nexclude == 2


def test_welded_links_two_steps_apart_are_a_constant_pair(tmp_path: Path) -> None:
    text = ARM.replace("2 3 Revolute -1:1", "2 3 NonActuated").format(
        second="NonActuated", extra="", pose="5 0 0 0 0 0"
    )
    scene = env2mjcf.load(
        write_scene(tmp_path, text, **{n: box_mesh(0.4, 0.4, 0.4) for n in ("base", "a", "b", "c")}), collision="hull"
    )
    assert frozenset(("a", "c")) in touching(scene)
    assert scene.in_collision([1.0]) is True


def test_a_static_base_in_an_obstacle_colours_every_verdict(tmp_path: Path) -> None:
    inside = env2mjcf.load(arm(tmp_path, pose="0.7 0 0 0 0 0"), collision="hull", adjacent_links=3)
    assert inside.in_collision([0.0, 0.0, 0.0])
    contacts = [c for c in inside.contacts([0, 0, 0]) if c.link == "base"]
    assert {c.other for c in contacts} == {"cube"}
    assert contacts[0].distance == pytest.approx(-0.2, abs=1e-6)
    assert contacts[0].normal == pytest.approx([1, 0, 0], abs=1e-6)
    assert inside.model.npair == 1
    outside = env2mjcf.load(arm(tmp_path / "b", pose="0.95 0 0 0 0 0"), collision="hull", adjacent_links=3)
    assert not outside.in_collision([0.0, 0.0, 0.0])


def test_dialect_a_does_not_test_its_fixed_base(tmp_path: Path) -> None:
    text = """2
MultiBody Active
2
FixedBody 0 cube.g 0 0 0 0 0 0
FreeBody 1 cube.g
Connection
1
0 1 Actuated
0 0 0 0 0 0  0 3 0 0  Revolute  0 0 0 0 0 0
MultiBody Passive
1
FixedBody 0 cube.g 0.2 0 0 0 0 0
Connection
0
"""
    scene = env2mjcf.load(write_scene(tmp_path, text))
    assert scene.pairs == (("cube_2", "cube_3"),)
    assert not scene.in_collision([0.0])


def test_robots_are_tested_against_each_other_unless_told_not_to() -> None:
    path = MODELS / "two-robots/two-robots.env"
    both, apart = env2mjcf.load(path), env2mjcf.load(path, inter_robot=False)
    between = {p for p in both.pairs if {n.split("/")[0] for n in p} == {"robot0", "robot1"}}
    assert between
    assert set(both.pairs) - set(apart.pairs) == between


def test_composite_robots_are_tested_within(tmp_path: Path) -> None:
    robot = "2\ncube.g Volumetric Rotational\ncube.g Volumetric Rotational\nConnections\n0\n"
    scene = env2mjcf.load(write_scene(tmp_path, free_cube(robot=robot)))
    assert scene.pairs == (("cube", "cube_2"),)
    assert scene.space.dim == 12
    assert scene.in_collision([0] * 12)
    assert not scene.in_collision([0] * 6 + [1.1, 0, 0, 0, 0, 0])


def test_obstacles_and_surfaces_do_not_collide(tmp_path: Path) -> None:
    text = free_cube("5 0 0 0 0 0", "5 0 0 0 0 0") + "\nSurface FLOOR\ncube.g 0 0 0 0 0 0\n"
    text = text.replace("Multibodies\n3", "Multibodies\n4")
    scene = env2mjcf.load(write_scene(tmp_path, text))
    assert scene.pairs == (("cube", "cube_2"), ("cube", "cube_3"))
    assert not scene.in_collision([0] * 6)
    assert scene.obstacle_names == ("cube_2", "cube_3")


def test_an_unknown_name_is_answered_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"'cubee'; did you mean 'cube'\?.*base, a, b, c, cube"):
        env2mjcf.load(arm(tmp_path), exclude_pairs=[("a", "cubee")])


def test_a_problem_file_decides_about_adjacent_links(tmp_path: Path) -> None:
    arm(tmp_path, pose="5 0 0 0 0 0")
    problem = tmp_path / "problem.xml"
    problem.write_text(
        '<MotionPlanning><Problem><Environment filename="scene.env"/></Problem>'
        '<Library><ValidityCheckers><CollisionDetection label="c" ignoreAdjacentLinks="false"/></ValidityCheckers>'
        "</Library></MotionPlanning>"
    )
    assert named("base-a") <= pairs(env2mjcf.load(problem, collision="hull"))
    problem.write_text(problem.read_text().replace('Links="false"', 'Links="false" ignoreSelfCollision="true"'))
    assert pairs(env2mjcf.load(problem, collision="hull")) == OBSTACLE
