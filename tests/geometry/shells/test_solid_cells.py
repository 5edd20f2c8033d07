"""Shells: where the cells of a closed non-convex mesh lie, and what they cover."""

from __future__ import annotations

import time
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from meshes import box, channel, corpus_meshes, joined, moved, rotation, turned, voxels
from scenes import MODELS
from solids import (
    CORPUS_MESHES,
    MESHES,
    MODEL_MESHES,
    PIN,
    area_of,
    assert_inside_and_covering,
    bumpy,
    crossing_prism,
    height,
    lined,
    loaded,
    of_trimesh,
    protrusion,
    shelled,
    thin_bottom,
)

from env2mjcf.diagnostics import CATALOGUE, DiagnosticLog
from env2mjcf.geometry.mesh import Mesh
from env2mjcf.geometry.orientation import winding_numbers
from env2mjcf.geometry.pieces import ConvexPiece, hull_volume
from env2mjcf.geometry.repair import repaired
from env2mjcf.geometry.shapes import CollisionShape, collision_shape
from env2mjcf.geometry.shells import shells

LIP = 1e-4  # of the diagonal deep


@pytest.mark.parametrize("name", MESHES)
def test_cells_stay_inside_and_cover_the_surface(name: str) -> None:
    thin = name == "thinner than a pin"
    assert_inside_and_covering(MESHES[name], pinned=4 if thin else 0)


@pytest.mark.parametrize(
    "mesh",
    [
        *(crossing_prism(seed) for seed in range(4)),
        of_trimesh("spindle", trimesh.creation.torus(0.3, 1.0, 16, 12)),
        joined(box((4, 4, 4)), turned(box((2, 2, 2), (1, 0, 0)))),
    ],
    ids=["crossing 0", "crossing 1", "crossing 2", "crossing 3", "spindle", "cavity at the surface"],
)
def test_a_surface_that_crosses_or_touches_itself_has_no_cell_outside(mesh: Mesh) -> None:
    """Where no cell has room, or none is right, thin prisms stand on the surface."""
    shape, pieces = lined(mesh)
    a = shape.analysis
    cells = [p for p in pieces if height(shape, p) > 1.5 * PIN * a.diagonal]
    assert sorted(f for faces in {p.polygon.faces for p in pieces} for f in faces) == list(range(len(a.faces)))
    points = np.concatenate([p.center + 0.999 * p.vertices for p in cells])
    assert (np.abs(winding_numbers(points, a.vertices, a.faces)) > 0.5).all()
    assert_compiles(shape)


@pytest.mark.slow_but("bug.g", "bent")
@pytest.mark.parametrize("name", MODEL_MESHES)
def test_cells_of_model_meshes_stay_inside_and_cover_the_surface(name: str) -> None:
    assert_inside_and_covering(loaded(MODELS / name))


@pytest.mark.slow
@pytest.mark.parametrize("name", CORPUS_MESHES)
def test_cells_of_real_meshes_stay_inside_and_cover_the_surface(corpus: Path, name: str) -> None:
    mesh = next(m for m in corpus_meshes(corpus) if m.path.name == name)
    shape, _ = lined(mesh)
    if shape.strategy == "hull":
        # Of convex pieces each is one hull.
        assert len(shape.pieces) == shape.analysis.components
        return
    # Folds of this one's caps reach beyond the solid: two sheets with two sides.
    assert_inside_and_covering(mesh, pinned=4 if name == "S2Dharder1.obj" else 0)


def test_the_protrusion_test_sees_a_cell_that_sticks_out() -> None:
    shape, pieces = lined(channel())
    moved_out = ConvexPiece(pieces[0].vertices, pieces[0].center + 1e-6 * pieces[0].polygon.normal, pieces[0].polygon)
    assert protrusion(shape, [moved_out]) > 1e-8


def volumes_by_normal(mesh: Mesh) -> dict[tuple[float, ...], list[float]]:
    _, pieces = lined(mesh)
    volumes: dict[tuple[float, ...], list[float]] = {}
    for p in pieces:
        volumes.setdefault(tuple(np.round(p.polygon.normal, 9) + 0.0), []).append(hull_volume(p.vertices))
    return volumes


def test_cells_go_straight_down_at_right_and_reflex_edges() -> None:
    """Slabs, which overlap at the corners of the channel as its walls do.

    Below rims and pit they are as deep as those are wide, under the bottom as deep as halfway to the pit.
    """
    volumes = volumes_by_normal(channel())
    assert volumes[0, 0, -1] == [pytest.approx(12 * 0.5, rel=1e-5)]
    assert volumes[0, 0, 1] == pytest.approx([4 * 1.0] * 3, rel=1e-5)


