"""Options are valid however they are built, and what is given overrules what a problem XML says."""

from __future__ import annotations

import dataclasses
import typing
from pathlib import Path
from typing import Any

import pytest
from scenes import free_cube, write_scene

import env2mjcf
from env2mjcf import Options
from env2mjcf.cli.main import main
from env2mjcf.errors import Severity
from env2mjcf.options import OptionKeywords

WRONG: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"collision": "nonsense"}, ValueError, "'nonsense' is not one of 'auto', 'hull'"),
    ({"collision": ["auto"]}, ValueError, "is not one of"),
    ({"dialect": "F"}, ValueError, "is not one of None, 'A'"),
    ({"engine": None}, ValueError, "is not one of 'auto'"),
    ({"scale": -1}, ValueError, "scale is -1; expected a positive number"),
    ({"scale": float("nan")}, ValueError, "scale is nan; expected a positive number"),
    ({"query": 3}, TypeError, "query=3; expected a path"),
    ({"robots": [None]}, TypeError, "robots holds None; expected paths"),
    ({"robots": b"a.robot"}, TypeError, "expected paths"),
    ({"mesh_dirs": [["meshes"]]}, TypeError, "expected paths"),
    ({"density": True}, TypeError, "density is True; expected a number"),
    ({"gravity": 3}, TypeError, "gravity=3; expected a sequence"),
    ({"gravity": (0, 0)}, ValueError, "gravity must be three finite numbers"),
    ({"gravity": "123"}, ValueError, "gravity must be three finite numbers"),
    ({"gravity": (0, 0, 10**400)}, ValueError, "gravity must be three finite numbers"),
    ({"gravity": (0, 0, float("inf"))}, ValueError, "gravity must be three finite numbers"),
    ({"adjacent_links": -1}, ValueError, "adjacent_links is -1; expected at least 0"),
    ({"adjacent_links": 1.0}, TypeError, "adjacent_links is 1.0; expected a whole number"),
    ({"self_collision": 1}, TypeError, "self_collision=1; expected True or False"),
    ({"strict": None}, TypeError, "strict=None; expected True or False"),
    ({"exclude_pairs": ["ab"]}, ValueError, "exclude_pairs holds 'ab'"),
    ({"exclude_pairs": [3]}, ValueError, "exclude_pairs holds 3"),
    ({"limits": 3}, TypeError, r"limits=3; expected Limits\(...\)"),
]


@pytest.mark.parametrize(("values", "error", "message"), WRONG)
def test_a_wrong_value_is_refused_however_options_are_built(
    values: dict[str, Any], error: type[Exception], message: str
) -> None:
    for build in (
        lambda: Options(**values),
        lambda: Options.from_keywords(values),
        lambda: dataclasses.replace(Options(), **values),
        lambda: env2mjcf.read("nothing.env", **values),
    ):
        with pytest.raises(error, match=message):
            build()


def test_lists_become_tuples_however_options_are_built() -> None:
    given: dict[str, Any] = {
        "robots": "a.robot", "mesh_dirs": [Path("b"), "c"], "exclude_pairs": iter([["a", "b"]]), "gravity": [0, 0, -1],
    }  # fmt: skip
    built = Options(**given)
    assert (built.robots, built.mesh_dirs) == (("a.robot",), (Path("b"), "c"))
    assert (built.exclude_pairs, built.gravity) == ((("a", "b"),), (0.0, 0.0, -1.0))
    assert dataclasses.replace(built, scale=2.0).robots == built.robots
    assert len({built, dataclasses.replace(built)}) == 1


def test_an_unknown_option_is_answered_with_a_guess() -> None:
    with pytest.raises(TypeError, match=r"unknown option 'colision'; did you mean 'collision'\? \(options: robots, "):
        Options.from_keywords({"colision": "auto"})


@pytest.mark.parametrize("function", [env2mjcf.read, env2mjcf.convert, env2mjcf.load])
def test_editors_are_told_every_option(function: Any) -> None:
    assert list(OptionKeywords.__annotations__) == [f.name for f in dataclasses.fields(Options)]
    # Each keyword takes what the field holds.
    of_fields, of_keywords = typing.get_type_hints(Options), typing.get_type_hints(OptionKeywords)
    for name, kind in of_keywords.items():
        if "Iterable" not in str(kind):
            assert kind == of_fields[name], name
    assert function.__annotations__["options"] == "Unpack[OptionKeywords]"


@pytest.fixture
def problem(tmp_path: Path) -> Path:
    """A problem XML that ignores self-collision and links two connections apart, around an arm of four links."""
    from test_pairs import arm

    arm(tmp_path, pose="5 0 0 0 0 0")
    file = tmp_path / "problem.xml"
    file.write_text(
        '<MotionPlanning><Problem><Environment filename="scene.env" gravity="0 0 -32"/></Problem>'
        '<Library><ValidityCheckers><CollisionDetection label="c" ignoreIAdjacentLinks="2" ignoreSelfCollision="true"/>'
        "</ValidityCheckers></Library></MotionPlanning>"
    )
    return file


def own_pairs(scene: env2mjcf.Scene) -> set[str]:
    return {f"{a}-{b}" for a, b in scene.pairs} & {"base-a", "base-b", "base-c", "a-b", "a-c", "b-c"}


