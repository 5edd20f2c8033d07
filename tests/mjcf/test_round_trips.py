"""What is left of our MJCF after MuJoCo has written it: `mj_saveLastXML`, `MjSpec`, its archives, `attach`, `.mjb`.

MuJoCo writes six significant digits. Every way that goes through text is therefore tried twice: as it is, where
everything may be moved by what the lost digits weigh, and with as many digits as a double needs, where nothing may
change at all. A binary loses nothing.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from real_scenes import FEW, real_scene, scene_names
from scenes import MODELS, SCENES, box_mesh, free_cube, write_scene

import env2mjcf

# Nothing is certain closer to contact than this part of a scene's extent, and the files say so.
BAND = 1e-5
# What the digits that MuJoCo leaves out change of a number, relative to the greatest of its kind; a chain adds up.
LOST = 2e-5
KEPT = 1e-9
# How far vertices may be moved in the world, in extents. MuJoCo keeps those of meshes in single precision.
LOST_WAY = BAND / 2
KEPT_WAY = 5e-7

PREFIX = "left/"
COUNTS = (
    *("nq", "nv", "nu", "nbody", "njnt", "ngeom", "nsite", "ncam", "nlight", "nmesh", "nmeshvert"),
    *("neq", "nexclude", "nkey"),
)
NAMED = {
    mujoco.mjtObj.mjOBJ_BODY: "nbody",
    mujoco.mjtObj.mjOBJ_JOINT: "njnt",
    mujoco.mjtObj.mjOBJ_GEOM: "ngeom",
    mujoco.mjtObj.mjOBJ_SITE: "nsite",
    mujoco.mjtObj.mjOBJ_MESH: "nmesh",
    mujoco.mjtObj.mjOBJ_EQUALITY: "neq",
    mujoco.mjtObj.mjOBJ_ACTUATOR: "nu",
    mujoco.mjtObj.mjOBJ_KEY: "nkey",
}
SAME = (
    *("body_parentid", "body_weldid", "jnt_type", "jnt_bodyid", "jnt_limited"),
    *("geom_type", "geom_bodyid", "geom_contype", "geom_conaffinity", "geom_group", "geom_condim"),
    *("exclude_signature", "eq_type", "eq_obj1id", "eq_obj2id", "eq_active0", "actuator_trnid"),
)
CLOSE = (
    *("body_mass", "body_inertia", "jnt_axis", "jnt_range", "qpos0", "key_qpos", "dof_armature", "dof_damping"),
    *("geom_solref", "geom_solimp", "geom_friction", "geom_rgba", "eq_data", "eq_solref", "eq_solimp"),
    *("actuator_gainprm", "actuator_biasprm", "actuator_ctrlrange", "actuator_forcerange"),
)
PLACES = ("body_ipos", "geom_pos", "geom_margin", "site_pos")

Way = Callable[[Path], mujoco.MjModel]


def through_save_last_xml(path: Path) -> mujoco.MjModel:
    saved = path.with_name("last.xml")
    mujoco.mj_saveLastXML(str(saved), mujoco.MjModel.from_xml_path(str(path)))
    return mujoco.MjModel.from_xml_path(str(saved))


def through_a_spec_and_a_file(path: Path) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_file(str(path))
    spec.compile()
    saved = path.with_name("spec.xml")
    saved.write_text(spec.to_xml())
    return mujoco.MjSpec.from_file(str(saved)).compile()


def through_a_spec_and_a_string(path: Path) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_file(str(path))
    spec.compile()
    assets = {p.name: p.read_bytes() for p in (path.parent / "assets").iterdir()}
    return mujoco.MjSpec.from_string(spec.to_xml(), assets=assets).compile()


def through_what_was_written(path: Path) -> mujoco.MjModel:
    """Write the spec as it is, not as it was compiled."""
    spec = mujoco.MjSpec.from_file(str(path))
    spec.compiler.savecompiled = False
    saved = path.with_name("authored.xml")
    saved.write_text(spec.to_xml())
    return mujoco.MjModel.from_xml_path(str(saved))


def through_an_archive(path: Path) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_file(str(path))
    spec.assets = {p.name: p.read_bytes() for p in (path.parent / "assets").glob("*.[so][tb][lj]")}
    archive = path.with_name("scene.zip")
    spec.to_zip(str(archive))
    return mujoco.MjSpec.from_zip(str(archive)).compile()


def through_a_copied_spec(path: Path) -> mujoco.MjModel:
    return mujoco.MjSpec.from_file(str(path)).copy().compile()


def through_a_binary(path: Path) -> mujoco.MjModel:
    saved = path.with_name("scene.mjb")
    mujoco.mj_saveModel(mujoco.MjModel.from_xml_path(str(path)), str(saved))
    return mujoco.MjModel.from_binary_path(str(saved))


def through_a_parent(path: Path) -> mujoco.MjModel:
    child, parent = mujoco.MjSpec.from_file(str(path)), mujoco.MjSpec()
    # An attached spec takes the options of its parent.
    for name in ("disableflags", "integrator", "timestep"):
        setattr(parent.option, name, getattr(child.option, name))
    for name in ("znear", "zfar"):
        setattr(parent.visual.map, name, getattr(child.visual.map, name))
    parent.attach(child, frame=parent.worldbody.add_frame(), prefix=PREFIX)
    return parent.compile()


TEXT = (
    through_save_last_xml,
    through_a_spec_and_a_file,
    through_a_spec_and_a_string,
    through_what_was_written,
    through_an_archive,
)
MEMORY = (through_a_copied_spec, through_a_binary, through_a_parent)


@contextmanager
def all_digits() -> Iterator[None]:
    """Have MuJoCo write seventeen digits, by a function that is there for its own tests."""
    library = ctypes.CDLL(next(str(p) for p in Path(mujoco.__file__).parent.glob("libmujoco.so*")))
    before = library._mjPRIVATE__get_xml_precision()
    library._mjPRIVATE__set_xml_precision(17)
    try:
        yield
    finally:
        library._mjPRIVATE__set_xml_precision(before)


@dataclass(frozen=True)
class Sight:
    """What MuJoCo makes of a model at some configurations.

    Attributes:
        poses: (n, nbody, 3, 4) of the bodies.
        geoms: (n, ngeom, 3) positions.
        depths: (n,) of the deepest contact; -inf where nothing touches.
    """

    poses: np.ndarray
    geoms: np.ndarray
    depths: np.ndarray


def look(model: mujoco.MjModel, qpos: np.ndarray) -> Sight:
    data = mujoco.MjData(model)
    poses, geoms, depths = [], [], []
    for row in qpos:
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        poses.append(np.concatenate([data.xmat.reshape(-1, 3, 3), data.xpos[:, :, None]], axis=2))
        geoms.append(data.geom_xpos.copy())
        depths.append(-data.contact.dist.min() if data.ncon else -np.inf)
    return Sight(np.array(poses), np.array(geoms), np.array(depths))


def corners(model: mujoco.MjModel, poses: np.ndarray) -> np.ndarray:
    """Return the vertices of all mesh geoms in the world, (n, vertices, 3); the frame of a mesh is MuJoCo's choice."""
    found = [np.zeros((len(poses), 0, 3))]
    for geom in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH):
        mesh, turn = model.geom_dataid[geom], np.zeros(9)
        first = model.mesh_vertadr[mesh]
        mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
        vertices = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
        local = vertices @ turn.reshape(3, 3).T + model.geom_pos[geom]
        pose = poses[:, model.geom_bodyid[geom]]
        found.append(local @ pose[..., :3].swapaxes(-1, -2) + pose[:, None, :, 3])
    return np.concatenate(found, axis=1)


