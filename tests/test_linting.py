"""What lint finds, past the first error, and how it reports it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from mujoco import FatalError

from env2mjcf import Options, Severity, linting
from env2mjcf.cli.lint import github_annotation
from env2mjcf.cli.main import main
from env2mjcf.errors import Diagnostic, Span
from env2mjcf.linting import Kind, lint

MODELS = Path(__file__).parents[1] / "models"

CUBE = """1 8 12 36
1 12
-0.5 -0.5 -0.5  0.5 -0.5 -0.5  0.5 0.5 -0.5  -0.5 0.5 -0.5
-0.5 -0.5 0.5  0.5 -0.5 0.5  0.5 0.5 0.5  -0.5 0.5 0.5
1 3 -2 1 4 -3 5 6 -7 5 7 -8 1 2 -6 1 6 -5 2 3 -7 2 7 -6 3 4 -8 3 8 -7 4 1 -5 4 5 -8
"""

# The robot is at the origin at home; the obstacle's place and the meshes are filled in.
SCENE = """Boundary Box2D [-4:4; -4:4]
Multibodies
2
Active
1
{robot} Planar Rotational
Connections
0
Passive
{obstacle} {x} 0 0 0 0 0
"""

ROBOT = """2
cube.g Planar Rotational
cube.g Joint
Connections
1
0 1 Revolute -1:1  0 0 0 0 0 0  0 0 0 0  2 0 0 0 0 0
"""


def scene(robot: str = "cube.g", obstacle: str = "cube.g", x: float = 2) -> str:
    return SCENE.format(robot=robot, obstacle=obstacle, x=x)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with a good mesh in it."""
    (tmp_path / "cube.g").write_text(CUBE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def codes(result) -> list[str]:
    return [d.code for d in result.diagnostics]


class TestWhatIsLookedAt:
    def test_a_folder_is_searched_for_scenes_and_robots(self, folder):
        (folder / "deep").mkdir()
        (folder / "deep" / "a.env").write_text(scene())
        (folder / "b.robot").write_text(ROBOT)
        (folder / "c.xml").write_text('<?xml version="1.0"?>\n<!-- x -->\n<MotionPlanning/>')
        (folder / "readme.txt").write_text("1 2 3")
        (folder / ".hidden").mkdir()
        (folder / ".hidden" / "d.env").write_text("nonsense")
        found = {r.path: r.kind for r in lint(["."])}
        assert found == {str(Path("deep/a.env")): Kind.SCENE, "b.robot": Kind.ROBOT, "c.xml": Kind.SCENE}

    @pytest.mark.parametrize(
        "text", ["<mujoco/>", '<robot name="urdf"><link name="a"/></robot>', "<a><b></a>", "no XML at all", ""]
    )
    def test_other_xml_is_skipped_in_folders_and_noted_when_named(self, text, folder):
        (folder / "other.xml").write_text(text)
        assert lint(["."]) == ()
        (named,) = lint(["other.xml"])
        assert (named.kind, codes(named)) == (Kind.OTHER, ["ENV132"])
        assert named.count(Severity.INFO) == 1

    @pytest.mark.parametrize("name", ["a.env", "a.robot", "a.xml"])
    def test_a_link_that_leads_out_of_a_folder_is_not_followed(self, name, folder):
        (folder / "shared").mkdir()
        (folder / "shared" / "common.env").write_text(scene("../cube.g", "../cube.g"))
        (folder / "linked").mkdir()
        (folder / "linked" / "common.env").symlink_to("../shared/common.env")
        for paths, options in (
            (["linked", "shared"], {}),
            (["shared", "linked"], {}),
            (["linked"], {"mesh_dirs": "shared"}),
        ):
            assert [(r.kind, "ENV152" in codes(r)) for r in lint(paths, Options.from_keywords(options))] == [
                ("scene", False)
            ]
        assert [codes(r) for r in lint(["linked"])] == [["ENV152"]]

        (folder / "secret").write_text("the first word of this file would be quoted")
        (folder / "scenes").mkdir()
        (folder / "scenes" / "inside.env").write_text(scene("../cube.g", "../cube.g"))
        (folder / "scenes" / "link.env").symlink_to("inside.env")
        (folder / "scenes" / name).symlink_to("../secret")
        first, *others = lint(["scenes"], Options(allow_outside=False))
        assert (first.path, codes(first)) == (f"scenes/{name}", ["ENV152"])
        assert [r.path for r in others] == ["scenes/inside.env"]
        assert "secret" not in repr(first)
        if name != "a.xml":  # of which other kinds are passed over
            first, *_ = lint(["scenes"], Options(allow_outside=True))
            assert first.path == f"scenes/{name}"
            assert codes(first) != ["ENV152"]

    def test_a_file_named_twice_is_looked_at_once(self, folder):
        (folder / "a.env").write_text(scene())
        assert [r.path for r in lint(["a.env", ".", folder / "a.env"])] == ["a.env"]

    def test_a_missing_file_is_an_error(self, folder):
        (result,) = lint(["gone.env"])
        assert codes(result) == ["ENV101"]

    def test_a_missing_path_is_bad_input_to_the_program(self, folder, capsys):
        for words in (["gone.env"], ["gone.g", "."], ["nowhere/"], ["gone.env", "--json"]):
            assert main(["lint", *words]) == 3
        capsys.readouterr()

    def test_a_mesh_on_its_own(self, folder):
        (folder / "open.g").write_text("1 3 1 3\n1 1\n0 0 0 1 0 0 0 1 0\n1 2 -3\n")
        (folder / "bad.g").write_text("1 3 1 3\n1 1\n0 0 0 1 0 0 0 1 0\n1 2 -4\n")
        good, opened, bad = lint(["cube.g", "open.g", "bad.g"])
        assert codes(good) == []
        assert "GEO230" in codes(opened)
        assert codes(bad) == ["GEO214"]
        assert bad.diagnostics[0].span is not None
        assert (bad.diagnostics[0].span.line, bad.diagnostics[0].span.column) == (4, 5)

    def test_a_robot_on_its_own_by_its_grammar(self, folder):
        (folder / "good.robot").write_text(ROBOT)
        (folder / "bad.robot").write_text(ROBOT.replace("Revolute", "Rotary"))
        (folder / "stray.robot").write_text("2\ncube.g Planar Rotational\ncube.g Joint\nConnections\n0\n")
        good, bad, stray = lint(["good.robot", "bad.robot", "stray.robot"])
        assert codes(good) == []
        assert bad.count(Severity.ERROR) == 1
        assert bad.diagnostics[-1].span is not None
        assert bad.diagnostics[-1].span.line == 6
        assert codes(stray) == ["KIN301"]

    def test_a_robot_file_by_another_name(self, folder):
        (folder / "arm.env").write_text(ROBOT)
        (result,) = lint(["arm.env"])
        assert result.diagnostics == ()


class TestPastTheFirstError:
    def test_an_error_in_one_file_keeps_no_other_from_being_looked_at(self, folder):
        (folder / "a.env").write_text("nonsense")
        (folder / "b.env").write_text(scene(x=0.5))
        a, b = lint(["."])
        assert a.count(Severity.ERROR) == 1
        assert codes(b) == ["KIN312"]  # touches at home

    def test_every_bad_mesh_of_a_scene_has_a_finding_of_its_own(self, folder):
        (folder / "bad.g").write_text("1 3 1 3\n1 1\n0 0 0 1 0 0 0 1 0\n1 2 -4\n")
        text = scene("gone.g", "bad.g") + "Passive\nlost.g 3 0 0 0 0 0\n"
        (folder / "a.env").write_text(text.replace("\n2\nActive", "\n3\nActive"))
        (result,) = lint(["a.env"])
        found = {(d.code, d.span.line) for d in result.diagnostics if d.span}
        assert found == {("GEO201", 6), ("GEO214", 4), ("GEO201", 12)}

    def test_good_meshes_are_looked_at_beside_a_missing_one(self, folder):
        (folder / "flat.g").write_text("1 3 1 3\n1 1\n0 0 0 1 0 0 0 1 0\n1 2 -3\n")
        (folder / "a.env").write_text(scene("flat.g", "gone.g"))
        (result,) = lint(["a.env"])
        assert {"GEO230", "GEO201"} <= set(codes(result))

    def test_a_warning_does_not_end_a_file_in_strict_mode(self, folder):
        (folder / "a.env").write_text(scene(x=0.5).replace("\n2\nActive", "\n3\nActive"))
        (result,) = lint(["a.env"], Options(strict=True))
        assert codes(result) == ["ENV203", "KIN312"]

    def test_a_place_is_reported_once(self, folder):
        (folder / "twice.g").write_text("1 3 1 3\n1 1\n0 0 0 1 0 0 0 1 0\n1 2 -4\n")
        for name in ("a.env", "b.env"):
            (folder / name).write_text(scene("twice.g"))
        a, b = lint(["."])
        assert codes(a) == ["GEO214"]
        assert codes(b) == []

    def test_what_has_no_place_is_reported_for_every_file(self, folder):
        for name in ("a.env", "b.env"):
            (folder / name).write_text("Boundary Box [-1:1; -1:1; -1:1]\nMultibodies\n1\nPassive\ncube.g 0 0 0 0 0 0\n")
        assert [codes(r) for r in lint(["."])] == [["ENV310"], ["ENV310"]]

    def test_options_reach_the_scenes(self, folder):
        (folder / "a.env").write_text(scene(x=0.5))
        (result,) = lint(["a.env"], Options(exclude_rest_contacts=True))
        assert codes(result) == ["KIN313"]
        with pytest.raises(ValueError, match="exclude_pairs"):
            lint(["a.env"], Options(exclude_pairs=(("cube", "nobody"),)))


class TestModels:
    def test_our_own_scenes_have_no_error(self):
        if not MODELS.is_dir():
            pytest.skip("there are no models")
        results = lint([MODELS])
        assert len(results) >= 8
        assert [d for r in results for d in r.diagnostics if d.severity is Severity.ERROR] == []


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]):
    def run(*words: str) -> tuple[int, str, str]:
        capsys.readouterr()
        status = main(["lint", *words])
        return (status, *capsys.readouterr())

    return run


