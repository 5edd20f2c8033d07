"""The MJCF that comes out: joints, inertias, keyframes, loops, actuators, boundary, and the errors of MuJoCo."""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest
from extras import missing
from lxml import etree
from mjcf_schema import assert_known_to_mujoco
from scenes import MODEL_FILES, MODELS, box_mesh, free_cube, write_scene

import env2mjcf
from env2mjcf.kinematics.forward import RobotKinematics


@pytest.mark.slow_but("seed", "auto")
@pytest.mark.parametrize("path", MODEL_FILES, ids=lambda p: p.stem)
@pytest.mark.parametrize("collision", ["hull", "surface", "auto"])
def test_every_model_is_mjcf_that_mujoco_knows(path: Path, collision: str) -> None:
    scene = env2mjcf.load(
        path, collision=collision, ground=True, actuators="position", boundary="visual", primitives=True
    )
    assert_known_to_mujoco(scene.xml)
    for name, data in scene.assets.items():
        if name.endswith(".xml"):
            root = etree.fromstring(data)
            assert {e.tag for e in root} == {"mesh"}


@pytest.mark.parametrize("path", MODEL_FILES, ids=lambda p: p.stem)
def test_mujoco_puts_links_where_the_chain_does(path: Path) -> None:
    scene = env2mjcf.load(path, collision="hull")
    q = scene.space.sample(30, seed=0)
    poses = scene.link_poses(q)
    offset = 0
    for multibody, columns in zip(scene.environment.robots, scene.space.robot_slices, strict=True):
        robot = RobotKinematics.of(multibody)
        expected = robot.forward(q[:, columns])
        found = poses[:, offset : offset + len(multibody.bodies)]
        np.testing.assert_allclose(found, expected, atol=1e-12)
        offset += len(multibody.bodies)


@pytest.mark.parametrize("path", MODEL_FILES, ids=lambda p: p.stem)
@pytest.mark.parametrize("primitives", [False, True])
def test_obstacles_stand_before_robots(path: Path, primitives: bool) -> None:
    """MuJoCo takes the normal of the second geom's face where two are nearly parallel: that of what moves."""
    model = env2mjcf.load(path, primitives=primitives, boundary="solid").model
    moves = model.body_weldid[model.geom_bodyid] > 0
    robots = np.flatnonzero(moves & (model.geom_contype > 0))
    fixed = np.flatnonzero(~moves & (model.geom_contype == 2))  # the mask of obstacles
    assert len(robots) > 0
    assert fixed.max(initial=-1) < robots.min()


@pytest.mark.parametrize("path", MODEL_FILES, ids=lambda p: p.stem)
def test_every_moving_body_has_an_explicit_inertia(path: Path) -> None:
    scene = env2mjcf.load(path)
    root = etree.fromstring(scene.xml.encode())
    for name in scene.link_names:
        body = root.xpath("//body[@name=$n]", n=name)[0]
        assert body.find("inertial") is not None
        body_id = scene.model.body(name).id
        if scene.model.body_weldid[body_id]:
            assert scene.model.body_mass[body_id] > 0
            assert (scene.model.body_inertia[body_id] > 0).all()


def test_a_cube_weighs_what_its_density_says(tmp_path: Path) -> None:
    path = write_scene(tmp_path, free_cube("5 0 0 0 0 0"))
    model = env2mjcf.load(path, density=7850, scale=0.1).model
    assert model.body("cube").mass[0] == pytest.approx(7.85)
    np.testing.assert_allclose(model.body("cube").inertia, 7.85 * 0.1**2 / 6)


def test_a_mass_of_the_file_overrides_the_density(tmp_path: Path) -> None:
    robot = "1\ncube.g 3.5 Volumetric Rotational\nConnections\n0\n"
    model = env2mjcf.load(write_scene(tmp_path, free_cube(robot=robot)), density=50).model
    assert model.body("cube").mass[0] == pytest.approx(3.5)


