"""Which pairs never and always touch, where geometry says so."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from scenes import box_mesh, free_cube, write_scene

import env2mjcf
from env2mjcf.cli.main import main
from env2mjcf.simulation.verdicts import count_touching

# A fixed foot in a block that it stands in, and a hand on a hinge about z, two away from the axis.
ARM = (
    "2\ncube.g Fixed 0 0 0 0 0 0\nhand.g Joint\nConnections\n1\n0 1 Revolute -1:1  0 0 0 0 0 0  0 0 0 0  3 0 0 0 0 0\n"
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """The hand sweeps a circle of radius 3: a ring's part at x = 3, a far block, and a plate under all of it."""
    text = free_cube(
        "0.25 0 0 0 0 0",  # cube_2: about the foot
        "9 9 0 0 0 0",  # cube_3: out of reach
        "0 3 0 0 0 0",  # cube_4: on the circle
        "plate.g 0 0 -0.3 0 0 0",
        robot=ARM,
    )
    return write_scene(tmp_path, text, hand=box_mesh(0.4, 0.4, 0.4), plate=box_mesh(5, 5, 0.1))


def test_counts_are_what_geometry_says(path):
    counts = {(c.link, c.other): c for c in count_touching(env2mjcf.load(path), 400)}
    verdicts = {k: (c.verdict, c.constant) for k, c in counts.items()}
    assert verdicts == {
        ("cube", "cube_2"): ("always", True),
        ("cube", "cube_3"): ("never", True),
        ("cube", "cube_4"): ("never", True),
        ("cube", "plate"): ("always", True),
        ("hand", "cube_2"): ("never", False),
        ("hand", "cube_3"): ("never", False),
        ("hand", "cube_4"): ("sometimes", False),
        ("hand", "plate"): ("always", False),
    }
    # Centres within about 0.9 of each other, of a way of 2 pi 3.
    assert 0.05 < counts["hand", "cube_4"].touches / 400 < 0.2
    assert {c.samples for c in counts.values()} == {400}


def test_one_sample_is_home(path):
    counts = {(c.link, c.other): c.touches for c in count_touching(env2mjcf.load(path), 1)}
    assert counts["hand", "plate"] == 1
    assert counts["hand", "cube_4"] == 0


def test_a_scene_without_robots_has_no_pairs(tmp_path):
    scene = env2mjcf.load(
        write_scene(tmp_path, "Boundary Box [-1:1; -1:1; -1:1]\nMultibodies\n1\nPassive\ncube.g 0 0 0 0 0 0\n")
    )
    assert count_touching(scene, 10) == ()


def test_info_tells(path, capsys):
    assert main(["info", str(path), "--pairs", "--json", "--samples", "50"]) == 0
    told = json.loads(capsys.readouterr().out)["touching"]
    assert told["samples"] == 50
    assert {p["other"]: p["verdict"] for p in told["pairs"] if p["link"] == "hand"}["plate"] == "always"
    assert main(["info", str(path), "--pairs", "--samples", "50"]) == 0
    out = capsys.readouterr().out
    assert "cube  cube_2  always: neither moves against the other" in out
    assert "hand  cube_3  never, in 50 samples" in out
    assert "sampled, not proved: home and 49 uniform configurations; 2 pairs never touched, 1 always did" in out
