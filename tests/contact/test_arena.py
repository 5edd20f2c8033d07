"""Contacts are complete, however many there are: MuJoCo's memory is sized for them, or they are asked for in parts."""

from __future__ import annotations

import itertools
import re
import shutil
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scenes import MODELS, box_mesh, fault, free_cube, notched_block, write_scene
from truth import Truth

import env2mjcf
from env2mjcf.cli.main import main
from env2mjcf.contact.arena import lack
from env2mjcf.contact.mujoco_engine import MujocoEngine
from env2mjcf.mjcf import dense_contacts, scenery
from env2mjcf.simulation import loading

# The half section of a closed bottle with walls, radius and height, from the middle of its foot to that of its floor.
PROFILE = [(0, 0), (0.35, 0), (0.4, 0.05), (0.4, 0.5), (0.35, 0.65), (0.12, 0.8), (0.1, 1.0)]
PROFILE += [(0.08, 1.0), (0.1, 0.78), (0.32, 0.62), (0.36, 0.48), (0.36, 0.08), (0, 0.05)]

STEP = """
import sys, mujoco
model = mujoco.MjModel.from_xml_path(sys.argv[1])
data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, model.key(sys.argv[2]).id)
mujoco.mj_step(model, data, 3)
print(data.ncon, data.nefc, data.warning.number.max())
"""


def bottle(sides: int) -> str:
    """A bottle with round walls of so many sides, as BYU."""
    ring = PROFILE[1:-1]
    angles = np.arange(sides) * 2 * np.pi / sides
    points = [(r * np.cos(a), r * np.sin(a), z) for a in angles for r, z in ring]
    points += [(0, 0, PROFILE[0][1]), (0, 0, PROFILE[-1][1])]
    n, foot = len(ring), sides * len(ring)
    faces = []
    for i, j in ((i, (i + 1) % sides) for i in range(sides)):
        faces += [(foot, j * n, i * n), (foot + 1, i * n + n - 1, j * n + n - 1)]
        for s in range(n - 1):
            faces += [(i * n + s, j * n + s, j * n + s + 1), (i * n + s, j * n + s + 1, i * n + s + 1)]
    lines = [f"1 {len(points)} {len(faces)} {3 * len(faces)}", f"1 {len(faces)}"]
    lines += [" ".join(repr(float(x)) for x in p) for p in points]
    lines += [f"{a + 1} {b + 1} -{c + 1}" for a, b, c in faces]
    return "\n".join(lines) + "\n"


def eight_about_one(folder: Path, sides: int) -> Path:
    """A bottle that moves, among eight others that it crosses at home."""
    poses = [
        f"{0.03 * np.cos(a)} {0.03 * np.sin(a)} {0.02 * np.sin(2 * a)} {0.02 * a} {0.05 * a} {0.1 * a}"
        for a in np.arange(8) * np.pi / 4
    ]
    robot = "1\nbottle.g Volumetric Rotational\nConnections\n0\n"
    return write_scene(folder, free_cube(*(f"bottle.g {p}" for p in poses), robot=robot), bottle=bottle(sides))


def robots_in_one_place(folder: Path, mesh: str, count: int) -> Path:
    """Robots of one mesh of the spherical arm, all at the origin at home."""
    shutil.copy(MODELS / "spherical-arm" / "meshes" / f"{mesh}.g", folder)
    robot = f"Active\n1\n{mesh}.g Volumetric Rotational\nConnections\n0\n\n"
    path = folder / "stack.env"
    path.write_text(f"Boundary Box [-9:9;-9:9;-9:9]\n\nMultiBodies\n{count}\n\n{count * robot}")
    return path


def star(links: int) -> str:
    """A robot whose links all hang on the first, all in one place."""
    joints = "".join(f"0 {i} Revolute -1:1\n{'0 ' * 6}\n{'0 ' * 4}\n{'0 ' * 6}\n" for i in range(1, links))
    bodies = "cube.g Volumetric Rotational\n" + "cube.g Joint\n" * (links - 1)
    return free_cube(robot=f"{links}\n{bodies}Connections\n{links - 1}\n{joints}")


def chain(links: int) -> str:
    joints = "".join(f"{i} {i + 1} Revolute -1:1\n{'0 ' * 6}\n{'0 ' * 4}\n{'0 ' * 6}\n" for i in range(links - 1))
    bodies = "cube.g Volumetric Rotational\n" + "cube.g Joint\n" * (links - 1)
    return free_cube(robot=f"{links}\n{bodies}Connections\n{links - 1}\n{joints}")


