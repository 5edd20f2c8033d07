"""What many contacts at once need: memory, and time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..diagnostics import DiagnosticLog
from ..geometry.assembly import Assembly
from ..pairs import PairTable

LEAST_MEMORY, MOST_MEMORY = 8 << 20, 2 << 30
"""Bytes of contacts and their forces: up to these MuJoCo's own choice of memory will do, and beyond those none is asked
for. Memory is not used, only reserved, until something touches."""

# Measured on shells in one place: contacts of two cells, and of the cells of one body with another body.
_CONTACTS_OF_CELLS, _CONTACTS_OF_SHELLS = 8, 40

# Measured on the corpus: bodies of a and b cells that are pressed into each other at random have up to so many times
# the root of a b contacts, and MuJoCo takes so many seconds for each, four fifths of them to find it.
_CONTACTS_AT_RANDOM, _SECONDS_OF_CONTACT = 3, 3e-6

# Degrees of freedom from which on MuJoCo's matrices are sparse.
_SPARSE = 60

_QUICKER = (
    "fewer pieces: collision='coacd' (--collision coacd), approximately; "
    "fewer pairs: exclude_pairs, inter_robot=False, self_collision=False; queries are quick all the same"
)


def possible_contacts(assembly: Assembly, pairs: PairTable) -> NDArray[np.int64]:
    """Return how many contacts each tested pair of bodies can have in MuJoCo, about and at most, (npairs,)."""
    a, b = _pieces(assembly, pairs).T
    return np.minimum(_CONTACTS_OF_CELLS * a * b, _CONTACTS_OF_SHELLS * np.maximum(a, b))


def _pieces(assembly: Assembly, pairs: PairTable) -> NDArray[np.int64]:
    """Return of how many pieces both bodies of each tested pair are, (npairs, 2); a box for a body is one, too."""
    pieces = {p.name: len(p.shape.pieces) if p.shape else 0 for p in assembly.parts()}
    return np.array([(pieces[p.link], pieces[p.other]) for p in pairs.tested], dtype=np.int64).reshape(-1, 2)


def memory(assembly: Assembly, pairs: PairTable) -> int:
    """Return how many bytes MuJoCo needs for the contacts that a scene can have; 0 where its own choice will do."""
    needed = contact_memory(assembly, pairs)
    if needed <= LEAST_MEMORY:
        return 0
    # What MuJoCo would choose, at most: its solver needs room, too.
    total = sum(r.kinematics.dim for r in assembly.robots)
    chosen = (16 << 20) + 36_000 * total + 72 * total * total
    return 0 if chosen > MOST_MEMORY else min(1 << (chosen + needed - 1).bit_length(), MOST_MEMORY)


def contact_memory(assembly: Assembly, pairs: PairTable) -> int:
    """Return how many bytes all contacts take that a scene can have, about and at most.

    A contact has 0.6 kB, and four rows of forces. Measured with its share of the solver's memory, a row has 0.3 kB, and
    28 bytes for each degree of freedom of the scene; from 60 of those on, where MuJoCo's matrices are sparse, 63 bytes
    for each that the contact acts on.
    """
    motions = {n: r.kinematics.dim for r in assembly.robots for n in r.names}
    total = sum(r.kinematics.dim for r in assembly.robots)
    moved = [motions[p.link] + (motions[p.other] if p.kind == "robot" else 0) for p in pairs.tested]
    row = 300 + (28 * total if total < _SPARSE else 63 * np.array(moved, dtype=np.int64))
    return int((possible_contacts(assembly, pairs) * (624 + 4 * row)).sum())


def report_contacts(assembly: Assembly, pairs: PairTable, step: float, looks: int, log: DiagnosticLog) -> None:
    """Report the two bodies that can have most contacts, where MuJoCo is then slower than real time, and scenes whose
    contacts may be more than it is given memory for.

    Args:
        assembly: The scene.
        pairs: Which bodies are tested.
        step: Time step, seconds.
        looks: How often the integrator finds all contacts in a step.
        log: Where to.
    """
    name = assembly.environment.name
    possible = possible_contacts(assembly, pairs)
    if not len(possible):
        return
    both = _pieces(assembly, pairs)
    at_random = np.minimum(_CONTACTS_AT_RANDOM * np.sqrt(both.prod(axis=1)), possible)
    worst = int(np.argmax(at_random))
    seconds = looks * _SECONDS_OF_CONTACT * at_random
    slow = int((seconds > step).sum())
    if slow:
        pair = pairs.tested[worst]
        more = f"; so it is with {slow - 1} more pairs" if slow > 1 else ""
        message = (
            f"{pair.link} and {pair.other}, {both[worst, 0]} and {both[worst, 1]} convex pieces, can have "
            f"{_round(at_random[worst])} contacts when pressed into each other, and {_round(possible[worst])} in one "
            f"place: about {_round(1000 * seconds[worst])} ms for MuJoCo's step of {1000 * step:g} ms{more}"
        )
        log.info("MJC419", name, message, hint=_QUICKER)
    needed = contact_memory(assembly, pairs)
    if needed > MOST_MEMORY:
        message = (
            f"if all bodies that may touch do so at once, MuJoCo needs {needed / 2**30:.2g} GiB for the contacts, and "
            f"gets {MOST_MEMORY / 2**30:g}: it warns where that is full, and contacts do not act"
        )
        log.info("MJC419", name, message, hint=f"{_QUICKER}, or raise <size memory=...> in the MJCF")


def _round(value: float) -> str:
    """Write an estimate with two digits."""
    return f"{float(f'{value:.2g}'):,g}"
