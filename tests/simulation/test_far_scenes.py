"""Scenes far from the origin of their file mean the same as they do near it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
import trimesh
from extras import needs
from scenes import box_mesh, write_scene

import env2mjcf
from env2mjcf.simulation.scene import Scene
from env2mjcf.view.web.nodes import WebScene

FAR = np.array([512345.0, 5403210.0, 312.0])

# A hall with an L as its ground plan, 10 m by 10 m and 4 m high, about nothing in particular.
PLAN = np.array([[-5, -5], [5, -5], [5, 0], [0, 0], [0, 5], [-5, 5]], dtype=float)
FLOOR = [(0, 1, 2), (0, 2, 3), (0, 3, 5), (3, 4, 5)]


def hall(at: np.ndarray) -> str:
    """Return the hall as a BYU mesh, its lower corner plan about a point."""
    points = np.concatenate([np.c_[PLAN, np.full(6, -2.0)], np.c_[PLAN, np.full(6, 2.0)]]) + at
    faces = [(a, c, b) for a, b, c in FLOOR] + [(a + 6, b + 6, c + 6) for a, b, c in FLOOR]
    for i in range(6):
        j = (i + 1) % 6
        faces += [(i, j, j + 6), (i, j + 6, i + 6)]
    vertices = "\n".join(" ".join(repr(float(x)) for x in p) for p in points)
    rows = "\n".join(f"{a + 1} {b + 1} {-(c + 1)}" for a, b, c in faces)
    return f"1 12 {len(faces)} {3 * len(faces)}\n1 {len(faces)}\n{vertices}\n{rows}\n"


def numbers(values: np.ndarray) -> str:
    return " ".join(repr(float(v)) for v in values)


def dialect_a(folder: Path, at: np.ndarray) -> Path:
    """The robot stands above the hall."""
    text = (
        f"2\nMultiBody Active\n1\nFreeBody 0 cube.g {numbers(np.add(at, (0, 0, 6)))} 0 0 0\nConnection\n0\n"
        f"MultiBody Passive\n1\nFixedBody 0 hall.g {numbers(at)} 0 0 0\nConnection\n0\n"
    )
    return write_scene(folder, text, hall=hall(np.zeros(3)))


def dialect_d(folder: Path, at: np.ndarray) -> Path:
    """The robot is at home at the origin of the file; a boundary and a query are about the hall."""
    low, high = at - 20, at + 20
    sides = " ; ".join(f"{a!r}:{b!r}" for a, b in zip(low.tolist(), high.tolist(), strict=True))
    text = (
        f"Boundary Box [{sides}]\nMultibodies\n2\nActive\n2\ncube.g Volumetric Rotational\narm.g Joint\n"
        "Connections\n1\n0 1 Revolute -0.9:0.9\n0 0 0 0 0 0  0 0.5 0 0  0.5 0 0 0 0 0\n"
        f"Passive\nhall.g {numbers(at)} 0 0 30\n"
    )
    path = write_scene(folder, text, hall=hall(np.zeros(3)), arm=box_mesh(0.5, 0.1, 0.1))
    rows = [numbers(np.r_[np.add(at, (0.3, 0.2, z)), 0, 0, 0, 0.1]) for z in (6, 8)]
    (folder / "scene.query").write_text("\n".join(rows) + "\n")
    return path


def in_mesh(folder: Path, at: np.ndarray) -> Path:
    """XML: the mesh itself has the coordinates of a map, and is turned about where it is."""
    folder.mkdir()
    (folder / "hall.g").write_text(hall(at))
    (folder / "cube.g").write_text(box_mesh(0.5, 0.5, 0.5))
    low, high = at - 20, at + 20
    sides = " ; ".join(f"{a!r}:{b!r}" for a, b in zip(low.tolist(), high.tolist(), strict=True))
    (folder / "scene.xml").write_text(
        f'<Environment><Boundary space="workspace" shape="box" limits="[{sides}]"/>'
        '<MultiBody type="passive"><Base filename="hall.g" comAdjustment="none" type="fixed" '
        'transform="0 0 0 0 0 0"/></MultiBody></Environment>'
    )
    (folder / "c.robot").write_text("1\ncube.g Volumetric Rotational\nConnections\n0\n")
    return folder / "scene.xml"


MAKERS = {"A": dialect_a, "D": dialect_d, "XML": in_mesh}


def loaded(kind: str, folder: Path, at: np.ndarray, **options: object) -> Scene:
    more = {"query": folder / "scene.query"} if kind == "D" else {}
    more |= {"robots": [folder / "c.robot"]} if kind == "XML" else {}
    return env2mjcf.load(MAKERS[kind](folder, at), cache=False, **more, **options)


def rows(scene: Scene, n: int, at: np.ndarray) -> np.ndarray:
    """Return configurations about the hall, the same but for where it is."""
    rng = np.random.default_rng(7)
    q = np.zeros((n, scene.space.dim))
    q[:, :3] = rng.uniform(-7, 7, (n, 3))
    q[:, 3:] = rng.uniform(-2, 2, (n, scene.space.dim - 3))
    q = np.round(q * 64) / 64  # exact far away, too
    q[:, :3] += at
    return q


@pytest.fixture(scope="module", params=list(MAKERS))
def pair(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Scene, Scene]:
    folder = tmp_path_factory.mktemp("far")
    return (
        request.param,
        loaded(request.param, folder / "near", np.zeros(3)),
        loaded(request.param, folder / "far", FAR),
    )


def test_the_origin_of_the_mjcf_is_a_round_point_amid_the_scene(pair: tuple[str, Scene, Scene]) -> None:
    kind, near, far = pair
    assert near.origin.tolist() == [0, 0, 0]
    assert far.origin.tolist() == [512340, 5403210, 310] or far.origin.tolist() == [512350, 5403210, 310]
    assert np.abs(far.origin - FAR).max() < far.extent
    assert near.extent == pytest.approx(far.extent, rel=1e-9)
    assert 10 < far.extent < 25
    place = f"({', '.join(str(int(x)) for x in far.origin)})"
    assert place in far.xml.split("<mujoco")[0]
    assert far.report.to_dict()["origin"] == tuple(far.origin)
    assert "GEO253" in {d.code for d in far.diagnostics}
    assert not {"GEO253", "KIN314"} & {d.code for d in near.diagnostics}
    assert ("KIN314" in {d.code for d in far.diagnostics}) == (kind != "A")
    assert abs(far.model.stat.center).max() < far.extent


def test_no_number_of_the_mjcf_but_home_is_far(pair: tuple[str, Scene, Scene]) -> None:
    model = pair[2].model
    for array in (
        model.geom_pos,
        model.body_pos[:1],
        model.cam_pos,
        model.light_pos,
        model.mesh_vert,
        model.stat.center,
    ):
        assert np.abs(array).max(initial=0) < 100


def test_verdicts_and_clearances_are_those_of_the_same_scene_at_the_origin(pair: tuple[str, Scene, Scene]) -> None:
    _, near, far = pair
    here, there = rows(near, 200, np.zeros(3)), rows(far, 200, FAR)
    expected = near.clearance(here)
    assert far.clearance(there) == pytest.approx(expected, abs=1e-9 * near.extent)
    certain = np.abs(expected) > 1e-5 * near.extent
    assert 20 < (expected > 0).sum() < 180
    for engine in ("mujoco", None):
        assert (far.in_collision(there, engine=engine) == (expected <= 0))[certain].all()
        assert (far.is_valid(there, engine=engine) == near.is_valid(here))[certain].all()


def test_plain_mujoco_agrees_on_the_written_scene(pair: tuple[str, Scene, Scene], tmp_path: Path) -> None:
    kind, near, far = pair
    name = far.environment.path
    more = {"query": Path(name).with_suffix(".query")} if kind == "D" else {}
    more |= {"robots": [Path(name).parent / "c.robot"]} if kind == "XML" else {}
    written = env2mjcf.convert(name, tmp_path, cache=False, **more)
    model = mujoco.MjModel.from_xml_path(str(written.xml))
    data = mujoco.MjData(model)
    here, there = rows(near, 100, np.zeros(3)), rows(far, 100, FAR)
    clearance = near.clearance(here)
    for q, expected in zip(there, clearance, strict=True):
        data.qpos[:] = far.space.qpos(q)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        # A body wholly inside touches no thin cell.
        if abs(expected) > 1e-4 and expected > -0.9:
            assert (data.ncon > 0) == (expected < 0)


def test_a_cube_comes_to_rest_on_the_roof(tmp_path: Path) -> None:
    scene = loaded("A", tmp_path / "far", FAR)
    # Above the middle of the slab that the hall is: 2 m high, and half of the cube.
    scene.set(np.r_[np.add(FAR, (-3, -3, 2.6)), 0, 0, 0])
    for _ in range(1500):
        mujoco.mj_step(scene.model, scene.data)
    assert scene.q()[:3] == pytest.approx(np.add(FAR, (-3, -3, 2.5)), abs=1e-3)


def test_public_poses_are_in_the_frame_of_the_file(pair: tuple[str, Scene, Scene]) -> None:
    kind, near, far = pair
    here, there = rows(near, 20, np.zeros(3)), rows(far, 20, FAR)
    moved = near.link_poses(here)
    moved[..., :3, 3] += FAR
    assert far.link_poses(there) == pytest.approx(moved, abs=4e-9)
    obstacles = near.obstacle_poses()
    if kind != "XML":
        obstacles[..., :3, 3] += FAR
    assert far.obstacle_poses() == pytest.approx(obstacles, abs=4e-9)
    assert far.space.from_qpos(far.space.qpos(there)) == pytest.approx(
        near.space.from_qpos(near.space.qpos(here)) + np.r_[FAR, np.zeros(far.space.dim - 3)], abs=4e-9
    )
    assert np.abs(far.space.qpos(there)).max() < 100
    assert (far.space.home[:3] == (np.add(FAR, (0, 0, 6)) if kind == "A" else 0)).all()
    key = far.model.key("home").qpos
    assert key == pytest.approx(far.space.qpos(far.space.home), abs=1e-9)
    assert far.q()[:3] == pytest.approx(far.space.home[:3], abs=4e-9)


def test_contacts_and_reasons_are_in_the_frame_of_the_file(pair: tuple[str, Scene, Scene]) -> None:
    kind, near, far = pair
    here, there = rows(near, 40, np.zeros(3)), rows(far, 40, FAR)
    for q, p in zip(here, there, strict=True):
        expected, found = near.explain(q), far.explain(p)
        assert len(found.reasons) == len(expected.reasons)
        poses = far.link_poses(p)
        by_hand = far.contacts_of_poses(poses)
        assert bool(by_hand) == far.in_collision(p)
        for contact in (*far.contacts(p), *by_hand):
            assert np.abs(contact.position - FAR).max() < 12
    if kind != "A":
        q = near.space.home.copy()
        q[0] = 25
        expected, found = near.explain(q).reasons, far.explain(q + np.r_[FAR, np.zeros(len(q) - 3)]).reasons
        assert [r.position + FAR for r in expected] == [pytest.approx(r.position, abs=1e-8) for r in found]
        assert [r.distance for r in expected] == pytest.approx([r.distance for r in found], abs=1e-8)


def test_samples_lie_about_the_scene(pair: tuple[str, Scene, Scene]) -> None:
    _, near, far = pair
    offset = np.r_[FAR, np.zeros(far.space.dim - 3)]
    assert far.space.sample(50, 3) == pytest.approx(near.space.sample(50, 3) + offset, abs=1e-8)


def test_the_keys_of_a_query_are_near_the_origin(tmp_path: Path) -> None:
    scene = loaded("D", tmp_path / "far", FAR)
    query = scene.queries[0].q
    assert query[0, :3] == pytest.approx(np.add(FAR, (0.3, 0.2, 6)))
    assert scene.model.key("start").qpos == pytest.approx(scene.space.qpos(query[0]))
    assert np.abs(scene.model.key("start").qpos).max() < 20
    assert scene.is_valid(query).all()


@needs("fast")
def test_edges_and_proofs_are_those_at_the_origin(pair: tuple[str, Scene, Scene]) -> None:
    _, near, far = pair
    here, there = rows(near, 60, np.zeros(3)), rows(far, 60, FAR)
    expected = near.edge_in_collision(here[::2], here[1::2])
    assert (far.edge_in_collision(there[::2], there[1::2]) == expected).all()
    proved = near.edge_is_free(here[::2], here[1::2])
    assert (far.edge_is_free(there[::2], there[1::2]) == proved).all()
    assert 0 < proved.sum() < 30


def test_the_origin_may_be_named_or_left_where_it_is(tmp_path: Path) -> None:
    left = loaded("D", tmp_path / "left", FAR, origin=(0, 0, 0))
    named = loaded("D", tmp_path / "named", FAR, origin=(512000, 5403000, 300))
    assert left.origin.tolist() == [0, 0, 0]
    assert named.origin.tolist() == [512000, 5403000, 300]
    assert "GEO253" not in {d.code for d in (*left.diagnostics, *named.diagnostics)}
    q = rows(left, 40, FAR)
    assert left.extent == pytest.approx(named.extent, rel=1e-8)
    assert left.clearance(q) == pytest.approx(named.clearance(q), abs=1e-8)
    for scene in (left, named):
        assert (scene.in_collision(q, engine="mujoco") == (named.clearance(q) <= 0)).all()
        assert scene.space.qpos(q)[:, :3] == pytest.approx(q[:, :3] - scene.origin, abs=1e-9)


def test_millimetres_of_a_map_are_moved_as_metres_are(tmp_path: Path) -> None:
    path = write_scene(
        tmp_path,
        "Boundary Box [-1e12:1e12 ; -1e12:1e12 ; -1e12:1e12]\nMultibodies\n2\nActive\n1\n"
        "cube.g Volumetric Rotational\nConnections\n0\n"
        f"Passive\nhall.g {numbers(FAR * 1000)} 0 0 0\n",
        hall=hall(np.zeros(3)),
    )
    scene = env2mjcf.load(path, scale=1e-3, cache=False, dialect="D")
    assert np.abs(scene.origin - FAR).max() <= 1
    assert scene.extent < 0.1
    q = np.r_[np.add(FAR, (0, 0, 0.0026)), 0, 0, 0]
    assert scene.clearance(q) == pytest.approx(1e-4, abs=2e-9)
    assert not scene.in_collision(q, engine="mujoco")
    assert scene.in_collision(q - np.r_[0, 0, 2e-4, 0, 0, 0], engine="mujoco")


def test_obstacles_far_from_each_other_are_a_large_scene(tmp_path: Path) -> None:
    scene = env2mjcf.load(
        write_scene(
            tmp_path,
            "Boundary Box [-10:10 ; -10:10 ; -10:10]\nMultibodies\n3\nActive\n1\ncube.g Volumetric Rotational\n"
            f"Connections\n0\nPassive\ncube.g 0 0 3 0 0 0\nPassive\ncube.g {numbers(FAR)} 0 0 0\n",
        ),
        cache=False,
    )
    assert scene.origin.tolist() == [0, 0, 0]
    assert scene.extent == pytest.approx(np.linalg.norm(FAR), rel=1e-4)


def test_a_fixed_robot_counts_by_its_place(tmp_path: Path) -> None:
    scene = env2mjcf.load(
        write_scene(
            tmp_path,
            "Boundary Box [-10:10 ; -10:10 ; -10:10]\nMultibodies\n2\nActive\n2\n"
            "cube.g Fixed 0 0 0 0 0 0\ncube.g Joint\n"
            "Connections\n1\n0 1 Revolute -1:1\n0 0 1 0 0 0  0 0 0 0  1 0 0 0 0 0\n"
            f"Passive\ncube.g {numbers(FAR)} 0 0 0\n",
        ),
        cache=False,
    )
    assert scene.extent == pytest.approx(np.linalg.norm(FAR), rel=1e-4)


def test_fixed_and_planar_robots_stand_where_the_file_says(tmp_path: Path) -> None:
    x, y, _ = FAR.tolist()
    text = (
        "Boundary Box [-1e7:1e7 ; -1e7:1e7 ; -1e7:1e7]\nMultibodies\n3\nActive\n2\n"
        f"cube.g Fixed {numbers(FAR)} 0 0 90\ncube.g Joint\n"
        "Connections\n1\n0 1 Revolute -1:1\n0 0 1 0 0 0  0 0 0 0  1 0 0 0 0 0\n"
        "Active\n1\ncube.g Planar Rotational\nConnections\n0\n"
        f"Passive\nhall.g {x + 8!r} {y!r} 0 0 0 0\n"
    )
    far = env2mjcf.load(write_scene(tmp_path / "far", text, hall=hall(np.zeros(3))), cache=False)
    assert far.origin[:2] == pytest.approx(FAR[:2], abs=1000)
    q = np.r_[0.25, x + 8.75, y + 1.25, 0.5]
    kinematics = [
        r.kinematics
        for r in env2mjcf.load(tmp_path / "far" / "scene.env", origin=(0, 0, 0), cache=False).compiled.assembly.robots
    ]
    expected = np.concatenate([k.forward(part) for k, part in zip(kinematics, (q[:1], q[1:]), strict=True)])
    assert far.link_poses(q) == pytest.approx(expected, abs=4e-9)
    # A planar robot stays at height 0 of the file.
    assert far.link_poses(q)[2, :3, 3] == pytest.approx([x + 8.75, y + 1.25, 0], abs=4e-9)
    for at in (0.75, 2.0):
        q[2] = y + at
        assert far.in_collision(q, engine="mujoco") == far.in_collision(q) == (far.clearance(q) <= 0)


def test_a_link_whose_mesh_is_far_from_its_frame_is_exact(tmp_path: Path) -> None:
    """Its frame stays the planner's: a turn about it swings the mesh by a long way."""
    arm = np.array([40000.0, 0, 0])
    text = (
        '<Environment><MultiBody type="passive"><Base filename="cube.g" comAdjustment="com" '
        'type="fixed" transform="0 0 0 0 0 0"/></MultiBody></Environment>'
    )
    robot = (
        '<Robot><MultiBody type="active"><Base filename="arm.g" comAdjustment="none" type="volumetric" '
        'movement="rotational"/></MultiBody></Robot>'
    )
    scenes: list[Scene] = []
    for name, at in (("far", arm), ("near", np.zeros(3))):
        path = write_scene(tmp_path / name, text, "scene.xml", arm=hall(at))
        (path.parent / "arm.robot").write_text(robot)
        scenes.append(env2mjcf.load(path, robots=path.parent / "arm.robot", cache=False))
    far, near = scenes
    assert np.abs(far.model.mesh_vert).max() < 20
    rng = np.random.default_rng(0)
    here = rng.uniform(-1, 1, (60, 6)) * (6, 6, 4, 2, 2, 2)
    there = here.copy()
    # The frame stands where it must for the mesh to be where the near one is.
    rotations = near.link_poses(here)[:, 0, :3, :3]
    there[:, :3] = here[:, :3] - rotations @ arm
    expected = near.clearance(here)
    assert 5 < (expected > 0).sum() < 55
    assert far.clearance(there) == pytest.approx(expected, abs=1e-9 * 40000 * 1e-3)
    assert (far.in_collision(there) == (expected <= 0)).all()
    assert (far.in_collision(there, engine="mujoco") == (expected <= 0)).all()
    inertia = near.compiled.assembly.links[0].inertial, far.compiled.assembly.links[0].inertial
    assert inertia[1].com - arm == pytest.approx(inertia[0].com, abs=1e-9)
    assert inertia[1].mass == pytest.approx(inertia[0].mass, rel=1e-12)


