"""What makes two batches the same, so that one may go on with what the other has done."""

from __future__ import annotations

import hashlib
import json
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from ..simulation.scene import Scene


def identity(scene: Scene, what: str, file_units: bool) -> str:
    """Return a digest of all that answers depend on but the configurations: the scene as it is read, not its path."""
    compiled, space = scene.compiled, scene.space
    options = compiled.options
    digest = hashlib.sha256()
    facts = [
        _version(), what, file_units, options.collision, options.engine, options.semantics, options.scale,
        scene.pairs, space.names, repr(compiled.assembly.environment.boundary),
    ]  # fmt: skip
    digest.update(json.dumps(facts).encode())
    for array in (space.lower, space.upper, space.periodic, space.home, space.decode(np.ones(space.dim))):
        digest.update(np.ascontiguousarray(array).tobytes())
    # Meshes as they were read: those of the MJCF are rounded to floats.
    for part in compiled.assembly.parts():
        for array in (part.mesh.vertices, part.mesh.faces):
            digest.update(repr((part.name, array.shape)).encode() + np.ascontiguousarray(array).tobytes())
    digest.update(scene.xml.encode())
    for name, content in sorted(scene.assets.items()):
        digest.update(name.encode() + content)
    return digest.hexdigest()


def _version() -> str:
    try:
        return version("env2mjcf")
    except PackageNotFoundError:
        return "a checkout"