@pytest.mark.parametrize("width", [4, 2], ids=["acute", "obtuse"])
def test_cells_fill_the_wedges_at_convex_edges(width: float) -> None:
    """A trough of which the long sides lean by 45 degrees: the cell under its bottom, w wide, ends at their planes."""
    lean = (width - 3) / 1  # the rim is 3 apart, one above the bottom
    section = np.array([[0, 0.9], [-1.5, 1], [-width / 2, 0], [width / 2, 0], [1.5, 1]])  # y, z; seen from the first
    n = len(section)
    corners = np.vstack([np.column_stack([np.full(n, x), section]) for x in (0.0, 5.0)])
    cap = np.array([[0, i, i + 1] for i in range(1, n - 1)])
    sides = [f for i in range(n) for j in [(i + 1) % n] for f in ([i, j, j + n], [i, j + n, i + n])]
    mesh = Mesh.from_arrays("trough", corners, np.vstack([cap[:, ::-1], cap + n, sides]))
    h = 0.9 / 2  # halfway to the dent in the top
    assert volumes_by_normal(mesh)[0, 0, -1] == [pytest.approx(5 * (width * h - lean * h**2 / 2), rel=1e-5)]


def test_cells_go_straight_down_at_blunt_edges_but_for_a_lip() -> None:
    """A drum of 24 sides, 165 degrees to each other, with a groove around: each side is a slab as deep as wide.

    Lips in the planes of the neighbours widen it at both edges, and it narrows again towards the bottom.
    """
    outline = [(1.0, 0.0), (1.0, 1.0), (0.8, 1.0), (0.8, 1.4), (1.0, 1.4), (1.0, 2.4)]  # radius, height
    drum = trimesh.creation.revolve([(0, 0), *outline, (0, 2.4)], sections=24)
    volumes = volumes_by_normal(of_trimesh("drum", drum))
    side, lip = 2 * np.sin(np.pi / 24), LIP * np.linalg.norm(np.ptp(drum.vertices, axis=0)) / np.tan(np.pi / 12)
    sides = sorted(v for normal, found in volumes.items() if normal[2] == 0 for v in found)
    assert sides[24:] == pytest.approx([(side + lip) * side] * 48, rel=1e-5)  # the least are those in the groove


@pytest.mark.parametrize("name", ["channel", "torus", "spiky", "star", "thin bottom"])
def test_the_volume_of_the_cells_is_that_of_their_hulls(name: str) -> None:
    mesh = MESHES[name]
    result = shelled(mesh)
    cells = [p for p in result.pieces if np.ptp(p.vertices @ p.polygon.normal) > 1.5 * PIN * mesh.diagonal]
    assert result.volume == pytest.approx(sum(hull_volume(p.vertices) for p in cells), rel=1e-4)


def test_cells_meet_in_the_middle_of_walls() -> None:
    result = shelled(channel())
    assert result.thinnest == pytest.approx(0.5, rel=1e-9)
    assert (result.pinned, result.tilted) == (0, 0)


def test_a_thin_spot_makes_cells_thin_and_not_wrong() -> None:
    result = shelled(thin_bottom(0.01))
    assert result.pinned == 0
    assert 0.004 < result.thinnest <= 0.01


