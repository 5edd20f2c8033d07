"""A scene says the same in every dialect, or it is said what is lost."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from real_scenes import FEW, RealScene, real_scene, real_scenes, scene_names
from scenes import MODELS
from strategies import environments
from texts import ENV_TEXTS, LEGACY, LEGACY_FIXED, NON_HOLONOMIC, PROBLEM, ROBOT, B, C, D, E, Reader, write

import env2mjcf
from env2mjcf.cli.main import main
from env2mjcf.kinematics.forward import RobotKinematics
from env2mjcf.model.environment import BoundaryShape, Dialect, Environment, JointType, MultiBodyKind
from env2mjcf.simulation.scene import Scene
from env2mjcf.translation import Translation, translate, write_environment

# What changes which pairs are tested, or where the walls are.
PAIRS = {"ENV172", "ENV175"}
WALLS = {"ENV160", "ENV163"}
REFUSED = {"ENV165", "ENV167", "ENV169", "ENV176"}
MODEL_FILES = {
    "alpha": "alpha.env",
    "bug-trap": "bug-trap.env",
    "closed-chain": "closed-chain.env",
    "gantry": "gantry.env",
    "maze": "maze.env",
    "seed": "seed.env",
    "spherical-arm": "spherical-arm.env",
    "two-robots": "two-robots.env",
    "xml-arm": "xml-arm.xml",
}
# One of each kind: trees, loops, serial arms, rigid bodies, planar ones, several robots, spherical joints.
REAL = [
    "Box.box",
    "LTunnel.tunnel",
    "SerialWalls.serial-vizmo",
    "alpha1.6.alpha",
    "old-testBranchs.branchs",
    "old-testSerialInWall.serial",
    "pmpl-2D.2d",
    "pmpl-FixedTree.narrow",
    "pmpl-FreeTreeBranched.branchs",
    "pmpl-MultipleRobot.narrow",
    "pmpl-ReachableVolumes.ClosedChain.chain.tree",
    "ppl-3D.3d+linked",
]


def model(name: str) -> tuple[Path, dict[str, Any]]:
    """Return the file of one of the project's scenes, and what it needs to be read."""
    path = MODELS / name / MODEL_FILES[name]
    robot, query = path.with_suffix(".robot"), path.with_suffix(".query")
    options: dict[str, Any] = {"query": query} if query.exists() else {}
    if path.suffix == ".env" and robot.exists():
        options["robots"] = (robot,)
    return path, options


def possible(scene: Environment) -> dict[Dialect, Translation]:
    """Return the translations that are not refused."""
    found: dict[Dialect, Translation] = {}
    for dialect in Dialect:
        try:
            found[dialect] = translate(scene, dialect)
        except env2mjcf.ConversionError as error:
            if error.code not in REFUSED:
                raise
    return found


def codes(translation: Translation) -> set[str]:
    return {d.code for d in translation.notes}


def assert_same_motion(before: Environment, *hops: Translation, count: int = 50) -> None:
    """Place every link at random joint values, before and after some translations."""
    rng = np.random.default_rng(7)
    for i, robot in enumerate(before.robots):
        kinematics = RobotKinematics.of(robot)
        q = rng.uniform(-3, 3, (count, kinematics.dim))
        expected = kinematics.forward(q)
        for hop in hops:
            q = hop.robots[i].q(q)
        found = RobotKinematics.of(hops[-1].environment.robots[i]).forward(q)
        assert np.abs(found - expected).max() <= 1e-9 * (1 + np.abs(expected).max())


def assert_same_limits(translation: Translation) -> None:
    for robot in translation.robots:
        old = [robot.source.dofs[i] for i in robot.order]
        new = robot.target.dofs
        assert [(d.lower, d.upper) for d in new] == [(d.lower, d.upper) for d in old]


def assert_same_home(translation: Translation) -> None:
    for robot in translation.robots:
        expected = robot.source.forward(robot.source.home())
        found = robot.target.forward(robot.target.home())
        assert np.abs(found - expected).max() <= 1e-9 * (1 + np.abs(expected).max())


