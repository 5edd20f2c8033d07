"""The viewer but for the browser: its sliders, words, verdicts, paths and server."""

from __future__ import annotations

import itertools
import os
import socket
import subprocess
import sys
import threading
import urllib.request
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from extras import skip_without
from scenes import MODELS, free_cube, write_scene

import env2mjcf
from env2mjcf import Scene, Verdict
from env2mjcf.view.web import page as wording
from env2mjcf.view.web import server as web_server
from env2mjcf.view.web.playback import Player, Track
from env2mjcf.view.web.sliders import Sliders
from env2mjcf.view.web.viewer import Latest, Viewer

ROOT = Path(__file__).parents[3]
NOTHING = np.zeros((0, 6))


@pytest.fixture(scope="module")
def cube(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """A free unit cube, one that stands at x = 3, and a boundary at 10."""
    return env2mjcf.load(write_scene(tmp_path_factory.mktemp("cube"), free_cube("3 0 0 0 0 0")))


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """A hinge that turns by a third of pi either way, with a cube 3 away from its axis."""
    third = repr(1 / 3)
    hinge = f"0 1 Revolute -{third}:{third}  0 0 0 0 0 0  0 0 0 0  3 0 0 0 0 0"
    robot = f"2\ncube.g Fixed 0 0 0 0 0 0\ncube.g Joint\nConnections\n1\n{hinge}\n"
    return env2mjcf.load(write_scene(tmp_path_factory.mktemp("arm"), free_cube(robot=robot)))


# Sliders.


def test_sliders_stand_in_turns_in_dialect_a_and_in_fractions_of_pi_elsewhere() -> None:
    seed = env2mjcf.load(MODELS / "seed" / "seed.env")
    (dials,) = Sliders(seed, np.zeros((0, 9))).robots
    assert [d.unit for d in dials] == ["lengths"] * 3 + ["turns"] * 6
    assert [(d.low, d.high) for d in dials[3:6]] == [(-0.5, 0.5)] * 3
    two = env2mjcf.load(MODELS / "two-robots" / "two-robots.env")
    car, turret = Sliders(two, np.zeros((0, 6))).robots
    assert [(d.label, d.unit) for d in car] == [
        ("car.x", "lengths"),
        ("car.y", "lengths"),
        ("car.rz", "fractions of pi"),
    ]
    # The limits of the file are the ends of the sliders.
    assert [(d.label, d.low, d.high) for d in turret][1:] == [("upper.theta", -0.1, 0.9), ("fore.theta", -0.8, 0.8)]


def test_a_slider_reaches_what_the_query_holds_beyond_its_limits(arm: Scene) -> None:
    ((dial,),) = Sliders(arm, np.array([[2.0]])).robots
    assert dial.low == pytest.approx(-1 / 3, abs=dial.step)
    assert dial.high >= 2.0 / np.pi


def test_a_slider_at_its_end_is_within_limits_that_are_no_whole_number_of_steps(arm: Scene) -> None:
    dials = Sliders(arm, np.zeros((0, 1)))
    ((dial,),) = dials.robots
    for end in (dial.low, dial.high):
        q = dials.configuration([end])
        assert q is not None
        assert abs(q[0]) == pytest.approx(np.pi / 3, abs=2 * dial.step)
        assert arm.is_valid(q, engine="mujoco")
    beyond = dials.configuration([dial.high + 2 * dial.step])
    assert beyond is not None
    assert not arm.is_valid(beyond, engine="mujoco")


def test_sliders_and_configurations_are_each_other_back(cube: Scene) -> None:
    dials = Sliders(cube, NOTHING)
    for q in cube.space.sample(20, 0):
        again = dials.configuration(dials.values(q))
        np.testing.assert_allclose(again, q, rtol=1e-12, atol=1e-12)
    assert dials.configuration([float("nan")] * 6) is None


def test_an_angle_that_turns_without_end_stays_on_its_slider(cube: Scene) -> None:
    dials = Sliders(cube, NOTHING)
    turned = np.array([0, 0, 0, 2 * np.pi, 3 * np.pi, -2.25 * np.pi])
    np.testing.assert_allclose(dials.values(turned)[3:], [0, -1, -0.25], atol=1e-12)


# Words.


def test_names_are_text_whatever_they_hold() -> None:
    assert wording.as_text("<script>alert('&')</script>") == "&lt;script&gt;alert(&#x27;&amp;&#x27;)&lt;/script&gt;"
    assert wording.as_text("a\u202eb\x07c") == r"a\u202eb\x07c"
    assert wording.as_text("**Körper** `π`") == "**Körper** `π`"


@pytest.mark.parametrize(
    ("x", "y", "words", "reason"),
    [
        (0.0, 0.0, "valid", "nothing touches"),
        (2.25, 0.0, "in collision", "0.25 m deep"),
        (0.0, 9.75, "outside the boundary", "<b>cube</b> reaches outside the boundary"),
    ],
)
def test_the_page_says_what_is_wrong_with_a_configuration(
    cube: Scene, x: float, y: float, words: str, reason: str
) -> None:
    q = np.array([x, y, 0, 0, 0, 0])
    verdict, touching = Verdict(q, cube.out_of_bounds(q)), cube.in_collision(q, engine="mujoco")
    assert (verdict.valid and not touching) == cube.is_valid(q, engine="mujoco")
    assert f">{words}</div>" in wording.status(verdict, looking=touching)
    if touching:
        assert "looking for contacts" in wording.reasons(verdict, cube.space, looking=True)
        verdict = cube.explain(q, engine="mujoco")
    assert reason in wording.reasons(verdict, cube.space)


def test_a_broken_limit_is_told_in_the_numbers_of_the_file(arm: Scene) -> None:
    q = np.array([np.pi / 2])
    verdict = arm.explain(q, engine="mujoco")
    assert ">out of limits</div>" in wording.status(verdict)
    assert "is 0.5; limits -0.333333 to 0.333333" in wording.reasons(verdict, arm.space)


# While somebody drags.


def test_what_has_been_overtaken_is_not_worked_on() -> None:
    begun, go_on, done = threading.Event(), threading.Event(), threading.Event()
    worked: list[int] = []

    def work(item: int, overtaken: Callable[[], bool]) -> None:
        worked.append(item)
        begun.set()
        assert go_on.wait(10)
        assert overtaken() == (item == 0)
        if item == 99:
            done.set()

    newest = Latest[int](work)
    newest.submit(0)
    assert begun.wait(10)
    for item in range(1, 100):
        newest.submit(item)
    go_on.set()
    assert done.wait(10)
    newest.close()
    assert worked == [0, 99]


# Paths.


def test_a_track_passes_its_configurations_at_a_constant_speed(cube: Scene) -> None:
    corners = np.array([[0, 0, 0, 0, 0, 0], [1, 0, 0, 0, 0, 0], [1, 3, 0, 0, 0, 0]], dtype=float)
    track = Track(cube, corners)
    assert track.length == pytest.approx(4.0)
    places = np.array([track.at(x) for x in np.linspace(0, 1, 41)])[:, :2]
    np.testing.assert_allclose(np.abs(np.diff(places, axis=0)).sum(axis=1), 0.1, rtol=1e-9)
    np.testing.assert_allclose(places[[0, 10, 40]], corners[:, :2], atol=1e-12)
    assert [track.index(f) for f in (0.0, 0.2, 0.25, 0.9, 1.0)] == [0, 0, 1, 1, 2]


def test_a_track_turns_the_short_way_round(cube: Scene) -> None:
    track = Track(cube, np.array([[0, 0, 0, 0, 0, 3.0], [0, 0, 0, 0, 0, -3.0]]))
    assert abs(track.at(0.5)[5]) == pytest.approx(np.pi)
    assert track.length < 1.0


def test_a_track_may_stand_still(cube: Scene) -> None:
    for rows in (np.zeros((1, 6)), np.zeros((3, 6))):
        np.testing.assert_array_equal(Track(cube, rows).at(0.7), np.zeros(6))


@pytest.mark.parametrize("loop", [False, True])
def test_a_player_comes_to_the_end_and_stays_or_begins_again(loop: bool) -> None:
    shown: list[float] = []
    ended, long_enough = threading.Event(), threading.Event()

    def show(fraction: float) -> None:
        shown.append(fraction)
        if len(shown) >= 20:
            long_enough.set()

    player = Player(0.3, show, ended.set)
    player.loop = loop
    player.play()
    try:
        assert (long_enough if loop else ended).wait(20)
        if loop:
            assert min(np.diff(shown)) < 0
            assert not ended.is_set()
        else:
            assert shown[-1] == 1.0
            assert shown == sorted(shown)
            assert not player.playing
    finally:
        player.close()


# The page.

PAGES = [*sorted(MODELS.glob("*/*.env")), MODELS / "xml-arm" / "xml-arm.xml", MODELS / "maze" / "maze.xml"]


@pytest.mark.parametrize("file", PAGES, ids=lambda p: p.name)
def test_every_scene_can_be_shown_with_one_slider_for_each_number_of_the_file(file: Path) -> None:
    skip_without("view")
    query = file.with_suffix(".query")
    robots = [file.with_suffix(".robot")] if file.with_suffix(".robot").exists() and file.suffix == ".env" else []
    known = {"query": query} if query.exists() and file.suffix == ".env" else {}
    scene = env2mjcf.load(file, robots=robots, **known)
    path = scene.queries[0].q if scene.queries else scene.space.home[None]
    with web_server.serving(web_server.free_port(), "title") as server:
        viewer = Viewer(server, scene, path)
        try:
            assert len(viewer.page.values()) == scene.space.dim
            # Whatever is chosen is shown to the last bit.
            for q in (path[-1], scene.space.sample(1, 3)[0], scene.space.home):
                viewer.go(q)
                np.testing.assert_array_equal(viewer.q, q)
                np.testing.assert_array_equal(viewer.page.values(), scene.space.encode(q))
            viewer.random()
            assert scene.is_valid(viewer.q, engine="mujoco")
        finally:
            viewer.close()


def test_a_scene_without_a_robot_can_be_shown(tmp_path: Path) -> None:
    skip_without("view")
    text = "Boundary Box [-10:10 ; -10:10 ; -10:10]\n\nMultibodies\n1\n\nPassive\ncube.g 0 0 0 0 0 0\n"
    scene = env2mjcf.load(write_scene(tmp_path, text))
    with web_server.serving(web_server.free_port(), "title") as server:
        viewer = Viewer(server, scene)
        viewer.random()
        viewer.close()
        assert viewer.page.values() == []


# The server.


def listeners(port: int) -> set[str]:
    """Return the local addresses that the kernel knows as listening on a port, in its own notation."""
    found: set[str] = set()
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        for line in Path(table).read_text().splitlines()[1:]:
            _, local, _, state, *_ = line.split()
            address, number = local.split(":")
            if int(number, 16) == port and state == "0A":
                found.add(address)
    return found


def own_addresses() -> set[str]:
    """Return addresses of this machine that others could reach."""
    infos = itertools.chain.from_iterable(
        socket.getaddrinfo(name, None, socket.AF_INET) for name in {socket.gethostname()}
    )
    return {str(info[4][0]) for info in infos if not str(info[4][0]).startswith("127.")}


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="asks the kernel of Linux who listens")
def test_the_page_is_served_to_this_machine_alone(capsys: pytest.CaptureFixture[str]) -> None:
    skip_without("view")
    with web_server.serving(web_server.free_port(), "title") as server:
        port = server.get_port()
        assert listeners(port) == {"0100007F"}
        with urllib.request.urlopen(f"http://127.0.0.1:{port}") as answer:
            assert answer.status == 200
        for address in own_addresses():
            with pytest.raises(ConnectionRefusedError):
                socket.create_connection((address, port), timeout=5)
        assert server.request_share_url() is None
        # The next viewer takes the next port.
        assert web_server.free_port() > port
        with pytest.raises(ValueError, match=f"port {port} is in use"):
            web_server.free_port(port)
    assert listeners(port) == set()
    assert capsys.readouterr() == ("", "")


