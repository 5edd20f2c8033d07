"""What `convert` writes, and what it leaves behind when it cannot."""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import mujoco
import pytest
from scenes import MODELS, box_mesh, free_cube, without_privileges, write_scene

import env2mjcf

SEED = MODELS / "seed/seed.env"


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_a_folder_holds_all_that_the_model_needs(tmp_path: Path) -> None:
    result = env2mjcf.convert(SEED, tmp_path / "out")
    assert result.xml == tmp_path / "out/seed.xml"
    assert set(files(tmp_path / "out")) == {
        "seed.xml", *(str(p.relative_to(tmp_path / "out")) for p in result.assets)
    }  # fmt: skip
    moved = tmp_path / "elsewhere"
    (tmp_path / "out").rename(moved)
    assert mujoco.MjModel.from_xml_path(str(moved / "seed.xml")).nbody == 5


def test_a_file_name_may_be_given_instead_of_a_folder(tmp_path: Path) -> None:
    result = env2mjcf.convert(SEED, tmp_path / "deep/er/robot.xml")
    assert result.xml == tmp_path / "deep/er/robot.xml"
    assert mujoco.MjModel.from_xml_path(str(result.xml)).nbody == 5


def test_only_what_the_last_scene_named_is_removed(tmp_path: Path) -> None:
    path = write_scene(tmp_path / "in", free_cube("5 0 0 0 0 0"))
    out = tmp_path / "out"
    first = env2mjcf.convert(path, out)
    (out / "assets/mine.stl").write_text("not yours")
    (out / "assets/cube-0123456789ab.stl").write_text("not yours either")
    (out / "notes.txt").write_text("hello")
    write_scene(tmp_path / "in", free_cube("5 0 0 0 0 0"), cube=box_mesh(0.4, 0.4, 0.4))
    second = env2mjcf.convert(path, out)
    assert not set(first.assets) & set(second.assets)
    assert not any(p.exists() for p in first.assets)
    assert all(p.exists() for p in second.assets)
    assert (out / "assets/mine.stl").read_text() == "not yours"
    assert (out / "assets/cube-0123456789ab.stl").exists()
    assert (out / "notes.txt").exists()


def test_two_scenes_share_a_folder(tmp_path: Path) -> None:
    env2mjcf.convert(SEED, tmp_path)
    env2mjcf.convert(MODELS / "alpha/alpha.env", tmp_path)
    for name in ("seed", "alpha"):
        mujoco.MjModel.from_xml_path(str(tmp_path / f"{name}.xml"))


