"""Verdicts about convex meshes whose numbers were rounded, by both engines, against python-fcl."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from truth import Truth, bisected

import env2mjcf

SOLIDS = {
    "box": trimesh.creation.box((1, 0.5, 1.5)),
    "cylinder": trimesh.creation.cylinder(0.4, 1, sections=40),
    "capsule": trimesh.creation.capsule(1, 0.3, count=[8, 8]),
    "ball": trimesh.creation.icosphere(2, 0.6),
}


def write_rounded(folder: Path, name: str, rng: np.random.Generator) -> None:
    """Write a solid, turned, as binary STL, which holds single precision."""
    solid = SOLIDS[name].copy()
    solid.vertices = solid.vertices @ Rotation.random(random_state=rng).as_matrix().T
    solid.export(folder / f"{name}.stl")


@pytest.mark.slow
@pytest.mark.parametrize("primitives", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_verdicts_of_rounded_convex_meshes_are_right_beyond_the_band(
    seed: int, primitives: bool, tmp_path: Path
) -> None:
    rng = np.random.default_rng(seed)
    for name in SOLIDS:
        write_rounded(tmp_path, name, rng)
    names = [*rng.permutation(list(SOLIDS)), "box"]
    bodies = [f"Passive\n{n}.stl {' '.join(map(str, rng.uniform(-1.5, 1.5, 3)))} 10 20 30\n" for n in names[1:]]
    robot = f"Active\n1\n{names[0]}.stl Volumetric Rotational\nConnections\n0\n"
    path = tmp_path / "scene.env"
    path.write_text(f"Boundary Box [-9:9 ; -9:9 ; -9:9]\nMultibodies\n{len(names)}\n{robot}{''.join(bodies)}")
    scene = env2mjcf.load(path, primitives=primitives, cache=False)
    parts = scene.compiled.assembly.parts()
    assert [len(p.shape.pieces) for p in parts if p.shape is not None] == [1] * len(names)
    assert any(p.shape is not None and p.shape.box is not None for p in parts)
    truth = Truth(scene)
    q = bisected(scene, truth, 150, 26, seed)
    for engine in ("exact", "mujoco"):
        verdicts = scene.in_collision(q, engine=engine)
        assert 0 < verdicts.mean() < 1
        wrong = [
            row for row, verdict in zip(q, verdicts, strict=True) if truth.wrong(row, verdict, 1e-5 * scene.extent)
        ]
        assert not wrong
