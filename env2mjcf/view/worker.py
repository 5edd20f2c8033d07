"""Draws one picture; run as a script by `offscreen`, with MUJOCO_GL set and the request as JSON on stdin."""

from __future__ import annotations

import json
import os
import sys
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

# Pictures are drawn larger and scaled down: OSMesa has no antialiasing of its own.
_OVERSAMPLING = 2
_GHOST_OPACITY = 0.25


def main() -> None:
    """Draw what stdin asks for; `null` only tries the GL backend."""
    request = json.load(sys.stdin)
    if request is None:
        mujoco.GLContext(16, 16).make_current()
    else:
        try:
            draw(request)
        except (KeyError, ValueError, OSError) as error:
            sys.stderr.write(f"{error.args[0] if isinstance(error, KeyError) else error}\n".replace("\n\n", "\n"))
            sys.exit(1)
    # Contexts that are freed while Python shuts down complain; there is nothing left to free in earnest.
    sys.stdout.flush()
    os._exit(0)


def draw(request: dict[str, Any]) -> None:
    """Draw a request of `offscreen.render`."""
    from PIL import Image

    width, height = request["size"]
    model = mujoco.MjModel.from_xml_path(request["xml"])
    model.vis.global_.offwidth, model.vis.global_.offheight = width * _OVERSAMPLING, height * _OVERSAMPLING
    camera = model.camera(request["camera"]).id
    half = np.tan(np.radians(model.cam_fovy[camera]) / 2) / request["zoom"]
    model.cam_fovy[camera] = np.degrees(2 * np.arctan(half))
    *ghosts, last = [_placed(model, qpos) for qpos in _poses(model, request["pose"])]
    renderer = mujoco.Renderer(model, height * _OVERSAMPLING, width * _OVERSAMPLING)
    option = mujoco.MjvOption()
    renderer.update_scene(last, camera, option)
    for ghost in ghosts:
        _add_ghost(renderer.scene, model, ghost, option)
    pixels = renderer.render()
    picture = Image.fromarray(pixels).resize((width, height), Image.Resampling.LANCZOS)
    # 256 colours are enough for shaded solids, and a third of the size.
    picture.quantize(256, kmeans=1, dither=Image.Dither.FLOYDSTEINBERG).save(
        request["picture"], format="PNG", optimize=True
    )


def _poses(model: mujoco.MjModel, pose: Any) -> list[NDArray[np.float64]]:
    if isinstance(pose, str):
        # A scene without degrees of freedom has no keyframes.
        return [model.key(pose).qpos if model.nkey else model.qpos0]
    rows = np.array(pose, dtype=np.float64)
    if rows.ndim != 2 or not len(rows) or rows.shape[1] != model.nq:
        raise ValueError(f"qpos of shape {rows.shape}; expected ({model.nq},) or (k, {model.nq})")
    return list(rows)


def _placed(model: mujoco.MjModel, qpos: NDArray[np.float64]) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    return data


def _add_ghost(scene: mujoco.MjvScene, model: mujoco.MjModel, data: mujoco.MjData, option: mujoco.MjvOption) -> None:
    """Add everything that moves, half transparent."""
    before = scene.ngeom
    mujoco.mjv_addGeoms(model, data, option, mujoco.MjvPerturb(), mujoco.mjtCatBit.mjCAT_DYNAMIC, scene)
    for geom in scene.geoms[before : scene.ngeom]:
        geom.rgba[3] = _GHOST_OPACITY
        # Decoration casts no shadow.
        geom.category = mujoco.mjtCatBit.mjCAT_DECOR


if __name__ == "__main__":
    main()