def test_what_is_given_overrules_a_problem_file_even_where_it_is_the_default(problem: Path) -> None:
    near, far = {"base-b", "a-c"}, {"base-c"}
    assert own_pairs(env2mjcf.load(problem)) == set()
    assert own_pairs(env2mjcf.load(problem, self_collision=True)) == far
    assert own_pairs(env2mjcf.load(problem, self_collision=True, adjacent_links=1)) == near | far
    assert own_pairs(env2mjcf.load(problem, adjacent_links=1)) == set()
    problem.write_text(problem.read_text().replace(' ignoreSelfCollision="true"', ""))
    assert own_pairs(env2mjcf.load(problem)) == far
    assert own_pairs(env2mjcf.load(problem, adjacent_links=1)) == near | far
    assert own_pairs(env2mjcf.load(problem, self_collision=False)) == set()


def test_what_is_said_about_pairs_is_what_holds(problem: Path) -> None:
    def notes(**options: Any) -> list[str]:
        return [d.message for d in env2mjcf.read(problem, **options).diagnostics if d.code == "ENV309"]

    assert notes() == ["pairs follow the problem file: self-collision ignored, links within 2 connections ignored"]
    assert notes(self_collision=True, adjacent_links=1) == [
        "pairs follow options and the problem file: self-collision tested, links within 1 connections ignored"
    ]


def test_flags_overrule_a_problem_file_even_where_they_are_the_default(
    problem: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def tested(*flags: str) -> bool:
        assert main(["info", str(problem), "--pairs", "--samples", "1", *flags]) == 0
        return "base-b" in capsys.readouterr().out.replace("  ", "-").replace("--", "-")

    assert [tested(), tested("--self-collision"), tested("--self-collision", "--adjacent-links", "1")] == [
        False, False, True,
    ]  # fmt: skip


def test_gravity_is_the_files_unless_given_or_zero(problem: Path) -> None:
    def gravity(**options: Any) -> list[float]:
        return env2mjcf.load(problem, **options).model.opt.gravity.tolist()

    assert gravity() == [0, 0, -32]
    assert gravity(scale=0.25) == [0, 0, -8]
    assert gravity(gravity=(0, 0, -9.81)) == [0, 0, -9.81]
    assert gravity(gravity=(0, 0, 0)) == [0, 0, 0]


@pytest.mark.parametrize("text", ["0 0 0", "-0 0 0.0", "", "down", "0 0", "0 0 nan", "0 inf 0", "1 2 3 4", "0 0 1e31"])
def test_gravity_that_is_zero_or_not_three_numbers_is_reported_and_not_used(problem: Path, text: str) -> None:
    problem.write_text(problem.read_text().replace("0 0 -32", text))
    scene = env2mjcf.load(problem, scale=0.5)
    assert scene.model.opt.gravity.tolist() == [0, 0, -9.81]
    (found,) = [d for d in scene.diagnostics if d.code == "MJC412"]
    zero = text in ("0 0 0", "-0 0 0.0")
    assert found.severity is (Severity.INFO if zero else Severity.WARNING)
    assert ("planner's default" if zero else "not three finite numbers") in found.message
    assert found.message.startswith(f"gravity={text!r} of the file")
    assert found.message.endswith("the MJCF has 0 0 -9.81")


@pytest.mark.parametrize("text", ["0 0 -32", "0 0 0", "down"])
def test_gravity_that_an_option_overrules_is_not_called_the_planners(problem: Path, text: str) -> None:
    problem.write_text(problem.read_text().replace("0 0 -32", text))
    scene = env2mjcf.load(problem, gravity=(0, 1, -2))
    assert scene.model.opt.gravity.tolist() == [0, 1, -2]
    (found,) = [d for d in scene.diagnostics if d.code == "MJC412"]
    assert "planner" not in found.message
    assert found.message.endswith("the MJCF has 0 1 -2")


def test_gravity_of_a_problem_overrules_that_of_its_environment(problem: Path) -> None:
    xml = problem.with_name("scene.xml")
    xml.write_text('<Environment gravity="1 2 3" frictionCoefficient="0.1"/>')
    alone = env2mjcf.load(xml, scale=2.0)
    assert alone.model.opt.gravity.tolist() == [2, 4, 6]
    assert [d.subject for d in alone.diagnostics if d.code == "MJC412"] == ["frictionCoefficient"]
    problem.write_text(problem.read_text().replace("scene.env", "scene.xml"))
    both = env2mjcf.load(problem)
    assert both.model.opt.gravity.tolist() == [0, 0, -32]
    problem.write_text(problem.read_text().replace(' gravity="0 0 -32"', ""))
    assert env2mjcf.load(problem).model.opt.gravity.tolist() == [1, 2, 3]


def test_without_a_problem_file_the_defaults_hold(tmp_path: Path) -> None:
    scene = env2mjcf.load(write_scene(tmp_path, free_cube("4 0 0 0 0 0")), scale=0.5)
    assert scene.model.opt.gravity.tolist() == [0, 0, -9.81]


def test_a_wrong_value_on_the_command_line_is_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", "nothing.env", "--scale", "-1"]) == 2
    assert capsys.readouterr().err == "env2mjcf: info: scale is -1.0; expected a positive number\n"
