"""Wavefront `.obj` meshes, and loading by extension."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.errors import GeometryError, Severity
from env2mjcf.formats.meshes.obj import read_obj
from env2mjcf.formats.meshes.text import MeshArrays
from env2mjcf.geometry.mesh import READABLE, load_mesh
from env2mjcf.limits import Limits

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
TETRAHEDRON_FACES = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]


def read(text: str | bytes, strict: bool = False) -> tuple[MeshArrays, DiagnosticLog]:
    log = DiagnosticLog(strict)
    return read_obj(text, "a.obj", log, Limits()), log


def codes(log: DiagnosticLog) -> list[str]:
    return [d.code for d in log]


def as_set(triangles: np.ndarray) -> Counter[bytes]:
    """Triangles as a multiset: by their coordinates, from the least corner on, so that the order stays."""
    rows: list[bytes] = []
    for triangle in triangles + 0.0:
        least = min(range(3), key=lambda k: tuple(triangle[k]))
        rows.append(np.roll(triangle, -least, axis=0).tobytes())
    return Counter(rows)


def test_every_mesh_of_the_corpus_has_the_triangles_that_trimesh_reads(corpus: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    files = sorted(corpus.rglob("*.obj"))
    assert len(files) > 100
    with_polygons = 0
    for file in files:
        text = file.read_text("latin-1")
        (vertices, faces), log = read(text)
        ours = as_set(vertices[faces])
        loaded = trimesh.load_mesh(file, process=False, skip_materials=True)
        theirs = as_set(np.asarray(loaded.triangles))
        # trimesh cuts every polygon as a fan, right or wrong; the rest must be the same.
        corners = [len(line.split()) - 1 for line in text.splitlines() if line.startswith("f ")]
        cut = sum(n - 2 for n in corners if n > 3)
        assert ours.total() == theirs.total() == sum(n - 2 for n in corners), file
        assert (ours & theirs).total() >= ours.total() - cut, file
        with_polygons += cut > 0
        assert set(codes(log)) == ({"GEO220", "GEO222"} if cut else set()), file
    assert with_polygons < 5


def test_every_mesh_of_the_corpus_keeps_its_raw_vertex_list(corpus: Path) -> None:
    for file in sorted(corpus.rglob("*.obj")):
        text = file.read_text("latin-1")
        listed = [[float(x) for x in line.split()[1:4]] for line in text.splitlines() if line.startswith("v ")]
        assert read(text)[0][0].tolist() == listed, file


def test_unused_and_repeated_vertices_stay() -> None:
    (vertices, faces), _ = read("v 9 9 9\nv 0 0 0\nv 1 0 0\nv 1 0 0\nv 0 1 0\nf 2 3 5\n")
    assert vertices.tolist() == [[9, 9, 9], [0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert faces.tolist() == [[1, 2, 4]]


@pytest.mark.parametrize("corner", ["{0}", "{0}/9", "{0}/9/9", "{0}//9", "{0}/9/"])
def test_textures_and_normals_are_not_needed(corner: str) -> None:
    text = re.sub(r"(?m)^f (\d) (\d) (\d)", lambda m: "f " + " ".join(map(corner.format, m.groups())), TETRAHEDRON)
    assert read(text, strict=True)[0][1].tolist() == TETRAHEDRON_FACES


def test_groups_objects_and_missing_materials_make_one_mesh() -> None:
    words = ["mtllib gone.mtl\no one", "vn 0 0 1\nvt 0 0", "g a b\nusemtl red", "s off", "usemtl blue\ng c", "# end"]
    lines = TETRAHEDRON.splitlines()
    text = "\n".join([*words[:2], *lines[:4], words[2], *lines[4:6], words[3], words[4], *lines[6:], words[5]])
    (vertices, faces), log = read(text, strict=True)
    assert len(vertices) == 4
    assert faces.tolist() == TETRAHEDRON_FACES
    assert codes(log) == []


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", "\n\n", " \n\t", " # comment\n", "#comment 7 8\r\n"])
def test_line_ends_blanks_and_comments_do_not_matter(end: str) -> None:
    (vertices, faces), _ = read(TETRAHEDRON.replace("\n", end), strict=True)
    np.testing.assert_array_equal(vertices, np.vstack([np.zeros(3), np.eye(3)]))
    assert faces.tolist() == TETRAHEDRON_FACES


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_a_backslash_continues_a_line(end: str) -> None:
    text = TETRAHEDRON.replace("v 0 0 1", "v 0 \\\n0 1").replace("f 1 2 4", "f 1 \\\n2\\\n 4").replace("\n", end)
    assert read(text, strict=True)[0][1].tolist() == TETRAHEDRON_FACES


def test_weights_and_colours_of_vertices_are_no_coordinates() -> None:
    text = TETRAHEDRON.replace("v 1 0 0", "v 1 0 0 1.0").replace("v 0 1 0", "v 0 1 0 0.5 0.5 0.5")
    np.testing.assert_array_equal(read(text)[0][0], np.vstack([np.zeros(3), np.eye(3)]))


def test_negative_indices_count_back_from_the_face_and_are_reported() -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 1\nf -4 -1 -2\n"
    (_, faces), log = read(text)
    assert faces.tolist() == [[0, 1, 2], [0, 3, 2]]
    assert [(d.code, d.severity, str(d.span)) for d in log] == [("GEO224", Severity.WARNING, "a.obj:4:3")]


def test_polygons_are_cut_and_reported() -> None:
    text = "v 0 0 0\nv 2 1 0\nv 0 2 0\nv 0.5 1 0\nf 1 2 3\nf  1/1 2/2 3/3 4/4\n"
    (_, faces), log = read(text)
    # The notch at corner 4 must be an end of the cut.
    assert {frozenset(f) for f in faces[1:].tolist()} == {frozenset({0, 1, 3}), frozenset({1, 2, 3})}
    assert [(d.code, d.severity, str(d.span)) for d in log] == [("GEO220", Severity.WARNING, "a.obj:6:4")]
    with pytest.raises(GeometryError, match="GEO220"):
        read(text, strict=True)


def test_lines_that_are_not_read_are_reported() -> None:
    _, log = read(TETRAHEDRON + "g a\n  curv2 1 2\nfo 1\n")
    assert [(d.code, str(d.span)) for d in log] == [("GEO225", "a.obj:10:3")]


BAD = [
    ("", "GEO210", None, "no vertices"),
    ("# v 1 2 3\nf 1 2 3\n", "GEO210", None, "no vertices"),
    ("v 0 0 0\n# nothing\n", "GEO210", None, "no faces"),
    ("v 0 0 0\nf 1 1\n", "GEO210", None, "no triangle"),
    (TETRAHEDRON.replace("v 0 1 0", "v 0 1"), "GEO213", (3, 3), "vertex 3 has 2 coordinates"),
    (TETRAHEDRON.replace("v 0 1 0", "v"), "GEO213", (3, 2), "vertex 3 has 0 coordinates"),
    (TETRAHEDRON.replace("v 0 1 0", "v 0 nan 0"), "GEO212", (3, 5), "vertex 3 is 'nan'"),
    (TETRAHEDRON.replace("v 0 1 0", "v  0 1 -inf"), "GEO212", (3, 8), "vertex 3 is '-inf'"),
    (TETRAHEDRON.replace("v 0 1 0", "v 0 1e400 0"), "GEO212", (3, 5), "vertex 3 is '1e400'"),
    (TETRAHEDRON.replace("v 0 1 0", "v 0 one 0"), "GEO211", (3, 5), "expected a coordinate of vertex 3, found 'one'"),
    (TETRAHEDRON.replace("v 0 1 0", "v 0 1_0 0"), "GEO211", (3, 5), "found '1_0'"),
    (TETRAHEDRON.replace("v 0 1 0", "v 0 1-2 0"), "GEO211", (3, 5), "found '1-2'"),
    (TETRAHEDRON.replace("f 2 3 4", "f 2 3 5"), "GEO214", (7, 7), "face 3 is vertex 5; expected 1 to 4"),
    (TETRAHEDRON.replace("f 2 3 4", "f 2 3/9 0/1"), "GEO214", (7, 9), "face 3 is vertex 0"),
    (TETRAHEDRON.replace("f 2 3 4", "f 2 3 -5"), "GEO214", (7, 7), "face 3 is vertex -5"),
    (TETRAHEDRON.replace("f 2 3 4", "f 2 x 4"), "GEO211", (7, 5), "a corner of face 3, found 'x'"),
    (TETRAHEDRON.replace("f 2 3 4", "f 2 /3 4"), "GEO211", (7, 5), "a corner of face 3, found '/3'"),
    (TETRAHEDRON.replace("f 2 3 4", "f 2 3.5 4"), "GEO216", (7, 5), "face 3 is 3.5; expected an integer"),
    (TETRAHEDRON.replace("f 2 3 4", "f 2 \\\n 3 99"), "GEO214", (8, 4), "face 3 is vertex 99"),
    (TETRAHEDRON.replace("\n", "\r").replace("f 2 3 4", "f 2 3 5"), "GEO214", (7, 7), "face 3 is vertex 5"),
    (TETRAHEDRON + "\0", "GEO211", (9, 1), "not a text file"),
]


@pytest.mark.parametrize(("text", "code", "place", "words"), BAD)
def test_a_bad_file_is_refused_with_its_place(text: str, code: str, place: tuple[int, int] | None, words: str) -> None:
    with pytest.raises(GeometryError, match=re.escape(words)) as caught:
        read(text)
    assert caught.value.code == code
    span = caught.value.span
    assert (span and (span.line, span.column)) == place


@given(st.binary(max_size=200) | st.text("vf 123-./\\#\n\r", max_size=200))
def test_no_input_ends_in_anything_but_a_mesh_or_a_geometry_error(data: bytes | str) -> None:
    try:
        (vertices, faces), _ = read(data)
    except GeometryError:
        return
    assert np.isfinite(vertices).all()
    assert faces.min() >= 0
    assert faces.max() < len(vertices)


def test_limits_hold(tmp_path: Path) -> None:
    with pytest.raises(GeometryError, match="mesh_elements"):
        read_obj(TETRAHEDRON, "a.obj", DiagnosticLog(), Limits(mesh_elements=3))
    file = tmp_path / "a.obj"
    file.write_text(TETRAHEDRON)
    with pytest.raises(GeometryError, match="file_bytes") as caught:
        load_mesh(file, DiagnosticLog(), Limits(file_bytes=10))
    assert caught.value.code == "GEO209"


def test_a_mesh_is_loaded_by_its_extension(tmp_path: Path) -> None:
    file = tmp_path / "Tetra.OBJ"
    file.write_text(TETRAHEDRON)
    log = DiagnosticLog()
    mesh = load_mesh(file, log, Limits())
    assert (mesh.name, mesh.path, mesh.faces.tolist()) == ("Tetra", file, TETRAHEDRON_FACES)
    assert codes(log) == []


@pytest.mark.parametrize("extension", ["stl", "ply", "off", "glb"])
def test_other_formats_go_through_trimesh_and_are_reported(tmp_path: Path, extension: str) -> None:
    trimesh = pytest.importorskip("trimesh")
    file = tmp_path / f"box.{extension}"
    trimesh.creation.box((1, 2, 3)).export(file)
    log = DiagnosticLog()
    mesh = load_mesh(file, log, Limits())
    assert mesh.vertices.shape == (8, 3)
    assert trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).volume == pytest.approx(6.0)
    assert [(d.code, d.severity) for d in log] == [("GEO208", Severity.INFO)]


@pytest.mark.parametrize(
    ("name", "content", "code"),
    [
        ("a.wrl", "", "GEO207"),
        ("a", "", "GEO207"),
        ("a.stl", "solid nothing\nendsolid nothing\n", None),
        ("a.ply", "no ply", "GEO226"),
        ("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", None),
        ("a.off", "OFF\n3 1 0\n0 0 0\n1 0 nan\n0 1 0\n3 0 1 2\n", "GEO212"),
    ],
)
def test_what_cannot_be_loaded_is_a_geometry_error(tmp_path: Path, name: str, content: str, code: str | None) -> None:
    file = tmp_path / name
    file.write_text(content)
    with pytest.raises(GeometryError) as caught:
        load_mesh(file, DiagnosticLog(), Limits())
    assert str(file) in str(caught.value)
    assert code is None or caught.value.code == code
    if code == "GEO207":
        assert all(extension in str(caught.value) for extension in READABLE)


def test_a_file_that_has_gone_is_a_geometry_error(tmp_path: Path) -> None:
    with pytest.raises(GeometryError, match="No such file") as caught:
        load_mesh(tmp_path / "a.g", DiagnosticLog(), Limits())
    assert caught.value.code == "GEO204"
