"""Files that mean harm: time and memory in proportion to their size, limits with options, errors of our own."""

from __future__ import annotations

import io
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from scenes import fault

import env2mjcf
from env2mjcf.companions.arrays import open_rows
from env2mjcf.companions.configurations import of_file
from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.errors import Env2MjcfError
from env2mjcf.formats.lexer import parse_integer
from env2mjcf.formats.meshes.byu import read_byu, read_gms
from env2mjcf.formats.meshes.obj import read_obj
from env2mjcf.formats.path import read_path
from env2mjcf.formats.roadmap import read_roadmap
from env2mjcf.formats.rows import read_query
from env2mjcf.formats.source import Source
from env2mjcf.geometry.mesh import Mesh, load_mesh
from env2mjcf.geometry.repair import repaired
from env2mjcf.limits import Limits, TooMuchWorkError, Work
from env2mjcf.linting import lint

BOX = "Boundary Box [0:1;0:1;0:1]\nMultibodies\n"
CUBE = "1 8 12 36\n1 12\n" + "".join(f"{x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))
CUBE += "1 2 -4\n1 4 -3\n5 7 -8\n5 8 -6\n1 5 -6\n1 6 -2\n3 4 -8\n3 8 -7\n1 3 -7\n1 7 -5\n2 6 -8\n2 8 -4\n"
ROBOT = "Active\n1\ncube.g Planar Rotational\nConnections\n0\n"
PATH = "VIZMO_PATH_FILE   Path Version 2012\n1\n"
BASE = '<Base filename="x.g" type="fixed" transform="0 0 0 0 0 0"/>'
MEGA = 1 << 20


def xml(inside: str) -> str:
    return f"<Environment>{inside}</Environment>"


def passive(inside: str) -> str:
    return f'<MultiBody type="passive">{inside}</MultiBody>'


def many_attributes(count: int) -> str:
    return "".join(f' a{i}=""' for i in range(count))


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


def byu(mesh: Mesh) -> str:
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in mesh.vertices.tolist())
    faces = "".join(f"{a} {b} -{c}\n" for a, b, c in mesh.faces + 1)
    n, m = len(mesh.vertices), len(mesh.faces)
    return f"1 {n} {m} {3 * m}\n1 {m}\n{rows}{faces}"


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
        "attributes of the root": (lambda n: xml("").replace(">", f"{many_attributes(n)}>", 1), 10_000),
        "quotes in front of the root": (lambda n: "<!DOCTYPE e " + "<!--" * n, 10_000),
        "entities that are not closed": (lambda n: xml("&a" * n), 10_000),
        "options that are not closed": (lambda n: BOX + "1\nPassive\nx.g " + "-a(" * n, 20_000),
        "digits that are no number": (lambda n: BOX + f"1\nPassive\nx.g {'1' * n}x", 5000),
        "digits on both sides of a point": (lambda n: BOX + f"1\nPassive\nx.g {'1' * n}.{'1' * n}x", 5000),
    }
    MAPS: ClassVar[dict[str, tuple[Callable[[int], str], int]]] = {
        "hashes": (lambda n: "#" * n, 20_000),
        "a long word": (lambda n: "x" * n + "GRAPHSTAR", 20_000),
        "sections without end": (lambda n: "#####LPSTART#####\n" * n + "#####GRAPHSTART#####\n0 0 0\n", 500),
        "hashes in a section": (lambda n: f"#####LPSTART#####\n{'#' * n}\n#####GRAPHSTART#####\n0 0 0\n", 5000),
        "digits that are no number": (lambda n: f"#####GRAPHSTART#####\n1 0 1\n0 {'1' * n}x 0 0 0 0 0\n", 5000),
    }
    DIGITS: ClassVar[dict[str, Callable[[str], object]]] = {
        "byu": lambda w: read_byu(f"1 3 1 3\n1 1\n{w} 0 0\n1 0 0\n0 1 0\n1 2 -3\n", "x", DiagnosticLog(), Limits()),
        "obj": lambda w: read_obj(f"v {w} 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "x", DiagnosticLog(), Limits()),
        "query": lambda w: rows_of(f"{w} 0 0\n", Limits()),
        "path": lambda w: read_path(Source.of("x", f"{PATH}1\n{w} 0 0\n"), (3,), (1,), DiagnosticLog()),
        "count of a path": lambda w: read_path(Source.of("x", f"{PATH}{w}\n0 0 0\n"), (3,), (1,), DiagnosticLog()),
    }

    @staticmethod
    def grows(run: Callable[[str], object], make: Callable[[int], str], size: int) -> float:
        small, large = make(size), make(4 * size)
        # What is quadratic is so every time; what the machine does besides is not.
        for _ in range(3):
            ratio = TestTime.best(run, large) / max(1e-3, TestTime.best(run, small))
            if ratio < 10:
                break
        return ratio

    @staticmethod
    def best(run: Callable[[str], object], text: str) -> float:
        times: list[float] = []
        for _ in range(3):
            start = time.process_time()
            with suppress(Env2MjcfError):
                run(text)
            times.append(time.process_time() - start)
        return min(times)

    @pytest.mark.slow_but("elements")
    @pytest.mark.parametrize("name", TEXTS)
    def test_of_an_environment(self, read: Reader, name: str) -> None:
        assert self.grows(read.env, *self.TEXTS[name]) < 10

    @pytest.mark.parametrize("name", MAPS)
    def test_of_a_roadmap(self, name: str) -> None:
        assert self.grows(roadmap, *self.MAPS[name]) < 10

    @pytest.mark.parametrize("reader", DIGITS)
    def test_of_digits_that_are_no_number(self, reader: str) -> None:
        assert self.grows(self.DIGITS[reader], lambda n: f"{'1' * n}x", 5000) < 10

    def test_of_rows_of_text(self, read: Reader) -> None:
        read.file(CUBE, "cube.g")
        scene = read.scene(BOX + "1\n" + ROBOT)

        def run(text: str) -> None:
            of_file(scene, str(read.file(text, "rows.csv")), False, Limits(), DiagnosticLog())

        assert self.grows(run, lambda n: f"0 0 {'1' * n}x\n", 5000) < 10

    def test_of_edges_of_a_robot_that_cannot_move(self) -> None:
        def run(text: str) -> None:
            read_roadmap(Source.of("x.map", text), (0, 6), DiagnosticLog())
            read_roadmap(Source.of("x.map", text), (0,), DiagnosticLog())

        def many(n: int) -> str:
            return f"#####GRAPHSTART#####\n1 {n} 1\n0 {n}\n" + f"0 {n} 1\n" * n + "#####GRAPHSTOP#####\n"

        assert self.grows(run, many, 500) < 10

    def test_of_rows_of_many_robots(self) -> None:
        def run(text: str) -> None:
            read_query(Source.of("x.query", text), (0,) * text.count("\n"), DiagnosticLog())

        assert self.grows(run, lambda n: "".join(f"{i}\n" for i in range(n)), 2000) < 10

    def test_of_telling_what_a_file_is(self, read: Reader) -> None:
        def run(text: str) -> None:
            lint([read.file(text, "hostile.xml")])

        # Each comment could end where any later one does: this is exponential, not quadratic.
        assert self.grows(run, lambda n: "<!---->" * n + "x", 6) < 10

    def test_triangles_without_neighbours_are_not_compared_each_with_each(self) -> None:
        def steps(count: int) -> int:
            work = Work()
            repaired(loose_triangles(count), work)
            return work.done

        assert steps(2000) < 6 * steps(500)


class TestWork:
    def test_a_mesh_that_takes_too_much_is_refused(self, read: Reader) -> None:
        text = BOX + "1\nPassive\nmesh.g 0 0 0 0 0 0\n"
        read.file(byu(loose_triangles(100)), "mesh.g")
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
            BOX
            + "1\nActive\n3\nx.g Fixed 0 0 0 0 0 0\nx.g Joint\nx.g Joint\nConnections\n2\n"
            + "".join(f"{i} {i + 1} NonActuated\n{'0 ' * 6}\n{'0 ' * 4}\n{'0 ' * 6}\n" for i in range(2)),
            x,
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
    "mesh_work": ("GEO273", lambda r, x: r.scene(BOX + "1\nPassive\nloose.g 0 0 0 0 0 0\n", x)),
    "pairs": ("GEO275", lambda r, x: r.scene(BOX + "3\n" + "Passive\ncube.g 9 9 9 0 0 0\n" * 2 + ROBOT, x)),
}


