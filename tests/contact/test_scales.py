"""Verdicts do not depend on the unit of length: MuJoCo's tolerances are absolute, ours are not."""

from __future__ import annotations

import pickle
from pathlib import Path

import mujoco
import numpy as np
import pytest
from real_scenes import FEW, real_scene, scene_names
from scenes import MODELS, box_mesh, write_scene

import env2mjcf

PLAY = 0.05
MOVED = np.array([0.05, 0.02, 0.03])
SCALES = (1e-7, 1e-5, 1e-3, 1e3, 1e6)


def plate() -> str:
    """Return a BYU plate, half sides 2, 2 and 0.25, with a square hole of half side 0.5."""
    rings = [[(-r, -r), (r, -r), (r, r), (-r, r)] for r in (2.0, 0.5)]
    points = [(x, y, z) for z in (-0.25, 0.25) for ring in rings for x, y in ring]
    faces: list[tuple[int, int, int]] = []
    for i in range(4):
        j = (i + 1) % 4
        faces += [(i, 4 + j, j), (i, 4 + i, 4 + j), (8 + i, 8 + j, 12 + j), (8 + i, 12 + j, 12 + i)]
        faces += [(i, j, 8 + j), (i, 8 + j, 8 + i), (4 + i, 12 + j, 4 + j), (4 + i, 12 + i, 12 + j)]
    vertices = "\n".join(" ".join(map(repr, p)) for p in points)
    rows = "\n".join(f"{a + 1} {b + 1} {-(c + 1)}" for a, b, c in faces)
    return f"1 16 {len(faces)} {3 * len(faces)}\n1 {len(faces)}\n{vertices}\n{rows}\n"


@pytest.fixture(scope="module")
def peg(tmp_path_factory: pytest.TempPathFactory) -> Path:
    text = (
        "Boundary Box [-10:10 ; -10:10 ; -10:10]\nMultibodies\n2\nActive\n1\npeg.g Volumetric Rotational\n"
        "Connections\n0\nPassive\nplate.g 0 0 0 0 0 0\n"
    )
    half = 0.5 - PLAY
    return write_scene(tmp_path_factory.mktemp("peg"), text, plate=plate(), peg=box_mesh(half, half, 0.4))


def shifts() -> tuple[np.ndarray, np.ndarray]:
    """Return places of an unturned peg within the hole, and whether it touches: |x| or |y| is beyond the play."""
    rng = np.random.default_rng(0)
    q = np.zeros((200, 6))
    q[:, :2] = rng.uniform(-2, 2, (200, 2)) * PLAY
    q[:, 2] = rng.uniform(-0.5, 0.5, 200)
    beyond = np.abs(q[:, :2]).max(axis=1)
    certain = np.abs(beyond - PLAY) > 1e-4
    return q[certain], (beyond > PLAY)[certain]


@pytest.mark.parametrize("scale", SCALES)
def test_a_peg_with_play_is_free_at_every_scale(peg: Path, scale: float) -> None:
    scene = env2mjcf.load(peg, scale=scale, cache=False)
    assert not {"KIN312", "GEO241"} & {d.code for d in scene.diagnostics}
    assert scene.clearance(scene.space.home) == pytest.approx(PLAY * scale, rel=1e-9)
    q, touches = shifts()
    q[:, :3] *= scale
    for engine in ("mujoco", None):
        assert (scene.in_collision(q, engine=engine) == touches).all()
    for row in q[touches][:20]:
        for contact in scene.contacts(row, engine="mujoco"):
            assert np.abs(contact.position).max() < 3 * scale
            assert abs(contact.distance) < 3 * scale


@pytest.mark.parametrize("scale", SCALES)
def test_plain_mujoco_sees_the_play_at_every_scale(peg: Path, scale: float, tmp_path: Path) -> None:
    written = env2mjcf.convert(peg, tmp_path, scale=scale, cache=False)
    model = mujoco.MjModel.from_xml_path(str(written.xml))
    data = mujoco.MjData(model)
    q, touches = shifts()
    found = np.zeros(len(q), dtype=bool)
    for i, row in enumerate(q):
        data.qpos[:] = (*row[:3] * scale, 1, 0, 0, 0)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        found[i] = data.ncon > 0
    assert not (found & ~touches).any()
    # MuJoCo's native algorithm misses a few overlaps of aligned boxes, whatever their size.
    assert (touches & ~found).sum() <= 2


def test_the_tolerance_of_the_written_scene_follows_its_extent(peg: Path) -> None:
    small, usual = (env2mjcf.load(peg, scale=s, cache=False) for s in (1e-5, 1.0))
    assert small.model.opt.ccd_tolerance == pytest.approx(1e-6 * small.extent, rel=0.1)
    assert usual.model.opt.ccd_tolerance == 1e-6
    assert "ccd_tolerance" not in usual.xml


def test_powers_of_two_change_no_digit(peg: Path) -> None:
    rng = np.random.default_rng(1)
    q = rng.uniform(-1, 1, (20, 6)) * (0.15, 0.15, 0.6, 0.1, 0.1, 0.1)
    usual, small = (env2mjcf.load(peg, scale=s, cache=False, engine="mujoco") for s in (1.0, 2.0**-17))
    scaled = q * (*[2.0**-17] * 3, 1, 1, 1)
    assert (small.clearance(scaled) == usual.clearance(q) * 2.0**-17).all()
    assert (small.in_collision(scaled) == usual.in_collision(q)).all()
    moved = usual.link_poses(q)
    moved[..., :3, 3] *= 2.0**-17
    assert (small.link_poses(scaled) == moved).all()