def plate(low: tuple[float, float], across: bool, left: float) -> Mesh:
    """A plate of 4 x 3, 0.4 thick, with a groove or a pit below it that leaves `left` of it over x in `low`."""
    x, z = np.array([0, *low, 4]), np.array([0, 0.4 - left, 0.4])
    y = np.array([0, 3.0]) if across else np.array([0, 1.4, 1.6, 3.0])
    filled = np.ones((3, len(y) - 1, 2), dtype=bool)
    filled[1, len(y) // 2 - 1, 0] = False
    return of_trimesh("plate", voxels([x, y, z], filled))


@pytest.mark.parametrize("across", [True, False], ids=["groove", "pit"])
@pytest.mark.parametrize("turn", [0, 3])
def test_a_large_face_is_thin_at_its_thin_spot_only(across: bool, turn: int) -> None:
    mesh = moved(plate((1.9, 2.1), across, 4e-4), rotation(turn) if turn else np.eye(3))
    assert_inside_and_covering(mesh)
    up = rotation(turn)[:, 2] if turn else np.array([0, 0, 1.0])
    shape, pieces = lined(mesh)
    top = [p for p in pieces if p.polygon.normal @ up > 0.99 and area_of(mesh.vertices[list(p.polygon.loop)]) > 1]
    thick = [p for p in top if height(shape, p) > 0.019 * shape.analysis.diagonal]
    thin = [p for p in top if p not in thick]
    # 3.8 of 4 units of the length are as thick as cells are anywhere; the strip over the groove is as thin as before.
    covered = sum(hull_volume(p.vertices) / height(shape, p) for p in thick)
    assert covered == pytest.approx(3.8 * 3, rel=1e-3)
    assert len(thin) == 1
    assert height(shape, thin[0]) == pytest.approx(2e-4, rel=1e-3)
    assert shelled(mesh).split == 1
    assert "1 polygon split at thin spots" in shape.note


def test_a_face_that_is_thin_all_over_is_not_split() -> None:
    result = shelled(plate((0.1, 3.9), True, 4e-4))
    assert result.split == 0
    assert len(result.pieces) == 14


def test_where_there_is_no_room_a_thin_prism_stands_and_is_counted() -> None:
    """The floor from above and below, and its ends."""
    mesh = thin_bottom(1e-5)
    shape, _ = lined(mesh)
    assert shelled(mesh).pinned == 4
    assert "4 thin prisms where there is no room" in shape.note


def reach_beyond(shape: CollisionShape, piece: ConvexPiece, edge: np.ndarray) -> tuple[float, float]:
    """How far a cell reaches beyond an edge of its face, (2, 3) counter-clockwise; how deep those corners lie."""
    along = edge[1] - edge[0]
    outward = np.cross(along, piece.polygon.normal) / np.linalg.norm(along)
    points = piece.vertices + piece.center - edge[0]
    beyond = points @ outward
    far = beyond > beyond.max() - 1e-9 * shape.analysis.diagonal
    return float(beyond.max()), float(-(points[far] @ piece.polygon.normal).mean())


def assert_lip(shape: CollisionShape, piece: ConvexPiece, edge: np.ndarray, degrees: float = 3.0) -> None:
    reach, depth = reach_beyond(shape, piece, edge)
    assert depth == pytest.approx(LIP * shape.analysis.diagonal, rel=1e-6)
    assert reach == pytest.approx(depth / np.tan(np.radians(degrees)), rel=1e-6)


def corner_block() -> Mesh:
    """Three unit cubes around a corner: their top and bottom are each two polygons or three."""
    filled = np.ones((2, 2, 1), dtype=bool)
    filled[1, 1, 0] = False
    return of_trimesh("corner", voxels([np.arange(3.0), np.arange(3.0), np.arange(2.0)], filled))


@pytest.mark.parametrize("turn", [0, 4])
def test_cells_reach_under_each_other_at_flat_seams_and_nowhere_else(turn: int) -> None:
    """By the angle of three degrees, beyond which MuJoCo would not take the lip's face and the seam's for parallel.

    The larger of two faces at a seam ends at an outer wall further on, so that a lip of its cell would leave the solid.
    """
    mesh = moved(corner_block(), rotation(turn) if turn else np.eye(3))
    assert_inside_and_covering(mesh)
    shape, pieces = lined(mesh)
    of_edge: dict[tuple[int, int], ConvexPiece] = {}
    for piece in pieces:
        loop = piece.polygon.loop
        of_edge |= dict.fromkeys(zip(loop, loop[1:] + loop[:1], strict=True), piece)
    vertices = shape.analysis.vertices
    seams = [e for e, p in of_edge.items() if p.polygon.normal @ of_edge[e[::-1]].polygon.normal > 0.99]
    small = [e for e in seams if area_of(vertices[list(of_edge[e].polygon.loop)]) < 1.5]
    assert (len(seams), len(small)) == (4, 2)
    for edge in seams:
        if edge in small:
            assert_lip(shape, of_edge[edge], vertices[list(edge)])
        else:
            assert reach_beyond(shape, of_edge[edge], vertices[list(edge)])[0] < 1e-9


@pytest.mark.parametrize(("sections", "degrees"), [(24, 15), (36, 10), (72, 5), (180, 3)])
def test_lips_lie_in_the_neighbours_plane_at_blunt_edges(sections: int, degrees: float) -> None:
    """Of a drum with a groove around it; its edges fold by 360 degrees over the number of sides."""
    outline = [(1.0, 0.0), (1.0, 1.0), (0.8, 1.0), (0.8, 1.4), (1.0, 1.4), (1.0, 2.4)]  # radius, height
    mesh = of_trimesh("drum", trimesh.creation.revolve([(0, 0), *outline, (0, 2.4)], sections=sections))
    shape, pieces = lined(mesh)
    sides = [p for p in pieces if abs(p.polygon.normal[2]) < 0.5 and np.ptp((p.vertices + p.center)[:, 2]) > 0.9]
    assert len(sides) == 2 * sections
    for piece in sides:
        corners = shape.analysis.vertices[list(piece.polygon.loop)]
        for edge in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            if abs(edge[1][2] - edge[0][2]) > 0.9:
                assert_lip(shape, piece, np.array(edge), degrees)


def test_the_thin_part_of_a_split_polygon_has_lips() -> None:
    """Under the thick ones beside it, of which no lip has room over the groove."""
    mesh = plate((1.9, 2.1), True, 4e-4)
    shape, pieces = lined(mesh)
    thin = [p for p in pieces if p.polygon.normal[2] > 0.99 and height(shape, p) < 1e-3]
    assert len(thin) == 1
    depth = height(shape, thin[0]) / 2  # of half a cell, which is less than lips have elsewhere
    assert depth < LIP * shape.analysis.diagonal
    assert np.ptp(thin[0].vertices[:, 0]) == pytest.approx(0.2 + 2 * depth / np.tan(np.radians(3)), rel=1e-9)


def test_convex_components_stay_one_hull() -> None:
    shape, cells = lined(joined(box((1, 1, 1), (9, 0, 0)), channel(), box((1, 1, 1), (0, 9, 0))))
    assert len(shape.pieces) - len(cells) == 2
    assert shape.note.startswith("2 convex parts as hulls, ")
    assert len(lined(box())[0].pieces) == 1
    two = lined(joined(box(), box(center=(5, 0, 0))))[0]
    assert (two.strategy, len(two.pieces), two.needs_containment) == ("hull", 2, False)


def test_the_note_tells_the_numbers() -> None:
    shape, cells = lined(channel())
    ratio = sum(hull_volume(p.vertices) for p in cells) / 28
    assert shape.note == (
        f"{len(cells)} shell cells, none a thin prism, 0 tilted, thinnest 0.5, {ratio:.3g} times the solid's volume"
    )


def test_an_open_mesh_under_solid_is_a_surface_and_says_so() -> None:
    mesh = Mesh.from_arrays("open", channel().vertices, channel().faces[1:])
    log = DiagnosticLog()
    a = repaired(mesh).analysis
    shape = collision_shape(mesh, a, "solid", PIN * a.diagonal, log)
    assert shape.strategy == "surface"
    assert "the mesh is open and has no inside" in shape.note
    assert [d.code for d in log] == ["GEO243"]
    assert "GEO243" in CATALOGUE
    auto = DiagnosticLog()
    assert collision_shape(mesh, a, "auto", PIN * a.diagonal, auto).strategy == "surface"
    assert len(auto) == 0


@pytest.mark.parametrize("name", MESHES)
def test_every_piece_compiles_in_mujoco(name: str) -> None:
    assert_compiles(lined(MESHES[name])[0])


@pytest.mark.slow
@pytest.mark.parametrize("name", CORPUS_MESHES)
def test_every_piece_of_real_meshes_compiles_in_mujoco(corpus: Path, name: str) -> None:
    assert_compiles(lined(next(m for m in corpus_meshes(corpus) if m.path.name == name))[0])


def assert_compiles(shape: CollisionShape) -> None:
    spec = mujoco.MjSpec()
    for i, piece in enumerate(shape.pieces):
        spec.add_mesh(name=f"m{i}", uservert=piece.vertices.ravel(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"m{i}", pos=piece.center)
    model = spec.compile()
    assert model.ngeom == len(shape.pieces)


def test_pieces_are_small_about_their_own_centres() -> None:
    """MuJoCo keeps vertices as float32, so a piece must not carry its place in them."""
    shape, cells = lined(moved(channel(), rotation(1), (1e5, 1e5, 1e5)))
    for piece in cells:
        assert np.abs(piece.vertices.mean(axis=0)).max() < 1e-9 * shape.analysis.diagonal
        assert np.abs(piece.vertices).max() < shape.analysis.diagonal


def test_the_same_mesh_gives_the_same_bytes() -> None:
    one, two = (shelled(bumpy(2, 0.4)) for _ in range(2))
    for p, q in zip(one.pieces, two.pieces, strict=True):
        assert p.vertices.tobytes() == q.vertices.tobytes()
        assert p.center.tobytes() == q.center.tobytes()


@pytest.mark.slow
def test_five_thousand_triangles_take_a_few_seconds() -> None:
    mesh = bumpy(4, 0.05)
    assert len(mesh.faces) == 5120
    analysis = repaired(mesh).analysis
    began = time.process_time()
    shells(analysis, np.arange(len(analysis.faces)), PIN * analysis.diagonal)
    assert time.process_time() - began < 5
