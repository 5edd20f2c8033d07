"""Mesh files: which extensions are read, and how they may end."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
import trimesh

import env2mjcf
from env2mjcf.cli.main import main
from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.errors import GeometryError, Severity
from env2mjcf.formats.meshes.byu import export_byu, read_byu
from env2mjcf.geometry.mesh import load_mesh
from env2mjcf.limits import Limits

TETRAHEDRON = "1 4 4 12\n1 4\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 3 -2\n1 2 -4\n2 3 -4\n1 4 -3\n"


@pytest.mark.parametrize("end", ["\x1a", "\n\x1a", "\x1a\r\n", "\x1a\x1a\x1a", "\x1a\0\0\0", "\n\x1a \n\x1a\n"])
@pytest.mark.parametrize("suffix", [".g", ".byu", ".dat", ".obj", ".stl", ".ply", ".off"])
def test_a_text_may_end_as_dos_ended_it(suffix: str, end: str, tmp_path: Path) -> None:
    box, path = trimesh.creation.box((1, 2, 3)), tmp_path / f"box{suffix}"
    text = {
        ".dat": f"8 {_numbers(box.vertices)} 12 {_numbers(np.insert(box.faces, 0, 3, axis=1))}",
        ".obj": box.export(file_type="obj"),
        ".stl": box.export(file_type="stl_ascii"),
        ".ply": trimesh.exchange.ply.export_ply(box, encoding="ascii").decode(),
        ".off": box.export(file_type="off"),
    }.get(suffix) or export_byu(box)
    path.write_text(text + end)
    log = DiagnosticLog()
    mesh = load_mesh(path, log, Limits())
    assert trimesh.Trimesh(mesh.vertices, mesh.faces).volume == pytest.approx(6)
    (found,) = [d for d in log if d.code == "GEO229"]
    assert found.severity is Severity.WARNING
    assert found.span is not None
    assert path.read_text().splitlines()[found.span.line - 1][found.span.column - 1] == "\x1a"
    path.write_text(text)
    log = DiagnosticLog()
    load_mesh(path, log, Limits())
    assert "GEO229" not in [d.code for d in log]
    path.write_text(text + end)
    with pytest.raises(GeometryError) as caught:
        load_mesh(path, DiagnosticLog(strict=True), Limits())
    assert caught.value.code == "GEO229"


def _numbers(rows: np.ndarray) -> str:
    return " ".join(map(str, rows.ravel().tolist()))


def test_dos_s_mark_in_the_middle_is_a_fault() -> None:
    for text in (TETRAHEDRON.replace("0 1 0", "0 \x1a1 0"), TETRAHEDRON + "\x1a1", TETRAHEDRON + "\0"):
        with pytest.raises(GeometryError) as caught:
            read_byu(text, "a.g", DiagnosticLog(), Limits())
        assert caught.value.code in ("GEO211", "GEO215")
    began = time.process_time()
    with pytest.raises(GeometryError):
        read_byu(TETRAHEDRON + "\x1a" * 300_000 + "1", "a.g", DiagnosticLog(), Limits())
    assert time.process_time() - began < 5


def test_the_extension_byu_is_byu_everywhere(tmp_path: Path) -> None:
    (tmp_path / "box.BYU").write_text(export_byu(trimesh.creation.box((1, 2, 3))))
    assert trimesh.load_mesh(tmp_path / "box.BYU").volume == pytest.approx(6)
    trimesh.load_mesh(tmp_path / "box.BYU").export(tmp_path / "again.byu")
    assert (tmp_path / "again.byu").read_text().startswith("1 8 12 36\n")
    scene = tmp_path / "scene.env"
    scene.write_text(
        "Boundary Box [-9:9 ; -9:9 ; -9:9]\nMultibodies\n1\nActive\n1\nbox.BYU Planar Rotational\nConnections\n0\n"
    )
    assert env2mjcf.load(scene, cache=False).link_names == ("box",)
    assert main(["lint", str(tmp_path / "again.byu")]) == 0
    with pytest.raises(GeometryError, match=r"can be read: \.g, \.byu, "):
        load_mesh(tmp_path / "box.xyz", DiagnosticLog(), Limits())