def crowd(folder: Path, seed: int) -> Path:
    """A chain of blocks and grooved blocks among others, at random places in a small room."""
    random = np.random.default_rng(seed)
    stems = ("cube", "notched", "small")

    def mesh() -> str:
        return f"{stems[random.integers(3)]}.g"

    def numbers(count: int, reach: float) -> str:
        return " ".join(f"{x:.4f}" for x in random.uniform(-reach, reach, count))

    reach = random.choice([0.0, 0.01, 0.5, 2.0])
    links = int(random.integers(1, 8))
    joints = "".join(
        f"{random.integers(i)} {i} Revolute -1:1\n{numbers(3, reach)} 0 0 0\n0 0 0 0\n{numbers(3, reach)} 0 0 0\n"
        for i in range(1, links)
    )
    bodies = f"{mesh()} Volumetric Rotational\n" + "".join(f"{mesh()} Joint\n" for _ in range(links - 1))
    obstacles = [f"{mesh()} {numbers(3, reach)} {numbers(3, 1)}" for _ in range(random.integers(0, 8))]
    text = free_cube(*obstacles, robot=f"{links}\n{bodies}Connections\n{links - 1}\n{joints}")
    return write_scene(folder, text, notched=notched_block(), small=box_mesh(0.2, 0.3, 0.1))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(autouse=True)