def test_keyframes_are_home_start_and_goal() -> None:
    scene = env2mjcf.load(MODELS / "seed/seed.env", query=MODELS / "seed/seed.query")
    names = [scene.model.key(i).name for i in range(scene.model.nkey)]
    assert names == ["home", "start", "goal"]
    query = scene.queries[0]
    for key, q in (("home", scene.space.home), ("start", query.q[0]), ("goal", query.q[-1])):
        np.testing.assert_allclose(scene.model.key(key).qpos, scene.space.qpos(q))
    # The page's own theta of 30 degrees.
    np.testing.assert_allclose(scene.space.home[6:], math.radians(30))


def test_bases_and_connections_become_joints_of_their_kind() -> None:
    kinds = {
        "seed": ["free", "hinge", "hinge", "hinge"],
        "gantry": ["slide", "slide", "slide", "hinge"],
        "spherical-arm": ["hinge"] * 6,
        "closed-chain": ["hinge"] * 3,
        "bug-trap": ["free"],
        "two-robots": ["slide", "slide", "hinge", "hinge", "hinge", "hinge"],
    }
    names = {0: "free", 2: "slide", 3: "hinge"}
    for name, expected in kinds.items():
        model = env2mjcf.load(MODELS / name / f"{name}.env", collision="hull").model
        assert [names[int(t)] for t in model.jnt_type] == expected, name


def test_a_spherical_joint_owns_theta_then_alpha_and_turns_alpha_first() -> None:
    scene = env2mjcf.load(MODELS / "spherical-arm/spherical-arm.env", collision="hull")
    assert [n.rpartition(".")[2] for n in scene.space.names] == ["theta", "alpha"] * 3
    joints = [scene.model.joint(i).name.rpartition(".")[2] for i in range(scene.model.njnt)]
    assert joints == ["alpha", "theta"] * 3
    q = np.arange(1.0, 7.0) / 10
    np.testing.assert_allclose(scene.space.qpos(q), [0.2, 0.1, 0.4, 0.3, 0.6, 0.5])


def test_a_closed_chain_keeps_its_loop_under_actuators() -> None:
    scene = env2mjcf.load(MODELS / "closed-chain/closed-chain.env", actuators="position")
    assert scene.model.neq == 2
    assert scene.model.eq_active0.all()
    assert scene.loop_error(scene.space.home) < 1e-12
    data = mujoco.MjData(scene.model)
    mujoco.mj_resetDataKeyframe(scene.model, data, 0)
    home = scene.space.home[0]
    assert scene.model.actuator(0).name == scene.space.names[0]
    worst = 0.0
    while data.time < 10:
        data.ctrl[0] = home + 0.5 * math.sin(2 * data.time)
        mujoco.mj_step(scene.model, data)
        ends = [[data.site(f"rocker:loop3:{i}{side}").xpos for i in "01"] for side in "ab"]
        worst = max(worst, float(np.linalg.norm(np.subtract(*ends), axis=1).max()))
    assert worst < 1e-4 * scene.extent
    assert abs(scene.space.from_qpos(data.qpos)[0] - data.ctrl[0]) < 0.1
    assert not data.warning.number.any()


def test_an_open_loop_is_written_but_inactive(tmp_path: Path) -> None:
    text = (MODELS / "closed-chain/closed-chain.env").read_text().replace("1.5707963267948966   0.2", "0.3   0.2", 1)
    (tmp_path / "meshes").symlink_to(MODELS / "closed-chain/meshes")
    path = tmp_path / "open.env"
    path.write_text(text)
    scene = env2mjcf.load(path, allow_outside=True)
    assert scene.model.neq == 2
    assert not scene.model.eq_active0.any()
    found = [d for d in scene.diagnostics if d.code == "KIN311"]
    assert len(found) == 1
    assert found[0].span is not None
    assert found[0].span.line == text.splitlines().index("2 3 Revolute -1:1") + 1


def test_position_actuators_hold_an_arm_up() -> None:
    scene = env2mjcf.load(MODELS / "spherical-arm/spherical-arm.env", actuators="position")
    data = mujoco.MjData(scene.model)
    q = scene.space.home.copy()
    q[0] += 0.2
    mujoco.mj_resetDataKeyframe(scene.model, data, 0)
    data.ctrl[:] = [scene.space.qpos(q)[scene.model.joint(scene.model.actuator(i).name).qposadr[0]]
                    for i in range(scene.model.nu)]  # fmt: skip
    while data.time < 4:
        mujoco.mj_step(scene.model, data)
    np.testing.assert_allclose(scene.space.from_qpos(data.qpos), q, atol=0.05)


