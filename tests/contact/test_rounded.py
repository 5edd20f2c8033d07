"""Verdicts about convex meshes whose numbers were rounded, by both engines, against python-fcl."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from truth import Truth, bisected

import env2mjcf

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

from generated import rounded_solids


@pytest.mark.slow
@pytest.mark.parametrize("primitives", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_verdicts_of_rounded_convex_meshes_are_right_beyond_the_band(
    seed: int, primitives: bool, tmp_path: Path
) -> None:
    scene = env2mjcf.load(rounded_solids(tmp_path, seed).path, primitives=primitives, cache=False)
    parts = scene.compiled.assembly.parts()
    assert [len(p.shape.pieces) for p in parts if p.shape is not None] == [1] * 5
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
