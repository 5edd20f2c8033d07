"""Writes paths in the planners' own format (env-format section 13.2)."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

from ..options import PathArgument
from ..simulation.scene import Scene
from ..transforms import Array

_VERSION = 2012


def write_path(scene: Scene, q: Array, file: PathArgument, robot: int = 0) -> Path:
    """Write configurations of one robot, (k, dim), to a path file in the file's own units; return its path.

    The file is written beside its place and renamed there. Where there are several robots, each row begins with the
    robot's index.
    """
    rows = scene.space.encode(q)[:, scene.space.robot_slices[robot]]
    index = f"{robot} " if len(scene.space.robot_slices) > 1 else ""
    lines = [f"VIZMO_PATH_FILE   Path Version {_VERSION}", "1", str(len(rows))]
    lines += [index + " ".join(repr(float(x)) for x in row) for row in rows]
    path = Path(os.fspath(file))
    beside = path.with_name(f".{path.name}-{secrets.token_hex(8)}")
    try:
        beside.write_text("\n".join(lines) + "\n", encoding="ascii")
        os.replace(beside, path)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise
    return path