def test_the_boundary_is_drawn_or_built_on_request_only(tmp_path: Path) -> None:
    path = write_scene(tmp_path, free_cube("5 0 0 0 0 0"))

    def geoms(**options: object) -> list[str]:
        model = env2mjcf.load(path, **options).model
        return [model.geom(i).name for i in range(model.ngeom) if model.geom(i).name.startswith("boundary")]

    assert geoms() == []
    assert len(geoms(boundary="visual")) == 12
    assert len(geoms(boundary="solid")) == 6


def test_exact_boxes_become_box_geoms_on_request(tmp_path: Path) -> None:
    path = write_scene(tmp_path, free_cube("5 0 0 0 0 45", robot="1\nslab.g Planar Rotational\nConnections\n0\n"),
                       slab=box_mesh(1, 0.2, 0.1))  # fmt: skip
    boxes = env2mjcf.load(path, primitives=True)
    collision = [boxes.model.geom(n) for n in ("slab:0", "cube:0")]
    assert {int(g.type[0]) for g in collision} == {int(mujoco.mjtGeom.mjGEOM_BOX)}
    np.testing.assert_allclose(sorted(collision[0].size), [0.1, 0.2, 1])
    meshes = env2mjcf.load(path)
    q = boxes.space.sample(400, seed=0)
    q[:, :2] = q[:, :2] * 0.2 + [4, 0]
    assert 0 < meshes.in_collision(q).mean() < 1
    np.testing.assert_array_equal(boxes.in_collision(q), meshes.in_collision(q))


@pytest.mark.parametrize("collision", ["auto", "hull", "solid", "coacd", "surface"])
def test_a_box_geom_stands_only_where_a_solid_collides(collision: str, tmp_path: Path) -> None:
    # A small cube wholly inside a large one touches no surface of it.
    path = write_scene(tmp_path, free_cube("room.g 0 0 0 0 0 0"), room=box_mesh(3, 3, 3))
    scene = env2mjcf.load(path, primitives=True, collision=collision, cache=False)
    kinds = {int(scene.model.geom(n).type[0]) for n in ("cube:0", "room:0")}
    surface = collision == "surface"
    assert (kinds == {int(mujoco.mjtGeom.mjGEOM_BOX)}) is not surface
    for engine in ("mujoco", *([] if missing("fast") else ["exact"])):
        assert scene.in_collision(np.zeros(scene.space.dim), engine=engine) is not surface
        assert scene.in_collision(np.array([2.8, 0, 0, 0, 0, 0]), engine=engine)
    told = [d for d in scene.diagnostics if d.code == "MJC416"]
    assert len(told) == surface
    if surface:
        assert "collision='surface'" in told[0].message


def test_primitives_that_find_no_box_are_reported(tmp_path: Path) -> None:
    tetrahedron = "1 4 4 12 1 4 0 0 0 1 0 0 0 1 0 0 0 1 1 3 -2 1 2 -4 2 3 -4 1 4 -3"
    robot = "1\nsolid.g Planar Rotational\nConnections\n0\n"
    path = write_scene(tmp_path, free_cube(robot=robot), solid=tetrahedron)
    assert [d.code for d in env2mjcf.load(path, primitives=True).diagnostics].count("MJC416") == 1
    assert "MJC416" not in [d.code for d in env2mjcf.load(path).diagnostics]


def test_a_link_may_be_called_world(tmp_path: Path) -> None:
    robot = "1\nworld.g Volumetric Rotational\nConnections\n0\n"
    scene = env2mjcf.load(write_scene(tmp_path, free_cube(robot=robot), world=box_mesh(1, 1, 1)))
    assert scene.link_names == ("world_2",)