def assert_everything_moves_alike(scene: Environment) -> None:
    for there in possible(scene).values():
        assert_same_motion(scene, there)
        if "ENV163" not in codes(there):
            assert_same_limits(there)
        if not codes(there) & {"ENV163", "ENV168"}:
            assert_same_home(there)
        for back in possible(there.environment).values():
            assert_same_motion(scene, there, back, count=5)


@pytest.mark.parametrize("name", MODEL_FILES)
def test_links_of_the_models_move_alike_there_and_back(name: str) -> None:
    path, options = model(name)
    assert_everything_moves_alike(env2mjcf.read(path, **options))


@pytest.mark.parametrize("real", real_scenes(), ids=[r.name for r in real_scenes()])
def test_links_of_real_scenes_move_alike_there_and_back(real: RealScene) -> None:
    assert_everything_moves_alike(env2mjcf.read(real.env, **real.keywords))


@pytest.mark.parametrize("text", ENV_TEXTS.values(), ids=ENV_TEXTS)
def test_links_of_every_kind_move_alike_there_and_back(read: Reader, text: str) -> None:
    assert_everything_moves_alike(read(text))


@settings(max_examples=60, deadline=None)
@given(scene=environments())
def test_links_of_any_robot_move_alike(scene: Environment) -> None:
    assert_everything_moves_alike(scene)


@settings(max_examples=60, deadline=None)
@given(scene=environments())
def test_a_translation_is_written_as_it_is(tmp_path_factory: pytest.TempPathFactory, scene: Environment) -> None:
    for dialect, there in possible(scene).items():
        folder = tmp_path_factory.mktemp("scene")
        written = write_environment(there.environment, folder / "scene.env")
        again = env2mjcf.read(written.environment, robots=written.robots)
        assert again.dialect is dialect
        files = [m.robot_file for m in there.environment.multibodies]
        assert _without_files(again) == _without_files(there.environment)
        assert files.count(None) == again.declared_multibodies


def _without_files(scene: Environment) -> Environment:
    placed = tuple(
        replace(m, robot_file=None, bodies=tuple(replace(b, filename=Path(b.filename).name) for b in m.bodies))
        for m in scene.multibodies
    )
    return replace(scene, multibodies=placed)


# Verdicts, by MuJoCo's poses and the exact engine, on the files that were written.


def loaded(there: Translation, folder: Path) -> Scene:
    written = write_environment(there.environment, folder / f"{there.environment.dialect}.env")
    return env2mjcf.load(
        written.environment, robots=written.robots, query=written.query, dialect=there.environment.dialect.value,
        mesh_dirs=written.mesh_dirs,
    )  # fmt: skip


def indices(scene: Scene) -> set[tuple[int, int]]:
    """Return the tested pairs by the places of their links and obstacles, robots first."""
    names = {n: i for i, n in enumerate((*scene.link_names, *scene.obstacle_names))}
    return {(names[a], names[b]) for a, b in scene.pairs}


def assert_same_verdicts(path: Path, options: dict[str, Any], folder: Path) -> None:
    scene = env2mjcf.load(path, **options)
    q = scene.space.sample(200, seed=3)
    # Near obstacles, not all over a wide boundary.
    starts = np.concatenate([scene.space.home[None], *(query.q for query in scene.queries)])
    q[100:] = starts[np.arange(100) % len(starts)] + (q[100:] - q[100:].mean(axis=0)) * 0.02
    checked = 0
    for dialect, there in possible(scene.environment).items():
        if dialect is scene.environment.dialect:
            continue
        new = loaded(there, folder)
        mapped = np.concatenate(
            [
                np.zeros((len(q), 0)),
                *(r.q(q[:, s]) for r, s in zip(there.robots, scene.space.robot_slices, strict=True)),
            ],
            axis=1,
        )
        assert np.abs(new.link_poses(mapped) - scene.link_poses(q)).max() <= 1e-9 * (1 + scene.extent)
        found = codes(there)
        if not found & PAIRS:
            assert indices(new) == indices(scene)
            assert np.array_equal(new.in_collision(mapped), scene.in_collision(q))
        if not found & (PAIRS | WALLS):
            assert np.array_equal(new.is_valid(mapped), scene.is_valid(q))
        for old_query, new_query in zip(scene.queries, new.queries, strict=True):
            assert np.array_equal(new.in_collision(new_query.q), scene.in_collision(old_query.q)) or found & PAIRS
        checked += 1
    assert checked


