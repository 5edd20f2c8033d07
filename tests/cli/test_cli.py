"""The program: what it prints where, and its exit status."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from extras import skip_without

from env2mjcf import load
from env2mjcf.cli import info as info_module
from env2mjcf.cli.main import VERBS, main
from env2mjcf.cli.terminal import format_diagnostic, one_line, plain
from env2mjcf.errors import Diagnostic, Severity, Span

ROOT = Path(__file__).parents[2]
MODELS = ROOT / "models"

# A cube with edges of 1, and outward faces.
CUBE = """1 8 12 36
1 12
-0.5 -0.5 -0.5  0.5 -0.5 -0.5  0.5 0.5 -0.5  -0.5 0.5 -0.5
-0.5 -0.5 0.5  0.5 -0.5 0.5  0.5 0.5 0.5  -0.5 0.5 0.5
1 3 -2 1 4 -3 5 6 -7 5 7 -8 1 2 -6 1 6 -5 2 3 -7 2 7 -6 3 4 -8 3 8 -7 4 1 -5 4 5 -8
"""

# One free cube with a second one on a hinge; a wall 5 away from it along x.
DIALECT_A = """2
MultiBody Active
2
FreeBody 0 cube.g 0 0 0 0 0 0
FreeBody 1 cube.g
Connection
1
0 1 Actuated
0.5 0 0 0 0 0  0 1 0 0  Revolute  0 0.5 0 0 0 0
MultiBody Passive
1
FixedBody 0 cube.g 5 0 0 0 0 0
Connection
0
"""

# A cube that slides in a plane; an obstacle 2 away from it along x, and walls at 4.
DIALECT_D = """Boundary Box2D [-4:4; -4:4]
Multibodies
2
Active
1
cube.g Planar Rotational
Connections
0
Passive
cube.g 2 0 0 0 0 0
"""

# An arm of one hinge on a fixed foot; the hinge has limits.
LIMITED = """Boundary Box [-9:9; -9:9; -9:9]
Multibodies
1
Active
2
cube.g Fixed 0 0 0 0 0 0
cube.g Joint
Connections
1
0 1 Revolute -0.5:0.5  0 0 0 0 0 0  0 0 0 0  3 0 0 0 0 0
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder: a scene of each kind, and their mesh."""
    for name, text in (("cube.g", CUBE), ("a.env", DIALECT_A), ("d.env", DIALECT_D), ("limited.env", LIMITED)):
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    return tmp_path


class Run:
    """What one run of the program in this process gave."""

    def __init__(self, capsys: pytest.CaptureFixture[str], *words: str) -> None:
        capsys.readouterr()
        self.status = main(list(words))
        self.out, self.err = capsys.readouterr()

    @property
    def json(self) -> dict:
        return json.loads(self.out)


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]):
    return lambda *words: Run(capsys, *map(str, words))


def program(*words: str, **how) -> subprocess.CompletedProcess[str]:
    """Run the real program in a process of its own."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [sys.executable, "-m", "env2mjcf", *words], capture_output=True, text=True, env=environment, check=False, **how
    )


class TestHelp:
    def test_without_a_verb_is_wrong_usage(self, run):
        result = run()
        assert (result.status, result.out) == (2, "")
        assert "a verb is missing" in result.err

    def test_lists_every_verb_and_what_each_exit_status_means(self, run):
        result = run("--help")
        assert (result.status, result.err) == (0, "")
        assert all(re.search(rf"^  {verb} ", result.out, re.MULTILINE) for verb in VERBS)
        assert "3 bad input" in result.out

    @pytest.mark.parametrize("verb", VERBS)
    def test_of_every_verb_has_an_example_and_the_options(self, verb, run):
        result = run(verb, "--help")
        assert (result.status, result.err) == (0, "")
        assert re.search(rf"Examples:\n  env2mjcf {verb} \S", result.out)
        if verb == "cache":
            return  # it reads no scene
        for flag in ("--robots", "--query", "--mesh-dirs", "--allow-outside", "--limits.file-bytes"):
            assert flag in result.out
        assert "PATH" in result.out
        if verb == "translate":
            return  # it neither compiles nor loads one
        assert "--exclude-pairs" in result.out
        assert "Metres per file unit" in result.out

    def test_needs_no_mujoco(self, tmp_path):
        """Help is quick."""
        code = (
            "import sys; from env2mjcf.cli.main import main; main(['check', '--help']); main(['--help'])\n"
            "sys.exit('mujoco' in sys.modules)"
        )
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, check=False)
        assert done.returncode == 0

    def test_a_misspelt_verb_is_guessed(self, run):
        result = run("chek", "a.env")
        assert result.status == 2
        assert "did you mean 'check'?" in result.err

    def test_a_misspelt_flag_is_guessed(self, run):
        result = run("convert", "a.env", "--colision", "hull")
        assert (result.status, result.out) == (2, "")
        assert "--collision" in result.err


