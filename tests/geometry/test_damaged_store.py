"""Whatever happens to what is kept between runs, answers stay what they are."""

from __future__ import annotations

import io
import os
import random
import struct
import subprocess
import sys
import time
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path

import folders
import numpy as np
import pytest

from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.geometry.serialization import pack
from env2mjcf.geometry.store import GeometryCache, entry_key

pytestmark = pytest.mark.skipif(os.name != "posix", reason="pipes, limits, permissions")
VALUE = (1.5, "word", (np.arange(12.0), np.arange(3)))


def asked(folder: Path) -> tuple[int, list[str]]:
    """Ask for the value, check that it is right, and return how often it was computed, and what was said."""
    built: list[int] = []

    def build() -> object:
        built.append(1)
        return VALUE

    log = DiagnosticLog()
    found = GeometryCache(folder).remember(("a",), build, kinds=(), known={}, log=log)
    assert found[:2] == VALUE[:2]
    assert [a.tolist() for a in found[2]] == [a.tolist() for a in VALUE[2]]
    return len(built), [d.code for d in log]


@pytest.fixture
def entry(tmp_path: Path) -> Path:
    """An entry of a cache that has just been written."""
    assert asked(tmp_path / "cache") == (1, [])
    assert asked(tmp_path / "cache") == (0, [])
    return tmp_path / "cache" / f"{entry_key('a')}.npz"


def test_an_entry_cut_short_anywhere_is_made_anew(entry: Path) -> None:
    good = entry.read_bytes()
    for length in range(0, len(good), 5):
        entry.write_bytes(good[:length])
        assert asked(entry.parent) == (1, ["GEO260"])
        assert asked(entry.parent) == (0, [])


def test_a_flipped_bit_anywhere_changes_no_answer(entry: Path) -> None:
    good, chance = entry.read_bytes(), random.Random(0)
    made_anew = 0
    for _ in range(600):
        data = bytearray(good)
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
        entry.write_bytes(data)
        found = asked(entry.parent)
        assert found in ((1, ["GEO260"]), (0, []))
        made_anew += found[0]
    # The others were flipped in dates and the like, which nobody reads.
    assert made_anew > 400


def bomb(path: Path) -> None:
    """Write 128 kilobytes that become 128 megabytes."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("f.npy", "w") as file:
        np.lib.format.write_array_header_1_0(file, {"descr": "<f8", "fortran_order": False, "shape": (1 << 24,)})
        for _ in range(1 << 3):
            file.write(bytes(1 << 24))


def declaration(path: Path) -> None:
    """Write an entry that says that it is 8 petabytes, and holds nothing."""
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (1 << 50,)})
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("f.npy", header.getvalue())


@pytest.mark.parametrize("make", [bomb, declaration])
def test_an_entry_that_would_be_huge_is_not_unpacked(make: Callable[[Path], None], entry: Path) -> None:
    make(entry)

    tracemalloc.start()
    try:
        assert asked(entry.parent) == (1, ["GEO260"])
        # What is only declared is asked of the system, which gives none.
        assert make is declaration or tracemalloc.get_traced_memory()[1] < 1 << 24
    finally:
        tracemalloc.stop()
    assert asked(entry.parent) == (0, [])


def overlapping(path: Path) -> None:
    """Write a quarter of a megabyte, and a list of parts that names it 50,000 times: 13 gigabytes."""
    np.savez(path, f=np.zeros(1 << 15))
    data, parts = path.read_bytes(), 50_000
    directory, end = data.index(b"PK\1\2"), data.index(b"PK\5\6")
    listed = data[directory:end] * parts
    numbers = struct.pack("<HHII", parts, parts, len(listed), directory)
    path.write_bytes(data[:directory] + listed + data[end : end + 8] + numbers + bytes(2))


def test_an_entry_whose_parts_overlap_is_refused_before_they_are_read(entry: Path) -> None:
    overlapping(entry)
    start = time.process_time()
    assert asked(entry.parent) == (1, ["GEO260"])
    assert time.process_time() - start < 3


def test_a_pipe_in_its_place_is_not_waited_for(entry: Path) -> None:
    entry.unlink()
    os.mkfifo(entry)
    assert asked(entry.parent) == (1, ["GEO260"])
    assert asked(entry.parent) == (0, [])


def test_a_folder_in_its_place_stops_nothing(entry: Path) -> None:
    entry.unlink()
    entry.mkdir()
    assert asked(entry.parent) == (1, ["GEO261"])


@pytest.mark.parametrize("target", ["a copy", "/dev/zero", "nothing", "itself"])
def test_a_link_in_its_place_is_as_good_as_what_it_leads_to(target: str, entry: Path) -> None:
    copy = entry.with_name("copy")
    entry.rename(copy)
    entry.symlink_to({"a copy": copy, "nothing": "nowhere", "itself": entry}.get(target, target))
    assert asked(entry.parent)[0] == (target != "a copy")
    if target != "itself":
        assert asked(entry.parent) == (0, [])
    assert copy.is_file()


def test_code_in_an_entry_is_not_run(entry: Path, tmp_path: Path) -> None:
    class Evil:
        def __reduce__(self) -> tuple[object, ...]:
            return os.mkdir, (str(tmp_path / "done"),)

    arrays = pack(VALUE, (), {})
    np.savez(entry, digest=np.array([Evil()], dtype=object), **arrays, allow_pickle=True)
    assert asked(entry.parent) == (1, ["GEO260"])
    assert not (tmp_path / "done").exists()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become somebody else")
def test_a_cache_of_somebody_else_stops_nothing(entry: Path) -> None:
    for mode in (0o000, 0o555):
        entry.parent.chmod(mode)

        def ask() -> None:
            os.setuid(65534)
            assert asked(entry.parent)[1] in (["GEO261"], [])

        for above in entry.parents[1:4]:
            above.chmod(0o755)
        assert folders.in_child(ask) == 0


_COMPILED = """
import sys, numba, numpy as np
def _entries():
    @numba.njit(cache=True)
    def collisions(numbers, out):
        for i in range(len(numbers)):
            out[i] = numbers[i] > 0
    return collisions
collisions = _entries()
if __name__ != "__main__":
    from env2mjcf.contact.exact.engine import call
    out = np.zeros(3, dtype=np.bool_)
    call(collisions, np.array([1.0, -1.0, 2.0]), out)
    print(out.tolist(), sum(collisions.stats.cache_hits.values()))
"""


@pytest.mark.slow_but("code")
@pytest.mark.parametrize("damage", ["index", "code"])
def test_what_numba_keeps_is_compiled_anew_where_it_is_cut_short(damage: str, tmp_path: Path) -> None:
    """Of a small function, because the engine's own take a minute."""
    pytest.importorskip("numba")
    (tmp_path / "entries.py").write_text(_COMPILED)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(folders.ROOT)])}
    environment.pop("NUMBA_CACHE_DIR", None)

    def run() -> str:
        done = subprocess.run(
            [sys.executable, "-c", "import entries"], env=environment, cwd=tmp_path,
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        return done.stdout + done.stderr

    assert run() == "[True, False, True] 0\n"
    for file in (tmp_path / "__pycache__").glob({"index": "*.nbi", "code": "*.nbc"}[damage]):
        file.write_bytes(file.read_bytes()[:100])
    # Compiled anew, and kept again.
    assert run() == "[True, False, True] 0\n"
    assert len(list((tmp_path / "__pycache__").glob("*.nb[ic]"))) == 2