@pytest.mark.slow_but("seed", "xml-arm", "two-robots", "closed-chain")
@pytest.mark.parametrize("name", MODEL_FILES)
def test_verdicts_on_the_models_stay(name: str, tmp_path: Path) -> None:
    path, options = model(name)
    assert_same_verdicts(path, options, tmp_path)


@pytest.mark.slow_but(*FEW)
@pytest.mark.parametrize("name", [n for n in REAL if n in scene_names()] or ["corpus"])
def test_verdicts_on_real_scenes_stay(corpus: Path, name: str, tmp_path: Path) -> None:
    real = real_scene(name)
    query = {"query": real.query} if real.query else {}
    assert_same_verdicts(real.env, {**real.keywords, **query}, tmp_path)


# The joints, by hand.


def test_craig_and_standard_place_a_link_where_the_formula_says(read: Reader) -> None:
    # Rx(90) Tx(2) Rz(theta) Tz(3) at theta = 90: the child's origin lies at (2, -3, 0), its x axis along z.
    text = B.replace(
        "1 2 3 90 0 0  0.1 0.2 0.3 0.4  4 5 6 0 90 0", "0 0 0 0 0 0  1.5707963267948966 2 3 0  0 0 0 0 0 0"
    )
    there = translate(read(text), "E")
    assert there.environment.robots[0].connections[0].dh.alpha == 0
    q = np.array([0, 0, 0, 0, 0, 0, math.pi / 2, 0, 0])
    pose = there.robots[0].target.forward(there.robots[0].q(q))[1]
    assert pose[:3, 3] == pytest.approx([2, -3, 0])
    assert pose[:3, 0] == pytest.approx([0, 0, 1])


def test_a_spherical_joint_changes_the_places_of_its_angles_between_the_forms(read: Reader) -> None:
    there = translate(read(C), "E")
    before, after = C.partition("Spherical ")[2].split()[:2], there.environment.robots[0].connections[1]
    assert before == ["-1:1", "-0.1:0.2"]
    assert [x.lower / math.pi for x in after.limits] == pytest.approx([-0.1, -1])
    assert there.robots[0].order == (0, 1, 2, 3, 5, 4)


def test_turns_become_fractions_of_pi_within_limits(tmp_path: Path) -> None:
    query = write(tmp_path, "0 0 0 0.75 0 0 0.875 7\n1 2 3 0.5 0 0 0.125 0.25\n", "scene.query")
    scene = env2mjcf.read(write(tmp_path, LEGACY, "scene.env"), query=query)
    found = translate(scene, "C").environment.tasks[0].configurations
    assert found == ((0, 0, 0, -0.5, 0, 0, -0.25, 7), (1, 2, 3, -1, 0, 0, 0.25, 0.25))
    assert translate(scene, "A").environment.tasks == scene.tasks


def test_joints_are_listed_as_the_dialect_sorts_them(tmp_path: Path) -> None:
    robot = write(tmp_path, ROBOT, "rob.robot")
    query = write(tmp_path, "0 0 0.1 0.2 0.3\n1 1 0.1 0.2 0.3\n", "scene.query")
    scene = env2mjcf.read(write(tmp_path, E, "scene.env"), robots=[robot], query=query)
    # E sorts by (parent, child); D keeps the file's order, in which the hinge comes first.
    assert translate(scene, "D").environment.tasks[0].configurations[0] == (0, 0, 0.3, 0.2, 0.1)


