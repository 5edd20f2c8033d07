"""Rebuilds flat parts of a closed surface that are folded over themselves, without moving the surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .analysis import Analysis
from .coplanar import flat_neighbours
from .planar import triangulated
from .topology import Bools, Floats, Ints, area_vectors, connected, edges

_MOST_FACES = 1000
"""Faces of a patch beyond which it is left alone."""

_MOST_EDGES = 128
"""Edges of a patch's outline beyond which it is left alone: that many take about a second, twice as many eight."""

_UNCOVERED = 1e-12
"""Area in units of the squared diagonal that counts as nothing: a spot a millionth of the diagonal across."""


@dataclass(frozen=True, slots=True, eq=False)
class Unfolded:
    """A surface without folds.

    Attributes:
        faces: (m, 3).
        source: (m,) the old face that each stands for: itself, or one of its patch near the new one's middle.
        rebuilt: Number of old faces in flat parts that were triangulated anew.
        sheets: Number of old faces that were wound against their plane and reach beyond the solid; the file's surface
            has them, so they stay, as sheets with two sides.
    """

    faces: Ints
    source: Ints
    rebuilt: int
    sheets: int


def unfolded(analysis: Analysis) -> Unfolded | None:
    """Triangulate each flat patch anew that has neighbours with opposite normals; None where there is none.

    Such neighbours lie upon each other, and the faces of the patch cancel: what bounds the solid is the part of the
    plane that their signed sum covers, and its outline is the signed sum of their edges. The winding number of no
    point changes, because the new faces have the same signed boundary and lie in the same plane.

    Args:
        analysis: The mesh; only its `solids` are changed.
    """
    vertices, faces = analysis.vertices, analysis.faces
    areas = area_vectors(vertices[faces])
    normals = areas / np.linalg.norm(areas, axis=1, keepdims=True)
    keep = np.ones(len(faces), dtype=np.bool_)
    new: list[Ints] = []
    source: list[Ints] = []
    sheets = 0
    for patch in _folded_patches(analysis, normals):
        normal = areas[patch].sum(axis=0)
        length = float(np.linalg.norm(normal))
        if length <= _UNCOVERED * analysis.diagonal**2:
            continue
        built = _rebuilt(analysis, patch, normal / length)
        if built is not None:
            keep[patch] = False
            new.append(built[0])
            source.append(built[1])
            sheets += built[2]
    if keep.all():
        return None
    all_faces = np.concatenate([faces[keep], *new])
    return Unfolded(all_faces, np.concatenate([np.flatnonzero(keep), *source]), int((~keep).sum()), sheets)


def _folded_patches(analysis: Analysis, normals: Floats) -> list[Ints]:
    """Return the faces of each connected flat patch in which neighbours have opposite normals."""
    vertices, faces = analysis.vertices, analysis.faces
    here, there, _, cosine = flat_neighbours(vertices, faces, edges(faces), normals, analysis.tolerance)
    solid = analysis.solids[analysis.component[here // 3]] & analysis.solids[analysis.component[there // 3]]
    here, there, cosine = here[solid], there[solid], cosine[solid]
    label = connected(len(normals), here // 3, there // 3)
    return [np.flatnonzero(label == p) for p in np.unique(label[here[cosine < 0] // 3]).tolist()]


def _rebuilt(analysis: Analysis, patch: Ints, normal: Floats) -> tuple[Ints, Ints, int] | None:
    """Return new faces for a patch, their sources, and how many of them are sheets; None to leave it alone."""
    if len(patch) > _MOST_FACES:
        return None
    used, local = np.unique(analysis.faces[patch], return_inverse=True)
    local = local.reshape(-1, 3)
    points = analysis.vertices[used] - analysis.vertices[used[0]]
    height = points @ normal
    if np.ptp(height) > analysis.tolerance:
        return None
    flat = points @ _axes(normal).T
    boundary = _outline(local)
    if boundary is None or len(boundary) > _MOST_EDGES:
        return None
    triangles = triangulated(flat, boundary, analysis.tolerance)
    if triangles is None:
        return None
    doubled_areas = _doubled_areas(flat[local])
    against = np.flatnonzero(doubled_areas < 0)
    covered = np.array([sum(_common_area(flat[t], flat[n]) for n in triangles) for t in local[against, ::-1]])
    beyond = against[-doubled_areas[against] / 2 - covered > _UNCOVERED * analysis.diagonal**2]
    sheet = local[beyond]
    found = np.concatenate([triangles, sheet, sheet[:, ::-1]])
    nearest = _nearest(flat[local], flat[triangles].mean(axis=1))
    return used[found], patch[np.concatenate([nearest, beyond, beyond])], len(beyond)


def _axes(normal: Floats) -> Floats:
    """Return two unit vectors of a plane, (2, 3), counter-clockwise about its normal; axes of space if they can be."""
    k = int(np.argmax(np.abs(normal)))
    u = np.cross(np.eye(3)[(k + 2) % 3], normal)
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(normal, u)])


def _outline(local: Ints) -> Ints | None:
    """Return the directed edges (e, 2) that are left of a patch's; None if one is left more than once."""
    table = edges(local)
    if (np.abs(table.balance) > 1).any():
        return None
    forward, backward = table.ends[table.balance == 1], table.ends[table.balance == -1]
    return np.concatenate([forward, backward[:, ::-1]])


def _doubled_areas(corners: Floats) -> Floats:
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]


def _common_area(one: Floats, other: Floats) -> float:
    """Return the area that two counter-clockwise triangles (3, 2) have in common.

    Cuts the first by the sides of the second (Sutherland and Hodgman, CACM 17(1), 1974).
    """
    left = [tuple(p) for p in one.tolist()]
    for (ax, ay), (bx, by) in zip(other.tolist(), np.roll(other, -1, axis=0).tolist(), strict=True):
        sides = [(bx - ax) * (y - ay) - (by - ay) * (x - ax) for x, y in left]
        kept: list[tuple[float, float]] = []
        for i, (p, s) in enumerate(zip(left, sides, strict=True)):
            q, t = left[i - 1], sides[i - 1]
            if s * t < 0:
                share = t / (t - s)
                kept.append((q[0] + share * (p[0] - q[0]), q[1] + share * (p[1] - q[1])))
            if s >= 0:
                kept.append(p)
        left = kept
    x0, y0 = left[0] if left else (0.0, 0.0)
    following = left[1:] + left[:1]
    return sum((x - x0) * (v - y0) - (u - x0) * (y - y0) for (x, y), (u, v) in zip(left, following, strict=True)) / 2


def _nearest(corners: Floats, points: Floats) -> Ints:
    """Return for each point (n, 2) the triangle (m, 3, 2) that it is deepest in, or least far out of, (n,)."""
    turned: Bools = _doubled_areas(corners) < 0
    corners = np.where(turned[:, None, None], corners[:, ::-1], corners)
    along = np.roll(corners, -1, axis=1) - corners
    left = np.stack([-along[:, :, 1], along[:, :, 0]], axis=2) / np.linalg.norm(along, axis=2, keepdims=True)
    depth = np.einsum("mej,nmej->nme", left, points[:, None, None] - corners[None]).min(axis=2)
    return np.argmax(depth, axis=1).astype(np.int64)
