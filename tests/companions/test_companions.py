"""Paths, roadmaps and queries in the terms of a scene."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import free_cube, without_privileges, write_scene

import env2mjcf
from env2mjcf import ConversionError, FormatError, Query, Roadmap, Scene
from env2mjcf.transforms import angles_from_quaternion, quaternion_from_matrix

ARM = "FreeBody 0 cube.g 0 0 0 0 0 0\nFreeBody 1 cube.g\nFreeBody 2 cube.g\n"
JOINTS = (
    "0 1 Actuated\n1 0 0 -90 0 0  90 0.2 0 30 Revolute 1 0 0 0 0 0\n"
    "1 2 Actuated\n1 0 0 -90 0 0  30 0.2 0.3 30 Prismatic 1 0 0 0 20 0\n"
)
LEGACY_ARM = f"1\nMultiBody Active\n3\n{ARM}Connection\n2\n{JOINTS}"
LEGACY_FIXED = LEGACY_ARM.replace("FreeBody 0 cube.g 0 0 0 0 0 0", "FixedBody 0 cube.g 1 2 3 0 0 90")
SPHERICAL = """Boundary Box [-10:10 ; -10:10 ; -10:10]

Multibodies
1

Active
2
cube.g Volumetric Rotational
cube.g Joint
Connections
1
0 1 Spherical -1:1 -1:1
1 0 0 10 20 30  0.1 0.2 0.3 0.4  1 0 0 0 20 0
"""


def load(folder: Path, text: str, **options: object) -> Scene:
    return env2mjcf.load(write_scene(folder, text), engine="mujoco", **options)


def two_robots() -> str:
    cube = "Active\n1\ncube.g Planar Translational\nConnections\n0\n"
    other = cube.replace("Translational", "Rotational")
    return f"Boundary Box [-10:10 ; -10:10 ; -10:10]\n\nMultibodies\n2\n\n{cube}\n{other}"


def recorded_poses(scene: Scene, q: np.ndarray, unit: float = 6.2832, links: slice = slice(None)) -> str:
    """Write link poses as dialect A's planner printed them: six decimals, angles about fixed axes in turns."""
    lines = []
    for pose in scene.link_poses(q)[:, links].reshape(-1, 4, 4):
        angles = angles_from_quaternion(quaternion_from_matrix(pose[:3, :3]))
        numbers = [*(pose[:3, 3] / scene.compiled.options.scale), *(float(a) / unit for a in angles)]
        lines.append(" ".join(f"{x:f}" for x in numbers))
    return f"VIZMO_PATH_FILE   Path Version 20001022\n{len(lines) // len(q)}\n{len(q)}\n" + "\n".join(lines) + "\n"