def test_robots_of_two_dialects_become_robots_of_one(tmp_path: Path) -> None:
    robot = write(tmp_path, ROBOT, "rob.robot")
    scene = env2mjcf.read(write(tmp_path, D, "scene.env"), robots=[robot])
    assert [r.dialect for r in scene.robots] == ["D", "D", "E"]
    assert_everything_moves_alike(scene)
    found = translate(scene, "D").environment
    assert [(r.dialect, r.robot_file) for r in found.robots] == [("D", None)] * 3
    apart = translate(scene, "E").environment
    assert [r.robot_file for r in apart.robots] == ["scene-0.robot", "scene-1.robot", str(robot)]


def test_a_robot_of_two_free_bodies_is_none_for_the_newest_planner(read: Reader) -> None:
    text = D.replace(
        "1\nball.g Volumetric Translational", "2\nball.g Volumetric Translational\nball.g Planar Rotational"
    )
    assert "ENV176" in codes(translate(read(text), "E"))
    assert "ENV176" not in codes(translate(read(text), "D"))


def test_the_page_s_reading_becomes_the_planner_s(read: Reader) -> None:
    scene = read(LEGACY, semantics="page")
    there = translate(scene, "A")
    assert there.environment.semantics == "planner"
    assert_same_motion(scene, there)


# What a dialect lacks.


@pytest.mark.parametrize(
    ("text", "dialect", "expected"),
    [
        (LEGACY, "D", {"ENV161", "ENV164", "ENV166", "ENV168"}),
        (LEGACY_FIXED, "B", {"ENV164"}),
        (B, "C", {"ENV161"}),
        (C, "B", {"ENV160", "ENV163"}),
        (C, "D", set()),
        (C, "E", set()),
        (D.replace("-a(None) ", ""), "C", {"ENV162", "ENV170", "ENV172"}),
        (D, "E", {"ENV170", "ENV174"}),
        (NON_HOLONOMIC, "B", {"ENV160", "ENV162", "ENV170", "ENV173"}),
        (NON_HOLONOMIC, "E", {"ENV170", "ENV173"}),
        (E, "C", {"ENV162"}),
    ],
)
def test_what_is_lost_is_said_and_is_an_error_in_strict_mode(
    read: Reader, text: str, dialect: str, expected: set[str]
) -> None:
    scene = read(text)
    assert codes(translate(scene, dialect)) == expected
    if expected:
        with pytest.raises(env2mjcf.ConversionError) as caught:
            translate(scene, dialect, strict=True)
        assert caught.value.code in expected
    else:
        translate(scene, dialect, strict=True)


@pytest.mark.parametrize(
    ("text", "dialect", "code"),
    [
        (B, "A", "ENV165"),
        (C, "A", "ENV167"),
        (D, "C", "ENV169"),
        (E, "A", "ENV176"),
        (D.replace("NonActuated", "SMAJoint -1:1").replace("0.5 0.6 0.7 0.8", "0.5 0.6 0.7 0.8 1 2"), "E", "ENV165"),
    ],
)
def test_what_would_move_links_is_refused(read: Reader, text: str, dialect: str, code: str) -> None:
    with pytest.raises(env2mjcf.ConversionError) as caught:
        translate(read(text), dialect)
    assert caught.value.code == code
    assert caught.value.diagnostic.hint


def test_a_loss_says_where_it_stands(read: Reader) -> None:
    lines = C.splitlines()
    found = [(d.code, d.span and lines[d.span.line - 1]) for d in translate(read(C), "B").notes]
    assert found == [
        ("ENV163", "0 1 Revolute -0.5:0.25"),
        ("ENV163", "1 2 Spherical -1:1 -0.1:0.2"),
        ("ENV160", "Boundary Box -10:10 -20:20 -30:30"),
    ]


