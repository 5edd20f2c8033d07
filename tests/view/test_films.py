"""Films: as many pictures as promised, of robots that are where the path says."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cameras import projected
from extras import needs
from scenes import free_cube, write_scene

import env2mjcf
from env2mjcf.companions import read_path, write_path
from env2mjcf.view import film, offscreen
from env2mjcf.view.films import encoder
from env2mjcf.view.trails import paced, reference_points

needs_gl = pytest.mark.skipif(offscreen.backend() is None, reason=f"no GL: {offscreen.missing()}")
needs_view = needs("view")
CORNERS = np.array([[x, y, z, 1] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
PATH = np.array([[-3, -3, 0, 0, 0, 0], [-3, 2, 0, 0, 0, 3.0], [3, 2, 0, 0, 0, -3.0]])


@pytest.fixture(scope="module")
def cubes(tmp_path_factory: pytest.TempPathFactory) -> env2mjcf.Scene:
    """A free cube and a wall on the last stretch of its path."""
    return env2mjcf.load(write_scene(tmp_path_factory.mktemp("cubes"), free_cube("0 2.5 0 0 0 0")))


def decoded(file: Path) -> tuple[dict, list[np.ndarray]]:
    """Return what a film's header says, and its pictures."""
    import imageio_ffmpeg

    frames: Iterator = imageio_ffmpeg.read_frames(str(file))
    head = next(frames)
    width, height = head["size"]
    return head, [np.frombuffer(f, dtype=np.uint8).reshape(height, width, 3).astype(int) for f in frames]


def blue(picture: np.ndarray) -> np.ndarray:
    """Return the corners (x, y) of the box around what has a robot's blue, (2, 2)."""
    found = np.argwhere(picture[..., 2] > 1.4 * picture[..., 0] + 10)[:, ::-1]
    return np.array([found.min(axis=0), found.max(axis=0) + 1])


@needs_gl
@needs_view
def test_the_robot_in_a_film_follows_the_path(cubes: env2mjcf.Scene, tmp_path: Path) -> None:
    free = PATH[:2]
    made = film(cubes, free, tmp_path / "a.mp4", seconds=2, fps=10, size=(641, 481), camera="top", ghosts=False)
    head, pictures = decoded(made.file)
    assert (head["size"], head["fps"], len(pictures), len(made.q)) == ((640, 480), 10, 20, 20)
    assert not made.in_contact.any()
    # Straight, and at constant speed: what moves furthest is a corner, and it does so evenly.
    share = (made.q[:, 1] + 3) / 5
    np.testing.assert_allclose(made.q, free[0] + share[:, None] * (free[1] - free[0]), atol=1e-12)
    corners = (cubes.link_poses(made.q)[:, 0] @ CORNERS.T).swapaxes(1, 2)[..., :3]
    steps = np.linalg.norm(np.diff(corners, axis=0), axis=2).max(axis=1)
    assert steps.max() < 1.02 * steps.min()
    for picture, points in zip(pictures, corners, strict=True):
        # Colours are stored for blocks of 2 x 2 pixels, and those of 16 x 16 spill into each other.
        expected = projected(points, made.camera, (640, 480))
        np.testing.assert_allclose(blue(picture), [expected.min(axis=0), expected.max(axis=0)], atol=4.1)


@needs_gl
@needs_view
def test_what_touches_is_red_for_as_long_as_it_does(cubes: env2mjcf.Scene, tmp_path: Path) -> None:
    made = film(cubes, PATH, tmp_path / "a.mp4", seconds=2, fps=10, size=(320, 240), ghosts=False)
    np.testing.assert_array_equal(made.in_contact, cubes.in_collision(made.q))
    assert 2 < made.in_contact.sum() < 10
    for picture, touches in zip(decoded(made.file)[1], made.in_contact, strict=True):
        assert (np.count_nonzero(picture[..., 0] - picture[..., 2] > 60) > 100) == touches


@needs_gl
@needs_view
def test_a_gif_has_as_many_pictures(cubes: env2mjcf.Scene, tmp_path: Path) -> None:
    from PIL import Image as image

    made = film(cubes, PATH, tmp_path / "a.gif", seconds=1.5, fps=10, size=(160, 120))
    with image.open(made.file) as opened:
        durations = []
        for i in range(opened.n_frames):
            opened.seek(i)
            durations.append(opened.info["duration"])
    # Equal pictures may be stored as one that stands for longer.
    assert sum(durations) == 15 * 100 + 1000


