"""Actuators hold, follow and are bounded; undamped joints keep their energy; the ground lies below every key."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from chains import write_chain, write_loop
from real_scenes import real_scene, scene_names
from scenes import MODELS, free_cube, write_scene

import env2mjcf
from env2mjcf import Scene
from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.errors import FormatError
from env2mjcf.mjcf.actuators import drives, mass_matrix
from env2mjcf.options import Actuators

JOINTED = ("gantry/gantry.env", "seed/seed.env", "spherical-arm/spherical-arm.env", "xml-arm/xml-arm.xml",
           "closed-chain/closed-chain.env")  # fmt: skip


def without_contacts(scene: Scene) -> mujoco.MjData:
    scene.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data = mujoco.MjData(scene.model)
    mujoco.mj_resetDataKeyframe(scene.model, data, 0)
    return data


def driven(model: mujoco.MjModel) -> np.ndarray:
    """Return where in qpos the driven joints stand."""
    return model.jnt_qposadr[model.actuator_trnid[:, 0]]


def follow(scene: Scene, by: float, seconds: float) -> tuple[float, float, float]:
    """Move the targets of all hinges; return the last second's swing, the error at the end, and the overshoot.

    Contacts are off: links that start side by side touch when their hinges turn, and some homes collide.
    """
    model, data = scene.model, without_contacts(scene)
    at = driven(model)
    data.ctrl += by * (model.jnt_type[model.actuator_trnid[:, 0]] == mujoco.mjtJoint.mjJNT_HINGE)
    target, last, over = data.ctrl.copy(), [], 0.0
    while data.time < seconds:
        mujoco.mj_step(model, data)
        over = max(over, float((data.qpos[at] - target).max()))
        if data.time > seconds - 1:
            last.append(data.qpos[at].copy())
    assert not data.warning.number.any()
    return float(np.ptp(last, axis=0).max()), float(np.abs(data.qpos[at] - target).max()), over


@pytest.mark.parametrize("by", [0.0, 0.3])
@pytest.mark.parametrize("size", [0.05, 0.5, 3.0])
@pytest.mark.parametrize("hinges", [2, 8, 16, 32])
@pytest.mark.slow_but("2-0.5-0.3", "16-0.05-0.3")
def test_chains_hold_and_follow(hinges: int, size: float, by: float, tmp_path: Path) -> None:
    scene = env2mjcf.load(write_chain(tmp_path, hinges, size, size / 5), actuators="position")
    # A chain of a hundred metres is as slow as a pendulum of that length.
    seconds = 3 + 1.5 * math.sqrt(hinges * size)
    swing, error, over = follow(scene, by, seconds)
    assert swing < 0.01
    assert error < 0.05
    assert over < 0.05


@pytest.mark.parametrize("path", JOINTED)
def test_robots_of_ours_hold_and_follow(path: str) -> None:
    scene = env2mjcf.load(MODELS / path, actuators="position")
    for by in (0.0, 0.3):
        swing, error, over = follow(scene, by, 3.0)
        assert swing < 0.01
        assert error < 0.05
        assert over < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("name", scene_names())
def test_real_robots_hold_and_follow_and_keep_their_energy(corpus: Path, name: str) -> None:
    real = real_scene(name)
    scene = env2mjcf.load(real.env, actuators="position", **real.keywords)
    if not scene.model.nu:
        pytest.skip("no joints")
    for by in (0.0, 0.3):
        swing, error, over = follow(scene, by, 5.0)
        assert swing < 0.01
        assert error < 0.05
        assert over < 0.05
    assert energy_gain(env2mjcf.load(real.env, **real.keywords), 60.0) < 0.01


@pytest.mark.parametrize("path", JOINTED)
def test_the_mass_matrix_is_mujocos(path: str) -> None:
    scene = env2mjcf.load(MODELS / path)
    model, data = scene.model, mujoco.MjData(scene.model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for q in (scene.space.home, *scene.space.sample(3, seed=1)):
        data.qpos[:] = scene.space.qpos(q)
        mujoco.mj_forward(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        (robot,) = scene.compiled.assembly.robots
        ours = mass_matrix(robot, q)
        joints = [(c, int(model.joint(n).dofadr[0])) for c, n in enumerate(scene.space.names) if n in names(model)]
        columns, addresses = (list(x) for x in zip(*joints, strict=True))
        np.testing.assert_allclose(
            ours[np.ix_(columns, columns)],
            full[np.ix_(addresses, addresses)],
            rtol=1e-9,
            atol=1e-9 * np.abs(full).max(),
        )


def names(model: mujoco.MjModel) -> list[str]:
    return [model.joint(i).name for i in range(model.njnt)]


def test_of_a_closed_loop_as_many_joints_are_driven_as_can_move() -> None:
    scene = env2mjcf.load(MODELS / "closed-chain/closed-chain.env", actuators="position")
    data = mujoco.MjData(scene.model)
    mujoco.mj_resetDataKeyframe(scene.model, data, 0)
    mujoco.mj_forward(scene.model, data)
    rows = data.efc_J.reshape(-1, scene.model.nv) if not mujoco.mj_isSparse(scene.model) else None
    assert rows is not None
    assert scene.model.nu == scene.model.nv - np.linalg.matrix_rank(rows, tol=1e-6) == 1
    (told,) = [d for d in scene.diagnostics if d.code == "MJC417"]
    assert scene.model.actuator(0).name in told.message


def test_forces_are_bounded_by_weight_and_reach() -> None:
    scene = env2mjcf.load(MODELS / "gantry/gantry.env", actuators="position")
    model, data = scene.model, without_contacts(scene)
    weight = 9.80665 * model.body_mass.sum()
    data.ctrl[0] += 100.0
    for _ in range(200):
        mujoco.mj_step(model, data)
    assert np.abs(data.actuator_force).max() <= 5.01 * weight * max(1.0, scene.extent)
    assert np.abs(data.qvel).max() < 5.0


def test_velocity_actuators_reach_the_speed_asked_for() -> None:
    scene = env2mjcf.load(MODELS / "spherical-arm/spherical-arm.env", actuators="velocity", gravity=(0, 0, 0))
    model, data = scene.model, without_contacts(scene)
    data.ctrl[0] = 0.2
    while data.time < 0.5:
        mujoco.mj_step(model, data)
    assert data.qvel[model.joint(model.actuator(0).name).dofadr[0]] == pytest.approx(0.2, abs=0.01)
    assert np.abs(model.actuator_ctrlrange[:, 1] * model.actuator_gainprm[:, 0]) == pytest.approx(
        model.actuator_forcerange[:, 1]
    )


def test_motors_are_forces_and_add_no_damping() -> None:
    scene = env2mjcf.load(MODELS / "spherical-arm/spherical-arm.env", actuators="motor")
    model, data = scene.model, without_contacts(scene)
    assert not model.dof_damping.any()
    data.ctrl[:] = 0.5 * model.actuator_ctrlrange[:, 1]
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.actuator_force, data.ctrl)
    assert (model.actuator_forcerange[:, 1] > 0).all()


@pytest.mark.parametrize("kind", ["position", "velocity", "motor"])
def test_keys_hold_still(kind: Actuators) -> None:
    scene = env2mjcf.load(
        MODELS / "two-robots/two-robots.env", query=MODELS / "two-robots/two-robots.query", actuators=kind
    )
    model, data = scene.model, mujoco.MjData(scene.model)
    for key in range(model.nkey):
        mujoco.mj_resetDataKeyframe(model, data, key)
        wanted = data.qpos[driven(model)] if kind == "position" else np.zeros(model.nu)
        np.testing.assert_array_equal(data.ctrl, wanted)


def test_sensors_and_tools_are_written_on_request() -> None:
    path = MODELS / "spherical-arm/spherical-arm.env"
    assert env2mjcf.load(path).model.nsensor == 0
    scene = env2mjcf.load(path, sensors=True)
    scene.set(scene.space.sample(1, seed=0)[0])
    model, data = scene.model, scene.data
    joints = [n for n in scene.space.names if n in names(model)]
    for name in joints:
        assert data.sensor(f"{name}:position").data[0] == data.joint(name).qpos[0]
    assert model.nsensor == 2 * len(joints)
    # The frame of the DH row: the last link's, taken back by the last transform of its connection.
    robot = scene.environment.robots[0]
    to_body = env2mjcf.transforms.pose_matrix(robot.connections[-1].to_body)
    frame = scene.link_poses(scene.q())[-1] @ np.linalg.inv(to_body)
    np.testing.assert_allclose(data.site("tool").xpos, frame[:3, 3], atol=1e-12)
    np.testing.assert_allclose(data.site("tool").xmat.reshape(3, 3), frame[:3, :3], atol=1e-12)
    several = env2mjcf.load(MODELS / "two-robots/two-robots.env", sensors=True).model
    assert [several.site(i).name for i in range(several.nsite)] == ["robot0/tool", "robot1/tool"]


def energy_gain(scene: Scene, seconds: float, most_open: float = math.inf) -> float:
    """Return how much energy a scene gains from home without contacts and limits, in weights times extents.

    Its loops must not open by more than `most_open`.
    """
    model = scene.model
    model.jnt_limited[:] = 0
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    data = without_contacts(scene)
    mujoco.mj_forward(model, data)
    highest = first = float(data.energy.sum())
    while data.time < seconds:
        mujoco.mj_step(model, data)
        highest = max(highest, float(data.energy.sum()))
        gaps = data.efc_pos[data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)]
        assert np.abs(gaps).max(initial=0.0) <= most_open
    assert not data.warning.number.any()
    return (highest - first) / (9.81 * float(model.body_mass.sum()) * scene.extent)


@pytest.mark.parametrize(("hinges", "seconds"), [(6, 10), (12, 60), (24, 60)])
@pytest.mark.slow_but("6-10")
def test_undamped_chains_keep_their_energy(hinges: int, seconds: float, tmp_path: Path) -> None:
    assert energy_gain(env2mjcf.load(write_chain(tmp_path, hinges)), seconds) < 0.01


@pytest.mark.parametrize("seed", range(13))
@pytest.mark.slow
def test_loops_stay_closed_and_keep_their_energy(seed: int, tmp_path: Path) -> None:
    scene = env2mjcf.load(write_loop(tmp_path, seed))
    assert scene.model.neq == 2
    assert energy_gain(scene, 60.0, most_open=1e-4 * scene.extent) < 0.01


def with_query(name: str, **options: Any) -> Scene:
    """Load a real scene with its query, where it has one that fits."""
    real = real_scene(name)
    try:
        return env2mjcf.load(real.env, query=real.query, **real.keywords, **options)
    except FormatError:
        return env2mjcf.load(real.env, **real.keywords, **options)


def free_keys(scene: Scene) -> list[tuple[int, bool]]:
    """Return the keys and whether nothing touches there."""
    places = scene.space.from_qpos(scene.model.key_qpos)
    return [(k, not hit) for k, hit in enumerate(scene.in_collision(places, engine="mujoco"))]


def highest_energy(model: mujoco.MjModel, data: mujoco.MjData, seconds: float) -> float:
    """Simulate; return the gain of energy, in weights, looked at every 20 steps."""
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    mujoco.mj_forward(model, data)
    values = [float(data.energy.sum())]
    for _ in range(round(seconds / model.opt.timestep / 20)):
        mujoco.mj_step(model, data, 20)
        # Of the state that the last of these steps began with.
        values.append(float(data.energy.sum()))
    return (max(values) - values[0]) / (9.81 * float(model.body_mass.sum()))


@pytest.mark.slow
@pytest.mark.parametrize("name", scene_names())
def test_nothing_falls_through_the_ground_from_any_key(corpus: Path, name: str) -> None:
    scene = with_query(name, ground=True)
    model, data = scene.model, mujoco.MjData(scene.model)
    if not model.nv:
        pytest.skip("nothing moves")
    for key, free in free_keys(scene):
        mujoco.mj_resetDataKeyframe(model, data, key)
        gain = highest_energy(model, data, 2.0)
        assert gain < 0.01 * scene.extent or not free
        for part in scene.compiled.assembly.links:
            place = data.body(part.name)
            low = float((part.used_vertices @ place.xmat.reshape(3, 3)[2]).min() + place.xpos[2])
            assert low > model.geom("ground").pos[2] - 1e-3 * scene.extent


@pytest.mark.slow
@pytest.mark.parametrize("name", scene_names())
def test_a_minute_of_every_scene_passes_without_warnings(corpus: Path, name: str) -> None:
    scene = with_query(name)
    model, data = scene.model, mujoco.MjData(scene.model)
    keys = [k for k, free in free_keys(scene) if free] if model.nv else []
    if not keys:
        pytest.skip("nothing moves, or touches at every key")
    # From the start, where it is free.
    mujoco.mj_resetDataKeyframe(model, data, 1 if 1 in keys else keys[0])
    assert highest_energy(model, data, 60.0) < 0.01 * scene.extent
    assert not data.warning.number.any()


def crossings(begin: np.ndarray, end: np.ndarray, triangles: np.ndarray) -> int:
    """Return how many triangles (n, 3, 3) a line between two points crosses (Moeller and Trumbore, 1997)."""
    a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    across = np.cross(end - begin, b)
    size = (a * across).sum(axis=1)
    facing = np.flatnonzero(np.abs(size) > 1e-12 * np.abs(across).max(initial=1.0))
    offset = (begin - triangles[:, 0])[facing]
    turned = np.cross(offset, a[facing])
    u = (offset * across[facing]).sum(axis=1) / size[facing]
    v = turned @ (end - begin) / size[facing]
    t = (b[facing] * turned).sum(axis=1) / size[facing]
    return int(((u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 1)).sum())


@pytest.mark.slow
@pytest.mark.parametrize("name", scene_names())
def test_goal_targets_push_nothing_through_walls(corpus: Path, name: str) -> None:
    scene = with_query(name, actuators="position")
    model, data = scene.model, mujoco.MjData(scene.model)
    if not model.nu or model.nkey < 3 or (model.jnt_type == int(mujoco.mjtJoint.mjJNT_FREE)).any():
        pytest.skip("no task, or a base that is not driven")
    if not all(free for _, free in free_keys(scene)[1:]):
        pytest.skip("start or goal is not free")
    mujoco.mj_resetDataKeyframe(model, data, 1)
    data.ctrl[:] = model.key_ctrl[2]
    assembly = scene.compiled.assembly
    size = min(p.mesh.diagonal for p in assembly.links)
    walls = [(o.mesh.vertices @ o.mesh_pose[:3, :3].T + o.mesh_pose[:3, 3])[o.mesh.faces] for o in assembly.obstacles]
    places: list[np.ndarray] = []
    deepest = 0.0
    for n in range(round(6 / model.opt.timestep)):
        mujoco.mj_step(model, data)
        deepest = min(deepest, float(data.contact.dist.min(initial=0.0)))
        if n % 50 == 0:
            places.append(data.qpos.copy())
    q = scene.space.from_qpos(np.array(places))
    assert -deepest < 0.05 * size
    assert scene.clearance(q[::4]).min() > -0.05 * size
    centers = scene.link_poses(q)[:, :, :3, 3] - assembly.origin
    for wall in walls:
        assert not sum(
            crossings(a, b, wall) for a, b in zip(centers[:-1].reshape(-1, 3), centers[1:].reshape(-1, 3), strict=True)
        )


def test_the_time_step_is_rounded_down(tmp_path: Path) -> None:
    # A seventieth of the time in which it falls by its thickness is 1.58 ms.
    thickness = 9.81 * (70 * 1.58e-3) ** 2 / 2
    scene = env2mjcf.load(write_chain(tmp_path, 1, 2.0, thickness))
    assert scene.model.opt.timestep == 1e-3


def test_targets_keep_the_limits_of_joints_that_have_any(tmp_path: Path) -> None:
    later = env2mjcf.load(write_chain(tmp_path, 2), actuators="position").model
    assert later.actuator_ctrllimited.tolist() == [1, 1]
    np.testing.assert_allclose(later.actuator_ctrlrange, [[-math.pi, math.pi]] * 2)
    turning = env2mjcf.load(MODELS / "seed/seed.env", actuators="position").model
    assert not turning.actuator_ctrllimited.any()


def test_no_drive_is_quicker_than_steps_can_follow(tmp_path: Path) -> None:
    """A critically damped mass swings with w = sqrt(k / m) and is damped by 2 k / w; w is at most 4 a step."""
    scene = env2mjcf.load(write_chain(tmp_path, 1))
    data, mass = mujoco.MjData(scene.model), np.zeros((1, 1))
    mujoco.mj_forward(scene.model, data)
    mujoco.mj_fullM(scene.model, data, mass)
    assembly, step = scene.compiled.assembly, 10.0
    (drive,) = drives(assembly.robots, scene.space, [scene.space.home], 0.0, step, DiagnosticLog()).values()
    assert drive.stiffness == pytest.approx(mass[0, 0] * (4 / step) ** 2, rel=1e-2)
    assert drive.damping == pytest.approx(drive.stiffness * step / 2, rel=1e-2)


def test_a_ground_beside_gravity_is_reported(tmp_path: Path) -> None:
    path = write_scene(tmp_path, free_cube("5 0 0 0 0 0"))
    for gravity, told in (((0, 0, -9.81), 0), ((9.81, 0, 0), 1), ((0, 0, 3.0), 1), ((0, 0, 0), 0)):
        scene = env2mjcf.load(path, ground=True, gravity=gravity)
        assert sum(d.code == "MJC418" for d in scene.diagnostics) == told
