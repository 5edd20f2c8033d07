"""Bounding boxes over triangles, in trees: what lets a distance query look at few of them.

The trees of all meshes of a scene lie one after another in flat arrays, so that one query can walk down many pairs of
trees at once, and so that another engine can read them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .topology import Floats, Ints


@dataclass(frozen=True, slots=True, eq=False)
class Forest:
    """Trees with up to four children a node and one triangle a leaf.

    Attributes:
        triangles: (m, 3, 3) corners of all triangles, each in the frame of its mesh.
        roots: (t,) root node of each tree.
        center: (k, 3) centre of each node's box.
        frame: (k, 3, 3) the axes of the box, as columns.
        half: (k, 3) its half sizes along them.
        point: (k, 3) a point on some triangle of each node.
        first: (k,) first child; the children of a node follow each other.
        children: (k,) how many; 0 for a leaf.
        triangle: (k,) row of a leaf's triangle; of inner nodes, that of `point`.
    """

    triangles: Floats
    roots: Ints
    center: Floats
    frame: Floats
    half: Floats
    point: Floats
    first: Ints
    children: Ints
    triangle: Ints


def forest(meshes: Sequence[Floats]) -> Forest:
    """Build one tree for each array of triangles, (m, 3, 3) with m > 0."""
    trees = [_tree(triangles) for triangles in meshes]
    nodes = np.cumsum([0, *(len(t.first) for t in trees)])
    faces = np.cumsum([0, *(len(t.triangles) for t in trees)])
    vectors, none = np.zeros((0, 3)), np.zeros(0, dtype=np.int64)
    return Forest(
        triangles=np.concatenate([np.zeros((0, 3, 3)), *(t.triangles for t in trees)]),
        roots=nodes[:-1].astype(np.int64),
        center=np.concatenate([vectors, *(t.center for t in trees)]),
        frame=np.concatenate([np.zeros((0, 3, 3)), *(t.frame for t in trees)]),
        half=np.concatenate([vectors, *(t.half for t in trees)]),
        point=np.concatenate([vectors, *(t.point for t in trees)]),
        first=np.concatenate([none, *(t.first + n for t, n in zip(trees, nodes, strict=False))]),
        children=np.concatenate([none, *(t.children for t in trees)]),
        triangle=np.concatenate([none, *(t.triangle + n for t, n in zip(trees, faces, strict=False))]),
    )


def _tree(triangles: Floats) -> Forest:
    """Build one tree from the top, all nodes of a depth at once, each halved twice across its longest side."""
    middle = (triangles.min(axis=1) + triangles.max(axis=1)) / 2
    order, count = np.arange(len(triangles)), np.array([len(triangles)])
    node = np.zeros(1, dtype=np.int64)
    starts, counts = [np.zeros(1, dtype=np.int64)], [count]
    first, children = np.zeros((2, 2 * len(triangles)), dtype=np.int64)
    made = 1
    while (count > 1).any():
        order, halves, of_half = _halved(order, count, middle)
        order, count, parent = _halved(order, halves, middle)
        parent = of_half[parent]
        family = np.bincount(parent)
        new = family[parent] > 1
        ids = np.where(new, made + np.cumsum(new) - 1, node[parent])
        eldest = np.cumsum(family) - family
        split = family > 1
        first[node[split]], children[node[split]] = ids[eldest[split]], family[split]
        starts.append((np.cumsum(count) - count)[new])
        counts.append(count[new])
        made, node = made + int(new.sum()), ids
    start, size = np.concatenate(starts), np.concatenate(counts)
    center, frame, half = _boxes(triangles[order], start, size)
    triangle = order[start + size // 2]
    return Forest(
        triangles=triangles,
        roots=np.zeros(1, dtype=np.int64),
        center=center,
        frame=frame,
        half=half,
        point=triangles[triangle].mean(axis=1),
        first=first[:made],
        children=children[:made],
        triangle=triangle,
    )


def _boxes(triangles: Floats, start: Ints, size: Ints) -> tuple[Floats, Floats, Floats]:
    """Return centre, axes and half sizes of a box around each run of triangles, (k, 3), (k, 3, 3), (k, 3).

    The axes are principal ones of the corners (Gottschalk et al., OBBTree, SIGGRAPH 1996), or the mesh's own where
    those give a smaller surface.
    """
    each = np.repeat(start - np.cumsum(size) + size, size) + np.arange(int(size.sum()))
    corners, run = triangles[each], np.cumsum(size) - size
    node = np.repeat(np.arange(len(size)), size)
    mean = np.add.reduceat(corners.sum(axis=1), run) / (3 * size[:, None])
    apart = corners - mean[node][:, None]
    spread = np.add.reduceat(apart.transpose(0, 2, 1) @ apart, run)
    best: tuple[Floats, Floats, Floats] | None = None
    for axes in (np.broadcast_to(np.eye(3), spread.shape), np.linalg.eigh(spread)[1]):
        along = apart @ axes[node]
        low = np.minimum.reduceat(along.min(axis=1), run)
        high = np.maximum.reduceat(along.max(axis=1), run)
        center, half = mean + (axes @ ((low + high) / 2)[..., None])[..., 0], (high - low) / 2
        if best is None:
            best = center, axes, half
        better = (_surface(half) < _surface(best[2]))[:, None]
        center, half = np.where(better, center, best[0]), np.where(better, half, best[2])
        best = center, np.where(better[..., None], axes, best[1]), half
    assert best is not None
    return best


def _surface(half: Floats) -> Floats:
    return (half * np.roll(half, 1, axis=1)).sum(axis=1)


def _halved(order: Ints, count: Ints, middle: Floats) -> tuple[Ints, Ints, Ints]:
    """Sort each run of `count` triangles along its longest side and halve it.

    Returns:
        The new order, the sizes of the halves (no empty ones), and which run each came from.
    """
    run = np.repeat(np.arange(len(count)), count)
    points, start = middle[order], np.cumsum(count) - count
    spread = np.maximum.reduceat(points, start) - np.minimum.reduceat(points, start)
    key = points[np.arange(len(order)), np.argmax(spread, axis=1)[run]]
    order = order[np.lexsort((key, run))]
    halves = np.stack([(count + 1) // 2, count // 2], axis=1).ravel()
    kept = halves > 0
    return order, halves[kept], np.repeat(np.arange(len(count)), 2)[kept]
