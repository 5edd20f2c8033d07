"""Paths and roadmaps that the original planner recorded, against its own other files and against our verdicts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import env2mjcf
from env2mjcf import Roadmap, Scene
from env2mjcf.companions.roadmaps import ways_between
from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.simulation.edge_verdicts import Edges, EdgeVerdicts

FOLDERS = {"2loop_13con": "old-2loop.2loop_13con", "branchs": "old-testBranchs.branchs",
           "serial": "old-testSerialInWall.serial"}  # fmt: skip


@pytest.fixture(scope="module")
def scenes(corpus: Path) -> dict[str, Scene]:
    walls = corpus / "scenes" / FOLDERS["serial"]  # 2loop came without the walls that both stand between
    return {
        name: env2mjcf.load(corpus / "scenes" / folder / f"{name}.env", mesh_dirs=[walls])
        for name, folder in FOLDERS.items()
    }


def beside(scene: Scene, name: str) -> Path:
    return Path(scene.environment.path).parent / name


def steps(scene: Scene, file: str) -> Edges:
    q = env2mjcf.read_path(scene, beside(scene, file)).q
    ends = np.stack([np.arange(len(q) - 1), np.arange(1, len(q))], axis=1)
    return Edges(q, ends, (), [f"{i} to {j}" for i, j in ends])


def roadmap(scene: Scene, name: str) -> tuple[Roadmap, Edges]:
    found = env2mjcf.read_roadmap(scene, beside(scene, f"{name}.map"))
    assert not found.diagnostics
    return found, Edges(found.q, found.edges, ways_between(scene, found, DiagnosticLog()), [""] * len(found.edges))


def test_recorded_poses_are_the_configurations_that_they_were_printed_from(scenes: dict[str, Scene]) -> None:
    """prm.path holds poses of 12 links, prm.path.cfg the configurations, both printed by the planner."""
    scene = scenes["2loop_13con"]
    found = env2mjcf.read_path(scene, beside(scene, "prm.path"))
    assert not found.diagnostics
    assert found.q.shape == (300, 19)
    assert found.pose_error < 5e-6  # printed with six decimals
    cfg = scene.space.decode(np.loadtxt(beside(scene, "prm.path.cfg")))  # printed with six digits
    apart = scene.link_poses(found.q) - scene.link_poses(cfg)
    assert np.abs(apart).max() < 6e-5
    # The joints that close the loops, which place nothing, are recovered, too. The base has other angles of the turn.
    assert np.abs(scene.space.difference(found.q, cfg)[:, 6:]).max() < 1e-4


def test_every_recorded_pose_belongs_to_a_configuration(scenes: dict[str, Scene]) -> None:
    scene = scenes["2loop_13con"]
    old = env2mjcf.read_path(scene, beside(scene, "2loop_13con.old.path"))
    new = env2mjcf.read_path(scene, beside(scene, "2loop_13con.path"))
    # Two files of one version: the one with poses, the other with configurations.
    assert (len(old), len(new), old.version, new.version) == (366, 364, 20001022, 20001022)
    assert (old.poses is None, new.poses is None) == (False, True)
    assert old.fits.all()
    assert old.pose_error < 5e-6
    start = scene.link_poses(old.q[0]) - scene.link_poses(new.q[0])
    assert np.abs(start).max() < 6e-5


@pytest.mark.parametrize("name", FOLDERS)
def test_a_roadmap_has_as_many_nodes_and_edges_as_it_declares(scenes: dict[str, Scene], name: str) -> None:
    found, _ = roadmap(scenes[name], name)
    expected = {"2loop_13con": (300, 281), "branchs": (219, 208), "serial": (89, 78)}[name]
    assert (len(found), len(found.edges)) == expected
    assert found.header.environment == f"{name}.env"
    assert found.header.version == "061300"
    surface = {"branchs": "surface.path", "serial": "surface.path", "2loop_13con": "prm.path.cfg"}[name]
    if name != "2loop_13con":
        nodes = env2mjcf.read_path(scenes[name], beside(scenes[name], surface)).q
        assert np.abs(nodes - found.q).max() < 1e-4  # the same nodes, printed with other digits


def test_the_recorded_path_of_serial_is_free_and_proved_free(scenes: dict[str, Scene]) -> None:
    scene = scenes["serial"]
    judge = EdgeVerdicts(scene, steps(scene, "serial.path"), certified=True)
    assert (len(judge.valid), judge.valid.all()) == (512, True)


def test_the_recorded_path_of_branchs_grazes_the_block_once(scenes: dict[str, Scene]) -> None:
    """Free at the steps that it was planned in; in steps of a centimetre, 1e-4 of the extent, one edge of 308 is not.

    It goes 3.3 mm into the block of a scene 85 m long: the planner stepped over that.
    """
    scene = scenes["branchs"]
    edges = steps(scene, "branchs.path")
    assert EdgeVerdicts(scene, edges).valid.all()
    found = EdgeVerdicts(scene, edges, certified=True)
    assert np.flatnonzero(~found.valid).tolist() == [166]
    fine = EdgeVerdicts(scene, Edges(edges.q, edges.ends[166:167], (), ["166"]), resolution=0.01).verdict(0)
    assert fine.at is not None
    assert [(c.link, c.other) for c in fine.at.contacts] == [("link1", "block")]
    assert -0.01 < fine.at.contacts[0].distance < 0


def test_the_roadmap_of_serial_is_free_the_way_that_its_local_planners_went(scenes: dict[str, Scene]) -> None:
    """76 edges are straight; 2 turn half way, and collide if they are taken as straight."""
    found, edges = roadmap(scenes["serial"], "serial")
    assert np.bincount(found.planners).tolist() == [0, 76, 2]
    assert EdgeVerdicts(scenes["serial"], edges, resolution=0.02).valid.all()
    straight = EdgeVerdicts(scenes["serial"], Edges(found.q, found.edges, (), edges.labels), resolution=0.02)
    assert straight.valid.tolist() == (found.planners == 1).tolist()


def test_the_roadmap_of_branchs_is_free_but_for_grazes(scenes: dict[str, Scene]) -> None:
    """10 edges turn half way, and all collide if they are taken as straight; 8 of them are free as they were made.

    The other two, and 4 of the 198 straight ones, graze the block or the robot itself by less than 5e-4 of the extent:
    nodes lie on surfaces, and are printed with six digits.
    """
    scene = scenes["branchs"]
    found, edges = roadmap(scene, "branchs")
    assert np.bincount(found.planners).tolist() == [0, 198, 10]
    straight = EdgeVerdicts(scene, Edges(found.q, found.edges, (), edges.labels))
    assert not straight.valid[found.planners == 2].any()
    judge = EdgeVerdicts(scene, edges)
    assert np.bincount(found.planners[judge.valid]).tolist() == [0, 194, 8]
    for i in np.flatnonzero(~judge.valid):
        at = judge.verdict(int(i)).at
        assert at is not None
        assert min(c.distance for c in at.contacts) > -5e-4 * scene.extent


def test_links_that_hang_on_one_link_overlap_in_2loop(scenes: dict[str, Scene]) -> None:
    """Nothing else touches, anywhere in its roadmap: the planner cannot have tested links two connections apart."""
    scene = scenes["2loop_13con"]
    nodes = env2mjcf.read_roadmap(scene, beside(scene, "2loop_13con.map")).q
    assert scene.in_collision(nodes).all()
    touching = {(c.link, c.other) for q in nodes[:40] for c in scene.contacts(q)}
    assert touching == {("link1_3", "link1_8"), ("link1_4", "link1_12")}


@pytest.mark.parametrize("name", FOLDERS)
def test_what_is_written_is_what_was_read(scenes: dict[str, Scene], tmp_path: Path, name: str) -> None:
    scene = scenes[name]
    path = env2mjcf.read_path(scene, beside(scene, f"{name}.path"))
    np.testing.assert_array_equal(
        env2mjcf.read_path(scene, env2mjcf.write_path(scene, path.q, tmp_path / "x")).q, path.q
    )
    found, _ = roadmap(scene, name)
    again = env2mjcf.read_roadmap(scene, env2mjcf.write_roadmap(scene, found, tmp_path / "x.map"))
    for field in ("q", "edges", "weights", "vids"):
        np.testing.assert_array_equal(getattr(again, field), getattr(found, field))
