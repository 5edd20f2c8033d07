"""Mass, centre of mass and principal moments."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from meshes import box, channel, corpus_meshes, grid, joined, moved, rotation, tetrahedron, turned

from env2mjcf.geometry.analysis import analyse
from env2mjcf.geometry.inertia import Inertial, inertial, principal_axes
from env2mjcf.geometry.mesh import Mesh
from env2mjcf.geometry.union import union


def of(mesh: Mesh, density: float = 1000.0, mass: float | None = None) -> Inertial:
    return inertial(mesh, analyse(mesh), density, mass)


def matrix(i: Inertial) -> np.ndarray:
    """The inertia tensor about the centre of mass, in the mesh's axes."""
    axes = np.empty(9)
    mujoco.mju_quat2Mat(axes, i.quat)
    axes = axes.reshape(3, 3)
    return axes @ np.diag(i.diagonal) @ axes.T


def accepted(i: Inertial) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body()
    body.add_freejoint()
    body.mass, body.ipos, body.iquat, body.inertia = i.mass, i.com, i.quat, i.diagonal
    body.explicitinertial = True
    return spec.compile()


def test_a_box_has_the_moments_of_a_box() -> None:
    i = of(box((1, 2, 3), (4, 5, 6)), density=2.0)
    assert i.mass == pytest.approx(12, rel=1e-13)
    np.testing.assert_allclose(i.com, (4, 5, 6), rtol=1e-13)
    np.testing.assert_allclose(i.diagonal, (13, 10, 5), rtol=1e-12)  # m/12 (b^2 + c^2)
    np.testing.assert_array_equal(i.quat, (1, 0, 0, 0))
    assert i.note == ""


def test_the_corner_of_a_cube_has_the_moments_of_a_tetrahedron() -> None:
    i = of(tetrahedron(), density=6.0)
    assert i.mass == pytest.approx(1)
    np.testing.assert_allclose(i.com, (0.25, 0.25, 0.25), rtol=1e-13)
    # About the right-angled corner: integral of x^2 is m/10, of xy m/20 (Tonon, J. Math. Stat. 1(1), 2005).
    second = np.full((3, 3), 1 / 20) + np.eye(3) / 20 - np.full((3, 3), 1 / 16)
    np.testing.assert_allclose(matrix(i), np.trace(second) * np.eye(3) - second, atol=1e-14)


@pytest.mark.parametrize("seed", range(4))
def test_moments_turn_with_the_body(seed: int) -> None:
    turn = rotation(seed)
    i, turned_round = of(channel()), of(moved(channel(), turn, (9, 8, 7)))
    np.testing.assert_allclose(turned_round.com, turn @ i.com + (9, 8, 7), rtol=1e-12)
    np.testing.assert_allclose(matrix(turned_round), turn @ matrix(i) @ turn.T, rtol=1e-9, atol=1e-6)
    assert np.linalg.norm(turned_round.quat) == pytest.approx(1, abs=1e-15)
    assert turned_round.quat[0] >= 0


def test_a_body_far_away_keeps_its_digits() -> None:
    near, far = of(channel()), of(moved(channel(), np.eye(3), (2.0**20, 0, 0)))
    np.testing.assert_allclose(far.diagonal, near.diagonal, rtol=1e-12)


def test_an_inverted_mesh_weighs_the_same() -> None:
    i, j = of(channel()), of(turned(channel()))
    assert i.mass == pytest.approx(j.mass, rel=1e-14)
    np.testing.assert_allclose(i.diagonal, j.diagonal, rtol=1e-13)
    assert j.note == ""


def test_a_cavity_weighs_nothing() -> None:
    i = of(joined(box((3, 3, 3)), turned(box())), density=1.0)
    assert i.mass == pytest.approx(26)
    np.testing.assert_allclose(i.diagonal, np.full(3, (27 * 18 - 2) / 12), rtol=1e-13)


def test_mujoco_finds_the_same_inertia() -> None:
    mesh = moved(channel(), rotation(6), (1, 2, 3))
    spec = mujoco.MjSpec()
    spec.add_mesh(
        name="m",
        uservert=mesh.vertices.ravel(),
        userface=mesh.faces.ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_EXACT,
    )
    body = spec.worldbody.add_body()
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="m", density=1000)
    model = spec.compile()
    i = of(mesh)
    assert i.mass == pytest.approx(model.body_mass[1], rel=1e-5)
    np.testing.assert_allclose(i.com, model.body_ipos[1], rtol=1e-5)
    np.testing.assert_allclose(np.sort(i.diagonal), np.sort(model.body_inertia[1]), rtol=1e-5)


def test_the_mass_of_the_file_scales_the_moments() -> None:
    i = of(box((1, 2, 3)), mass=24.0)
    assert i.mass == 24
    np.testing.assert_allclose(i.diagonal, (26, 20, 10), rtol=1e-12)


@pytest.mark.parametrize("mass", [0.0, -1.0])
def test_a_mass_that_is_not_positive_is_not_used(mass: float) -> None:
    i = of(box(), mass=mass)
    assert i.mass == pytest.approx(1000)
    assert "not positive" in i.note


