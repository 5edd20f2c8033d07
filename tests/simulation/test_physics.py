"""Balls, arms, stacks and gantries on non-convex meshes, simulated with the settings that the converter writes."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from meshes import table
from scenes import MODELS, box_mesh, write_scene
from simulations import Fall, fall, start

import env2mjcf
from env2mjcf.formats.meshes.byu import export_byu

RADIUS = 0.15


def read_model(path: str) -> str:
    return (MODELS / path).read_text()


def load(folder: Path, *bodies: str, **meshes: str) -> env2mjcf.Scene:
    """A scene of blocks of dialect D, with `collision="auto"`."""
    head = f"Boundary Box [-10:10 ; -10:10 ; -10:10]\n\nMultibodies\n{len(bodies)}\n\n"
    return env2mjcf.load(write_scene(folder, head + "\n\n".join(bodies) + "\n", **meshes), collision="auto")


def maze_scene(folder: Path) -> env2mjcf.Scene:
    """A ball of 320 facets in the walls of the maze, which stand on a floor at z = -0.25."""
    return load(
        folder,
        "Active\n1\nball.g Volumetric Rotational\nConnections\n0",
        f"Passive\nwalls.g {maze_place()} 0 0 0 0",
        "Passive\nfloor.g 0 0 -0.45 0 0 0",
        ball=export_byu(trimesh.creation.icosphere(subdivisions=2, radius=RADIUS)),
        walls=read_model("maze/meshes/maze.g"),
        floor=box_mesh(4.5, 4.5, 0.2),
    )


def maze_place() -> str:
    return " ".join(read_model("maze/maze.env").strip().splitlines()[-1].split()[-6:-4])


@pytest.mark.slow_but("0.0")
@pytest.mark.parametrize(("speed", "seconds"), [(0.0, 10), (2.0, 16), (5.0, 12)])
def test_a_ball_dropped_into_the_maze_stays_in_its_corridor(tmp_path: Path, speed: float, seconds: float) -> None:
    """Thrown, it rolls before it rests: nothing but tipping from facet to facet brakes it."""
    scene = maze_scene(tmp_path)
    start(scene, np.array([0.02, -0.05, 0.1, 0.3, 0.2, 0.1]))
    velocity = np.zeros(6)
    velocity[:2] = speed * np.array([0.8, 0.6])
    seen = fall(scene, velocity, seconds, every=0.025)
    seen.check()
    # Between two samples it goes less than its diameter: had it passed a wall, a sample would be deep in it.
    steps = np.linalg.norm(np.diff(seen.shifted[:, 0], axis=0), axis=1)
    assert steps.max() < 2 * RADIUS
    assert seen.deepest < 0.01
    assert scene.q()[2] == pytest.approx(RADIUS - 0.25, abs=0.01)
    assert scene.contacts(scene.q())


ARM = """Active
4
pedestal.g Fixed 0 0 0 0 0 0
turret.g Joint
upper.g Joint
fore.g Joint
Connections
3
0 1 Revolute
0 0 0.2 0 0 0   0 0 0.14 0   0 0 0 0 0 0
1 2 Revolute
0 -0.28 0 90 0 0   0 0 0 0.6   0.4 0 0 0 0 0
2 3 Revolute
-0.4 0 0 0 0 0   0 0.8 0.12 0.4   0.35 0 0 0 0 0"""


def arm_scene(folder: Path, x: float, turn: float) -> env2mjcf.Scene:
    """An arm of three hinges beside a table, whose top is 0.08 thick and 0.1 above the arm's base."""
    mesh = table(1.4, 1.2, 0.6, 0.08)
    assert mesh.is_watertight
    heights = mesh.vertices @ mesh.face_normals.T - np.einsum("ij,ij->i", mesh.triangles[:, 0], mesh.face_normals)
    assert heights.max() > 0.1, "a convex table"
    z = 0.1 - float(mesh.bounds[1][2])
    return load(
        folder,
        ARM,
        f"Passive\ntable.g {x} 0 {z!r} 0 0 {turn}",
        table=export_byu(mesh),
        **{name: read_model(f"two-robots/meshes/{name}.g") for name in ("pedestal", "turret", "upper", "fore")},
    )


