"""Bodies thrown at thin walls in plain MuJoCo: what is no faster than the report says stays on its side."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from meshes import table, voxels
from scenes import write_scene
from slides import Slide, notched_box

import env2mjcf
from env2mjcf import Scene
from env2mjcf.contact.mujoco_engine import MujocoEngine
from env2mjcf.formats.meshes.byu import export_byu

SPECULATIVE = int(mujoco.mjtEnableBit.mjENBL_SPECULATIVE)
THICKNESS = 0.01

BODIES = {
    "cube": trimesh.creation.box((0.2, 0.2, 0.2)),
    "die": trimesh.creation.box((0.04, 0.04, 0.04)),
    "plate": trimesh.creation.box((0.2, 0.2, 0.02)),
    "ball": trimesh.creation.icosphere(subdivisions=2, radius=0.1),
    "notched": notched_box(),
    "table": table(0.2, 0.2, 0.2, 0.04),
}


def angle() -> trimesh.Trimesh:
    """A wall of 2 x 2 across x, with a foot, so that it is not convex and collides as cells."""
    filled = np.zeros((2, 1, 2), dtype=bool)
    filled[0], filled[1, 0, 0] = True, True
    return voxels([np.array([-0.5, 0.5, 50]) * THICKNESS, np.array([-1.0, 1.0]), np.array([-1, -0.95, 1])], filled)


WALLS = {"board": trimesh.creation.box((THICKNESS, 2, 2)), "angle": angle()}


def before_a_wall(folder: Path, body: str, wall: str) -> Scene:
    # Meshes of these helpers, and of the planner, lie about the mean of their vertices.
    low, high = WALLS[wall].bounds.tolist()
    x, z = -low[0] - THICKNESS / 2, -(low[2] + high[2]) / 2
    text = (
        "Boundary Box [-99:99 ; -99:99 ; -99:99]\n\nMultibodies\n2\n\n"
        f"Active\n1\nbody.g Volumetric Rotational\nConnections\n0\n\nPassive\nwall.g {x!r} 0 {z!r} 0 0 0\n"
    )
    meshes = {"body": export_byu(BODIES[body]), "wall": export_byu(WALLS[wall])}
    return env2mjcf.load(write_scene(folder, text, **meshes), gravity=(0, 0, 0))


def passed(scene: Scene, speed: float, throws: int = 60) -> int:
    """Throw a body at the wall, every second time flat and without spin; return how often it got through."""
    model, data, rng = scene.model, mujoco.MjData(scene.model), np.random.default_rng(0)
    step, count = model.opt.timestep, 0
    radius = max(p.radius for p in scene.compiled.assembly.links)
    for i in range(throws):
        mujoco.mj_resetData(model, data)
        spin = speed / 3 / radius * (i % 2)
        # Where it is when a step ends is left to chance.
        data.qpos[:3] = [-1.2 * radius - rng.uniform() * speed * step, *rng.uniform(-0.3, 0.3, 2)]
        data.qvel[0] = speed - spin * radius
        if i % 2:
            data.qpos[3:] = rng.normal(size=4)
            data.qpos[3:] /= np.linalg.norm(data.qpos[3:])
            axis = rng.normal(size=3)
            data.qvel[3:] = spin * axis / np.linalg.norm(axis)
        for _ in range(round((0.02 + 6 * radius / speed) / step)):
            mujoco.mj_step(model, data)
        count += data.qpos[0] > 0
    return count


@pytest.mark.parametrize("wall", WALLS)
@pytest.mark.parametrize("body", BODIES)
def test_a_wall_holds_what_is_no_faster_than_the_report_says(tmp_path: Path, body: str, wall: str) -> None:
    scene = before_a_wall(tmp_path, body, wall)
    speed = scene.report.wall_speed
    assert speed is not None
    for share in (0.3, 1.0):
        assert passed(scene, share * speed) == 0
    # A plate that turns is wider than its thickness.
    if body != "plate":
        assert passed(scene, 2.5 * speed) > 0


def test_the_speed_is_in_the_report_and_in_the_file(tmp_path: Path) -> None:
    scene = before_a_wall(tmp_path, "cube", "board")
    # Half the width in a step, less a fifth.
    assert scene.report.wall_speed == pytest.approx(0.8 * 0.1 / scene.model.opt.timestep)
    assert f"no faster than {scene.report.wall_speed:g} m/s" in scene.xml
    alone = env2mjcf.load(tmp_path / "scene.env", exclude_pairs=(("body", "wall"),))
    assert alone.report.wall_speed is None


def test_speculative_contacts_hold_what_is_faster(tmp_path: Path) -> None:
    scene = before_a_wall(tmp_path, "die", "board")
    speed = 2.5 * (scene.report.wall_speed or 0)
    assert passed(scene, speed) > 0
    scene.model.opt.enableflags |= SPECULATIVE
    assert passed(scene, speed) == 0


def test_speculative_contacts_stay_off_because_they_catch_what_slides(tmp_path: Path) -> None:
    slide = Slide("frictionless", "notched", 0.0, 0.8, 10.0)
    speeds = [slide.run("plate", seconds=0.1, flags=flag)[1][0] for flag in (0, SPECULATIVE)]
    assert speeds[0] == pytest.approx(10.0, rel=1e-3)
    assert speeds[1] < 9.0
    assert not before_a_wall(tmp_path, "die", "board").model.opt.enableflags & SPECULATIVE


def test_verdicts_do_not_depend_on_speculative_contacts(tmp_path: Path) -> None:
    scene = before_a_wall(tmp_path, "notched", "angle")
    q = scene.space.sample(300, seed=0)
    q[:, :3] = np.random.default_rng(0).uniform(-0.3, 0.3, (len(q), 3))
    expected = scene.in_collision(q, engine="mujoco")
    scene.model.opt.enableflags |= SPECULATIVE
    engine = MujocoEngine(scene.model, scene.compiled.document.owners, scene.extent)
    np.testing.assert_array_equal(engine.collide(scene.space.qpos(q), engine.data()), expected)
    assert 20 < expected.sum() < 280
