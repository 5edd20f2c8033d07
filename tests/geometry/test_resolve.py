"""Mesh files, found by the names that a scene gives them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.errors import GeometryError, Severity, Span
from env2mjcf.geometry import resolve
from env2mjcf.geometry.resolve import resolve_all
from env2mjcf.model.environment import BaseKind, Body, Dialect, Environment, MultiBody, MultiBodyKind
from env2mjcf.options import Options


def scene(directory: Path, *names: str) -> Environment:
    """A scene with one obstacle per name; body k stands on line k + 1."""
    return Environment(
        name="scene",
        dialect=Dialect.A,
        multibodies=tuple(
            MultiBody(MultiBodyKind.PASSIVE, (Body(name, BaseKind.FIXED, span=Span("scene.env", line, 5, len(name))),))
            for line, name in enumerate(names, 1)
        ),
        directory=directory,
        path="scene.env",
    )


def find(
    directory: Path, *names: str, strict: bool = False, **options: object
) -> tuple[dict[str, Path], DiagnosticLog]:
    log = DiagnosticLog(strict)
    return resolve_all(scene(directory, *names), Options.from_keywords(options), log), log


def touch(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()
    return path


def test_files_lie_beside_the_scene(tmp_path: Path) -> None:
    a, b = touch(tmp_path / "a.g"), touch(tmp_path / "sub" / "b.g")
    found, log = find(tmp_path, "sub/b.g", "a.g", "sub/b.g", strict=True)
    assert list(found.items()) == [("sub/b.g", b), ("a.g", a)]
    assert len(log) == 0


def test_the_scene_s_folder_comes_before_mesh_dirs_and_these_come_in_order(tmp_path: Path) -> None:
    here, one, two = (tmp_path / d for d in ("here", "one", "two"))
    for folder, names in ((here, "a"), (one, "ab"), (two, "abc")):
        for name in names:
            touch(folder / f"{name}.g")
    found, _ = find(here, "a.g", "b.g", "c.g", mesh_dirs=[one, str(two)], strict=True)
    assert list(found.values()) == [here / "a.g", one / "b.g", two / "c.g"]


def test_the_current_directory_is_not_searched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    touch(tmp_path / "cwd" / "a.g")
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "cwd")
    with pytest.raises(GeometryError, match="GEO201"):
        find(tmp_path / "here", "a.g")


def test_backslashes_are_read_as_slashes_with_a_warning(tmp_path: Path) -> None:
    b = touch(tmp_path / "sub" / "b.g")
    found, log = find(tmp_path, "sub\\b.g")
    assert found == {"sub\\b.g": b}
    assert [(d.code, d.severity, str(d.span)) for d in log] == [("GEO206", Severity.WARNING, "scene.env:1:5")]
    with pytest.raises(GeometryError, match="GEO206"):
        find(tmp_path, "sub\\b.g", strict=True)


def test_a_file_whose_name_holds_a_backslash_is_found_as_it_stands(tmp_path: Path) -> None:
    odd = touch(tmp_path / "sub\\b.g")
    touch(tmp_path / "sub" / "b.g")
    assert find(tmp_path, "sub\\b.g", strict=True)[0] == {"sub\\b.g": odd}


@pytest.mark.parametrize("name", ["Sub/B.g", "sub/b.G", "SUB\\B.G"])
def test_case_is_forgiven_with_a_warning(tmp_path: Path, name: str) -> None:
    b = touch(tmp_path / "sub" / "b.g")
    found, log = find(tmp_path, name)
    assert found == {name: b}
    assert [(d.code, d.severity) for d in log] == [("GEO205", Severity.WARNING)]


def test_the_exact_case_in_a_later_folder_wins(tmp_path: Path) -> None:
    touch(tmp_path / "here" / "A.g")
    a = touch(tmp_path / "more" / "a.g")
    assert find(tmp_path / "here", "a.g", mesh_dirs=tmp_path / "more", strict=True)[0] == {"a.g": a}


def test_files_outside_need_permission(tmp_path: Path) -> None:
    outside = touch(tmp_path / "secret" / "a.g")
    here = tmp_path / "here"
    here.mkdir()
    (here / "link.g").symlink_to(outside)
    (here / "folder").symlink_to(outside.parent)
    for name in ("../secret/a.g", str(outside), "link.g", "folder/a.g"):
        with pytest.raises(GeometryError) as caught:
            find(here, name)
        assert caught.value.code == "GEO202"
        for option in ("allow_outside=True", "--allow-outside", "mesh_dirs"):
            assert option in caught.value.diagnostic.hint
        assert find(here, name, allow_outside=True, strict=True)[0][name].samefile(outside)
        assert find(here, name, mesh_dirs=outside.parent, strict=True)[0][name].samefile(outside)


def test_a_folder_whose_name_begins_alike_is_outside(tmp_path: Path) -> None:
    touch(tmp_path / "here2" / "a.g")
    (tmp_path / "here").mkdir()
    with pytest.raises(GeometryError, match="GEO202"):
        find(tmp_path / "here", "../here2/a.g")


def test_links_and_absolute_names_that_stay_inside_are_allowed(tmp_path: Path) -> None:
    a = touch(tmp_path / "real" / "sub" / "a.g")
    (tmp_path / "scene").symlink_to(tmp_path / "real")
    (tmp_path / "real" / "link.g").symlink_to(a)
    found, _ = find(tmp_path / "scene", "link.g", str(a), "sub/../sub/a.g", strict=True)
    assert len(found) == 3
    assert all(path.samefile(a) for path in found.values())


def test_names_outside_are_not_listed(tmp_path: Path) -> None:
    touch(tmp_path / "secret" / "passwords.g")
    (tmp_path / "here").mkdir()
    for name in ("../secret/password.g", "../secret/PASSWORDS.G"):
        with pytest.raises(GeometryError) as caught:
            find(tmp_path / "here", name)
        assert "passwords.g" not in str(caught.value)


def test_a_missing_file_tells_where_it_was_sought_and_what_is_near(tmp_path: Path) -> None:
    touch(tmp_path / "more" / "robot_base.g")
    (tmp_path / "here").mkdir()
    with pytest.raises(GeometryError) as caught:
        find(tmp_path / "here", "robotbase.g", mesh_dirs=tmp_path / "more")
    error = caught.value
    assert error.code == "GEO201"
    assert str(error.span) == "scene.env:1:5"
    assert str(tmp_path / "here" / "robotbase.g") in error.diagnostic.message
    assert str(tmp_path / "more" / "robotbase.g") in error.diagnostic.message
    assert error.diagnostic.hint == "did you mean 'robot_base.g'?"


def test_one_error_names_all_missing_files(tmp_path: Path) -> None:
    touch(tmp_path / "here" / "good.g")
    touch(tmp_path / "out.g")
    with pytest.raises(GeometryError) as caught:
        find(tmp_path / "here", "good.g", "one.g", "../out.g", "one.g", "two.g")
    error = caught.value
    assert (error.code, error.diagnostic.subject, str(error.span)) == ("GEO201", "one.g", "scene.env:2:5")
    lines = error.diagnostic.message.splitlines()
    assert lines[0] == "3 mesh files cannot be used:"
    assert ["scene.env:2:5" in lines[1], "scene.env:3:5" in lines[2], "scene.env:5:5" in lines[3]] == [True] * 3
    assert ["one.g" in lines[1], "out.g" in lines[2], "two.g" in lines[3]] == [True] * 3
    assert "allow_outside=True" in lines[2]


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "folder.g").mkdir()
    (tmp_path / "broken.g").symlink_to("nowhere.g")
    (tmp_path / "loop.g").symlink_to("loop.g")
    os.mkfifo(tmp_path / "pipe.g")
    for name, word in {"folder.g": "folder", "broken.g": "broken", "loop.g": "broken", "pipe.g": "special"}.items():
        with pytest.raises(GeometryError, match=word) as caught:
            find(tmp_path, name)
        assert caught.value.code == "GEO203"
    with pytest.raises(GeometryError, match="NUL") as caught:
        find(tmp_path, "a\0.g")
    assert caught.value.code == "GEO203"


@pytest.mark.parametrize("name", ["x" * 5000 + ".g", "a.g/b.g", ".", ".."])
def test_impossible_names_are_geometry_errors(tmp_path: Path, name: str) -> None:
    touch(tmp_path / "a.g")
    with pytest.raises(GeometryError):
        find(tmp_path, name)


def test_a_file_that_may_not_be_read_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    touch(tmp_path / "a.g").chmod(0)
    # The superuser may read everything.
    monkeypatch.setattr(resolve.os, "access", lambda path, mode: False)
    with pytest.raises(GeometryError, match="may not be read") as caught:
        find(tmp_path, "a.g")
    assert caught.value.code == "GEO204"


def test_a_forbidden_file_does_not_hide_an_allowed_one(tmp_path: Path) -> None:
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "a.g").symlink_to(touch(tmp_path / "secret" / "a.g"))
    allowed = touch(tmp_path / "more" / "a.g")
    assert find(tmp_path / "here", "a.g", mesh_dirs=tmp_path / "more")[0] == {"a.g": allowed}