class TestConvert:
    def test_prints_the_path_of_the_mjcf_and_nothing_else(self, folder, run):
        result = run("convert", "a.env", "out")
        assert result.status == 0
        assert result.out == f"{Path('out', 'a.xml')}\n"
        assert mujoco.MjModel.from_xml_path(str(folder / "out" / "a.xml")).njnt == 2

    @pytest.mark.parametrize(
        ("words", "where"),
        [((), "a_mjcf/a.xml"), (("-o", "x"), "x/a.xml"), (("--out", "x/y.xml"), "x/y.xml"), (("y",), "y/a.xml")],
    )
    def test_writes_where_it_is_told(self, words, where, folder, run):
        result = run("convert", "a.env", *words)
        assert Path(result.out.strip()) == Path(where)
        assert (folder / where).is_file()

    def test_names_its_output_after_the_problem(self, folder, run):
        Path("the-task.xml").write_text('<Problem><Environment filename="a.env"/></Problem>')
        result = run("convert", "the-task.xml")
        assert Path(result.out.strip()) == Path("the-task_mjcf/the-task.xml")
        assert mujoco.MjModel.from_xml_path(result.out.strip()).njnt == 2
        assert Path(run("convert", "the-task.xml", "-o", "x/named.xml").out.strip()) == Path("x/named.xml")

    def test_refuses_two_places(self, folder, run):
        result = run("convert", "a.env", "x", "-o", "y")
        assert (result.status, result.out) == (2, "")
        assert "twice" in result.err
        assert not (folder / "x").exists()

    def test_as_json_tells_everything(self, folder, run):
        result = run("convert", "d.env", "out", "--json").json
        assert set(result) == {"xml", "assets", "report", "diagnostics"}
        assert all((folder / asset).is_file() for asset in result["assets"])
        assert (result["report"]["dof"], result["report"]["dialect"]) == (3, "D")

    def test_flags_reach_the_conversion(self, folder, run):
        run("convert", "d.env", "out", "--scale", "0.5", "--gravity", "0", "0", "-1.5", "--actuators", "position")
        model = mujoco.MjModel.from_xml_path("out/d.xml")
        assert model.opt.gravity.tolist() == [0, 0, -1.5]
        assert model.nu == 3
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        assert 1.0 in np.round(data.geom_xpos[:, 0], 9)  # the obstacle at 2 file units