class TestLimits:
    def test_each_is_passed(self) -> None:
        assert set(PASSED) == {f.name for f in fields(Limits)}

    @pytest.mark.parametrize("name", PASSED)
    def test_each_has_a_diagnostic_that_names_its_option(self, read: Reader, name: str) -> None:
        read.file(CUBE, "cube.g")
        read.file(byu(loose_triangles(4)), "loose.g")
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
from env2mjcf.companions.arrays import map_array
from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.errors import Env2MjcfError
from env2mjcf.formats.lexer import parse_integer
from env2mjcf.formats.meshes.byu import read_byu, read_gms
from env2mjcf.formats.meshes.obj import read_obj
from env2mjcf.formats.path import read_path
from env2mjcf.formats.reading import read
from env2mjcf.formats.roadmap import read_roadmap
from env2mjcf.formats.source import Source
from env2mjcf.limits import Limits
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
        lambda: read(sys.argv[1] + f"/bodies{{n}}.env", limits=unlimited),
        lambda: read(sys.argv[1] + f"/links{{n}}.env", limits=unlimited),
        lambda: map_array(sys.argv[1] + f"/rows{{n}}.npy", log),
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
    }

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


class TestIntegers:
    """Leading zeros do not make a number large, however many Python would take."""

    ZEROS = "0" * 5000

    def test_of_counts_and_indices(self, read: Reader) -> None:
        joined = f"{self.ZEROS} {self.ZEROS}1 NonActuated\n{'0 ' * 6}\n{'0 ' * 4}\n{'0 ' * 6}\n"
        arm = f"Active\n2\nx.g Fixed 0 0 0 0 0 0\nx.g Joint\nConnections\n1\n{joined}"
        (robot,) = read.env(BOX + f"{self.ZEROS}1\n{arm}").robots
        assert (robot.connections[0].previous, robot.connections[0].next) == (0, 1)

    @pytest.mark.parametrize("digits", [ZEROS + "61300", "1" * 5000])
    def test_of_versions(self, digits: str) -> None:
        text = f"Roadmap Version Number {digits}\n{NODES}"
        assert read_roadmap(Source.of("x.map", text), (3,), DiagnosticLog()).header.version == digits

    @pytest.mark.parametrize("digits", ["1" * 400, "-" + "1" * 5000])
    def test_what_is_too_large_is_refused(self, read: Reader, digits: str) -> None:
        assert fault(lambda: read.env(BOX + f"{digits}\n")).code == "ENV113"

    @pytest.mark.parametrize(
        ("word", "value"), [("+7", 7), ("-0012", -12), ("000", 0), ("9007199254740993", 2**53 + 1)]
    )
    def test_each_digit_counts(self, word: str, value: int) -> None:
        assert parse_integer(word) == value


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

    @pytest.mark.parametrize(("row", "word"), [("1.5 0 .", "."), ("-5 0 -", "-"), ("0, 1x,1", "1x")])
    def test_of_a_word_that_another_one_holds(self, read: Reader, row: str, word: str) -> None:
        read.file(CUBE, "cube.g")
        scene = read.scene(BOX + "1\n" + ROBOT)
        path = str(read.file(f"0 0 0\n{row}\n", "rows.csv"))
        found = fault(lambda: of_file(scene, path, False, Limits(), DiagnosticLog()))
        assert found.span is not None
        assert (found.span.line, found.span.column) == (2, row.rindex(word) + 1)