def test_a_sheet_is_a_plate_of_a_hundredth_of_its_diagonal() -> None:
    side = 4
    t = 0.01 * side * np.sqrt(2)
    i = of(grid(side), density=100.0)
    assert i.mass == pytest.approx(100 * side**2 * t)
    np.testing.assert_allclose(i.com, (2, 2, 0), atol=1e-13)
    edge, face = (side**2 + t**2) / 12, 2 * side**2 / 12
    np.testing.assert_allclose(i.diagonal, i.mass * np.array([edge, edge, face]), rtol=1e-12)
    np.testing.assert_array_equal(i.quat, (1, 0, 0, 0))
    assert "sheet" in i.note


@pytest.mark.parametrize("mass", [None, 3.0])
def test_an_open_box_is_a_shell(mass: float | None) -> None:
    tray = Mesh.from_arrays("tray", box().vertices, box().faces[:10])
    t = 0.01 * np.sqrt(3)
    i = of(tray, density=1.0, mass=mass)
    assert i.mass == pytest.approx(mass or 5 * t)
    np.testing.assert_allclose(i.com, (0, 0, -0.1), atol=1e-13)
    assert "tray encloses no certain volume" in i.note
    # Five unit plates: each has 1/12 along its sides and t^2/12 across, and stands 1/2 from the middle of the box.
    xx = 3 / 12 + 2 * (1 / 4 + t**2 / 12)
    zz = 4 / 12 + 1 / 4 + t**2 / 12 - 5 * 0.1**2
    np.testing.assert_allclose(i.diagonal, i.mass / 5 * np.array([xx + zz, xx + zz, 2 * xx]), rtol=1e-12)


@pytest.mark.parametrize(
    "sides", [(1, 1, 1e-7), (1, 1e-7, 1e-7), (1e-5, 1e-5, 1e-5), (1e-3, 1e-9, 1e-9), (1e3, 1e3, 1e-3)]
)
def test_mujoco_takes_thin_and_tiny_bodies(sides: tuple[float, ...]) -> None:
    i = of(moved(box(sides), rotation(1)))
    model = accepted(i)
    np.testing.assert_allclose(model.body_inertia[1], i.diagonal, rtol=1e-12)
    a, b, c = np.sort(i.diagonal)
    assert a + b >= c
    if min(sides) < 1e-8 or max(sides) < 1e-4:
        assert "raised" in i.note


def test_a_needle_of_a_sheet_has_three_moments() -> None:
    i = of(Mesh.from_arrays("needle", [[0, 0, 0], [1, 0, 0], [0.5, 1e-6, 0]], [[0, 1, 2]]))
    assert (i.diagonal > 0).all()
    accepted(i)


def test_a_cube_keeps_its_axes() -> None:
    # Subdivided, so that the sums are rounded differently in each direction: no axis may be preferred for it.
    cube = trimesh.creation.box().subdivide().subdivide()
    i = of(Mesh.from_arrays("cube", cube.vertices + np.array([0.1, 0.2, 0.3]), cube.faces))
    np.testing.assert_allclose(i.quat, (1, 0, 0, 0), atol=1e-15)


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([(1, 2, 3), (1, 1, 2), (2, 2, 2), (1, 0, 0), (0, 0, 0)]))
def test_principal_axes_diagonalise(seed: int, values: tuple[float, ...]) -> None:
    turn = rotation(seed)
    m = turn @ np.diag(np.asarray(values, dtype=float)) @ turn.T
    found, axes = principal_axes(m)
    np.testing.assert_allclose(axes @ np.diag(found) @ axes.T, m, atol=1e-12)
    np.testing.assert_allclose(np.sort(found), np.linalg.eigvalsh(m), atol=1e-12)
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-14)
    assert np.linalg.det(axes) == pytest.approx(1)


def test_the_bytes_are_the_same_on_every_run() -> None:
    mesh = moved(channel(), rotation(8))
    one, two = of(mesh), of(mesh)
    assert one.diagonal.tobytes() == two.diagonal.tobytes()
    assert one.quat.tobytes() == two.quat.tobytes()
    assert not np.signbit(one.quat[one.quat == 0]).any()


@pytest.mark.slow
def test_corpus_bodies_agree_with_trimesh_and_compile(corpus: Path) -> None:
    solids = 0
    for mesh in corpus_meshes(corpus):
        i = of(mesh)
        accepted(i)
        a = analyse(mesh)
        # What pieces share counts once here, and twice there.
        if a.solid and union(a).volume == pytest.approx(a.volume, rel=1e-9):
            solids += 1
            # About the body's middle: trimesh integrates from the origin.
            middle = a.vertices.mean(axis=0)
            other = trimesh.triangles.mass_properties(a.vertices[a.faces] - middle, density=1000)
            assert i.mass == pytest.approx(other["mass"], rel=1e-9), mesh.path
            np.testing.assert_allclose(i.com - middle, other["center_mass"], atol=1e-9 * a.diagonal)
            np.testing.assert_allclose(matrix(i), other["inertia"], atol=1e-8 * np.abs(other["inertia"]).max())
            assert i.note == "", mesh.path
    assert solids > 100
