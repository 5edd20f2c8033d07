"""Geoms of one body: the mesh that is drawn, and the convex cells that collide."""

from __future__ import annotations

from ..geometry.assembly import Part
from ..transforms import quaternion_from_matrix
from .assets import AssetBook
from .writer import Element, add, numbers

# Links collide with everything; obstacles with links only. A geom that a user adds with MuJoCo's default masks (1, 1),
# such as a floor, collides with links and not with obstacles.
_OBSTACLE_MASKS = {"contype": "2", "conaffinity": "0"}

_ROBOT_COLORS = (
    (0.16, 0.47, 0.71, 1.0),
    (0.85, 0.42, 0.15, 1.0),
    (0.24, 0.60, 0.33, 1.0),
    (0.55, 0.36, 0.64, 1.0),
    (0.76, 0.24, 0.33, 1.0),
    (0.17, 0.63, 0.64, 1.0),
)
_OBSTACLE_COLOR = (0.62, 0.64, 0.66, 1.0)
_SURFACE_COLOR = (0.82, 0.80, 0.74, 1.0)


def robot_color(number: int) -> tuple[float, ...]:
    """Return the colour of a robot that has none of its own."""
    return _ROBOT_COLORS[number % len(_ROBOT_COLORS)]


def add_visual(parent: Element, part: Part, assets: AssetBook, color: tuple[float, ...] | None = None) -> None:
    """Append the geom that is drawn; the file's colour wins, unless it is wholly transparent."""
    rgba = part.body.color
    if rgba is None or rgba[3] == 0:
        rgba = color or (_SURFACE_COLOR if part.shape is None else _OBSTACLE_COLOR)
    add(
        parent, "geom", name=f"{part.name}:visual", class_="visual", mesh=assets.visual_name(part.mesh),
        rgba=numbers(rgba),
    )  # fmt: skip


def add_collision(
    parent: Element, part: Part, assets: AssetBook, *, obstacle: bool, primitives: bool, owners: dict[str, str]
) -> None:
    """Append the geoms that collide, and note whose they are in `owners`."""
    if part.shape is None:
        return
    masks = _OBSTACLE_MASKS if obstacle else {}
    box = part.analysis.box if primitives else None
    if box is not None:
        name = f"{part.name}:0"
        owners[name] = part.name
        add(
            parent, "geom", name=name, class_="collision", type="box", size=numbers(box.half_sizes),
            pos=numbers(box.center), quat=numbers(quaternion_from_matrix(box.rotation)), **masks,
        )  # fmt: skip
        return
    assets.use_cells(part.mesh, part.shape)
    for i, piece in enumerate(part.shape.pieces):
        name = f"{part.name}:{i}"
        owners[name] = part.name
        add(
            parent, "geom", name=name, class_="collision", mesh=assets.cell_name(part.mesh, i),
            pos=numbers(piece.center), **masks,
        )  # fmt: skip
