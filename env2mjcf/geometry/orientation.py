"""Which side of a closed surface is outside."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..limits import Work
from .topology import Bools, Edges, Floats, Ints, by_component, connected

_BLOCK = 2_000_000  # solid angles held in memory at once
_PROBES = 8  # faces of a surface that are looked at until one is clearly inside or outside of another


def wound_alike(table: Edges, component: Ints, count: int) -> Bools:
    """Tell of which components each edge is walked as often one way as the other, but for an odd face, (count,)."""
    out = np.ones(count, dtype=np.bool_)
    wrong = np.abs(table.balance) > table.faces % 2
    out[component[wrong[table.of_corner].any(axis=1)]] = False
    return out


def disagreeing(table: Edges, component: Ints, count: int) -> tuple[Bools, Bools]:
    """Find the faces to turn round so that neighbours agree.

    In each patch the winding of the majority wins.

    Returns:
        Which faces, (m,), and in which components all edges agree then, (count,).
    """
    here, there, edge = table.neighbours()
    pair = table.faces[edge] == 2
    a, b, differ = here[pair] // 3, there[pair] // 3, table.balance[edge[pair]] != 0
    a, b, differ = np.concatenate([a, b]), np.concatenate([b, a]), np.concatenate([differ, differ])
    patch = connected(len(table.of_corner), a, b)
    turned, known = np.zeros((2, len(table.of_corner)), dtype=np.bool_)
    known[np.unique(patch, return_index=True)[1]] = True
    while (step := known[a] & ~known[b]).any():
        turned[b[step]] = turned[a[step]] ^ differ[step]
        known[b[step]] = True
    minority = np.bincount(patch, turned) * 2 <= np.bincount(patch)
    turned = turned == minority[patch]
    return turned, wound_alike(table.turned(turned), component, count)


def winding_numbers(points: Floats, vertices: Floats, faces: Ints, work: Work | None = None) -> Floats:
    """Return how often the surface winds around each point, (k,): 0 outside, 1 inside, in between if it is open.

    Sums signed solid angles (van Oosterom and Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomed.
    Eng. 30(2), 1983).

    Raises:
        TooMuchWorkError: Points and faces make more pairs than `work` has left.
    """
    if work is not None:
        work.spend(len(points) * len(faces))
    out = np.empty(len(points))
    step = max(1, _BLOCK // max(1, len(faces)))
    for i in range(0, len(points), step):
        a, b, c = (vertices[faces[:, k]] - points[i : i + step, None] for k in range(3))
        la, lb, lc = (np.linalg.norm(x, axis=2) for x in (a, b, c))
        top = np.einsum("kmi,kmi->km", a, np.cross(b, c))
        bottom = la * lb * lc
        for x, y, lz in ((a, b, lc), (b, c, la), (c, a, lb)):
            bottom += np.einsum("kmi,kmi->km", x, y) * lz
        out[i : i + step] = np.arctan2(top, bottom).sum(axis=1) / (2 * np.pi)
    return out


def encloses(vertices: Floats, faces: Ints, points: Floats, work: Work | None = None) -> Bools:
    """Tell which points (k, 3) the surface winds around, (k,); see `winding_numbers`."""
    return np.abs(winding_numbers(points, vertices, faces, work)) > 0.5


def encloses_any(vertices: Floats, faces: Ints, points: Floats) -> Bools:
    """Tell for each row of points (n, c, 3) whether the surface winds around one of them, (n,)."""
    near = ((points > vertices.min(axis=0)) & (points < vertices.max(axis=0))).all(axis=-1)
    inside = np.zeros(near.shape, dtype=np.bool_)
    inside[near] = encloses(vertices, faces, points[near])
    return np.asarray(inside.any(axis=-1))


def inside_out(vertices: Floats, faces: Ints, component: Ints, volumes: Floats, work: Work) -> Bools:
    """Tell which components of a closed, consistently wound surface are wound inside out, (c,).

    A component of negative volume is a cavity where others fill what is around it. Elsewhere it is inside out, and
    everything in it was wound by the same hand.

    Args:
        vertices: (n, 3).
        faces: (m, 3).
        component: (m,) component of each face.
        volumes: (c,) signed volume of each component.
        work: What may be done.
    """
    flipped = np.zeros(len(volumes), dtype=np.bool_)
    if not (volumes < 0).any() or len(volumes) == 1:
        return volumes < 0
    groups = by_component(faces, component)
    low = np.array([vertices[g.ravel()].min(axis=0) for g in groups])
    high = np.array([vertices[g.ravel()].max(axis=0) for g in groups])
    # What is around a component is larger, so that it has been decided before.
    for i in np.argsort(-np.abs(volumes), kind="stable"):
        if (volumes[i] < 0) == flipped[i]:
            continue
        work.spend(len(groups))
        around = np.flatnonzero((low <= low[i]).all(axis=1) & (high >= high[i]).all(axis=1))
        around = around[[bool(j != i and _within(vertices, groups[j], groups[i : i + 1], work)[0]) for j in around]]
        if np.where((volumes[around] < 0) == flipped[around], 1, -1).sum() > 0:
            continue
        within = np.flatnonzero((low >= low[i]).all(axis=1) & (high <= high[i]).all(axis=1))
        within = within[_within(vertices, groups[i], [groups[j] for j in within], work) & (within != i)]
        flipped[within] ^= True
        flipped[i] ^= True
    return flipped


def _within(vertices: Floats, outer: Ints, inner: Sequence[Ints], work: Work) -> Bools:
    """Tell which surfaces a closed one winds around, given that they do not cross, (len(inner),)."""
    out = np.zeros(len(inner), dtype=np.bool_)
    unsure = np.arange(len(inner))
    for nth in range(_PROBES):
        # The middle of a face stays clear of edges that surfaces may share; of two that share a wall, it may lie in it.
        probes = np.array([vertices[inner[i][nth * len(inner[i]) // _PROBES]].mean(axis=0) for i in unsure.tolist()])
        around = np.abs(winding_numbers(probes.reshape(-1, 3), vertices, outer, work))
        out[unsure] = around > 0.5
        unsure = unsure[np.abs(around - 0.5) < 0.25]
        if not len(unsure):
            break
    return out
