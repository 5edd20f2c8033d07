"""CoACD in a child process: the same parts every time, and never our crash."""

from __future__ import annotations

import os
from pathlib import Path

import mujoco
import pytest
from extras import needs
from meshes import box, channel, grid, joined
from scenes import MODELS

import env2mjcf
from env2mjcf.cli.main import main
from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.errors import GeometryError
from env2mjcf.geometry import decompose
from env2mjcf.geometry.analysis import analyse
from env2mjcf.geometry.decompose import approximate_parts
from env2mjcf.geometry.shapes import collision_shape
from env2mjcf.geometry.store import GeometryCache

ALPHA = MODELS / "alpha" / "alpha.env"
needs_coacd = needs("decompose")


def shape(mesh, cache: GeometryCache | None = None):
    return collision_shape(mesh, analyse(mesh), "coacd", 1e-5, DiagnosticLog(), cache=cache)


@pytest.fixture
def worker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Put a program in the place of CoACD's."""
    monkeypatch.setattr(decompose.importlib.util, "find_spec", lambda _: True)

    def replace(code: str) -> None:
        (tmp_path / "worker.py").write_text(code)
        monkeypatch.setattr(decompose, "_WORKER", tmp_path / "worker.py")

    return replace


@needs_coacd
class TestParts:
    def test_of_a_channel_are_its_floor_and_walls(self):
        parts = approximate_parts(channel().vertices, channel().faces)
        boxes = sorted((*p.min(axis=0).round(6).tolist(), *p.max(axis=0).round(6).tolist()) for p in parts)
        assert boxes == [(0, 0, 0, 4, 3, 1), (0, 0, 1, 4, 1, 3), (0, 2, 1, 4, 3, 3)]

    @pytest.mark.slow
    def test_are_the_same_every_time_and_sorted(self, monkeypatch):
        mesh = channel()
        first = approximate_parts(mesh.vertices, mesh.faces)
        monkeypatch.setenv("OMP_NUM_THREADS", "2")
        second = approximate_parts(mesh.vertices, mesh.faces)
        assert [p.tobytes() for p in first] == [p.tobytes() for p in second]
        assert [p.ravel().tolist() for p in first] == sorted(p.ravel().tolist() for p in first)

    def test_are_kept(self, tmp_path, monkeypatch):
        built = shape(channel(), GeometryCache(tmp_path))
        monkeypatch.setattr(decompose, "_run", lambda _: pytest.fail("it was decomposed again"))
        kept = shape(channel(), GeometryCache(tmp_path))
        assert [p.vertices.tobytes() for p in kept.pieces] == [p.vertices.tobytes() for p in built.pieces]
        assert (kept.strategy, kept.note, len(kept.pieces)) == ("coacd", "3 convex parts by CoACD, approximately", 3)

    @pytest.mark.slow
    def test_a_scene_converts_and_says_what_is_claimed_and_missed(self, tmp_path):
        result = env2mjcf.convert(ALPHA, tmp_path / "out", collision="coacd")
        (mesh,) = {m.file: m for m in result.report.meshes}.values()
        assert 2 <= mesh.cells <= 40
        assert 0 < mesh.certificate.reach_added < 0.5 * env2mjcf.load(ALPHA).compiled.assembly.robots[0].links[0].radius
        told = [d.message for d in result.diagnostics if d.code == "GEO263"]
        assert told
        assert "free configurations there are called collisions" in told[0]
        assert mujoco.MjModel.from_xml_path(str(result.xml)).ngeom > mesh.cells


class TestNotNeeded:
    """CoACD is not asked where a shape is simple."""

    @pytest.fixture(autouse=True)
    def _no_coacd(self, monkeypatch):
        monkeypatch.setattr(decompose, "_run", lambda _: pytest.fail("it was asked"))

    def test_a_convex_mesh_is_one_hull(self):
        assert (shape(box()).strategy, len(shape(box()).pieces)) == ("hull", 1)

    def test_a_flat_mesh_stays_exact(self):
        assert shape(grid(3)).strategy == "surface"


class TestFailure:
    def failure(self) -> GeometryError:
        with pytest.raises(GeometryError) as caught:
            shape(channel())
        assert caught.value.code == "GEO262"
        return caught.value

    @pytest.mark.skipif(os.name == "nt", reason="signals")
    def test_a_crash_is_an_error_with_a_way_out(self, worker):
        worker("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
        error = self.failure()
        assert "channel: CoACD crashed (signal 11)" in error.diagnostic.message
        assert "collision='auto'" in error.diagnostic.hint

    def test_an_exception_is_told(self, worker):
        worker("raise RuntimeError('too hard')")
        assert "CoACD crashed (status 1): RuntimeError: too hard" in self.failure().diagnostic.message

    def test_a_hang_ends(self, worker, monkeypatch):
        monkeypatch.setattr(decompose, "_SECONDS", 0.5)
        worker("import time; time.sleep(60)")
        assert "no answer within 0.5 seconds" in self.failure().diagnostic.message

    @pytest.mark.parametrize(
        "code",
        [
            "pass",
            "import sys; open(sys.argv[2], 'wb').write(b'PK nonsense')",
            "import sys, numpy as np; np.savez(sys.argv[2], corners=np.zeros((0, 3)), lengths=[])",
            "import sys, numpy as np; np.savez(sys.argv[2], corners=np.full((4, 3), np.nan), lengths=[4])",
        ],
    )
    def test_nonsense_is_an_error(self, code, worker):
        worker(code)
        self.failure()

    def test_a_failure_is_not_kept(self, worker, tmp_path):
        worker("raise RuntimeError")
        with pytest.raises(GeometryError):
            shape(channel(), GeometryCache(tmp_path / "cache"))
        assert not (tmp_path / "cache").exists()

    def test_parts_come_sorted_whatever_their_order(self, worker):
        code = (
            "import sys, numpy as np\n"
            "unit = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)\n"
            "parts = [unit, unit - [0, 2, 0], unit + [1, 0, 0]]\n"
            "np.savez(sys.argv[2], corners=np.concatenate(parts), lengths=[8, 8, 8])\n"
        )
        worker(code)
        parts = approximate_parts(box().vertices, box().faces)
        assert [p[0].tolist() for p in parts] == [[0, -2, 0], [0, 0, 0], [1, 0, 0]]
        assert parts[0][:2].tolist() == [[0, -2, 0], [0, -2, 1]]


def test_without_the_package_one_sentence_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setattr(decompose.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(
        ValueError, match=r"^collision='coacd' needs one more package: pip install 'env2mjcf\[decompose\]'$"
    ):
        shape(joined(box(), box(center=(3, 0, 0))))
    assert main(["convert", str(ALPHA), "/nowhere", "--collision", "coacd", "--no-cache"]) == 2
    assert capsys.readouterr().err == (
        "env2mjcf: convert: collision='coacd' needs one more package: pip install 'env2mjcf[decompose]'\n"
    )
