"""Names are hostile: wherever one comes out, it is a name and nothing else."""

from __future__ import annotations

import json
import os
import re
import select
import socket
import subprocess
import sys
import unicodedata
from pathlib import Path
from typing import ClassVar
from xml.etree import ElementTree
from xml.sax.saxutils import escape

import mujoco
import numpy as np
import pytest
import trimesh
from scenes import box_mesh

import env2mjcf
from env2mjcf import ConversionError, FormatError, GeometryError, Roadmap
from env2mjcf.cli.main import main
from env2mjcf.errors import one_line
from env2mjcf.mjcf.markup import comment_text
from env2mjcf.model.names import file_stem, mesh_stem
from env2mjcf.view.web import page as wording

STEMS = {
    "script": "<script>alert(1)<",
    "quotes": "\"'&amp;&",
    "section": "]]>--><!--",
    "dashes": "a---b----",
    "newline": "a\nMultibodies\r\t9",
    "escape": "\x1b[2J\x1b]52;c;eA==\x07",
    "link": "\x1b]8;;evil\x1b\\",
    "c1": "\x9b2J\x85",
    "bidi": "a\u202eg.exe\u2066",
    "zero width": "\u200b\ufeff\u2060",
    "noncharacter": "\ufffe\uffff",
    "surrogate": "a\udcff",
    "astral": "\U0001f600",
    "reserved": "CON",
    "dotted": "..a..",
    "dash": "-rf",
    "long": "x" * 240,
    "wide": "\u6f22" * 80,
    "percent": "%s%n{0}{}$HOME`id`",
    "markup": "[red]a[b]:smile:",
    "hash": "#a#b",
    "backslash": "a\\b",
    "separator": "a\u2028b\u2029",
}
TRICKY = ("Cc", "Cf", "Cs", "Zl", "Zp")
# Letters and digits of any script, and what no file system or shell gives a meaning to inside a name.
PORTABLE = re.compile(r"(?![-.])(?!(?i:con|prn|aux|nul|com\d|lpt\d)(?:\.|$))[^\x00-\x1f\x7f<>:\"/\\|?*]+(?<![. ])")


@pytest.fixture(params=STEMS, name="stem")
def _stem(request: pytest.FixtureRequest) -> str:
    return STEMS[request.param]


# A lone surrogate cannot stand in a text, so no scene can name such a mesh.
@pytest.fixture(params=[k for k in STEMS if k != "surrogate"], name="mesh")
def _mesh(request: pytest.FixtureRequest) -> str:
    return STEMS[request.param]


def attribute(text: str) -> str:
    """Return a text as it stands in an attribute."""
    return escape(text, {'"': "&quot;", "\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})


def written(folder: Path, name: str, env: str = "scene") -> Path:
    """A scene whose robot and obstacle, which touch at home, have a mesh of this name; in XML what no word can be."""
    folder.mkdir(exist_ok=True)
    if name.strip("\\") and "/" not in name:
        (folder / name).write_text(box_mesh(0.5, 0.5, 0.5))
    if name.split() == [name] and "#" not in name:
        text = (
            f"Boundary Box [-9:9; -9:9; -9:9]\nMultibodies\n2\nActive\n1\n{name} Planar Rotational\nConnections\n0\n"
            f"Passive\n{name} 0.25 0 0 0 0 0\n"
        )
        path = folder / f"{env}.env"
        path.write_bytes(text.encode("utf-8", "surrogateescape"))
        return path
    named = attribute(name)
    (folder / "robot.xml").write_text(
        f'<Robot><MultiBody type="active"><Base type="planar" movement="rotational" filename="{named}"/>'
        "</MultiBody></Robot>"
    )
    (folder / "world.xml").write_text(
        '<Environment><Boundary space="workspace" shape="box" limits="[-9:9 ; -9:9 ; -9:9]"/><MultiBody type="passive">'
        f'<Base type="fixed" filename="{named}" transform="0.25 0 0 0 0 0"/></MultiBody></Environment>'
    )
    path = folder / f"{env}.xml"
    path.write_text(
        '<MotionPlanning><Problem><Environment filename="world.xml"/><Robot label="r" filename="robot.xml"/>'
        "</Problem></MotionPlanning>"
    )
    return path


def assert_harmless(*texts: str) -> None:
    """Nothing but line feeds can move a cursor, turn the direction of text, or hide."""
    for text in texts:
        assert [c for c in text if c != "\n" and unicodedata.category(c) in TRICKY] == []


# XML.


def test_mjcf_is_well_formed_loads_and_keeps_to_its_folder(mesh: str, tmp_path: Path) -> None:
    made = env2mjcf.convert(written(tmp_path / "in", f"{mesh}.g"), tmp_path / "out", cache=False)
    root = ElementTree.parse(made.xml).getroot()
    assert mujoco.MjModel.from_xml_path(str(made.xml)).nbody > 1
    assert_harmless(*(v for e in root.iter() for v in e.attrib.values()))
    assert root.find("script") is None
    for name in (e.get("file") for e in root.iter() if e.get("file")):
        assert name is not None
        assert PORTABLE.fullmatch(name.removeprefix("assets/"))
    for folder, _, files in os.walk(tmp_path / "out"):
        assert all(PORTABLE.fullmatch(f) and len(os.fsencode(f)) < 240 for f in files), (folder, files)
    assert sorted(os.listdir(tmp_path)) == ["in", "out"]


@pytest.mark.parametrize("text", ["--", "---", "a----b-", "-->", "\x1b\n--\x00", "\ud800", "x--"])
def test_a_comment_ends_where_it_should(text: str) -> None:
    for lines in ([text], [text, text]):
        (found,) = ElementTree.fromstring(
            f"<a><!--{comment_text(lines)}--></a>",
            ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True)),
        )
        assert found.tail is None


