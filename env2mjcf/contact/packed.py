"""Contacts of many configurations as arrays, because a million small objects are slow to make and to send."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..options import Engine
from ..transforms import Array
from .queries import ContactQueries
from .types import PackedContacts


def packed(queries: ContactQueries, rows: Array, engine: Engine | None = None) -> PackedContacts:
    """Return the contacts of configurations (n, dim)."""
    each = [queries.contacts(row, engine) for row in rows]
    found = [c for contacts in each for c in contacts]
    return PackedContacts(
        np.cumsum([0, *(len(contacts) for contacts in each)], dtype=np.int64),
        np.array([queries.pair_index(c) for c in found], dtype=np.int64),
        _vectors([c.position for c in found]),
        _vectors([c.normal for c in found]),
        np.array([c.distance for c in found], dtype=np.float64),
    )


def joined(parts: Sequence[PackedContacts]) -> PackedContacts:
    """Put the contacts of consecutive chunks together."""
    if not parts:
        return PackedContacts(np.zeros(1, np.int64), np.zeros(0, np.int64), _vectors([]), _vectors([]), np.zeros(0))
    counts = np.concatenate([np.diff(p.offsets) for p in parts])
    return PackedContacts(
        np.concatenate([np.zeros(1, np.int64), np.cumsum(counts)]),
        np.concatenate([p.pair for p in parts]),
        np.concatenate([p.position for p in parts]),
        np.concatenate([p.normal for p in parts]),
        np.concatenate([p.distance for p in parts]),
    )


def _vectors(rows: list[Array]) -> Array:
    return np.array(rows, dtype=np.float64).reshape(-1, 3)
