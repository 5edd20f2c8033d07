"""Nested frozen dataclasses as one JSON text and a few flat arrays, and back: without pickle, so no code is in it."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

_KINDS = {"f": np.float64, "i": np.int64, "b": np.bool_}
_PLAIN = (bool, int, float, str, type(None))


def pack(value: object, kinds: Sequence[type], known: Mapping[str, object]) -> dict[str, NDArray[Any]]:
    """Flatten a value.

    Args:
        value: Plain values, tuples, arrays of float64, int64 and bool, and dataclasses made of these.
        kinds: The dataclasses that may occur.
        known: Objects that are not stored: the reader has them, under the same names.

    Returns:
        Arrays by name, in a form that `unpack` reads.

    Raises:
        TypeError: Something else occurs.
    """
    packer = _Packer(kinds, known)
    skeleton = json.dumps(packer.encode(value), separators=(",", ":")).encode()
    arrays = {k: np.concatenate([np.zeros(0, d), *packer.arrays[k]]) for k, d in _KINDS.items()}
    return {"skeleton": np.frombuffer(skeleton, dtype=np.uint8), **arrays}


def unpack(arrays: Mapping[str, NDArray[Any]], kinds: Sequence[type], known: Mapping[str, object]) -> Any:
    """Build what `pack` flattened; its arrays are read-only.

    Raises:
        KeyError, IndexError, TypeError, ValueError: The arrays are not what `pack` wrote.
    """
    flat = {k: arrays[k] for k in _KINDS}
    for array in flat.values():
        array.setflags(write=False)

    def decode(value: Any) -> Any:
        if type(value) is list:
            return tuple(decode(v) for v in value)
        if type(value) is not dict:
            return value
        if "array" in value:
            letter, start, shape = value["array"]
            return flat[letter][start : start + prod(shape)].reshape(shape)
        if "plain" in value:
            return tuple(value["plain"])
        if "known" in value:
            return known[value["known"]]
        return kinds[value["kind"]](*[decode(v) for v in value["fields"]])

    return decode(json.loads(arrays["skeleton"].tobytes()))


class _Packer:
    def __init__(self, kinds: Sequence[type], known: Mapping[str, object]) -> None:
        self._kinds = {kind: i for i, kind in enumerate(kinds)}
        self._fields = {kind: [f.name for f in dataclasses.fields(kind)] for kind in kinds}
        self._known = {id(thing): name for name, thing in known.items()}
        self._used = dict.fromkeys(_KINDS, 0)
        self.arrays: dict[str, list[NDArray[Any]]] = {k: [] for k in _KINDS}

    def encode(self, value: Any) -> Any:
        if id(value) in self._known:
            return {"known": self._known[id(value)]}
        kind = type(value)
        if kind in _PLAIN:
            return value
        if kind is tuple:
            if all(type(v) in _PLAIN for v in value):
                return {"plain": value}
            return [self.encode(v) for v in value]
        if kind is np.ndarray:
            return {"array": self._array(value)}
        if kind in self._kinds:
            return {"kind": self._kinds[kind], "fields": [self.encode(getattr(value, f)) for f in self._fields[kind]]}
        raise TypeError(f"a {kind.__name__} cannot be stored")

    def _array(self, array: NDArray[Any]) -> list[Any]:
        letter = next((k for k, d in _KINDS.items() if array.dtype == d), None)
        if letter is None:
            raise TypeError(f"an array of {array.dtype} cannot be stored")
        start = self._used[letter]
        self._used[letter] += array.size
        self.arrays[letter].append(array.reshape(-1))
        return [letter, start, list(array.shape)]
