"""MJCF as text: written the same on every run, and known again after somebody has edited it."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable
from contextlib import suppress
from typing import Any

import numpy as np
from lxml import etree
from numpy.typing import ArrayLike

from ..formats.source import wide_encoding
from ..transforms import Array

ASSET_FOLDER = "assets"
"""Folder, beside an MJCF file, of the files that it refers to."""

Element = Any  # lxml's classes have no public names

# Without going back, which would take for ever in a file of many comments.
_MJCF = re.compile(r"(?>\s+|<\?.*?\?>|<!--.*?-->|<!DOCTYPE[^<>]*>)*+<mujoco(?=[\s/>])", re.DOTALL)
_ENDINGS = (".stl", ".obj", ".xml", ".mjcf", ".urdf")
_FILE = re.compile(r"""(?<![^\s"'<>=])[^\s"'<>=]+\.(?:stl|obj|xml|mjcf|urdf)""", re.IGNORECASE)


def number(value: float) -> str:
    """Return the shortest text that reads back as the same double; no trailing `.0`, no negative zero."""
    text = repr(float(value) + 0.0)
    return text[:-2] if text.endswith(".0") else text


def numbers(values: ArrayLike) -> str:
    """Return blank-separated numbers of an array in C order."""
    return " ".join(number(v) for v in np.asarray(values, dtype=np.float64).reshape(-1))


def tidy(values: ArrayLike) -> Array:
    """Return values with rounding noise set to zero: what is below 1e-15 of one, or of the largest of them."""
    array = np.asarray(values, dtype=np.float64)
    return np.where(np.abs(array) < 1e-15 * max(1.0, float(np.max(np.abs(array), initial=0.0))), 0.0, array)


def plain(text: str) -> str:
    """Return text with what cannot stand in XML (control characters, undecodable bytes) as question marks."""
    return "".join(c if c.isprintable() else "?" for c in text)


def add(parent: Element, tag: str, **attributes: str | None) -> Element:
    """Append an element; attributes that are None are left out, a trailing `_` of a name is dropped (`class_`)."""
    element = etree.SubElement(parent, tag)
    for name, value in attributes.items():
        if value is not None:
            element.set(name.rstrip("_"), value)
    return element


def comment(parent: Element, lines: Iterable[str]) -> None:
    """Append a comment."""
    parent.append(etree.Comment(comment_text(lines, "  ")))


def comment_text(lines: Iterable[str], indent: str = "") -> str:
    """Return the text of a comment; `--` and control characters cannot stand in one."""
    lines = [re.sub("-(?=-)", "- ", plain(line)) for line in lines]
    if len(lines) == 1:
        return f" {lines[0]} "
    return "\n" + "".join(f"{indent}  {line}\n" for line in lines) + indent


def to_text(root: Element) -> str:
    """Return the whole document, with a final newline: two-space indent, attributes in the order given."""
    etree.indent(root, space="  ")
    return etree.tostring(root, encoding="unicode") + "\n"


def is_mjcf(data: bytes) -> bool:
    """Return whether a text is MJCF, whatever its encoding, and whatever comments stand above it."""
    return _MJCF.match(_decoded(data)) is not None


def files_mentioned(data: bytes) -> set[str]:
    """Return what looks like the name of a file in a text in MJCF: values of attributes, and words anywhere.

    A comment may keep a line for later, and MuJoCo reads texts that are not well-formed.
    """
    names = set(_FILE.findall(html.unescape(_decoded(data))))
    with suppress(etree.XMLSyntaxError):
        root: Element = etree.fromstring(data, etree.XMLParser(resolve_entities=False, no_network=True))
        values = (value for element in root.iter(etree.Element) for value in element.attrib.values())
        names.update(value for value in values if value.lower().endswith(_ENDINGS))
    return names


def _decoded(data: bytes) -> str:
    wide = wide_encoding(data)
    little = data[:1] != b"\0" and not data.startswith(b"\xfe")
    return data.decode(f"{wide}-{'le' if little else 'be'}" if wide else "utf-8", "replace").lstrip("\ufeff")
