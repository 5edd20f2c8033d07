"""What the web page shows of a scene: bodies, contacts, the way of a path; camera, light, ground and boundary."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...contact.types import Contact
from ...geometry.assembly import Part
from ...mjcf.scenery import boundary_lines
from ...simulation.scene import Scene
from ...transforms import Array, quaternion_from_matrix, shifted, translated
from ..cameras import FIELD_OF_VIEW, box_corners, fitted, named_direction

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
        server: The server of the page.
        scene: The scene.
    """

    def __init__(self, server: viser.ViserServer, scene: Scene) -> None:
        self._server = server
        self._extent = scene.extent
        # Pages know single precision only: they show the scene about its own origin, and meshes about theirs.
        self._origin = scene.origin
        assembly = scene.compiled.assembly
        self._links = assembly.links
        fixed = (*assembly.obstacles, *assembly.surfaces)
        self._colours = {p.name: _colour(scene, p) for p in assembly.parts()}
        self._meshes = {p.name: self._add_mesh(i, p) for i, p in enumerate(assembly.parts())}
        self._fixed = frozenset(p.name for p in fixed)
        self._touching: frozenset[str] = frozenset()
        self._see_through = False
        for part in fixed:
            _place(self._meshes[part.name], part.mesh_pose)

    def place(self, poses: Array) -> None:
        """Put the links at their world poses, (nlinks, 4, 4)."""
        for part, pose in zip(self._links, translated(poses, -self._origin), strict=True):
            _place(self._meshes[part.name], shifted(pose, part.mesh.center))

    def mark(self, contacts: Sequence[Contact]) -> None:
        """Tint the bodies that touch, and show where they do, with normals from the link to the other body."""
        touching = frozenset(name for c in contacts for name in (c.link, c.other))
        changed = touching ^ self._touching
        self._touching = touching
        self._repaint(changed)
        if not contacts:
            self._server.scene.remove_by_name("/contacts")
            return
        places = np.array([c.position for c in contacts]) - self._origin
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
            segments = np.stack([points[:-1], points[1:]], axis=1) - self._origin
            self._server.scene.add_line_segments(
                f"/trail/{i}", segments, _TRAIL, thickness=2.5, thickness_units="screen"
            )

    def _add_mesh(self, index: int, part: Part) -> viser.MeshHandle:
        # Names of files stay out of the tree of the page, in which a slash means something.
        name, mesh, colour = f"/bodies/{index}", part.mesh, self._colours[part.name]
        return self._server.scene.add_mesh_simple(
            name, mesh.vertices, mesh.faces, color=colour, flat_shading=True, side="double"
        )

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


_WIRE = (120, 128, 138)
# Above and below.
_BACKGROUND = ((244, 246, 248), (216, 224, 232))
# A boundary is seen whole if it is no more than so many times as large as all bodies.
_BOUNDARY_SEEN = 1.5


def set_stage(server: viser.ViserServer, scene: Scene, rows: Array) -> None:
    """Set a page up for a scene.

    Args:
        server: The server of the page.
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
        _add_ground(server, scene)
    if assembly.boundary is not None:
        lines = np.array(boundary_lines(assembly.boundary, assembly))
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
    view = fitted(box_corners(lower, upper), named_direction("overview"), 1.0)
    position, forward = np.array(view.position), np.array(view.forward)
    distance = float(((lower + upper) / 2 - position) @ forward)
    camera = server.initial_camera
    camera.fov = FIELD_OF_VIEW
    camera.near, camera.far = distance / 1000, distance * 100
    camera.position, camera.look_at, camera.up = position, position + distance * forward, (0.0, 0.0, 1.0)


def _add_ground(server: viser.ViserServer, scene: Scene) -> None:
    size = 2 * scene.extent
    server.scene.add_grid(
        "/ground", size, size, cell_size=size / 40, section_size=size / 8, cell_color=_WIRE, section_color=_WIRE,
        position=scene.model.geom("ground").pos,
    )  # fmt: skip


def _seen(scene: Scene, rows: Array) -> tuple[Array, Array]:
    """Return the corners of a box around bodies at home, links at some configurations, and a boundary of like size."""
    assembly = scene.compiled.assembly
    lower, upper = assembly.lower, assembly.upper
    if len(rows) and scene.link_names:
        poses = translated(scene.link_poses(rows), -scene.origin)
        for i, part in enumerate(assembly.links):
            used = part.mesh.vertices + part.mesh.center
            corners = box_corners(used.min(axis=0), used.max(axis=0))
            world = np.einsum("nij,cj->nci", poses[:, i, :3, :3], corners) + poses[:, i, None, :3, 3]
            lower, upper = np.minimum(lower, world.min(axis=(0, 1))), np.maximum(upper, world.max(axis=(0, 1)))
    if assembly.boundary is not None:
        wires = np.array(boundary_lines(assembly.boundary, assembly)).reshape(-1, 3)
        low, high = np.minimum(lower, wires.min(axis=0)), np.maximum(upper, wires.max(axis=0))
        if np.linalg.norm(high - low) <= _BOUNDARY_SEEN * np.linalg.norm(upper - lower):
            return low, high
    return lower, upper
