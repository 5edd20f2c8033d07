"""Whole scenes that mean harm: each is refused, or read, without work that its size does not explain."""

from __future__ import annotations

import os
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from scenes import box_mesh, fault

import env2mjcf
from env2mjcf.cli.main import main
from env2mjcf.formats import reading
from env2mjcf.geometry import assembly, pieces, resolve, triangle_sweep
from env2mjcf.geometry.coplanar import Polygon, convex_polygons
from env2mjcf.geometry.pieces import prisms
from env2mjcf.limits import LARGEST, Limits

BOX = "Boundary Box [-9:9;-9:9;-9:9]\nMultibodies\n"
ROBOT = "Active\n1\ncube.g Volumetric Rotational\nConnections\n0\n"


def chain(links: int, limits: str = "-1:1") -> str:
    """An arm of so many links, each in its own place."""
    joints = "".join(f"{i} {i + 1} Revolute {limits}\n3 0 0 0 0 0\n0 0 0 0\n0 0 0 0 0 0\n" for i in range(links - 1))
    bodies = "cube.g Volumetric Rotational\n" + "cube.g Joint\n" * (links - 1)
    return f"Active\n{links}\n{bodies}Connections\n{links - 1}\n{joints}"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "cube.g").write_text(box_mesh(0.5, 0.5, 0.5))
    return tmp_path


def write(folder: Path, text: str, name: str = "hostile.env") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def load(folder: Path, text: str, **options: object) -> env2mjcf.Scene:
    return env2mjcf.load(write(folder, text), engine="mujoco", cache=False, **options)


@pytest.fixture
def no_geometry(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: object) -> None:
        pytest.fail("a mesh is loaded")

    monkeypatch.setattr(assembly, "load_mesh", never)


class TestRobotFiles:
    ROBOT_FILE = (
        '<Robot><MultiBody type="active"><Base filename="cube.g" type="volumetric" movement="rotational"/>'
        "</MultiBody></Robot>"
    )

    @pytest.fixture
    def read(self, monkeypatch: pytest.MonkeyPatch) -> list[str]:
        names: list[str] = []
        original = reading.read_source

        def noted(path: env2mjcf.options.PathArgument, *rest: object, **keywords: object) -> object:
            names.append(os.path.basename(path))
            return original(path, *rest, **keywords)  # pyright: ignore[reportArgumentType]

        monkeypatch.setattr(reading, "read_source", noted)
        return names

    def problem(self, folder: Path, robots: int) -> Path:
        write(folder, self.ROBOT_FILE, "a.xml")
        named = "".join(f'<Robot label="r{i}" filename="{"./" * i}a.xml"/>' for i in range(robots))
        inside = f"<Environment/>{named}"
        return write(folder, f"<MotionPlanning><MPProblem>{inside}</MPProblem></MotionPlanning>", "p.xml")

    def test_one_that_is_named_often_is_read_once(self, folder: Path, read: list[str]) -> None:
        found = env2mjcf.read(self.problem(folder, 20))
        assert read == ["p.xml", "a.xml"]
        assert [r.label for r in found.robots] == [f"r{i}" for i in range(20)]
        assert len({id(r) for r in found.robots}) == 20

    def test_none_is_read_beyond_the_limit(self, folder: Path, read: list[str]) -> None:
        names = [write(folder, self.ROBOT_FILE, f"{i}.xml") for i in range(9)]
        env = write(folder, BOX + "0\n")
        found = fault(lambda: env2mjcf.read(env, robots=names, limits=Limits(bodies=3)))
        assert (found.code, read) == ("ENV110", ["hostile.env", "0.xml", "1.xml", "2.xml", "3.xml"])