def names(model: mujoco.MjModel) -> list[str]:
    found = (mujoco.mj_id2name(model, kind, i) for kind, n in NAMED.items() for i in range(getattr(model, n)))
    return [str(name).removeprefix(PREFIX) for name in found]


def difference(found: np.ndarray, expected: np.ndarray, least: float = 1e-300) -> float:
    """Return the greatest difference relative to the greatest number, or to `least`."""
    assert found.shape == expected.shape
    if not expected.size:
        return 0.0
    return float(np.abs(found - expected).max() / max(least, np.abs(expected).max()))


@dataclass(frozen=True)
class Original:
    """A written scene, as MuJoCo first loads it, and as it then looks at random configurations."""

    path: Path
    model: mujoco.MjModel
    qpos: np.ndarray
    sight: Sight

    def compare(self, model: mujoco.MjModel, tolerance: float, way: float) -> None:
        """Fail unless a model is this one.

        Args:
            tolerance: Of every number, relative to the greatest of its kind.
            way: How far a vertex may be from where it was, in extents of the scene.
        """
        extent = self.model.stat.extent
        assert [getattr(model, n) for n in COUNTS] == [getattr(self.model, n) for n in COUNTS]
        assert names(model) == names(self.model)
        for name in SAME:
            np.testing.assert_array_equal(getattr(model, name), getattr(self.model, name), err_msg=name)
        for name in CLOSE:
            assert difference(getattr(model, name), getattr(self.model, name)) <= tolerance, name
        for name in PLACES:
            assert difference(getattr(model, name), getattr(self.model, name), extent) <= tolerance, name
        fitted = self.model.geom_type == mujoco.mjtGeom.mjGEOM_MESH
        assert difference(model.geom_size[~fitted], self.model.geom_size[~fitted]) <= tolerance
        assert difference(model.opt.gravity, self.model.opt.gravity) <= tolerance
        assert model.opt.timestep == pytest.approx(self.model.opt.timestep, rel=tolerance)
        assert model.opt.disableflags == self.model.opt.disableflags
        sight = look(model, self.qpos)
        assert difference(sight.poses[..., :3], self.sight.poses[..., :3]) <= tolerance
        assert difference(sight.poses[..., 3], self.sight.poses[..., 3], extent) <= tolerance
        assert difference(sight.geoms, self.sight.geoms, extent) <= tolerance
        moved = corners(model, sight.poses[:5]) - corners(self.model, self.sight.poses[:5])
        assert np.linalg.norm(moved, axis=-1).max(initial=0.0) <= way * extent
        # A contact that only one of them has is a graze.
        one = np.isfinite(sight.depths) != np.isfinite(self.sight.depths)
        assert np.maximum(sight.depths, self.sight.depths)[one].max(initial=0.0) <= BAND * extent


