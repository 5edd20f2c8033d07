"""The same input gives the same bytes, and a conversion touches nothing but what is its own."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import mujoco
import pytest

import env2mjcf

MODELS = Path(__file__).parents[1] / "models"
SCENES = {
    "seed": {"query": "seed.query"},
    "alpha": {"query": "alpha.query"},
    "two-robots": {"query": "two-robots.query", "ground": True, "boundary": "visual", "actuators": "position"},
}
CONVERT = """
import ast, sys, env2mjcf
scene, out, options = sys.argv[1:]
env2mjcf.convert(scene, out, cache=False, **ast.literal_eval(options))
"""


def convert_elsewhere(scene: Path, out: Path, options: dict[str, object], *, seed: int, folder: Path) -> None:
    """Convert in a process with its own hash seed, number of threads, time zone and current directory."""
    folder.mkdir(parents=True)
    environment = {**os.environ, "PYTHONHASHSEED": str(seed), "OMP_NUM_THREADS": str(1 + seed % 2), "TZ": f"UTC-{seed}"}
    relative = [os.path.relpath(p, folder) for p in (scene, out)] if seed % 2 else [str(scene), str(out)]
    command = [sys.executable, "-c", CONVERT, *relative, repr(options)]
    subprocess.run(command, cwd=folder, env=environment, check=True)


def tree(folder: Path) -> dict[str, bytes]:
    """Return all files below a folder."""
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def identities(folder: Path) -> dict[str, tuple[int, int]]:
    """Return what changes when a file is written anew, even with the same bytes."""
    return {p.name: (p.stat().st_ino, p.stat().st_mtime_ns) for p in folder.iterdir()}


@pytest.fixture
def seed_scene(tmp_path: Path) -> Path:
    """A copy of the seed scene that a test may change."""
    shutil.copytree(MODELS / "seed", tmp_path / "scene")
    return tmp_path / "scene" / "seed.env"


def shorten(mesh: Path) -> None:
    """Make another shape of a mesh."""
    text = mesh.read_text()
    assert "0.2" in text
    mesh.write_text(text.replace("0.2", "0.1"))


@pytest.mark.slow_but("two-robots")
@pytest.mark.parametrize("name", SCENES)
def test_the_bytes_do_not_depend_on_hash_seed_threads_or_current_directory(name: str, tmp_path: Path) -> None:
    scene = MODELS / name / f"{name}.env"
    options = {k: str(scene.parent / str(v)) if k == "query" else v for k, v in SCENES[name].items()}
    for seed, folder in ((1, "here"), (4242, "somewhere/else")):
        convert_elsewhere(scene, tmp_path / f"out{seed}", options, seed=seed, folder=tmp_path / folder)
    first, second = tree(tmp_path / "out1"), tree(tmp_path / "out4242")
    assert sorted(first) == sorted(second)
    assert first == second
    assert f"{name}.xml" in first
    assert len(first) > 1


def test_the_bytes_do_not_depend_on_where_the_scene_lies(seed_scene: Path, tmp_path: Path) -> None:
    env2mjcf.convert(MODELS / "seed" / "seed.env", tmp_path / "a")
    env2mjcf.convert(seed_scene, tmp_path / "b")
    assert tree(tmp_path / "a") == tree(tmp_path / "b")


def test_what_is_loaded_is_what_is_written(tmp_path: Path) -> None:
    scene = MODELS / "two-robots" / "two-robots.env"
    env2mjcf.convert(scene, tmp_path)
    loaded = env2mjcf.load(scene)
    assert tree(tmp_path) == {"two-robots.xml": loaded.xml.encode(), **loaded.assets}


def test_a_second_conversion_leaves_the_bytes_and_the_asset_files(seed_scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = env2mjcf.convert(seed_scene, out)
    bytes_before, files_before = tree(out), identities(out / "assets")
    again = env2mjcf.convert(seed_scene, out)
    assert tree(out) == bytes_before
    assert identities(out / "assets") == files_before
    assert again.assets == result.assets


def test_a_damaged_asset_is_written_anew(seed_scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    asset = env2mjcf.convert(seed_scene, out).assets[0]
    before = tree(out)
    asset.write_bytes(asset.read_bytes()[:-1])
    env2mjcf.convert(seed_scene, out)
    assert tree(out) == before


def test_a_changed_scene_takes_away_only_what_the_last_one_named(seed_scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    first = env2mjcf.convert(seed_scene, out)
    foreign = {
        out / "notes.txt": b"mine",
        out / "assets" / "photo.stl": b"mine",
        # In the shape of an asset's name, and named by no scene.
        out / "assets" / "cube-0123456789ab.stl": b"mine",
    }
    for path, data in foreign.items():
        path.write_bytes(data)
    shorten(seed_scene.parent / "cube.g")
    second = env2mjcf.convert(seed_scene, out)
    gone = set(first.assets) - set(second.assets)
    assert {p.name.split("-")[0] for p in gone} == {"cube"}
    assert not any(p.exists() for p in gone)
    assert {p: p.read_bytes() for p in foreign} == foreign
    assert {p for p in out.rglob("*") if p.is_file()} == {second.xml, *second.assets, *foreign}


def test_two_scenes_in_one_folder_do_not_take_each_others_assets(seed_scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    env2mjcf.convert(seed_scene, out / "one.xml")
    other = env2mjcf.convert(seed_scene, out / "two.xml")
    shorten(seed_scene.parent / "cube.g")
    env2mjcf.convert(seed_scene, out / "one.xml")
    assert [p for p in other.assets if not p.exists()] == []
    assert mujoco.MjModel.from_xml_path(str(other.xml)).nq == 10
