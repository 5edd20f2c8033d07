"""`make demo`, and the pictures it draws."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

import env2mjcf
from env2mjcf.view import offscreen

ROOT = Path(__file__).parents[1]
SEED = ROOT / "models" / "seed" / "seed.env"
CUBE_HALF_EDGE = 0.2

needs_gl = pytest.mark.skipif(offscreen.backend() is None, reason=f"no GL: {offscreen.missing()}")


def demo(out: Path, *arguments: str, **environment: str) -> str:
    """Run the demo in a process of its own and return what it prints."""
    command = [sys.executable, str(ROOT / "models" / "demo.py"), "--out", str(out), *arguments]
    finished = subprocess.run(
        command, cwd=out.parent, env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
    assert finished.returncode == 0, finished.stderr
    return finished.stdout


def pixels(picture: Path) -> np.ndarray:
    """Return a picture, (height, width, 3)."""
    image = pytest.importorskip("PIL.Image")
    with image.open(picture) as opened:
        assert opened.format == "PNG"
        return np.array(opened.convert("RGB"), dtype=np.int64)


def blue(picture: Path) -> int:
    """Count the pixels of the robot's colour; sky, ground and obstacles are grey, or nearly so."""
    image = pixels(picture)
    return int(np.count_nonzero(image[..., 2] - image[..., 0] > 60))


