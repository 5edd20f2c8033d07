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
    numbers = {kind: i for i, kind in enumerate(kinds)}
    names = {kind: [f.name for f in dataclasses.fields(kind)] for kind in kinds}
    known_names = {id(thing): name for name, thing in known.items()}
    used = dict.fromkeys(_KINDS, 0)
    arrays: dict[str, list[NDArray[Any]]] = {k: [] for k in _KINDS}

    def encode(value: Any) -> Any:
        kind = type(value)
        if id(value) in known_names:
            return {"known": known_names[id(value)]}
        if kind in _PLAIN:
            return value
        if kind is tuple:
            return {"plain": value} if all(type(v) in _PLAIN for v in value) else [encode(v) for v in value]
        if kind is np.ndarray:
            letter = next((k for k, d in _KINDS.items() if value.dtype == d), None)
            if letter is None:
                raise TypeError(f"an array of {value.dtype} cannot be stored")
            start = used[letter]
            used[letter] += value.size
            arrays[letter].append(value.reshape(-1))
            return {"array": [letter, start, list(value.shape)]}
        if kind in numbers:
            return {"kind": numbers[kind], "fields": [encode(getattr(value, name)) for name in names[kind]]}
        raise TypeError(f"a {kind.__name__} cannot be stored")

    skeleton = json.dumps(encode(value), separators=(",", ":")).encode()
    flat = {k: np.concatenate([np.zeros(0, d), *arrays[k]]) for k, d in _KINDS.items()}
    return {"skeleton": np.frombuffer(skeleton, dtype=np.uint8), **flat}


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
