"""Every real scene that converts: verdicts on the way to the border of contact, against exact triangles.

`benchmarks/truth.py` does the same with more configurations, and writes the counts down.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from extras import skip_without
from real_scenes import FEW, scene_names

import env2mjcf

pytest.importorskip("fcl", reason="no python-fcl to compare with")

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

import verdicts
from table import Case, corpus_cases
from triangles import Truth

COUNT = 400
STILL = {"skel-2D.doors-pmpl", "skel-2D.paths-pmpl", "ros2-inlet.ppl_files.inlet", "ppl-3D.3d-empty_vizmo"}
"""Scenes in which nothing moves, or nothing is there to touch."""
FOR_EVER = {"pmpl-ReachableVolumes.ClosedChain.chain.tree.vizmo"}
"""Links about one pivot overlap in every configuration, so that there is no border."""


def case(corpus: Path, name: str) -> Case:
    return next(c for c in corpus_cases(corpus) if c.name == name)


@pytest.mark.slow_but(*FEW)
@pytest.mark.parametrize("engine", ["mujoco", "exact"])
@pytest.mark.parametrize("name", scene_names())
def test_no_verdict_is_wrong_outside_the_band(corpus: Path, name: str, engine: str) -> None:
    """`auto` against triangles and containment, `surface` against triangles alone, both directions of error."""
    if engine == "exact":
        skip_without("fast")
    result = verdicts.examine(case(corpus, name), COUNT, seed=2, engine=engine)
    for mode, tally in result.tallies.items():
        assert tally.outside == []
        # Both answers occur often, so that a constant one fails.
        assert name in STILL | FOR_EVER or 0.05 < tally.colliding / tally.verdicts < 0.95, mode
    assert name in STILL or result.uniform >= COUNT // 4
    assert name in STILL | FOR_EVER or result.bisected >= COUNT // 2


@pytest.mark.slow
def test_the_comparison_finds_hulls_wrong(corpus: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    load = env2mjcf.load
    monkeypatch.setattr(env2mjcf, "load", lambda path, **options: load(path, **{**options, "collision": "hull"}))
    assert len(verdicts.examine(case(corpus, "Maze.maze"), COUNT, seed=2).tallies["auto"].outside) > COUNT // 10


def test_truth_itself_knows_boxes(tmp_path: Path) -> None:
    """Two unit cubes touch where no coordinate of their centres differs by more than one; a small one is inside."""
    from scenes import box_mesh, free_cube, write_scene

    scene = env2mjcf.load(write_scene(tmp_path, free_cube("0 0 0 0 0 0"), cube=box_mesh(0.5, 0.5, 0.5)))
    shifts = np.random.default_rng(0).uniform(-1.5, 1.5, (300, 3))
    surface, solid = Truth(scene).verdicts(np.hstack([shifts, np.zeros((300, 3))]))
    assert (surface == (np.abs(shifts) <= 1).all(axis=1)).all()
    assert (solid == surface).all()
    robot = "1\nsmall.g Volumetric Rotational\nConnections\n0\n"
    text = free_cube("cube.g 0 0 0 0 0 0", robot=robot)
    scene = env2mjcf.load(write_scene(tmp_path, text, small=box_mesh(0.1, 0.1, 0.1)))
    surface, solid = Truth(scene).verdicts(np.hstack([shifts, np.zeros((300, 3))]))
    assert (solid == (np.abs(shifts) <= 0.6).all(axis=1)).all()
    inside = (np.abs(shifts) < 0.4).all(axis=1)
    assert inside.any()
    assert (surface == solid & ~inside).all()
