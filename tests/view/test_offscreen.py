"""Which GL library draws, and where: never in the process that asks."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from extras import needs
from scenes import MODELS

import env2mjcf
from env2mjcf.system.files import replaced
from env2mjcf.view import offscreen, picture
from env2mjcf.view.offscreen import drawn

SEED = MODELS / "seed" / "seed.env"
needs_gl = pytest.mark.skipif(offscreen.backend() is None, reason=f"no GL: {offscreen.missing()}")


@pytest.fixture
def _forgetful() -> object:
    """Find the backend anew, and forget it afterwards."""
    offscreen._backend.cache_clear()
    yield
    offscreen._backend.cache_clear()


@pytest.mark.usefixtures("_forgetful")
def test_a_machine_without_gl_is_told_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # A backend that MuJoCo does not know fails in the child as a missing library does.
    monkeypatch.setattr(offscreen, "_CANDIDATES", {"Linux": ("none",)})
    monkeypatch.setattr(offscreen.platform, "system", lambda: "Linux")
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    assert offscreen.backend() is None
    with pytest.raises(offscreen.RenderError, match="apt-get install libosmesa6"):
        picture(env2mjcf.load(SEED), file=tmp_path / "a.png")
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("_forgetful")
@pytest.mark.parametrize("gl", ["egl", "osmesa"])
def test_a_backend_that_is_named_is_tried_first(gl: str, monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[str] = []

    def works(name: str) -> bool:
        tried.append(name)
        return name == gl

    monkeypatch.setattr(offscreen, "_works", works)
    monkeypatch.setattr(offscreen.platform, "system", lambda: "Linux")
    monkeypatch.setenv("MUJOCO_GL", gl)
    assert offscreen.backend() == offscreen.backend() == gl
    assert tried == [gl], "found once, by trying it first"
    monkeypatch.delenv("MUJOCO_GL")
    assert offscreen.backend() == gl
    assert tried == {"egl": [gl, "egl"], "osmesa": [gl, "egl", "osmesa"]}[gl]


@needs_gl
@needs("view")
def test_a_picture_leaves_this_process_without_gl(tmp_path: Path) -> None:
    program = (
        "import sys, env2mjcf\nfrom env2mjcf.view import picture\n"
        f"pixels = picture(env2mjcf.load({str(SEED)!r}), size=(64, 48), file='a.png')\n"
        "print(pixels.shape, *sorted({m.partition('.')[0] for m in sys.modules} & {'OpenGL'}))\n"
    )
    # MuJoCo itself imports glfw, which makes nothing of it before a window is asked for.
    environment = {k: v for k, v in os.environ.items() if k != "MUJOCO_GL"}
    finished = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    assert finished.stdout.strip() == "(48, 64, 3)"
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


@needs_gl
def test_a_child_that_fails_is_an_error_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    offscreen.backend()
    for program, message in (
        ("raise SystemExit('no room')", "no room"),
        ("print('{\"camera\": 0}')", "ended too early"),
    ):
        monkeypatch.setattr(offscreen, "_COMMAND", (sys.executable, "-c", program))
        with (
            pytest.raises(offscreen.RenderError, match=message),
            drawn({}) as (_, stream),
            replaced(tmp_path / "a.png"),
        ):
            offscreen.read_exactly(stream, 12)
    assert not list(tmp_path.iterdir())
