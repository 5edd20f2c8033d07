"""Geoms of one body, the mesh that is drawn and the convex cells that collide, and which of them are tested."""

from __future__ import annotations

from collections.abc import Mapping

from ..geometry.assembly import Part
from ..pairs import PairTable
from ..transforms import Array, quaternion_from_matrix
from .assets import AssetBook
from .markup import Element, add, comment, numbers

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


def add_visual(
    parent: Element, part: Part, assets: AssetBook, place: Array, color: tuple[float, ...] | None = None
) -> None:
    """Append the geom that is drawn; the file's colour wins, unless it is wholly transparent.

    `place` is where the frame of the mesh stands in that of the parent, (3,).
    """
    rgba = part.body.color
    if rgba is None or rgba[3] == 0:
        rgba = color or (_SURFACE_COLOR if part.shape is None else _OBSTACLE_COLOR)
    mesh = assets.visual_name(part.mesh)
    pos = numbers(place) if place.any() else None
    add(parent, "geom", name=f"{part.name}:visual", class_="visual", mesh=mesh, pos=pos, rgba=numbers(rgba))


def add_collision(
    parent: Element,
    part: Part,
    assets: AssetBook,
    place: Array,
    *,
    obstacle: bool,
    primitives: bool,
    owners: dict[str, str],
) -> None:
    """Append the geoms that collide, and note whose they are in `owners`; `place` as for `add_visual`."""
    if part.shape is None:
        return
    masks = _OBSTACLE_MASKS if obstacle else {}
    box = part.shape.box if primitives else None
    if box is not None:
        name, size = f"{part.name}:0", numbers(box.half_sizes)
        pose = {"pos": numbers(place + box.center), "quat": numbers(quaternion_from_matrix(box.rotation))}
        owners[name] = part.name
        add(parent, "geom", name=name, class_="collision", type="box", size=size, **pose, **masks)
        return
    assets.use_cells(part.mesh, part.shape)
    for i, piece in enumerate(part.shape.pieces):
        name = f"{part.name}:{i}"
        owners[name] = part.name
        mesh, pos = assets.cell_name(part.mesh, i), numbers(place + piece.center)
        add(parent, "geom", name=name, class_="collision", mesh=mesh, pos=pos, **masks)


# A constant pair of more geoms than this is tested by env2mjcf at load alone: MuJoCo tests every <pair> at each step.
_MAX_EXPLICIT_PAIRS = 256


def excluded_obstacles(table: PairTable) -> frozenset[str]:
    """Return the obstacles that some link must be excluded from, which therefore need bodies of their own."""
    return frozenset(p.other for p in table.excluded if p.kind == "obstacle")


def add_contacts(root: Element, table: PairTable, owners: Mapping[str, str]) -> None:
    """Append `<contact>` with an exclude for each untested pair of bodies and a pair for each constant one.

    MuJoCo's own parent filter is off, since it judges welded bodies and static bases otherwise than the planner.
    """
    geoms: dict[str, list[str]] = {}
    for geom, owner in owners.items():
        geoms.setdefault(owner, []).append(geom)
    contact = add(root, "contact")
    for pair in table.excluded:
        add(contact, "exclude", body1=pair.link, body2=pair.other)
    for pair in table.tested:
        if not pair.constant:
            continue
        mine, others = geoms.get(pair.link, []), geoms.get(pair.other, [])
        if len(mine) * len(others) > _MAX_EXPLICIT_PAIRS:
            comment(contact, [f"{pair.link} and {pair.other} cannot move: tested once when env2mjcf loads the scene"])
            continue
        for geom1 in mine:
            for geom2 in others:
                add(contact, "pair", geom1=geom1, geom2=geom2)
    if not len(contact):
        root.remove(contact)
