"""The real scenes of the corpus, for tests that are parametrised by name."""

from __future__ import annotations

import csv
import json
import os
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

_FOLDER = os.environ.get("ENV2MJCF_CORPUS")

# Scenes of each dialect, with one robot and several, with trees and loops; tests of all the others are slow.
FEW = (
    "LTunnel.tunnel",
    "SerialWalls.serial",
    "old-2loop.2loop_13con",
    "old-testBranchs.branchs",
    "pmpl-MultipleRobot.narrow",
    "pmpl-ReachableVolumes.ClosedChain.chain.tree",
    "exps-2DHeterogeneous.heterogeneous",
    "ppl-3D.3d+linked",
    "factory_simulation.map",
)


@dataclass(frozen=True)
class RealScene:
    """One row of scenes.tsv."""

    name: str
    env: Path
    dialect: str
    bodies: int
    dof: int
    status: str
    options: tuple[tuple[str, Any], ...]
    query: Path | None
    golden: Path

    @property
    def keywords(self) -> dict[str, Any]:
        """Options that the scene needs to be read or loaded."""
        return dict(self.options)

    @property
    def complete(self) -> bool:
        """Whether every mesh is there."""
        return "missing" not in self.status

    def read_golden(self) -> dict[str, Any]:
        """Return the vectors that an independent program computed."""
        return json.loads(self.golden.read_text())


@cache
def real_scenes() -> tuple[RealScene, ...]:
    """Return all scenes of the corpus; none where it is not there."""
    if not _FOLDER:
        return ()
    corpus = Path(_FOLDER)
    with (corpus / "scenes.tsv").open(newline="") as file:
        rows = list(csv.DictReader(file, delimiter="\t"))
    scenes: list[RealScene] = []
    for row in rows:
        folder = corpus / "scenes" / row["name"]
        options: dict[str, Any] = {}
        if row["robot"] != "-":
            options["robots"] = (folder / row["robot"],)
        # The inlet's meshes lie in a folder beside its own.
        if "inlet" in row["name"]:
            options["allow_outside"] = True
        scenes.append(
            RealScene(
                row["name"],
                folder / row["env"],
                row["dialect"],
                int(row["n_bodies"]),
                int(row["dof"]),
                row["status"],
                tuple(options.items()),
                folder / row["query"] if row["query"] != "-" else None,
                corpus / "golden" / f"{row['name']}.json",
            )
        )
    return tuple(scenes)


def scene_names(*, complete: bool = True, golden: bool = False) -> list[str]:
    """Return names for `parametrize`; one name that skips where the corpus is not there."""
    names = [s.name for s in real_scenes() if s.complete is complete and (s.golden.exists() or not golden)]
    return names or ["corpus"]


def real_scene(name: str) -> RealScene:
    """Return a scene by name."""
    return next(s for s in real_scenes() if s.name == name)


def matrices(poses: list[dict[str, Any]]) -> np.ndarray:
    """Return golden poses as (n, 4, 4)."""
    out = np.tile(np.eye(4), (len(poses), 1, 1))
    for i, pose in enumerate(poses):
        out[i, :3, :3] = pose["R"]
        out[i, :3, 3] = pose["p"]
    return out


def deviation(found: np.ndarray, expected: np.ndarray) -> float:
    """Return max|difference| / (1 + max|expected|)."""
    if not expected.size:
        return 0.0
    return float(np.abs(found - expected).max() / (1 + np.abs(expected).max()))