@pytest.mark.parametrize("at", [1e12, 1e17])
def test_where_doubles_are_too_coarse_the_scene_is_refused(tmp_path: Path, at: float) -> None:
    with pytest.raises(env2mjcf.GeometryError, match="GEO254") as raised:
        loaded("D" if at < 1e15 else "A", tmp_path / "far", np.array([at, 0, 0]))
    assert "apart" in str(raised.value)


def test_a_mesh_in_single_precision_far_away_is_reported(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=5.0)
    ball.apply_translation((512345, 5403210, 312))
    tmp_path.mkdir(exist_ok=True)
    (tmp_path / "ball.stl").write_bytes(ball.export(file_type="stl"))
    path = write_scene(
        tmp_path,
        '<Environment><MultiBody type="passive"><Base filename="ball.stl" comAdjustment="none" type="fixed" '
        'transform="0 0 0 0 0 0"/></MultiBody></Environment>',
        "scene.xml",
    )
    found = [d for d in env2mjcf.load(path, cache=False).diagnostics if d.code == "GEO255"]
    assert len(found) == 1
    assert "0.5 m apart" in found[0].message


def test_paths_queries_and_recorded_poses_keep_the_frame_of_the_file(
    pair: tuple[str, Scene, Scene], tmp_path: Path
) -> None:
    kind, _, far = pair
    q = rows(far, 12, FAR)
    assert env2mjcf.read_path(far, env2mjcf.write_path(far, q, tmp_path / "a.path")).q == pytest.approx(q, abs=2e-9)
    if kind != "A":
        return
    # As dialect A's planner printed them: six decimals, angles about fixed axes in turns.
    lines = ["VIZMO_PATH_FILE   Path Version 2001125", "1", str(len(q))]
    lines += [" ".join(f"{x:.6f}" for x in (*row[:3], *row[3:] / 6.2832)) for row in q]
    (tmp_path / "b.path").write_text("\n".join(lines) + "\n")
    found = env2mjcf.read_path(far, tmp_path / "b.path")
    assert found.fits.all()
    assert far.link_poses(found.q) == pytest.approx(far.link_poses(q), abs=1e-4)


