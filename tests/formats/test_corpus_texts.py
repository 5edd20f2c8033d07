"""Every real file reads, with the dialect, bodies and degrees of freedom that are known of it."""

from __future__ import annotations

from pathlib import Path

import pytest
from conftest import CORPUS
from real_scenes import RealScene, real_scenes

import env2mjcf
from env2mjcf.errors import Severity
from env2mjcf.kinematics.forward import RobotKinematics

TEXTS = sorted((CORPUS / "texts").glob("*.env")) if CORPUS else []
# Files that are known to be doubtful, and why.
DOUBTFUL = {
    "ENV203": "a count that is wrong",
    "ENV210": "no newline at the end",
    "ENV303": "numbers of dialect A, in degrees, copied into a later dialect",
}


@pytest.mark.parametrize("path", TEXTS, ids=[p.stem for p in TEXTS])
def test_every_text_reads(path: Path) -> None:
    scene = env2mjcf.read(path)
    assert {d.code for d in scene.diagnostics if d.severity is Severity.WARNING} <= set(DOUBTFUL)
    assert all(d.span is not None for d in scene.diagnostics if d.severity is Severity.WARNING)
    honest = "ENV203" not in {d.code for d in scene.diagnostics}
    assert honest == (len(scene.multibodies) == scene.declared_multibodies)


@pytest.mark.parametrize("real", real_scenes(), ids=[r.name for r in real_scenes()])
def test_every_scene_reads_as_it_is_known(real: RealScene) -> None:
    scene = env2mjcf.read(real.env, **real.keywords)
    assert scene.dialect == real.dialect
    robots = scene.robots
    assert sum(len(r.bodies) for r in robots) == real.bodies
    assert sum(RobotKinematics.of(r).dim for r in robots) == real.dof
    if "missing" not in real.status or "no robot" in real.status:
        assert (len(robots) == 0) == ("no robot" in real.status)
