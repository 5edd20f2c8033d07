"""What is written reads as what was written: read(write(environment)) == environment."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from random import Random

import pytest
from conftest import CORPUS
from hypothesis import given, settings
from hypothesis import strategies as st
from real_scenes import RealScene, real_scenes
from scenes import MODELS
from strategies import environments, laid_out, rich_environments
from texts import ENV_TEXTS, LEGACY, ROBOT, XML_ENVIRONMENT, XML_ROBOT, B, D, E, Reader, warnings, write

import env2mjcf
from env2mjcf.formats.writers import decimal, env_text, robot_text, settled
from env2mjcf.model.environment import Environment, PlannerRules

TEXTS = sorted((CORPUS / "texts").glob("*.env")) if CORPUS else []
OWN = sorted(MODELS.glob("*/*.env"))
DEGREE = math.pi / 180


def written_and_read(scene: Environment, folder: Path, layout: Callable[[str], str] = str) -> Environment:
    """Write a scene and its robots, and read them."""
    env = write(folder, layout(env_text(scene)), f"{scene.name}.env")
    robots = [
        write(folder, layout(robot_text(m)), f"{i}.robot")
        for i, m in enumerate(m for m in scene.multibodies if m.robot_file)
    ]
    # Words such as Active are missing where a scene has no robot: then the text does not tell its dialect.
    return env2mjcf.read(env, robots=robots, dialect=scene.dialect.value, semantics=scene.semantics)


def kept(scene: Environment) -> Environment:
    """Return a scene without the few things that its text cannot keep."""
    return dataclasses.replace(
        scene,
        # Wrong counts are put right: the original readers fail on them, or leave out what stands behind.
        declared_multibodies=sum(m.robot_file is None for m in scene.multibodies),
        # A query is another file.
        tasks=(),
        # Only XML says these.
        attributes=(),
        planner_rules=PlannerRules(),
        multibodies=tuple(
            # A robot's file has the name that it is given, and a robot's label and actuators stand in XML.
            dataclasses.replace(m, robot_file=None, actuators=(), label=None if m.moves else m.label)
            for m in scene.multibodies
        ),
    )


def assert_kept(scene: Environment, folder: Path) -> None:
    assert kept(written_and_read(scene, folder)) == kept(scene)


@pytest.mark.parametrize("text", ENV_TEXTS.values(), ids=ENV_TEXTS)
def test_a_scene_of_every_dialect_is_kept(read: Reader, tmp_path: Path, text: str) -> None:
    scene = read(text)
    again = written_and_read(scene, tmp_path)
    assert again == scene
    assert not warnings(again)
    assert env2mjcf.read(tmp_path / "scene.env").dialect == scene.dialect
    assert env_text(again) == env_text(scene)


@pytest.mark.parametrize("path", OWN, ids=lambda p: p.stem)
def test_every_model_is_kept(path: Path, tmp_path: Path) -> None:
    robot = path.with_suffix(".robot")
    assert_kept(env2mjcf.read(path, robots=[robot] if robot.exists() else []), tmp_path)


@pytest.mark.parametrize("real", real_scenes(), ids=[r.name for r in real_scenes()])
def test_every_real_scene_is_kept(real: RealScene, tmp_path: Path) -> None:
    assert_kept(env2mjcf.read(real.env, **real.keywords), tmp_path)


@pytest.mark.parametrize("path", TEXTS, ids=[p.stem for p in TEXTS])
def test_every_real_text_is_kept(path: Path, tmp_path: Path) -> None:
    assert_kept(env2mjcf.read(path), tmp_path)


@pytest.mark.parametrize("robot", [ROBOT, XML_ROBOT.replace(' mass="3"', "")], ids=["text", "XML"])
@pytest.mark.parametrize("environment", [E, D, XML_ENVIRONMENT], ids=["E", "D", "XML"])
def test_robots_of_files_of_their_own_are_kept(environment: str, robot: str, tmp_path: Path) -> None:
    file = write(tmp_path, robot, "rob.robot")
    assert_kept(env2mjcf.read(write(tmp_path, environment, "source.env"), robots=[file]), tmp_path)


def test_the_reading_of_the_page_is_kept(read: Reader, tmp_path: Path) -> None:
    scene = read(LEGACY, semantics="page")
    assert written_and_read(scene, tmp_path) == scene


def test_joints_without_limits_get_a_whole_turn_where_the_dialect_demands_limits(read: Reader, tmp_path: Path) -> None:
    scene = read(D.replace("Revolute -0.5:0.25", "Revolute"))
    limits = written_and_read(scene, tmp_path).robots[0].connections[0].limits
    assert [(x.lower, x.upper) for x in limits] == [(-math.pi, math.pi)]


def test_comments_come_back_at_the_top(read: Reader) -> None:
    scene = read(LEGACY.replace("Connection\n2", "# two joints\nConnection\n2"))
    lines = env_text(scene).splitlines()
    assert lines[:3] == ["#Environment Version 20020327", "# two joints", "2"]
    # A directive stays in front of the body that it is for.
    assert lines[lines.index("#VIZMO_COLOR 0.5 0.25 1") + 1].startswith("FreeBody 0 cube.g")


def test_no_header_line_stops_the_reader_of_dialect_a(read: Reader) -> None:
    text = env_text(read("# my Environment\n" + LEGACY.partition("\n")[2]))
    assert text.startswith("# my environment\n")


def test_header_lines_fit_what_dialect_a_reads(read: Reader) -> None:
    scene = read("# " + "long " * 100 + "\n" + LEGACY.partition("\n")[2].replace("Passive", "Internal"))
    lines = env_text(scene).splitlines()
    header = lines[: lines.index("2")]
    assert all(len(line) <= 240 and line[0] == "#" for line in header)
    assert "".join(line.removeprefix("#") for line in header[:-1]).split() == ["long"] * 100
    # Its planner knows Internal since this version.
    assert header[-1] == "#Environment Version 20020327"


def test_text_is_what_the_original_readers_take(read: Reader) -> None:
    legacy, b, d = (env_text(read(t)) for t in (LEGACY, B, D))
    assert "0 1 Actuated\n0.2 0 0 -90 0 0  90 0.3 0.4 30  Revolute  0.5 0 0 0 0 45\n" in legacy
    assert "0 1 Revolute\n1 2 3 90 0 0  0.1 0.2 0.3 0.4  4 5 6 0 90 0\n" in b
    # Brackets are words of their own, limits are one word, and the tag is in the plural.
    assert "Boundary Box [ -10:10 ; -20:20 ; -30:30 ]\nPositionRes 0.05\nOrientation 0.1\n" in d
    assert "Connections\n2\n0 1 Revolute -0.5:0.25\n" in d
    assert all(t.endswith("0\n") for t in (legacy, b, d))


@given(st.floats(-1e6, 1e6), st.sampled_from([1.0, DEGREE, math.pi, 2 * math.pi]))
def test_what_was_read_is_written_so_that_it_reads_the_same(number: float, unit: float) -> None:
    value = number * unit
    assert float(decimal(value, unit)) * unit == value


@given(st.floats(-10, 10))
def test_other_angles_are_one_unit_of_the_last_place_off_at_most(angle: float) -> None:
    assert abs(settled(angle, DEGREE) - angle) <= math.ulp(angle)


def test_round_numbers_stay_round() -> None:
    assert [decimal(math.pi / 2, DEGREE), decimal(math.pi, math.pi), decimal(0.1), decimal(3.0)] == [
        "90",
        "1",
        "0.1",
        "3",
    ]
    assert decimal(1e-300 * DEGREE, DEGREE) == "1e-300"


@settings(max_examples=150, deadline=None)
@given(scene=environments())
def test_any_environment_is_kept(tmp_path_factory: pytest.TempPathFactory, scene: Environment) -> None:
    assert_kept(scene, tmp_path_factory.mktemp("scene"))


@settings(max_examples=150, deadline=None)
@given(scene=rich_environments())
def test_any_environment_with_all_that_its_dialect_has_is_kept(
    tmp_path_factory: pytest.TempPathFactory, scene: Environment
) -> None:
    assert_kept(scene, tmp_path_factory.mktemp("scene"))


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(scene=rich_environments(), random=st.randoms(use_true_random=False))
def test_blanks_comments_and_the_spelling_of_numbers_change_nothing(
    tmp_path_factory: pytest.TempPathFactory, scene: Environment, random: Random
) -> None:
    again = written_and_read(scene, tmp_path_factory.mktemp("scene"), lambda text: laid_out(text, random))
    assert kept(again) == kept(scene)