# Names of files.


def test_a_scene_of_any_name_becomes_a_file_of_a_plain_one(stem: str, tmp_path: Path) -> None:
    scene = written(tmp_path / "in", "cube.g", stem)
    made = env2mjcf.convert(scene, tmp_path / "out", cache=False)
    assert made.xml.parent == tmp_path / "out"
    assert PORTABLE.fullmatch(made.xml.name)
    assert len(os.fsencode(made.xml.name)) <= 200
    assert made.xml.is_file()


@pytest.mark.parametrize(
    ("name", "stem"),
    [
        ("scene", "scene"),
        ("maze 2", "maze 2"),
        ("CON", "_CON"),
        ("con .a", "_con .a"),
        ("nul.b.c", "_nul.b.c"),
        ("console", "console"),
        ("..", "_"),
        ("../x", "_.._x"),
        ("-o", "_-o"),
        ("", "_"),
        ("a. .", "a"),
        ("a:b", "a_b"),
        ("LPT1 ", "_LPT1"),
        ("\u202e\x1b\ud800", "_"),
    ],
)
def test_a_stem_is_fit_for_every_system(name: str, stem: str) -> None:
    assert file_stem(name) == stem
    assert file_stem(stem) == stem


# Terminals.


@pytest.mark.slow_but("script", "newline", "escape", "bidi", "surrogate", "long")
def test_no_name_reaches_a_terminal_as_it_is(
    mesh: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = str(written(tmp_path / "in", f"{mesh}.g"))
    monkeypatch.chdir(tmp_path)
    for words in (("info", scene, "--pairs", "--samples", "2"), ("check", scene), ("lint", scene)):
        main([*words, "--engine", "mujoco", "--no-cache", "--verbose"])
        assert_harmless(*capsys.readouterr())
        assert main([*words, "--engine", "mujoco", "--no-cache", "--json"]) in (0, 1)
        out, err = capsys.readouterr()
        assert json.loads(out)
        assert out.isascii()
        assert_harmless(err)
    (tmp_path / "in" / f"{mesh}.g").unlink()
    for words in (
        ("info", scene),
        ("convert", scene),
        ("lint", scene),
        ("lint", scene, "--github"),
        ("convert", scene, "--debug"),
    ):
        assert main([*words]) in (1, 3)
        assert_harmless(*capsys.readouterr())


def test_the_caret_stands_under_what_it_means(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for stem in (STEMS["escape"], STEMS["bidi"], STEMS["markup"]):
        scene = written(tmp_path / "in", f"{stem}.g")
        (tmp_path / "in" / f"{stem}.g").unlink()
        main(["info", str(scene)])
        lines = capsys.readouterr().err.splitlines()
        caret = next(i for i, line in enumerate(lines) if re.fullmatch(r" +\^+", line))
        start, end = lines[caret].index("^"), len(lines[caret])
        assert end - start == len(stem) + 2
        assert lines[caret - 1][end - 2 : end + 1] == ".g "
        assert_harmless(*lines)


def test_words_of_the_command_line_are_no_commands(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["\x1b[2J"], ["info", "a.env", "--\x1b[2J\u202e"], ["info", "a.env", "--scale", "\x9b1"]):
        assert main(words) == 2
        out, err = capsys.readouterr()
        assert_harmless(out, err)
        assert "\\x" in err
    # And a word that is not an option may hold what it likes.
    assert main(["info", "\x1b[2J.env"]) == 3
    assert "there is no file \\x1b[2J.env" in capsys.readouterr().err


def test_what_libraries_say_is_no_command_either() -> None:
    code = (
        "import sys, warnings, logging; from env2mjcf.cli.main import main; sys.argv = ['', '--version']; main();"
        "warnings.warn('\\x1b[2Ja'); logging.getLogger('trimesh').warning('\\x1b]0;b\\x07')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "\\x1b[2Ja" in done.stderr
    assert "\\x1b]0;b" in done.stderr
    assert_harmless(done.stderr)


# The page.


def test_a_name_on_the_page_is_text(stem: str) -> None:
    shown = wording.as_text(stem)
    assert not set("<>\"'") & set(shown)
    assert_harmless(shown.replace("\ufffe", "").replace("\uffff", ""), one_line(mesh_stem(f"{stem}.g")))


# Texts.


def test_a_roadmap_names_any_scene_and_reads_back(stem: str, tmp_path: Path) -> None:
    for env in (stem, f"{stem[:9]}#####GRAPHSTART#####", "#####ENVFILESTOP#####"):
        scene = env2mjcf.load(written(tmp_path / "in", "cube.g", env), engine="mujoco", cache=False)
        made = Roadmap.of([[0, 0, 0], [1, 0, 0]], [[0, 1]])
        found = env2mjcf.read_roadmap(scene, env2mjcf.write_roadmap(scene, made, tmp_path / "a.map"))
        np.testing.assert_array_equal(found.q, made.q)
        assert found.edges.tolist() == [[0, 1]]
        assert len(found.header.environment.splitlines()) == 1
        assert not found.diagnostics


def test_a_translated_scene_names_the_same_meshes_or_is_refused(mesh: str, tmp_path: Path) -> None:
    from env2mjcf.translation import translate, write_environment

    before = env2mjcf.read(written(tmp_path / "in", f"{mesh}.g"))
    new = tmp_path / "in" / "new.env"
    if mesh.split() != [mesh] or "#" in mesh:
        with pytest.raises(ConversionError) as caught:
            write_environment(translate(before, "D").environment, new)
        assert caught.value.code == "ENV178"
        assert not new.exists()
        return
    after = write_environment(translate(before, "D").environment, new).environment
    names = [[b.filename for m in e.multibodies for b in m.bodies] for e in (before, env2mjcf.read(after))]
    assert names[0] == names[1]


# Paths that leave the folder.

OUTSIDE = (
    "../secret.g",
    "sub/../../secret.g",
    "/etc/passwd",
    "{}/secret.g",
    "//{}/secret.g",
    "..\\secret.g",
    "\\\\server\\share\\a.g",
    "//server/share/a.g",
    "C:\\x.g",
    "c:x.g",
    "file:///etc/passwd",
    "file://{}/secret.g",
    "http://127.0.0.1/a.g",
    "link.g",
    "folder/secret.g",
    "~/a.g",
    "$HOME/a.g",
    "/dev/zero",
    "/proc/self/environ",
)


@pytest.mark.parametrize("name", OUTSIDE)
@pytest.mark.parametrize("place", ["env", "robot", "xml", "problem environment", "problem robot"])
def test_nothing_outside_the_folder_is_opened(name: str, place: str, tmp_path: Path) -> None:
    here = tmp_path / "here"
    (here / "sub").mkdir(parents=True)
    (tmp_path / "secret.g").write_text(box_mesh(0.5, 0.5, 0.5))
    (here / "link.g").symlink_to(tmp_path / "secret.g")
    (here / "folder").symlink_to(tmp_path)
    (here / "cube.g").write_text(box_mesh(0.5, 0.5, 0.5))
    name = name.replace("{}", str(tmp_path))
    robot = "1\n{} Planar Rotational\nConnections\n0\n"
    head = "Boundary Box [-9:9; -9:9; -9:9]\nMultibodies\n{}\n"
    options = {}
    if place == "env":
        (here / "a.env").write_text(f"{head.format(1)}Active\n{robot.format(name)}")
        scene = here / "a.env"
    elif place == "robot":
        (here / "a.env").write_text(f"{head.format(1)}Passive\ncube.g 3 0 0 0 0 0\n")
        (here / "a.robot").write_text(robot.format(name))
        scene, options = here / "a.env", {"robots": [here / "a.robot"]}
    else:
        scene = written(here, "a b.g" if place == "xml" else "cube.g")
        scene = scene if scene.suffix == ".xml" else written(here, "a b.g")
        target = {"xml": "world.xml", "problem environment": "scene.xml", "problem robot": "scene.xml"}[place]
        was = {"xml": "a b.g", "problem environment": "world.xml", "problem robot": "robot.xml"}[place]
        text = (here / target).read_text()
        assert was in text
        (here / target).write_text(text.replace(was, attribute(name)))
    with watching(tmp_path, here) as opened, pytest.raises((GeometryError, FormatError)) as caught:
        env2mjcf.load(scene, engine="mujoco", cache=False, **options)
    assert opened == []
    assert caught.value.code in ("GEO201", "GEO202", "GEO203", "ENV101", "ENV104", "ENV150")


@pytest.mark.parametrize("kind", ["SYSTEM", 'PUBLIC "e"'])
@pytest.mark.parametrize("there", ["http://127.0.0.1:{port}/e.dtd", "{folder}/e.dtd", "../e.dtd"])
def test_a_document_type_elsewhere_is_not_fetched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, there: str
) -> None:
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    (tmp_path / "e.dtd").write_text("<!this is not well-formed")
    # No audit hook sees what a library in C opens: a server does, and so does what would break the document.
    with socket.create_server(("127.0.0.1", 0)) as server, watching(tmp_path, here) as opened:
        place = there.format(port=server.getsockname()[1], folder=tmp_path)
        scene = here / "scene.xml"
        scene.write_text(f'<!DOCTYPE Environment {kind} "{place}">\n<Environment/>')
        assert env2mjcf.read(scene).multibodies == ()
        assert select.select([server], [], [], 0)[0] == []
    assert opened == []


class watching:
    """Collects what is opened below a folder but not below another, devices, and connections, while it lasts."""

    _active: ClassVar[list[watching]] = []
    _hooked = False

    def __init__(self, below: Path, but: Path) -> None:
        self.below, self.but, self.opened = str(below), str(but), list[str]()

    def __enter__(self) -> list[str]:
        if not watching._hooked:
            sys.addaudithook(watching._hook)
            watching._hooked = True
        watching._active.append(self)
        return self.opened

    def __exit__(self, *_: object) -> None:
        watching._active.remove(self)

    @staticmethod
    def _hook(event: str, arguments: tuple) -> None:
        if event in ("socket.connect", "socket.getaddrinfo") and watching._active:
            watching._active[-1].opened.append(event)
        if event != "open" or not watching._active or not isinstance(arguments[0], (str, bytes)):
            return
        watcher, path = watching._active[-1], os.path.realpath(os.fsdecode(arguments[0]))
        inside = path.startswith(watcher.but + os.sep)
        if (path.startswith(watcher.below + os.sep) and not inside) or path.startswith(
            ("/etc/passwd", "/dev/zero", "/proc/self/env")
        ):
            watcher.opened.append(path)


def glb(uri: str) -> bytes:
    """A GLB whose vertices, and a picture, lie in another file."""
    buffer = {"uri": uri, "byteLength": 36}
    views = [{"buffer": 0, "byteLength": 36}]
    accessor = {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1]}
    head = {
        "asset": {"version": "2.0"},
        "buffers": [buffer],
        "bufferViews": views,
        "accessors": [accessor],
        "images": [{"uri": uri}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    }
    text = json.dumps(head).encode()
    text += b" " * (-len(text) % 4)
    return (
        b"glTF"
        + (2).to_bytes(4, "little")
        + (20 + len(text)).to_bytes(4, "little")
        + len(text).to_bytes(4, "little")
        + b"JSON"
        + text
    )


@pytest.mark.parametrize("kind", ["obj", "glb", "ply"])
def test_a_mesh_opens_no_other_file(kind: str, tmp_path: Path) -> None:
    here = tmp_path / "here"
    here.mkdir()
    for name in ("secret.mtl", "secret.bin"):
        (tmp_path / name).write_bytes(b"map_Kd ../secret.bin\n" * 8)
    if kind == "obj":
        solid = "".join(f"{line}\n" for line in trimesh.creation.box().export(file_type="obj").splitlines())
        content = f"mtllib ../secret.mtl\nusemtl a\n{solid}".encode()
    elif kind == "glb":
        content = glb("../secret.bin")
    else:
        content = trimesh.creation.box().export(file_type="ply", encoding="ascii")
        content = content.replace(b"comment", b"comment TextureFile ../secret.bin\ncomment", 1)
    path = written(here, f"a.{kind}")
    (here / f"a.{kind}").write_bytes(content)
    with watching(tmp_path, here) as opened:
        try:
            env2mjcf.load(path, engine="mujoco", cache=False)
        except GeometryError:
            assert kind == "glb"  # without its vertices it is not a mesh
    assert opened == []
