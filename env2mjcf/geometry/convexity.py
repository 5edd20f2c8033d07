"""Whether a closed surface is the boundary of its own hull, and whether that hull is a box."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .topology import Edges, Floats, Ints, area_vectors, edges

_BLOCK = 4_000_000  # distances held in memory at once


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """A box in the mesh's frame.

    Attributes:
        half_sizes: (3,) half of each side.
        center: (3,).
        rotation: (3, 3) columns are the directions of the sides; the identity for a box along the axes.
    """

    half_sizes: Floats
    center: Floats
    rotation: Floats


def is_convex(vertices: Floats, faces: Ints, tolerance: float, table: Edges | None = None) -> bool:
    """Tell whether every vertex lies within `tolerance` behind the plane of every face.

    The surface must be closed; its winding does not matter, because the mean of its vertices is inside a convex one.

    Args:
        vertices: (n, 3), all used by `faces`.
        faces: (m, 3) without degenerate ones.
        tolerance: Length.
        table: `edges(faces)`, where it is known.
    """
    if len(faces) < 4:
        return False
    normals, offsets = _planes_from_mean(vertices, faces)
    limits = offsets + tolerance
    if not _edges_bulge(vertices, faces, table or edges(faces), normals, limits):
        return False
    # Planes that are equal to the last bit, as those of a tessellated flat side often are, count once.
    planes = np.unique(np.column_stack([normals, limits]), axis=0)
    return _all_behind(vertices, planes[:, :3], planes[:, 3])


def _planes_from_mean(vertices: Floats, faces: Ints) -> tuple[Floats, Floats]:
    corners = vertices[faces]
    normals = area_vectors(corners)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    heights = np.einsum("ij,ij->i", normals, corners.mean(axis=1) - vertices.mean(axis=0))
    normals[heights < 0] *= -1
    # A vertex of the triangle farthest out: a face does not fail on the rounding of its own corners.
    return normals, np.einsum("ij,ikj->ik", normals, corners).max(axis=1)


def _edges_bulge(vertices: Floats, faces: Ints, table: Edges, normals: Floats, limits: Floats) -> bool:
    """Test each face against the neighbours only: linear in time, and most non-convex meshes end here."""
    first, second, _ = table.neighbours()
    for here, there in ((first, second), (second, first)):
        face, opposite = here // 3, faces[there // 3, (there % 3 + 2) % 3]
        if (np.einsum("ij,ij->i", normals[face], vertices[opposite]) > limits[face]).any():
            return False
    return True


def _all_behind(vertices: Floats, normals: Floats, limits: Floats) -> bool:
    """Test every vertex against every plane, down a tree of boxes: what lies wholly behind a plane is not opened."""
    boxes, leaves = _tree(vertices)
    step = max(1, _BLOCK // 256)
    for i in range(0, len(normals), step):
        normal, limit = normals[i : i + step], limits[i : i + step]
        plane, node = np.arange(len(normal)), np.zeros(len(normal), dtype=np.int64)
        for depth, (middle, half) in enumerate(boxes):
            if depth:
                plane, node = np.repeat(plane, 2), (2 * node[:, None] + (0, 1)).ravel()
            reach = np.einsum("ij,ij->i", normal[plane], middle[node])
            reach += np.einsum("ij,ij->i", np.abs(normal[plane]), half[node])
            plane, node = plane[reach > limit[plane]], node[reach > limit[plane]]
        per_block = max(1, _BLOCK // leaves.shape[1])
        for j in range(0, len(plane), per_block):
            p = plane[j : j + per_block]
            heights = (leaves[node[j : j + per_block]] @ normal[p][:, :, None])[:, :, 0]
            if (heights.max(axis=1) > limit[p]).any():
                return False
    return True


def _tree(vertices: Floats, size: int = 8) -> tuple[list[tuple[Floats, Floats]], Floats]:
    """Split points at medians.

    Returns:
        Middles and half sides, (2**depth, 3), of the boxes at each depth, and the leaves' points, (leaves, size, 3),
        some of them twice where the number does not divide.
    """
    count = 1 << max(0, int(np.ceil(np.log2(len(vertices) / size))))
    parts = np.resize(vertices, (-(-len(vertices) // count) * count, 3))[None]
    boxes: list[tuple[Floats, Floats]] = []
    while True:
        low, high = parts.min(axis=1), parts.max(axis=1)
        boxes.append(((low + high) / 2, (high - low) / 2))
        if len(parts) == count:
            return boxes, parts
        along = np.take_along_axis(parts, (high - low).argmax(axis=1)[:, None, None], axis=2)[:, :, 0]
        order = np.argsort(along, axis=1, kind="stable")
        parts = np.take_along_axis(parts, order[:, :, None], axis=1).reshape(2 * len(parts), -1, 3)


def exact_box(vertices: Floats, faces: Ints, tolerance: float) -> Box | None:
    """Return the box that a convex surface is, to within `tolerance`, or None.

    Args:
        vertices: (n, 3), all used by `faces`.
        faces: (m, 3) of a convex surface.
        tolerance: Length by which a corner may be off.
    """
    areas = area_vectors(vertices[faces])
    sizes = np.linalg.norm(areas, axis=1)
    normals = areas / sizes[:, None]
    first = normals[np.argmax(sizes)]
    # Sides that stand on the first: the largest of them gives the second direction.
    upright = np.abs(normals @ first) < 0.5
    if not upright.any():
        return None
    second = normals[upright][np.argmax(sizes[upright])]
    second = second - first * (first @ second)
    second /= np.linalg.norm(second)
    rotation = _nearest_to_identity(np.column_stack([first, second, np.cross(first, second)]))
    local = vertices @ rotation
    low, high = local.min(axis=0), local.max(axis=0)
    on_side = np.minimum(np.abs(local - low), np.abs(local - high)) <= tolerance
    # On a box each vertex lies on a side, and each corner is a vertex.
    at_corner = np.unique((local > (low + high) / 2)[on_side.all(axis=1)], axis=0)
    if not on_side.any(axis=1).all() or len(at_corner) != 8:
        return None
    return Box((high - low) / 2, rotation @ ((low + high) / 2), rotation)


def _nearest_to_identity(axes: Floats) -> Floats:
    """Reorder and turn round the columns so that the diagonal is large and positive and the frame right-handed."""
    columns = [0, 1, 2]
    chosen: list[int] = []
    for row in range(3):
        best = max(columns, key=lambda c: (round(abs(float(axes[row, c])), 9), -c))
        columns.remove(best)
        chosen.append(best)
    out = axes[:, chosen]
    out = out * np.where(np.diag(out) < 0, -1.0, 1.0)
    if np.linalg.det(out) < 0:
        out[:, 2] *= -1
    return np.asarray(out + 0.0, dtype=np.float64)
