"""Assertions for tests, and the pytest plugin, in real pytest runs."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from extras import needs
from scenes import free_cube, write_scene

import env2mjcf
from env2mjcf.testing import assert_free, assert_valid, assert_valid_path
from env2mjcf.view import offscreen

pytest_plugins = ["pytester"]

ROOT = Path(__file__).parents[1]
needs_gl = pytest.mark.skipif(offscreen.backend() is None, reason=f"no GL: {offscreen.missing()}")

FREE = [0.0] * 6
# Two unit cubes whose centres are 0.75 apart.
DEEP = [2.25, 0.0, 0.0, 0.0, 0.0, 0.0]
OUTSIDE = [0.0, 9.75, 0.0, 0.0, 0.0, 0.0]
BEHIND = [8.0, 0.0, 0.0, 0.0, 0.0, 0.0]


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> env2mjcf.Scene:
    """A free unit cube, one that stands at x = 3, and a boundary at 10."""
    return env2mjcf.load(write_scene(tmp_path_factory.mktemp("scene"), free_cube("3 0 0 0 0 0")))


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> env2mjcf.Scene:
    """A hinge with limits of a quarter turn either way."""
    hinge = "0 1 Revolute -0.5:0.5  0 0 0 0 0 0  0 0 0 0  3 0 0 0 0 0"
    robot = f"2\ncube.g Fixed 0 0 0 0 0 0\ncube.g Joint\nConnections\n1\n{hinge}\n"
    return env2mjcf.load(write_scene(tmp_path_factory.mktemp("arm"), free_cube(robot=robot)))


def message(assertion, *arguments, **how) -> list[str]:
    """Return the lines of a failure."""
    with pytest.raises(AssertionError) as caught:
        assertion(*arguments, **how)
    return str(caught.value).splitlines()


class TestAssertFree:
    def test_passes_what_is_free(self, scene):
        assert_free(scene, FREE)
        assert_free(scene, [FREE, OUTSIDE])  # it does not look at the boundary

    def test_names_the_bodies_the_place_and_the_depth(self, scene):
        head, values, contact, *rest = message(assert_free, scene, DEEP)
        assert head == "the configuration is in collision"
        assert values == f"  q = {DEEP}  (cube.x, cube.y, cube.z, cube.rx, cube.ry, cube.rz)"
        assert contact.startswith("    cube and cube_2 (obstacle): 0.25 m deep at (")
        x, y, z = (float(n) for n in contact.partition(" at (")[2].rstrip(")").split(","))
        assert 2.5 <= x <= 2.75
        assert max(abs(y), abs(z)) <= 0.5
        assert rest == []

    def test_of_several_names_the_first_and_counts_them(self, scene):
        head = message(assert_free, scene, [FREE, DEEP, FREE, DEEP])[0]
        assert head == "2 of 4 configurations are in collision; the first is row 1"

    def test_the_values_can_be_copied_back(self, scene):
        row = np.array([2 + 1 / 3, 1e-17, 0, 0, 0, 0])
        values = message(assert_free, scene, row)[1]
        assert eval(values.split("q = ")[1].split("  (")[0]) == row.tolist()

    def test_nothing_is_no_proof(self, scene):
        with pytest.raises(ValueError, match="nothing to assert"):
            assert_free(scene, np.zeros((0, 6)))

    def test_a_wrong_shape_is_a_mistake_and_no_failure(self, scene):
        with pytest.raises(ValueError, match="6"):
            assert_free(scene, [0.0, 1.0])


class TestAssertValid:
    def test_passes_what_is_valid(self, scene, arm):
        assert_valid(scene, [FREE, BEHIND])
        assert_valid(arm, [0.5 * np.pi])

    def test_says_who_is_outside(self, scene):
        lines = message(assert_valid, scene, OUTSIDE)
        assert lines[0] == "the configuration is not valid"
        assert lines[2].startswith("    cube reaches ")
        assert " m outside the boundary, to (" in lines[2]
        assert len(lines) == 3

    def test_says_which_limit_is_passed(self, arm):
        assert message(assert_valid, arm, [2.0])[2:] == ["    cube_2.theta is 2; limits -1.5708 to 1.5708"]

    def test_says_who_touches(self, scene):
        assert message(assert_valid, scene, DEEP)[2].startswith("    cube and cube_2 (obstacle): 0.25 m deep")


class TestAssertValidPath:
    def test_passes_what_is_valid(self, scene):
        assert_valid_path(scene, [FREE, [0.0, 3, 0, 0, 0, 0], [8.0, 3, 0, 0, 0, 0], BEHIND])

    def test_finds_what_lies_between_two_valid_configurations(self, scene):
        head, _, contact = message(assert_valid_path, scene, [[-6.0, *FREE[1:]], FREE, BEHIND], resolution=0.01)
        # The cubes touch where the moving one has come to x = 2, a quarter of the way.
        assert head == (
            "the path is not valid between its configurations 1 and 2 of 3, 25% of the way (1 of its 2 edges are not)"
        )
        assert contact.startswith("    cube and cube_2 (obstacle): ")

    def test_says_which_configuration_is_bad(self, scene):
        head = message(assert_valid_path, scene, [FREE, OUTSIDE])[0]
        assert head.startswith("the path is not valid ")
        head = message(assert_valid_path, scene, [OUTSIDE, FREE])[0]
        assert head == "the path is not valid at its configuration 0 of 2 (1 of its 1 edges are not)"

    def test_a_single_configuration_is_no_path(self, scene):
        with pytest.raises(ValueError, match="path"):
            assert_valid_path(scene, FREE)


class TestPicture:
    @needs_gl
    @needs("view")
    def test_is_drawn_where_it_was_asked_for(self, scene, tmp_path):
        from PIL import Image

        target = tmp_path / "new" / "deep.png"
        assert message(assert_free, scene, DEEP, picture=target)[-1] == f"    picture: {target}"
        with Image.open(target) as opened:
            assert opened.size == (1280, 960)
            assert len(opened.convert("RGB").getcolors(1 << 20)) > 20

    def test_that_cannot_be_drawn_hides_nothing(self, scene, tmp_path, monkeypatch):
        monkeypatch.setenv("MUJOCO_GL", "disable")
        lines = message(assert_free, scene, DEEP, picture=tmp_path / "deep.png")
        assert lines[0] == "the configuration is in collision"
        assert lines[-1].startswith("    no picture: pictures ")


TESTS = """
import sys