class TestInfo:
    def test_tells_dialect_robots_and_degrees_of_freedom(self, folder, run):
        result = run("info", "a.env")
        assert (result.status, result.err) == (0, "")
        assert "A: begins with a count, then 'MultiBody'" in result.out
        assert re.search(r"cube_2.theta +turns +turns freely", result.out)
        assert re.search(r"cube\.g +12 +yes +yes +1", result.out)
        assert not re.search(r" $", result.out, re.MULTILINE)

    def test_tells_how_far_apart_the_two_readings_are(self, folder, run):
        # The planner goes 0.5 along y, 1 along x (a) and 0.5 along x; with no turn at all the order does not matter.
        assert "puts every link at the same place" in run("info", "a.env").out
        # With a quarter turn in the first transform of the file, the planner turns last and the page first:
        # planner (0, .5, 0) + (1, 0, 0) + (.5, 0, 0); page (.5, 0, 0) + Rz(90) ((1, 0, 0) + (0, .5, 0)) = (0, 1, 0).
        turned = DIALECT_A.replace("0.5 0 0 0 0 0  0 1", "0.5 0 0 0 0 90  0 1")
        (folder / "turned.env").write_text(turned)
        readings = run("info", "turned.env", "--json").json["readings"]
        assert readings["other"] == "page"
        assert readings["link"] == "cube_2"
        assert readings["distance"] == pytest.approx(np.hypot(1.5, 0.5), abs=1e-12)
        half = run("info", "turned.env", "--json", "--scale", "0.5", "--semantics", "page").json["readings"]
        assert (half["other"], half["distance"]) == ("planner", pytest.approx(np.hypot(1.5, 0.5) / 2, abs=1e-12))

    def test_other_dialects_have_one_reading(self, folder, run):
        assert run("info", "d.env", "--json").json["readings"] is None

    def test_gives_limits_in_the_numbers_of_the_file_and_in_radians(self, folder, run):
        (dof,) = run("info", "limited.env", "--json").json["robots"][0]["dofs"]
        assert (dof["name"], dof["unit"]) == ("cube_2.theta", "pi")
        assert (dof["lower"], dof["upper"]) == (-0.5, 0.5)
        assert (dof["lower_si"], dof["upper_si"]) == (pytest.approx(-np.pi / 2), pytest.approx(np.pi / 2))

    def test_writes_unbounded_limits_as_null(self, folder, run):
        dof = run("info", "a.env", "--json").json["robots"][0]["dofs"][0]
        assert (dof["name"], dof["lower"], dof["upper"]) == ("cube.x", None, None)

    def test_lists_pairs_on_request(self, folder, run):
        assert run("info", "d.env", "--json").json["pairs"] == 1
        assert run("info", "d.env", "--json", "--pairs").json["pairs"] == [["cube", "cube_2"]]
        out = run("info", "d.env", "--pairs", "--samples", "300").out
        assert re.search(r"Tested pairs\n +link +other +touch\n +cube +cube_2 +in \d+ of 300 samples\n", out)
        assert "sampled, not proved: home and 299 uniform configurations; 0 pairs never touched, 0 always did" in out

    def test_wants_a_sample_at_least(self, folder, run):
        result = run("info", "d.env", "--pairs", "--samples", "0")
        assert (result.status, result.out) == (2, "")
        assert "expected at least 1" in result.err

    def test_prints_what_the_text_says_when_a_mesh_is_missing(self, folder, run):
        (folder / "cube.g").unlink()
        result = run("info", "d.env")
        assert result.status == 3
        assert "Planar Rotational" in result.out
        assert "Whole scene" not in result.out
        assert re.search(r"^d.env:6:1: error GEO201: ", result.err, re.MULTILINE)
        assert "    cube.g Planar Rotational\n    ^^^^^^\n" in result.err

    def test_as_json_holds_the_error(self, folder, run):
        (folder / "cube.g").unlink()
        result = run("info", "d.env", "--json")
        assert result.status == 3
        assert result.json["error"]["code"] == "GEO201"
        assert result.json["robots"][0]["base"] == "Planar Rotational"

    def test_names_the_file_that_a_problem_takes_its_environment_from(self, run):
        if not (MODELS / "maze" / "maze.xml").is_file():
            pytest.skip("there are no models")
        told = run("info", MODELS / "maze" / "maze.xml", "--json").json["told_by"]
        assert told.startswith(f"{MODELS / 'maze' / 'maze.env'}: its boundary has brackets")

    def test_shows_what_is_only_worth_knowing(self, folder, run):
        (folder / "empty.env").write_text(
            "Boundary Box [-1:1; -1:1; -1:1]\nMultibodies\n1\nPassive\ncube.g 0 0 0 0 0 0\n"
        )
        assert "info ENV310: the scene has no robot" in run("info", "empty.env").err
        assert "ENV310" not in run("convert", "empty.env").err
        assert "info ENV310" in run("convert", "empty.env", "--verbose").err