def test_the_robot_is_the_first_multibody_in_dialect_a(read: Reader) -> None:
    text = "2\nPassive\nwall.g 0 2 0 0 0 90\nActive\n1\nball.g Volumetric Rotational\nConnections\n0\n"
    found = translate(read(text), "A").environment.multibodies
    assert [m.kind for m in found] == [MultiBodyKind.ACTIVE, MultiBodyKind.PASSIVE]
    # The planner reads a pose behind the first FreeBody.
    assert found[0].bodies[0].pose is not None


def test_a_robot_without_its_tag_gets_it(read: Reader) -> None:
    scene = read(LEGACY.replace("Active", "Passive"))
    assert [m.kind for m in translate(scene, "B").environment.multibodies] == ["Active", "Passive"]


def test_obstacles_of_many_bodies_become_many(read: Reader) -> None:
    text = LEGACY.replace(
        "1\nFixedBody 0 wall.g 0 2 0 0 0 90", "2\nFixedBody 0 a.g 0 2 0 0 0 90\nFixedBody 1 b.g 1 2 3 4 5 6"
    )
    found = translate(read(text), "B").environment.obstacles
    assert [(m.bodies[0].filename, len(m.bodies)) for m in found] == [("a.g", 1), ("b.g", 1)]


def test_flat_boundaries_are_named_as_each_dialect_names_them(read: Reader) -> None:
    scene = read(D.replace("Boundary Box [-10:10 ; -20:20 ; -30:30]", "Boundary Box2D [-10:10 ; -20:20]"))
    for dialect, shape in (("D", BoundaryShape.BOX2D), ("E", BoundaryShape.BOX2D)):
        found = translate(scene, dialect).environment.boundary
        assert found is not None
        assert found.shape is shape
    flat = translate(read(C.replace(" -30:30", "")), "D").environment.boundary
    assert flat is not None
    assert (flat.shape, flat.lower) == (BoundaryShape.BOX2D, (-10, -20))
    plain = translate(
        read(E.replace("Box [-10:10 ; -20:20 ; -30:30]", "Box2D [-1:1 ; -2:2]")), "C"
    ).environment.boundary
    assert plain is not None
    assert (plain.shape, plain.upper) == (BoundaryShape.BOX, (1, 2))


def test_what_only_xml_says_is_lost_with_a_note(tmp_path: Path) -> None:
    write(tmp_path, E, "scene.env")
    write(tmp_path, ROBOT, "rob.robot")
    rules = PROBLEM.replace('ignoreSelfCollision="false"', 'ignoreSelfCollision="true"')
    scene = env2mjcf.read(write(tmp_path, rules, "problem.xml"))
    there = translate(scene, "D")
    lost = [d.message for d in there.notes if d.code == "ENV177"]
    assert len(lost) == 2
    assert there.environment.tasks[0].configurations == ((1, 2, 0.3, 0.2, 0.1), (3, 4, 0.6, 0.5, 0.4))


# The program.


