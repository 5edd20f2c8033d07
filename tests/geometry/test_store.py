"""The geometry cache: never wrong, never in the way, never larger than it may be."""

from __future__ import annotations

import dataclasses
import json
import multiprocessing
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import platformdirs
import platformdirs.windows
import pytest
from meshes import box, channel, grid
from platformdirs.macos import MacOS
from platformdirs.unix import Unix
from platformdirs.windows import Windows
from scenes import MODELS

import env2mjcf
from env2mjcf.cli.main import main
from env2mjcf.contact.exact import engine
from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.geometry import shapes
from env2mjcf.geometry.analysis import analyse
from env2mjcf.geometry.serialization import pack, unpack
from env2mjcf.geometry.store import GeometryCache, default_folder, entry_key

BUG_TRAP = MODELS / "bug-trap" / "bug-trap.env"


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Thing:
    """Something that may be kept."""

    numbers: np.ndarray
    words: tuple[str, ...] = ()
    inner: Thing | None = None


class Builder:
    """Counts how often it had to work."""

    def __init__(self, size: int = 10) -> None:
        self.calls = 0
        self.size = size

    def __call__(self) -> Thing:
        self.calls += 1
        return Thing(np.arange(float(self.size)), ("a", "b"))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache."""
    monkeypatch.setenv("ENV2MJCF_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


def remember(cache: GeometryCache, build: Builder, *what: object, log: DiagnosticLog | None = None) -> Thing:
    return cache.remember(
        what, build, kinds=(Thing,), known={}, log=DiagnosticLog() if log is None else log, subject="thing"
    )


def codes(log: DiagnosticLog) -> list[str]:
    return [d.code for d in log]


def entries(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.npz"))


def tree(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


class TestPacking:
    def test_gives_back_every_value_bit_for_bit(self):
        numbers = np.array([[0.1, -0.0, np.inf], [5e-324, 1 / 3, np.nan]])
        rest = Thing(np.array([True, False]), ("ü\x00", "q"), None)
        value = (Thing(numbers, (), rest), 3, 1 / 3, None, True, (1, (2, ())), np.zeros((0, 3)), np.arange(3))
        back = unpack(pack(value, (Thing,), {}), (Thing,), {})
        assert back[0].numbers.tobytes() == numbers.tobytes()
        assert (back[0].numbers.shape, back[0].numbers.flags.writeable) == ((2, 3), False)
        assert back[0].inner.numbers.tolist() == [True, False]
        assert back[0].inner.words == rest.words
        assert back[1:6] == value[1:6]
        assert (back[6].shape, back[7].tolist(), back[7].dtype) == ((0, 3), [0, 1, 2], np.int64)

    def test_leaves_out_what_the_reader_has(self):
        shared = Thing(np.arange(1e6))
        value = Thing(np.zeros(2), inner=shared)
        stored = pack(value, (Thing,), {"shared": shared})
        assert sum(a.nbytes for a in stored.values()) < 200
        assert unpack(stored, (Thing,), {"shared": shared}).inner is shared

    @pytest.mark.parametrize("value", [object(), np.zeros(2, dtype=np.float32), [1], {"a": 1}, np.float64(1)])
    def test_refuses_what_it_could_not_give_back(self, value):
        with pytest.raises(TypeError, match="cannot be stored"):
            pack((value,), (Thing,), {})


class TestCache:
    def test_builds_once_for_equal_input_and_anew_for_any_other(self, folder):
        build = Builder()
        for what in (("a", 1.0), ("a", 1.0), ("a", np.nextafter(1.0, 2)), ("b", 1.0), ("a1.0",)):
            assert remember(GeometryCache(folder), build, *what).numbers.tolist() == list(range(10))
        assert build.calls == 4
        assert len(entries(folder)) == 4

    def test_without_a_folder_keeps_nothing(self):
        build = Builder()
        remember(GeometryCache(None), build, "a")
        remember(GeometryCache(None), build, "a")
        assert build.calls == 2

    @pytest.mark.parametrize("harm", ["empty", "short", "bit", "text", "other entry", "pickle"])
    def test_a_damaged_entry_is_made_anew_and_reported(self, harm, folder):
        build, log = Builder(1000), DiagnosticLog(strict=True)
        remember(GeometryCache(folder), build, "a")
        (entry,) = entries(folder)
        good = entry.read_bytes()
        if harm == "empty":
            entry.write_bytes(b"")
        elif harm == "short":
            entry.write_bytes(good[: len(good) // 2])
        elif harm == "bit":
            entry.write_bytes(good[:4000] + bytes([good[4000] ^ 1]) + good[4001:])
        elif harm == "text":
            entry.write_bytes(b"not an archive")
        elif harm == "other entry":
            remember(GeometryCache(folder), Builder(5), "b")
            other = next(p for p in entries(folder) if p != entry)
            entry.write_bytes(other.read_bytes())
        else:
            np.savez(entry, digest=np.array([object()], dtype=object), allow_pickle=True)
        assert len(remember(GeometryCache(folder), build, "a", log=log).numbers) == 1000
        assert (build.calls, codes(log)) == (2, ["GEO260"])
        quiet = DiagnosticLog()
        remember(GeometryCache(folder), build, "a", log=quiet)
        assert (build.calls, codes(quiet)) == (2, [])

    def test_a_folder_that_cannot_be_made_is_said_once_and_stops_nothing(self, tmp_path):
        (tmp_path / "file").write_text("in the way")
        cache, build, log = GeometryCache(tmp_path / "file" / "cache"), Builder(), DiagnosticLog(strict=True)
        for what in "abc":
            assert remember(cache, build, what, log=log).words == ("a", "b")
        assert (build.calls, codes(log)) == (3, ["GEO261"])

    @pytest.mark.skipif(hasattr(os, "geteuid") and os.geteuid() == 0, reason="root may write anywhere")
    def test_a_read_only_folder_stops_nothing(self, folder):
        folder.mkdir()
        folder.chmod(0o500)
        log = DiagnosticLog()
        remember(GeometryCache(folder), Builder(), "a", log=log)
        assert codes(log) == ["GEO261"]

    def test_what_was_not_used_for_longest_goes(self, folder):
        size = 1000 * 8 + 2500
        cache = GeometryCache(folder, limit=4 * size)
        for i, what in enumerate("abcd"):
            remember(cache, Builder(1000), what)
            os.utime(folder / f"{entry_key(what)}.npz", (i, i))
        remember(GeometryCache(folder, limit=4 * size), Builder(1000), "a")  # used again
        remember(cache, Builder(1000), "e")
        remember(cache, Builder(1000), "f")
        left = {p.stem for p in entries(folder)}
        assert {entry_key("a"), entry_key("f")} <= left
        assert {entry_key("b"), entry_key("c")}.isdisjoint(left)
        assert GeometryCache(folder).state().bytes <= 4 * size

    def test_what_is_larger_than_the_limit_is_not_kept(self, folder):
        remember(GeometryCache(folder, limit=1000), Builder(1000), "a")
        assert not folder.exists()

    def test_clearing_leaves_what_is_not_its_own(self, folder):
        remember(GeometryCache(folder), Builder(), "a")
        (folder / "notes.npz").write_bytes(b"mine")
        (folder / f".{'0' * 64}-{'0' * 16}.npz").write_bytes(b"left by a writer that was killed")
        assert GeometryCache(folder).clear() == 1
        assert [p.name for p in folder.iterdir()] == ["notes.npz"]

    def test_a_killed_writers_file_goes_after_a_while(self, folder):
        folder.mkdir()
        left, fresh = (folder / f".{digit * 64}-{'0' * 16}.npz" for digit in "01")
        for path in (left, fresh):
            path.write_bytes(b"")
        os.utime(left, (0, 0))
        remember(GeometryCache(folder), Builder(), "a")
        assert (left.exists(), fresh.exists()) == (False, True)

    @pytest.mark.slow
    def test_many_processes_may_write_one_entry(self, folder):
        context = multiprocessing.get_context("spawn")
        with context.Pool(3) as pool:
            answers = pool.map(hammer, [str(folder)] * 3)
        assert answers == [[]] * 3
        assert len(entries(folder)) == 3
        assert len(list(folder.iterdir())) == 3


def hammer(folder: str) -> list[str]:
    """Ask for the same entries again and again, while others do the same and remove them."""
    log = DiagnosticLog()
    for i in range(60):
        cache = GeometryCache(Path(folder))
        thing = remember(cache, Builder(2000), "abc"[i % 3], log=log)
        assert thing.numbers.tolist() == list(range(2000))
        if i % 10 == 5:
            cache.clear()
    for what in "abc":
        remember(GeometryCache(Path(folder)), Builder(2000), what, log=log)
    return codes(log)


class TestFolder:
    @pytest.fixture(autouse=True)
    def _no_variables(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        for name in ("ENV2MJCF_CACHE_DIR", "XDG_CACHE_HOME", "LOCALAPPDATA"):
            monkeypatch.delenv(name, raising=False)
        monkeypatch.setenv("HOME", str(tmp_path))
        local = str(tmp_path / "AppData" / "Local")
        monkeypatch.setattr(platformdirs.windows, "get_win_folder", {"CSIDL_LOCAL_APPDATA": local}.__getitem__)

    @pytest.mark.parametrize(
        ("system", "place"),
        [(Unix, ".cache/env2mjcf"), (MacOS, "Library/Caches/env2mjcf"), (Windows, "AppData/Local/env2mjcf")],
    )
    def test_is_the_platforms(self, system, place, tmp_path, monkeypatch):
        monkeypatch.setattr(platformdirs, "PlatformDirs", system)
        assert default_folder() == tmp_path / place

    def test_follows_xdg_but_not_to_a_relative_path(self, tmp_path, monkeypatch):
        monkeypatch.setattr(platformdirs, "PlatformDirs", Unix)
        monkeypatch.setenv("XDG_CACHE_HOME", "/somewhere")
        assert default_folder() == Path("/somewhere/env2mjcf")
        monkeypatch.setenv("XDG_CACHE_HOME", "here")
        assert default_folder() == tmp_path / ".cache" / "env2mjcf"

    def test_is_the_one_of_the_environment_variable(self, tmp_path, monkeypatch):
        monkeypatch.setenv("ENV2MJCF_CACHE_DIR", str(tmp_path / "mine"))
        assert default_folder() == tmp_path / "mine"

    def test_may_be_none(self, monkeypatch):
        monkeypatch.setattr(platformdirs, "PlatformDirs", Unix)
        monkeypatch.delenv("HOME")
        monkeypatch.setattr("pwd.getpwuid", {}.__getitem__)  # as for a user that the system does not know
        assert default_folder() is None


class TestShapes:
    def shape(self, folder: Path, mesh, strategy: str = "auto"):
        return shapes.collision_shape(mesh, analyse(mesh), strategy, 1e-4, DiagnosticLog(), cache=GeometryCache(folder))

    def test_a_kept_shape_is_the_one_that_was_built(self, folder, monkeypatch):
        mesh = grid(12)
        built = self.shape(folder, mesh, "surface")
        monkeypatch.setitem(shapes._STRATEGIES, "surface", lambda *_: pytest.fail("it was built again"))
        kept = self.shape(folder, mesh, "surface")
        assert len(built.pieces) == len(kept.pieces) > 0
        for a, b in zip(built.pieces, kept.pieces, strict=True):
            assert a.vertices.tobytes() == b.vertices.tobytes()
            assert a.center.tobytes() == b.center.tobytes()
            assert not b.vertices.flags.writeable
            assert a.polygon.loop == b.polygon.loop
            assert a.polygon.faces == b.polygon.faces
            assert a.polygon.normal.tobytes() == b.polygon.normal.tobytes()
        assert (kept.note, kept.strategy, kept.omitted_area) == (built.note, built.strategy, built.omitted_area)
        assert kept.mesh is mesh

    def test_small_meshes_are_kept_if_they_have_cells(self, folder):
        self.shape(folder, box())
        self.shape(folder, channel(), "surface")
        assert not folder.exists()
        self.shape(folder, channel())
        assert len(entries(folder)) == 1

    def test_another_strategy_or_thickness_is_another_entry(self, folder):
        self.shape(folder, grid(12), "surface")
        self.shape(folder, grid(12), "hull")
        assert len(entries(folder)) == 2


def test_the_bytes_are_the_same_with_a_cold_a_warm_and_no_cache(folder, tmp_path):
    diagnostics = []
    for out, cache in (("none", False), ("cold", True), ("warm", True)):
        assert len(entries(folder)) == (2 if out == "warm" else 0)
        diagnostics.append(env2mjcf.convert(BUG_TRAP, tmp_path / out, cache=cache).diagnostics)
    assert tree(tmp_path / "none") == tree(tmp_path / "cold") == tree(tmp_path / "warm")
    assert diagnostics[0] == diagnostics[1] == diagnostics[2]


def test_a_warm_cache_is_used(folder, monkeypatch):
    built: list[str] = []
    auto = shapes._STRATEGIES["auto"]

    def count(mesh, *rest):
        built.append(mesh.name)
        return auto(mesh, *rest)

    monkeypatch.setitem(shapes._STRATEGIES, "auto", count)
    env2mjcf.load(BUG_TRAP)
    assert sorted(built) == ["bottle", "bug"]
    env2mjcf.load(BUG_TRAP)
    assert sorted(built) == ["bottle", "bug"]


def test_a_conversion_survives_a_cache_that_cannot_be_written(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("ENV2MJCF_CACHE_DIR", str(tmp_path / "file"))
    scene = env2mjcf.load(BUG_TRAP, strict=False)
    assert [d.severity for d in scene.diagnostics if d.code == "GEO261"] == ["info"]


class TestVerb:
    def test_info_and_clear(self, folder, capsys, monkeypatch):
        monkeypatch.setattr(engine, "kept_files", lambda: (None, []))  # other tests need the compiled code
        env2mjcf.load(BUG_TRAP)
        size = sum(p.stat().st_size for p in entries(folder))
        assert main(["cache", "info", "--json"]) == 0
        told = json.loads(capsys.readouterr().out)
        assert (told["folder"], told["entries"], told["bytes"], told["limit"]) == (str(folder), 2, size, 2**30)
        assert main(["cache", "info"]) == 0
        assert (
            capsys.readouterr().out
            == f"folder  {folder}\nholds   2 entries, {size / 2**20:.1f} MiB\nlimit   1024 MiB\n"
            "engine  0 compiled functions, 0.0 MiB\nkept    nowhere: numba is not installed, or has no folder\n"
        )
        assert main(["cache", "clear"]) == 0
        assert f"removed 2 entries, {size / 2**20:.1f} MiB from {folder}" in capsys.readouterr().out
        assert entries(folder) == []
        assert main(["cache", "clear", "--json"]) == 0
        assert json.loads(capsys.readouterr().out) == {
            "folder": str(folder),
            "removed": 0,
            "compiled": {"folder": None, "functions": 0, "bytes": 0},
        }

    def test_a_cache_that_is_not_there_is_empty(self, folder, capsys):
        assert main(["cache", "info", "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["entries"] == 0
        assert not folder.exists()

    def test_does_not_load_mujoco(self):
        code = (
            "import sys; from env2mjcf.cli.main import main; main(['cache', 'info']); sys.exit('mujoco' in sys.modules)"
        )
        environment = {**os.environ, "PYTHONPATH": str(Path(env2mjcf.__file__).parents[1])}
        subprocess.run([sys.executable, "-c", code], check=True, env=environment, capture_output=True)
