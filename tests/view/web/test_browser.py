"""The viewer end to end: the program, its page in a headless Chromium, a hand on the sliders."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from browsing import ROOT, Tab, browser, needs_chromium, viewing
from scenes import box_mesh, free_cube, write_scene

import env2mjcf

pytestmark = needs_chromium
SEED = ROOT / "models" / "seed" / "seed.env"
START = [0, 0, 0, 0, 0, 0, 0.125, 0.875, 0.125]
GOAL = [0, 4, 0.5, 0, 0, 0.5, 0.1, 0.1, 0.9]
NAMES = [f"cube.{k}" for k in ("x", "y", "z", "rx", "ry", "rz")] + [f"link{i}.theta" for i in (1, 2, 3)]


def coloured(picture: np.ndarray) -> int:
    """Return how many pixels are not background, which is almost grey."""
    return int((np.ptp(picture.astype(int), axis=2) > 24).sum())


def is_red(picture: np.ndarray) -> bool:
    """Return whether something is clearly red, as only what touches is in this scene."""
    red, green, blue = picture.astype(int).transpose(2, 0, 1)
    return int(((red > green + 60) & (red > blue + 60)).sum()) > 100


@pytest.mark.slow
def test_a_hand_on_a_slider_moves_the_robot_into_a_wall_and_a_path_out_of_it(tmp_path: Path) -> None:
    path = tmp_path / "way.csv"
    path.write_text("\n".join(",".join(map(str, row)) for row in (START, GOAL)))
    with viewing(SEED, "--query", SEED.with_suffix(".query"), "--path", path) as address, browser() as context:
        tab = Tab(context, address)
        tab.wait_status("valid")
        assert tab.numbers() == {**dict(zip(NAMES, START, strict=True)), "along": 0}
        free = tab.wait_picture(lambda p: coloured(p) > 1000 and not is_red(p))

        tab.drag("cube.y", 0.5)  # of 0 to 4, and the wall is at 2
        tab.wait_status("in collision")
        y = tab.numbers()["cube.y"]
        assert y == pytest.approx(2, abs=0.2)
        scene = env2mjcf.load(SEED)
        told = touches(scene.space.decode([0, y, *START[2:]]), scene)
        assert told
        assert sorted(tab.reasons()) == sorted(told)
        hit = tab.wait_picture(is_red)
        assert np.mean(np.any(free != hit, axis=2)) > 0.02

        tab.press("goal")
        tab.wait_status("valid")
        assert [tab.numbers()[name] for name in NAMES] == GOAL
        tab.wait_picture(lambda p: not is_red(p))

        tab.drag("along", 0.2)
        tab.press("play")
        tab.page.wait_for_function("document.querySelector('#reasons').innerText.includes('cube and block')")
        tab.press("pause")
        tab.page.get_by_role("button", name="play", exact=True).wait_for()
        seen = tab.numbers()
        assert 0.2 < seen["along"] < 1
        # Everything is as far along its way, which is straight; all angles take the short way round, in turns.
        share = seen["cube.y"] / 4
        assert 0.2 < share < 1
        way = np.subtract(GOAL, START)
        way[3:] = (way[3:] + 0.5) % 1 - 0.5
        off = np.array([seen[name] for name in NAMES]) - (START + share * way)
        off[3:] -= np.round(off[3:])
        np.testing.assert_allclose(off, 0, atol=1e-9)

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


def touches(q: np.ndarray, scene: env2mjcf.Scene) -> list[str]:
    """Return a line for each pair that touches, with the depth of its deepest contact."""
    depths: dict[str, float] = {}
    for c in scene.contacts(q, engine="mujoco"):
        pair = f"{c.link} and {c.other} ({c.kind})"
        depths[pair] = max(depths.get(pair, 0.0), -c.distance)
    return [f"{pair} {depth:.3g} m deep" for pair, depth in depths.items()]
