"""`read_configurations`: one function for every kind of file, its values computed by hand."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scenes import write_scene

import env2mjcf
from env2mjcf import FormatError, Scene

PATH = "VIZMO_PATH_FILE   Path Version 2012\n1\n2\n1 3 4 0.5\n0 1 2\n"
ROADMAP = (
    "#####ENVFILESTART#####\na.env\n#####ENVFILESTOP#####\n#####GRAPHSTART#####\n2 2 2\n"
    "0 0 1 2 1 1 0 2.0\n1 0 5 6 1 0 0 2.0\n#####GRAPHSTOP#####\n"
)
# The scene's scale is a half, and half a turn is one of the file's units of angle.
ALL, HALF = [1, 2, 3, 4, 0.5], [0.5, 1, 1.5, 2, math.pi / 2]
SECOND, FIRST = [0, 0, 1.5, 2, math.pi / 2], [0.5, 1, 0, 0, 0]


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """Two planar cubes, the second of which turns, at home in the origin."""
    cube = "Active\n1\ncube.g Planar Translational\nConnections\n0\n"
    text = f"Multibodies\n2\n\n{cube}\n{cube.replace('Translational', 'Rotational')}"
    text = f"Boundary Box [-10:10 ; -10:10 ; -10:10]\n\n{text}"
    return env2mjcf.load(write_scene(tmp_path_factory.mktemp("scene"), text), scale=0.5, engine="mujoco")


@pytest.mark.parametrize(
    ("name", "text", "file_units", "expected"),
    [
        ("a.csv", "x,y,x,y,angle\n1,2,3,4,0.5\n", False, [ALL]),
        ("a.csv", "1 2 3 4 0.5\n1 3 4 0.5  # robot 1\n", True, [HALF, SECOND]),
        ("a.TXT", "1 3 4 0.5\n", False, [[0, 0, 3, 4, 0.5]]),
        # Each robot of a query stands at its start while the other moves.
        ("a.query", "0 1 2\n1 3 4 0.5\n", False, [HALF, HALF]),
        ("a.query", "0 1 2\n0 9 9\n1 3 4 0.5\n", True, [HALF, [4.5, 4.5, *HALF[2:]], HALF]),
        ("a.path", PATH, False, [SECOND, FIRST]),
        ("a.map", ROADMAP, True, [FIRST, [2.5, 3, 0, 0, 0]]),
        ("named otherwise", PATH, True, [SECOND, FIRST]),
        ("otherwise.query", ROADMAP, False, [FIRST, [2.5, 3, 0, 0, 0]]),
    ],
)
def test_files_of_every_kind(
    scene: Scene, tmp_path: Path, name: str, text: str, file_units: bool, expected: list[list[float]]
) -> None:
    (tmp_path / name).write_text(text)
    q = env2mjcf.read_configurations(tmp_path / name, scene, file_units=file_units)
    assert q.dtype == np.float64
    np.testing.assert_allclose(q, expected, atol=1e-15)


@pytest.mark.parametrize(("file_units", "expected"), [(False, ALL), (True, HALF)])
def test_numpy_files(scene: Scene, tmp_path: Path, file_units: bool, expected: list[float]) -> None:
    np.save(tmp_path / "a.npy", np.array([ALL, ALL], dtype=np.float32))
    q = env2mjcf.read_configurations(str(tmp_path / "a.npy"), scene, file_units=file_units)
    assert type(q) is np.ndarray  # in memory: the file may be written anew
    assert q.dtype == np.float64
    np.testing.assert_allclose(q, [expected, expected], atol=1e-15)
    np.save(tmp_path / "a.npy", np.array([1, 3, 4, 0]))
    q = env2mjcf.read_configurations(tmp_path / "a.npy", scene)
    np.testing.assert_array_equal(q, [[0, 0, 3, 4, 0]])


@pytest.mark.parametrize(
    ("name", "text", "code"),
    [
        ("a.csv", "1 2 x\n", "CFG502"),
        ("a.csv", "1 2 3 4 nan\n", "CFG502"),
        ("a.csv", "9 2 3\n", "CFG504"),
        ("a.csv", "x,y\n", "CFG503"),
        ("a.query", "7 7 7 7 7 7 7\n", "CFG504"),
        ("a.npy", "1 2\n", "CFG505"),
        ("missing.csv", None, "ENV101"),
    ],
)
def test_what_cannot_be_read_is_said(scene: Scene, tmp_path: Path, name: str, text: str | None, code: str) -> None:
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(FormatError) as caught:
        env2mjcf.read_configurations(tmp_path / name, scene)
    assert caught.value.code == code


def test_a_large_file_is_refused_and_warnings_are_errors_if_wanted(scene: Scene, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("1 2 3 4 5\n" * 100)
    with pytest.raises(FormatError, match="more than 100 bytes"):
        env2mjcf.read_configurations(tmp_path / "a.csv", scene, limits=env2mjcf.Limits(file_bytes=100))
    (tmp_path / "a.query").write_text("0 1 2\n")  # no goal
    assert len(env2mjcf.read_configurations(tmp_path / "a.query", scene)) == 1
    with pytest.raises(FormatError, match="start and a goal"):
        env2mjcf.read_configurations(tmp_path / "a.query", scene, strict=True)
