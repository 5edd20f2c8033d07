"""What surrounds the bodies on the web page: camera, light, background, ground and boundary."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from ..geometry.assembly import Assembly
from ..mjcf.boundary import boundary_lines
from ..simulation.scene import Scene
from ..transforms import Array
from .framing import FIELD_OF_VIEW, fitted, named_direction

if TYPE_CHECKING:
    import viser

_WIRE = (120, 128, 138)
# Above and below.
_BACKGROUND = ((244, 246, 248), (216, 224, 232))
# A boundary is seen whole if it is no more than so many times as large as all bodies.
_BOUNDARY_SEEN = 1.5


def set_stage(server: viser.ViserServer, scene: Scene, rows: Array) -> None:
    """Set a page up for a scene.

    Args:
        server: The page.
        scene: The scene.
        rows: (n, dim) configurations that the camera is to see besides home.
    """
    assembly = scene.compiled.assembly
    _add_lights(server)
    _place_camera(server, *_seen(scene, rows))
    above, below = (np.array(c, dtype=np.float64) for c in _BACKGROUND)
    share = np.linspace(0, 1, 64)[:, None, None]
    gradient = ((1 - share) * above + share * below).round().astype(np.uint8)
    server.scene.set_background_image(np.repeat(gradient, 2, axis=1), format="png")
    if scene.compiled.options.ground:
        _add_ground(server, assembly)
    if assembly.environment.boundary is not None:
        lines = np.array(boundary_lines(assembly.environment.boundary, assembly))
        server.scene.add_line_segments("/boundary", lines, _WIRE, thickness=1.2, thickness_units="screen")


def _add_lights(server: viser.ViserServer) -> None:
    # The shadows of the page reach 20 units from the camera, whatever the size of the scene.
    server.scene.configure_default_lights(cast_shadow=False)
    # A sky of one colour instead of a photograph, which browsers without a GPU prepare for seconds.
    server.scene.configure_environment_map(None)
    server.scene.add_light_hemisphere("/sky", sky_color=(255, 255, 255), ground_color=(150, 150, 160), intensity=1.5)
    # From the side, so that walls at right angles differ.
    server.scene.add_light_directional("/lamp", intensity=0.9, position=(1.0, -0.35, 0.3))


def _place_camera(server: viser.ViserServer, lower: Array, upper: Array) -> None:
    """Look from where the MJCF's `overview` stands, as near as a whole box is seen in a square picture."""
    view = fitted(_corners(lower, upper), named_direction("overview"), 1.0)
    position, forward = np.array(view.position), np.array(view.forward)
    distance = float(((lower + upper) / 2 - position) @ forward)
    camera = server.initial_camera
    camera.fov = FIELD_OF_VIEW
    camera.near, camera.far = distance / 1000, distance * 100
    camera.position, camera.look_at, camera.up = position, position + distance * forward, (0.0, 0.0, 1.0)


def _add_ground(server: viser.ViserServer, assembly: Assembly) -> None:
    x, y, _ = (assembly.lower + assembly.upper) / 2
    size = 2 * assembly.extent
    server.scene.add_grid(
        "/ground", size, size, cell_size=size / 40, section_size=size / 8, cell_color=_WIRE, section_color=_WIRE,
        position=(x, y, assembly.lower[2]),
    )  # fmt: skip


def _seen(scene: Scene, rows: Array) -> tuple[Array, Array]:
    """Return the corners of a box around bodies at home, links at some configurations, and a boundary of like size."""
    assembly = scene.compiled.assembly
    lower, upper = assembly.lower, assembly.upper
    if len(rows) and scene.link_names:
        poses = scene.link_poses(rows)
        for i, part in enumerate(p for r in assembly.robots for p in r.links):
            corners = _corners(part.mesh.vertices.min(axis=0), part.mesh.vertices.max(axis=0))
            world = np.einsum("nij,cj->nci", poses[:, i, :3, :3], corners) + poses[:, i, None, :3, 3]
            lower, upper = np.minimum(lower, world.min(axis=(0, 1))), np.maximum(upper, world.max(axis=(0, 1)))
    if assembly.environment.boundary is not None:
        wires = np.array(boundary_lines(assembly.environment.boundary, assembly)).reshape(-1, 3)
        low, high = np.minimum(lower, wires.min(axis=0)), np.maximum(upper, wires.max(axis=0))
        if np.linalg.norm(high - low) <= _BOUNDARY_SEEN * np.linalg.norm(upper - lower):
            return low, high
    return lower, upper


def _corners(lower: Array, upper: Array) -> Array:
    """Return the corners of a box, (8, 3)."""
    return np.array(list(itertools.product(*zip(lower, upper, strict=True))))
