"""Bodies that slide over plates made of many polygons, in plain MuJoCo: what they lose at the seams between cells.

As a program, prints how many of all slides lose how much, two minutes: `python tests/support/slides.py [SLIDER ...]`.
"""

from __future__ import annotations

import itertools
import math
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

import mujoco
import numpy as np
import trimesh
from meshes import table, voxels
from scenes import write_scene

import env2mjcf
from env2mjcf.formats.meshes.byu import export_byu

Kind = Literal["frictionless", "friction", "tilted", "tilted with friction", "both move", "both move, plate first"]

# Whose losses are told by their speed.
_RUN_OVER = {"frictionless": "plate", "both move": "robot", "both move, plate first": "first"}
_SETTLING = 0.3
_FRICTION = 0.2
_G = 9.81
_TILT = math.radians(20)


def plate(step: float = 0.0, noise: float = 0.0) -> trimesh.Trimesh:
    """A plate of 2 x 1.2, 0.1 thick; its top is of uneven triangles, flat but for dents beside the middle.

    With a step, all beyond x = 0.3 is higher by it; with noise, each vertex of the top by as much at random.
    """
    rng = np.random.default_rng(1)
    n, m = 25, 13
    u, v = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    inner = (u > 0) & (u < n - 1) & (v > 0) & (v < m - 1)
    jitter = np.where(inner, rng.uniform(-0.35, 0.35, (2, n, m)), 0.0)
    x, y = (u + jitter[0]) * 2 / (n - 1) - 0.5, (v + jitter[1]) * 1.2 / (m - 1) - 0.6
    z = np.where(inner & (np.abs(y) > 0.35), rng.uniform(-0.02, 0, (n, m)), 0.0)
    z += np.where(x > 0.3, step, 0.0) + noise * rng.uniform(-0.5, 0.5, (n, m))
    top = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    i = (np.arange(n - 1)[:, None] * m + np.arange(m - 1)).ravel()
    faces = np.concatenate([np.stack([i, i + m, i + m + 1], 1), np.stack([i, i + m + 1, i + 1], 1)])
    sides = {(a, b) for f in faces.tolist() for a, b in zip(f, f[1:] + f[:1], strict=True)}
    rim = np.array(sorted((a, b) for a, b in sides if (b, a) not in sides))
    a, b = rim.T
    k = len(top)
    wall = np.concatenate([np.stack([b, a, a + k], 1), np.stack([b, a + k, b + k], 1)])
    bottom = np.column_stack([top[:, :2], np.full(k, -0.1)])
    mesh = trimesh.Trimesh(np.vstack([top, bottom]), np.vstack([faces, faces[:, ::-1] + k, wall]), process=False)
    assert mesh.is_watertight
    return mesh


def notched_box() -> trimesh.Trimesh:
    """A box of 0.2 with a groove in its upper side: convex where it slides, and yet in cells."""
    filled = np.ones((3, 1, 2), dtype=bool)
    filled[1, 0, 1] = False
    return voxels([np.array([-0.1, -0.04, 0.04, 0.1]), np.array([-0.1, 0.1]), np.array([-0.1, 0.0, 0.1])], filled)


def tapered(mesh: trimesh.Trimesh, growth: float) -> trimesh.Trimesh:
    """Wider by `growth` at its top than at its bottom, which is as wide as before."""
    corners = mesh.vertices.copy()
    corners[:, :2] *= 1 + growth * (corners[:, 2:] - corners[:, 2].min()) / np.ptp(corners[:, 2])
    return trimesh.Trimesh(corners, mesh.faces, process=False)


def blunt(degrees: float) -> trimesh.Trimesh:
    """A notched box whose lower edges have this angle."""
    return tapered(notched_box(), 2 * math.tan(math.radians(degrees - 90)))


SLIDERS = {
    "box": trimesh.creation.box((0.2, 0.2, 0.2)),
    "notched": notched_box(),
    "acute": tapered(notched_box(), -0.6),
    "obtuse": tapered(notched_box(), 0.6),
    "table": table(0.2, 0.2, 0.2, 0.04),
    "stool": tapered(table(0.2, 0.2, 0.2, 0.04), -0.4),
    "blunt 150": blunt(150),
    "blunt 160": blunt(160),
    "blunt 167": blunt(167),
}


def _robot(mesh: str) -> str:
    return f"Active\n1\n{mesh}.g Volumetric Rotational\nConnections\n0\n\n"


@cache
def scene_of(name: str, noise: float, over: str = "plate", step: float = 0.0) -> env2mjcf.Scene:
    """Load a slider, over a plate that is an obstacle, one that is a "robot" after or "first", or MuJoCo's "plane"."""
    slider, flat = SLIDERS[name], plate(step, noise)
    # The planner puts the mean of a mesh's vertices at its pose.
    x, y, z = flat.vertices.mean(axis=0).tolist()
    moving = _robot("slider")
    bodies = {
        "plate": [moving, f"Passive\nplate.g {x!r} {y!r} {z!r} 0 0 0\n"],
        "robot": [moving, _robot("plate")],
        "first": [_robot("plate"), moving],
        "plane": [moving],
    }[over]
    text = f"Boundary Box [-10:10 ; -10:10 ; -10:10]\n\nMultibodies\n{len(bodies)}\n\n" + "".join(bodies)
    with tempfile.TemporaryDirectory() as folder:
        file = write_scene(Path(folder), text, slider=export_byu(slider), plate=export_byu(flat))
        return env2mjcf.load(file, ground=over == "plane")


