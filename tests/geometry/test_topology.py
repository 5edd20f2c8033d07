"""Edges of triangle lists, and what a mesh keeps of what is computed of it."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import MODELS

import env2mjcf
from env2mjcf.geometry.mesh import Mesh
from env2mjcf.geometry.topology import by_component, edges

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


@pytest.mark.parametrize("seed", range(5))
def test_the_edges_of_turned_faces_are_those_of_the_list_with_the_faces_turned(seed: int) -> None:
    rng = np.random.default_rng(seed)
    faces = np.array([rng.choice(9, 3, replace=False) for _ in range(30)])
    chosen = rng.random(30) < 0.4
    turned, anew = edges(faces).turned(chosen), edges(np.where(chosen[:, None], faces[:, ::-1], faces))
    for name in ("ends", "of_corner", "forward", "faces", "balance"):
        np.testing.assert_array_equal(getattr(turned, name), getattr(anew, name))


def test_neighbours_share_the_edge_that_is_named() -> None:
    table = edges(TETRAHEDRON)
    here, there, edge = table.neighbours()
    assert sorted(edge.tolist()) == list(range(6))
    for first, second, shared in zip(here.tolist(), there.tolist(), edge.tolist(), strict=True):
        ends = {*TETRAHEDRON[first // 3].tolist()} & {*TETRAHEDRON[second // 3].tolist()}
        assert ends == {*table.ends[shared].tolist()}


def test_faces_are_told_apart_by_component() -> None:
    faces = np.array([[0, 1, 2], [3, 4, 5], [2, 1, 0]])
    first, second = by_component(faces, np.array([0, 1, 0]))
    assert first.tolist() == [[0, 1, 2], [2, 1, 0]]
    assert second.tolist() == [[3, 4, 5]]


def test_used_vertices_keep_the_order_of_the_file_and_are_read_only() -> None:
    mesh = Mesh.from_arrays("m", [[9, 9, 9], [0, 0, 1], [8, 8, 8], [1, 0, 0], [0, 1, 0]], [[4, 1, 3]])
    assert mesh.used_vertices.tolist() == [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    assert mesh.diagonal == pytest.approx(3**0.5)
    assert not mesh.used_vertices.flags.writeable
    whole = Mesh.from_arrays("m", np.eye(3), [[2, 1, 0]])
    assert whole.used_vertices is whole.vertices


def test_a_mesh_is_hashed_once() -> None:
    mesh = Mesh.from_arrays("m", np.eye(3), [[2, 1, 0]])
    assert mesh.digest is mesh.digest
    assert mesh.digest == Mesh.from_arrays("another", np.eye(3), [[2, 1, 0]]).digest


def test_the_links_of_a_scene_are_the_bodies_of_all_robots_in_order() -> None:
    scene = env2mjcf.load(MODELS / "seed" / "seed.env")
    assembly = scene.compiled.assembly
    assert [p.name for p in assembly.links] == [name for robot in assembly.robots for name in robot.names]
    assert assembly.parts()[: len(assembly.links)] == assembly.links
