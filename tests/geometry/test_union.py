"""What pieces that overlap, or lie in each other, fill together."""

from __future__ import annotations

from itertools import permutations, product
from pathlib import Path

import numpy as np
import pytest
from extras import needs
from meshes import box, channel, joined, moved, rotation, turned
from scenes import free_cube, write_scene

import env2mjcf
from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.geometry import union as module
from env2mjcf.geometry.analysis import analyse
from env2mjcf.geometry.inertia import inertial
from env2mjcf.geometry.mesh import Mesh
from env2mjcf.geometry.orientation import winding_numbers
from env2mjcf.geometry.repair import repaired
from env2mjcf.geometry.union import Union, available, union, union_diagnostics

BIG = box((4, 4, 4))


def of(*meshes: Mesh) -> Union:
    return union(analyse(joined(*meshes)))


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without manifold3d."""
    monkeypatch.setattr(module, "available", lambda: False)


@pytest.mark.usefixtures("alone")
@pytest.mark.parametrize(
    ("inner", "volume", "left_out"),
    [
        ([box((3, 3, 3))], 64, 1),
        ([turned(box((2, 2, 2)))], 64 - 8, 0),
        ([turned(box((3, 3, 3))), box((1, 1, 1))], 64 - 27 + 1, 0),
        # What is hollow in a solid is filled by that solid.
        ([box((3, 3, 3)), turned(box((2, 2, 2)))], 64, 2),
        ([box((3, 3, 3)), box((2, 2, 2)), box((1, 1, 1))], 64, 3),
        ([box((3, 3, 3)), box((1, 1, 1), (9, 0, 0))], 65, 1),
    ],
)
def test_what_lies_in_a_solid_is_left_out(inner: list[Mesh], volume: float, left_out: int) -> None:
    for seed in range(3):
        turn = rotation(seed) * 10.0 ** (2 - 2 * seed)
        found = of(*(moved(m, turn, (1, 2, 3)) for m in (BIG, *inner)))
        assert found.volume == pytest.approx(volume * 10.0 ** (6 - 6 * seed))
        assert (found.inner, found.united, found.samples) == (left_out, False, 0)


def test_two_cubes_one_in_the_other_weigh_as_much_as_the_larger() -> None:
    mesh = joined(BIG, box((3, 3, 3), (0.2, 0.1, 0)))
    found, expected = inertial(mesh, analyse(mesh), 1.0), inertial(BIG, analyse(BIG), 1.0)
    assert found.mass == pytest.approx(64)
    np.testing.assert_allclose(found.com, 0, atol=1e-12)
    np.testing.assert_allclose(found.diagonal, expected.diagonal)


@needs("solids")
@pytest.mark.parametrize("seed", range(4))
def test_boxes_that_cross_are_united(seed: int) -> None:
    turn, shift = rotation(seed) * 3, (10, -20, 5)
    mesh = joined(moved(BIG, turn, shift), moved(box((4, 4, 4), (2, 0, 0)), turn, shift))
    expected = inertial(moved(box((6, 4, 4), (1, 0, 0)), turn, shift), analyse(moved(box((6, 4, 4)), turn)), 1.0)
    found = inertial(mesh, analyse(mesh), 1.0)
    assert of(BIG, box((4, 4, 4), (2, 0, 0))).united
    assert found.mass == pytest.approx(96 * 27) == pytest.approx(expected.mass)
    np.testing.assert_allclose(np.sort(found.diagonal), np.sort(expected.diagonal), rtol=1e-9)
    np.testing.assert_allclose(found.com, moved(box((6, 4, 4), (1, 0, 0)), turn, shift).vertices.mean(axis=0))


@needs("solids")
def test_hollow_boxes_that_cross_keep_what_is_hollow_in_both() -> None:
    """Boxes of 4 with cavities of 2, half a box apart: each cavity is filled in so far as the other is solid there."""
    hollow = [moved(m, np.eye(3), (2, 0, 0)) for m in (BIG, turned(box((2, 2, 2))))]
    found = of(BIG, turned(box((2, 2, 2))), *hollow)
    # The cavities span x from -1 to 1 and from 1 to 3; the others' solids reach from 0 to 1, and from 1 to 2, in them.
    assert found.volume == pytest.approx(96 - 4 - 4)


@needs("solids")
def test_the_same_bytes_come_out_every_time() -> None:
    mesh = joined(*(moved(m, rotation(i), (i, 1, 0)) for i, m in enumerate((channel(), channel(), box((3, 3, 3))))))
    each = [inertial(mesh, analyse(mesh), 1.0) for _ in range(3)]
    assert len({(i.mass, i.com.tobytes(), i.quat.tobytes(), i.diagonal.tobytes()) for i in each}) == 1


@pytest.mark.usefixtures("alone")
@pytest.mark.parametrize("seed", range(3))
def test_without_manifold3d_both_figures_are_told(seed: int) -> None:
    turn = rotation(seed)
    found = of(moved(BIG, turn), moved(box((4, 4, 4), (2, 1, 0)), turn))
    assert found.total == pytest.approx(128)
    assert found.volume == pytest.approx(128 - 2 * 3 * 4, rel=0.02)
    assert not found.united
    log = DiagnosticLog()
    union_diagnostics(found, log, "m")
    (only,) = log
    assert only.code == "GEO246"
    assert "add up to 128, their union has about 10" in only.message
    assert "env2mjcf[solids]" in only.hint


@pytest.mark.parametrize("shift", [(4, 0, 0), (4, 4, 0), (4, 4, 4)])
def test_boxes_that_merely_touch_are_left_alone(shift: tuple[float, ...]) -> None:
    """And channels whose boxes overlap, which touch along a wall."""
    for meshes in ((BIG, box((4, 4, 4), shift)), (channel(), moved(box((1, 1, 1)), np.eye(3), (2, 1.5, 1.5)))):
        found = of(*meshes)
        assert found.volume == pytest.approx(found.total)
        assert (found.inner, found.united, found.samples) == (0, False, 0)


def test_a_scene_says_what_its_bodies_weigh(tmp_path: Path) -> None:
    def body(*meshes: Mesh) -> str:
        m = joined(*meshes)
        lines = [f"1 {len(m.vertices)} {len(m.faces)} {m.faces.size}", f"1 {len(m.faces)}"]
        lines += [" ".join(map(repr, v)) for v in m.vertices.tolist()]
        return "\n".join([*lines, *(f"{a} {b} {-c}" for a, b, c in m.faces + 1), ""])

    nested = body(BIG, box((3, 3, 3)))
    robot = "1\nnested.g Volumetric Rotational\nConnections\n0\n"
    # An obstacle does not move, and weighs nothing.
    path = write_scene(tmp_path, free_cube("nested.g 20 0 0 0 0 0", robot=robot), nested=nested)
    scene = env2mjcf.load(path, density=2.0)
    assert scene.report.mass == pytest.approx(128)
    (found,) = (d for d in scene.diagnostics if d.code == "GEO245")
    assert "add up to 91, their union has 64" in found.message
    (mesh,) = scene.report.meshes
    assert (mesh.solids, mesh.sheets, mesh.cells) == (2, 0, 2)


@pytest.mark.parametrize("signs", list(product((1, -1), repeat=3)))
def test_three_nested_boxes_fill_what_winding_says_whichever_way_each_is_wound(signs: tuple[int, ...]) -> None:
    """What is wound against the box around it is a cavity in it; in a cavity there can only be a solid."""
    boxes = [b if s > 0 else turned(b) for b, s in zip([box((n,) * 3) for n in (6, 4, 2)], signs, strict=True)]
    expected = 6**3 if signs[0] == signs[1] else 6**3 - 4**3 + 2**3
    for order in permutations(boxes):
        mesh = moved(joined(*order), rotation(1))
        a = repaired(mesh).analysis
        assert union(a).volume == pytest.approx(expected)
        assert inertial(mesh, a, 1.0).mass == pytest.approx(expected)
        probes = np.array([[0, 0, 0], [1.5, 0, 0], [2.5, 0, 0]]) @ rotation(1).T
        filled = np.abs(winding_numbers(probes, a.vertices, a.enclosing)) > 0.5
        assert filled @ [8, 64 - 8, 216 - 64] == expected


@pytest.mark.parametrize("extra", [True, False])
def test_boxes_that_touch_in_single_precision_do_not_overlap(extra: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rounding lets them overlap by 1e-7 or so, which is no finding."""
    monkeypatch.setattr(module, "available", lambda: extra and available())
    walls = [box((1, 3, 2), (i, 0.3 * i, 0.2 * i)) for i in range(8)]
    mesh = moved(joined(*walls), rotation(2), (30, 40, 50))
    rounded = Mesh.from_arrays("m", mesh.vertices.astype(np.float32).astype(np.float64), mesh.faces)
    log, found = DiagnosticLog(), union(repaired(rounded).analysis)
    assert found.volume == pytest.approx(8 * 6, rel=1e-5)
    union_diagnostics(found, log, "m")
    assert not list(log)