@pytest.mark.slow_but("1.5")
@pytest.mark.parametrize(("x", "turn"), [(1.05, 0.0), (1.5, 11.0)])
def test_an_arm_falls_on_a_table_and_rests_on_it(tmp_path: Path, x: float, turn: float) -> None:
    """It lies on the top with two links, or leans over the edge with one."""
    scene = arm_scene(tmp_path, x, turn)
    start(scene, scene.space.home)
    seen = fall(scene)
    seen.check()
    assert seen.deepest < 0.01
    assert seen.shifted[-1, -1, 2] < -0.5
    contacts = scene.contacts(scene.q())
    assert ("fore", "table") in {(c.link, c.other) for c in contacts}
    # No contact is deeper than its pair, though some triangles meet the table's side at its edge.
    assert min(c.distance for c in contacts) > -0.01 * min(p.mesh.diagonal for p in scene.compiled.assembly.parts())


def stack(folder: Path, crates: list[str], *obstacles: str, **meshes: str) -> Fall:
    active = ["Active\n1\ncrate.g Volumetric Rotational\nConnections\n0"] * len(crates)
    scene = load(folder, *active, *(f"Passive\n{o}" for o in obstacles), **meshes)
    q = np.array([[float(x) for x in c.split()] for c in crates])
    q[:, 3:] = np.radians(q[:, 3:])
    start(scene, q.ravel())
    return fall(scene)


def test_a_stack_of_the_gantrys_crates_stays_on_its_table(tmp_path: Path) -> None:
    """Two crates on one another as in the scene, and a third one across; each half a millimetre above the next."""
    seen = stack(
        tmp_path,
        ["-0.7 0.4 0.4005 0 0 0", "-0.7 0.38 0.601 0 0 15", "-0.68 0.4 0.8015 0 0 60"],
        "table.g 0 0 0.15 0 0 0",
        crate=read_model("gantry/crate.g"),
        table=read_model("gantry/table.g"),
    )
    seen.check()
    assert np.abs(seen.shifted).max() < 0.01 * 0.539


def test_a_stack_of_crates_stays_on_a_table_with_legs(tmp_path: Path) -> None:
    mesh = table(1.0, 0.9, 0.6, 0.08)
    seen = stack(
        tmp_path,
        ["0 0 0.3005 0 0 0", "0.05 0 0.901 0 0 20", "0 0.04 1.5015 0 0 -35"],
        f"table.g 0 0 {-float(mesh.bounds[1][2])!r} 0 0 0",
        crate=read_model("two-robots/meshes/crate.g"),
        table=export_byu(mesh),
    )
    seen.check()
    assert np.abs(seen.shifted).max() < 0.01 * 0.6 * 3**0.5


def test_the_gantry_follows_a_target_of_each_slide_and_the_wrist() -> None:
    scene = env2mjcf.load(
        MODELS / "gantry/gantry.env", query=MODELS / "gantry/gantry.query", actuators="position", collision="auto"
    )
    model, data = scene.model, scene.data
    names = [model.actuator(i).name for i in range(model.nu)]
    assert names == list(scene.space.names)
    # Raised first, to clear the crates; then bridge, trolley, wrist.
    begin, end = scene.queries[0].q
    end[2] = -0.1
    order = (2, 0, 1, 3)
    way = np.array([[end[k] if k in order[:n] else begin[k] for k in range(4)] for n in range(5)])
    assert scene.edge_is_free(way[:-1], way[1:]).all()
    scene.set(begin)
    worst, late = np.zeros(4), []
    while data.time < 20:
        # Each takes four seconds to get there, and the last four are for rest.
        done = np.clip(data.time / 4 - np.argsort(order), 0, 1)
        data.ctrl[:] = scene.space.qpos(begin + (3 - 2 * done) * done**2 * (end - begin))
        mujoco.mj_step(model, data)
        worst = np.maximum(worst, np.abs(scene.q() - scene.space.from_qpos(data.ctrl)))
        if data.time > 18.4:
            late.append(scene.q())
    # The dampers hold it back while it moves; the column's weight pulls it down by a hundredth of its reach of 1.13 m.
    assert (worst < 0.1 * np.abs(end - begin)).all()
    assert np.abs(late[-1] - end)[[0, 1, 3]].max() < 1e-6
    assert late[-1][2] - end[2] == pytest.approx(-0.0113, abs=1e-4)
    assert np.ptp(late, axis=0).max() < 1e-4
    assert not scene.contacts(scene.q())
    assert not data.warning.number.any()
