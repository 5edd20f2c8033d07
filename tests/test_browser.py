"""The viewer end to end: the program, its page in a headless Chromium, a hand on the sliders."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from browsing import ROOT, Tab, browser, needs_chromium, viewing
from scenes import box_mesh, free_cube, write_scene

pytestmark = needs_chromium
SEED = ROOT / "models" / "seed" / "seed.env"
START = [0, 0, 0, 0, 0, 0, 0.125, 0.875, 0.125]
GOAL = [0, 4, 0.5, 0, 0, 0.5, 0.1, 0.1, 0.9]
NAMES = [f"cube.{k}" for k in ("x", "y", "z", "rx", "ry", "rz")] + [f"link{i}.theta" for i in (1, 2, 3)]


def reddish(picture: np.ndarray) -> int:
    """Return how many pixels are clearly red."""
    red, green, blue = picture.astype(int).transpose(2, 0, 1)
    return int(((red > green + 60) & (red > blue + 60)).sum())


@pytest.mark.slow
def test_a_hand_on_a_slider_moves_the_robot_into_a_wall_and_a_path_out_of_it(tmp_path: Path) -> None:
    path = tmp_path / "way.csv"
    path.write_text("\n".join(",".join(map(str, row)) for row in (START, GOAL)))
    with viewing(SEED, "--query", SEED.with_suffix(".query"), "--path", path) as address, browser() as context:
        tab = Tab(context, address)
        tab.wait_status("valid")
        assert tab.numbers() == {**dict(zip(NAMES, START, strict=True)), "along": 0}
        free = tab.picture()

        tab.drag("cube.y", 0.5)  # of 0 to 4, and the wall is at 2
        tab.wait_status("in collision")
        y = tab.numbers()["cube.y"]
        assert y == pytest.approx(2, abs=0.2)
        # The page says what `check` says of the same numbers, in the same words.
        told = check(SEED, [0, y, *START[2:]])
        assert told
        assert sorted(map(pair, tab.reasons())) == sorted(told)
        hit = tab.picture()
        assert np.mean(np.any(free != hit, axis=2)) > 0.02
        assert reddish(hit) > 100 > reddish(free)

        tab.press("goal")
        tab.wait_status("valid")
        assert [tab.numbers()[name] for name in NAMES] == GOAL
        assert reddish(tab.picture()) < 100

        tab.press("play")
        tab.page.wait_for_function("document.querySelector('#reasons').innerText.includes('cube and block')")
        tab.press("pause")
        tab.page.get_by_role("button", name="play", exact=True).wait_for()
        seen = tab.numbers()
        assert 0 < seen["along"] < 1
        # The way is straight, and everything is as far along it.
        assert seen["cube.y"] == pytest.approx(4 * seen["along"], abs=0.01)
        assert seen["cube.z"] == pytest.approx(0.5 * seen["along"], abs=0.01)

        shot = tmp_path / "page.png"
        tab.page.screenshot(path=shot)
        assert shot.stat().st_size > 20_000
        assert {urlsplit(u).hostname for u in tab.requests if not u.startswith(("blob:", "data:"))} == {"127.0.0.1"}


@pytest.mark.slow
def test_names_of_files_are_text_on_the_page_and_all_tabs_see_the_same(tmp_path: Path) -> None:
    wall, robot = "<b>wall<i>&amp;", "**cube**<script>"
    text = free_cube(f"{wall}.g 3 0 0 0 0 0", robot=f"1\n{robot}.g Planar Translational\nConnections\n0\n")
    box = box_mesh(0.5, 0.5, 0.5)
    with viewing(write_scene(tmp_path, text, **{wall: box, robot: box})) as address, browser() as context:
        first, second = Tab(context, address), Tab(context, address)
        second.wait_status("valid")
        first.type(f"{robot}.x", 2.25)
        # Unit cubes with centres 0.75 apart are 0.25 in each other.
        for tab in (first, second):
            tab.wait_status("in collision")
            assert tab.reasons() == [f"{robot} and {wall} (obstacle) 0.25 m deep"]
            assert tab.numbers()[f"{robot}.x"] == 2.25


def pair(line: str) -> str:
    """Return `a and b (kind)` and the depth of a line of the page."""
    return line.replace(")", "):", 1)


def check(scene: Path, numbers: list[float]) -> list[str]:
    """Return the lines of `env2mjcf check` on what touches, without the places."""
    words = [sys.executable, "-m", "env2mjcf", "check", str(scene), *map(str, numbers), "--engine", "mujoco"]
    out = subprocess.run(words, capture_output=True, text=True, check=False).stdout
    return [line.strip().partition(" at (")[0] for line in out.splitlines() if line.startswith("    ")]
