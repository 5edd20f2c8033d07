"""`make demo`, and the pictures it draws."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from extras import needs

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
    from PIL import Image

    with Image.open(picture) as opened:
        assert opened.format == "PNG"
        return np.array(opened.convert("RGB"), dtype=np.int64)


def blue(picture: Path) -> int:
    """Count the pixels of the robot's colour; sky, ground and obstacles are grey, or nearly so."""
    image = pixels(picture)
    return int(np.count_nonzero(image[..., 2] - image[..., 0] > 60))


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


@pytest.mark.slow
@needs_gl
@needs("view")
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


def test_the_pictures_of_the_docs_are_small() -> None:
    pictures = sorted((ROOT / "docs").glob("*.png"))
    assert pictures
    for picture in pictures:
        assert picture.read_bytes().startswith(b"\x89PNG")
        assert picture.stat().st_size < 200_000, picture.name