def test_a_refused_scene_leaves_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_scene(tmp_path / "in", free_cube("5 0 0 0 0 0"))
    out = tmp_path / "out"
    env2mjcf.convert(path, out)
    before = files(out)
    write_scene(tmp_path / "in", free_cube("6 0 0 0 0 0"), cube=box_mesh(0.3, 0.3, 0.3))

    def refuse(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(env2mjcf.conversion, "load_file", refuse)
    with pytest.raises(KeyboardInterrupt):
        env2mjcf.convert(path, out)
    assert files(out) == before


def test_a_truncated_asset_is_written_again(tmp_path: Path) -> None:
    result = env2mjcf.convert(SEED, tmp_path)
    whole = files(tmp_path)
    result.assets[0].write_bytes(b"")
    env2mjcf.convert(SEED, tmp_path)
    assert files(tmp_path) == whole


def test_a_scene_is_not_replaced_by_its_own_conversion(tmp_path: Path) -> None:
    shutil.copytree(MODELS / "xml-arm", tmp_path / "in")
    before = files(tmp_path / "in")
    with pytest.raises(env2mjcf.ConversionError, match="is not MJCF") as caught:
        env2mjcf.convert(tmp_path / "in/xml-arm.xml", tmp_path / "in")
    assert caught.value.code == "MJC423"
    assert files(tmp_path / "in") == before
    env2mjcf.convert(tmp_path / "in/xml-arm.xml", tmp_path / "in/model.xml")
    env2mjcf.convert(tmp_path / "in/xml-arm.xml", tmp_path / "in/model.xml")


@pytest.mark.parametrize(
    ("name", "edit"),
    [
        ("single quotes.xml", lambda text: text.replace('"', "'").encode()),
        ("blanks.xml", lambda text: re.sub(r'file="', 'file\n = "', text).encode()),
        ("UPPERCASE.XML", str.encode),
        ("a byte-order mark.xml", lambda text: b"\xef\xbb\xbf" + text.encode()),
        ("utf-16.xml", lambda text: ('<?xml version="1.0" encoding="UTF-16"?>\n' + text).encode("utf-16")),
        ("utf-16 big-endian.xml", lambda text: b"\xfe\xff" + text.encode("utf-16-be")),
        ("entities.xml", lambda text: text.replace(".stl", "&#46;stl").replace(".xml", "&#x2e;xml").encode()),
        ("a path.xml", lambda text: re.sub('file="(?:assets/)?', 'file="./assets/', text).encode()),
        ("not well-formed.xml", lambda text: text.replace('"', "'").replace("</mujoco>", "").encode()),
        ("comments.xml", lambda text: re.sub("(<(?:mesh|include) [^>]*>)", r"<!-- \1 -->", text).encode()),
        ("a quotation mark is missing.xml", lambda text: re.sub(r'(\.(?:stl|xml))"', r"\1", text).encode()),
        ("damaged.xml", lambda text: text.encode() + b"<\xff"),
    ],
)
def test_assets_that_an_edited_copy_names_stay(tmp_path: Path, name: str, edit: Callable[[str], bytes]) -> None:
    path = write_scene(tmp_path / "in", free_cube("5 0 0 0 0 0"))
    first = env2mjcf.convert(path, tmp_path / "out")
    (tmp_path / "out" / name).write_bytes(edit(first.xml.read_text()))
    write_scene(tmp_path / "in", free_cube("5 0 0 0 0 0"), cube=box_mesh(0.4, 0.4, 0.4))
    second = env2mjcf.convert(path, tmp_path / "out")
    assert not set(first.assets) & set(second.assets)
    assert all(asset.exists() for asset in first.assets)


def test_assets_that_an_included_file_names_stay(tmp_path: Path) -> None:
    path = write_scene(tmp_path / "in", free_cube("5 0 0 0 0 0"))
    first = env2mjcf.convert(path, tmp_path / "out")
    mujoco.MjSpec.from_file(str(first.xml))
    (tmp_path / "out/parts").mkdir()
    (tmp_path / "out/parts/all.xml").write_text(first.xml.read_text().replace("mujoco", "mujocoinclude"))
    (tmp_path / "out/mine.xml").write_text("<mujoco><include file='parts/all.xml'/></mujoco>")
    write_scene(tmp_path / "in", free_cube("5 0 0 0 0 0"), cube=box_mesh(0.4, 0.4, 0.4))
    env2mjcf.convert(path, tmp_path / "out")
    assert all(asset.exists() for asset in first.assets)


@pytest.mark.parametrize(
    "edit",
    [
        lambda text: b"\xef\xbb\xbf" + text.encode(),
        lambda text: ('<?xml version="1.0" encoding="UTF-16"?>' + text).encode("utf-16"),
        lambda text: text.encode("utf-16-be"),
        lambda text: b"\n\n" + text.encode(),
        lambda text: f"<?xml version='1.0'?>\r\n<!-- <mesh> -->\r\n{text}".replace("\n", "\r\n").encode(),
        lambda text: f"<!DOCTYPE mujoco>\n{text}".replace('"', "'").encode(),
        lambda text: f"<!-- {'long ' * 5000} -->\n{text}".encode(),
        lambda _: b"\n",
    ],
)
def test_its_own_scene_is_replaced_whatever_an_editor_did_to_it(tmp_path: Path, edit: Callable[[str], bytes]) -> None:
    whole = env2mjcf.convert(SEED, tmp_path).xml
    text = whole.read_text()
    whole.write_bytes(edit(text))
    env2mjcf.convert(SEED, tmp_path)
    assert whole.read_text() == text


@pytest.mark.parametrize(
    "content",
    [
        b"<mujocoinclude/>",
        b"<!-- <mujoco> -->" * 40,
        b"<Problem><mujoco/></Problem>",
        b"mujoco",
        "<robot/>".encode("utf-16"),
    ],
)
def test_what_is_not_its_own_is_kept(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "seed.xml").write_bytes(content)
    with pytest.raises(env2mjcf.ConversionError, match="is not MJCF, and is not replaced"):
        env2mjcf.convert(SEED, tmp_path)
    (tmp_path / "folder/seed.xml").mkdir(parents=True)
    with pytest.raises(env2mjcf.ConversionError, match="is not MJCF, and is not replaced"):
        env2mjcf.convert(SEED, tmp_path / "folder")
    assert (tmp_path / "seed.xml").read_bytes() == content


def test_what_is_returned_is_shown_in_a_line(tmp_path: Path) -> None:
    result = env2mjcf.convert(SEED, tmp_path)
    translated = env2mjcf.translate(result.environment, "C")
    for shown in (result, result.report, result.environment, translated, translated.robots):
        assert len(repr(shown)) < 500, repr(shown)
    assert "seed.xml" in repr(result)


def test_a_file_in_the_way_is_named(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("I am a file")
    with pytest.raises(env2mjcf.ConversionError, match="expected a folder") as caught:
        env2mjcf.convert(SEED, tmp_path / "out")
    assert caught.value.code == "MJC421"
    assert (tmp_path / "out").read_text() == "I am a file"


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX permissions")
def test_a_folder_that_may_not_be_written_is_named(tmp_path: Path) -> None:
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o555)
    scene = write_scene(tmp_path / "in", free_cube("5 0 0 0 0 0"))
    answer = without_privileges(tmp_path, lambda: env2mjcf.convert(scene, closed / "out"))
    assert answer.startswith("MJC420")
    assert "may not be written" in answer
    assert str(closed) in answer
    assert list(closed.iterdir()) == []


def test_options_are_checked_before_anything_is_done(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="did you mean 'collision'"):
        env2mjcf.convert(SEED, tmp_path / "out", colision="hull")
    with pytest.raises(ValueError, match=r"'hul'.*did you mean 'hull'"):
        env2mjcf.convert(SEED, tmp_path / "out", collision="hul")
    with pytest.raises(ValueError, match="positive"):
        env2mjcf.load(SEED, scale=-1)
    for wrong in ({"scale": "a"}, {"strict": "yes"}, {"limits": 3}, {"adjacent_links": 1.5}, {"gravity": 5}):
        with pytest.raises(TypeError, match=next(iter(wrong))):
            env2mjcf.load(SEED, **wrong)
    with pytest.raises(ValueError, match="exclude_pairs"):
        env2mjcf.load(SEED, exclude_pairs=("a", "b"))
    with pytest.raises(ValueError, match="dialect A only"):
        env2mjcf.load(MODELS / "alpha/alpha.env", semantics="page")
    assert not (tmp_path / "out").exists()


def test_strict_turns_a_warning_into_an_error(tmp_path: Path) -> None:
    path = write_scene(tmp_path, free_cube("5 0 0 0 0 0").rstrip())
    assert "ENV210" in {d.code for d in env2mjcf.load(path).diagnostics}
    with pytest.raises(env2mjcf.FormatError) as caught:
        env2mjcf.load(path, strict=True)
    assert caught.value.code == "ENV210"


def test_reading_does_not_import_mujoco(tmp_path: Path) -> None:
    import subprocess

    code = f"import sys, env2mjcf; env2mjcf.read({os.fspath(SEED)!r}); sys.exit('mujoco' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.skipif(sys.platform != "linux", reason="names that are not UTF-8")
@pytest.mark.parametrize("out", [b"out\xff", b"\xfe/deep\xff", b"scene\xff.xml"])
def test_a_folder_may_have_a_name_that_is_not_utf_8(out: bytes, tmp_path: Path) -> None:
    target = tmp_path / os.fsdecode(out)
    result = env2mjcf.convert(SEED, target)
    assert files(result.xml.parent).keys() >= {result.xml.name, *(f"assets/{a.name}" for a in result.assets)}
    assert mujoco.MjModel.from_xml_path(os.fsencode(result.xml)).nbody == 5  # pyright: ignore[reportArgumentType]
    assert env2mjcf.convert(SEED, target).xml == result.xml


@pytest.mark.skipif(sys.platform != "linux", reason="names that are not UTF-8")
def test_so_may_the_scene_its_folder_and_its_query(tmp_path: Path) -> None:
    folder = tmp_path / os.fsdecode(b"in\xff")
    shutil.copytree(SEED.parent, folder)
    scene, query = (folder / os.fsdecode(b"s\xfe" + end) for end in (b".env", b".query"))
    (folder / "seed.env").rename(scene)
    (folder / "seed.query").rename(query)
    result = env2mjcf.convert(scene, tmp_path / "out", query=query)
    assert result.xml.name == "s_.xml"
    assert mujoco.MjModel.from_xml_path(str(result.xml)).nkey >= 2


@pytest.mark.parametrize("there", [[], ["deep"], ["deep", "deep/out"], ["deep", "deep/out", "deep/out/assets"]])
def test_one_that_fails_leaves_no_folder_behind(
    there: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder in there:
        (tmp_path / folder).mkdir()

    def refuse(*_: object) -> None:
        raise TypeError("refused")

    monkeypatch.setattr("env2mjcf.conversion.load_file", refuse)
    with pytest.raises(TypeError, match="refused"):
        env2mjcf.convert(SEED, tmp_path / "deep/out")
    assert sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*")) == there


def test_it_leaves_what_others_have_put_there_meanwhile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        (tmp_path / "out/notes.txt").write_text("mine")
        raise TypeError("refused")

    monkeypatch.setattr("env2mjcf.conversion.load_file", refuse)
    with pytest.raises(TypeError, match="refused"):
        env2mjcf.convert(SEED, tmp_path / "out")
    assert files(tmp_path) == {"out/notes.txt": b"mine"}