def test_batches_answer_as_the_scene_does(pair: tuple[str, Scene, Scene], tmp_path: Path) -> None:
    _, near, far = pair
    np.save(tmp_path / "q.npy", rows(far, 50, FAR))
    env2mjcf.batch.run(far, tmp_path / "q.npy", tmp_path / "out.npy", "clearance")
    expected = near.clearance(rows(near, 50, np.zeros(3)))
    assert np.load(tmp_path / "out.npy") == pytest.approx(expected, abs=1e-9 * near.extent)


@needs("fast")
def test_plans_are_found_about_the_scene(tmp_path: Path) -> None:
    scene = loaded("D", tmp_path / "far", FAR)
    q = scene.queries[0].q
    plan = env2mjcf.planning.plan(scene, q[0], q[1])
    assert plan.solved
    assert plan.certified.all()
    env2mjcf.testing.assert_valid_path(scene, plan.path)
    wrong = q[0] - np.r_[0, 0, 6, np.zeros(4)]
    with pytest.raises(AssertionError, match=r"at \(5123\d\d\.\d+, 54032\d\d\.\d+, 31\d"):
        env2mjcf.testing.assert_free(scene, wrong)


def test_translations_stand_where_the_file_says(tmp_path: Path) -> None:
    path = dialect_d(tmp_path / "far", FAR)
    for dialect in ("B", "C"):
        translated = env2mjcf.translate(env2mjcf.read(path), dialect)
        env2mjcf.write_environment(translated.environment, path.with_name(f"{dialect}.env"))
        there, source = (env2mjcf.load(p, cache=False) for p in (path.with_name(f"{dialect}.env"), path))
        q = rows(source, 30, FAR)
        assert there.origin.tolist() == source.origin.tolist()
        assert there.clearance(q) == pytest.approx(source.clearance(q), abs=1e-8)