def test_equal_meshes_are_written_once_and_namesakes_are_kept_apart(tmp_path: Path) -> None:
    for folder, size in (("a", 0.5), ("b", 0.5), ("c", 0.25)):
        write_scene(tmp_path / folder, "", cube=box_mesh(size, size, size))
    text = free_cube("a/cube.g 5 0 0 0 0 0", "b/cube.g -5 0 0 0 0 0", "c/cube.g 0 5 0 0 0 0")
    scene = env2mjcf.load(write_scene(tmp_path, text))
    assert scene.obstacle_names == ("cube_2", "cube_3", "cube_4")
    assert sorted(n.rpartition("-")[0] for n in scene.assets) == [
        "assets/cube", "assets/cube-cells", "assets/cube_2", "assets/cube_2-cells"
    ]  # fmt: skip


def test_colours_of_the_file_are_kept_unless_they_are_invisible(tmp_path: Path) -> None:
    text = free_cube("cube.g -c(0.25 0.5 0.75 1) 5 0 0 0 0 0", "cube.g -c(0 0 0 0) 7 0 0 0 0 0")
    model = env2mjcf.load(write_scene(tmp_path, text)).model
    np.testing.assert_allclose(model.geom("cube_2:visual").rgba, [0.25, 0.5, 0.75, 1])
    assert model.geom("cube_3:visual").rgba[3] == 1


def test_what_mujoco_refuses_is_told_by_the_line_of_the_env_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A real refusal: an inertia that no body can have."""
    from env2mjcf.mjcf import links as bodies

    path = write_scene(tmp_path, free_cube("5 0 0 0 0 0"))
    monkeypatch.setattr(
        bodies, "numbers", lambda v: "1 1 9" if np.shape(v) == (3,) else "1 0 0 0" if np.shape(v) == (4,) else "1"
    )
    with pytest.raises(env2mjcf.ConversionError) as caught:
        env2mjcf.load(path)
    assert caught.value.code == "MJC401"
    assert caught.value.span is not None
    assert caught.value.span.line == 8
    assert "inertia" in str(caught.value)


def test_an_sma_joint_reads_and_does_not_convert(tmp_path: Path) -> None:
    robot = "2\ncube.g Fixed 0 0 0 0 0 0\ncube.g Joint\nConnections\n1\n0 1 SMAJoint -1:1\n" \
            "0.5 0 0 0 0 0\n0 0 0 0 .25 1\n0.5 0 0 0 0 0\n"  # fmt: skip
    path = write_scene(tmp_path, free_cube(robot=robot, boundary="Boundary Box -1:1 -1:1 -1:1"))
    assert env2mjcf.read(path).robots[0].connections[0].sma is not None
    with pytest.raises(env2mjcf.ConversionError) as caught:
        env2mjcf.load(path)
    assert caught.value.code == "KIN320"
    assert caught.value.span is not None
    assert caught.value.span.line == 12


def test_what_is_mujocos_default_is_left_out(tmp_path: Path) -> None:
    scene = env2mjcf.load(write_scene(tmp_path, free_cube()))
    bodies = etree.fromstring(scene.compiled.document.xml.encode()).findall("worldbody/body")
    assert [dict(b.attrib) for b in bodies] == [{"name": "cube"}]


def test_a_joint_that_its_limits_hold_gets_the_least_play(tmp_path: Path) -> None:
    """MuJoCo refuses a range whose ends are equal."""
    robot = "2\ncube.g Fixed 0 0 0 0 0 0\ncube.g Joint\nConnections\n1\n0 1 Revolute 0.25:0.25\n" \
            "2 0 0 0 0 0  0 0 0 0.78539816339744828  0 0 0 0 0 0\n"  # fmt: skip
    model = env2mjcf.load(write_scene(tmp_path, free_cube(robot=robot))).model
    held = math.pi / 4
    assert model.jnt_limited.tolist() == [1]
    np.testing.assert_array_equal(model.jnt_range, [[held, math.nextafter(held, math.inf)]])


def test_the_goal_is_the_last_row_of_a_query(tmp_path: Path) -> None:
    path = write_scene(tmp_path, free_cube())
    (tmp_path / "via.query").write_text("1 0 0 0 0 0\n2 0 0 0 0 0\n3 0 0 0 0 0\n")
    scene = env2mjcf.load(path, query=tmp_path / "via.query")
    assert [scene.model.key(k).qpos[0] for k in ("start", "goal")] == [1, 3]
