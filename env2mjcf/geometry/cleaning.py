"""Weld a triangle list, and drop what is no triangle or is there twice."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .topology import RELATIVE_TOLERANCE, Bools, Edges, Floats, Ints, edges, face_areas, face_volumes, weld


@dataclass(frozen=True, slots=True, eq=False)
class Cleaned:
    """Triangles without degenerate and duplicate ones.

    Attributes:
        faces: (k, 3) indices into the given points, welded ones replaced by the first of their kind.
        source: (k,) rows of the given faces.
        edges: Of the faces that decide whether the surface is closed: `faces`, and perhaps some of no height.
        closed: Each of those edges has an even number of faces, and the points are not flat.
        degenerate: Number of faces of no height.
        duplicates: Number of copies that were dropped.
    """

    faces: Ints
    source: Ints
    edges: Edges
    closed: bool
    degenerate: int
    duplicates: int


def cleaned(points: Floats, faces: Ints, tolerance: float, dimension: int) -> Cleaned:
    """Weld and clean triangles.

    Args:
        points: (n, 3).
        faces: (m, 3) indices into `points`.
        tolerance: Length that counts as nothing.
        dimension: Of the point set; below 3 nothing is closed.
    """
    faces = weld(points, tolerance)[faces].reshape(-1, 3)
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    high = _heights(points, faces) > tolerance
    one, both = _without_copies(faces)
    keep, table, closed = _choose(points, faces, (one & whole, both & whole), high, dimension)
    source = np.flatnonzero(keep & high)
    degenerate = int((~whole | (one & ~high)).sum())
    return Cleaned(faces[source], source, table, closed, degenerate, int((whole & ~keep).sum()))


def _heights(points: Floats, faces: Ints) -> Floats:
    """Return the smallest height of each face, (m,)."""
    corners = points[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    return np.divide(2 * face_areas(points, faces), longest, out=np.zeros(len(faces)), where=longest > 0)


def _without_copies(faces: Ints) -> tuple[Bools, Bools]:
    """Return two masks (m,): one copy of each triangle, and one copy of each triangle and winding."""
    corner = np.argsort(faces, axis=1)
    turned = (np.diff(corner, axis=1) % 3 == 1).all(axis=1)
    keys = np.sort(faces, axis=1)
    one, both = np.zeros((2, len(faces)), dtype=np.bool_)
    if len(faces):
        one[np.unique(keys, axis=0, return_index=True)[1]] = True
        both[np.unique(np.column_stack([keys, turned]), axis=0, return_index=True)[1]] = True
    return one, both


def _choose(
    points: Floats, faces: Ints, masks: tuple[Bools, Bools], high: Bools, dimension: int
) -> tuple[Bools, Edges, bool]:
    """Pick the face set that closes the surface: which copies count, and whether faces of no height do.

    A wall that two solids share is a pair of opposite copies: both must stay for its edges to be even (their
    volumes cancel). A face of no height may bridge a T-junction: then it counts for the topology, though not as area.
    """
    one, both = masks
    fallback: tuple[Bools, Edges] | None = None
    for mask in (one, both) if (one != both).any() else (one,):
        for counted in (mask & high, mask) if (mask & ~high).any() else (mask,):
            table = edges(faces[counted])
            fallback = fallback or (mask, table)
            if dimension < 3 or not counted.any() or (table.faces % 2).any():
                continue
            if mask is both and abs(face_volumes(points, faces[counted]).sum()) <= _noise(points, faces[counted]):
                continue  # a sheet with two sides encloses nothing
            return mask, table, True
    assert fallback is not None
    return *fallback, False


def _noise(points: Floats, faces: Ints) -> float:
    return RELATIVE_TOLERANCE * float(face_areas(points, faces).sum() * np.linalg.norm(np.ptp(points, axis=0)))