def test_speed_is_constant_whatever_the_nodes_are(cubes: env2mjcf.Scene) -> None:
    uneven = np.concatenate([np.linspace(PATH[0], PATH[1], 40), PATH[2:]])
    few, length = paced(cubes, PATH, 50)
    many, same = paced(cubes, uneven, 50)
    assert length == pytest.approx(same, rel=1e-3)
    np.testing.assert_allclose(few, many, atol=0.02)
    np.testing.assert_array_equal(few[0], PATH[0])
    np.testing.assert_allclose(few[-1, :5], PATH[-1, :5])
    assert few[-1, 5] == pytest.approx(2 * np.pi - 3.0), "the short way round, without a jump"
    ways = reference_points(cubes, few)
    np.testing.assert_allclose(ways[0], few[:, :3], atol=1e-12)


def test_a_path_that_stands_still_is_a_still(cubes: env2mjcf.Scene) -> None:
    q, length = paced(cubes, PATH[[0, 0]], 5)
    assert length == 0
    np.testing.assert_array_equal(q, PATH[[0] * 5])


@needs_view
@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        ("a.avi", {}, r"expected \.mp4 or \.gif"),
        ("a", {}, "ends in nothing"),
        ("a.mp4", {"fps": 0}, "^fps is 0; expected 1 to 1000$"),
        ("a.gif", {"fps": 51}, r"^fps is 51; a \.gif has at most 50 pictures a second"),
        ("a.mp4", {"seconds": -1.0}, "^seconds is -1.0; expected a positive"),
        ("a.mp4", {"seconds": 1e15}, "^seconds is 1e.15, at 25 pictures a second; expected a film of at most 10000"),
        ("a.mp4", {"size": (1, 1)}, "^size is 1 x 1 pixels; expected at least 2 x 2"),
    ],
)
def test_an_impossible_film_says_what_is_possible(
    cubes: env2mjcf.Scene, tmp_path: Path, name: str, arguments: dict[str, float], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        film(cubes, PATH, tmp_path / name, **arguments)
    assert not list(tmp_path.iterdir())


@needs_view
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"fps": math.nan}, "^fps is nan; expected a whole number"),
        ({"fps": 12.5}, "^fps is 12.5; expected a whole number"),
        ({"seconds": "3"}, "^seconds is '3'; expected a number"),
        ({"size": "160x120"}, "^size is '160x120'; expected width and height"),
        ({"size": (160.0, 120)}, "^size is "),
        ({"camera": 3}, "^camera is 3; expected a Viewpoint"),
    ],
)
def test_an_argument_of_a_wrong_kind_is_named(
    cubes: env2mjcf.Scene, tmp_path: Path, arguments: dict[str, Any], message: str
) -> None:
    with pytest.raises(TypeError, match=message):
        film(cubes, PATH, tmp_path / "a.mp4", **arguments)
    assert not list(tmp_path.iterdir())


@needs_view
def test_no_gif_is_quicker_than_players_play_it() -> None:
    with pytest.raises(ValueError, match="fps is 51"):
        encoder("a.GIF", 51)
    encoder("a.gif", 50)


@needs_view
@pytest.mark.parametrize("fps", [30, 45, 50])
def test_a_gif_is_as_long_as_it_should_be(tmp_path: Path, fps: int) -> None:
    from PIL import Image

    # No two pictures are alike: equal ones are joined.
    pictures = (np.full((4, 4, 3), shade, dtype=np.uint8) for shade in range(0, 180, 2))
    encoder("a.gif", fps)(tmp_path / "a.gif", pictures, fps)
    shown = Image.open(tmp_path / "a.gif")
    total = 0
    for i in range(shown.n_frames):
        shown.seek(i)
        total += shown.info["duration"]
    assert total - 1000 == pytest.approx(90 / fps * 1000, abs=10)


@pytest.mark.slow
@needs_gl
@needs_view
@pytest.mark.parametrize(
    ("scene", "path"),
    [
        ("old-testBranchs.branchs/branchs.env", "branchs.path"),
        ("old-testSerialInWall.serial/serial.env", "serial.path"),
    ],
)
def test_recorded_paths_play_without_a_contact(scene: str, path: str, corpus: Path, tmp_path: Path) -> None:
    env = corpus / "scenes" / scene
    loaded = env2mjcf.load(env)
    recorded = read_path(loaded, env.parent / path).q
    made = film(loaded, recorded, tmp_path / "a.mp4", seconds=10, fps=10, size=(160, 120))
    assert len(decoded(made.file)[1]) == 100
    assert not made.in_contact.any()
    # Link poses of the film lie on the recorded way: no further from it than recorded poses are from each other.
    filmed, nodes = (loaded.link_poses(q)[:, -1, :3, 3] for q in (made.q, recorded))
    spacing = np.linalg.norm(np.diff(nodes, axis=0), axis=1).max()
    nearest = np.linalg.norm(filmed[:, None] - nodes[None], axis=2).min(axis=1)
    assert nearest.max() <= spacing