def test_an_engine_in_another_process_has_the_same_size(peg: Path) -> None:
    scene = env2mjcf.load(peg, scale=1e-5, cache=False, engine="mujoco")
    q, touches = shifts()
    q[:, :3] *= 1e-5
    solver = pickle.loads(pickle.dumps(scene._solver))
    assert (solver.collisions(q) == touches).all()
    assert (pickle.loads(pickle.dumps(solver)).link_poses(q) == scene.link_poses(q)).all()


def test_fixed_bodies_of_tiny_scenes_touch_where_they_do(tmp_path: Path) -> None:
    """What cannot move is decided once, by MuJoCo."""
    for gap, expected in ((0.05, False), (-0.05, True)):
        text = (
            "Boundary Box [-10:10 ; -10:10 ; -10:10]\nMultibodies\n2\nActive\n1\ncube.g Fixed 0 0 0 0 0 0\n"
            f"Connections\n0\nPassive\ncube.g 0 0 {1 + gap} 0 0 0\n"
        )
        path = write_scene(tmp_path / str(gap), text)
        scene = env2mjcf.load(path, scale=1e-5, cache=False)
        assert scene.in_collision(np.zeros(0)) is expected
        for contact in scene.contacts(np.zeros(0)):
            assert contact.distance == pytest.approx(-0.05e-5, rel=1e-3)
            assert contact.position[2] == pytest.approx(0.475e-5, rel=1e-2)
            assert contact.normal == pytest.approx([0, 0, 1], abs=1e-6)


def test_frames_that_nearly_coincide_are_two_to_the_engine(tmp_path: Path) -> None:
    """MuJoCo takes frames less than 1e-6 m apart for one: here that is a tenth of a box."""
    text = (
        '<Environment><MultiBody type="passive"><Base filename="box.g" comAdjustment="none" type="fixed" '
        'transform="0 0 0 0 0 0"/></MultiBody></Environment>'
    )
    header, counts, *rows = box_mesh(0.6, 0.8, 1.0).splitlines()
    moved = [" ".join(repr(float(x) + float(by)) for x, by in zip(r.split(), MOVED, strict=True)) for r in rows[:8]]
    path = write_scene(tmp_path, text, "scene.xml", box="\n".join([header, counts, *moved, *rows[8:]]))
    (tmp_path / "c.robot").write_text("1\ncube.g Volumetric Rotational\nConnections\n0\n")
    scene = env2mjcf.load(path, robots=tmp_path / "c.robot", scale=1e-5, cache=False)
    q = np.zeros((2000, 6))
    q[:, :3] = np.random.default_rng(0).uniform(-2, 2, (2000, 3))
    gap = (np.abs(q[:, :3] - MOVED) - (1.1, 1.3, 1.5)).max(axis=1)
    q, gap = q[np.abs(gap) > 1e-4], gap[np.abs(gap) > 1e-4]
    q[:, :3] *= 1e-5
    assert (scene.in_collision(q, engine="mujoco") == (gap < 0)).all()


# What MuJoCo did not find in bounding volumes that stood about another frame than the body.
SLIPPED = [208, 3225, 4856, 5975, 6753]


def test_bounding_volumes_of_tiny_links_stand_where_the_links_do() -> None:
    folder = MODELS / "gantry"
    usual, small = (env2mjcf.load(folder / "gantry.env", scale=s) for s in (1.0, 1e-5))
    model = small.model
    assert not model.body_ipos[model.body_sameframe == mujoco.mjtSameFrame.mjSAMEFRAME_BODY].any()
    q = usual.space.sample(8000, 3)[SLIPPED]
    assert usual.in_collision(q).all()
    q[:, [not name.endswith((".rx", ".ry", ".rz", ".theta")) for name in usual.space.names]] *= 1e-5
    data = mujoco.MjData(model)
    for qpos in small.space.qpos(q):
        data.qpos[:] = qpos
        mujoco.mj_forward(model, data)
        assert data.ncon


def test_what_mujoco_cannot_hold_is_refused_with_the_figure(peg: Path) -> None:
    with pytest.raises(env2mjcf.GeometryError, match=r"GEO241: its area of 4.5e-16 m\^2 is below 2e-14"):
        env2mjcf.load(peg, scale=1e-8, cache=False)


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in scene_names() if n in (*FEW, "corpus")])
def test_real_scenes_have_the_same_verdicts_at_every_scale(corpus: Path, name: str) -> None:
    real = real_scene(name)
    usual = env2mjcf.load(real.env, **real.keywords)
    q = usual.space.sample(150, seed=3)
    clearance = usual.clearance(q)
    certain = np.abs(clearance) > 2e-5 * usual.extent
    for scale in (1e-5, 1e-3, 1e3, 1e6):
        scene = env2mjcf.load(real.env, scale=scale, **real.keywords)
        rows = scene.space.decode(usual.space.encode(q))
        for engine in ("mujoco", None):
            wrong = scene.in_collision(rows, engine=engine) != (clearance <= 0)
            assert not wrong[certain].any(), (scale, engine)
