"""Bad input through the front door: each case has one clear error, or a warning, with code, message and place."""

from __future__ import annotations

import errno
import os
import pickle
from collections.abc import Callable
from pathlib import Path

import pytest
from scenes import box_mesh, free_cube, without_privileges, write_scene

import env2mjcf
from env2mjcf import batch

GOOD = free_cube("5 0 0 0 0 0")
ARM = """Boundary Box [-9:9 ; -9:9 ; -9:9]
Multibodies
1
Active
2
cube.g Fixed 0 0 0 0 0 0
cube.g Joint
Connections
1
0 1 Revolute -1:1
1 0 0 0 0 0  0 0 0 0  0 0 0 0 0 0
"""


@pytest.mark.parametrize(
    ("text", "code", "line", "column", "words"),
    [
        pytest.param(ARM[: ARM.rindex("0 0 0 0\n")], "ENV111", 11, 25, "the file ends", id="truncated file"),
        pytest.param(GOOD.replace("Passive", "Dynamic"), "ENV120", 12, 1, "unknown multibody tag 'Dynamic'", id="tag"),
        pytest.param(GOOD.replace("5 0 0", "nan 0 0"), "ENV113", 13, 8, "'nan'", id="NaN"),
        pytest.param(ARM.replace("0 1 Rev", "0 2 Rev"), "ENV115", 10, 3, "body index 2 is out of range", id="index"),
        pytest.param(ARM.replace("Revolute", "Hinge"), "ENV121", 10, 5, "unknown joint type 'Hinge'", id="joint type"),
        pytest.param("", "ENV130", 1, 1, "is empty", id="empty file"),
    ],
)
def test_a_bad_text_is_refused_at_its_place(
    tmp_path: Path, text: str, code: str, line: int, column: int, words: str
) -> None:
    path = write_scene(tmp_path, text)
    with pytest.raises(env2mjcf.FormatError) as caught:
        env2mjcf.load(path)
    span = caught.value.span
    assert span is not None
    assert (caught.value.code, span.line, span.column) == (code, line, column)
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"{path}:{line}:{column}: error {code}: ")
    assert "^" in str(caught.value) or not text


@pytest.mark.parametrize(
    ("text", "line"),
    [
        pytest.param(GOOD.replace("Multibodies\n2", "Multibodies\n3"), 4, id="too many declared"),
        pytest.param(GOOD.replace("Multibodies\n2", "Multibodies\n1"), 4, id="too few declared"),
        pytest.param(ARM.replace("Connections\n1", "Connections\n0"), 9, id="connections"),
        pytest.param(ARM.replace("Active\n2", "Active\n5"), 5, id="bodies"),
    ],
)
def test_a_wrong_count_is_read_with_a_warning(tmp_path: Path, text: str, line: int) -> None:
    path = write_scene(tmp_path, text)
    scene = env2mjcf.read(path)
    found = [d for d in scene.diagnostics if d.code == "ENV203"]
    assert [d.span.line for d in found if d.span] == [line]
    assert "declares" in found[0].message
    with pytest.raises(env2mjcf.FormatError, match="ENV203"):
        env2mjcf.read(path, strict=True)


def test_two_parents_are_refused_where_the_dialect_forbids_them(tmp_path: Path) -> None:
    connection = (
        '<Connection joint="nonactuated" parentIndex="0" childIndex="1" transformParentToDH="0 0 0 0 0 0" '
        'initialDHParams="0 0 0 0" transformDHToChild="0 0 0 0 0 0"/>'
    )
    robot = (
        '<Robot>\n<MultiBody type="active">\n<Base filename="cube.g" type="fixed"/>\n<Link filename="cube.g" '
        f'type="joint">\n{connection}\n{connection}\n</Link>\n</MultiBody>\n</Robot>\n'
    )
    path = write_scene(tmp_path, "Boundary Box [-9:9 ; -9:9 ; -9:9]\nMultibodies\n0\n")
    (tmp_path / "robot.xml").write_text(robot)
    with pytest.raises(env2mjcf.FormatError, match="expected one") as caught:
        env2mjcf.read(path, robots=[tmp_path / "robot.xml"])
    assert caught.value.code == "ENV147"
    assert caught.value.span is not None
    assert caught.value.span.line == 6


def test_two_parents_are_a_loop_where_the_dialect_allows_them(tmp_path: Path) -> None:
    text = ARM.replace("Connections\n1", "Connections\n2") + ARM.split("Connections\n1\n")[1]
    assert len(env2mjcf.read(write_scene(tmp_path, text)).robots[0].connections) == 2


def _missing(folder: Path) -> None:
    (folder / "cube.g").unlink()


def _folder(folder: Path) -> None:
    (folder / "cube.g").unlink()
    (folder / "cube.g").mkdir()


def _write(text: str | bytes) -> Callable[[Path], None]:
    data = text.encode() if isinstance(text, str) else text
    return lambda folder: (folder / "cube.g").write_bytes(data) and None


