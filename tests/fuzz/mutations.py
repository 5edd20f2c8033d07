"""Structure-aware mutations: words, numbers, lines and counts of a file change, not only its bytes."""

from __future__ import annotations

import io
import random
import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

_PIECE = re.compile(rb"[A-Za-z0-9_.+\-]+|[ \t]+|\r\n|[^A-Za-z0-9_.+\- \t]")
_NUMBER = re.compile(rb"[+-]?[0-9.]+(?:[eE][+-]?[0-9]+)?")

NUMBERS = [
    b"0", b"1", b"-1", b"2", b"3", b"1e9", b"2147483647", b"-2147483648", b"4294967296", b"9223372036854775807",
    b"9" * 30, b"9" * 400, b"1e308", b"-1e308", b"1e-308", b"5e-324", b"1e999", b"-0", b"nan", b"-inf", b"NaN", b"1,5",
    b"0x10", b"1.#INF", b"1_000", b"1e", b".", b"+", b"1d5", b"1e150", b"1e60", b"1e17", b"100000",
]  # fmt: skip
ODD = [
    b"\0", b"\xff", b"\xef\xbb\xbf", b"\xc3\xa9", b"\xd9\xa3", b"\r", b"\n", b"\x1b[2J", b"\xe2\x80\xae", b"#",
    b"//", b"<", b">", b"&lt;", b"&x;", b"<!--", b"]]>", b"\"", b"'", b"[", b"]", b";", b":", b"-c(", b"-a(", b")",
    b"# x\n", b"/", b"\\", b"../", b"..", b"\\\n",
]  # fmt: skip


def mutated(data: bytes, other: bytes, random_: random.Random) -> bytes:
    """Return a file with a few changes, some taken from another file."""
    pieces = _PIECE.findall(data) or [b" "]
    for _ in range(random_.choice((1, 1, 1, 2, 2, 3, 5, 8))):
        _change(pieces, other, random_)
        pieces = pieces or [b" "]
    return b"".join(pieces)


def _change(pieces: list[bytes], other: bytes, random_: random.Random) -> None:
    at = random_.randrange(len(pieces))
    kind = random_.randrange(11)
    if kind <= 2:  # another number where a number stands
        numbers = [i for i, p in enumerate(pieces) if _NUMBER.fullmatch(p)]
        # Counts stand in front.
        numbers = numbers[:12] if random_.random() < 0.4 else numbers
        if numbers:
            pieces[random_.choice(numbers)] = random_.choice(NUMBERS)
    elif kind == 3:
        del pieces[at : at + random_.choice((1, 2, 3, 20))]
    elif kind == 4:
        pieces[at:at] = pieces[at : at + random_.choice((1, 4, 30, 200))]
    elif kind == 5:
        with_ = random_.randrange(len(pieces))
        pieces[at], pieces[with_] = pieces[with_], pieces[at]
    elif kind == 6:
        pieces[at] = random_.choice(NUMBERS)
    elif kind == 7:
        pieces.insert(at, random_.choice(ODD))
    elif kind == 8:
        foreign = _PIECE.findall(other) or [b" "]
        start = random_.randrange(len(foreign))
        pieces[at:at] = foreign[start : start + random_.choice((1, 5, 40))]
    elif kind == 9:
        del pieces[at:]
    else:
        piece = bytearray(pieces[at])
        piece[random_.randrange(len(piece))] = random_.randrange(256)
        pieces[at] = bytes(piece)


def seeds(patterns: Iterable[str], folders: Iterable[Path]) -> list[bytes]:
    """Return small files of our own making, and those of folders that are small enough to be changed in many places."""
    files = {path for folder in folders for pattern in patterns for path in folder.rglob(pattern) if path.is_file()}
    found = sorted((path.read_bytes() for path in files), key=lambda data: (len(data), data))
    made = [data for pattern in patterns for data in _MADE.get(pattern, [])]
    return [*made, *(data for data in found if len(data) < 60_000)] or found[:1] or [b"1 2 3\n"]


def _array(values: object) -> bytes:
    file = io.BytesIO()
    np.save(file, np.array(values), allow_pickle=False)
    return file.getvalue()


_MADE = {
    "*.npy": [_array([[0.0] * 6] * 3), _array([[1, 2, 3, 4, 5, 6]]), _array([[True] * 6]), _array(["a"])],
    "*.dat": [b"4\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n4\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"],
    "*.obj": [b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1/1 2/2 4/3\nf -4 -1 -2\nf 2//1 3//1 4//1\n"],
    "*.path": [
        b"VIZMO_PATH_FILE   Path Version 2012\n1\n2\n0 0 0 0 0 0 0\n0 1 0 0 0 0 0.5\n",
        b"VIZMO_PATH_FILE   Path Version 20001022\n4\n1\n0 0 0 0 0 0\n1 0 0 0 0 0\n2 0 0 0 0 0\n3 0 0 0 0 0\n",
    ],
    "*.map": [
        b"#####ENVFILESTART#####\na.env\n#####ENVFILESTOP#####\n#####GRAPHSTART#####\n2 2 2\n"
        b"0 0 0 0 0 0 0 0 1 1 0 1.0\n1 0 1 0 0 0 0 0 1 0 1 0 1 1 1 0 0 0 2.0\n#####GRAPHSTOP#####\n",
    ],
}  # fmt: skip
