"""Loads the MJCF of the scenes in `models/` into plain MuJoCo, of every 4.x that the package index has.

    python tests/stress/mujoco_versions.py
    python tests/stress/mujoco_versions.py 4.0.0 3.17.0

Each version gets an environment with nothing but MuJoCo and numpy, which says of every scene what it is made of, where
everything is at given configurations, and what touches. That is compared with what the MuJoCo beside env2mjcf says.
Prints one line of figures per version; exit status 1 if one of 4.x differs.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
CONFIGURATIONS = 100
# Of any number, relative to the greatest of its kind.
TOLERANCE = 1e-9
# Nothing is certain closer to contact than this part of a scene's extent.
BAND = 1e-5
COUNTS = ("nq", "nv", "nu", "nbody", "njnt", "ngeom", "nmesh", "neq", "nexclude", "nkey", "nsite", "ncam")
NUMBERS = ("body_mass", "body_inertia", "jnt_range", "jnt_axis", "key_qpos", "qpos0", "geom_solref", "geom_rgba")


def look(folder: Path, out: Path) -> None:
    """Write down what this MuJoCo makes of every scene of a folder."""
    import mujoco

    found: dict[str, np.ndarray] = {"version": np.array(mujoco.__version__)}
    for path in sorted(folder.glob("*/*.xml")):
        model = mujoco.MjModel.from_xml_path(str(path))
        data = mujoco.MjData(model)
        places, depths = [], []
        for row in np.load(path.with_suffix(".npy")):
            data.qpos[:] = row
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_collision(model, data)
            places.append(np.concatenate([data.xpos.ravel(), data.xmat.ravel(), data.geom_xpos.ravel()]))
            depths.append(-data.contact.dist.min() if data.ncon else -np.inf)
        name = path.parent.name
        found |= {f"{name} {n}": getattr(model, n) for n in NUMBERS}
        found[f"{name} counts"] = np.array([getattr(model, n) for n in COUNTS])
        found[f"{name} excludes"] = model.exclude_signature
        found[f"{name} places"], found[f"{name} depths"] = np.array(places), np.array(depths)
        found[f"{name} extent"] = np.array(model.stat.extent)
    np.savez(out, **found)


def convert(folder: Path) -> int:
    """Convert the scenes of `models/`, and draw configurations for each; return how many there are."""
    import env2mjcf

    scenes = sorted([*ROOT.glob("models/*/*.env"), *ROOT.glob("models/*/*.xml")])
    scenes = [s for s in scenes if not s.stem.endswith(("-environment", "-robot"))]
    for scene in scenes:
        robots = tuple(scene.parent.glob("*.robot")) if scene.suffix == ".env" else ()
        place = folder / f"{scene.stem}{scene.suffix.replace('.', '-')}" / "scene.xml"
        env2mjcf.convert(scene, place, robots=robots)
        space = env2mjcf.load(scene, robots=robots).space
        np.save(place.with_suffix(".npy"), space.qpos(space.sample(CONFIGURATIONS, seed=0)))
    return len(scenes)


def on_the_index() -> list[str]:
    """Return the versions of 4.x; the simulator is the package mujoco-core, which the package mujoco asks for."""
    command = [sys.executable, "-m", "pip", "index", "versions", "mujoco-core"]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    listed = re.search(r"Available versions: (.*)", told)
    return [v for v in listed[1].split(", ") if v.startswith("4.")] if listed else []


def installed(version: str, folder: Path) -> Path:
    """Make an environment with this version; return its Python."""
    package = "mujoco-core" if int(version.partition(".")[0]) >= 4 else "mujoco"
    subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
    python = folder / "bin" / "python"
    quiet = ("--quiet", "--disable-pip-version-check")
    subprocess.run([str(python), "-m", "pip", "install", *quiet, f"{package}=={version}"], check=True)
    return python


def differences(found: dict[str, np.ndarray], expected: dict[str, np.ndarray]) -> tuple[list[str], float, int]:
    """Return what differs, the greatest relative difference of numbers, and how many verdicts were compared."""
    wrong, worst, verdicts = [], 0.0, 0
    for key, value in expected.items():
        scene, _, kind = key.partition(" ")
        if kind == "depths":
            one = np.isfinite(found[key]) != np.isfinite(value)
            deep = np.maximum(found[key], value)[one] > BAND * expected[f"{scene} extent"]
            verdicts += len(value)
            wrong += [f"{scene}: {deep.sum()} verdicts"] * bool(deep.any())
        elif found[key].shape != value.shape:
            wrong.append(f"{key}: {found[key].shape} for {value.shape}")
        elif kind in ("counts", "excludes"):
            wrong += [f"{key}: {found[key]} for {value}"] * bool((found[key] != value).any())
        elif kind and value.size:
            relative = float(np.abs(found[key] - value).max() / max(1e-300, np.abs(value).max()))
            worst = max(worst, relative)
            wrong += [f"{key}: by {relative:.1e}"] * (relative > TOLERANCE)
    return wrong, worst, verdicts


def main() -> int:
    """Compare versions."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("versions", nargs="*", help="default: every 4.x on the package index")
    arguments = parser.parse_args()
    failed = False
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        count = convert(folder / "scenes")
        look(folder / "scenes", folder / "expected.npz")
        expected = dict(np.load(folder / "expected.npz"))
        for version in arguments.versions or on_the_index():
            began = time.monotonic()
            python, out = installed(version, folder / version), folder / f"{version}.npz"
            command = [str(python), "-I", __file__, "--look", str(folder / "scenes"), str(out)]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                wrong, worst, verdicts = [done.stderr.strip().rpartition("\n")[2]], np.nan, 0
            else:
                wrong, worst, verdicts = differences(dict(np.load(out)), expected)
            failed |= bool(wrong) and version.startswith("4.")
            print(
                f"MuJoCo {version}: {count} scenes, numbers within {worst:.1e} of {expected['version']}'s, {verdicts} "
                f"verdicts; {len(wrong)} differences; {time.monotonic() - began:.0f} s"
            )
            for line in wrong:
                print(f"    {line}")
    return int(failed)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--look"]:
        look(Path(sys.argv[2]), Path(sys.argv[3]))
    else:
        sys.exit(main())