@dataclass(frozen=True)
class Slide:
    """A slide of a second: how, what, over what noise, how it is turned about z, and how fast it begins, m/s."""

    kind: Kind
    name: str
    noise: float
    turn: float
    speed: float
    step: float = 0.0

    def lost(self) -> float:
        """Return what share of its speed a body loses, corrected for the height that it gains.

        With friction or on a slope: by what share its way differs from that over a plane.
        """
        if self.kind not in _RUN_OVER:
            way, expected = (float(self.run(over)[0][0]) for over in ("plate", "plane"))
            return abs(way - expected) / abs(expected)
        moved, velocity, gravity = self.run(_RUN_OVER[self.kind])
        squared = float(velocity[:3] @ velocity[:3]) - 2 * float(gravity @ moved)
        return 1 - math.sqrt(max(squared, 0.0)) / self.speed

    def run(self, over: str, seconds: float = 1.0, flags: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the way of the slider, its velocity and angular velocity at the end, and gravity.

        Args:
            over: As of `scene_of`.
            seconds: How long it slides.
            flags: Of MuJoCo that are switched on.
        """
        scene = scene_of(self.name, self.noise, over, self.step)
        model, data = scene.model, scene.data
        as_written = int(model.opt.enableflags)
        model.opt.enableflags |= flags
        model.geom_condim[:] = 3 if "friction" in self.kind.split() else 1
        model.geom_friction[:, 0] = _FRICTION
        slider = SLIDERS[self.name]
        low = float((slider.vertices - slider.vertices.mean(axis=0))[:, 2].min())
        mujoco.mj_resetData(model, data)
        at = [0.0, 0.0, 0.0 if over == "plane" else -low, 0.0, 0.0, self.turn]
        below = [*plate(self.step, self.noise).vertices.mean(axis=0), 0.0, 0.0, 0.0]
        scene.set(np.array({"robot": [*at, *below], "first": [*below, *at]}.get(over, at)))
        tilt = _TILT if self.kind.startswith("tilted") else 0.0
        gravity = np.array([0, 0, -_G * math.cos(tilt)])
        _step(model, data, over, gravity, _SETTLING)
        gravity[0] = _G * math.sin(tilt)
        joint = 1 if over == "first" else 0
        place, speeds = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
        data.qvel[:] = 0
        data.qvel[speeds] = self.speed
        start = data.qpos[place : place + 3].copy()
        _step(model, data, over, gravity, _SETTLING + (seconds / 2 if tilt else seconds))
        model.opt.enableflags = as_written
        assert not data.warning.number.any()
        return data.qpos[place : place + 3] - start, data.qvel[speeds : speeds + 6].copy(), gravity


def _step(model: mujoco.MjModel, data: mujoco.MjData, over: str, gravity: np.ndarray, until: float) -> None:
    """Step until then; two robots are pressed together, by forces that leave both at rest were the plate flat.

    A plate too heavy to be pushed away would be no substitute: at 1e9 kg MuJoCo's solver stops early, and bodies lose
    most of their speed by that alone.
    """
    model.opt.gravity[:] = 0 if over in ("robot", "first") else gravity
    while data.time < until:
        if over in ("robot", "first"):
            slider, other = model.jnt_bodyid if over == "robot" else model.jnt_bodyid[::-1]
            force = model.body_mass[slider] * gravity
            data.xfrc_applied[slider, :3] = force
            data.xfrc_applied[other, :3] = -force
            data.xfrc_applied[other, 3:] = np.cross(data.xipos[slider] - data.xipos[other], -force)
        mujoco.mj_step(model, data)


NOISES = (0.0, 1e-6, 1e-5, 1e-4)


def all_slides() -> Iterator[Slide]:
    """Yield nearly six hundred slides."""
    for name, noise in itertools.product(SLIDERS, NOISES):
        for turn in (-2.7, -1.3, 0.4, 0.8, 1.5, 2.2):
            yield Slide("frictionless", name, noise, turn, round(0.6 + turn / 20, 3))
        for kind in ("friction", "tilted", "tilted with friction"):
            for turn in (0.4, 2.2):
                yield Slide(kind, name, noise, turn, 1.0 if kind == "friction" else 0.5)
        for turn in (-1.3, 0.8):
            yield Slide("both move", name, noise, turn, 0.6)
            yield Slide("both move, plate first", name, noise, turn, 0.6)


def main() -> None:
    """Print how many slides of each kind and noise lose more than 0.1, 1 and 10 %, and the worst."""
    found: dict[tuple[str, float], list[tuple[float, Slide]]] = {}
    wanted = sys.argv[1:]
    for slide in sorted(all_slides(), key=lambda s: (s.name, s.noise, s.kind)):
        if not wanted or slide.name in wanted:
            found.setdefault((slide.kind, slide.noise), []).append((slide.lost(), slide))
    for (kind, noise), losses in sorted(found.items()):
        counts = [sum(lost > mark for lost, _ in losses) for mark in (1e-3, 1e-2, 1e-1)]
        worst = sorted(losses, key=lambda pair: -pair[0])[:3]
        told = ", ".join(f"{s.name} {s.turn}: {lost:.2%}" for lost, s in worst)
        print(f"{kind:22} {noise:6.0e} {len(losses):3} slides, over .1/1/10 %: {counts}  {told}", flush=True)


if __name__ == "__main__":
    main()
