"""Draws what is in a scene on the web page: bodies, what touches, the way of a path."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..contact.types import Contact
from ..geometry.assembly import Part
from ..simulation.scene import Scene
from ..transforms import Array, quaternion_from_matrix

if TYPE_CHECKING:
    import viser

Colour = tuple[int, int, int]

_TOUCHING: Colour = (214, 69, 65)
# How much of a body that touches is tinted, and how opaque it is: marks inside it are to be seen.
_LINK_TINT, _LINK_OPACITY = 0.8, 0.75
_OBSTACLE_TINT, _OBSTACLE_OPACITY = 0.45, 0.35
_SEE_THROUGH = 0.25
_MARK: Colour = (122, 12, 22)
_TRAIL: Colour = (44, 93, 138)
# Of the extent.
_MARK_RADIUS, _NORMAL_LENGTH = 0.005, 0.05


class WebScene:
    """The bodies of a scene on a page.

    Args:
        server: The page.
        scene: The scene.
    """

    def __init__(self, server: viser.ViserServer, scene: Scene) -> None:
        self._server = server
        self._extent = scene.extent
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
        ends = places + self._extent * _NORMAL_LENGTH * np.array([c.normal for c in contacts])
        self._add_spheres("/contacts/places", places)
        radius = self._extent * _MARK_RADIUS
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
            if not np.ptp(points, axis=0).any():
                continue
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

        ball = trimesh.creation.icosphere(subdivisions=2, radius=self._extent * _MARK_RADIUS)
        unturned = np.tile([1.0, 0.0, 0.0, 0.0], (len(places), 1))
        self._server.scene.add_batched_meshes_simple(
            name, ball.vertices, ball.faces, unturned, places, batched_colors=_MARK, cast_shadow=False, lod="off"
        )

    def _repaint(self, names: Iterable[str]) -> None:
        for name in names:
            handle, colour = self._meshes[name], self._colours[name]
            if name in self._touching:
                fixed = name in self._fixed
                handle.color = _mixed(colour, _TOUCHING, _OBSTACLE_TINT if fixed else _LINK_TINT)
                handle.opacity = _OBSTACLE_OPACITY if fixed else _LINK_OPACITY
            else:
                handle.color = colour
                handle.opacity = _SEE_THROUGH if self._see_through and name in self._fixed else None


def _colour(scene: Scene, part: Part) -> Colour:
    red, green, blue, _ = (round(255 * float(c)) for c in scene.model.geom(f"{part.name}:visual").rgba)
    return red, green, blue


def _mixed(colour: Colour, tint: Colour, share: float) -> Colour:
    red, green, blue = (round(share * b + (1 - share) * a) for a, b in zip(colour, tint, strict=True))
    return red, green, blue


def _place(handle: viser.MeshHandle, pose: Array) -> None:
    handle.position = pose[:3, 3]
    handle.wxyz = quaternion_from_matrix(pose[:3, :3])
