"""What is fuzzed: one function for each reader, which takes the bytes of a file and lets only faults through."""

from __future__ import annotations

import atexit
import functools
import re
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import env2mjcf
from env2mjcf.companions.configurations import of_file
from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.errors import Env2MjcfError
from env2mjcf.formats.meshes.byu import read_byu, read_gms
from env2mjcf.formats.meshes.obj import read_obj
from env2mjcf.formats.path import read_path
from env2mjcf.formats.roadmap import read_roadmap
from env2mjcf.formats.rows import read_query
from env2mjcf.formats.source import read_source
from env2mjcf.limits import Limits

MODELS = Path(__file__).parents[2] / "models"

# Small enough that whatever takes long, or much memory, is a fault of the reader.
LIMITS = Limits(file_bytes=4_000_000, mesh_elements=1_000_000)

_HOST = "Boundary Box [-9:9 ; -9:9 ; -9:9]\nMultibodies\n0\n"
_CUBE = (MODELS / "seed" / "cube.g").read_text()
_CARRIER = (
    "Boundary Box [-9:9 ; -9:9 ; -9:9]\nMultibodies\n1\nActive\n1\ncube.g Volumetric Rotational\nConnections\n0\n"
)
_MESH_NAME = re.compile(rb"(?<![\w./-])(?:[\w-]{1,30}/)?[\w-]{1,30}\.(?:g|obj|dat)\b", re.ASCII)
_MOST_NAMES = 1000
_given: set[bytes] = set()


@functools.cache
def _folder() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="env2mjcf-fuzz-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    (folder / "host.env").write_text(_HOST)
    (folder / "cube.g").write_text(_CUBE)
    (folder / "carrier.env").write_text(_CARRIER)
    return folder


def _written(data: bytes, name: str) -> Path:
    path = _folder() / name
    path.write_bytes(data)
    return path


@functools.cache
def _carrier() -> Any:
    return env2mjcf.load(_folder() / "carrier.env", engine="mujoco", cache=False)


def _env(data: bytes) -> None:
    env2mjcf.read(_written(data, "scene.env"), limits=LIMITS)


def _robot(data: bytes) -> None:
    env2mjcf.read(_folder() / "host.env", robots=[_written(data, "robot.robot")], limits=LIMITS)


def _byu(data: bytes) -> None:
    read_byu(data, "mesh.g", DiagnosticLog(), LIMITS)


def _obj(data: bytes) -> None:
    read_obj(data, "mesh.obj", DiagnosticLog(), LIMITS)


def _gms(data: bytes) -> None:
    read_gms(data, "mesh.dat", DiagnosticLog(), LIMITS)


def _query(data: bytes) -> None:
    log = DiagnosticLog()
    read_query(read_source(_written(data, "scene.query"), log, LIMITS), (6, 3), log)


def _path(data: bytes) -> None:
    log = DiagnosticLog()
    read_path(read_source(_written(data, "scene.path"), log, LIMITS), (6, 3), (4, 3), log)


def _roadmap(data: bytes) -> None:
    log = DiagnosticLog()
    read_roadmap(read_source(_written(data, "scene.map"), log, LIMITS), (6, 3), log)


def _npy(data: bytes) -> None:
    of_file(_carrier(), str(_written(data, "rows.npy")), False, LIMITS, DiagnosticLog())


def _csv(data: bytes) -> None:
    of_file(_carrier(), str(_written(data, "rows.csv")), False, LIMITS, DiagnosticLog())


def _mesh(data: bytes) -> None:
    """Take a mesh the whole way to MuJoCo, as a body of a scene."""
    _written(_CARRIER.replace("cube.g", "fuzzed.g").encode(), "mesh.env")
    _written(data, "fuzzed.g")
    env2mjcf.load(_folder() / "mesh.env", engine="mujoco", cache=False, limits=LIMITS)


def _scene(data: bytes) -> None:
    """Take an environment the whole way to MuJoCo; every mesh that it names is a cube."""
    for name in {*_MESH_NAME.findall(data)} - _given:
        # Names of the files to start from, and some that have come of them.
        if len(_given) < _MOST_NAMES:
            _given.add(name)
            path = _folder() / name.decode()
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(_CUBE)
    env2mjcf.load(_written(data, "whole.env"), engine="mujoco", cache=False, limits=LIMITS)


def _only_ours(read: Callable[[bytes], None]) -> Callable[[bytes], bool]:
    @functools.wraps(read)
    def run(data: bytes) -> bool:
        """Return whether the file was read, not refused."""
        try:
            read(data)
        except Env2MjcfError as error:
            if not error.diagnostic.message:
                raise AssertionError("an error without a message") from error
            return False
        return True

    return run


READERS: dict[str, Callable[[bytes], bool]] = {
    name: _only_ours(read)
    for name, read in {
        "env": _env,
        "robot": _robot,
        "xml": _env,
        "xml-robot": _robot,
        "byu": _byu,
        "obj": _obj,
        "gms": _gms,
        "query": _query,
        "path": _path,
        "roadmap": _roadmap,
        "npy": _npy,
        "csv": _csv,
        "mesh": _mesh,
        "scene": _scene,
    }.items()
}

# Files to start from, below `models/` and any folder that is given.
SEEDS = {
    "env": ("*.env",),
    "robot": ("*.robot",),
    "xml": ("*.xml",),
    "xml-robot": ("*robot*.xml",),
    "byu": ("*.g",),
    "obj": ("*.obj",),
    "gms": ("*.dat",),
    "query": ("*.query",),
    "path": ("*.path",),
    "roadmap": ("*.map",),
    "npy": ("*.npy",),
    "csv": ("*.query",),
    "mesh": ("*.g",),
    "scene": ("*.env",),
}