class TestCheck:
    def test_without_configurations_takes_home(self, folder, run):
        result = run("check", "d.env")
        assert result.status == 0
        assert result.out == "home: valid\n1 configuration: 1 valid\n"

    def test_tells_who_touches_whom_where_and_how_deep(self, folder, run):
        result = run("check", "d.env", "1.25", "0", "0")
        assert result.status == 1
        assert "configuration: in collision" in result.out
        found = re.search(r"cube and cube_2 \(obstacle\): (\S+) m deep at \((\S+), ", result.out)
        assert found
        assert float(found[1]) == pytest.approx(0.25, abs=1e-6)
        assert 1.5 - 1e-6 <= float(found[2]) <= 1.75 + 1e-6
        assert result.out.endswith("1 configuration: 0 valid, 1 in collision\n")

    def test_angles_are_in_the_units_of_the_file(self, folder, run):
        # 0.25 of pi turns the cube by 45 degrees, so that its edge reaches 0.7071 towards the obstacle's face at 1.5.
        assert run("check", "d.env", "0.9", "0", "0").status == 0
        assert run("check", "d.env", "0.9", "0", "0.25").status == 1
        assert run("check", "d.env", "0.9", "0", "0.25", "--radians").status == 1
        assert run("check", "d.env", "0.78", "0", "0.25").status == 0
        assert run("check", "d.env", "0.9", "0", "1.5").status == 0  # one and a half times pi: a quarter turn
        assert run("check", "d.env", "0.9", "0", "1.5", "--radians").status == 0
        assert run("check", "d.env", "0.87", "0", "0.75").status == 1
        assert run("check", "d.env", "0.87", "0", "3.2", "--radians").status == 0

    @pytest.mark.parametrize("dashes", [(), ("--",)])
    def test_takes_negative_numbers(self, dashes, folder, run):
        result = run("check", "d.env", "--json", *dashes, "-1.5", "-2.5e-1", "-.5")
        assert result.status == 0
        assert result.json["configurations"][0]["q"] == pytest.approx([-1.5, -0.25, -np.pi / 2])

    def test_tells_limits_and_boundary_apart(self, folder, run):
        limits = run("check", "limited.env", "0.75")
        assert limits.status == 1
        assert "configuration: out of limits\n    cube_2.theta is 2.35619; limits -1.5708 to 1.5708" in limits.out
        # The whole cube must stay inside; its corner sticks out already where its centre does not.
        boundary = run("check", "d.env", "-3.75", "0", "0", "--json")
        (verdict,) = boundary.json["configurations"]
        assert boundary.status == 1
        assert (verdict["valid"], verdict["in_collision"], verdict["outside"]) == (False, False, ["cube"])
        assert "outside the boundary" in run("check", "d.env", "-3.75", "0", "0").out

    @pytest.mark.parametrize("how", ["flag", "argument"])
    def test_takes_a_query_file(self, how, folder, run):
        (folder / "d.query").write_text("0 0 0\n1.5 0 0\n")
        result = run("check", "d.env", *(["--query", "d.query"] if how == "flag" else ["d.query"]))
        assert result.status == 1
        assert "configuration 1 of 2: valid\nconfiguration 2 of 2: in collision\n" in result.out
        assert result.out.endswith("2 configurations: 1 valid, 1 in collision\n")

    def test_takes_a_table_in_text(self, folder, run):
        (folder / "rows.csv").write_text("x,y,turn\n0,0,0\n\n1.5, 0, 0 # touches\n0;1;0\n0 0 0 0\n")
        result = run("check", "d.env", "rows.csv", "--json")
        assert result.status == 1
        verdicts = {v["label"]: v["valid"] for v in result.json["configurations"]}
        assert verdicts == {"line 2": True, "line 4": False, "line 5": True, "line 6": True}

    def test_takes_an_array(self, folder, run):
        q = np.random.default_rng(7).uniform(-4, 4, (300, 3))
        np.save(folder / "q.npy", q)
        result = run("check", "d.env", "q.npy", "--radians", "--json")
        valid = [v["valid"] for v in result.json["configurations"]]
        assert valid == load("d.env").is_valid(q).tolist()
        assert 0 < sum(valid) < 300

    def test_lists_only_invalid_ones_of_many(self, folder, run):
        np.save(folder / "q.npy", np.repeat([[0.0, 0, 0], [1.5, 0, 0]], 50, axis=0))
        out = run("check", "d.env", "q.npy").out
        assert out.count(": in collision\n") == 20
        assert ": valid\n" not in out
        assert "and 30 more" in out
        assert out.endswith("100 configurations: 50 valid, 50 in collision\n")
        everything = run("check", "d.env", "q.npy", "--all").out
        assert (everything.count(": in collision\n"), everything.count(": valid\n")) == (50, 50)

    def test_rows_of_several_robots(self, folder, run):
        second = "Active\n1\ncube.g Planar Translational\nConnections\n0\n"
        (folder / "two.env").write_text(DIALECT_D.replace("\n2\nActive", f"\n3\n{second}Active"))

        def q(*row):
            return run("check", "two.env", "--json", "--", *row).json["configurations"][0]["q"]

        assert q("-2", "1", "0", "3", "0.5") == pytest.approx([-2, 1, 0, 3, np.pi / 2])
        assert q("0", "-2", "1") == pytest.approx([-2, 1, 0, 0, 0])
        assert q("1", "0", "3", "0.5") == pytest.approx([0, 0, 0, 3, np.pi / 2])

    @pytest.mark.parametrize(
        ("name", "content", "code", "place"),
        [
            ("q.csv", "0 0 0\n0 x 0\n", "CFG502", "q.csv:2:3: error"),
            ("q.csv", "nan nan nan\n", "CFG502", "q.csv:1:1: error"),
            ("q.csv", "0 0 0\n0 0\n", "CFG504", "q.csv:2:1: error"),
            ("q.csv", "x,y,z\n", "CFG503", "q.csv:1:1: error"),
            ("q.query", "1 2\n", "CFG504", "q.query:1:1: error"),
            ("q.npy", "0 0 0\n", "CFG505", "error"),
        ],
    )
    def test_a_bad_file_of_configurations_is_bad_input(self, name, content, code, place, folder, run):
        (folder / name).write_text(content)
        result = run("check", "d.env", name)
        assert (result.status, result.out) == (3, "")
        assert f"{place} {code}: " in result.err

    @pytest.mark.parametrize(
        ("words", "what"),
        [
            (["1", "2"], "2 numbers; expected 3 (cube.x, cube.y, cube.rz)"),
            (["1", "2", "x"], "'x' is not a number"),
            (["nan", "0", "0"], "cube.x is nan"),
            (["0", "0", "0", "--query", "d.query"], "given twice"),
        ],
    )
    def test_bad_numbers_are_wrong_usage(self, words, what, folder, run):
        result = run("check", "d.env", *words)
        assert (result.status, result.out) == (2, "")
        assert what in result.err

    def test_takes_the_tasks_of_a_problem_file(self, run):
        problem = MODELS / "maze" / "maze.xml"
        if not problem.is_file():
            pytest.skip("there are no models")
        result = run("check", problem)
        assert "configuration 1 of 2" in result.out


