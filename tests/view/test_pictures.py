"""Pictures: everything is in view, and what is drawn is what was asked for."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from cameras import projected
from real_scenes import FEW, real_scene, scene_names
from scenes import MODELS, SCENES, free_cube, write_scene

import env2mjcf
from env2mjcf.view import Direction, Points, Polyline, offscreen, picture, segmentation
from env2mjcf.view.cameras import candidates, fitted

needs_gl = pytest.mark.skipif(offscreen.backend() is None, reason=f"no GL: {offscreen.missing()}")
CORNERS = np.array([[x, y, z, 1] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
# Beside the robot, and behind it.
WALLS = ("3 0 0 0 0 0", "0 4 0 0 0 0")


@pytest.fixture(scope="module")
def cubes(tmp_path_factory: pytest.TempPathFactory) -> env2mjcf.Scene:
    """A free cube and two others."""
    folder = tmp_path_factory.mktemp("cubes")
    return env2mjcf.load(write_scene(folder, free_cube(*WALLS, boundary="Boundary Box [-5:5 ; -5:5 ; -5:5]")))


def blue(pixels: np.ndarray) -> int:
    """Count the pixels of a robot's colour; sky and obstacles are grey, or nearly so."""
    values = pixels.astype(int)
    return int(np.count_nonzero(values[..., 2] - values[..., 0] > 60))


def red(pixels: np.ndarray) -> int:
    """Count the pixels of what touches."""
    values = pixels.astype(int)
    return int(np.count_nonzero(values[..., 0] - values[..., 2] > 60))


def everything_is_in_view(scene: env2mjcf.Scene, q: np.ndarray | None) -> None:
    """Each body covers pixels, or would if those before it were not there; none is cut by the border."""
    seen = segmentation(scene, q, size=(640, 480))
    rest = set(seen.names)
    while True:
        border = [seen.labels[0], seen.labels[-1], seen.labels[:, 0], seen.labels[:, -1]]
        assert (np.concatenate(border) == -1).all(), "a body is cut by the border"
        visible = {seen.names[i] for i in np.unique(seen.labels) if i >= 0}
        rest -= visible
        if not rest:
            return
        # A link of a long thin chain may be smaller than a pixel of the usual size.
        assert visible or seen.labels.shape == (480, 640), f"not in the picture: {sorted(rest)}"
        # What hides them is taken away.
        size = (640, 480) if visible else (2560, 1920)
        seen = segmentation(scene, q, size=size, camera=seen.camera, only=rest)


@pytest.mark.slow_but("alpha", "seed", "maze.xml")
@needs_gl
@pytest.mark.parametrize("name", SCENES)
def test_every_scene_of_ours_is_in_view(name: str) -> None:
    options = {k: [MODELS / v for v in vs] if k == "robots" else MODELS / vs for k, vs in SCENES[name].items()}
    scene = env2mjcf.load(MODELS / name, **options)
    everything_is_in_view(scene, scene.queries[0].q[0] if scene.queries else None)


@pytest.mark.slow_but(*FEW)
@needs_gl
@pytest.mark.usefixtures("corpus")
@pytest.mark.parametrize("name", scene_names())
def test_every_real_scene_is_in_view(name: str) -> None:
    row = real_scene(name)
    # A few environments lack the robot that their query is for.
    scene = env2mjcf.load(row.env, **row.keywords, query=row.query if row.dof else None)
    everything_is_in_view(scene, scene.queries[0].q[0] if scene.queries else None)


@pytest.mark.parametrize("aspect", [0.5, 1.0, 16 / 9])
@pytest.mark.parametrize("planar", [False, True])
def test_a_camera_stands_as_near_as_all_points_are_seen(aspect: float, planar: bool) -> None:
    points = np.random.default_rng(3).normal(size=(50, 3)) * (4, 1, 2) + (10, -20, 5)
    size = (round(1000 * aspect), 1000)
    for direction in candidates(planar):
        pixels = projected(points, fitted(points, direction, aspect), size) / size
        assert (pixels >= 0.039).all()
        assert (pixels <= 0.961).all()
        room = [pixels.min(axis=0), 1 - pixels.max(axis=0)]
        assert np.min(np.max(room, axis=0)) < 0.0401, "from nearer, something would be cut"


@needs_gl
def test_the_robot_stands_where_its_pose_is_projected(cubes: env2mjcf.Scene) -> None:
    q = np.array([-2, 1, 0.5, 0.3, 0.2, 0.1])
    seen = segmentation(cubes, q, size=(400, 300), camera="front")
    found = np.argwhere(seen.labels == seen.names.index(cubes.link_names[0]))[:, ::-1]
    corners = (cubes.link_poses(q)[0] @ CORNERS.T).T[:, :3]
    expected = projected(corners, seen.camera, (400, 300))
    np.testing.assert_allclose(found.min(axis=0), expected.min(axis=0), atol=1.1)
    np.testing.assert_allclose(found.max(axis=0) + 1, expected.max(axis=0), atol=1.1)


@pytest.mark.slow
@needs_gl
def test_a_ghost_adds_to_the_picture_and_a_trail_does_too(cubes: env2mjcf.Scene) -> None:
    home, aside = cubes.space.home, np.array([-9.0, 0, 0, 0, 0, 0])
    view = segmentation(cubes, aside, size=(320, 240), camera="overview").camera
    plain = picture(cubes, home, size=(320, 240), camera=view)
    ghost = picture(cubes, home, size=(320, 240), camera=view, ghosts=aside)
    trail = picture(cubes, home, size=(320, 240), camera=view, trail=[home, aside])
    changed = np.abs(ghost.astype(int) - plain).max(axis=2) > 20
    assert 0.3 * blue(plain) < np.count_nonzero(changed)
    assert blue(ghost) < 1.5 * blue(plain), "a ghost is pale"
    assert red(trail) > 15 > red(ghost), "the line is orange"