def test_start_is_cheap():
    assert "env2mjcf.testing.pytest_plugin" in sys.modules
    assert not {{"mujoco", "numpy", "trimesh"}} & set(sys.modules)

def test_scene_is_loaded_once(load_scene):
    scene = load_scene(r"{scene}")
    assert load_scene(r"{scene}", robots=[]) is scene
    assert load_scene(r"{scene}", collision="hull") is not scene
    test_scene_is_loaded_once.scene = scene

def test_scene_stays_for_the_session(load_scene):
    assert load_scene(r"{scene}") is test_scene_is_loaded_once.scene

def test_finds_a_collision(load_scene):
    from env2mjcf.testing import assert_free
    assert_free(load_scene(r"{scene}"), {deep})
"""


class TestPlugin:
    @pytest.fixture
    def run(self, pytester: pytest.Pytester, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
        scene = write_scene(tmp_path / "of it", free_cube("3 0 0 0 0 0"))
        pytester.makepyfile(test_it=TESTS.format(scene=scene, deep=DEEP))
        # The plugin is loaded by name, so that it does not matter how env2mjcf is installed here.
        monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
        monkeypatch.setenv("PYTHONPATH", str(ROOT))
        return lambda *words: pytester.runpytest_subprocess(
            "-p", "env2mjcf.testing.pytest_plugin", "-p", "no:cacheprovider", *words
        )

    def test_gives_scenes_and_readable_failures(self, run):
        result = run()
        result.assert_outcomes(passed=3, failed=1)
        result.stdout.fnmatch_lines(
            [
                "E *AssertionError: the configuration is in collision",
                "E *q = [[]2.25, 0.0, *(cube.x, cube.y, *",
                "E *cube and cube_2 (obstacle): 0.25 m deep at (*",
            ]
        )
        # What is inside the assertion is not news to the author of the test.
        result.stdout.no_fnmatch_line("*raise AssertionError*")
        result.stdout.no_fnmatch_line("*picture*")

    @needs_gl
    @needs("view")
    @pytest.mark.slow
    def test_draws_failures_into_a_folder(self, run, pytester):
        result = run("--env2mjcf-pictures", "drawn", "-k", "finds")
        (picture,) = (pytester.path / "drawn").iterdir()
        assert picture.name.startswith("test_it-test_finds_a_collision-")
        assert picture.read_bytes().startswith(b"\x89PNG")
        result.stdout.fnmatch_lines([f"E *picture: *{picture.name}"])

    def test_says_its_option_in_pytests_help(self, run):
        run("--help").stdout.fnmatch_lines(["env2mjcf:", "*--env2mjcf-pictures=DIR*"])

    def test_is_an_entry_point_and_is_shipped(self):
        project = tomllib.loads((ROOT / "pyproject.toml").read_text())
        assert project["project"]["entry-points"]["pytest11"] == {"env2mjcf": "env2mjcf.testing.pytest_plugin"}
        assert importlib.util.find_spec("env2mjcf.testing.pytest_plugin")

    def test_imports_nothing_but_pytest(self):
        code = (
            "import sys, env2mjcf.testing.pytest_plugin\n"
            "sys.exit(' '.join({'lxml', 'numpy', 'mujoco'} & set(sys.modules)) or 0)"
        )
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        done = subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stderr) == (0, "")
