"""Meshes as convex pieces: what they claim, whether MuJoCo takes them, whether its verdicts are those of triangles."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from meshes import box, channel, corpus_meshes, grid, joined, moved, rotation, soup, tetrahedron, turned

from env2mjcf.diagnostics import CATALOGUE, DiagnosticLog
from env2mjcf.errors import GeometryError
from env2mjcf.geometry.analysis import analyse
from env2mjcf.geometry.mesh import Mesh
from env2mjcf.geometry.pieces import hull_volume
from env2mjcf.geometry.shapes import CollisionShape, ConvexPiece, collision_shape
from env2mjcf.model.environment import Recentring

SHELL = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
MESH_GEOM = mujoco.mjtGeom.mjGEOM_MESH


def shape_of(mesh: Mesh, strategy: str = "auto", thickness: float = 1e-5) -> CollisionShape:
    return collision_shape(mesh, analyse(mesh), strategy, thickness, DiagnosticLog())  # type: ignore[arg-type]


def add_geoms(spec: mujoco.MjSpec, body: mujoco.MjsBody, pieces: tuple[ConvexPiece, ...], name: str) -> None:
    for i, piece in enumerate(pieces):
        spec.add_mesh(name=f"{name}{i}", uservert=piece.vertices.ravel(), inertia=SHELL)
        body.add_geom(type=MESH_GEOM, meshname=f"{name}{i}", pos=piece.center, mass=0)


def compiled(*pieces: tuple[ConvexPiece, ...]) -> mujoco.MjModel:
    """The first set of pieces is fixed in the world, every other one floats freely."""
    spec = mujoco.MjSpec()
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MULTICCD
    add_geoms(spec, spec.worldbody, pieces[0], "obstacle")
    for k, moving in enumerate(pieces[1:]):
        body = spec.worldbody.add_body()
        body.add_freejoint()
        body.mass, body.inertia, body.explicitinertial = 1, (1, 1, 1), True
        add_geoms(spec, body, moving, f"body{k}:")
    return spec.compile()


def corners(shape: CollisionShape) -> np.ndarray:
    return np.vstack([p.vertices + p.center for p in shape.pieces])


def test_a_convex_mesh_is_one_hull() -> None:
    shape = shape_of(soup(box((1, 2, 3), (4, 5, 6))))
    assert (shape.strategy, len(shape.pieces), shape.needs_containment) == ("hull", 1, False)
    assert shape.note == "convex: one hull"
    np.testing.assert_array_equal(
        np.unique(corners(shape), axis=0), np.unique(box((1, 2, 3), (4, 5, 6)).vertices, axis=0)
    )


def test_a_closed_mesh_that_is_not_convex_is_lined_with_cells_and_has_an_inside() -> None:
    shape = shape_of(channel())
    assert (shape.strategy, len(shape.pieces), shape.needs_containment) == ("solid", 14, True)


def test_the_planners_surface_has_no_inside() -> None:
    for mesh in (box(), channel()):
        shape = shape_of(mesh, "surface")
        assert shape.strategy == "surface"
        assert not shape.needs_containment
    assert len(shape_of(box(), "surface").pieces) == 6


def test_an_open_mesh_is_a_surface_without_an_inside() -> None:
    tray = Mesh.from_arrays("tray", box().vertices, box().faces[2:])
    shape = shape_of(tray)
    assert (shape.strategy, len(shape.pieces), shape.needs_containment) == ("surface", 5, False)


@pytest.mark.parametrize("inside_out", [False, True])
def test_prisms_of_a_solid_stand_inside_of_their_polygons(inside_out: bool) -> None:
    mesh = moved(channel(), rotation(3), (1, 2, 3))
    thickness = 1e-3
    shape = shape_of(turned(mesh) if inside_out else mesh, "surface", thickness)
    local = (corners(shape) - (1, 2, 3)) @ rotation(3)
    assert (local > -1e-12).all()
    assert (local < np.array([4, 3, 3]) + 1e-12).all()
    for piece in shape.pieces:
        assert piece.polygon is not None
        outer = shape.analysis.vertices[list(piece.polygon.loop)]
        height = (piece.vertices + piece.center - outer[0]) @ piece.polygon.normal
        np.testing.assert_allclose(np.sort(height), np.repeat([-thickness, 0], len(height) // 2), atol=1e-12)


def test_prisms_of_a_sheet_stand_on_both_sides() -> None:
    shape = shape_of(grid(4, height=2.0), thickness=0.5)
    assert sum(np.prod(np.ptp(p.vertices, axis=0)) for p in shape.pieces) == pytest.approx(16 * 0.5)
    assert set(np.round(corners(shape)[:, 2], 12)) == {1.75, 2.25}


def test_a_plate_of_mixed_winding_is_one_plate() -> None:
    plate = turned(grid(1), [1])
    assert not analyse(plate).consistent
    assert len(shape_of(plate).pieces) == 1


def test_a_prism_has_no_vertex_where_its_outline_goes_straight_on() -> None:
    shape = shape_of(grid(40))
    assert max(len(p.polygon.loop) for p in shape.pieces if p.polygon) > 40
    assert max(len(p.vertices) for p in shape.pieces) <= 2 * 6


def test_pieces_are_centred_and_read_only() -> None:
    far = moved(channel(), np.eye(3), (1e6, 0, 0))
    for strategy in ("hull", "surface"):
        for piece in shape_of(far, strategy).pieces:
            assert np.abs(piece.vertices).max() < 4
            assert not piece.vertices.flags.writeable
            assert not piece.center.flags.writeable


def test_the_hull_of_a_channel_claims_its_groove() -> None:
    log = DiagnosticLog()
    shape = collision_shape(channel(), analyse(channel()), "hull", 1e-5, log, "u.obj")
    # The groove is 2 of the 9 of the section's hull.
    assert "claims 0.286 times its volume more" in shape.note
    assert [(d.code, d.subject) for d in log] == [("GEO240", "u.obj")]
    assert not shape.needs_containment


def test_the_hull_of_a_convex_mesh_is_no_finding() -> None:
    log = DiagnosticLog()
    collision_shape(box(), analyse(box()), "hull", 1e-5, log)
    assert len(log) == 0


@pytest.mark.parametrize(("mesh", "volume"), [(box((1, 2, 3)), 6.0), (tetrahedron(), 1 / 6), (channel(), 36.0)])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_hull_volumes_are_those_of_algebra(mesh: Mesh, volume: float, scale: float) -> None:
    assert hull_volume(mesh.vertices * scale + 100 * scale) == pytest.approx(volume * scale**3, rel=1e-5)


def test_a_flat_hull_is_a_slab_about_the_plane() -> None:
    turn = rotation(5)
    shape = shape_of(moved(grid(3), turn, (1, 2, 3)), "hull", thickness=0.01)
    local = (corners(shape) - (1, 2, 3)) @ turn
    np.testing.assert_allclose(np.unique(np.round(local[:, 2], 9)), (-0.005, 0.005))
    np.testing.assert_allclose((local[:, :2].min(), local[:, :2].max()), (0, 3), atol=1e-12)
    assert compiled(shape.pieces).nmesh == 1


@pytest.mark.parametrize("strategy", ["auto", "hull", "surface"])
def test_a_line_is_refused(strategy: str) -> None:
    line = Mesh.from_arrays("line", [[0, 0, 0], [1, 1, 1], [2, 2, 2]], [[0, 1, 2]])
    with pytest.raises(GeometryError) as error:
        shape_of(line, strategy)
    assert error.value.code == "GEO231"


@pytest.mark.parametrize("thickness", [0.0, -1.0, float("nan"), float("inf")])
def test_a_thickness_is_a_positive_length(thickness: float) -> None:
    with pytest.raises(ValueError, match="thickness"):
        shape_of(box(), "surface", thickness)


def test_convex_parts_of_a_mesh_stay_hulls() -> None:
    mesh = joined(box((1, 1, 1), (-5, 0, 0)), channel(), turned(moved(tetrahedron(), np.eye(3), (0, 9, 0))))
    shape = shape_of(mesh)
    assert (len(shape.pieces), shape.needs_containment, shape.strategy) == (2 + 14, True, "solid")
    assert shape.note.startswith("2 convex parts as hulls")
    boxes = shape_of(joined(box(), box((1, 1, 1), (0.5, 0, 0))))
    assert (len(boxes.pieces), boxes.needs_containment, boxes.strategy) == (2, False, "hull")


def test_a_convex_part_with_a_cavity_is_no_hull() -> None:
    shape = shape_of(joined(box((3, 3, 3)), turned(box()), box((1, 1, 1), (9, 0, 0))))
    assert shape.needs_containment
    assert len(shape.pieces) == 6 + 6 + 1


def test_pieces_too_small_for_mujoco_are_reported() -> None:
    micro = moved(joined(box(), channel()), np.eye(3) * 1e-8)
    log = DiagnosticLog()
    with pytest.raises(GeometryError) as error:
        collision_shape(micro, analyse(micro), "surface", 1e-9, log)
    assert error.value.code == "GEO241"
    speck = joined(moved(tetrahedron(), np.eye(3) * 3e-8), channel(1e-2))
    shape = collision_shape(speck, analyse(speck), "surface", 3e-8, log)
    assert [d.code for d in log] == ["GEO241"]
    assert all(d.code in CATALOGUE for d in log)
    assert shape.omitted_length == pytest.approx(np.sqrt(3) * 3e-8)
    assert shape.omitted_area == pytest.approx((1.5 + np.sqrt(3) / 2) * 9e-16, rel=1e-6)
    assert compiled(shape.pieces).nmesh == 14
    # What is longer than verdicts may be off would leave a hole in them.
    with pytest.raises(GeometryError, match=r"up to 5\.2e-08 m long"):
        collision_shape(speck, analyse(speck), "surface", 2e-8, DiagnosticLog())


SIZES = (1.0, 100.0)  # a mesh that is the whole scene, and one in a scene a hundred times as large


def sliver(width: float, length: float, scale: float) -> Mesh:
    """A narrow triangle beside one that fixes the size of the mesh."""
    points = np.array([[0, 0, 0], [length, 0, 0], [length / 3, width, 0], [2, 0, 0], [3, 0, 0], [2, 0.5, 0.3]])
    return moved(Mesh.from_arrays("sliver", points * scale, [[0, 1, 2], [3, 4, 5]]), rotation(7), (scale, 2, 3))


@pytest.mark.parametrize("scene", SIZES)
@pytest.mark.parametrize("scale", [1e-2, 1.0, 1e3])
@pytest.mark.parametrize(("width", "length"), [(3e-8, 1.0), (1e-6, 1.0), (1e-4, 1.0), (1e-7, 1e-7), (1e-5, 1e-4)])
def test_mujoco_takes_slivers_and_none_leaves_its_place(
    width: float, length: float, scale: float, scene: float
) -> None:
    mesh = sliver(width, length, scale)
    thickness = 5e-6 * mesh.diagonal * scene
    shape = shape_of(mesh, "surface", thickness)
    assert len(shape.pieces) == 2
    assert compiled(shape.pieces).nmesh == 2
    triangle = (mesh.vertices[:3] - (scale, 2, 3)) @ rotation(7)
    claimed = (shape.pieces[0].vertices + shape.pieces[0].center - (scale, 2, 3)) @ rotation(7)
    slack = thickness * (1 + 1e-6) + 1e-12 * scale
    assert (claimed > triangle.min(axis=0) - slack).all()
    assert (claimed < triangle.max(axis=0) + slack).all()


@pytest.mark.parametrize("scene", SIZES)
@pytest.mark.parametrize("sides", [(1, 1, 1e-8), (1, 1e-8, 1e-8), (1, 1e-6, 1e-3), (1, 1, 1e-5), (1, 1e-7, 1)])
@pytest.mark.parametrize("strategy", ["auto", "hull", "surface"])
def test_mujoco_takes_thin_boxes(strategy: str, sides: tuple[float, ...], scene: float) -> None:
    mesh = moved(box(sides), rotation(2), (3, 2, 1))
    thickness = 5e-6 * mesh.diagonal * scene
    shape = shape_of(mesh, strategy, thickness)
    assert compiled(shape.pieces).nmesh == len(shape.pieces) == (6 if strategy == "surface" else 1)
    local = (corners(shape) - (3, 2, 1)) @ rotation(2)
    assert (np.abs(local) <= np.array(sides) / 2 + thickness * (1 + 1e-6)).all()


class Verdicts:
    """Two meshes, as prisms in MuJoCo and as triangles in python-fcl."""

    def __init__(self, obstacle: Mesh, robot: Mesh, extent: float) -> None:
        self._fcl = pytest.importorskip("fcl", reason="no python-fcl to compare with")
        self.extent = extent
        shapes = [shape_of(m, "surface", 5e-6 * extent) for m in (obstacle, robot)]
        self.model = compiled(shapes[0].pieces, shapes[1].pieces)
        self.data = mujoco.MjData(self.model)
        self.obstacle, self.robot = self.triangulated(obstacle), self.triangulated(robot)

    def triangulated(self, mesh: Mesh) -> Any:
        model = self._fcl.BVHModel()
        model.beginModel(len(mesh.vertices), len(mesh.faces))
        model.addSubModel(mesh.vertices, mesh.faces)
        model.endModel()
        return self._fcl.CollisionObject(model, self._fcl.Transform())

    def prisms(self, pose: np.ndarray) -> bool:
        self.data.qpos[:] = pose
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)
        return self.data.ncon > 0

    def triangles(self, pose: np.ndarray) -> bool:
        self.robot.setTransform(self._fcl.Transform(pose[3:], pose[:3]))
        fcl = self._fcl
        return fcl.collide(self.obstacle, self.robot, fcl.CollisionRequest(), fcl.CollisionResult()) > 0

    def clearance(self, pose: np.ndarray) -> float:
        self.robot.setTransform(self._fcl.Transform(pose[3:], pose[:3]))
        fcl = self._fcl
        return fcl.distance(self.obstacle, self.robot, fcl.DistanceRequest(), fcl.DistanceResult())

    def shallow(self, pose: np.ndarray, depth: float) -> bool:
        """Whether some translation by `depth` separates the triangles."""
        directions = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z])
        steps = directions / np.linalg.norm(directions, axis=1, keepdims=True) * depth
        return any(not self.triangles(pose + np.concatenate([s, np.zeros(4)])) for s in steps)

    def assert_equal_near_contact(self, center: np.ndarray, radius: float, count: int, seed: int = 0) -> None:
        """Compare at poses found by halving between a free and a colliding one."""
        rng = np.random.default_rng(seed)

        def pose() -> np.ndarray:
            quat = rng.normal(size=4)
            return np.concatenate([center + rng.uniform(-1, 1, 3) * radius, quat / np.linalg.norm(quat)])

        sample = [pose() for _ in range(4 * count)]
        hit = np.array([self.triangles(p) for p in sample])
        assert 0 < hit.sum() < len(hit), "the sample must hold both verdicts"
        compared = [0, 0]
        for _ in range(count):
            free, colliding = (sample[rng.choice(np.flatnonzero(hit == kind))] for kind in (False, True))
            for _ in range(int(rng.integers(0, 22))):
                middle = (free + colliding) / 2
                middle[3:] /= np.linalg.norm(middle[3:])
                free, colliding = (free, middle) if self.triangles(middle) else (middle, colliding)
            assert not self.prisms(free) or self.clearance(free) <= 1e-5 * self.extent
            assert self.prisms(colliding) or self.shallow(colliding, 1e-5 * self.extent)
            compared[0] += not self.prisms(free)
            compared[1] += self.prisms(colliding)
        # Most poses lie outside of the band, so that the comparison says something.
        assert min(compared) > 0.4 * count


@pytest.mark.parametrize("robot", [tetrahedron(), channel(1.0), grid(1)], ids=["tetrahedron", "channel", "sheet"])
def test_prisms_collide_where_triangles_do(robot: Mesh) -> None:
    turn = rotation(4)
    verdicts = Verdicts(moved(channel(), turn, (20, 0, 0)), robot, extent=8.0)
    verdicts.assert_equal_near_contact(turn @ (2, 1.5, 1.5) + (20, 0, 0), radius=3.0, count=150)


def test_a_body_in_the_groove_is_free_of_prisms_but_not_of_the_hull() -> None:
    small = moved(box(), np.eye(3) * 0.5)
    pose = np.array([2, 1.5, 2.2, 1, 0, 0, 0.0])
    verdicts = Verdicts(channel(), small, extent=6.0)
    assert not verdicts.prisms(pose)
    hulls = compiled(shape_of(channel(), "hull").pieces, shape_of(small, "hull").pieces)
    data = mujoco.MjData(hulls)
    data.qpos[:] = pose
    mujoco.mj_forward(hulls, data)
    assert data.ncon > 0


@pytest.mark.slow
@pytest.mark.parametrize("scene", SIZES)
@pytest.mark.parametrize("strategy", ["auto", "hull", "surface"])
def test_mujoco_takes_every_corpus_mesh(corpus: Path, strategy: str, scene: float) -> None:
    for mesh in corpus_meshes(corpus):
        shape = shape_of(mesh, strategy, 5e-6 * mesh.diagonal * scene)
        assert shape.omitted_area == 0, mesh.path
        assert compiled(shape.pieces).nmesh == len(shape.pieces), mesh.path


@pytest.mark.parametrize(
    ("obstacle", "robot"),
    [("wall3", "wall0"), ("alphaobstacle", "alpharobot"), ("trap", "stick-bug"), ("Ztunnel_wsides", "clutter1")],
)
def test_prisms_of_corpus_meshes_collide_where_triangles_do(corpus: Path, obstacle: str, robot: str) -> None:
    named = {m.name: m for m in corpus_meshes(corpus)}
    fixed, moving = named[obstacle], named[robot]
    moving = moving.recentred(Recentring.COM).scaled(0.5 * fixed.diagonal / moving.diagonal)
    middle = (fixed.vertices.min(axis=0) + fixed.vertices.max(axis=0)) / 2
    verdicts = Verdicts(fixed, moving, extent=fixed.diagonal + moving.diagonal)
    verdicts.assert_equal_near_contact(middle, radius=0.5 * fixed.diagonal, count=60)
