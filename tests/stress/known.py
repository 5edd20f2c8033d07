"""Scenes with answers that were noted once: what every later answer is compared with."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests/support"))

import env2mjcf
from real_scenes import RealScene, real_scenes
from truth import Truth, near_obstacles

# Fraction of a scene's extent within which a verdict may go either way.
BAND = 1e-5
_ROWS = 60
# Real scenes beyond this many dimensions or bodies take too long to be loaded again and again.
_LARGEST_DOF, _LARGEST_BODIES, _LARGEST_FILE = 12, 40, 400_000
_MODELS: dict[str, tuple[str, ...]] = {
    "alpha/alpha.env": (),
    "bug-trap/bug-trap.env": (),
    "closed-chain/closed-chain.env": (),
    "gantry/gantry.env": (),
    "maze/maze.env": ("maze/maze.robot",),
    "maze/maze.xml": (),
    "seed/seed.env": (),
    "spherical-arm/spherical-arm.env": (),
    "two-robots/two-robots.env": (),
    "xml-arm/xml-arm.xml": (),
}


@dataclass(eq=False)
class Known:
    """A scene, rows of configurations, and what was answered about them at the start.

    Attributes:
        name: What it is called.
        path: Its file.
        options: What it is loaded with.
        scene: Loaded once, asked all the time.
        q, to: (n, dim) configurations, and where edges from them end.
        answers: By question and engine.
        checked: How many verdicts were compared with an independent program's.
        wrong: Those that differed.
    """

    name: str
    path: Path
    options: dict[str, Any]
    scene: env2mjcf.Scene
    q: np.ndarray
    to: np.ndarray
    answers: dict[tuple[str, str], np.ndarray] = field(default_factory=dict)
    checked: int = 0
    wrong: list[str] = field(default_factory=list)

    def note(self) -> None:
        """Ask everything once, in this thread alone."""
        scene, q = self.scene, self.q
        for engine in ("exact", "mujoco"):
            self.answers["collisions", engine] = scene.in_collision(q, engine=engine, threads=1)
            self.answers["validity", engine] = scene.is_valid(q, engine=engine, threads=1)
            self.answers["contacts", engine] = bytes_of(scene.packed_contacts(q[:12], engine=engine, threads=1))
        self.answers["clearance", "exact"] = scene.clearance(q[:12], threads=1)
        self.answers["edges", "exact"] = scene.edge_in_collision(q, self.to, threads=1)
        self.answers["proofs", "exact"] = scene.edge_is_free(q[:20], self.to[:20], threads=1)
        self.answers["poses", "exact"] = scene.link_poses(q, threads=1)

    def compare(self) -> None:
        """Compare verdicts with those of fcl on the triangles; those within the band do not count."""
        if not self.scene.pairs:
            return
        truth, band = Truth(self.scene), BAND * self.scene.extent
        for engine in ("exact", "mujoco"):
            for row, verdict in zip(self.q, self.answers["collisions", engine], strict=True):
                self.checked += 1
                if truth.wrong(row, bool(verdict), band):
                    self.wrong.append(f"{self.name}: {engine} says {bool(verdict)} at {row.tolist()}, fcl does not")


def bytes_of(contacts: env2mjcf.PackedContacts) -> np.ndarray:
    """Return all that contacts hold as bytes, (k,)."""
    arrays = (contacts.offsets, contacts.pair, contacts.position, contacts.normal, contacts.distance)
    return np.frombuffer(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays), dtype=np.uint8)


def known_scenes(
    seed: int, *, models: Sequence[str] | None = None, real: int | None = None, truth: bool = True
) -> list[Known]:
    """Load scenes and note their answers.

    Args:
        seed: Of the configurations.
        models: Which of the project's scenes; None: all.
        real: How many real scenes at most; None: all that are small.
        truth: Whether to compare answers with those of other programs.
    """
    own = [m for m in _models() if models is None or m[0] in models]
    return [_known(name, path, options, seed, truth) for name, path, options in (*own, *list(_real())[:real])]


def _models() -> Iterator[tuple[str, Path, dict[str, Any]]]:
    folder = ROOT / "models"
    for name, robots in _MODELS.items():
        yield name, folder / name, {"robots": tuple(folder / r for r in robots)}


def _real() -> Iterator[tuple[str, Path, dict[str, Any]]]:
    for real in real_scenes():
        small = real.dof <= _LARGEST_DOF and real.bodies <= _LARGEST_BODIES and _size(real) <= _LARGEST_FILE
        if real.complete and real.dof and real.golden.exists() and small:
            yield real.name, real.env, real.keywords


def _size(real: RealScene) -> int:
    return sum(p.stat().st_size for p in real.env.parent.iterdir() if p.suffix in (".g", ".obj"))


def _known(name: str, path: Path, options: dict[str, Any], seed: int, truth: bool) -> Known:
    scene = env2mjcf.load(path, **options)
    obstacles = bool(scene.obstacle_names)
    rows = [scene.space.sample(_ROWS // 2, seed=seed), near_obstacles(scene, _ROWS // 2, seed)] if obstacles else [
        scene.space.sample(_ROWS, seed=seed)
    ]  # fmt: skip
    q = np.concatenate(rows)
    to = q + 0.2 * scene.space.difference(q, np.roll(q, 1, axis=0))
    known = Known(name, path, options, scene, q, to)
    known.note()
    if truth:
        known.compare()
        _compare_golden(known)
    return known


def _compare_golden(known: Known) -> None:
    """Compare verdicts with the vectors of the corpus, which another program computed."""
    real = next((r for r in real_scenes() if r.name == known.name), None)
    if real is None or not os.environ.get("ENV2MJCF_CORPUS"):
        return
    scene = env2mjcf.load(known.path, inter_robot=False, **known.options)
    for row in real.read_golden()["random"]:
        if row["margin"] is None or abs(row["margin"]) > BAND * scene.extent:
            known.checked += 1
            if scene.in_collision(scene.space.decode(row["cfg"])) != row["hit_solid"]:
                known.wrong.append(f"{known.name}: a golden verdict differs at {row['cfg']}")
