"""The boundary of a scene: wires to look at, or walls."""

from __future__ import annotations

import itertools
import math

import numpy as np

from ..geometry.assembly import Assembly
from ..model import Boundary
from ..transforms import Array
from .writer import Element, add, number, numbers

_WIRE_COLOR = "0.35 0.38 0.42 0.6"


def _corners(boundary: Boundary, assembly: Assembly) -> tuple[Array, Array]:
    """Return the corners of a box; an unbounded axis is drawn as far as the bodies reach."""
    lower, upper = assembly.lower.copy(), assembly.upper.copy()
    lower[: len(boundary.lower)] = boundary.lower
    upper[: len(boundary.upper)] = boundary.upper
    return lower, upper


def boundary_lines(boundary: Boundary, assembly: Assembly) -> list[tuple[Array, Array]]:
    """Return the edges of a box, or rings around a ball, as pairs of points, (3,) each, in metres."""
    if not boundary.lower:
        return _rings(boundary)
    box = np.array(_corners(boundary, assembly))
    corners = [box[list(c), range(3)] for c in itertools.product((0, 1), repeat=3)]
    return [(a, b) for a, b in itertools.combinations(corners, 2) if np.count_nonzero(a != b) == 1]


def add_wires(world: Element, boundary: Boundary, assembly: Assembly) -> None:
    """Append a boundary to look at."""
    lines = boundary_lines(boundary, assembly)
    radius = 5e-4 * max(assembly.extent, *(float(np.linalg.norm(b - a)) for a, b in lines))
    for i, (a, b) in enumerate(lines):
        add(
            world, "geom", name=f"boundary:{i}", class_="visual", type="capsule",
            fromto=numbers((a, b)), size=number(radius), rgba=_WIRE_COLOR,
        )  # fmt: skip


def _rings(boundary: Boundary, segments: int = 48) -> list[tuple[Array, Array]]:
    """Three great circles of a ball, one for a disc."""
    center = np.zeros(3)
    center[: len(boundary.center)] = boundary.center
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    planes = [(0, 1)] if len(boundary.center) == 2 else [(0, 1), (1, 2), (2, 0)]
    lines: list[tuple[Array, Array]] = []
    for i, j in planes:
        points = np.tile(center, (len(angle), 1))
        points[:, i] += boundary.radius * np.cos(angle)
        points[:, j] += boundary.radius * np.sin(angle)
        lines += list(itertools.pairwise(points))
    return lines


def add_walls(world: Element, boundary: Boundary, assembly: Assembly) -> None:
    """Planes that face inwards: a box exactly, a ball by planes that touch it."""
    planes: list[tuple[Array, Array]] = []
    if boundary.lower:
        for axis in range(len(boundary.lower)):
            for sign, bound in ((1.0, boundary.lower), (-1.0, boundary.upper)):
                normal, point = np.zeros(3), (assembly.lower + assembly.upper) / 2
                normal[axis], point[axis] = sign, bound[axis]
                planes.append((point, normal))
    else:
        dimension = len(boundary.center)
        center = np.zeros(3)
        center[:dimension] = boundary.center
        planes = [(center - boundary.radius * n, n) for n in _directions(dimension)]
    for i, (point, normal) in enumerate(planes):
        add(
            world, "geom", name=f"boundary:{i}", type="plane", group="4", pos=numbers(point), zaxis=numbers(normal),
            size=numbers((assembly.extent, assembly.extent, assembly.extent / 20)), rgba="0.5 0.5 0.5 0.1",
        )  # fmt: skip


def _directions(dimension: int) -> list[Array]:
    """Evenly spread unit vectors: 32 on a circle, 128 on a sphere (Fibonacci lattice)."""
    if dimension == 2:
        angle = np.arange(32) * (2 * np.pi / 32)
        return list(np.stack([np.cos(angle), np.sin(angle), np.zeros(32)], axis=1))
    i = np.arange(128)
    z = 1 - (2 * i + 1) / 128
    angle = i * np.pi * (3 - math.sqrt(5))
    r = np.sqrt(1 - z * z)
    return list(np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1))
