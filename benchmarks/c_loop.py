"""MuJoCo at its quickest: its C functions, called by their addresses from a loop that numba compiles."""

from __future__ import annotations

import copy
import ctypes
import functools
from collections.abc import Callable
from pathlib import Path

import mujoco
import numba
import numpy as np
from lxml import etree

import env2mjcf

# One contact a pair is enough for a verdict.
_ONE_CONTACT = int(mujoco.mjtDisableBit.mjDSBL_MULTICCD)
_LIBCCD = int(mujoco.mjtDisableBit.mjDSBL_NATIVECCD)


@functools.cache
def c_loop() -> Callable[..., None]:
    """Return a compiled loop over configurations: mj_kinematics and mj_collision, nothing else."""
    library = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("libmujoco*"))))
    kinematics, collision = library.mj_kinematics, library.mj_collision
    for function in (kinematics, collision):
        function.argtypes, function.restype = [ctypes.c_void_p, ctypes.c_void_p], None

    @numba.njit(nogil=True)
    def loop(model: int, data: int, qpos: np.ndarray, rows: np.ndarray) -> None:
        for i in range(len(rows)):
            qpos[:] = rows[i]
            kinematics(model, data)
            collision(model, data)

    return loop


class CLoop:
    """The loop on one model.

    Args:
        model: The model.
        qpos: (n, nq) its configurations.
    """

    def __init__(self, model: mujoco.MjModel, qpos: np.ndarray) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        self.qpos = np.ascontiguousarray(qpos)
        self._loop = c_loop()

    def __call__(self, part: slice) -> None:
        """Go through some of the configurations."""
        self._loop(self.model._address, self.data._address, self.data.qpos, self.qpos[part])

    def verdicts(self, part: slice) -> np.ndarray:
        """Return whether there are contacts, (k,): what the loop does, from Python."""
        hits = np.zeros(len(self.qpos[part]), dtype=bool)
        for i, row in enumerate(self.qpos[part]):
            self.data.qpos[:] = row
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_collision(self.model, self.data)
            hits[i] = self.data.ncon > 0
        return hits


def with_verdict_settings(model: mujoco.MjModel) -> mujoco.MjModel:
    """Return a model with the settings of env2mjcf's own verdicts: one contact a pair, found by libccd."""
    copied = copy.copy(model)
    copied.opt.disableflags |= _ONE_CONTACT | _LIBCCD
    return copied


def layouts(scene: env2mjcf.Scene) -> dict[str, mujoco.MjModel]:
    """Return models of the scene's geometry that MuJoCo may be quicker on than on the one that is written."""
    bare, static = _compiled(scene, bodies=False), _compiled(scene, bodies=True)
    for model in (bare, static):
        model.opt.disableflags |= _ONE_CONTACT
    return {
        "libccd": with_verdict_settings(scene.model),
        "bare": bare,
        "bare, libccd": with_verdict_settings(bare),
        "static bodies": static,
        "static bodies, libccd": with_verdict_settings(static),
    }


def _compiled(scene: env2mjcf.Scene, *, bodies: bool) -> mujoco.MjModel:
    """Compile a scene without what is only drawn, its obstacles as geoms of the world or as bodies of their own."""
    root = etree.fromstring(scene.xml.encode("utf-8"))
    root.find("compiler").set("discardvisual", "true")
    if bodies:
        # Sweep-and-prune takes room for all pairs of bodies, and MuJoCo ends the process where there is none.
        etree.SubElement(root, "size", memory="256M")
        # Obstacles stand in frames of the world; a frame that is called a body is one.
        for frame in root.find("worldbody").iterfind("frame"):
            frame.tag = "body"
    with mujoco.MjVfs() as vfs:
        vfs["model.xml"] = etree.tostring(root)
        for name, data in scene.assets.items():
            vfs[name] = data
        spec = mujoco.MjSpec.from_file("model.xml", vfs=vfs)
    spec.assets = {Path(n).name: d for n, d in scene.assets.items() if not n.endswith(".xml")}
    return spec.compile()
