"""Random scenes of every dialect, with random meshes, the whole way from text to verdicts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from strategies import Solid, laid_out, mesh_text, rich_environments, solids

import env2mjcf
from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.formats.meshes.byu import read_byu
from env2mjcf.formats.meshes.obj import read_obj
from env2mjcf.formats.writers import env_text, robot_text
from env2mjcf.limits import Limits
from env2mjcf.model.environment import Environment, JointType

SIZE = 25.0
"""Of meshes: poses of the random scenes lie within 100 of each other, so that some bodies touch and some do not."""


def without_sma(scene: Environment) -> Environment:
    """Return the scene with hinges for its SMAJoints, which bend along their length as no joint of MuJoCo does."""
    robots = tuple(
        replace(m, connections=tuple(
            replace(c, joint=JointType.REVOLUTE, sma=None) if c.joint is JointType.SMA else c for c in m.connections
        ))
        for m in scene.multibodies
    )  # fmt: skip
    return replace(scene, multibodies=robots)


def written(scene: Environment, meshes: list[Solid], folder: Path, random: Random) -> env2mjcf.Scene:
    """Write a scene whose bodies are these meshes, and load it."""
    names = dict.fromkeys(b.filename for m in scene.multibodies for b in m.bodies)
    for i, name in enumerate(names):
        solid = meshes[i % len(meshes)]
        (folder / name).parent.mkdir(exist_ok=True)
        scaled = replace(solid, vertices=solid.vertices * SIZE)
        (folder / name).write_text(mesh_text(scaled, random, "obj" if name.endswith("obj") else "g"))
    (folder / "scene.env").write_bytes(laid_out(env_text(scene), random).encode())
    robots = [m for m in scene.multibodies if m.robot_file]
    for i, robot in enumerate(robots):
        (folder / f"{i}.robot").write_text(robot_text(robot))
    return env2mjcf.load(
        folder / "scene.env",
        robots=[folder / f"{i}.robot" for i in range(len(robots))],
        dialect=scene.dialect.value,
        engine="mujoco",
        cache=False,
    )


@settings(max_examples=200, deadline=None)
@given(solid=solids(), random=st.randoms(use_true_random=False), kind=st.sampled_from(["g", "obj"]))
def test_a_mesh_reads_as_it_was_written(solid: Solid, random: Random, kind: str) -> None:
    text = mesh_text(solid, random, kind).encode()
    vertices, faces = (read_obj if kind == "obj" else read_byu)(text, "mesh", DiagnosticLog(), Limits())
    assert (vertices == solid.vertices).all()
    assert (faces == solid.faces).all()


@settings(
    max_examples=40,
    deadline=None,
    phases=[Phase.generate],
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
@given(
    scene=rich_environments().map(without_sma),
    meshes=st.lists(solids(), min_size=1, max_size=3),
    random=st.randoms(use_true_random=False),
)
def test_poses_and_verdicts_of_any_scene(
    tmp_path_factory: pytest.TempPathFactory, scene: Environment, meshes: list[Solid], random: Random
) -> None:
    pytest.importorskip("fcl")
    from truth import Truth

    loaded = written(scene, meshes, tmp_path_factory.mktemp("scene"), random)
    truth = Truth(loaded)
    q = loaded.space.sample(12, seed=1)
    # MuJoCo's chain of bodies and joints, against the product of the file's transforms.
    poses = loaded.link_poses(q)
    columns = loaded.space.robot_slices
    robots = loaded.compiled.assembly.robots
    expected = [r.kinematics.forward(q[:, c]) for r, c in zip(robots, columns, strict=True)]
    assert np.allclose(poses, np.concatenate(expected, axis=1), rtol=0, atol=1e-9 * loaded.extent)
    for row, verdict in zip(q, loaded.in_collision(q), strict=True):
        assert not truth.wrong(row, bool(verdict), 1e-5 * loaded.extent)


@settings(max_examples=25, deadline=None)
@given(solid=solids())
def test_mass_is_density_times_volume(tmp_path_factory: pytest.TempPathFactory, solid: Solid) -> None:
    folder = tmp_path_factory.mktemp("scene")
    (folder / "solid.g").write_text(mesh_text(solid, Random(0), "g"))
    (folder / "scene.env").write_text(
        "Boundary Box [-9:9 ; -9:9 ; -9:9]\nMultibodies\n1\nActive\n1\nsolid.g Volumetric Rotational\nConnections\n0\n"
    )
    scene = env2mjcf.load(folder / "scene.env", engine="mujoco", cache=False, density=700.0)
    assert scene.model.body_mass.sum() == pytest.approx(700.0 * solid.volume, rel=1e-6)
