"""Configurations to be asked about: uniform in the space, and bisected onto contact."""

from __future__ import annotations

import numpy as np

import env2mjcf

# Between a random free and a random colliding configuration.
_FEWEST_HALVINGS, _MOST_HALVINGS = 4, 20
# So many free and colliding ones are drawn from, or as many as this number of uniform ones holds.
_ENDS, _MOST_DRAWN = 500, 400_000


def uniform_and_near(scene: env2mjcf.Scene, count: int, seed: int) -> tuple[np.ndarray, dict[str, slice]]:
    """Return configurations, and which of them are of which half; each half is in random order.

    A half is missing where the scene is never, or always, in collision.
    """
    near = near_contact(scene, count, seed + 1)
    rows = np.vstack([scene.space.sample(count, seed), near])
    halves = {"uniform": slice(0, count)}
    if len(near):
        halves["near"] = slice(count, count + len(near))
    return rows, halves


def near_contact(scene: env2mjcf.Scene, count: int, seed: int) -> np.ndarray:
    """Bisect between random free and random colliding configurations; return the last of one or the other kind.

    Which kind is for a coin to decide. There are 4 to 20 halvings, so that some are far from contact and some within
    the last digits of it.
    """
    free, colliding = _ends(scene, seed)
    if not len(free) or not len(colliding):
        return np.empty((0, scene.space.dim))
    rng = np.random.default_rng(seed)
    low, high = free[rng.integers(len(free), size=count)], colliding[rng.integers(len(colliding), size=count)]
    halvings = rng.integers(_FEWEST_HALVINGS, _MOST_HALVINGS + 1, size=count)
    for step in range(_MOST_HALVINGS):
        going = np.flatnonzero(halvings > step)
        middle = (low[going] + high[going]) / 2
        hits = scene.in_collision(middle, threads=1)
        high[going[hits]], low[going[~hits]] = middle[hits], middle[~hits]
    coin = rng.random(count) < 0.5
    return np.where(coin[:, None], low, high)


def _ends(scene: env2mjcf.Scene, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return free and colliding configurations, _ENDS of each where so many are found."""
    free, colliding = [np.empty((0, scene.space.dim))], [np.empty((0, scene.space.dim))]
    drawn, size = 0, 2 * _ENDS
    while drawn < _MOST_DRAWN and min(sum(map(len, free)), sum(map(len, colliding))) < _ENDS:
        q = scene.space.sample(size, seed + drawn)
        hits = scene.in_collision(q, threads=1)
        free.append(q[~hits])
        colliding.append(q[hits])
        drawn += size
        size = min(4 * size, _MOST_DRAWN - drawn)
    return np.vstack(free)[:_ENDS], np.vstack(colliding)[:_ENDS]
