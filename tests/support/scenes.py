"""Tiny scenes that tests write for themselves."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from env2mjcf.errors import Env2MjcfError

MODELS = Path(__file__).parents[2] / "models"

CUBE_FACES = "1 3 -2\n1 4 -3\n5 6 -7\n5 7 -8\n1 2 -6\n1 6 -5\n2 3 -7\n2 7 -6\n3 4 -8\n3 8 -7\n4 1 -5\n4 5 -8\n"


def box_mesh(x: float, y: float, z: float) -> str:
    """Return a BYU box of these half sizes about the origin, faces outwards."""
    corners = [(-x, -y, -z), (x, -y, -z), (x, y, -z), (-x, y, -z), (-x, -y, z), (x, -y, z), (x, y, z), (-x, y, z)]
    lines = "\n".join(" ".join(repr(float(c)) for c in corner) for corner in corners)
    return f"1 8 12 36\n1 12\n{lines}\n{CUBE_FACES}"


def write_scene(folder: Path, text: str, name: str = "scene.env", **meshes: str) -> Path:
    """Write an env file and its meshes (`cube=...` becomes cube.g); a unit cube is always there."""
    folder.mkdir(parents=True, exist_ok=True)
    for stem, content in {"cube": box_mesh(0.5, 0.5, 0.5), **meshes}.items():
        (folder / f"{stem}.g").write_text(content)
    path = folder / name
    path.write_text(text)
    return path


def free_cube(*obstacles: str, boundary: str = "Boundary Box [-10:10 ; -10:10 ; -10:10]", robot: str = "") -> str:
    """Return a dialect D scene of one cube robot and cubes at poses `x y z rx ry rz`."""
    passive = "".join(f"\nPassive\n{o if '.g' in o else 'cube.g ' + o}\n" for o in obstacles)
    active = robot or "1\ncube.g Volumetric Rotational\nConnections\n0\n"
    return f"{boundary}\n\nMultibodies\n{1 + len(obstacles)}\n\nActive\n{active}{passive}"


def give_up_privileges() -> None:
    """Let permissions hold for root, too, who may still read what is root's own: a checkout, a Python."""
    if os.geteuid() == 0:
        version_3_and_this_process = (ctypes.c_uint32 * 2)(0x20080522, 0)
        if ctypes.CDLL(None).capset(version_3_and_this_process, (ctypes.c_uint32 * 6)()):
            raise OSError("capabilities cannot be given up")


def without_privileges(folder: Path, call: Callable[[], object], *, somebody_else: bool = False) -> str:
    """Return the code and message of the error that a call raises in a child for which permissions hold.

    With `somebody_else`, the child of root belongs to another user, who must be able to read what it imports.
    """
    for above in (folder, *folder.parents):
        if above.stat().st_uid == os.getuid() and above != Path("/"):
            above.chmod(above.stat().st_mode | 0o055)
    read_end, write_end = os.pipe()
    child = os.fork()
    if child == 0:
        answer = "no error"
        try:
            if somebody_else:
                os.setuid(65534)
            give_up_privileges()
            call()
        except Exception as error:  # whatever it is, the parent shows it
            answer = f"{getattr(error, 'code', type(error).__name__)} {error}"
        os.write(write_end, answer.encode())
        os._exit(0)
    os.close(write_end)
    os.waitpid(child, 0)
    return os.read(read_end, 10_000).decode()


def notched_block() -> str:
    """A 2 x 2 x 2 block with a groove of 1 x 2 x 0.75 along y in its top, as one closed mesh."""
    profile = [(-1, -1), (1, -1), (1, 1), (0.5, 1), (0.5, 0.25), (-0.5, 0.25), (-0.5, 1), (-1, 1)]
    n = len(profile)
    vertices = [(x, -1.0, z) for x, z in profile] + [(x, 1.0, z) for x, z in profile]
    front = [(0, 1, 4), (0, 4, 5), (1, 2, 3), (1, 3, 4), (0, 5, 6), (0, 6, 7)]
    faces = list(front) + [(a + n, c + n, b + n) for a, b, c in front]
    for i in range(n):
        j = (i + 1) % n
        faces += [(i, j + n, j), (i, i + n, j + n)]
    lines = [f"1 {2 * n} {len(faces)} {3 * len(faces)}", f"1 {len(faces)}"]
    lines += [" ".join(map(str, v)) for v in vertices]
    lines += [f"{a + 1} {b + 1} -{c + 1}" for a, b, c in faces]
    return "\n".join(lines) + "\n"


MODEL_FILES = sorted(
    [p for p in MODELS.glob("*/*.env") if p.stem != "maze"] + [MODELS / "maze/maze.xml", MODELS / "xml-arm/xml-arm.xml"]
)


def fault(read: Callable[[], object]) -> Env2MjcfError:
    with pytest.raises(Env2MjcfError) as caught:
        read()
    return caught.value


SCENES = {
    "seed/seed.env": {"query": "seed/seed.query"},
    "gantry/gantry.env": {"query": "gantry/gantry.query"},
    "bug-trap/bug-trap.env": {"query": "bug-trap/bug-trap.query"},
    "spherical-arm/spherical-arm.env": {"query": "spherical-arm/spherical-arm.query"},
    "closed-chain/closed-chain.env": {"query": "closed-chain/closed-chain.query"},
    "alpha/alpha.env": {"query": "alpha/alpha.query"},
    "two-robots/two-robots.env": {"query": "two-robots/two-robots.query"},
    "maze/maze.env": {"robots": ["maze/maze.robot"], "query": "maze/maze.query"},
    "maze/maze.xml": {},
    "xml-arm/xml-arm.xml": {},
    "xml-arm/xml-arm-environment.xml": {"robots": ["xml-arm/xml-arm-robot.xml"]},
}
