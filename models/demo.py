"""The seed scene in MuJoCo, from the env file to a contact report and a picture: what `make demo` runs.

`python models/demo.py --gallery docs/models.png` draws the picture of the README instead: every scene of this folder.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
from rich.console import Console
from rich.table import Table

import env2mjcf
from env2mjcf import view
from env2mjcf.view import offscreen

HERE = Path(__file__).resolve().parent
SECONDS = 2.0
# A third of a second after release the robot is still in the air.
GHOSTS = (0.0, 0.33)

# What the gallery shows: scenes, and their queries where the robots are to stand at the start.
GALLERY: tuple[tuple[str, dict[str, str]], ...] = (
    ("seed/seed.env", {}),
    ("gantry/gantry.env", {}),
    ("bug-trap/bug-trap.env", {"query": "bug-trap/bug-trap.query"}),
    ("spherical-arm/spherical-arm.env", {"query": "spherical-arm/spherical-arm.query"}),
    ("closed-chain/closed-chain.env", {}),
    ("alpha/alpha.env", {"query": "alpha/alpha.query"}),
    ("two-robots/two-robots.env", {}),
    ("maze/maze.xml", {}),
    ("xml-arm/xml-arm.xml", {}),
)
# In pixels, but for the first.
COLUMNS, TILE, CAPTION, MARGIN = 3, (400, 300), 26, 4


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the demo, or draw the gallery."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=HERE.parent / "demo", help="folder for the MJCF (default: demo)")
    parser.add_argument("--picture", type=Path, help="the picture to write (default: seed.png beside the MJCF)")
    parser.add_argument("--gallery", type=Path, help="draw every scene into this file, and do nothing else")
    chosen = parser.parse_args(arguments)
    console = Console(highlight=False, soft_wrap=True)
    if chosen.gallery:
        gallery(chosen.gallery)
        console.print(f"picture   {chosen.gallery}", markup=False)
        return 0
    demo(chosen.out, chosen.picture, console)
    return 0


def demo(out: Path, picture: Path | None, console: Console) -> None:
    """Convert, load, let fall, report, draw."""
    options = {"ground": True, "query": HERE / "seed/seed.query"}
    result = env2mjcf.convert(HERE / "seed/seed.env", out, **options)
    report = result.report
    console.print("\n[bold]env2mjcf[/bold]: the example of the Parasol Lab's page, in MuJoCo\n")
    console.print(f"scene     {HERE / 'seed/seed.env'}", markup=False)
    console.print(
        f"          dialect {report.dialect}: {report.links} links, {report.dof} degrees of freedom, "
        f"{report.obstacles} obstacles, {report.geoms} geoms that collide, {report.mass:.0f} kg"
    )
    console.print(f"MJCF      {result.xml} and {len(result.assets)} assets", markup=False)
    for diagnostic in result.diagnostics:
        console.print(str(diagnostic), markup=False)

    # From here on plain MuJoCo, and nothing but the written file.
    model = mujoco.MjModel.from_xml_path(str(result.xml))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    poses = [fall_until(model, data, second) for second in (*GHOSTS, SECONDS)]
    speed = float(np.abs(data.qvel).max())
    console.print(
        f"fall      {SECONDS:g} simulated seconds in steps of {1e3 * model.opt.timestep:g} ms; "
        f"fastest coordinate at the end: {speed:.2g} m/s or rad/s\n"
    )

    # For two answers it is not worth compiling the quicker engine.
    scene = env2mjcf.load(HERE / "seed/seed.env", engine="mujoco", **options)
    contact_report(console, "at home", scene, scene.space.home)
    contact_report(console, f"after {SECONDS:g} seconds", scene, scene.space.from_qpos(poses[-1]))
    console.print(f"on the ground: {', '.join(resting(model, data)) or 'nothing'}\n", markup=False)

    picture = picture or out / "seed.png"
    *ghosts, last = scene.space.from_qpos(poses)
    try:
        view.picture(scene, last, ghosts=ghosts, size=(1280, 960), camera="overview", file=picture)
    except offscreen.RenderError as error:
        console.print(f"picture   none: {error}", markup=False)
    else:
        console.print(f"picture   {picture} (drawn with {offscreen.backend()})", markup=False)
    console.print(f'look      python -m mujoco.viewer --mjcf="{result.xml}"\n', markup=False)


def fall_until(model: mujoco.MjModel, data: mujoco.MjData, seconds: float) -> np.ndarray:
    """Simulate up to a time and return the qpos reached."""
    while data.time < seconds - model.opt.timestep / 2:
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    return data.qpos.copy()


def contact_report(console: Console, when: str, scene: env2mjcf.Scene, q: np.ndarray) -> None:
    """Print who touches whom, where and how deep: the deepest contact of each pair."""
    pairs: dict[tuple[str, str], list[env2mjcf.Contact]] = {}
    for contact in scene.contacts(q):
        pairs.setdefault((contact.link, contact.other), []).append(contact)
    if not pairs:
        console.print(f"contacts {when}: none among {len(scene.pairs)} tested pairs\n")
        return
    table = Table(title=f"contacts {when}, of {len(scene.pairs)} tested pairs", title_justify="left", title_style="")
    for name in ("link", "touches", "kind", "points", "x, y, z / m", "depth / mm"):
        table.add_column(name, justify="right" if name in ("points", "depth / mm") else "left")
    for (link, other), contacts in pairs.items():
        deepest = min(contacts, key=lambda c: c.distance)
        x, y, z = deepest.position
        where, depth = f"{x:.3f}, {y:.3f}, {z:.3f}", f"{-1e3 * deepest.distance:.2g}"
        table.add_row(link, other, deepest.kind, str(len(contacts)), where, depth)
    console.print(table)


def resting(model: mujoco.MjModel, data: mujoco.MjData) -> list[str]:
    """Return the bodies that touch the ground, in the model's order."""
    ground = model.geom("ground").id
    geoms = {int(g) for c in data.contact if ground in c.geom for g in c.geom} - {ground}
    return [model.body(b).name for b in sorted({int(model.geom_bodyid[g]) for g in geoms})]


def gallery(picture: Path) -> None:
    """Draw every scene of this folder into one picture."""
    from PIL import Image, ImageDraw, ImageFont

    (width, height), rows = TILE, -(-len(GALLERY) // COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * width, rows * (height + CAPTION)), "white")
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(15)
    for i, (path, files) in enumerate(GALLERY):
        scene = env2mjcf.load(HERE / path, **{name: HERE / file for name, file in files.items()})
        start = scene.queries[0].q[0] if scene.queries else None
        tile = view.picture(scene, start, size=(width - 2 * MARGIN, height - 2 * MARGIN))
        left, top = i % COLUMNS * width + MARGIN, i // COLUMNS * (height + CAPTION) + MARGIN
        sheet.paste(Image.fromarray(tile), (left, top))
        caption = f"{Path(path).parent.name}, dialect {scene.report.dialect}"
        pen.text((left + width / 2, top + height), caption, fill=(70, 75, 80), font=font, anchor="mt")
    picture.parent.mkdir(parents=True, exist_ok=True)
    sheet.quantize(256, kmeans=2, dither=Image.Dither.NONE).save(picture, format="PNG", optimize=True)


if __name__ == "__main__":
    sys.exit(main())