class TestProgram:
    def test_good_scenes_are_0(self, folder, run):
        (folder / "a.env").write_text(scene())
        assert run("a.env") == (0, "1 file: 0 errors, 0 warnings, 0 notes\n", "")

    def test_errors_are_1_and_findings_are_the_result(self, folder, run):
        (folder / "a.env").write_text(scene("gone.g"))
        status, out, err = run("a.env")
        assert (status, err) == (1, "")
        assert re.search(r"^a\.env:6:1: error GEO201: .*\n    gone\.g Planar Rotational\n    \^{6}\n", out)
        assert out.endswith("1 file: 1 error, 0 warnings, 0 notes\n")

    def test_warnings_are_1_in_strict_mode_only(self, folder, run):
        (folder / "a.env").write_text(scene().replace("\n2\nActive", "\n3\nActive"))
        assert run("a.env")[0] == 0
        assert run("a.env", "--strict")[0] == 1

    def test_notes_are_shown_and_are_no_fault(self, folder, run):
        (folder / "other.xml").write_text("<mujoco/>")
        status, out, _ = run("other.xml", "--strict")
        assert status == 0
        assert out.startswith("other.xml: info ENV132: ")

    def test_as_json(self, folder, run):
        (folder / "a.env").write_text(scene("gone.g"))
        status, out, _ = run(".", "--json")
        report = json.loads(out)
        assert status == 1
        assert (report["errors"], report["warnings"], report["notes"]) == (1, 0, 0)
        (file,) = report["files"]
        assert (file["path"], file["kind"]) == ("a.env", "scene")
        assert file["diagnostics"][0]["span"] == {
            "path": "a.env", "line": 6, "column": 1, "length": 6, "text": "gone.g Planar Rotational", "skipped": 0,
        }  # fmt: skip

    def test_for_github(self, folder, run):
        (folder / "a.env").write_text(scene("gone.g"))
        status, out, err = run("a.env", "--github")
        assert status == 1
        (line,) = out.splitlines()
        assert line.startswith("::error file=a.env,line=6,col=1,endColumn=7,title=env2mjcf GEO201::there is no mesh")
        assert "%0Ahint: " in line
        assert err == "GEO201 1\n1 file: 1 error, 0 warnings, 0 notes\n"

    def test_an_empty_folder_is_said_to_be_empty(self, folder, run):
        status, _, err = run(".")
        assert status == 0
        assert "no scene" in err

    @pytest.mark.parametrize("words", [(), ("a.env", "--json", "--github"), ("a.env", "--scale", "-1")])
    def test_wrong_usage_is_2(self, words, folder, run):
        (folder / "a.env").write_text(scene())
        status, out, err = run(*words)
        assert (status, out) == (2, "")
        assert err

    @pytest.mark.parametrize("error", [RuntimeError("oh"), ValueError("a fault"), MemoryError(), FatalError("oh")])
    def test_a_fault_in_one_file_leaves_the_findings_of_the_others(self, folder, run, monkeypatch, error):
        for name in ("a.env", "b.env", "c.env"):
            (folder / name).write_text(scene("gone.g"))
        resolve = linting.resolve_all

        def broken(environment, *rest):
            if environment.name == "b" and environment.multibodies[0].bodies[0].filename == "cube.g":
                raise error
            return resolve(environment, *rest)

        monkeypatch.setattr("env2mjcf.linting.resolve_all", broken)
        status, out, err = run("a.env", "b.env", "c.env", "--json")
        files = json.loads(out)["files"]
        assert (status, err) == (4, "")
        assert [[d["code"] for d in f["diagnostics"]] for f in files] == [["GEO201"], ["GEO201", "MJC407"], ["GEO201"]]
        said = files[1]["diagnostics"][1]["message"]
        assert ("not enough memory" if isinstance(error, MemoryError) else f"{type(error).__name__}: {error}") in said


class TestGithubAnnotations:
    def test_escape_what_ends_a_property_or_a_line(self):
        span = Span("50%,a:b.env", 3, 4, 2, "x")
        line = github_annotation(Diagnostic("ENV1", Severity.WARNING, "x", "100%: a,\r\nb\x1b", "do\nit", span), "")
        assert line == (
            "::warning file=50%25%2Ca%3Ab.env,line=3,col=4,endColumn=6,title=env2mjcf ENV1::"
            "100%25: a,\\r%0Ab\\x1b%0Ahint: do%0Ait"
        )

    def test_stand_at_the_file_where_there_is_no_place(self):
        line = github_annotation(Diagnostic("ENV1", Severity.INFO, "x", "hm"), "a.env")
        assert line == "::notice file=a.env,title=env2mjcf ENV1::hm"
