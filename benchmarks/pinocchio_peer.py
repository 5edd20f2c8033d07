"""What a Python user would do with pinocchio: a model of the same joints and meshes; kinematics is in its time."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import mujoco
import numpy as np
import pinocchio as pin
from peers import bvh

import env2mjcf

_BROADPHASE = "DynamicAABBTreeCollisionManager"


class Pinocchio:
    """pinocchio with coal, on trees of triangles (BVHModelOBBRSS).

    Args:
        scene: The scene.
        rows: (n, dim) configurations.
    """

    def __init__(self, scene: env2mjcf.Scene, rows: np.ndarray) -> None:
        self.model, frames, columns = _joints(scene.model)
        self.geometry = _geometry(scene, frames)
        self.qpos = np.ascontiguousarray(scene.space.qpos(rows)[:, columns])
        # Its requests are without contacts unless one asks for them.
        self.data, self.placed = self.model.createData(), self.geometry.createData()
        self._check(scene, rows[0])

    def ways(self) -> dict[str, Callable[[slice], np.ndarray]]:
        """Return the ways to ask, by name: row by row from Python, or a whole batch in C++ on one thread."""
        model, data, geometry, placed = self.model, self.data, self.geometry, self.placed
        flat, tree = (
            getattr(pin, f"{kind}_{_BROADPHASE}")(model, geometry, placed)
            for kind in ("BroadPhaseManager", "TreeBroadPhaseManager")
        )
        pools = {"pin batch": pin.GeometryPool(model, geometry, 1)}
        for name, kind in (("broadphase", "BroadPhaseManagerPool"), ("tree", "TreeBroadPhaseManagerPool")):
            pools[f"pin batch {name}"] = getattr(pin, f"{kind}_{_BROADPHASE}")(model, geometry, 1)
        ways = {
            "pin pairs": self._row_by_row(lambda q: pin.computeCollisions(model, data, geometry, placed, q, True)),
            "pin broadphase": self._row_by_row(lambda q: pin.computeCollisions(model, data, flat, q, True)),
            "pin tree": self._row_by_row(lambda q: pin.computeCollisions(model, data, tree, q, True)),
        }
        return ways | {name: self._batch(pool) for name, pool in pools.items()}

    def _row_by_row(self, ask: Callable[[np.ndarray], bool]) -> Callable[[slice], np.ndarray]:
        return lambda part: np.array([ask(q) for q in self.qpos[part]], dtype=bool)

    def _batch(self, pool: object) -> Callable[[slice], np.ndarray]:
        # A column is a configuration, so that rows of C order need no copy.
        return lambda part: pin.computeCollisionsInParallel(1, pool, self.qpos[part].T, True, False)

    def _check(self, scene: env2mjcf.Scene, row: np.ndarray) -> None:
        pin.forwardKinematics(self.model, self.data, self.qpos[0])
        pin.updateGeometryPlacements(self.model, self.data, self.geometry, self.placed)
        for name, pose in zip(scene.link_names, scene.link_poses(row), strict=True):
            found = self.placed.oMg[self.geometry.getGeometryId(name)].homogeneous
            assert np.allclose(found, pose, atol=1e-9 * scene.extent), f"{name} is elsewhere in pinocchio"


def _joints(model: mujoco.MjModel) -> tuple[pin.Model, dict[int, tuple[int, pin.SE3]], list[int]]:
    """Return the joints of a MuJoCo model, where each body is (joint, placement), and qpos in pinocchio's order."""
    out = pin.Model()
    frames: dict[int, tuple[int, pin.SE3]] = {0: (0, pin.SE3.Identity())}
    columns: list[int] = []
    for body in range(1, model.nbody):
        joint, parent = frames[model.body_parentid[body]]
        placement = parent * _se3(model.body_pos[body], model.body_quat[body])
        for number in _joints_of(model, body):
            address = int(model.jnt_qposadr[number])
            name = f"joint{number}"
            if model.jnt_type[number] == mujoco.mjtJoint.mjJNT_FREE:
                joint = out.addJoint(joint, pin.JointModelFreeFlyer(), placement, name)
                placement = pin.SE3.Identity()
                # MuJoCo's quaternions begin with the real part, pinocchio's end with it.
                columns += [address + k for k in (0, 1, 2, 4, 5, 6, 3)]
                continue
            slides = model.jnt_type[number] == mujoco.mjtJoint.mjJNT_SLIDE
            kind = pin.JointModelPrismaticUnaligned if slides else pin.JointModelRevoluteUnaligned
            anchor = pin.SE3(np.eye(3), model.jnt_pos[number])
            joint = out.addJoint(joint, kind(model.jnt_axis[number]), placement * anchor, name)
            placement = anchor.inverse()
            columns.append(address)
        frames[body] = (joint, placement)
    return out, frames, columns


def _joints_of(model: mujoco.MjModel, body: int) -> Iterator[int]:
    first = int(model.body_jntadr[body])
    yield from range(first, first + int(model.body_jntnum[body]))


def _geometry(scene: env2mjcf.Scene, frames: dict[int, tuple[int, pin.SE3]]) -> pin.GeometryModel:
    geometry = pin.GeometryModel()
    parts = {p.name: p for p in scene.compiled.assembly.parts()}
    links = set(scene.link_names)
    numbers = {}
    for name in (*scene.link_names, *scene.obstacle_names):
        pose = parts[name].pose
        joint, placement = (
            frames[scene.model.body(name).id]
            if name in links
            else (0, pin.SE3(pose[:3, :3].copy(), pose[:3, 3].copy()))
        )
        thing = pin.GeometryObject(name, joint, placement, bvh(parts[name].mesh))
        numbers[name] = geometry.addGeometryObject(thing)
    # All at once: one by one, each is looked for among those that are there already.
    tested = np.zeros((len(numbers), len(numbers)), dtype=bool)
    for a, b in scene.pairs:
        tested[min(numbers[a], numbers[b]), max(numbers[a], numbers[b])] = True
    geometry.setCollisionPairs(tested)
    assert len(geometry.collisionPairs) == len(scene.pairs), "pinocchio tests other pairs"
    return geometry


def _se3(position: np.ndarray, quaternion: np.ndarray) -> pin.SE3:
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return pin.SE3(matrix.reshape(3, 3), np.array(position))
