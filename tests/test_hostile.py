"""Files that mean harm: time and memory in proportion to their size, limits with options, errors of our own."""

from __future__ import annotations

import io
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

import env2mjcf
from env2mjcf.errors import DiagnosticLog, Env2MjcfError
from env2mjcf.formats.byu import read_byu
from env2mjcf.formats.gms import read_gms
from env2mjcf.formats.obj import read_obj
from env2mjcf.formats.query import read_query
from env2mjcf.formats.roadmap import read_roadmap
from env2mjcf.formats.source import Source
from env2mjcf.geometry.loading import load_mesh
from env2mjcf.geometry.mesh import Mesh
from env2mjcf.geometry.repair import repaired
from env2mjcf.options import Limits
from env2mjcf.work import TooMuchWorkError, Work

BOX = "Boundary Box [0:1;0:1;0:1]\nMultibodies\n"
CUBE = "1 8 12 36\n1 12\n" + "".join(f"{x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))
CUBE += "1 2 -4\n1 4 -3\n5 7 -8\n5 8 -6\n1 5 -6\n1 6 -2\n3 4 -8\n3 8 -7\n1 3 -7\n1 7 -5\n2 6 -8\n2 8 -4\n"
BASE = '<Base filename="x.g" type="fixed" transform="0 0 0 0 0 0"/>'
MEGA = 1 << 20


def xml(inside: str) -> str:
    return f"<Environment>{inside}</Environment>"


def passive(inside: str) -> str:
    return f'<MultiBody type="passive">{inside}</MultiBody>'


def many_attributes(count: int) -> str:
    return "".join(f' a{i}=""' for i in range(count))


def fault(read: Callable[[], object]) -> Env2MjcfError:
    with pytest.raises(Env2MjcfError) as caught:
        read()
    return caught.value


class Reader:
    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def file(self, text: str | bytes, name: str) -> Path:
        path = self.folder / name
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return path

    def env(self, text: str | bytes, limits: Limits | None = None) -> env2mjcf.Environment:
        return env2mjcf.read(self.file(text, "hostile.env"), limits=limits or Limits())

    def mesh(self, text: str | bytes, limits: Limits | None = None, name: str = "mesh.g") -> Mesh:
        return load_mesh(self.file(text, name), DiagnosticLog(), limits or Limits())

    def scene(self, text: str, limits: Limits | None = None) -> env2mjcf.Scene:
        return env2mjcf.load(self.file(text, "hostile.env"), limits=limits or Limits(), engine="mujoco", cache=False)


@pytest.fixture
def read(tmp_path: Path) -> Reader:
    return Reader(tmp_path)


def roadmap(text: str) -> None:
    read_roadmap(Source.of("x.map", text), (6,), DiagnosticLog())


def loose_triangles(count: int) -> Mesh:
    """Small triangles all over the place, none of which has a neighbour: every edge is open."""
    rng = np.random.default_rng(1)
    corners = rng.random((count, 1, 3)) + 0.01 * rng.random((count, 3, 3))
    return Mesh.from_arrays("loose", corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


def star(corners: int) -> str:
    """A polygon of which every other corner is reflex."""
    angle = 2 * np.pi * np.arange(corners) / corners
    radius = 1 + np.arange(corners) % 2
    points = "\n".join(f"{x} {y} 0" for x, y in zip(radius * np.cos(angle), radius * np.sin(angle), strict=True))
    return f"1 {corners} 1 {corners}\n1 1\n{points}\n{' '.join(map(str, range(1, corners)))} -{corners}\n"


class TestTime:
    """Four times as much takes less than ten times as long: what is quadratic takes sixteen times."""

    TEXTS: ClassVar[dict[str, tuple[Callable[[int], str], int]]] = {
        "bodies on one line": (lambda n: BOX + "1\n" + "Passive x.g 0 0 0 0 0 0 " * n, 8000),
        "attributes of an element": (lambda n: xml(passive(BASE.replace("/>", f"{many_attributes(n)}/>"))), 2000),
        "blanks in an XML declaration": (lambda n: f"<?xml {' ' * n}?><Environment/>", 20_000),
        "elements on one line": (lambda n: xml("<a/>" * n), 5000),
    }  # fmt: skip
    MAPS: ClassVar[dict[str, tuple[Callable[[int], str], int]]] = {
        "hashes": (lambda n: "#" * n, 20_000),
        "a long word": (lambda n: "x" * n + "GRAPHSTAR", 20_000),
        "sections without end": (lambda n: "#####LPSTART#####\n" * n + "#####GRAPHSTART#####\n0 0 0\n", 500),
        "hashes in a section": (lambda n: f"#####LPSTART#####\n{'#' * n}\n#####GRAPHSTART#####\n0 0 0\n", 5000),
    }

    @staticmethod
    def grows(run: Callable[[str], object], make: Callable[[int], str], size: int) -> float:
        small, large = make(size), make(4 * size)
        return TestTime.best(run, large) / max(1e-3, TestTime.best(run, small))

    @staticmethod
    def best(run: Callable[[str], object], text: str) -> float:
        times: list[float] = []
        for _ in range(3):
            start = time.process_time()
            with suppress(Env2MjcfError):
                run(text)
            times.append(time.process_time() - start)
        return min(times)

    @pytest.mark.parametrize("name", TEXTS)
    def test_of_an_environment(self, read: Reader, name: str) -> None:
        assert self.grows(read.env, *self.TEXTS[name]) < 10

    @pytest.mark.parametrize("name", MAPS)
    def test_of_a_roadmap(self, name: str) -> None:
        assert self.grows(roadmap, *self.MAPS[name]) < 10

    def test_triangles_without_neighbours_are_not_compared_each_with_each(self) -> None:
        def steps(count: int) -> int:
            work = Work()
            repaired(loose_triangles(count), work)
            return work.done

        assert steps(2000) < 6 * steps(500)


class TestWork:
    def test_a_mesh_that_takes_too_much_is_refused(self, read: Reader) -> None:
        text = BOX + "1\nPassive\nmesh.g 0 0 0 0 0 0\n"
        mesh = loose_triangles(100)
        rows = "".join(f"{x} {y} {z}\n" for x, y, z in mesh.vertices.tolist())
        read.file(f"1 300 100 300\n1 100\n{rows}" + "".join(f"{a} {b} -{c}\n" for a, b, c in mesh.faces + 1), "mesh.g")
        assert fault(lambda: read.scene(text, Limits(mesh_work=1000))).code == "GEO273"
        assert read.scene(text).model.ngeom > 1

    def test_the_limit_ends_the_work_when_it_is_reached(self) -> None:
        work = Work(1000)
        with pytest.raises(TooMuchWorkError):
            repaired(loose_triangles(2000), work)
        assert work.done < 100_000

    def test_a_star_of_many_corners_ends_at_the_limit(self, read: Reader) -> None:
        assert fault(lambda: read.mesh(star(300), Limits(polygon_work=1000))).code == "GEO270"
        assert len(read.mesh(star(300)).faces) == 298


NODES = "#####GRAPHSTART#####\n2 0 2\n0 0 0 0 0\n1 0 0 0 0\n#####GRAPHSTOP#####\n"
ROBOT = "Active\n1\ncube.g Planar Rotational\nConnections\n0\n"


def rows_of(text: str, limits: Limits) -> None:
    read_query(Source.of("x.query", text, limits), (3,), DiagnosticLog())


def nodes_of(text: str, limits: Limits) -> None:
    read_roadmap(Source.of("x.map", text, limits), (3,), DiagnosticLog())


PASSED: dict[str, tuple[str, Callable[[Reader, Limits], object]]] = {
    "file_bytes": ("ENV105", lambda r, x: r.env(BOX + "0\n", x)),
    "bodies": ("ENV110", lambda r, x: r.env(BOX + "2\n" + "Passive\nx.g 0 0 0 0 0 0\n" * 2, x)),
    "connections": (
        "ENV110",
        lambda r, x: r.env(
            BOX + "1\nActive\n3\nx.g Fixed 0 0 0 0 0 0\nx.g Joint\nx.g Joint\nConnections\n2\n"
            + "".join(f"{i} {i + 1} NonActuated\n{'0 ' * 6}\n{'0 ' * 4}\n{'0 ' * 6}\n" for i in range(2)), x,
        ),
    ),
    "name_length": ("ENV109", lambda r, x: r.env(BOX + "1\nPassive\nlong.g 0 0 0 0 0 0\n", x)),
    "nesting": ("ENV180", lambda r, x: r.env(xml(BASE), x)),
    "elements": ("ENV180", lambda r, x: r.env(xml(BASE), x)),
    "rows": ("ENV182", lambda r, x: rows_of("0 0 0\n0 0 0\n", x)),
    "mesh_elements": ("GEO209", lambda r, x: r.mesh(CUBE, x)),
    "polygon_corners": ("GEO227", lambda r, x: r.mesh(CUBE, x)),
    "polygon_work": ("GEO270", lambda r, x: r.mesh(star(20), x)),
    "scene_elements": ("GEO271", lambda r, x: r.scene(BOX + "1\n" + ROBOT, x)),
    "scene_cells": ("GEO272", lambda r, x: r.scene(BOX + "2\nPassive\ncube.g 0 0 0 0 0 0\n" + ROBOT, x)),
    "pairs": ("GEO275", lambda r, x: r.scene(BOX + "3\n" + "Passive\ncube.g 9 9 9 0 0 0\n" * 2 + ROBOT, x)),
}  # fmt: skip


class TestLimits:
    @pytest.mark.parametrize("name", PASSED)
    def test_each_has_a_diagnostic_that_names_its_option(self, read: Reader, name: str) -> None:
        read.file(CUBE, "cube.g")
        code, run = PASSED[name]
        found = fault(lambda: run(read, Limits(**{name: 1})))
        assert found.code == code
        assert f"limits=Limits({name}=" in found.diagnostic.hint
        assert f"--limits.{name.replace('_', '-')}" in found.diagnostic.hint

    def test_nodes_of_roadmaps_are_rows(self) -> None:
        assert fault(lambda: nodes_of(NODES, Limits(rows=1))).code == "ENV182"
        nodes_of(NODES, Limits(rows=2))

    def test_nesting_can_be_raised_beyond_what_lxml_allows(self, read: Reader) -> None:
        deep = xml("<a>" * 400 + "</a>" * 400)
        assert fault(lambda: read.env(deep)).code == "ENV180"
        assert read.env(deep, Limits(nesting=500)).multibodies == ()

    def test_the_program_has_them_as_flags(self, read: Reader) -> None:
        from env2mjcf.cli.main import main

        path = str(read.file(BOX + "0\n", "hostile.env"))
        assert main(["info", path]) == 0
        assert main(["info", path, "--limits.file-bytes", "10"]) == 3


# Run in a process of its own, with little memory.
STARVED = f"""
import resource, sys
import numpy as np
from env2mjcf.errors import DiagnosticLog, Env2MjcfError
from env2mjcf.options import Limits
import env2mjcf
from env2mjcf.cli.rows import _numpy_array
from env2mjcf.formats.byu import read_byu
from env2mjcf.formats.gms import read_gms
from env2mjcf.formats.obj import read_obj
from env2mjcf.formats.path import read_path
from env2mjcf.formats.roadmap import read_roadmap
from env2mjcf.formats.source import Source
in_use = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (in_use + 64 * {MEGA}, resource.RLIM_INFINITY))
unlimited = Limits(**{{name: 10**15 for name in Limits.__slots__ if name not in ("file_bytes", "nesting")}})
def source(text): return Source.of("x", text, unlimited)
log = DiagnosticLog()
for n in (10**8, 10**12, 10**14):
    for run in (
        lambda: read_byu(f"1 {{n}} {{n}} {{3 * n}}\\n1 {{n}}\\n0 0 0\\n", "x", log, unlimited),
        lambda: read_gms(f"{{n}}\\n0 0 0\\n", "x", log, unlimited),
        lambda: read_gms(f"3 0 0 0 1 0 0 0 1 0 {{n}} 3 0 1 2\\n", "x", log, unlimited),
        lambda: read_obj(f"v 0 0 0\\nf 1 {{n}} 2\\n", "x", log, unlimited),
        lambda: read_path(source(f"VIZMO_PATH_FILE   Path Version 2012\\n1\\n{{n}}\\n0 0 0 0\\n"), (3,), (1,), log),
        lambda: read_roadmap(source(f"#####GRAPHSTART#####\\n{{n}} {{n}} {{n}}\\n0 0 0 0 {{n}}\\n"), (3,), log),
        lambda: env2mjcf.read(sys.argv[1] + f"/bodies{{n}}.env", limits=unlimited),
        lambda: env2mjcf.read(sys.argv[1] + f"/links{{n}}.env", limits=unlimited),
        lambda: _numpy_array(sys.argv[1] + f"/rows{{n}}.npy"),
    ):
        try:
            run()
        except (Env2MjcfError, ValueError):
            pass
"""


@pytest.mark.skipif(sys.platform != "linux", reason="needs RLIMIT_AS and /proc")
def test_what_is_declared_takes_no_memory_before_it_is_there(tmp_path: Path) -> None:
    for n in (10**8, 10**12, 10**14):
        (tmp_path / f"bodies{n}.env").write_text(f"{BOX}{n}\nPassive\nx.g 0 0 0 0 0 0\n")
        (tmp_path / f"links{n}.env").write_text(f"{BOX}1\nActive\n{n}\nx.g Planar Rotational\n")
        header = str({"descr": "<f8", "fortran_order": False, "shape": (n, 6)}).ljust(117) + "\n"
        (tmp_path / f"rows{n}.npy").write_bytes(b"\x93NUMPY\x01\x00v\x00" + header.encode())
    result = subprocess.run([sys.executable, "-c", STARVED, str(tmp_path)], capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (0, "")


class TestNumbers:
    BAD = ("nan", "-inf", "0x10", "1e999", "1,5", "1_000", "٣", "1.#INF", "--1", "½")
    READERS: ClassVar[dict[str, Callable[[Reader, str], object]]] = {
        "env": lambda r, w: r.env(BOX + f"1\nPassive\nx.g {w} 0 0 0 0 0\n"),
        "xml": lambda r, w: r.env(xml(passive(BASE.replace('"0 0', f'"{w} 0')))),
        "byu": lambda r, w: read_byu(f"1 3 1 3\n1 1\n{w} 0 0\n1 0 0\n0 1 0\n1 2 -3\n", "x", DiagnosticLog(), Limits()),
        "obj": lambda r, w: read_obj(f"v {w} 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "x", DiagnosticLog(), Limits()),
        "gms": lambda r, w: read_gms(f"3 {w} 0 0 1 0 0 0 1 0 1 3 0 1 2\n", "x", DiagnosticLog(), Limits()),
        "query": lambda r, w: rows_of(f"{w} 0 0\n", Limits()),
        "roadmap": lambda r, w: nodes_of(NODES.replace("0 0 0 0 0", f"0 {w} 0 0 0"), Limits()),
    }  # fmt: skip

    @pytest.mark.parametrize("reader", READERS)
    @pytest.mark.parametrize("word", BAD)
    def test_what_is_no_number_is_refused_where_it_stands(self, read: Reader, reader: str, word: str) -> None:
        found = fault(lambda: self.READERS[reader](read, word))
        assert found.span is not None
        assert word.encode() in found.diagnostic.message.encode("latin-1", "replace") or word in str(found)

    @pytest.mark.parametrize("reader", READERS)
    def test_denormals_are_numbers(self, read: Reader, reader: str) -> None:
        self.READERS[reader](read, "5e-324")

    @pytest.mark.parametrize(("word", "hint"), [("1,5", "a decimal point"), ("0x10", "hexadecimal")])
    @pytest.mark.parametrize("reader", ["env", "byu", "gms", "query", "roadmap"])
    def test_what_to_write_instead_is_told(self, read: Reader, reader: str, word: str, hint: str) -> None:
        assert hint in fault(lambda: self.READERS[reader](read, word)).diagnostic.hint

    @pytest.mark.filterwarnings("error")
    @pytest.mark.parametrize("size", ["1e300", "1e150", "1e35"])
    def test_meshes_of_astronomic_size_are_refused(self, read: Reader, size: str) -> None:
        assert fault(lambda: read.mesh(f"1 3 1 3\n1 1\n0 0 0\n{size} 0 0\n0 {size} 0\n1 2 -3\n")).code == "GEO276"

    @pytest.mark.filterwarnings("error")
    @pytest.mark.parametrize("size", ["1e29", "1e-29", "1e-300"])
    def test_meshes_of_less_either_load_or_are_refused(self, read: Reader, size: str) -> None:
        read.file(_sized(size), "cube.g")
        with suppress(Env2MjcfError):
            read.scene(BOX + "1\n" + ROBOT)


def _sized(size: str) -> str:
    head, *rows = CUBE.splitlines()
    return "\n".join(
        [head, rows[0], *(" ".join(size if w == "1" else w for w in r.split()) for r in rows[1:9]), *rows[9:]]
    )


class TestEncodings:
    @pytest.mark.parametrize("name", ["mesh.g", "mesh.obj", "mesh.dat"])
    @pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-32-le", "utf-32-be"])
    def test_wide_ones_are_named(self, read: Reader, name: str, encoding: str) -> None:
        found = fault(lambda: read.mesh(CUBE.encode(encoding), name=name))
        assert (found.code, encoding[:6].upper() in found.diagnostic.message) == ("GEO274", True)

    def test_a_mark_in_front_of_utf_8_is_skipped(self, read: Reader) -> None:
        assert len(read.mesh(CUBE.encode("utf-8-sig")).faces) == 12

    @pytest.mark.parametrize("declared", ["latin-1", "utf-16", "nonsense"])
    def test_what_xml_declares_does_not_matter(self, read: Reader, declared: str) -> None:
        text = f'<?xml version="1.0" encoding="{declared}"?>' + xml(passive(BASE))
        named = read.env(text.replace("x.g", "é.g"))
        assert named.multibodies[0].bodies[0].filename == "é.g"


class TestPlaces:
    def test_of_a_long_line_the_part_around_the_place_is_quoted(self, read: Reader) -> None:
        text = BOX + "1\nPassive x.g 0 0 0 0 0 0" + " " * 5000 + "wrong" + " y" * 5000
        source = Source.of("x.env", text)
        at = text.index("wrong")
        span = source.span(at, at + 5)
        assert span.column == at - text.rindex("\n", 0, at)
        line, carets = span.excerpt().splitlines()
        assert line[carets.index("^") : carets.rindex("^") + 1] == "wrong"
        assert line.strip().startswith("...")
        assert line.endswith("...")
        assert len(line) < 500

    def test_so_it_is_in_meshes(self) -> None:
        words = "1 3 1 3 1 1 0 0 0 1 0 0 0 1 0 1 2 -3" + " 7" * 2000 + " wrong"
        found = fault(lambda: read_byu(words, "x.g", DiagnosticLog(), Limits()))
        assert found.span is not None
        assert found.span.column == words.index(" 7") + 2
        line, carets = found.span.excerpt().splitlines()
        assert line[carets.index("^")] == "7"
        assert len(line) < 500


class TestArrays:
    @staticmethod
    def of(read: Reader, content: bytes) -> Env2MjcfError:
        from env2mjcf.cli.configurations import of_file

        read.file(CUBE, "cube.g")
        scene = read.scene(BOX + "1\n" + ROBOT)
        path = read.file(content, "rows.npy")
        return fault(lambda: of_file(scene, str(path), False, Limits(), DiagnosticLog()))

    def test_a_damaged_archive_is_no_array(self, read: Reader) -> None:
        assert self.of(read, b"PK\x03\x04" + b"0" * 100).code == "CFG505"

    def test_neither_is_a_whole_one(self, read: Reader) -> None:
        file = io.BytesIO()
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("a.npy", b"")
        assert self.of(read, file.getvalue()).code == "CFG505"

    @pytest.mark.filterwarnings("error")
    def test_numbers_that_would_overflow_are_refused(self, read: Reader) -> None:
        file = io.BytesIO()
        np.save(file, np.full((1, 3), 1e308))
        assert self.of(read, file.getvalue()).code == "CFG505"