def _silence(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    """MuJoCo prints nothing by itself, and leaves no file behind."""
    yield
    assert "WARNING: " not in capfd.readouterr().err
    assert not list(tmp_path.rglob("MUJOCO_LOG.TXT"))


def engine_of(scene: env2mjcf.Scene, memory: int) -> MujocoEngine:
    """An engine whose MuJoCo has so many bytes for contacts."""
    spec = scene.spec()
    spec.memory = memory
    return MujocoEngine(spec.compile(), scene.compiled.document.owners, scene.extent)


def found(engine: MujocoEngine, qpos: np.ndarray) -> list[tuple[str, str, tuple[float, ...]]]:
    touching = engine.touching(qpos, engine.data())
    return sorted((*sorted((a, b)), (*np.round(p, 9), round(d, 9))) for a, b, p, _, d in touching)


def same_in_parts(path: Path, rows: int = 4) -> None:
    """An engine that must ask in parts says what one with enough memory says, and so does python-fcl."""
    scene = env2mjcf.load(path, engine="mujoco")
    truth = Truth(scene)
    full = engine_of(scene, 1 << 28)
    q = np.vstack([scene.space.home, scene.space.interpolate(scene.space.home, scene.space.sample(1, seed=1)[0], rows)])
    qpos = scene.space.qpos(q)
    hits = full.collide(qpos, full.data())
    wanted = [found(full, row) for row in qpos]
    # Little more than what compiling takes, and what holds more and more of the contacts.
    for memory in (30_000, 60_000, 300_000):
        engine = engine_of(scene, memory)
        assert np.array_equal(engine.collide(qpos, engine.data()), hits)
        assert [found(engine, row) for row in qpos] == wanted
        named = engine.touching_names(qpos[0], engine.data())
        assert named == {frozenset((a, b)) for a, b, _ in wanted[0]}
    touching = set(map(frozenset, scene.touching_pairs(scene.space.home)))
    assert touching >= {frozenset(pair) for pair in scene.pairs if pair_collides(truth, scene, pair)}
    for row in q:
        if scene.in_collision(row) != truth.collides(row):
            assert truth.clearance(row) < 1e-5 * scene.extent
            assert truth.depth_is_below(row, 1e-5 * scene.extent)


class TestInParts:
    @pytest.mark.parametrize("seed", range(4))
    def test_answers_are_those_of_enough_memory(self, folder: Path, seed: int) -> None:
        same_in_parts(crowd(folder, seed))

    @pytest.mark.slow
    @pytest.mark.parametrize("seed", range(4, 200))
    def test_and_so_they_are_for_many(self, folder: Path, seed: int) -> None:
        same_in_parts(crowd(folder, seed))

    def test_all_pairs_of_links_in_one_place_are_named(self, folder: Path) -> None:
        scene = env2mjcf.load(write_scene(folder, star(30)), engine="mujoco")
        engine = engine_of(scene, 40_000)
        pairs = engine.touching_names(scene.space.qpos(scene.space.home), engine.data())
        # All pairs but those of the first link, which is next to each other one.
        assert pairs == {frozenset(p) for p in itertools.combinations(scene.link_names[1:], 2)}

    def test_what_two_geoms_do_not_fit_into_is_refused(self, folder: Path) -> None:
        scene = env2mjcf.load(write_scene(folder, free_cube("0 0 0 0 0 0")), engine="mujoco")
        engine = engine_of(scene, 700)
        said = fault(lambda: list(engine.touching(scene.space.qpos(scene.space.home), engine.data())))
        assert said.code == "MJC405"
        assert "exclude_pairs" in said.diagnostic.hint


class TestMemory:
    def test_small_scenes_leave_it_to_mujoco(self, folder: Path) -> None:
        scene = env2mjcf.load(write_scene(folder, free_cube("3 0 0 0 0 0", "0 3 0 0 0 0")))
        assert "<size" not in scene.xml

    @pytest.mark.parametrize("links", [60, 120])
    def test_it_is_never_less_than_mujocos_own_choice(self, folder: Path, links: int) -> None:
        scene = env2mjcf.load(write_scene(folder, star(links)), engine="mujoco")
        spec = scene.spec()
        assert spec.memory == scene.model.narena
        spec.memory = -1
        assert scene.model.narena >= spec.compile().narena

    def test_boxes_that_collide_as_surfaces_count_by_their_prisms(self, folder: Path) -> None:
        path = write_scene(folder, free_cube("3 0 0 0 0 0"))
        for primitives in (False, True):
            compiled = env2mjcf.load(path, collision="surface", primitives=primitives, engine="mujoco").compiled
            cells = [sum(n.startswith(f"{name}:") for n in compiled.document.owners) for name in ("cube", "cube_2")]
            assert min(cells) > 1
            # 8 contacts of two cells, at most, and 40 of each cell with the other body.
            expected = min(8 * cells[0] * cells[1], 40 * max(cells))
            assert dense_contacts.possible_contacts(compiled.assembly, compiled.pairs).tolist() == [expected]

    @pytest.mark.parametrize("sides", [8, pytest.param(48, marks=pytest.mark.slow)])
    def test_what_is_written_steps_in_plain_mujoco(self, folder: Path, sides: int) -> None:
        result = env2mjcf.convert(eight_about_one(folder, sides), folder / "out")
        step = [sys.executable, "-c", STEP, str(result.xml), "home"]
        done = subprocess.run(step, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
        assert (done.returncode, done.stderr) == (0, "")
        contacts, forces, warned = map(int, done.stdout.split())
        assert contacts > 10_000 * sides / 16
        assert (forces, warned) == (4 * contacts, 0)
        assert not list(folder.rglob("MUJOCO_LOG.TXT"))

    @pytest.mark.slow
    def test_no_more_is_asked_for_than_is_sane(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(dense_contacts, "MOST_MEMORY", 20 << 20)
        scene = env2mjcf.load(write_scene(folder, star(80)), engine="mujoco")
        assert re.findall(r'<size memory="(.*)"/>', scene.xml) == ["20M"]
        said = [d for d in scene.diagnostics if d.code == "MJC405"]
        assert [d.severity for d in said] == ["warning"]
        assert "at home" in said[0].message
        assert ["gets 0.0195" in d.message for d in scene.diagnostics if d.code == "MJC419"] == [True]
        # Verdicts, contacts and places are there all the same.
        assert scene.in_collision(scene.space.home)
        pairs = {frozenset(p) for p in itertools.combinations(scene.link_names[1:], 2)}
        assert set(map(frozenset, scene.touching_pairs(scene.space.home))) == pairs
        assert {frozenset((c.link, c.other)) for c in scene.contacts(scene.space.home)} == pairs
        scene.data.time = 3.0
        refused = fault(lambda: scene.set(scene.space.home + 0.25))
        assert (refused.code, type(refused)) == ("MJC405", env2mjcf.ConversionError)
        assert scene.data.time == 3.0
        assert np.allclose(scene.q(), scene.space.home + 0.25)
        place = scene.link_poses(scene.space.home + 0.25)[0, :3, 3]
        assert np.allclose(scene.data.body(scene.link_names[0]).xpos, place)

    def test_warnings_of_users_own_calls_are_counted_and_shown(self, folder: Path) -> None:
        scene = env2mjcf.load(write_scene(folder, free_cube("3 0 0 0 0 0")))
        scene.set(scene.space.home)
        assert scene.data.warning.number.max() == 0

    @pytest.mark.parametrize("mesh", ["hand", pytest.param("hoop", marks=pytest.mark.slow)])
    def test_two_bodies_in_one_place_need_what_is_reckoned_with(self, folder: Path, mesh: str) -> None:
        scene = env2mjcf.load(robots_in_one_place(folder, mesh, 2), engine="mujoco")
        compiled = scene.compiled
        data = mujoco.MjData(scene.model)
        mujoco.mj_forward(scene.model, data)
        possible = int(dense_contacts.possible_contacts(compiled.assembly, compiled.pairs).sum())
        assert 0.5 * possible <= data.ncon <= possible
        needed = dense_contacts.contact_memory(compiled.assembly, compiled.pairs)
        assert 0.3 * needed <= data.maxuse_arena + data.maxuse_stack <= needed

    @pytest.mark.parametrize("robots", [8, pytest.param(32, marks=pytest.mark.slow)])
    def test_robots_in_one_place_are_held(self, folder: Path, robots: int) -> None:
        result = env2mjcf.convert(robots_in_one_place(folder, "hand", robots), folder / "out")
        step = [sys.executable, "-c", STEP, str(result.xml), "home"]
        done = subprocess.run(step, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
        assert (done.returncode, done.stderr) == (0, "")
        contacts, forces, warned = map(int, done.stdout.split())
        assert contacts > 200 * robots * (robots - 1) / 2
        assert (forces, warned) == (4 * contacts, 0)


class TestDensePairs:
    def test_what_many_contacts_cost_is_said_with_a_figure(self, folder: Path) -> None:
        obstacle = free_cube("bottle.g 9 0 0 0 0 0", robot="1\nbottle.g Volumetric Rotational\nConnections\n0\n")
        scene = env2mjcf.load(write_scene(folder, obstacle, bottle=bottle(48)), engine="mujoco")
        (said,) = (d for d in scene.diagnostics if d.code == "MJC419")
        assert said.severity == "info"
        cells = [sum(n.startswith(f"{b}:") for n in scene.compiled.document.owners) for b in ("bottle", "bottle_2")]
        assert f"bottle and bottle_2, {cells[0]} and {cells[1]} convex pieces" in said.message
        assert "coacd" in said.hint
        assert "exclude_pairs" in said.hint
        # Pressed into each other, they have about as many contacts as is said.
        expected = float(re.findall(r"can have ([\d,]+) contacts", said.message)[0].replace(",", ""))
        data, rng, found = mujoco.MjData(scene.model), np.random.default_rng(0), []
        for _ in range(30):
            q = np.array([9, 0, 0, 0, 0, 0]) + rng.uniform(-1, 1, 6) * [0.4, 0.4, 0.4, 3, 3, 3]
            data.qpos[:] = scene.space.qpos(q)
            mujoco.mj_kinematics(scene.model, data)
            mujoco.mj_collision(scene.model, data)
            found.append(data.ncon)
        assert expected / 4 < max(found) < 2 * expected

    def test_where_contacts_are_few_nothing_is_said(self, folder: Path) -> None:
        text = free_cube("notched.g 3 0 0 0 0 0", "0 3 0 0 0 0")
        scene = env2mjcf.load(write_scene(folder, text, notched=notched_block()), engine="mujoco")
        assert not [d for d in scene.diagnostics if d.code == "MJC419"]


@pytest.mark.parametrize(
    ("memory", "said", "warned"),
    [
        ("20K", "out of memory", True),
        ("100K", r"its memory of 0\.0977 MB is full after \d+ contacts", True),
        ("200K", r"its memory of 0\.195 MB has no room for the forces of 190 contacts", True),
        ("2000K", "^$", False),
    ],
)
def test_what_memory_lacks_is_said_and_counted(memory: str, said: str, warned: bool) -> None:
    """Twenty balls in one place: each of 190 pairs has a contact, and four forces."""
    balls = '<body><freejoint/><geom size="1"/></body>' * 20
    text = f'<mujoco><size memory="{memory}"/><worldbody>{balls}</worldbody></mujoco>'
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    assert re.search(said, lack(mujoco.mj_forward, model, data))
    assert bool(data.warning.number.any()) is warned
    assert warned or (data.ncon, data.nefc) == (190, 760)


class TestEightBottles:
    def test_are_all_named(self, folder: Path) -> None:
        scene = env2mjcf.load(eight_about_one(folder, 12))
        truth = Truth(scene)
        named = [d.message for d in scene.diagnostics if d.code == "KIN312"]
        assert len(named) == len(scene.obstacle_names) == 8
        small = engine_of(scene, 1 << 20)
        names = small.touching_names(scene.space.qpos(scene.space.home), small.data())
        assert names == {frozenset(p) for p in scene.pairs}
        assert all(pair_collides(truth, scene, pair) for pair in scene.pairs)

    @pytest.mark.slow
    @pytest.mark.parametrize("engine", ["exact", "mujoco"])
    def test_by_contacts_and_by_the_program(
        self, folder: Path, engine: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
    ) -> None:
        # A megabyte holds a third of them.
        monkeypatch.setattr(scenery, "memory", lambda *_: 1 << 20)
        path = eight_about_one(folder, 8)
        scene = env2mjcf.load(path, engine=engine)
        assert scene.model.narena == 1 << 20
        assert {c.other for c in scene.contacts(scene.space.home)} == set(scene.obstacle_names)
        assert main(["check", str(path), *"000000", "--engine", engine]) == 1
        shown = capfd.readouterr()
        assert all(re.search(rf"\b{name}\b", shown.out) for name in scene.obstacle_names)


def pair_collides(truth: Truth, scene: env2mjcf.Scene, pair: tuple[str, str]) -> bool:
    fcl = pytest.importorskip("fcl")
    truth._place(truth.poses(scene.space.home))
    a, b = (truth._objects[name] for name in pair)
    return fcl.collide(a, b, fcl.CollisionRequest(), fcl.CollisionResult()) > 0


class TestCrowds:
    """Many bodies in one place: what is said is short, and comes soon."""

    @pytest.mark.slow
    @pytest.mark.parametrize("text", [star(500), chain(480)], ids=["star", "chain"])
    @pytest.mark.parametrize("verb", ["info", "lint", "convert"])
    def test_five_hundred_links(self, folder: Path, text: str, verb: str, capfd: pytest.CaptureFixture[str]) -> None:
        path = write_scene(folder, text)
        assert main([verb, str(path), *(["-o", str(folder / "out")] if verb == "convert" else [])]) == 0
        shown = capfd.readouterr()
        assert len(shown.out + shown.err) < 100_000
        assert "KIN315" in shown.out + shown.err
        if verb == "convert":
            step = [sys.executable, "-c", STEP, str(folder / "out" / "scene.xml"), "home"]
            done = subprocess.run(step, cwd=folder.parent, capture_output=True, text=True, timeout=300, check=False)
            (folder.parent / "MUJOCO_LOG.TXT").unlink(missing_ok=True)
            assert done.returncode == 0
            warned = "arena memory" in done.stderr
            assert warned is ("MJC405" in shown.err)

    def test_a_few_are_listed_and_all_are_counted(self, folder: Path) -> None:
        scene = env2mjcf.load(write_scene(folder, star(25)), engine="mujoco")
        codes = [d.code for d in scene.diagnostics]
        assert codes.count("KIN312") == loading._LISTED
        (said,) = [d.message for d in scene.diagnostics if d.code == "KIN315"]
        assert said.startswith("276 pairs")

    def test_excluding_them_is_short_too(self, folder: Path) -> None:
        scene = env2mjcf.load(write_scene(folder, star(25)), engine="mujoco", exclude_rest_contacts=True)
        (said,) = [d.message for d in scene.diagnostics if d.code == "KIN313"]
        assert said.endswith(", 226 more")
        assert not scene.in_collision(scene.space.home)

    def test_what_would_take_hours_is_not_looked_at(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(loading, "_CROWD", 3000)
        near = env2mjcf.load(write_scene(folder / "near", star(30)), engine="mujoco")
        assert [d.code for d in near.diagnostics] == ["KIN315"]
        assert "3248 contacts" in near.diagnostics[0].message  # 406 pairs of one cell each, eight for each
        monkeypatch.setattr(loading, "_CROWD", 0)
        away = env2mjcf.load(write_scene(folder / "away", free_cube("3 0 0 0 0 0", "0 2 0 0 0 0")), engine="mujoco")
        assert away.diagnostics == ()

    @pytest.mark.slow
    @pytest.mark.parametrize("seed", range(200, 240))
    def test_programs_end_in_order(self, folder: Path, seed: int, capfd: pytest.CaptureFixture[str]) -> None:
        crowd(folder, seed)
        assert main(["lint", str(folder)]) in (0, 1)
        assert main(["info", str(folder / "scene.env")]) == 0
        shown = capfd.readouterr()
        assert len(shown.out + shown.err) < 64_000