# The verb.


def view(*words: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run `env2mjcf view` to its end."""
    screenless = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    return subprocess.run(
        [sys.executable, "-m", "env2mjcf", "view", *map(str, words)],
        cwd=ROOT, env=screenless | environment, capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip


SEED = MODELS / "seed" / "seed.env"


@pytest.mark.slow_but("other.csv")
@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("other.csv", "0,0,0\n", "error CFG504: a row of 3 numbers; expected 9 (cube.x"),
        ("words.csv", "a,b\n0 1 two\n", "error CFG502: expected a row of finite numbers, found 'two'"),
        ("none.csv", None, "error ENV101"),
    ],
)
def test_a_path_that_does_not_fit_is_refused_before_anything_is_served(
    tmp_path: Path, name: str, content: str | None, message: str
) -> None:
    skip_without("view")
    path = tmp_path / name
    if content is not None:
        path.write_text(content)
    done = view(SEED, "--path", path)
    assert (done.returncode, done.stdout) == (3, "")
    assert message in done.stderr


def test_a_path_in_radians_is_doubted(tmp_path: Path) -> None:
    skip_without("view")
    path = tmp_path / "radians.csv"
    path.write_text("0 0 0 0.9 2.2 0\n")
    done = view(MODELS / "two-robots" / "two-robots.env", "--path", path, "--strict")
    assert (done.returncode, done.stdout) == (3, "")
    assert "CFG551" in done.stderr
    path.write_text("0 0 0 0.9 0.2 0\n0 0 0 0.9 2.2 0\n")
    done = view(MODELS / "two-robots" / "two-robots.env", "--path", path, "--strict")
    assert "CFG550: 1 of 2 configurations" in done.stderr
    assert "in number 2 robot1/upper.theta is 2.2, its limits are -0.1 to 0.9" in done.stderr


def test_without_a_display_the_native_viewer_says_so_in_one_sentence() -> None:
    done = view(SEED, "--native")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "env2mjcf: view: --native opens a window, and there is no display: leave it out for the web page\n"
    )


def test_without_the_extra_one_sentence_says_how_to_get_it() -> None:
    code = (
        "import sys; sys.modules['viser'] = None; from env2mjcf.cli.main import main; sys.exit(main(['view', 'x.env']))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "env2mjcf: view: the web page needs viser: pip install 'env2mjcf[view]'\n"


def test_no_other_verb_imports_what_the_page_is_made_of() -> None:
    code = (
        "import sys; from env2mjcf.cli.main import main\n"
        f"assert main(['check', {os.fspath(SEED)!r}, '--engine', 'mujoco']) == 0\n"
        "import env2mjcf.cli.view, env2mjcf.view.web.viewer\n"
        "print(*{'viser', 'websockets', 'mujoco.viewer'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == ""
