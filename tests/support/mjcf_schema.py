"""Checks that every element and attribute of an MJCF text is one that MuJoCo's own schema lists."""

from __future__ import annotations

from functools import cache

import mujoco
from lxml import etree

_INDENT, _ATTRIBUTES_FROM = 3, 30
_BODY = ("mujoco", "(world)body")
# A frame is a meta-element, which the printed schema leaves out (XMLreference, "frame").
_FRAME = (*_BODY, "frame")


@cache
def schema() -> dict[tuple[str, ...], set[str]]:
    """Parse `mj_printSchema` into the attributes of each path of elements."""
    table: dict[tuple[str, ...], set[str]] = {}
    path: list[str] = []
    for line in mujoco.mj_printSchema(False, True).splitlines():
        head, attributes = line[:_ATTRIBUTES_FROM], line[_ATTRIBUTES_FROM:].split()
        if head.strip():
            depth = (len(head) - len(head.lstrip())) // _INDENT
            path = [*path[:depth], head.split()[0]]
            table[tuple(path)] = set()
        if path:
            table[tuple(path)] |= set(attributes)
    table[_FRAME] = {"name", "childclass", "pos", "quat"}
    return table


def assert_known_to_mujoco(xml: str) -> None:
    """Fail on an element or attribute that the schema does not list."""
    table = schema()
    assert ("mujoco", "option") in table
    assert "timestep" in table["mujoco", "option"]

    def visit(element: etree._Element, path: tuple[str, ...]) -> None:
        assert path in table, f"unknown element {'/'.join(path)}"
        unknown = set(element.attrib) - table[path]
        assert not unknown, f"unknown attributes of {'/'.join(path)}: {unknown}"
        for child in element:
            if isinstance(child.tag, str) and child.tag != "include":
                visit(child, _below(path, child.tag))

    visit(etree.fromstring(xml.encode()), ("mujoco",))


def _below(path: tuple[str, ...], tag: str) -> tuple[str, ...]:
    """Bodies and defaults nest in themselves: the schema lists each once."""
    if tag in ("body", "worldbody"):
        return _BODY
    if tag == "frame":
        return _FRAME
    if path == _FRAME:
        return (*_BODY, tag)
    if path[-1] == tag == "default":
        return path
    return (*path, tag)
