"""Mass, centre of mass and principal moments of a mesh."""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, hypot

import numpy as np

from ..errors import counted
from ..transforms import quaternion_from_matrix
from .analysis import Analysis
from .mesh import Mesh
from .topology import RELATIVE_TOLERANCE, Floats, area_vectors
from .union import Union, union

SHELL_THICKNESS = 0.01
"""Thickness of the sheet that stands for a mesh without inside, in units of the diagonal of what is open."""

LEAST = 1e-14
"""Least mass and moment: ten times what MuJoCo takes for nothing (mjMINVAL)."""

LEAST_SPREAD = 1e-9
"""Least second moment along any axis, relative to the largest: keeps A + B >= C clear of rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Inertial:
    """What a MuJoCo `<inertial>` says.

    Attributes:
        mass: Kilograms.
        com: (3,) centre of mass in the mesh's frame.
        quat: (4,) w x y z, from principal axes to the mesh's frame; w is not negative.
        diagonal: (3,) moments about the principal axes.
        note: What was assumed; empty for the exact moments of a solid.
    """

    mass: float
    com: Floats
    quat: Floats
    diagonal: Floats
    note: str


def inertial(
    mesh: Mesh, analysis: Analysis, density: float, mass: float | None = None, filled: Union | None = None
) -> Inertial:
    """Return the inertia of a mesh of uniform density.

    Solid pieces have the exact moments of their polyhedra; all others together those of a sheet of 1 % of their
    diagonal.

    Args:
        mesh: The mesh; its name appears in the note.
        analysis: `analyse(mesh)`.
        density: Mass per volume.
        mass: Mass that the file gives; overrides the density if it is positive.
        filled: `union(analysis)`, where it is known.
    """
    notes: list[str] = []
    origin = analysis.vertices.mean(axis=0) if len(analysis.vertices) else np.zeros(3)
    filled = filled or union(analysis)
    loose = np.ones(len(analysis.faces), dtype=np.bool_)
    parts: list[tuple[float, Floats, Floats]] = []
    if filled.volume > RELATIVE_TOLERANCE * analysis.area * analysis.diagonal:
        parts.append(_solid(filled.triangles - origin))
        loose = ~analysis.solids[analysis.component]
    if loose.any() or not parts:
        corners = analysis.vertices[analysis.faces[loose]]
        thickness = SHELL_THICKNESS * float(np.linalg.norm(np.ptp(corners, axis=(0, 1))))
        parts.append(_sheet(corners - origin, thickness))
        what = mesh.name if loose.all() else f"a part of {mesh.name} in {counted(int(loose.sum()), 'triangle')}"
        notes.append(f"{what} encloses no certain volume, so it was taken for a sheet {thickness:.3g} thick")
    volume, com, second = parts[0] if len(parts) == 1 else _together(*parts)
    total = volume * density
    if mass is not None and mass > 0:
        total = float(mass)
    elif mass is not None:
        notes.append(f"mass {mass:g} of the file is not positive; density used")
    if total < LEAST:
        notes.append(f"mass {total:.3g} raised to {LEAST:g}, the least that MuJoCo takes")
        total = LEAST
    second = second * (total / volume) if volume > 0 else np.zeros((3, 3))

    spread, axes = principal_axes(second)
    # The moments are sums of two second moments, so with none below the floor A + B >= C holds with room to spare.
    least = max(LEAST_SPREAD * float(spread.max()), LEAST / 2)
    if (spread < least).any():
        notes.append(f"moments raised to what MuJoCo takes (second moments of at least {least:.3g})")
        spread = np.maximum(spread, least)
    diagonal = spread.sum() - spread
    quat, com = quaternion_from_matrix(axes) + 0.0, com + origin
    for array in (diagonal, quat, com):
        array.setflags(write=False)
    return Inertial(total, com, quat, diagonal, "; ".join(notes))


def _solid(triangles: Floats) -> tuple[float, Floats, Floats]:
    """Return volume, centroid and central second moments, integral of x x^T, of a polyhedron (m, 3, 3).

    Sums tetrahedra from the origin: a tetrahedron (0, a, b, c) of volume V has the moments
    V/20 (a a^T + b b^T + c c^T + s s^T) with s = a + b + c.
    """
    volumes = np.einsum("ij,ij->i", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2])) / 6
    sums = triangles.sum(axis=1)
    volume = float(volumes.sum())
    com = volumes @ sums / (4 * volume)
    second = np.einsum("m,mki,mkj->ij", volumes, triangles, triangles) + np.einsum("m,mi,mj->ij", volumes, sums, sums)
    return volume, com, second / 20 - volume * np.outer(com, com)


def _together(*parts: tuple[float, Floats, Floats]) -> tuple[float, Floats, Floats]:
    """Return volume, centroid and central second moments of several bodies."""
    volume = sum(v for v, _, _ in parts)
    com = np.sum([v * c for v, c, _ in parts], axis=0) / volume
    second = np.sum([s + v * np.outer(c - com, c - com) for v, c, s in parts], axis=0)
    return volume, com, second


def _sheet(triangles: Floats, thickness: float) -> tuple[float, Floats, Floats]:
    """Return volume, centroid and central second moments of plates of a thickness on triangles, (m, 3, 3).

    A triangle of area A has the moments A/12 (a a^T + b b^T + c c^T + s s^T); its thickness t adds A t^2/12 n n^T.
    """
    normals = area_vectors(triangles) / 2
    areas = np.linalg.norm(normals, axis=1)
    area = float(areas.sum())
    if area == 0:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    sums = triangles.sum(axis=1)
    com = areas @ sums / (3 * area)
    second = np.einsum("m,mki,mkj->ij", areas, triangles, triangles) + np.einsum("m,mi,mj->ij", areas, sums, sums)
    second = second / 12 - area * np.outer(com, com)
    second += np.einsum("m,mi,mj->ij", thickness**2 / 12 / areas, normals, normals)
    return area * thickness, com, second * thickness


def principal_axes(matrix: Floats) -> tuple[Floats, Floats]:
    """Diagonalise a symmetric matrix, (3, 3), by Jacobi rotations.

    Unlike LAPACK's, the axes are the coordinate axes turned as little as possible: a matrix that is diagonal but for
    rounding gives the identity, equal eigenvalues give no arbitrary axes, and the bytes do not depend on the machine.

    Returns:
        (3,) eigenvalues and (3, 3) right-handed eigenvectors as columns.
    """
    a: list[list[float]] = ((matrix + matrix.T) / 2).tolist()
    v: list[list[float]] = np.eye(3).tolist()
    nothing = 1e-13 * sum(abs(a[i][i]) for i in range(3))
    for _ in range(30):
        p, q = max(((0, 1), (0, 2), (1, 2)), key=lambda pq: abs(a[pq[0]][pq[1]]))
        if abs(a[p][q]) <= nothing:
            break
        # Golub and Van Loan, "Matrix Computations", section 8.5: the smaller of the two angles.
        tau = (a[q][q] - a[p][p]) / (2 * a[p][q])
        t = copysign(1.0, tau) / (abs(tau) + hypot(1.0, tau))
        c = 1 / hypot(1.0, t)
        s = t * c
        for row in (*a, *v):
            row[p], row[q] = c * row[p] - s * row[q], s * row[p] + c * row[q]
        a[p], a[q] = (
            [c * x - s * y for x, y in zip(a[p], a[q], strict=True)],
            [s * x + c * y for x, y in zip(a[p], a[q], strict=True)],
        )
    return np.array([a[i][i] for i in range(3)]), np.array(v)