def test_the_program_writes_a_scene_that_loads(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    seed = MODELS / "seed" / "seed.env"
    words = ["translate", seed, "-o", tmp_path / "new.env", "--dialect", "E", "--query", seed.with_suffix(".query")]
    assert main([*map(str, words), "--box", "-9", "9", "-9", "9", "-9", "9"]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[0].endswith("new.env: dialect E, 1 robot, 2 obstacles")
    assert "ENV164" in err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["new.env", "new.query", "new.robot"]
    options = {"robots": tmp_path / "new.robot", "query": tmp_path / "new.query", "mesh_dirs": seed.parent}
    scene = env2mjcf.load(tmp_path / "new.env", **options)
    old = env2mjcf.load(seed, query=seed.with_suffix(".query"))
    assert np.allclose(scene.link_poses(scene.queries[0].q), old.link_poses(old.queries[0].q), atol=1e-12)
    assert scene.environment.boundary is not None
    assert scene.environment.boundary.lower == (-9, -9, -9)


def test_the_program_replaces_no_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path, LEGACY, "scene.env")
    assert main(["translate", str(path), "-o", str(path), "--dialect", "D"]) == 3
    assert path.read_text() == LEGACY
    err = capsys.readouterr().err
    assert "error ENV179: " in err
    assert "scene.env is an input; expected a file to write" in err


def test_the_program_says_what_is_refused_and_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = str(write(tmp_path, C, "scene.env")), str(tmp_path / "new.env")
    assert main(["translate", path, "-o", out, "--dialect", "A"]) == 3
    assert "ENV167" in capsys.readouterr().err
    assert main(["translate", path, "-o", out, "--dialect", "B", "--strict"]) == 3
    assert main(["translate", path, "-o", str(tmp_path / "new"), "--dialect", "D"]) == 2
    assert main(["translate", path, "-o", out, "--dialect", "D", "--box", "1", "0", "0", "1", "0", "1"]) == 2
    assert main(["translate", path, "-o", str(tmp_path / "scene.env" / "new.env"), "--dialect", "D"]) == 3
    assert "ENV179" in capsys.readouterr().err
    assert [p.name for p in tmp_path.iterdir()] == ["scene.env"]


def test_the_program_makes_the_folder_or_leaves_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    seed, made = MODELS / "seed/seed.env", tmp_path / "new" / "er" / "a.env"
    assert main(["translate", str(seed), "-o", str(made), "--dialect", "A"]) == 0
    assert np.array_equal(env2mjcf.load(made, allow_outside=True).space.home, env2mjcf.load(seed).space.home)
    text = seed.read_text().replace("cube.g", "odd.g")
    path = write(tmp_path / "new", text, "scene.env")
    (tmp_path / "a folder").mkdir()
    (tmp_path / "a folder" / "odd.g").write_text((seed.parent / "cube.g").read_text())
    capsys.readouterr()
    # A mesh that cannot be named from there, which comes out after the folder is made.
    words = ["translate", str(path), "-o", str(tmp_path / "x" / "y" / "a.env"), "--dialect", "A"]
    assert main([*words, "--mesh-dirs", str(tmp_path / "a folder")]) == 3
    assert "ENV178" in capsys.readouterr().err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a folder", "new"]


def test_what_moves_together_is_lost_in_text_and_told(tmp_path: Path) -> None:
    write(tmp_path, "1\nb.g Planar Translational\nConnections\n0\n", "a.robot")
    write(tmp_path, E, "scene.env")
    tasks = "".join(
        f"""<Task robot="{name}"><StartConstraints><CSpaceConstraint point="{x} 0"/></StartConstraints>
        <GoalConstraints><CSpaceConstraint point="{x} 9"/></GoalConstraints></Task>"""
        for name, x in (("a", 1), ("b", 2))
    )
    problem = f"""<Problem><Environment filename="scene.env"/>
    <Robot label="a" filename="a.robot"/><Robot label="b" filename="a.robot"/>
    <RobotGroup label="g" robotLabels="a b"/><GroupTask label="t" group="g">{tasks}</GroupTask></Problem>"""
    scene = env2mjcf.read(write(tmp_path, problem, "problem.xml"))
    assert scene.tasks[0].robots == (0, 1)
    result = translate(scene, "D")
    assert "query files do not say that robots 0, 1 move together" in str(result.notes)
    expected = [((0,), ((1, 0), (1, 9))), ((1,), ((2, 0), (2, 9)))]
    assert [(t.robots, t.configurations) for t in result.environment.tasks] == expected
    written = write_environment(result.environment, tmp_path / "out" / "d.env")
    again = env2mjcf.read(written.environment, query=written.query)
    assert [(t.robots, t.configurations) for t in again.tasks] == expected
    # Written in its own dialect, without `translate`, too.
    own = write_environment(scene, tmp_path / "own" / "e.env")
    again = env2mjcf.read(own.environment, robots=own.robots, query=own.query)
    assert [(t.robots, t.configurations) for t in again.tasks] == expected


def test_joint_types_are_those_of_the_file(read: Reader) -> None:
    joints = [c.joint for c in translate(read(LEGACY), "D").environment.robots[0].connections]
    assert joints == [JointType.REVOLUTE, JointType.PRISMATIC]