class TestDistances:
    @pytest.mark.parametrize("size", ["1e31", "1e200", "1e308"])
    @pytest.mark.parametrize(
        "text",
        [
            "Boundary Box [-9:9;-{}:9;-9:9]\n",
            "Boundary Box [-9:9;-9:9;-9:{}]\n",
            "Boundary Sphere [0 {} 0; 1]\n",
            "Boundary Sphere [0 0 0; {}]\n",
        ],
    )
    def test_boundaries_without_end_are_refused_at_the_number(self, folder: Path, text: str, size: str) -> None:
        text = text.format(size)
        found = fault(lambda: env2mjcf.read(write(folder, f"{text}Multibodies\n1\n{ROBOT}")))
        column = text.index(size) + 1 - (f"-{size}" in text)
        assert (found.code, found.span and found.span.column) == ("ENV183", column)

    @pytest.mark.parametrize("joint", ["Revolute", "Prismatic", "Spherical -1:1"])
    def test_so_are_limits_of_joints(self, folder: Path, joint: str) -> None:
        text = BOX + "1\n" + chain(2, "-1e308:1e308").replace("Revolute", joint)
        assert fault(lambda: env2mjcf.read(write(folder, text))).code == "ENV183"

    def test_and_boundaries_of_problems(self, folder: Path) -> None:
        axes = "".join(f'<parameter Label="{a}" min="-1" max="1e200"/>' for a in "xyz")
        inside = f'<Environment filename="hostile.env"><boundary type="bbox">{axes}</boundary></Environment>'
        write(folder, BOX + "1\n" + ROBOT)
        problem = write(folder, f"<MotionPlanning><MPProblem>{inside}</MPProblem></MotionPlanning>", "p.xml")
        assert fault(lambda: env2mjcf.read(problem)).code == "ENV183"

    def test_the_largest_is_planned_in(self, folder: Path) -> None:
        pytest.importorskip("ompl", reason="planning needs the extra planning")
        from env2mjcf import planning

        scene = load(folder, (BOX + "1\n" + ROBOT).replace("9", f"{LARGEST:g}"))
        goal = np.array([0, 0, 7.0, 0, 0, 0])
        assert planning.plan(scene, np.zeros(6), goal).solved