def run(*words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the program in a folder."""
    command = [sys.executable, "-m", "env2mjcf", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.slow
@needs_gl
@needs_view
def test_play_says_what_touches_when(cubes: env2mjcf.Scene, tmp_path: Path) -> None:
    write_scene(tmp_path, free_cube("0 2.5 0 0 0 0"))
    write_path(cubes, PATH, tmp_path / "a.path")
    words = ("play", "scene.env", "a.path", "-o", "a.mp4", "--seconds", "2", "--fps", "10", "--size", "160x120")
    shown = run(*words, folder=tmp_path)
    assert shown.returncode == 0, shown.stderr
    assert shown.stdout.startswith("a.mp4: 20 pictures, 2 seconds\n")
    assert " s: cube touches cube_2" in shown.stdout
    told = json.loads(run(*words, "--json", folder=tmp_path).stdout)
    assert told["pictures"] == len(told["configurations"]) == len(told["touching"]) == 20
    assert [["cube", "cube_2"]] in told["touching"]


@needs_gl
@needs_view
@pytest.mark.slow
def test_render_draws_a_query_a_trail_and_contacts(cubes: env2mjcf.Scene, tmp_path: Path) -> None:
    write_scene(tmp_path, free_cube("0 2.5 0 0 0 0"))
    write_path(cubes, PATH, tmp_path / "a.path")
    (tmp_path / "a.query").write_text("0 -3 -3 0 0 0 0\n0 3 2 0 0 0 0\n")
    words = ("render", "scene.env", "-o", "a.png", "--size", "160x120")
    assert run(*words, "--query", "a.query", "--trail", "a.path", folder=tmp_path).stdout == "a.png: 160 x 120 pixels\n"
    shown = run(*words, "--config", "0", "2", "0", "0", "0", "0", "--contacts", "--camera", "120,-35", folder=tmp_path)
    assert shown.stdout == "a.png: 160 x 120 pixels\n    cube touches cube_2\n"


@pytest.mark.slow_but("words1")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("-o", "a.jpg"), "expected a file that ends in .png"),
        (("-o", "a.png", "--camera", "above"), "azimuth,elevation in degrees"),
        (("-o", "a.png", "--camera", "10,-100"), "azimuth,elevation in degrees"),
        (("-o", "a.png", "--size", "12"), "as in 1280x960"),
        (("-o", "a.png", "--config", "1", "2"), "2 numbers; expected 6"),
    ],
)
def test_render_refuses_what_it_cannot_do(words: tuple[str, ...], message: str, tmp_path: Path) -> None:
    write_scene(tmp_path, free_cube())
    shown = run("render", "scene.env", *words, folder=tmp_path)
    assert (shown.returncode, shown.stdout) == (2, "")
    assert message in shown.stderr


@pytest.mark.slow_but("words0")
@needs_view
@pytest.mark.parametrize("words", [("render",), ("play", "a.path"), ("check", "a.path")])
def test_a_place_that_cannot_be_written_is_told_before_anything_is_drawn(
    cubes: env2mjcf.Scene, words: tuple[str, ...], tmp_path: Path
) -> None:
    write_scene(tmp_path, free_cube())
    write_path(cubes, PATH[:2], tmp_path / "a.path")
    verb, *rest = words
    out = {"render": ("-o", "none/a.png"), "play": ("-o", "none/a.mp4"), "check": ("--picture", "none/a.png")}[verb]
    shown = run(verb, "scene.env", *rest, *out, folder=tmp_path)
    assert (shown.returncode, shown.stdout) == (3, "")
    assert "error CFG552: none/a." in shown.stderr
    assert "lies in none, which is not a folder" in shown.stderr


@pytest.mark.slow
def test_a_gl_library_that_is_none_is_wrong_usage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_scene(tmp_path, free_cube())
    monkeypatch.setenv("MUJOCO_GL", "bogus")
    for words in (("render", "scene.env", "-o", "a.png"), ("info", "scene.env")):
        shown = run(*words, folder=tmp_path)
        assert (shown.returncode, shown.stdout) == (2, "")
        assert f"{words[0]}: MUJOCO_GL is 'bogus'; expected " in shown.stderr
        assert "or disable for no pictures, or leave it unset" in shown.stderr


def test_without_gl_render_says_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_scene(tmp_path, free_cube())
    monkeypatch.setenv("MUJOCO_GL", "disable")
    shown = run("render", "scene.env", "-o", "a.png", folder=tmp_path)
    assert (shown.returncode, shown.stdout) == (2, "")
    assert "render: pictures are switched off by MUJOCO_GL" in shown.stderr
    assert not (tmp_path / "a.png").exists()