class TestExitStatus:
    def test_bad_input_is_3(self, folder, run):
        (folder / "bad.env").write_text(DIALECT_A.replace("FreeBody 1", "Wheel 1"))
        for verb in ("convert", "info", "check"):
            result = run(verb, "bad.env")
            assert (result.status, result.out) == (3, "")
            line, source, caret = result.err.splitlines()[:3]
            assert re.match(r"bad\.env:5:1: error ENV\d{3}: ", line)
            assert (source, caret) == ("    Wheel 1 cube.g", "    ^^^^^")

    @pytest.mark.parametrize(
        "words",
        [
            ("plan", "e.env"), ("plan", "e.env", "--query", "q"), ("play", "e.env", "q", "-o", "a.gif"),
            ("view", "e.env", "--path", "q", "--no-browser"),
        ],
    )  # fmt: skip
    def test_a_scene_in_which_nothing_moves_is_3_and_said_to_be_one(self, words, folder, run):
        skip_without("planning" if words[0] == "plan" else "view")
        (folder / "e.env").write_text("Boundary Box [-9:9; -9:9; -9:9]\nMultibodies\n1\nPassive\ncube.g 0 0 0 0 0 0\n")
        (folder / "q").write_text("1 2 3\n")
        result = run(*words)
        assert (result.status, result.out) == (3, "")
        if "q" not in words or words[0] != "plan":
            assert "error CFG543: e.env has no robot" in result.err

    @pytest.mark.parametrize("words", [("check", "d.env", "1", "2"), ("info", "d.env", "--scale", "0"), ("nothing",)])
    def test_wrong_usage_leaves_stdout_empty_with_json_too(self, words, folder, run):
        result = run(*words, "--json")
        assert (result.status, result.out) == (2, "")
        assert result.err

    def test_json_of_check_holds_the_diagnostics(self, folder, run):
        (folder / "d.env").write_text(DIALECT_D.replace("Multibodies", "Multibodys"))
        (found,) = run("check", "d.env", "--json").json["diagnostics"]
        assert found["code"] == "ENV202"
        assert found == run("info", "d.env", "--json").json["diagnostics"][0]

    def test_a_missing_file_is_3(self, folder, run):
        result = run("convert", "b.env")
        assert result.status == 3
        assert "there is no file b.env" in result.err

    @pytest.mark.parametrize(
        "words",
        [
            ("--scale", "0"),
            ("--scale", "x"),
            ("--collision", "hul"),
            ("--semantics", "page"),
            ("--engine", "exakt"),
            ("--exclude-pairs", "cube", "nothing"),
            ("--exclude-pairs", "cube"),
            ("--adjacent-links", "-1"),
        ],
    )
    def test_wrong_options_are_2(self, words, folder, run):
        result = run("convert", "d.env", "out", *words)
        assert (result.status, result.out) == (2, "")
        assert result.err.strip()
        assert "Traceback" not in result.err
        assert not (folder / "out").exists()

    def test_strict_makes_a_warning_bad_input(self, folder, run):
        (folder / "count.env").write_text(DIALECT_D.replace("Multibodies\n2", "Multibodies\n3"))
        assert run("convert", "count.env").status == 0
        assert run("convert", "count.env", "--strict").status == 3

    def test_a_fault_of_ours_is_4_in_one_line(self, folder, run, monkeypatch):
        def broken(*_):
            raise KeyError("gone\x1b[31m")

        monkeypatch.setattr(info_module.Info, "run", broken)
        result = run("info", "a.env")
        assert (result.status, result.out) == (4, "")
        assert result.err.count("\n") == 1
        assert "please report it: KeyError: " in result.err
        assert "\x1b" not in result.err
        assert "Traceback" in run("info", "a.env", "--debug").err
        monkeypatch.setenv("ENV2MJCF_DEBUG", "1")
        assert "Traceback" in run("info", "a.env").err

    def test_an_error_of_a_library_is_no_wrong_usage(self, folder, run, monkeypatch):
        def broken(*_):
            np.linalg.inv(np.zeros((2, 2)))  # raises LinAlgError, which is a ValueError

        monkeypatch.setattr(info_module.Info, "run", broken)
        assert run("info", "a.env").status == 4

    def test_an_interruption_is_130(self, folder, run, monkeypatch):
        def interrupted(*_):
            raise KeyboardInterrupt

        monkeypatch.setattr(info_module.Info, "run", interrupted)
        result = run("info", "a.env")
        assert (result.status, result.out, result.err) == (130, "", "")

    def test_as_json_an_error_is_an_object(self, folder, run):
        result = run("check", "b.env", "--json")
        assert result.status == 3
        assert result.json["error"]["code"] == "ENV101"