@pytest.mark.parametrize(
    ("spoil", "code", "place", "words"),
    [
        pytest.param(_missing, "GEO201", "scene.env:8:1", "tried", id="missing"),
        pytest.param(_folder, "GEO203", "scene.env:8:1", "folder", id="a folder"),
        pytest.param(_write(""), "GEO210", "cube.g:1:1", "empty", id="empty file"),
        pytest.param(_write("1 0 0 0\n1 0\n"), "GEO210", "cube.g", "", id="no vertices"),
        pytest.param(_write(box_mesh(1, 1, 1).replace("8 -7", "9 -7")), "GEO214", "cube.g:20:3", "9", id="index"),
        pytest.param(_write(box_mesh(1, 1, 1)[:-20]), "GEO213", "cube.g", "ends", id="truncated"),
        pytest.param(_write(b"\x7fELF\x00\x01\x02\xff\xfe"), "GEO211", "cube.g:1:1", "", id="binary"),
        pytest.param(_write("1 3 1 3\n1 1\n0 0 0\n1 0 0\n2 0 0\n1 2 -3\n"), "GEO231", "scene.env:8:1", "", id="a line"),
    ],
)
def test_a_bad_mesh_is_refused_at_its_place(
    tmp_path: Path, spoil: Callable[[Path], None], code: str, place: str, words: str
) -> None:
    path = write_scene(tmp_path, GOOD)
    spoil(tmp_path)
    with pytest.raises(env2mjcf.GeometryError) as caught:
        env2mjcf.load(path)
    assert caught.value.code == code
    assert str(caught.value).startswith(str(tmp_path / place))
    assert words in str(caught.value)


def test_a_flat_mesh_is_a_sheet_with_a_warning(tmp_path: Path) -> None:
    sheet = "1 4 2 6\n1 2\n-1 -1 0\n1 -1 0\n1 1 0\n-1 1 0\n1 2 -3\n1 3 -4\n"
    path = write_scene(tmp_path, free_cube("sheet.g 0 0 0 0 0 0"), sheet=sheet)
    scene = env2mjcf.load(path)
    found = [d for d in scene.diagnostics if d.code == "GEO230"]
    assert [str(d.span) for d in found] == [f"{path}:13:1"]
    assert "one plane" in found[0].message
    band = 1e-5 * scene.extent
    assert scene.in_collision([0, 0, 0.5 - band, 0, 0, 0])
    assert not scene.in_collision([0, 0, 0.5 + band, 0, 0, 0])


def test_a_folder_instead_of_a_scene(tmp_path: Path) -> None:
    write_scene(tmp_path, GOOD)
    with pytest.raises(env2mjcf.FormatError, match=r"is a folder.*\n.*scene\.env") as caught:
        env2mjcf.load(tmp_path)
    assert caught.value.code == "ENV102"


def test_a_binary_file_instead_of_a_scene(tmp_path: Path) -> None:
    path = tmp_path / "scene.env"
    path.write_bytes(b"Boundary\n\x00\x01")
    with pytest.raises(env2mjcf.FormatError, match="NUL byte") as caught:
        env2mjcf.load(path)
    assert caught.value.code == "ENV107"
    assert caught.value.span is not None
    assert caught.value.span.line == 2


@pytest.mark.parametrize(("name", "code"), [("scene.env", "ENV103"), ("cube.g", "GEO204")])
def test_a_file_that_may_not_be_read_is_named(tmp_path: Path, name: str, code: str) -> None:
    path = write_scene(tmp_path, GOOD)
    (tmp_path / name).chmod(0)
    answer = without_privileges(tmp_path, lambda: env2mjcf.load(path))
    assert answer.startswith(code)
    assert str(tmp_path / name) in answer


@pytest.mark.parametrize("what", ["scene", "robot", "query", "mesh", "path", "rows", "batch"])
def test_a_missing_file_is_a_file_not_found_error_too(tmp_path: Path, what: str) -> None:
    path, none = write_scene(tmp_path, GOOD), tmp_path / "none.any"
    scene = env2mjcf.load(path)
    calls: dict[str, Callable[[], object]] = {
        "scene": lambda: env2mjcf.load(none),
        "robot": lambda: env2mjcf.read(path, robots=[none]),
        "query": lambda: env2mjcf.load(path, query=none),
        "mesh": lambda: env2mjcf.load(write_scene(tmp_path, GOOD.replace("cube.g 5", "none.any.g 5"))),
        "path": lambda: env2mjcf.read_path(scene, none),
        "rows": lambda: env2mjcf.read_configurations(none.with_suffix(".npy"), scene),
        "batch": lambda: batch.run(scene, none.with_suffix(".npy"), tmp_path / "out.npy"),
    }
    with pytest.raises(FileNotFoundError) as caught:
        calls[what]()
    error = caught.value
    assert (error.errno, error.strerror) == (errno.ENOENT, os.strerror(errno.ENOENT))
    assert isinstance(error, env2mjcf.GeometryError if what == "mesh" else env2mjcf.FormatError)
    assert error.code == ("GEO201" if what == "mesh" else "ENV101")
    assert error.errno == errno.ENOENT
    assert "none" in error.filename
    # Texts of an OSError with a number and a name are others: ours tells the code, the place and the hint.
    assert str(error) == str(error.diagnostic)
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert (str(again), again.diagnostics, again.errno) == (str(error), error.diagnostics, error.errno)


def test_folders_and_forbidden_files_are_errors_of_python_too(tmp_path: Path) -> None:
    with pytest.raises(IsADirectoryError) as caught:
        env2mjcf.read(tmp_path)
    assert isinstance(caught.value, env2mjcf.FormatError)
    assert (caught.value.code, caught.value.errno) == ("ENV102", errno.EISDIR)
    path = write_scene(tmp_path, GOOD)
    path.chmod(0)

    def read() -> None:
        with pytest.raises(PermissionError) as caught:
            env2mjcf.read(path)
        raise caught.value

    assert without_privileges(tmp_path, read).startswith("ENV103")
