"""Non-convex bodies that slide over flat faces made of many polygons: seams between cells must not be felt."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from meshes import table, voxels
from scenes import write_scene

import env2mjcf
from env2mjcf.formats.meshes.byu import export_byu


def plate(step: float) -> trimesh.Trimesh:
    """A plate of 2 x 1.2, 0.1 thick; its top is of uneven triangles, flat but for dents beside the middle.

    With a step, all beyond x = 0.3 is higher by it.
    """
    rng = np.random.default_rng(1)
    n, m = 25, 13
    u, v = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    inner = (u > 0) & (u < n - 1) & (v > 0) & (v < m - 1)
    jitter = np.where(inner, rng.uniform(-0.35, 0.35, (2, n, m)), 0.0)
    x, y = (u + jitter[0]) * 2 / (n - 1) - 0.5, (v + jitter[1]) * 1.2 / (m - 1) - 0.6
    z = np.where(inner & (np.abs(y) > 0.35), rng.uniform(-0.02, 0, (n, m)), 0.0)
    z += np.where(x > 0.3, step, 0.0)
    top = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    i = (np.arange(n - 1)[:, None] * m + np.arange(m - 1)).ravel()
    faces = np.concatenate([np.stack([i, i + m, i + m + 1], 1), np.stack([i, i + m + 1, i + 1], 1)])
    sides = {(a, b) for f in faces.tolist() for a, b in zip(f, f[1:] + f[:1], strict=True)}
    rim = np.array(sorted((a, b) for a, b in sides if (b, a) not in sides))
    a, b = rim.T
    k = len(top)
    wall = np.concatenate([np.stack([b, a, a + k], 1), np.stack([b, a + k, b + k], 1)])
    bottom = np.column_stack([top[:, :2], np.full(k, -0.1)])
    mesh = trimesh.Trimesh(np.vstack([top, bottom]), np.vstack([faces, faces[:, ::-1] + k, wall]), process=False)
    assert mesh.is_watertight
    return mesh


def notched_box() -> trimesh.Trimesh:
    """A box of 0.2 with a groove in its upper side: convex where it slides, and yet in cells."""
    filled = np.ones((3, 1, 2), dtype=bool)
    filled[1, 0, 1] = False
    return voxels([np.array([-0.1, -0.04, 0.04, 0.1]), np.array([-0.1, 0.1]), np.array([-0.1, 0.0, 0.1])], filled)


def tapered(mesh: trimesh.Trimesh, growth: float) -> trimesh.Trimesh:
    """Wider by `growth` at its top than at its bottom, which is as wide as before."""
    corners = mesh.vertices.copy()
    corners[:, :2] *= 1 + growth * (corners[:, 2:] - corners[:, 2].min()) / np.ptp(corners[:, 2])
    return trimesh.Trimesh(corners, mesh.faces, process=False)


SLIDERS = {
    "box": trimesh.creation.box((0.2, 0.2, 0.2)),
    "notched": notched_box(),
    "acute": tapered(notched_box(), -0.6),
    "obtuse": tapered(notched_box(), 0.6),
    "table": table(0.2, 0.2, 0.2, 0.04),
    "stool": tapered(table(0.2, 0.2, 0.2, 0.04), -0.4),
}


def sliding(
    folder: Path,
    slider: trimesh.Trimesh,
    turn: float,
    speed: float,
    step: float = 0.0,
    seconds: float = 1.0,
    flags: int = 0,
) -> np.ndarray:
    """Let a body slide along x without friction, with flags of MuJoCo; return its velocity and angular velocity."""
    flat = plate(step)
    # The planner puts the mean of a mesh's vertices at its pose.
    x, y, z = flat.vertices.mean(axis=0).tolist()
    scene = env2mjcf.load(
        write_scene(
            folder,
            "Boundary Box [-10:10 ; -10:10 ; -10:10]\n\nMultibodies\n2\n\n"
            "Active\n1\nslider.g Volumetric Rotational\nConnections\n0\n\n"
            f"Passive\nplate.g {x!r} {y!r} {z!r} 0 0 0\n",
            slider=export_byu(slider),
            plate=export_byu(flat),
        )
    )
    model, data = scene.model, scene.data
    model.geom_condim[:] = 1
    model.opt.enableflags |= flags
    low = float((slider.vertices - slider.vertices.mean(axis=0))[:, 2].min())
    scene.set(np.array([0, 0, -low, 0, 0, turn]))
    while data.time < 0.3:
        mujoco.mj_step(model, data)
    data.qvel[:] = [speed, 0, 0, 0, 0, 0]
    while data.time < 0.3 + seconds:
        mujoco.mj_step(model, data)
    assert not data.warning.number.any()
    return data.qvel.copy()


@pytest.mark.slow_but("0.8")
@pytest.mark.parametrize("turn", [-2.7, 0.8, 2.2])
@pytest.mark.parametrize("name", SLIDERS)
def test_a_body_keeps_its_speed_and_course_over_the_seams_of_a_flat_face(
    tmp_path: Path, name: str, turn: float
) -> None:
    velocity = sliding(tmp_path, SLIDERS[name], turn, speed := 0.6 + turn / 50)
    assert velocity[0] == pytest.approx(speed, rel=1e-3)
    assert np.abs(velocity[1:]).max() < 1e-3


def test_a_step_of_a_millimetre_is_felt(tmp_path: Path) -> None:
    """What the test above would see if seams were felt."""
    velocity = sliding(tmp_path, SLIDERS["notched"], 0.8, 0.6, step=1e-3)
    assert velocity[0] < 0.59