class TestProgram:
    """The real program, in a process of its own."""

    def test_keeps_results_and_diagnostics_apart(self, folder):
        (folder / "count.env").write_text(DIALECT_D.replace("Multibodies\n2", "Multibodies\n3"))
        result = program("convert", "count.env", "out", cwd=folder)
        assert (result.returncode, result.stdout) == (0, f"{Path('out', 'count.xml')}\n")
        assert result.stderr.startswith("count.env:3:1: warning ENV203: ")
        assert "\x1b" not in result.stderr

    def test_reports_a_collision_by_its_status(self, folder):
        assert program("check", "d.env", "1.5", "0", "0", cwd=folder).returncode == 1
        assert program("check", "d.env", "0", "0", "0", cwd=folder).returncode == 0

    @pytest.mark.slow
    def test_is_silent_when_nobody_listens(self, folder):
        np.save(folder / "q.npy", np.tile([1.5, 0, 0], (20_000, 1)))
        command = [sys.executable, "-m", "env2mjcf", "check", "d.env", "q.npy", "--json"]
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        with subprocess.Popen(
            command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        ) as process:
            assert process.stdout is not None
            assert process.stderr is not None
            process.stdout.read(1)
            process.stdout.close()
            said = process.stderr.read()
        assert (process.returncode, said) == (141, b"")

    def test_tells_its_version(self):
        result = program("--version")
        assert (result.returncode, result.stderr) == (0, "")
        assert re.fullmatch(r"\d+\.\d+\S*|a checkout that is not installed", result.stdout.strip())


class TestNothingPlaysTricks:
    def test_control_characters_are_escaped(self):
        assert one_line("a\x1b[2J\nb\u202ec\ud800") == r"a\x1b[2J\nb\u202ec\ud800"

    def test_in_a_diagnostic_with_the_caret_in_place(self):
        span = Span("a\nb.env", 3, 5, 4, "\x1b\x07\tx name")
        text = format_diagnostic(Diagnostic("ENV101", Severity.ERROR, "x", "no \x1b[31mname", "", span))
        assert text == "a\\nb.env:3:5: error ENV101: no \\x1b[31mname\n    \ufffd\ufffd\tx name\n      \t ^^^^"

    def test_in_names_of_files(self, folder, run):
        (folder / "e.env").write_text(DIALECT_D.replace("Planar", "Planar\x1b[31m"))
        result = run("info", "e.env")
        assert result.status == 3
        assert "\x1b" not in result.out + result.err

    def test_numbers_that_json_lacks_become_null(self):
        assert plain({"a": (float("inf"), np.float64("nan"), np.arange(2))}) == {"a": [None, None, [0, 1]]}