SCENES = {"A": LEGACY_ARM, "A fixed": LEGACY_FIXED, "D": free_cube("3 0 0 0 0 0"), "D spherical": SPHERICAL}


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("scale", [1.0, 0.25])
def test_what_was_read_from_a_file_is_written_so_that_it_reads_back_to_the_last_bit(
    tmp_path: Path, name: str, scale: float
) -> None:
    scene = load(tmp_path, SCENES[name], scale=scale)
    q = scene.space.decode(np.random.default_rng(1).uniform(-1, 1, (200, scene.space.dim)))
    path = env2mjcf.read_path(scene, env2mjcf.write_path(scene, q, tmp_path / "x.path"))
    np.testing.assert_array_equal(path.q, q)
    assert not path.diagnostics
    (query,) = env2mjcf.read_query(scene, env2mjcf.write_query(scene, Query(0, q), tmp_path / "x.query"))
    np.testing.assert_array_equal(query.q, q)
    between = [q[:2], q[:0], q[3:4]]
    made = Roadmap.of(q, [[0, 1], [0, 2], [1, 5]], intermediates=between)
    found = env2mjcf.read_roadmap(scene, env2mjcf.write_roadmap(scene, made, tmp_path / "x.map"))
    assert not found.diagnostics
    np.testing.assert_array_equal(found.q, q)
    np.testing.assert_array_equal(found.edges, made.edges)
    np.testing.assert_array_equal(found.weights, made.weights)
    for ours, theirs in zip(between, found.intermediates, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(found.way(0), [q[0], q[0], q[1], q[1]])


def test_any_angle_is_written_to_one_unit_of_its_last_digit_and_then_stays(tmp_path: Path) -> None:
    scene = load(tmp_path, LEGACY_ARM)
    q = np.random.default_rng(2).normal(size=(2000, scene.space.dim)) * 10
    first = env2mjcf.read_path(scene, env2mjcf.write_path(scene, q, tmp_path / "1.path")).q
    assert (np.abs(first - q) <= np.spacing(np.abs(q))).all()
    np.testing.assert_array_equal(first[:, :3], q[:, :3])
    second = env2mjcf.read_path(scene, env2mjcf.write_path(scene, first, tmp_path / "2.path")).q
    np.testing.assert_array_equal(second, first)


@pytest.mark.parametrize(
    ("name", "start"),
    [("A", ["VIZMO_PATH_FILE   Path Version 20001125", "1", "1", "   0.0"]),
     ("D", ["VIZMO_PATH_FILE   Path Version 2012", "1", "1", "0    0.0"])],
)  # fmt: skip
def test_the_dialect_says_which_version_is_written_and_whether_the_robots_index_is(
    tmp_path: Path, name: str, start: list[str]
) -> None:
    scene = load(tmp_path, SCENES[name])
    lines = env2mjcf.write_path(scene, scene.space.home[None] * 0, tmp_path / "x.path").read_text().splitlines()
    assert lines[:3] == start[:3]
    assert lines[3].startswith(start[3])


def test_dialect_e_writes_no_index(tmp_path: Path) -> None:
    path = write_scene(
        tmp_path, "Boundary Box [-10:10 ; -10:10 ; -10:10]\nMultibodies\n1\nPassive\ncube.g 3 0 0 0 0 0\n"
    )
    (tmp_path / "r.robot").write_text("1\ncube.g Volumetric Rotational\nConnections\n0\n")
    scene = env2mjcf.load(path, robots=[tmp_path / "r.robot"], engine="mujoco")
    assert scene.environment.dialect == "E"
    text = env2mjcf.write_path(scene, np.ones((2, 6)), tmp_path / "x.path").read_text()
    assert len(text.splitlines()[3].split()) == 6
    assert env2mjcf.read_path(scene, tmp_path / "x.path").q.tolist() == np.ones((2, 6)).tolist()


def test_of_several_robots_one_is_written_and_the_others_are_read_at_home(tmp_path: Path) -> None:
    scene = load(tmp_path, two_robots())
    q = np.random.default_rng(0).uniform(-1, 1, (4, 5))
    found = env2mjcf.read_path(scene, env2mjcf.write_path(scene, q, tmp_path / "x.path", robot=1))
    assert found.robots.tolist() == [1] * 4
    np.testing.assert_array_equal(found.q[:, :2], np.tile(scene.space.home[:2], (4, 1)))
    np.testing.assert_allclose(found.q[:, 2:], q[:, 2:], rtol=1e-15)
    env2mjcf.write_query(scene, [Query(1, q), Query(0, q[:2])], tmp_path / "x.query")
    assert [(x.robot, len(x.q)) for x in env2mjcf.read_query(scene, tmp_path / "x.query")] == [(0, 2), (1, 4)]
    env2mjcf.write_roadmap(scene, Roadmap.of(q, [[2, 3]], robot=1), tmp_path / "x.map")
    found_map = env2mjcf.read_roadmap(scene, tmp_path / "x.map")
    assert (found_map.robots.tolist(), found_map.edges.tolist()) == ([1] * 4, [[2, 3]])
    with pytest.raises(ValueError, match="robot=2; the scene has 2 robots"):
        env2mjcf.write_path(scene, q, tmp_path / "x.path", robot=2)


def test_a_row_of_all_robots_is_a_configuration_of_the_scene(tmp_path: Path) -> None:
    scene = load(tmp_path, two_robots())
    (tmp_path / "x.path").write_text("VIZMO_PATH_FILE   Path Version 2012\n1\n2\n0 1 2 3 4 0.5\n0 2 3 4 5 0.25\n")
    found = env2mjcf.read_path(scene, tmp_path / "x.path")
    assert found.robots.tolist() == [-1, -1]
    np.testing.assert_allclose(found.q, [[1, 2, 3, 4, np.pi / 2], [2, 3, 4, 5, np.pi / 4]])


@pytest.mark.parametrize("name", ["A", "A fixed", "D spherical"])
@pytest.mark.parametrize("scale", [1.0, 10.0])
def test_configurations_are_recovered_from_recorded_poses(tmp_path: Path, name: str, scale: float) -> None:
    scene = load(tmp_path, SCENES[name], scale=scale)
    q = scene.space.sample(50, seed=4)
    (tmp_path / "x.path").write_text(recorded_poses(scene, q))
    found = env2mjcf.read_path(scene, tmp_path / "x.path")
    assert not found.diagnostics
    assert found.fits.all()
    assert found.pose_error < 4e-5 * scale
    np.testing.assert_allclose(scene.link_poses(found.q), scene.link_poses(q), atol=1e-4 * max(1, scale))


def test_a_fixed_base_may_be_left_out_of_recorded_poses(tmp_path: Path) -> None:
    scene = load(tmp_path, LEGACY_FIXED)
    q = scene.space.sample(5, seed=4)
    (tmp_path / "x.path").write_text(recorded_poses(scene, q, links=slice(1, None)))
    found = env2mjcf.read_path(scene, tmp_path / "x.path")
    assert found.fits.all()
    np.testing.assert_allclose(found.q, q, atol=2e-5)


def test_poses_of_a_robot_with_longer_links_fit_no_configuration(tmp_path: Path) -> None:
    scene = load(tmp_path / "a", LEGACY_ARM)
    longer = load(tmp_path / "b", LEGACY_ARM.replace("0.2 0 30 Revolute 1", "0.2 0 30 Revolute 1.125"))
    q = scene.space.sample(5, seed=4)
    (tmp_path / "x.path").write_text(recorded_poses(longer, q))
    found = env2mjcf.read_path(scene, tmp_path / "x.path")
    assert not found.fits.any()
    assert found.pose_error == pytest.approx(0.125, rel=0.01)
    assert [(d.code, d.span and d.span.line) for d in found.diagnostics] == [("CFG518", 4)]
    assert found.poses is not None
    np.testing.assert_allclose(found.poses, longer.link_poses(q), atol=1e-5)
    with pytest.raises(FormatError):
        env2mjcf.read_path(scene, tmp_path / "x.path", strict=True)


def roadmap(scene: Scene, folder: Path, *nodes: str, edges: int = 0) -> Roadmap:
    body = "\n".join(nodes)
    (folder / "x.map").write_text(f"#####GRAPHSTART#####\n{len(nodes)} {edges} 9\n{body}\n#####GRAPHSTOP#####\n")
    return env2mjcf.read_roadmap(scene, folder / "x.map")


@pytest.mark.parametrize(
    ("nodes", "entries", "code", "edges"),
    [
        (("0 0 1 2 1 1 0 5.5", "1 0 3 4 0"), 1, "CFG527", [[0, 1]]),
        (("0 0 1 2 0", "1 0 3 4 1 0 0 5.5"), 1, "CFG527", [[0, 1]]),
        (("0 0 1 2 1 7 0 5.5", "1 0 3 4 0"), 1, "CFG526", []),
        (("0 0 1 2 1 0 0 5.5", "1 0 3 4 0"), 1, "CFG528", []),
        (("0 0 1 2 1 4 0 5.5", "0 0 3 4 0", "4 0 5 6 1 0 0 5.5"), 2, "CFG525", [[0, 2]]),
        (("0 0 1 2 1 1 0 5.5", "1 1 3 4 0.5 1 0 0 5.5"), 2, "CFG533", []),
    ],
)
def test_doubtful_edges_are_told_once_with_the_line_of_the_first(
    tmp_path: Path, nodes: tuple[str, ...], entries: int, code: str, edges: list[list[int]]
) -> None:
    found = roadmap(load(tmp_path, two_robots()), tmp_path, *nodes, edges=entries)
    assert [d.code for d in found.diagnostics] == [code]
    assert found.diagnostics[0].span is not None
    assert found.edges.tolist() == edges
    assert len(found) == len(nodes)


def test_intermediates_of_an_edge_that_only_its_upper_end_knows_are_turned_round(tmp_path: Path) -> None:
    found = roadmap(load(tmp_path, two_robots()), tmp_path, "0 0 1 2 0", "1 0 3 4 1 0 2 0 8 9 0 6 7 2.5", edges=1)
    np.testing.assert_array_equal(found.way(0)[:, :2], [[1, 2], [6, 7], [8, 9], [3, 4]])


def test_a_roadmap_of_wrong_shapes_is_refused() -> None:
    with pytest.raises(ValueError, match="index outside 0 to 1"):
        Roadmap.of(np.zeros((2, 3)), [[0, 2]])
    with pytest.raises(ValueError, match="expected one for each of 1 edges"):
        Roadmap.of(np.zeros((2, 3)), [[0, 1]], weights=[1, 2])
    with pytest.raises(ValueError, match=r"expected \(n, dim\)"):
        Roadmap.of(np.zeros(3), [])
    with pytest.raises(ValueError, match="nodes is a masked array"):
        Roadmap.of(np.ma.masked_array(np.zeros((2, 3)), mask=True), [])


@pytest.mark.parametrize(
    ("edges", "more", "message"),
    [
        ([[0, 1.5]], {}, "whole numbers"),
        ([[0, 0]], {}, "from a node to itself"),
        ([[0, 1], [1, 0]], {}, "twice"),
        ([0, 1], {}, r"expected \(m, 2\)"),
        ([[0, 1]], {"weights": [math.nan]}, "weights holds nan"),
        ([[0, 1]], {"robot": -1}, "robot is -1"),
        ([[0, 1]], {"weights": ["1"]}, "expected real numbers"),
        ([[0, 1]], {"weights": np.array([1j])}, "expected real numbers"),
        ([[0, 1]], {"intermediates": [[[math.inf] * 3]]}, "intermediates holds inf"),
        ([[0, 1]], {"intermediates": [[["1"] * 3]]}, "expected real numbers"),
        (np.ma.masked_array([[0, 1]], mask=True), {}, "masked"),
    ],
)
def test_a_roadmap_that_no_reader_would_give_back_is_refused(edges: Any, more: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Roadmap.of(np.zeros((2, 3)), edges, **more)


def test_nothing_is_written_that_no_reader_reads(tmp_path: Path) -> None:
    scene = load(tmp_path, SCENES["D"])
    with pytest.raises(ValueError, match="no configuration"):
        env2mjcf.write_query(scene, [], tmp_path / "a.query")
    with pytest.raises(ValueError, match="no configuration"):
        env2mjcf.write_query(scene, Query(0, np.zeros((0, 6))), tmp_path / "a.query")
    far = np.zeros((1, 6))
    far[0, 0] = 1e101
    with pytest.raises(ValueError, match=r"numbers up to 1e\+30"):
        env2mjcf.write_path(scene, far, tmp_path / "a.path")
    good = Roadmap.of(np.zeros((2, 6)), [[0, 1]])
    with pytest.raises(ValueError, match="weights"):
        env2mjcf.write_roadmap(scene, dataclasses.replace(good, weights=np.array([math.nan])), tmp_path / "a.map")
    assert not list(tmp_path.glob("a.*"))


def test_writing_is_whole_or_not_at_all(tmp_path: Path) -> None:
    scene = load(tmp_path, SCENES["D"])
    target = tmp_path / "x.path"
    env2mjcf.write_path(scene, np.zeros((2, 6)), target)
    before = target.read_text()
    with pytest.raises(ValueError, match="finite"):
        env2mjcf.write_path(scene, np.full((2, 6), np.nan), target)
    assert target.read_text() == before
    with pytest.raises(ConversionError) as caught:
        env2mjcf.write_path(scene, np.zeros((2, 6)), tmp_path / "missing" / "x.path")
    assert caught.value.code == "CFG532"
    with pytest.raises(ConversionError):
        env2mjcf.write_roadmap(scene, Roadmap.of(np.zeros((1, 6)), []), tmp_path)
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o555)
    answer = without_privileges(tmp_path, lambda: env2mjcf.write_path(scene, np.zeros((2, 6)), locked / "x.path"))
    assert answer.startswith("CFG532")
    assert not list(tmp_path.glob(".x.path*"))


def test_an_empty_path_is_written_and_read(tmp_path: Path) -> None:
    scene = load(tmp_path, SCENES["D"])
    found = env2mjcf.read_path(scene, env2mjcf.write_path(scene, np.zeros((0, 6)), tmp_path / "x.path"))
    assert found.q.shape == (0, 6)
    assert not found.diagnostics


SLIPS = (
    "nan",
    "-1",
    "1e999",
    "1e101",
    "1e99",
    "1e18",
    "9" * 400,
    "x",
    "0.5",
    "#",
    "//",
    "0x1",
    "1_0",
    "٣",
    "",
    "0",
    "7 7",
)


@pytest.mark.parametrize("kind", ["path", "poses", "map", "query"])
def test_no_slip_of_the_pen_is_more_than_a_refusal(tmp_path: Path, kind: str) -> None:
    """One word after the other is replaced by what may stand there by mistake, and every other line is doubled."""
    scene = load(tmp_path, SCENES["A"] if kind == "poses" else SCENES["D"])
    q = scene.space.sample(4, seed=0)
    file = tmp_path / "x"
    if kind == "poses":
        file.write_text(recorded_poses(scene, q[:2]))
    elif kind == "map":
        env2mjcf.write_roadmap(
            scene, Roadmap.of(q, [[0, 1], [0, 2], [2, 3]], intermediates=[q[:0], q[1:3], q[:1]]), file
        )
    elif kind == "query":
        env2mjcf.write_query(scene, Query(0, q), file)
    else:
        env2mjcf.write_path(scene, q, file)
    read = {"map": env2mjcf.read_roadmap, "query": env2mjcf.read_query}.get(kind, env2mjcf.read_path)
    words = file.read_text().replace("\n", " \n ").split(" ")
    places = [i for i, word in enumerate(words) if word.strip()]
    slips = np.random.default_rng(0).permutation(len(places) * len(SLIPS))[:600]
    for slip in slips.tolist():
        changed = list(words)
        changed[places[slip // len(SLIPS)]] = SLIPS[slip % len(SLIPS)]
        file.write_text(" ".join(changed))
        try:
            found = read(scene, file)
        except FormatError:
            continue
        for part in found if isinstance(found, tuple) else (found,):
            assert np.isfinite(part.q).all()


def test_files_of_the_time_of_turns_are_read_in_turns_whatever_the_scene_is_written_in(tmp_path: Path) -> None:
    scene = load(tmp_path, SCENES["D"])
    (tmp_path / "x.path").write_text("VIZMO_PATH_FILE   Path Version 20001125\n1\n1\n1 2 3 0 0 0.25\n")
    found = env2mjcf.read_path(scene, tmp_path / "x.path")
    np.testing.assert_allclose(found.q, [[1, 2, 3, 0, 0, np.pi / 2]])
    assert [d.code for d in found.diagnostics] == ["CFG535"]
    head = "Roadmap Version Number 061300\n#####GRAPHSTART#####\n1 0 1\n"
    (tmp_path / "x.map").write_text(f"{head}0 1 2 3 0 0 0.25 -1 -1 -1 0\n#####GRAPHSTOP#####\n")
    found_map = env2mjcf.read_roadmap(scene, tmp_path / "x.map")
    np.testing.assert_allclose(found_map.q, [[1, 2, 3, 0, 0, np.pi / 2]])
    assert [d.code for d in found_map.diagnostics] == ["CFG535"]
