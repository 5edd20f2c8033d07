"""MOVIE.BYU `.g` and GMS `.dat` meshes."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.errors import GeometryError, Severity
from env2mjcf.formats.meshes import byu
from env2mjcf.formats.meshes.byu import export_byu, load_byu, read_byu, read_gms, teach
from env2mjcf.formats.meshes.text import MeshArrays
from env2mjcf.geometry.mesh import Mesh
from env2mjcf.limits import Limits

TETRAHEDRON = """1 4 4 12
1 4
0 0 0
1 0 0
0 1 0
0 0 1
1 3 -2
1 2 -4
2 3 -4
1 4 -3
"""
TETRAHEDRON_FACES = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
SQUARE = "0 0 0  1 0 0  1 1 0  0 1 0"


def read(text: str | bytes, strict: bool = False) -> tuple[MeshArrays, DiagnosticLog]:
    log = DiagnosticLog(strict)
    return read_byu(text, "a.g", log, Limits()), log


def codes(log: DiagnosticLog) -> list[str]:
    return [d.code for d in log]


def vtk_polygons(path: Path) -> tuple[np.ndarray, list[list[int]]]:
    vtk = pytest.importorskip("vtk")
    reader = vtk.vtkBYUReader()
    reader.SetGeometryFileName(str(path))
    reader.ReadDisplacementOff()
    reader.ReadScalarOff()
    reader.ReadTextureOff()
    reader.Update()
    data = reader.GetOutput()
    points = np.array([data.GetPoint(i) for i in range(data.GetNumberOfPoints())])
    polygons: list[list[int]] = []
    for i in range(data.GetNumberOfCells()):
        ids = data.GetCell(i).GetPointIds()
        polygons.append([ids.GetId(j) for j in range(ids.GetNumberOfIds())])
    return points, polygons


@pytest.mark.slow
def test_every_mesh_of_the_corpus_is_what_vtk_reads(corpus: Path) -> None:
    files = sorted(corpus.rglob("*.g"))
    assert len(files) > 100
    for file in files:
        log = DiagnosticLog()
        vertices, faces = read_byu(file.read_bytes(), str(file), log, Limits())
        points, polygons = vtk_polygons(file)
        # VTK keeps single precision.
        np.testing.assert_array_equal(vertices.astype(np.float32), points.astype(np.float32), str(file))
        assert faces.tolist() == polygons, file
        # Real files lie about edges and ranges, and about nothing else.
        assert set(codes(log)) <= {"GEO217", "GEO218"}, file


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", " ", "\n\n\t"])
def test_line_ends_and_layout_do_not_matter(end: str) -> None:
    (vertices, faces), log = read(TETRAHEDRON.replace("\n", end))
    np.testing.assert_array_equal(vertices, np.vstack([np.zeros(3), np.eye(3)]))
    assert faces.tolist() == TETRAHEDRON_FACES
    assert codes(log) == []


def test_a_byte_order_mark_is_no_part_of_the_mesh() -> None:
    assert read(b"\xef\xbb\xbf" + TETRAHEDRON.encode())[0][1].tolist() == TETRAHEDRON_FACES


def test_signs_part_the_numbers_that_fortran_prints_without_blanks(tmp_path: Path) -> None:
    text = (
        "       1       4       4      12\n       1       4\n"
        "-1.00000E+00-1.00000E+00-1.00000E+00 1.00000E+00-1.00000E+00-1.00000E+00\n"
        " 0.00000E+00 2.50000E-01-1.00000E+00 0.00000E+00 0.00000E+00 1.00000E+00\n"
        "       1       3      -2       1       2      -4       2       3      -4       1       4      -3\n"
    )
    (vertices, faces), log = read(text)
    file = tmp_path / "fortran.g"
    file.write_text(text)
    points, polygons = vtk_polygons(file)
    np.testing.assert_array_equal(vertices, points)
    assert faces.tolist() == polygons
    assert codes(log) == []


def test_signs_part_indices_too() -> None:
    assert read(TETRAHEDRON.replace("1 3 -2\n1 2 -4\n", "1 3-2 1 2-4 "))[0][1].tolist() == TETRAHEDRON_FACES


def test_exponents_may_be_written_with_d() -> None:
    (vertices, _), _ = read(TETRAHEDRON.replace("1 0 0", "1.25D+01 -2.5d-1 .5"))
    assert vertices[1].tolist() == [12.5, -0.25, 0.5]


def test_integers_in_columns_of_fixed_width_may_touch() -> None:
    # More than 9999 vertices in columns of five: FORMAT(16I5) and FORMAT(6E12.5).
    n = 10_002
    points = np.arange(3 * n) - 20_000.0
    lines = ["".join(f"{x:5d}" for x in row) for row in ([1, n, 2, 6], [1, 2])]
    lines += ["".join(f"{x:12.5E}" for x in points[i : i + 6]) for i in range(0, 3 * n, 6)]
    lines += ["".join(f"{x:5d}" for x in (1, 10_002, -3, 10_000, 10_001, -4))]
    (vertices, faces), log = read("\n".join(lines))
    np.testing.assert_array_equal(vertices.ravel(), points)
    assert faces.tolist() == [[0, 10_001, 2], [9_999, 10_000, 3]]
    assert codes(log) == ["GEO223"]


def test_parts_are_read_as_one_mesh_and_reported() -> None:
    (_, faces), log = read(TETRAHEDRON.replace("1 4 4 12\n1 4", "2 4 4 12\n1 2\n3 4"))
    assert faces.tolist() == TETRAHEDRON_FACES
    assert [(d.code, d.severity, str(d.span)) for d in log] == [("GEO219", Severity.INFO, "a.g:1:1")]


@pytest.mark.parametrize("ranges", ["1 2\n2 4", "2 2\n3 4", "1 2\n3 5", "1 2\n4 4"])
def test_parts_that_do_not_follow_each_other_are_reported(ranges: str) -> None:
    _, log = read(TETRAHEDRON.replace("1 4 4 12\n1 4", f"2 4 4 12\n{ranges}"))
    assert codes(log) == ["GEO219", "GEO218"]


def test_wrong_edge_counts_and_ranges_are_reported_and_not_used() -> None:
    (_, faces), log = read(TETRAHEDRON.replace("1 4 4 12\n1 4", "1 4 4 36\n1 12"), strict=True)
    assert faces.tolist() == TETRAHEDRON_FACES
    assert [(d.code, d.severity, str(d.span)) for d in log] == [
        ("GEO217", Severity.INFO, "a.g:1:7"),
        ("GEO218", Severity.INFO, "a.g:2:1"),
    ]


def test_quads_are_cut_and_reported(tmp_path: Path) -> None:
    text = f"1 4 2 7\n1 2\n{SQUARE}\n1 2 -3\n1 2 3 -4\n"
    (_, faces), log = read(text)
    assert faces.tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 3]]
    assert [(d.code, str(d.span)) for d in log] == [("GEO220", "a.g:5:1")]
    (tmp_path / "quad.g").write_text(text)
    assert vtk_polygons(tmp_path / "quad.g")[1] == [[0, 1, 2], [0, 1, 2, 3]]


def test_polygons_with_two_corners_are_skipped_and_reported() -> None:
    (_, faces), log = read(f"1 4 2 5\n1 2\n{SQUARE}\n1 -2\n1 2 -3\n")
    assert faces.tolist() == [[0, 1, 2]]
    assert [(d.code, str(d.span)) for d in log] == [("GEO221", "a.g:4:1")]


def test_polygons_that_cross_themselves_are_reported() -> None:
    _, log = read(f"1 4 1 4\n1 1\n{SQUARE}\n1 3 2 -4\n")
    assert codes(log) == ["GEO220", "GEO222"]


BAD = [
    ("", "GEO210", (1, 1), "is empty"),
    (" \n\n", "GEO210", (1, 1), "is empty"),
    ("1 4\n", "GEO213", (1, 3), "the number of polygons"),
    ("solid cube\n", "GEO211", (1, 1), "expected the number of parts, found 'solid'"),
    ("1 4 four 12\n", "GEO211", (1, 5), "expected the number of polygons, found 'four'"),
    ("1.0 4 4 12\n", "GEO216", (1, 1), "expected an integer"),
    ("1 4 4 1E1\n", "GEO216", (1, 7), "expected an integer"),
    ("-1 4 4 12\n", "GEO216", (1, 1), "expected 1 to 4"),
    ("5 4 4 12\n", "GEO216", (1, 1), "expected 1 to 4"),
    ("1 -4 4 12\n", "GEO216", (1, 3), "the number of vertices is -4"),
    ("1 0 4 12\n", "GEO210", (1, 3), "the number of vertices is 0"),
    ("1 4 0 12\n", "GEO210", (1, 5), "the number of polygons is 0"),
    ("1 99999999999999999999 4 12\n1 4\n", "GEO209", (1, 3), "99999999999999999999; at most"),
    ("1 40000000 4 12\n1 4\n0 0 0\n", "GEO213", (3, 5), "x of vertex 2 of 40000000"),
    ("1 4 40000000 12\n1 4\n" + SQUARE + "\n1 2 -3\n", "GEO213", (4, 5), "a corner of polygon 2 of 40000000"),
    ("1 4 4 12\n1", "GEO213", (2, 1), "the last polygon of part 1"),
    (TETRAHEDRON.replace("0 1 0", "0 nan 0"), "GEO212", (5, 3), "y of vertex 3 of 4 is 'nan'"),
    (TETRAHEDRON.replace("0 1 0", "0 1 -Infinity"), "GEO212", (5, 5), "z of vertex 3 of 4"),
    (TETRAHEDRON.replace("0 1 0", "1e999 1 0"), "GEO212", (5, 1), "x of vertex 3 of 4"),
    (TETRAHEDRON.replace("0 1 0", "0 1_0 0"), "GEO211", (5, 3), "found '1_0'"),
    (TETRAHEDRON.replace("0 1 0", "0 0x1 0"), "GEO211", (5, 3), "found '0x1'"),
    (TETRAHEDRON.replace("0 1 0", "0 1.2.3 0"), "GEO211", (5, 3), "found '1.2.3'"),
    (TETRAHEDRON.replace("0 1 0", "0 1,5 0"), "GEO211", (5, 3), "found '1,5'"),
    (TETRAHEDRON.replace("0 1 0", "0 model 0"), "GEO211", (5, 3), "found 'model'"),
    (TETRAHEDRON.replace("0 1 0", "0 1 0 # apex"), "GEO211", (5, 7), "no comments"),
    (TETRAHEDRON.replace("2 3 -4", "2 3 -5"), "GEO214", (9, 5), "polygon 3 of 4 is vertex -5; expected 1 to 4"),
    (TETRAHEDRON.replace("2 3 -4", "2 9 -4"), "GEO214", (9, 3), "polygon 3 of 4 is vertex 9"),
    (TETRAHEDRON.replace("2 3 -4", "0 3 -4"), "GEO214", (9, 1), "polygon 3 of 4 is vertex 0"),
    (TETRAHEDRON.replace("2 3 -4", "2 3.5 -4"), "GEO216", (9, 3), "is 3.5; expected an integer"),
    (TETRAHEDRON.replace("1 4 -3\n", ""), "GEO213", (9, 5), "a corner of polygon 4 of 4"),
    (TETRAHEDRON.replace("1 4 -3\n", "1 4\n"), "GEO213", (10, 3), "a corner of polygon 4 of 4"),
    (TETRAHEDRON + "7\n", "GEO215", (11, 1), "1 more words behind the last of 4 polygons"),
    (TETRAHEDRON + "1 2 -3\n", "GEO215", (11, 1), "expected the end of the file"),
    (TETRAHEDRON + "end\n", "GEO215", (11, 1), "'end'"),
    ("1 2 1 2\n1 1\n0 0 0 1 1 1\n1 -2\n", "GEO210", None, "no triangle"),
    (TETRAHEDRON.replace("\n", "\r").replace("0 1 0", "0 ? 0"), "GEO211", (5, 3), "found '?'"),
]


@pytest.mark.parametrize(("text", "code", "place", "words"), BAD)
def test_a_bad_file_is_refused_with_its_place(text: str, code: str, place: tuple[int, int] | None, words: str) -> None:
    with pytest.raises(GeometryError, match=re.escape(words)) as caught:
        read(text)
    assert caught.value.code == code
    span = caught.value.span
    assert (span and (span.line, span.column)) == place
    assert caught.value.diagnostic.subject == "a.g"


def test_a_binary_file_is_refused() -> None:
    with pytest.raises(GeometryError, match="is it a binary file") as caught:
        read(b"\x7fELF\x02\x01\x01\0\0\0")
    assert caught.value.code == "GEO211"


def test_a_span_covers_the_word_and_quotes_its_line() -> None:
    with pytest.raises(GeometryError) as caught:
        read(TETRAHEDRON.replace("0 1 0", "\t0  oops 0"))
    assert str(caught.value).splitlines()[1:] == ["    \t0  oops 0", "    \t   ^^^^"]


def test_limits_hold() -> None:
    with pytest.raises(GeometryError, match="mesh_elements") as caught:
        read_byu(TETRAHEDRON, "a.g", DiagnosticLog(), Limits(mesh_elements=3))
    assert caught.value.code == "GEO209"
    with pytest.raises(GeometryError, match="12 corners; at most 11") as caught:
        read_byu(TETRAHEDRON, "a.g", DiagnosticLog(), Limits(mesh_elements=11))


finite = st.floats(allow_nan=False, allow_infinity=False)


@given(st.data())
def test_what_is_exported_loads_back_to_the_same_doubles(data: st.DataObject) -> None:
    vertices = data.draw(arrays(np.float64, st.tuples(st.integers(1, 20), st.just(3)), elements=finite))
    index = st.integers(0, len(vertices) - 1)
    faces = data.draw(arrays(np.int64, st.tuples(st.integers(1, 20), st.just(3)), elements=index))
    text = export_byu(Mesh.from_arrays("m", vertices, faces))
    for stream in (io.StringIO(text), io.BytesIO(text.encode())):
        loaded = load_byu(stream, file_type="g")
        np.testing.assert_array_equal(loaded["vertices"], vertices)
        np.testing.assert_array_equal(loaded["faces"], faces)
    assert codes(read(text)[1]) == []


@given(st.binary(max_size=200) | st.text("0123456789-+.eED \n", max_size=200))
def test_no_input_ends_in_anything_but_a_mesh_or_a_geometry_error(data: bytes | str) -> None:
    try:
        (vertices, faces), _ = read(data)
    except GeometryError:
        return
    assert np.isfinite(vertices).all()
    assert faces.min() >= 0
    assert faces.max() < len(vertices)


def test_trimesh_loads_and_exports_g_once_registered(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    teach(trimesh.exchange.load)
    teach(trimesh.exchange.export)
    box = trimesh.creation.box((1, 2, 3))
    box.export(tmp_path / "box.g")
    loaded = trimesh.load_mesh(tmp_path / "box.g")
    assert loaded.is_watertight
    assert loaded.volume == pytest.approx(6.0)
    points, polygons = vtk_polygons(tmp_path / "box.g")
    np.testing.assert_array_equal(points, box.vertices)
    assert polygons == box.faces.tolist()


GMS = "4\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n4\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"


def test_a_gms_file_counts_corners_and_indexes_from_zero() -> None:
    log = DiagnosticLog(strict=True)
    vertices, faces = read_gms(GMS, "a.dat", log, Limits())
    np.testing.assert_array_equal(vertices, np.vstack([np.zeros(3), np.eye(3)]))
    assert faces.tolist() == TETRAHEDRON_FACES


@pytest.mark.parametrize(
    ("text", "code", "place", "words"),
    [
        (GMS.replace("3 1 2 3", "3 1 2 4"), "GEO214", (9, 7), "polygon 3 of 4 is vertex 4; expected 0 to 3"),
        (GMS.replace("3 1 2 3", "0"), "GEO216", (9, 1), "polygon 3 of 4 has 0 corners"),
        (GMS.replace("3 1 2 3", "3 1 2 x"), "GEO211", (9, 7), "a corner of polygon 3 of 4"),
        (GMS.replace("3 0 3 2", "3 0 3"), "GEO213", (10, 5), "a corner of polygon 4 of 4"),
        (GMS.replace("3 0 3 2", ""), "GEO213", (9, 7), "the number of corners of polygon 4 of 4"),
        (GMS + "3", "GEO215", (11, 1), "behind the last of 4 polygons"),
        ("", "GEO213", (1, 1), "the number of vertices"),
    ],
)
def test_a_bad_gms_file_is_refused_with_its_place(text: str, code: str, place: tuple[int, int], words: str) -> None:
    with pytest.raises(GeometryError, match=re.escape(words)) as caught:
        read_gms(text, "a.dat", DiagnosticLog(), Limits())
    assert caught.value.code == code
    span = caught.value.span
    assert span is not None
    assert (span.line, span.column) == place


class TestGuessesOfColumns:
    """Files that fit many widths at once: few are tried, so that the time is that of some readings."""

    HEADER = "1\n3\n1\n3\n"
    TEXTS: ClassVar[dict[str, str]] = {
        "digits that fit every width": HEADER + ("1" * 2520 + "\n") * 20,
        "points that do, too": HEADER + (".1111111" * 315 + "\n") * 20,
        "both": HEADER + ("1" * 2520 + "\n" + ".1111111" * 315 + "\n") * 20,
        "one number a line": "1\n" * 9000,
    }

    @pytest.mark.parametrize("text", TEXTS)
    def test_few_are_tried(self, text: str, monkeypatch: pytest.MonkeyPatch) -> None:
        tried: list[int] = []
        original = byu._read
        monkeypatch.setattr(byu, "_read", lambda file: tried.append(1) or original(file))
        with pytest.raises(GeometryError):
            read_byu(self.TEXTS[text], "x.g", DiagnosticLog(), Limits())
        assert len(tried) <= 5
        if text == "one number a line":
            assert len(tried) == 1

    @pytest.mark.parametrize("integer", [5, 6, 7, 8, 9, 10, 12])
    @pytest.mark.parametrize("other", [12, 13, 14, 15, 16, 20])
    @pytest.mark.parametrize("end", ["\n", "\r\n", " \r\n"])
    def test_every_width_is_found_where_all_numbers_touch(self, integer: int, other: int, end: str) -> None:
        count = 1000
        points = [(-1.25 - k % 7, 2.5e-3 * k, -3.0) for k in range(count)]
        lines = ["".join(f"{n:{integer}d}" for n in (1, count, 1, 3)), f"{1:{integer}d}{1:{integer}d}"]
        lines += ["".join(f"{x:{other}.{other - 7}E}" for x in point) for point in points]
        lines.append(f"{1:{integer}d}{2:{integer}d}{-count:{integer}d}")
        vertices, faces = read_byu(end.join([*lines, ""]), "x.g", DiagnosticLog(), Limits())
        np.testing.assert_allclose(vertices, points, rtol=10.0 ** (8 - other))
        assert faces.tolist() == [[0, 1, count - 1]]