@pytest.mark.parametrize("ground", [False, True])
def test_the_ground_lies_below_every_key(tmp_path: Path, ground: bool) -> None:
    scene = loaded("D", tmp_path / "far", FAR, ground=ground)
    planes = np.flatnonzero(scene.model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
    assert len(planes) == ground
    for plane in planes:
        assert scene.model.geom_pos[plane, 2] < scene.space.qpos(scene.space.home)[2] - 0.5


@pytest.mark.parametrize("at", [np.zeros(3), FAR], ids=["near", "far"])
def test_the_ground_lies_below_start_and_goal(tmp_path: Path, at: np.ndarray) -> None:
    """A cube of half side 0.5 is taken under the hall."""
    path = dialect_d(tmp_path / "scene", at)
    starts = [numbers(np.r_[np.add(at, (0.3, 0.2, z)), 0, 0, 0, 0]) for z in (-400, -390)]
    path.with_suffix(".query").write_text("\n".join(starts) + "\n")
    scene = env2mjcf.load(path, query=path.with_suffix(".query"), ground=True, cache=False)
    lowest = min(scene.model.key(name).qpos[2] for name in ("home", "start", "goal")) - 0.5
    assert lowest - 1 < scene.model.geom("ground").pos[2] < lowest


class Page:
    """Keeps what a page is handed, in the precision of browsers."""

    def __init__(self) -> None:
        self.scene = self
        self.shown: list[tuple[np.ndarray, SimpleNamespace]] = []

    def add_mesh_simple(self, name: str, vertices: np.ndarray, faces: np.ndarray, **_: object) -> SimpleNamespace:
        self.shown.append((vertices.astype(np.float32), SimpleNamespace()))
        return self.shown[-1][1]

    def points(self) -> np.ndarray:
        return np.concatenate(
            [v.astype(float) @ mujoco_rotation(node.wxyz).T + node.position for v, node in self.shown]
        )


def mujoco_rotation(quaternion: np.ndarray) -> np.ndarray:
    flat = np.zeros(9)
    mujoco.mju_quat2Mat(flat, np.asarray(quaternion))
    return flat.reshape(3, 3)


def test_pages_show_bodies_where_they_are(pair: tuple[str, Scene, Scene]) -> None:
    _, near, far = pair
    shown: list[np.ndarray] = []
    for scene, at in ((near, np.zeros(3)), (far, FAR)):
        page = Page()
        web = WebScene(page, scene)  # type: ignore[arg-type]
        web.place(scene.link_poses(rows(scene, 1, at)[0]))
        shown.append(page.points() + scene.origin - at)
        assert max(np.spacing(np.abs(v).max()) for v, _ in page.shown) < 1e-5
    assert shown[0] == pytest.approx(shown[1], abs=1e-5)


@needs("view")
@pytest.mark.slow
def test_pictures_show_what_the_same_scene_at_the_origin_shows(pair: tuple[str, Scene, Scene]) -> None:
    _, near, far = pair
    here, there = (np.r_[np.add(at, (-2, -2, 3)), np.zeros(near.space.dim - 3)] for at in (np.zeros(3), FAR))
    camera = env2mjcf.view.Direction(1.0, -0.8)
    pictures = [
        env2mjcf.view.picture(scene, q, size=(160, 120), camera=camera) for scene, q in ((near, here), (far, there))
    ]
    apart = np.abs(pictures[0].astype(float) - pictures[1]).max(axis=-1)
    assert (apart > 40).mean() < 0.02
    assert np.ptp(pictures[1]) > 50


@pytest.mark.parametrize("primitives", [False, True])
def test_the_model_is_that_of_the_same_scene_at_the_origin(tmp_path: Path, primitives: bool) -> None:
    """Walls, boundary, actuators, ground, camera and keys, too: nothing is in two frames."""

    def path(name: str, at: np.ndarray) -> Path:
        sides = " ; ".join(f"{c - 20!r}:{c + 20!r}" for c in at.tolist())
        place = numbers(at)
        text = (
            f"Boundary Box [{sides}]\nMultibodies\n4\nActive\n2\ncube.g Fixed {place} 10 20 30\narm.g Joint\n"
            "Connections\n1\n0 1 Revolute -0.9:0.9\n0 0 1 0 0 0  0 0.5 0 0  0.5 0 0 0 0 0\n"
            "Active\n1\ncube.g Volumetric Translational\nConnections\n0\n"
            f"Passive\nhall.g {numbers(np.add(at, (9, 3, 1)))} 40 50 60\nSurface floor\ncube.g {place} 0 0 0\n"
        )
        return write_scene(tmp_path / name, text, hall=hall(np.zeros(3)), arm=box_mesh(0.5, 0.1, 0.1))

    options = {"boundary": "solid", "actuators": "position", "primitives": primitives, "cache": False}
    far = env2mjcf.load(path("far", FAR), **options)
    near = env2mjcf.load(path("near", np.zeros(3)), origin=far.origin - FAR, **options)
    assert far.origin == pytest.approx(FAR, abs=30)
    for name in dir(far.model):
        array = getattr(far.model, name)
        # The robot that travels is at home at the origin of its file.
        if isinstance(array, np.ndarray) and array.dtype.kind == "f" and not name.startswith("key_"):
            assert array == pytest.approx(getattr(near.model, name), abs=2e-8, rel=1e-6), name
    q = np.r_[0.3, 1, 2, 3.0]
    key = far.space.qpos(q + np.r_[0, FAR])
    assert key == pytest.approx(near.space.qpos(q), abs=2e-9)
    assert far.model.key("home").qpos == pytest.approx(np.r_[0, -far.origin], abs=1e-9)


def test_a_mesh_far_from_its_frame_turns_about_it(tmp_path: Path) -> None:
    """Its coordinates are those of a map, and its pose turns the whole map."""
    arm = np.array([512345.0, 0, 0])
    robot = "1\ncube.g Volumetric Rotational\nConnections\n0\n"
    scenes: list[Scene] = []
    for name, at, place in (("far", arm, "0 0 0"), ("near", np.zeros(3), "0 512345 0")):
        text = (
            '<Environment><MultiBody type="passive"><Base filename="hall.g" comAdjustment="none" type="fixed" '
            f'transform="{place} 0 0 90"/></MultiBody></Environment>'
        )
        path = write_scene(tmp_path / name, text, "scene.xml", hall=hall(at))
        (path.parent / "c.robot").write_text(robot)
        scenes.append(env2mjcf.load(path, robots=path.parent / "c.robot", cache=False))
    far, near = scenes
    assert far.origin.tolist() == near.origin.tolist() == [0, 512340, 0] or far.origin[1] == 512350
    assert far.obstacle_poses()[0, :3, 3] == pytest.approx(0, abs=1e-9)
    q = rows(near, 60, np.array([0, 512345.0, 0]))
    assert far.clearance(q) == pytest.approx(near.clearance(q), abs=1e-8)
    assert (far.in_collision(q, engine="mujoco") == near.in_collision(q)).all()