@needs_gl
def test_marks_are_drawn_where_they_are(cubes: env2mjcf.Scene) -> None:
    size = (400, 300)
    view = segmentation(cubes, np.array([-3.0, -3, 0, 0, 0, 0]), size=size, camera="top").camera
    place = np.array([[-3.0, -3.0, 0.0]])
    pixels = picture(cubes, size=size, camera=view, marks=[Points(place, (1, 0, 0, 1), size=20)]).astype(int)
    rows, columns = np.nonzero((pixels[..., 0] > 150) & (pixels[..., 1] < 100))
    assert np.hypot(*(np.array([columns.mean(), rows.mean()]) - projected(place, view, size)[0])) < 2
    line = Polyline([[-3, -3, 0], [-3, 3, 0]], (1, 0, 0, 1))
    assert red(picture(cubes, size=size, camera=view, marks=[line])) > 100


@needs_gl
def test_what_touches_is_red(cubes: env2mjcf.Scene) -> None:
    touching = np.array([2.2, 0, 0, 0, 0, 0])
    assert cubes.in_collision(touching)
    tinted = picture(cubes, touching, size=(320, 240), contacts=True)
    plain = picture(cubes, touching, size=(320, 240))
    assert red(tinted) > 500
    assert red(plain) == 0
    assert red(picture(cubes, size=(320, 240), contacts=True)) == 0, "nothing touches at home"


@pytest.mark.slow
@needs_gl
def test_a_robot_in_a_bottle_is_seen_through_it() -> None:
    scene = env2mjcf.load(MODELS / "bug-trap/bug-trap.env", query=MODELS / "bug-trap/bug-trap.query")
    (start, *_) = scene.queries[0].q
    turned = start + np.array([0, 0, 0, 0, 0, 1.0])
    view = segmentation(scene, start, size=(320, 240)).camera
    seen, moved = (picture(scene, q, size=(320, 240), camera=view).astype(int) for q in (start, turned))
    opaque, still = (
        picture(scene, q, size=(320, 240), camera=view, see_through=False).astype(int) for q in (start, turned)
    )
    assert np.count_nonzero(np.abs(seen - moved).max(axis=2) > 15) > 200
    assert np.count_nonzero(np.abs(opaque - still).max(axis=2) > 15) < 50


@needs_gl
def test_the_colours_of_the_file_are_drawn(tmp_path: Path) -> None:
    text = free_cube(robot="1\ncube.g -c(0.1 0.7 0.1 1) Volumetric Rotational\nConnections\n0\n")
    pixels = picture(env2mjcf.load(write_scene(tmp_path, text)), size=(160, 120)).astype(int)
    center = pixels[60, 80]
    assert center[1] > 1.5 * max(center[0], center[2])


@needs_gl
def test_a_direction_is_as_good_as_its_name(cubes: env2mjcf.Scene) -> None:
    named = picture(cubes, size=(160, 120), camera="right")
    assert np.array_equal(named, picture(cubes, size=(160, 120), camera=Direction(math.pi, -0.2)))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"camera": "nowhere"}, "expected one of overview, front"),
        ({"q": [0.0, 1.0]}, r"expected \(6,\)"),
        ({"q": np.zeros((2, 6))}, "others can be ghosts"),
        ({"size": (0, 100)}, "at least 1 x 1"),
        ({"trail": np.zeros((0, 6))}, "k > 0"),
        ({"camera": "top", "file": "a.jpg"}, r"^file is a\.jpg; expected one that ends in \.png"),
    ],
)
def test_an_impossible_picture_says_what_is_possible(
    cubes: env2mjcf.Scene, tmp_path: Path, arguments: dict[str, object], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        picture(cubes, **{"file": tmp_path / "a.png", **arguments})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("size", [(1.5, 3), "12", (1, 2, 3), (True, 5), None])
def test_a_size_is_two_whole_numbers(cubes: env2mjcf.Scene, size: object) -> None:
    with pytest.raises(TypeError, match=r"^size is "):
        picture(cubes, size=size)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("mark", "message"),
    [
        (lambda: Points([[0, 0, math.nan]]), "^array of points holds nan"),
        (lambda: Points([["1", "2", "3"]]), "expected real numbers"),
        (lambda: Polyline(np.ma.masked_array(np.zeros((2, 3)), mask=True)), "is a masked array"),
        (lambda: Points(np.zeros((3, 2))), r"^points of shape \(3, 2\); expected \(k, 3\)"),
        (lambda: Polyline(np.zeros(6)), r"^points of shape \(6,\)"),
        (lambda: Points(np.zeros((1, 3)), size=math.nan), "^size is nan"),
        (lambda: Points(np.zeros((1, 3)), color=(2, 0, 0, 1)), r"^color is \(2, 0, 0, 1\)"),
        (lambda: Direction(math.inf, 0), "finite angles"),
    ],
)
def test_what_cannot_be_drawn_is_no_mark(mark: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        mark()


def test_a_segmentation_of_an_unknown_body_names_the_known(cubes: env2mjcf.Scene) -> None:
    with pytest.raises(ValueError, match="no body 'ball'; expected some of cube"):
        segmentation(cubes, only=["ball"])