def npy(array: np.ndarray, version: tuple[int, int] = (1, 0)) -> bytes:
    file = io.BytesIO()
    np.lib.format.write_array(file, array, version)
    return file.getvalue()


def npy_of(shape: str) -> bytes:
    """An array whose header says this, and which holds next to nothing."""
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}}}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + b"0" * 48


def zipped() -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("a.npy", b"")
    return file.getvalue()


def checked(scene: env2mjcf.Scene, path: str) -> np.ndarray:
    return of_file(scene, path, False, Limits(), DiagnosticLog()).q


def batched(scene: env2mjcf.Scene, path: str) -> np.ndarray:
    source = open_rows(path, scene.space, True)
    return source.decoded(source.raw(0, len(source)), 0)


@pytest.mark.filterwarnings("always")
@pytest.mark.parametrize("verb", [checked, batched])
class TestArrays:
    REFUSED: ClassVar[dict[str, bytes]] = {
        "a damaged archive": b"PK\x03\x04" + b"0" * 100,
        "a whole archive": zipped(),
        "an empty file": b"",
        "more rows than there are numbers": npy_of(f"({10**30}, 3)"),
        "no row of more numbers than there are": npy_of(f"(0, {10**30})"),
        "as many rows as an index holds": npy_of(f"({2**62}, 3)"),
        "fewer rows than none": npy_of("(-1, 3)"),
        "a header as deep as long": npy_of(f"({'-' * 9000}1, 3)"),
        "words": npy(np.full((1, 3), "a")),
        "truths": npy(np.full((1, 3), True)),
        "complex numbers": npy(np.full((1, 3), 1j)),
        "nan": npy(np.full((1, 3), np.nan)),
        "1e150": npy(np.full((1, 3), 1e150)),
        "1e308": npy(np.full((1, 3), 1e308)),
        "what no double holds": npy(np.full((1, 3), np.finfo(np.longdouble).max)),
        "four numbers": npy(np.zeros((1, 5))),
    }
    READ: ClassVar[dict[str, bytes]] = {
        "version 1.0": npy(np.ones((2, 3))),
        "version 2.0": npy(np.ones((2, 3)), (2, 0)),
        "version 3.0": npy(np.ones((2, 3)), (3, 0)),
        "integers": npy(np.ones((2, 3), dtype=np.uint8)),
        "long doubles": npy(np.ones((2, 3), dtype=np.longdouble)),
        "the other byte order": npy(np.ones((2, 3), dtype=">f4")),
        "column by column": npy(np.ones((2, 3), order="F")),
    }

    @pytest.fixture
    def scene(self, read: Reader) -> env2mjcf.Scene:
        read.file(CUBE, "cube.g")
        return read.scene(BOX + "1\n" + ROBOT)

    @pytest.mark.parametrize("content", REFUSED)
    def test_what_is_no_rows_is_refused(self, read, scene, verb, content, recwarn) -> None:
        path = str(read.file(self.REFUSED[content], "rows.npy"))
        assert fault(lambda: verb(scene, path)).code in ("CFG504", "CFG505")
        assert not list(recwarn)

    @pytest.mark.parametrize("content", READ)
    def test_rows_are_read(self, read, scene, verb, content) -> None:
        path = str(read.file(self.READ[content], "rows.npy"))
        np.testing.assert_array_equal(verb(scene, path), scene.space.decode(np.ones((2, 3))))

    def test_the_row_that_is_too_large_is_named(self, read, scene, verb) -> None:
        rows = np.zeros((5, 3))
        rows[3, 1] = -1e101
        path = str(read.file(npy(rows), "rows.npy"))
        found = fault(lambda: verb(scene, path)).diagnostic.message
        assert f"row 3 of {path}: {scene.space.names[1]} is -1e+101" in found