@pytest.fixture(scope="module")
def seed_xml(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The seed scene as MJCF."""
    return env2mjcf.convert(SEED, tmp_path_factory.mktemp("seed"), ground=True).xml


def test_the_demo_reports_what_plain_mujoco_finds(tmp_path: Path) -> None:
    out = tmp_path / "demo"
    text = demo(out, MUJOCO_GL="disable")
    assert f"MJCF      {out / 'seed.xml'}" in text
    assert "contacts at home: none" in text

    model = mujoco.MjModel.from_xml_path(str(out / "seed.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    mujoco.mj_step(model, data, round(2 / model.opt.timestep))
    mujoco.mj_forward(model, data)
    assert data.time == pytest.approx(2)
    assert np.abs(data.qvel).max() < 0.5, "the robot has come to rest"
    height = data.body("cube").xpos[2] - model.geom("ground").pos[2]
    assert height == pytest.approx(CUBE_HALF_EDGE, abs=1e-3), "the cube stands on the ground"

    bodies = [{model.body(model.geom_bodyid[g]).name for g in contact.geom} for contact in data.contact]
    grounded = {name for pair in bodies if "world" in pair for name in pair - {"world"}}
    line = next(line for line in text.splitlines() if line.startswith("on the ground: "))
    assert set(line.removeprefix("on the ground: ").split(", ")) == grounded
    report = text.split("contacts after 2 seconds")[1]
    for pair in ({"link1", "link3"}, {"cube", "link2"}, {"cube", "link3"}, {"link3", "block"}):
        in_report = any(pair <= set(row.replace("│", " ").split()) for row in report.splitlines())
        assert in_report == (pair in bodies), pair


@needs_gl
def test_the_demo_draws_robot_and_obstacles(tmp_path: Path) -> None:
    picture = tmp_path / "seed.png"
    text = demo(tmp_path / "demo", "--picture", str(picture))
    assert f"picture   {picture}" in text
    image = pixels(picture)
    assert image.shape == (960, 1280, 3)
    assert image.std() > 15
    assert blue(picture) > 0.01 * 1280 * 960


def test_without_gl_the_demo_says_what_to_do_and_goes_on(tmp_path: Path) -> None:
    text = demo(tmp_path / "demo", MUJOCO_GL="disable")
    assert "picture   none: pictures are switched off by MUJOCO_GL" in text
    assert "python -m mujoco.viewer" in text
    assert list(tmp_path.rglob("*.png")) == []


def test_a_machine_without_gl_is_told_what_to_install(
    seed_xml: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A backend that MuJoCo does not know fails in the child as a missing library does.
    monkeypatch.setattr(offscreen, "_CANDIDATES", {"Linux": ("none",)})
    monkeypatch.setattr(offscreen.platform, "system", lambda: "Linux")
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    offscreen._backend.cache_clear()
    try:
        assert offscreen.backend() is None
        with pytest.raises(offscreen.RenderError, match="apt-get install libosmesa6"):
            offscreen.render(seed_xml, tmp_path / "a.png")
    finally:
        offscreen._backend.cache_clear()


@pytest.mark.parametrize("gl", ["egl", "osmesa"])
def test_a_backend_that_is_named_is_tried_first(gl: str, monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[str] = []

    def run(name: str, request: str) -> subprocess.CompletedProcess[str]:
        assert request == "null"
        tried.append(name)
        return subprocess.CompletedProcess([], 0 if name == gl else 1)

    monkeypatch.setattr(offscreen, "_run", run)
    monkeypatch.setattr(offscreen.platform, "system", lambda: "Linux")
    monkeypatch.setenv("MUJOCO_GL", gl)
    offscreen._backend.cache_clear()
    try:
        assert offscreen.backend() == offscreen.backend() == gl
        assert tried == [gl], "found once, by trying it first"
        monkeypatch.delenv("MUJOCO_GL")
        assert offscreen.backend() == gl
        assert tried == {"egl": [gl, "egl"], "osmesa": [gl, "egl", "osmesa"]}[gl]
    finally:
        offscreen._backend.cache_clear()


def test_importing_and_reading_touch_neither_gl_nor_mujoco() -> None:
    program = (
        "import sys, env2mjcf, env2mjcf.view.offscreen\n"
        f"env2mjcf.read({str(SEED)!r})\n"
        "print(*sorted({m.partition('.')[0] for m in sys.modules} & {'mujoco', 'OpenGL', 'glfw'}))\n"
    )
    # With a backend that does not exist, the first import of MuJoCo would fail.
    environment = {**os.environ, "MUJOCO_GL": "none"}
    finished = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False
    )
    assert (finished.stdout.strip(), finished.stderr) == ("", "")


@needs_gl
def test_a_picture_leaves_this_process_without_gl(seed_xml: Path, tmp_path: Path) -> None:
    program = (
        "import sys\nfrom env2mjcf.view import offscreen\n"
        f"offscreen.render({str(seed_xml)!r}, 'a.png', size=(64, 48))\n"
        "print(*sorted({m.partition('.')[0] for m in sys.modules} & {'mujoco', 'OpenGL', 'glfw'}))\n"
    )
    finished = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert finished.stdout.strip() == ""
    assert pixels(tmp_path / "a.png").shape == (48, 64, 3)


@needs_gl
def test_ghosts_and_zoom_show_more_of_the_robot(seed_xml: Path, tmp_path: Path) -> None:
    home = mujoco.MjModel.from_xml_path(str(seed_xml)).key("home").qpos
    aside = home + np.array([-0.8, *[0] * 9])
    size = (320, 240)
    alone = offscreen.render(seed_xml, tmp_path / "alone.png", home, size=size)
    ghost = offscreen.render(seed_xml, tmp_path / "ghost.png", [aside, home], size=size)
    near = offscreen.render(seed_xml, tmp_path / "near.png", "home", size=size, zoom=1.5)
    assert blue(near) > 1.8 * blue(alone)
    changed = np.abs(pixels(ghost) - pixels(alone)).max(axis=2) > 20
    assert np.count_nonzero(changed) > 0.4 * blue(alone)


@needs_gl
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"camera": "nowhere"}, "overview"),
        ({"pose": "nowhere"}, "home"),
        ({"pose": [0.0, 1.0]}, r"expected \(10,\)"),
    ],
)
def test_an_impossible_picture_says_what_is_possible(
    seed_xml: Path, tmp_path: Path, arguments: dict[str, object], message: str
) -> None:
    with pytest.raises(offscreen.RenderError, match=message):
        offscreen.render(seed_xml, tmp_path / "a.png", **arguments)
    assert not (tmp_path / "a.png").exists()


def test_the_pictures_of_the_docs_are_small() -> None:
    pictures = sorted((ROOT / "docs").glob("*.png"))
    assert pictures
    for picture in pictures:
        assert picture.read_bytes().startswith(b"\x89PNG")
        assert picture.stat().st_size < 200_000, picture.name