def written(scene: env2mjcf.Scene, folder: Path, n: int) -> Original:
    (folder / "assets").mkdir(parents=True)
    path = folder / "scene.xml"
    path.write_text(scene.xml, encoding="utf-8")
    for name, data in scene.assets.items():
        (folder / name).write_bytes(data)
    model = mujoco.MjModel.from_xml_path(str(path))
    qpos = scene.space.qpos(scene.space.sample(n, seed=6))
    return Original(path, model, qpos, look(model, qpos))


def options(scene: str) -> dict[str, Any]:
    """Return the options that a scene of `models/` is loaded with."""
    found: dict[str, Any] = dict(SCENES[scene])
    if "robots" in found:
        found["robots"] = [MODELS / robot for robot in found["robots"]]
    if "query" in found:
        found["query"] = MODELS / found["query"]
    return found


@pytest.fixture(scope="module", params=SCENES)
def original(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Original:
    scene = env2mjcf.load(MODELS / request.param, **options(request.param))
    return written(scene, tmp_path_factory.mktemp("scene"), 200)


@pytest.mark.slow_but("seed", "closed-chain", "two-robots")
@pytest.mark.parametrize("way", TEXT)
def test_text_of_mujocos_own_is_the_same_scene_but_for_the_digits_it_leaves_out(original: Original, way: Way) -> None:
    original.compare(way(original.path), LOST, LOST_WAY)


@pytest.mark.slow_but("seed", "closed-chain", "two-robots")
@pytest.mark.parametrize("way", TEXT)
def test_text_with_all_digits_is_the_same_scene(original: Original, way: Way) -> None:
    with all_digits():
        original.compare(way(original.path), KEPT, KEPT_WAY)


@pytest.mark.parametrize("way", MEMORY)
def test_what_goes_through_no_text_is_the_same_scene(original: Original, way: Way) -> None:
    original.compare(way(original.path), KEPT, KEPT_WAY)


@pytest.mark.parametrize("name", ["seed/seed.env", "closed-chain/closed-chain.env", "two-robots/two-robots.env"])
def test_so_is_a_scene_with_everything_that_can_be_asked_for(name: str, tmp_path: Path) -> None:
    everything = {"ground": True, "actuators": "position", "boundary": "solid", "primitives": True}
    for collision in ("hull", "surface"):
        scene = env2mjcf.load(MODELS / name, **options(name), **everything, collision=collision)
        found = written(scene, tmp_path / collision, 50)
        found.compare(through_save_last_xml(found.path), LOST, LOST_WAY)
        with all_digits():
            found.compare(through_a_spec_and_a_string(found.path), KEPT, KEPT_WAY)
        found.compare(through_a_parent(found.path), KEPT, KEPT_WAY)


def test_names_of_any_spelling_survive(tmp_path: Path) -> None:
    stem = "a & b \"c\" <d> 'é' 四:0"
    path = write_scene(tmp_path / "in", free_cube("5 0 0 0 0 0", "odd.g -5 0 0 0 0 0"), odd=box_mesh(1.0, 1.0, 1.0))
    (path.parent / f"{stem.replace(' ', '_')}.g").write_text(box_mesh(1.0, 1.0, 1.0))
    path.write_text(path.read_text().replace("odd.g", f"{stem.replace(' ', '_')}.g"), encoding="utf-8")
    found = written(env2mjcf.load(path), tmp_path / "out", 50)
    assert any("四" in name for name in names(found.model))
    for way in (*TEXT, *MEMORY):
        found.compare(way(found.path), LOST, LOST_WAY)


@pytest.mark.filterwarnings("ignore:Attach conflict")
def test_two_of_one_scene_stand_side_by_side() -> None:
    scene = env2mjcf.load(MODELS / "bug-trap/bug-trap.env")
    apart = 3 * scene.extent
    parent = mujoco.MjSpec()
    parent.option.disableflags = scene.model.opt.disableflags
    parent.option.integrator = scene.model.opt.integrator
    for prefix, x in (("left/", 0.0), ("right/", apart)):
        parent.attach(scene.spec(), frame=parent.worldbody.add_frame(pos=[x, 0, 0]), prefix=prefix)
    model = parent.compile()
    qpos = scene.space.qpos(scene.space.sample(100, seed=1))
    away = qpos + np.array([apart, 0, 0, 0, 0, 0, 0])
    one, two = look(scene.model, qpos), look(model, np.hstack([qpos, away]))
    free = [model.joint(f"{prefix}{scene.model.joint(0).name}").qposadr[0] for prefix in ("left/", "right/")]
    assert free == [0, 7]
    np.testing.assert_array_equal(np.isfinite(one.depths), np.isfinite(two.depths))
    assert 0 < np.isfinite(one.depths).sum() < 100
    np.testing.assert_allclose(two.poses[:, 1], one.poses[:, 1], atol=1e-12)


@pytest.mark.slow_but(*FEW)
@pytest.mark.parametrize("name", scene_names())
def test_a_real_scene_survives_mujocos_writer(corpus: Path, tmp_path: Path, name: str) -> None:
    real = real_scene(name)
    found = written(env2mjcf.load(real.env, **real.keywords), tmp_path / "scene", 60)
    found.compare(through_save_last_xml(found.path), LOST, LOST_WAY)
    with all_digits():
        found.compare(through_a_spec_and_a_string(found.path), KEPT, KEPT_WAY)
    found.compare(through_a_parent(found.path), KEPT, KEPT_WAY)
