"""Pictures without a screen, drawn in a child process: GL never enters the process that asks."""

from __future__ import annotations

import functools
import importlib.util
import json
import os
import platform
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

_WORKER = Path(__file__).with_name("worker.py")
_SECONDS = 300
# What MuJoCo itself reads from MUJOCO_GL as "no pictures".
_OFF = ("disable", "disabled", "off", "false", "0")
# A GPU first, where there is one; OSMesa needs none.
_CANDIDATES = {"Linux": ("egl", "osmesa"), "Darwin": ("cgl",), "Windows": ("wgl",)}


class RenderError(RuntimeError):
    """A picture that cannot be drawn: a library is missing, or the model has no such camera or keyframe."""


def backend() -> str | None:
    """Return the GL backend that draws here (`egl` or `osmesa` on Linux), found by trying; None if none does.

    A backend that MUJOCO_GL names is tried first; MUJOCO_GL=disable switches pictures off.
    """
    return _backend(os.environ.get("MUJOCO_GL", "").strip().lower())


def render(
    xml: str | os.PathLike[str],
    picture: str | os.PathLike[str],
    pose: str | ArrayLike = "home",
    *,
    camera: str = "overview",
    size: tuple[int, int] = (1280, 960),
    zoom: float = 1.0,
) -> Path:
    """Draw a model into a PNG file.

    Args:
        xml: An MJCF file.
        picture: The file to write; its folder must exist.
        pose: Name of a keyframe; or qpos, (nq,); or (k, nq), where all rows but the last are drawn as ghosts.
        camera: Name of a camera of the model.
        size: Width and height in pixels.
        zoom: How much nearer the camera sees the scene.

    Returns:
        The picture's path.

    Raises:
        RenderError: No GL library or no pillow, or the model cannot be drawn so.
    """
    if importlib.util.find_spec("PIL") is None:
        raise RenderError("pictures need pillow: pip install 'env2mjcf[view]'")
    name = backend()
    if name is None:
        raise RenderError(missing())
    request = {
        "xml": os.path.abspath(xml),
        "picture": os.path.abspath(picture),
        "pose": pose if isinstance(pose, str) else np.atleast_2d(np.asarray(pose, dtype=np.float64)).tolist(),
        "camera": camera,
        "size": list(size),
        "zoom": zoom,
    }
    finished = _run(name, json.dumps(request))
    if finished.returncode != 0:
        raise RenderError(f"cannot draw {os.fspath(xml)} with {name}: {_last_line(finished.stderr)}")
    return Path(picture)


def missing() -> str:
    """Return one sentence that says how to get pictures on this machine."""
    if os.environ.get("MUJOCO_GL", "").strip().lower() in _OFF:
        return "pictures are switched off by MUJOCO_GL: unset it, or set it to egl or osmesa"
    if platform.system() == "Linux":
        return "pictures need a GL library that works without a screen: apt-get install libosmesa6"
    return "pictures need a working OpenGL driver: none was found"


@functools.cache
def _backend(wish: str) -> str | None:
    if wish in _OFF:
        return None
    candidates = _CANDIDATES.get(platform.system(), ("glfw",))
    if wish in candidates:
        candidates = (wish, *(c for c in candidates if c != wish))
    return next((c for c in candidates if _run(c, "null").returncode == 0), None)


def _run(name: str, request: str) -> subprocess.CompletedProcess[str]:
    """Hand a request to a child with a GL backend of its own."""
    environment: Mapping[str, str] = {**os.environ, "MUJOCO_GL": name, "PYOPENGL_PLATFORM": name}
    if name not in _CANDIDATES["Linux"]:
        environment = {k: v for k, v in environment.items() if k != "PYOPENGL_PLATFORM"}
    command = [sys.executable, "-P", str(_WORKER)]
    try:
        return subprocess.run(
            command, input=request, env=environment, capture_output=True, text=True, timeout=_SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess(command, 1, "", f"no answer within {_SECONDS} seconds")


def _last_line(text: str) -> str:
    lines = [line for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else "the child process ended without a message"
