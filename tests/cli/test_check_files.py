"""`env2mjcf check` on paths and roadmaps: what it prints, and its exit status."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from extras import needs
from scenes import box_mesh, free_cube, write_scene

import env2mjcf
from env2mjcf import Roadmap
from env2mjcf.cli.main import main
from env2mjcf.view.offscreen import backend

HEAD = "VIZMO_PATH_FILE   Path Version 2012\n1\n"
# The cube goes along x and meets the wall, half a metre thick on either side of x = 3.
ACROSS = f"{HEAD}3\n0 -2 0 0 0 0 0\n0 0 0 0 0 0 0\n0 6 0 0 0 0 0\n"
SERIAL = (
    "1\nMultiBody Active\n2\nFreeBody 0 cube.g 0 0 0 0 0 0\nFreeBody 1 cube.g\nConnection\n1\n"
    "0 1 Actuated\n1 0 0 0 0 0  0 0 0 0 Revolute 1 0 0 0 0 0\n"
)
OLD_MAP = (
    "Roadmap Version Number 061300\n#####LPSTART#####\n2\nstraightline\nrotate_at_s 0.5\n#####LPSTOP#####\n"
    "#####GRAPHSTART#####\n2 1 2\n0 {} -1 -1 -1 1 1 {} 9\n1 {} -1 -1 -1 1 0 {} 9\n#####GRAPHSTOP#####\n"
)


class Run:
    def __init__(self, capsys: pytest.CaptureFixture[str], *words: object) -> None:
        capsys.readouterr()
        self.status = main(["check", *map(str, words), "--engine", "mujoco"])
        self.out, self.err = capsys.readouterr()

    @property
    def json(self) -> dict:
        return json.loads(self.out)


@pytest.fixture
def check(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    write_scene(tmp_path, free_cube("wall.g 3 0 0 0 0 0"), wall=box_mesh(0.5, 5, 5))
    (tmp_path / "x.path").write_text(ACROSS)
    return lambda *words: Run(capsys, "scene.env", *words)


def test_a_path_is_checked_node_by_node_and_edge_by_edge(check) -> None:
    found = check("x.path", "--resolution", 0.1)
    assert found.status == 1
    lines = found.out.splitlines()
    # Where on the wide face they meet is not of interest.
    assert lines.pop(5).startswith("    cube and wall (obstacle): 0.1 m deep at (2.55, ")
    assert lines == [
        "configuration 1 of 3 (x.path:4): valid",
        "configuration 2 of 3 (x.path:5): valid",
        "configuration 3 of 3 (x.path:6): valid",
        "edge from configuration 1 to 2 (x.path:4): valid",
        "edge from configuration 2 to 3 (x.path:5): in collision at 0.35 of the way",
        "3 configurations: 3 valid",
        "2 edges, checked every 0.1 m: 1 valid, 1 invalid",
        "first invalid: edge from configuration 2 to 3 (x.path:5), at 0.35 of the way",
    ]


def test_json_holds_every_node_and_edge(check) -> None:
    found = check("x.path", "--json", "--resolution", 0.1)
    assert found.status == 1
    report = found.json
    assert (report["valid"], report["kind"], report["version"]) == (False, "path", "2012")
    assert (report["resolution"], report["certified"], report["pose_error"]) == (0.1, False, None)
    assert [(c["valid"], c["line"], c["q"][0]) for c in report["configurations"]] == [
        (True, 4, -2),
        (True, 5, 0),
        (True, 6, 6),
    ]
    first, second = report["edges"]
    assert (first["start"], first["end"], first["valid"], first["fraction"], first["at"]) == (0, 1, True, None, None)
    assert (second["start"], second["end"], second["valid"]) == (1, 2, False)
    assert second["fraction"] == pytest.approx(0.35)
    assert second["at"]["q"][0] == pytest.approx(2.1)
    assert second["at"]["contacts"][0]["other"] == "wall"


def test_a_valid_path_is_status_0_and_an_empty_one_is_bad_input(check, tmp_path: Path) -> None:
    (tmp_path / "x.path").write_text(f"{HEAD}2\n0 -2 0 0 0 0 0\n0 0 0 0 0 0 0\n")
    assert check("x.path", "--certified").status == 0
    (tmp_path / "x.path").write_text(f"{HEAD}0\n")
    found = check("x.path")
    assert (found.status, found.out) == (3, "")
    assert "error CFG503: x.path holds no configuration" in found.err
    np.save(tmp_path / "x.npy", np.zeros((0, 6)))
    assert check("x.npy").status == 3


def test_a_file_is_known_by_what_it_says(check, tmp_path: Path) -> None:
    (tmp_path / "what.txt2").write_text(ACROSS)
    assert "2 edges" in check("what.txt2").out
    (tmp_path / "graph").write_text("#####GRAPHSTART#####\n1 0 1\n0 0 1 0 0 0 0 0 0\n#####GRAPHSTOP#####\n")
    assert "1 node: 1 valid" in check("graph").out
    (tmp_path / "broken.path").write_text("1 2 3 4 5 6\n")
    found = check("broken.path")
    assert (found.status, "CFG510" in found.err) == (3, True)


def test_a_proof_finds_what_steps_pass_over(check, tmp_path: Path) -> None:
    (tmp_path / "x.path").write_text(f"{HEAD}2\n0 0 0 0 0 0 0\n0 9 0 0 0 0 0\n")
    assert check("x.path", "--resolution", 50).status == 0
    found = check("x.path", "--resolution", 50, "--certified")
    assert found.status == 1
    assert "edge from configuration 1 to 2 (x.path:4): not proved" in found.out
    assert "1 edge, checked every 50 m: 0 valid and proved free, 1 not proved" in found.out


def test_a_roadmap_names_its_nodes_by_their_ids(check, tmp_path: Path) -> None:
    scene = env2mjcf.load("scene.env", engine="mujoco")
    q = np.zeros((4, 6))
    q[:, 0] = -2, 0, 3, 6
    made = Roadmap.of(q, [[0, 1], [1, 2], [1, 3]])
    env2mjcf.write_roadmap(scene, made, "x.map")
    (tmp_path / "x.map").write_text(
        (tmp_path / "x.map").read_text().replace("\n3 0 ", "\n9 0 ").replace(" 3 0 6.", " 9 0 6.")
    )
    found = check("x.map", "--resolution", 0.1)
    assert found.status == 1
    assert "node 2 (x.map:8): in collision" in found.out
    assert "edge from node 1 to 9 (x.map:7): in collision at 0.35 of the way" in found.out
    assert found.out.splitlines()[-4:] == [
        "4 nodes: 3 valid, 1 in collision",
        "3 edges, checked every 0.1 m: 1 valid, 2 invalid",
        "first invalid: node 2 (x.map:8)",
        "first invalid: edge from node 1 to 2 (x.map:7), at 0.7 of the way",
    ]
    report = check("x.map", "--json").json
    assert [c["id"] for c in report["configurations"]] == [0, 1, 2, 9]


def test_many_are_listed_on_request(check, tmp_path: Path) -> None:
    rows = "".join(f"0 {3 + i / 100} 0 0 0 0 0\n" for i in range(30))
    (tmp_path / "x.path").write_text(f"{HEAD}30\n{rows}")
    found = check("x.path")
    assert found.out.count(": in collision") == 40
    assert "... and 10 more that are invalid (--all lists every configuration)" in found.out
    assert "... and 9 more that are invalid (--all lists every edge)" in found.out
    assert check("x.path", "--all").out.count(": in collision") == 59


def test_edges_go_the_way_that_their_local_planner_went(check, tmp_path: Path) -> None:
    """Turning half way, the second cube keeps 1.5 m away from the first; turning all the way it hits a pin."""
    pin = "MultiBody Passive\n1\nFixedBody 0 pin.g 4.15 0.98 0 0 0 0\nConnection\n0\n"
    text = SERIAL.replace("1\nMultiBody Active", "2\nMultiBody Active", 1) + pin
    write_scene(tmp_path, text, pin=box_mesh(0.05, 0.05, 0.05))
    for planner, valid in ((1, False), (2, True)):
        (tmp_path / "x.map").write_text(OLD_MAP.format("0 0 0 0 0 0 0", planner, "8 0 0 0 0 0.25 0", planner))
        report = check("x.map", "--json", "--resolution", 0.02).json
        assert [c["valid"] for c in report["configurations"]] == [True, True]
        assert report["edges"][0]["valid"] is valid


def test_unknown_local_planners_are_told(check, tmp_path: Path) -> None:
    text = OLD_MAP.format("0 0 0 0 0 0", 2, "1 0 0 0 0 0", 2).replace("rotate_at_s 0.5", "a_star_distance 6 9")
    (tmp_path / "x.map").write_text(text)
    found = check("x.map", "--verbose")
    assert found.status == 0
    assert "CFG534: 1 edge made by the local planner 'a_star_distance 6 9'" in found.err


def poses(*x: float) -> str:
    """Return recorded poses of the two links of `SERIAL` at these places, the second one metre too far out."""
    lines = "".join(f"{v} 0 0 0 0 0\n{v + 3} 0 0 0 0 0\n" for v in x)
    return f"VIZMO_PATH_FILE   Path Version 20001022\n2\n{len(x)}\n{lines}"


def test_poses_of_no_configuration_are_checked_where_they_are(check, tmp_path: Path) -> None:
    write_scene(tmp_path, SERIAL.replace("1\nMultiBody Active", "2\nMultiBody Active", 1)
                + "MultiBody Passive\n1\nFixedBody 0 cube.g 9 0 0 0 0 0\nConnection\n0\n")  # fmt: skip
    (tmp_path / "x.path").write_text(poses(0, 6.5))
    found = check("x.path")
    assert found.status == 1
    assert "CFG518" in found.err
    assert "configuration 1 of 2 (x.path:4): valid" in found.out
    # Where the file has it, the second link meets the obstacle; where the robot could have it, it would not.
    assert "configuration 2 of 2 (x.path:6): in collision" in found.out
    assert "edge from configuration 1 to 2 (x.path:4): not checked" in found.out
    assert (
        "recorded poses: 0 of 2 are configurations of the robot; links at most 1 m from where these put them"
        in found.out
    )
    assert "1 edge, checked every" in found.out
    (tmp_path / "x.path").write_text(poses(0, 6.5).replace("3.0", "2.0").replace("3 0", "2 0").replace("9.5", "8.5"))
    report = check("x.path", "--json").json
    assert report["pose_error"] < 1e-9


@pytest.mark.parametrize("words", [("--resolution", "0.1"), ("--certified",)])
def test_options_of_edges_are_refused_where_there_are_none(check, words: tuple[str, ...]) -> None:
    found = check("0", "0", "0", "0", "0", "0", *words)
    assert found.status == 2
    assert "there is none" in found.err


def test_wrong_usage(check) -> None:
    assert check("x.path", "--resolution", "-1").status == 2
    assert check("x.path", "--resolution", "1e-200").status == 2
    found = check("x.path", "--radians")
    assert (found.status, "units of their own" in found.err) == (2, True)


@needs("view")
def test_a_picture_shows_what_is_valid_in_green_and_what_is_not_in_red(check, tmp_path: Path) -> None:
    if backend() is None:
        pytest.skip("no pictures on this machine")
    from PIL import Image

    found = check("x.path", "--resolution", 0.1, "--picture", "x.png")
    assert found.status == 1
    pixels = np.asarray(Image.open(tmp_path / "x.png").convert("RGB")).astype(int)
    assert pixels.shape == (720, 960, 3)
    red, green, blue = np.moveaxis(pixels, -1, 0)
    assert ((green > red + 40) & (green > blue + 25)).sum() > 200
    assert ((red > green + 80) & (red > blue + 80)).sum() > 200


def test_a_picture_that_cannot_be_drawn_is_one_sentence(check, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")
    found = check("x.path", "--picture", "x.png")
    assert found.status == 2
    assert "pictures are switched off by MUJOCO_GL" in found.err
    assert check("x.path", "--picture", "x.jpg").status == 2
