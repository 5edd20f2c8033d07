"""Simulations of scenes with the settings that the converter writes, and measures of how physical they are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from truth import Truth

import env2mjcf


def simulated(scene: env2mjcf.Scene, seconds: float, every: float = 0.25) -> Iterator[float]:
    """Simulate, and yield the total energy now and then; it is the highest since the last time."""
    model, data = scene.model, scene.data
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    mujoco.mj_forward(model, data)
    highest, steps = float(data.energy.sum()), round(every / model.opt.timestep)
    for n in range(1, 1 + round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        # The energy of the state that the step began with: positions and velocities of one moment.
        highest = max(highest, float(data.energy.sum()))
        if n % steps == 0:
            yield highest
            highest = -np.inf
    assert not data.warning.number.any()


def start(scene: env2mjcf.Scene, q: np.ndarray) -> float:
    """Set a free configuration; return its energy."""
    assert not Truth(scene).collides(q)
    scene.set(q)
    mujoco.mj_energyPos(scene.model, scene.data)
    return float(scene.data.energy[0])


def weight(scene: env2mjcf.Scene) -> float:
    return float(scene.model.body_mass.sum() * np.linalg.norm(scene.model.opt.gravity))


@dataclass(frozen=True)
class Fall:
    """What was seen of a simulation.

    Attributes:
        gained: The highest total energy less that at the start, in weights times sizes of the moving bodies.
        deepest: The greatest depth at any sample, in sizes of the smallest moving body.
        at_rest: The same over the last two seconds.
        moved: How far any vertex was from where it ended, over the last two seconds, in sizes of its body.
        shifted: (k, n, 3) how far the moving bodies' origins are from where they began, k samples in order.
    """

    gained: float
    deepest: float
    at_rest: float
    moved: float
    shifted: np.ndarray

    def check(self) -> None:
        """What holds for everything that has come to rest."""
        assert self.gained < 0.01
        assert self.at_rest < 0.01
        assert self.moved < 0.01


def fall(scene: env2mjcf.Scene, velocity: np.ndarray | None = None, seconds: float = 10.0, every: float = 0.1) -> Fall:
    """Simulate from the state of `scene.data`, which is at rest but for a velocity."""
    model, data = scene.model, scene.data
    parts = {p.name: p for robot in scene.compiled.assembly.robots for p in robot.links}
    moving = [i for i, name in enumerate(scene.link_names) if model.body_weldid[model.body(name).id] != 0]
    meshes = [parts[scene.link_names[i]].mesh for i in moving]
    sizes = np.array([m.diagonal for m in meshes])
    masses = np.array([model.body(scene.link_names[i]).mass[0] for i in moving])
    unit = float(masses @ sizes * np.linalg.norm(model.opt.gravity))
    if velocity is not None:
        data.qvel[:] = velocity
    mujoco.mj_energyPos(model, data)
    mujoco.mj_energyVel(model, data)
    before, highest = float(data.energy.sum()), -np.inf
    configurations = [scene.q()]
    for top in simulated(scene, seconds, every):
        highest = max(highest, top)
        configurations.append(scene.q())
    poses = scene.link_poses(np.array(configurations))[:, moving]
    depths = np.maximum(0.0, -scene.clearance(np.array(configurations))) / sizes.min()
    last = round(2 / every) + 1
    moved = 0.0
    for k, mesh in enumerate(meshes):
        corners = np.einsum("nij,vj->nvi", poses[-last:, k, :3, :3], mesh.vertices) + poses[-last:, k, None, :3, 3]
        moved = max(moved, float(np.linalg.norm(corners - corners[-1], axis=2).max()) / sizes[k])
    return Fall(
        gained=(highest - before) / unit,
        deepest=float(depths.max()),
        at_rest=float(depths[-last:].max()),
        moved=moved,
        shifted=poses[:, :, :3, 3] - poses[0, :, :3, 3],
    )
