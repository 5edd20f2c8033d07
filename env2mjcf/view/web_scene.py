"""Draws a scene on the web page: bodies, boundary, what touches, the way of a path."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..contact.types import Contact
from ..geometry.assembly import Part
from ..mjcf.scenery import OVERVIEW, boundary_lines
from ..simulation.scene import Scene
from ..transforms import Array, quaternion_from_matrix

if TYPE_CHECKING:
    import viser

Colour = tuple[int, int, int]

_TOUCHING: Colour = (214, 69, 65)
_TINT = 0.65
_TOUCHING_OPACITY = 0.55
_SEE_THROUGH = 0.25
_MARK: Colour = (122, 12, 22)
_WIRE: Colour = (120, 128, 138)
_TRAIL: Colour = (44, 93, 138)
_BACKGROUND = ((244, 246, 248), (216, 224, 232))
_FIELD_OF_VIEW = math.radians(40)
# Of the size of what is seen.
_MARK_RADIUS, _NORMAL_LENGTH = 0.006, 0.07


class WebScene:
    """The bodies of a scene on a page.

    Args:
        server: The page.
        scene: The scene.
        rows: (n, dim) configurations that the camera is to see.
    """

    def __init__(self, server: viser.ViserServer, scene: Scene, rows: Array) -> None:
        self._server = server
        assembly = scene.compiled.assembly
        self._link_names = scene.link_names
        fixed = (*assembly.obstacles, *assembly.surfaces)
        self._colours = {p.name: _colour(scene, p) for p in assembly.parts()}
        self._meshes = {p.name: self._add_mesh(i, p) for i, p in enumerate(assembly.parts())}
        self._fixed = frozenset(p.name for p in fixed)
        self._touching: frozenset[str] = frozenset()
        self._see_through = False
        for part in fixed:
            _place(self._meshes[part.name], part.pose)
        lower, upper = _seen(scene, rows)
        self._size = float(np.linalg.norm(upper - lower))
        self._set_stage((lower + upper) / 2)
        if assembly.environment.boundary is not None:
            lines = np.array(boundary_lines(assembly.environment.boundary, assembly))
            server.scene.add_line_segments("/boundary", lines, _WIRE, thickness=1.2, thickness_units="screen")

    def place(self, poses: Array) -> None:
        """Put the links at their world poses, (nlinks, 4, 4)."""
        for name, pose in zip(self._link_names, poses, strict=True):
            _place(self._meshes[name], pose)

    def mark(self, contacts: Sequence[Contact]) -> None:
        """Tint the bodies that touch, and show where they do, with normals from the link to the other body."""
        touching = frozenset(name for c in contacts for name in (c.link, c.other))
        changed = touching ^ self._touching
        self._touching = touching
        self._repaint(changed)
        if not contacts:
            self._server.scene.remove_by_name("/contacts")
            return
        places = np.array([c.position for c in contacts])
        ends = places + self._size * _NORMAL_LENGTH * np.array([c.normal for c in contacts])
        self._add_spheres("/contacts/places", places)
        radius = self._size * _MARK_RADIUS
        self._server.scene.add_arrows(
            "/contacts/normals", np.stack([places, ends], axis=1), _MARK, shaft_radius=radius / 3,
            head_radius=radius, head_length=3 * radius,
        )  # fmt: skip

    def see_through(self, wanted: bool) -> None:
        """Make obstacles transparent, or solid again."""
        self._see_through = wanted
        self._repaint(self._fixed)

    def trail(self, lines: Iterable[Array]) -> None:
        """Draw ways of points, each (n, 3)."""
        for i, points in enumerate(lines):
            segments = np.stack([points[:-1], points[1:]], axis=1)
            self._server.scene.add_line_segments(
                f"/trail/{i}", segments, _TRAIL, thickness=2.5, thickness_units="screen"
            )

    def _add_mesh(self, index: int, part: Part) -> viser.MeshHandle:
        # Names of files stay out of the tree of the page, in which a slash means something.
        return self._server.scene.add_mesh_simple(
            f"/bodies/{index}", part.mesh.vertices, part.mesh.faces, color=self._colours[part.name], flat_shading=True,
            side="double",
        )  # fmt: skip

    def _add_spheres(self, name: str, places: Array) -> None:
        import trimesh

        ball = trimesh.creation.icosphere(subdivisions=2, radius=self._size * _MARK_RADIUS)
        unturned = np.tile([1.0, 0.0, 0.0, 0.0], (len(places), 1))
        self._server.scene.add_batched_meshes_simple(
            name, ball.vertices, ball.faces, unturned, places, batched_colors=_MARK, cast_shadow=False, lod="off"
        )

    def _repaint(self, names: Iterable[str]) -> None:
        for name in names:
            handle, colour = self._meshes[name], self._colours[name]
            if name in self._touching:
                handle.color, handle.opacity = _mixed(colour, _TOUCHING), _TOUCHING_OPACITY
            else:
                handle.color = colour
                handle.opacity = _SEE_THROUGH if self._see_through and name in self._fixed else None

    def _set_stage(self, center: Array) -> None:
        """Place the camera as the MJCF's `overview` stands, light and background."""
        # The shadows of the page reach 20 units from the camera, whatever the size of the scene.
        self._server.scene.configure_default_lights(cast_shadow=False)
        back = np.array(OVERVIEW) / np.linalg.norm(OVERVIEW)
        distance = 0.5 * self._size / math.sin(_FIELD_OF_VIEW / 2) * 1.05
        camera = self._server.initial_camera
        camera.fov = _FIELD_OF_VIEW
        camera.near, camera.far = distance / 1000, distance * 100
        camera.position, camera.look_at, camera.up = center + distance * back, center, (0.0, 0.0, 1.0)
        above, below = (np.array(c, dtype=np.float64) for c in _BACKGROUND)
        share = np.linspace(0, 1, 64)[:, None, None]
        gradient = ((1 - share) * above + share * below).round().astype(np.uint8)
        self._server.scene.set_background_image(np.repeat(gradient, 2, axis=1), format="png")


def _seen(scene: Scene, rows: Array) -> tuple[Array, Array]:
    """Return the corners of a box around all bodies at home, and the balls around links at some configurations."""
    assembly = scene.compiled.assembly
    lower, upper = assembly.lower, assembly.upper
    if len(rows) and scene.link_names:
        origins = scene.link_poses(rows)[..., :3, 3]
        radii = np.array([p.radius for r in assembly.robots for p in r.links])[:, None]
        lower = np.minimum(lower, (origins - radii).min(axis=(0, 1)))
        upper = np.maximum(upper, (origins + radii).max(axis=(0, 1)))
    return lower, upper


def _colour(scene: Scene, part: Part) -> Colour:
    red, green, blue, _ = (round(255 * float(c)) for c in scene.model.geom(f"{part.name}:visual").rgba)
    return red, green, blue


def _mixed(colour: Colour, tint: Colour) -> Colour:
    red, green, blue = (round(_TINT * b + (1 - _TINT) * a) for a, b in zip(colour, tint, strict=True))
    return red, green, blue


def _place(handle: viser.MeshHandle, pose: Array) -> None:
    handle.position = pose[:3, 3]
    handle.wxyz = quaternion_from_matrix(pose[:3, :3])
