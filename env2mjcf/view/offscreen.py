"""Drawing without a screen, in a child process: GL never enters the process that asks."""

from __future__ import annotations

import functools
import json
import os
import platform
import subprocess
import sys
import tempfile
import threading
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

_WORKER = Path(__file__).with_name("worker.py")
_SECONDS_TO_TRY = 60
# What MuJoCo itself reads from MUJOCO_GL as "no pictures".
_OFF = ("disable", "disabled", "off", "false", "0")
# What MuJoCo takes, besides what draws here; with any other word it cannot even be imported.
_ANY = ("", "enable", "enabled", "on", "true", "1", "glfw", "glx")
# A GPU first, where there is one; OSMesa needs none.
_CANDIDATES = {"Linux": ("egl", "osmesa"), "Darwin": ("cgl",), "Windows": ("wgl",)}


class RenderError(RuntimeError):
    """A picture that cannot be drawn: a library is missing, or the child process failed."""


def backend() -> str | None:
    """Return the GL backend that draws here (`egl` or `osmesa` on Linux), found by trying; None if none does.

    A backend that MUJOCO_GL names is tried first; MUJOCO_GL=disable switches pictures off.
    """
    return _backend(os.environ.get("MUJOCO_GL", "").strip().lower())


def refuse_unknown() -> None:
    """Make sure that MUJOCO_GL names something that MuJoCo knows.

    Raises:
        ValueError: It does not; the message lists what it may be.
    """
    word = os.environ.get("MUJOCO_GL", "").strip().lower()
    candidates = _CANDIDATES.get(platform.system(), ())
    if word not in (*_OFF, *_ANY, *candidates):
        valid = " or ".join(candidates or ("glfw",))
        raise ValueError(f"MUJOCO_GL is {word!r}; expected {valid}, or disable for no pictures, or leave it unset")


def missing() -> str:
    """Return one sentence that says how to get pictures on this machine."""
    if os.environ.get("MUJOCO_GL", "").strip().lower() in _OFF:
        return "pictures are switched off by MUJOCO_GL: unset it, or set it to egl or osmesa"
    if platform.system() == "Linux":
        return "pictures need a GL library that works without a screen: apt-get install libosmesa6"
    return "pictures need a working OpenGL driver: none was found"


@contextmanager
def drawn(request: Mapping[str, Any]) -> Generator[tuple[dict[str, Any], IO[bytes]]]:
    """Let a child process draw a request; see `worker` for both sides' words.

    Yields:
        What the child says of its pictures, and the stream that they come out of.

    Raises:
        RenderError: There is no GL library, or the child failed.
    """
    refuse_unknown()
    name = backend()
    if name is None:
        raise RenderError(missing())
    with tempfile.TemporaryFile() as errors, _child(name, errors) as child:
        assert child.stdin is not None
        assert child.stdout is not None
        # A request may be longer than a pipe holds, and so may be what comes back.
        feeder = threading.Thread(target=_feed, args=(child.stdin, json.dumps(request).encode() + b"\n"), daemon=True)
        feeder.start()
        head = child.stdout.readline()
        if not head:
            raise RenderError(f"cannot draw with {name}: {_last_line(child, errors)}")
        yield json.loads(head), child.stdout


def read_exactly(stream: IO[bytes], count: int) -> bytes:
    """Read one picture.

    Raises:
        RenderError: The child ended before it was whole.
    """
    data = stream.read(count)
    if len(data) != count:
        raise RenderError("the process that draws ended too early")
    return data


@functools.cache
def _backend(wish: str) -> str | None:
    if wish in _OFF:
        return None
    candidates = _CANDIDATES.get(platform.system(), ("glfw",))
    if wish in candidates:
        candidates = (wish, *(c for c in candidates if c != wish))
    return next((c for c in candidates if _works(c)), None)


def _works(name: str) -> bool:
    try:
        finished = subprocess.run(
            _COMMAND, input=b"null", env=_environment(name), capture_output=True, timeout=_SECONDS_TO_TRY, check=False
        )
    except subprocess.TimeoutExpired:
        return False
    return finished.returncode == 0


_COMMAND = (sys.executable, "-P", str(_WORKER))


@contextmanager
def _child(name: str, errors: IO[bytes]) -> Generator[subprocess.Popen[bytes]]:
    """Start a child with a GL backend of its own, which does not outlive its use."""
    child = subprocess.Popen(
        _COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, env=_environment(name)
    )
    try:
        yield child
    finally:
        child.kill()
        child.wait()
        assert child.stdout is not None
        child.stdout.close()


def _environment(name: str) -> dict[str, str]:
    environment = {**os.environ, "MUJOCO_GL": name, "PYOPENGL_PLATFORM": name}
    if name not in _CANDIDATES["Linux"]:
        del environment["PYOPENGL_PLATFORM"]
    return environment


def _feed(stdin: IO[bytes], data: bytes) -> None:
    try:
        with stdin:
            stdin.write(data)
    except OSError:
        pass  # the child has ended, and its own words say why


def _last_line(child: subprocess.Popen[bytes], errors: IO[bytes]) -> str:
    child.wait()
    errors.seek(0)
    lines = [line for line in errors.read().decode("utf-8", "replace").splitlines() if line.strip()]
    return lines[-1] if lines else f"the child process ended with status {child.returncode}"
