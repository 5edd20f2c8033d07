"""What fuzzing has found in whole scenes, kept as small texts of our own making."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from pathlib import Path

import pytest
from folders import ROOT
from scenes import free_cube, write_scene

import env2mjcf

# A closed mesh with one corner in a wrong place: it crosses itself, and its volume adds up to nothing.
CROSSED = """1 8 12 36
1 12
0.95 0.95 0.95  0.95 0.95 -0.95  0.95 -0.95 -0.95  0.95 0.95 -0.95
0.95 -0.95 -0.95  -0.95 0.95 0.95  -0.95 0.95 -0.95  -0.95 0.95 -0.95
1 5 -7  1 7 -3  1 2 -6  1 6 -5  1 3 -4  1 4 -2
5 6 -8  5 8 -7  2 4 -8  2 8 -6  3 7 -8  3 8 -4
"""
# A chain that is a loop, open by four million kilometres: its inertia matrix is close to singular.
STRETCHED = """1
MultiBody Active
3
FreeBody 0 cube.g 0 0 0 0 0 0
FreeBody 1 cube.g
FreeBody 2 cube.g
Connection
2
0 1 Actuated
0.5 4294967296 0 0 0 0  0 1 0 0  Revolute  -0.5 0 0 0 0 0
1 2 Actuated
0.5 0 0 0 0 0  0 1 0 0  Revolute  -0.5 0 0 0 0 0
"""


@pytest.fixture(autouse=True)
def no_warnings() -> None:
    warnings.simplefilter("error", RuntimeWarning)


def test_a_mesh_whose_volume_adds_up_to_nothing_is_read(tmp_path: Path) -> None:
    scene = env2mjcf.load(write_scene(tmp_path, free_cube("crossed.g 3 0 0 0 0 0"), crossed=CROSSED), engine="mujoco")
    assert "nan" not in repr(scene.report)
    assert "inf" not in repr(scene.report.meshes)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (free_cube("-1e155 0 0 0 0 0"), 13),
        (free_cube("0 0 1e308 0 0 0"), 13),
        (free_cube("0 0 1e31 0 0 0"), 13),
        (STRETCHED.replace("4294967296", "1e308"), 5),
        (STRETCHED.replace("FreeBody 0 cube.g 0", "FreeBody 0 cube.g 1e200"), 4),
    ],
)
def test_a_body_too_far_away_to_be_computed_with_is_refused_at_its_line(text: str, line: int, tmp_path: Path) -> None:
    with pytest.raises(env2mjcf.GeometryError) as caught:
        env2mjcf.load(write_scene(tmp_path, text))
    assert caught.value.code == "GEO252"
    assert caught.value.diagnostic.span is not None
    assert caught.value.diagnostic.span.line == line


@pytest.mark.slow
def test_a_warning_of_mujoco_s_is_one_of_python_s_and_in_no_file(tmp_path: Path) -> None:
    write_scene(tmp_path, STRETCHED)

    def convert(*flags: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, *flags, "-m", "env2mjcf", "convert", "scene.env", "out"], cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False,
        )  # fmt: skip

    plain, strict = convert(), convert("-W", "error::UserWarning")
    assert plain.returncode == 0
    assert "UserWarning: Inertia matrix is too close to singular" in plain.stderr
    assert strict.returncode == 3
    assert "error MJC402: MuJoCo" in strict.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["cube.g", "out", "scene.env"]
