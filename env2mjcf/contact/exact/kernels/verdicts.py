"""Verdicts of many configurations: the compiled code that Python calls."""

from __future__ import annotations

from typing import Any

import numpy as np

from .boxes import lanes_about
from .compiling import compiled, entry
from .frames import place
from .opening import Tables, opened
from .touching import touch

_LANES = 8


@compiled
def collides(tables: Tables, frames: Any, spans: Any, stack: Any) -> bool:
    """Return whether any tested pair touches, with the robots placed in frames, (s, 12)."""
    _measure(tables, frames, spans)
    own = stack[tables.scalars[0, 0] :]
    for link in range(len(tables.links)):
        if tables.links[link, 2] >= 0 and _meets_obstacle(tables, link, frames, spans, stack):
            return True
    for i in range(len(tables.pairs)):
        a, b = tables.pairs[i, 0], tables.pairs[i, 1]
        p, q = frames[tables.links[a, 0]], frames[tables.links[b, 0]]
        if (
            abs(p[3] - q[3]) <= spans[a, 0] + spans[b, 0]
            and abs(p[7] - q[7]) <= spans[a, 1] + spans[b, 1]
            and abs(p[11] - q[11]) <= spans[a, 2] + spans[b, 2]
            and touch(tables, tables.links[a, 1], p, tables.links[b, 1], q, own)
        ):
            return True
    return False


@compiled
def _measure(tables: Tables, frames: Any, spans: Any) -> None:
    """Fill spans, (l, 3), with half the size of each link's box along the world's axes."""
    for link in range(len(tables.links)):
        pose, half = frames[tables.links[link, 0]], tables.halves[tables.links[link, 1]]
        for k in range(3):
            spans[link, k] = (
                abs(pose[4 * k]) * half[0] + abs(pose[4 * k + 1]) * half[1] + abs(pose[4 * k + 2]) * half[2]
            )


@compiled
def _meets_obstacle(tables: Tables, link: int, frames: Any, spans: Any, stack: Any) -> bool:
    pose, shape = frames[tables.links[link, 0]], tables.links[link, 1]
    own = stack[tables.scalars[0, 0] :]
    stack[0] = tables.links[link, 2]
    count = 1
    while count > 0:
        count -= 1
        node = stack[count]
        lanes = lanes_about(
            tables.top_boxes[node], pose[3], pose[7], pose[11], spans[link, 0], spans[link, 1], spans[link, 2]
        )
        children = tables.top_children[node]
        for k in range(_LANES):
            if lanes >> k & 1:
                child = children[k]
                if child >= 0:
                    stack[count] = child
                    count += 1
                elif touch(tables, shape, pose, tables.obstacles[~child, 0], tables.poses[~child], own):
                    return True
    return False


@entry
def verdicts(integers: Any, floats: Any, q: Any, sines: Any, cosines: Any, out: Any) -> None:
    """Fill out, (n,) bool, with whether anything touches at configurations, (n, dim)."""
    tables = opened(integers, floats)
    frames = np.empty((len(tables.steps), 12))
    spans = np.empty((len(tables.links), 3))
    stack = np.empty(tables.scalars[0, 0] + tables.scalars[0, 1], dtype=np.int64)
    for i in range(len(q)):
        place(tables, q[i], sines[i], cosines[i], frames)
        out[i] = collides(tables, frames, spans, stack)