class TestMissingMeshes:
    NAMES = 40

    def test_the_folder_is_listed_once_and_few_names_are_guessed(
        self, folder: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        listed: list[str] = []
        guessed: list[str] = []
        listdir = os.listdir
        monkeypatch.setattr(resolve.os, "listdir", lambda f: listed.append(str(f)) or listdir(f))
        monkeypatch.setattr(resolve, "did_you_mean", lambda word, _: guessed.append(word) or "did you mean 'cube.g'?")
        bodies = "".join(f"Passive\ncube{i}.g 0 0 0 0 0 0\n" for i in range(self.NAMES))
        found = fault(lambda: load(folder, f"{BOX}{self.NAMES}\n{bodies}"))
        assert (found.code, len(listed), guessed) == ("GEO201", 1, ["cube0.g", "cube1.g", "cube2.g"])
        first, *named, left = found.diagnostic.message.splitlines()
        assert first == f"{self.NAMES} mesh files cannot be used:"
        assert all("there is no mesh file" in line for line in named)
        assert left == f"... and {self.NAMES - len(named)} more lines"


class TestCounts:
    def test_pairs_are_counted_before_meshes_are_loaded(self, folder: Path, no_geometry: None) -> None:
        assert fault(lambda: load(folder, BOX + "9\n" + ROBOT * 9, limits=Limits(pairs=35))).code == "GEO275"

    def test_so_are_links_within_each_other(self, folder: Path, no_geometry: None) -> None:
        text = BOX + "1\n" + chain(497)
        found = fault(lambda: load(folder, text))
        assert found.code == "MJC403"
        assert found.span is not None
        assert text.splitlines()[found.span.line - 1].startswith("495 496 Revolute")

    @pytest.mark.slow
    def test_the_longest_chain_loads(self, folder: Path) -> None:
        assert load(folder, BOX + "1\n" + chain(496), self_collision=False).model.nbody == 497


class TestSteps:
    @pytest.mark.filterwarnings("error")
    @pytest.mark.parametrize("step", ["1e-12", "5e-324"])
    def test_a_resolution_of_the_file_is_blamed_where_it_stands(
        self, folder: Path, step: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        env = write(folder, (BOX + "1\n" + ROBOT).replace("Multibodies", f"PositionRes {step}\nMultibodies"))
        path = self.path(folder, "1")
        assert main(["check", str(env), str(path), "--engine", "mujoco"]) == 3
        assert f"{env}:2:1: error CFG536: PositionRes {float(step):g}" in capsys.readouterr().err
        assert main(["check", str(env), str(path), "--engine", "mujoco", "--resolution", "0.1"]) == 0
        assert main(["check", str(env), str(path), "--engine", "mujoco", "--resolution", step]) == 2

    @pytest.mark.parametrize("resolution", ["", "PositionRes 0.01\n"])
    def test_a_way_without_end_is_blamed_by_its_line(
        self, folder: Path, resolution: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        env = write(folder, (BOX + "1\n" + ROBOT).replace("Multibodies", f"{resolution}Multibodies"))
        path = self.path(folder, "1e12")
        assert main(["check", str(env), str(path), "--engine", "mujoco"]) == 3
        assert f"error CFG537: edge from configuration 1 to 2 ({path}:4) is too long" in capsys.readouterr().err

    @pytest.mark.parametrize("engine", ["exact", "mujoco"])
    def test_edges_of_an_array_take_no_memory_for_steps_without_end(self, folder: Path, engine: str) -> None:
        if engine == "exact":
            pytest.importorskip("numba", reason="the exact engine needs the extra fast")
        scene = env2mjcf.load(write(folder, BOX + "1\n" + ROBOT), engine=engine)
        ends = np.zeros((2, 6))
        ends[1, 0] = 9
        for ask in (scene.edge_in_collision, scene.edge_rows):
            with pytest.raises(ValueError, match=r"1e-12; in such steps an edge has 9e\+12 configurations"):
                ask(*ends, resolution=1e-12)
        with pytest.raises(ValueError, match="resolution is 1e-12; in such steps"):
            scene.check_path(ends, resolution=1e-12)

    def test_a_resolution_that_nothing_can_be_planned_with_is_refused(
        self, folder: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        pytest.importorskip("ompl", reason="planning needs the extra planning")
        env = write(folder, (BOX + "1\n" + ROBOT).replace("Multibodies", "PositionRes 1e-12\nMultibodies"))
        words = ["plan", str(env), "--query", str(write(folder, "0 0 0 0 0 0 0\n0 0 7 0 0 0 0\n", "a.query"))]
        assert main([*words, "--engine", "mujoco"]) == 3
        assert f"{env}:2:1: error CFG536: PositionRes 1e-12: planning takes steps" in capsys.readouterr().err
        assert main([*words, "--engine", "mujoco", "--resolution", "1e-12"]) == 2
        assert "resolution is 1e-12; expected at least" in capsys.readouterr().err

    def test_environments_of_xml_have_its_place_too(self, folder: Path) -> None:
        text = '<Environment positionRes="1e-12"></Environment>'
        span = env2mjcf.read(write(folder, text, "x.xml")).resolution.span
        assert span is not None
        assert span.column == text.index("positionRes") + 1 or span.column == text.index("1e-12") + 1

    @staticmethod
    def path(folder: Path, x: str) -> Path:
        return write(folder, f"VIZMO_PATH_FILE   Path Version 2012\n1\n2\n0 0 0 0 0 0\n{x} 0 0 0 0 0\n", "a.path")


def peak(run: object) -> int:
    """Return the bytes that a call takes at most."""
    tracemalloc.start()
    try:
        run()  # pyright: ignore
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


class TestCorners:
    def test_flat_parts_of_very_many_become_several_polygons(self) -> None:
        angle = 2 * np.pi * np.arange(4000) / 4000
        disc = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
        fan = np.array([(0, i, i + 1) for i in range(1, 3999)])
        found = convex_polygons(disc, fan, 1e-9)
        assert sorted(f for p in found for f in p.faces) == list(range(3998))
        assert max(len(p.loop) for p in found) <= 1000
        assert len(found) < 20


class TestMemory:
    def test_of_a_polygon_does_not_grow_with_the_square_of_its_corners(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(pieces, "_BLOCK", 10_000)
        angle = 2 * np.pi * np.arange(2000) / 2000
        disc = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
        polygon = Polygon(tuple(range(2000)), np.array([0, 0, 1.0]), (0,))
        assert peak(lambda: prisms(disc, [polygon], 0.01, False)) < 8 * 2000 * 2000

    def test_of_a_push_does_not_grow_with_the_boxes_that_are_met(
        self, folder: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        sizes: list[int] = []
        original = triangle_sweep._boxes_meet

        def noted(*arguments: object) -> object:
            sizes.append(len(arguments[4]))  # pyright: ignore
            return original(*arguments)  # pyright: ignore

        monkeypatch.setattr(triangle_sweep, "_BLOCK", 100)
        monkeypatch.setattr(triangle_sweep, "_boxes_meet", noted)
        fan = [(np.cos(a), np.sin(a), 0.5) for a in np.linspace(0, 6, 50)]
        rows = "".join(f"{x} {y} {z}\n" for x, y, z in [(0, 0, 0), (0, 0, 1), *fan])
        write(folder, f"1 52 50 150\n1 50\n{rows}" + "".join(f"1 2 -{i + 3}\n" for i in range(50)), "fan.g")
        scene = load(folder, BOX + "2\nPassive\nfan.g 0.5 0.5 0.5 0 0 0\n" + ROBOT)
        assert scene.contacts(scene.space.home)
        assert (max(sizes), sum(sizes) > 1000) == (100, True)
