"""Contact filters: which bodies are not tested, and static pairs that MuJoCo would not test by itself."""

from __future__ import annotations

from collections.abc import Mapping

from ..pairs import PairTable
from .writer import Element, add, comment

# A constant pair of more geoms than this is tested by env2mjcf at load alone: MuJoCo tests every <pair> at each step.
_MAX_EXPLICIT_PAIRS = 256


def excluded_obstacles(table: PairTable) -> frozenset[str]:
    """Return the obstacles that some link must be excluded from, which therefore need bodies of their own."""
    return frozenset(p.other for p in table.excluded if p.kind == "obstacle")


def add_contacts(root: Element, table: PairTable, owners: Mapping[str, str]) -> None:
    """Append `<contact>` with an exclude for each untested pair of bodies and a pair for each constant one.

    MuJoCo's own parent filter is off, since it judges welded bodies and static bases otherwise than the planner.
    """
    geoms: dict[str, list[str]] = {}
    for geom, owner in owners.items():
        geoms.setdefault(owner, []).append(geom)
    contact = add(root, "contact")
    for pair in table.excluded:
        add(contact, "exclude", body1=pair.link, body2=pair.other)
    for pair in table.tested:
        if not pair.constant:
            continue
        mine, others = geoms.get(pair.link, []), geoms.get(pair.other, [])
        if len(mine) * len(others) > _MAX_EXPLICIT_PAIRS:
            comment(contact, [f"{pair.link} and {pair.other} cannot move: tested once when env2mjcf loads the scene"])
            continue
        for geom1 in mine:
            for geom2 in others:
                add(contact, "pair", geom1=geom1, geom2=geom2)
    if not len(contact):
        root.remove(contact)
