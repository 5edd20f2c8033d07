"""What a conversion did, in numbers."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

from .geometry.certificate import Certificate
from .pipeline import Compiled


@dataclass(frozen=True, slots=True)
class MeshReport:
    """What became of one mesh.

    Attributes:
        file: The mesh as the scene names it.
        triangles: Number of triangles.
        closed, convex: What it is like.
        solids, sheets: Number of its pieces that have an inside, and of those that have none.
        cells: Number of convex pieces that collide for it.
        note: How it was represented, in a sentence.
        certificate: How far these are from the mesh; None for what is only drawn.
    """

    file: str
    triangles: int
    closed: bool
    convex: bool
    solids: int
    sheets: int
    cells: int
    note: str
    certificate: Certificate | None = None


@dataclass(frozen=True, slots=True)
class Report:
    """A scene in numbers.

    Attributes:
        name, dialect, semantics, collision: What was read, and how.
        robots, links, obstacles, surfaces: Numbers of each.
        dof: Degrees of freedom of all robots.
        pairs: Number of tested pairs.
        geoms: Geoms of the model that collide.
        mass: Mass of all links, kg.
        extent: Diagonal of the bounding box at home, metres.
        band: Verdicts are certain where bodies are farther apart, or deeper in each other, than this, metres: twice the
            greatest band of a mesh, since two meshes meet.
        meshes: One entry for each mesh.
        diagnostics: Number of diagnostics by severity.
        origin: Where the MJCF's origin lies in the file's frame, metres.
        wall_speed: Speed, m/s, up to which walls hold what moves in MuJoCo, at the time step of the MJCF; None where
            nothing can touch.
    """

    name: str
    dialect: str
    semantics: str
    collision: str
    robots: int
    links: int
    obstacles: int
    surfaces: int
    dof: int
    pairs: int
    geoms: int
    mass: float
    extent: float
    band: float
    meshes: tuple[MeshReport, ...] = field(repr=False)
    diagnostics: dict[str, int]
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    wall_speed: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values, for JSON."""
        return dataclasses.asdict(self)


def report(compiled: Compiled) -> Report:
    """Sum a compiled scene up."""
    environment, assembly = compiled.environment, compiled.assembly
    meshes: dict[tuple[str, str], MeshReport] = {}
    for part in assembly.parts():
        shape = part.shape
        meshes.setdefault(
            (part.body.filename, part.mesh.digest),
            MeshReport(
                part.body.filename,
                len(part.mesh.faces),
                part.analysis.closed,
                part.analysis.convex,
                int(part.analysis.closed_components.sum()),
                int((~part.analysis.closed_components).sum()),
                len(shape.pieces) if shape else 0,
                shape.note if shape else "drawn only",
                part.certificate,
            ),
        )
    counts: dict[str, int] = {}
    for diagnostic in compiled.diagnostics:
        counts[diagnostic.severity.value] = counts.get(diagnostic.severity.value, 0) + 1
    links = assembly.links
    return Report(
        name=environment.name,
        dialect=environment.dialect.value,
        semantics=environment.semantics,
        collision=compiled.options.collision,
        robots=len(assembly.robots),
        links=len(links),
        obstacles=len(assembly.obstacles),
        surfaces=len(assembly.surfaces),
        dof=compiled.space.dim,
        pairs=len(compiled.pairs.tested),
        geoms=len(compiled.document.owners),
        mass=sum(p.inertial.mass for p in links if p.inertial),
        extent=assembly.extent,
        band=assembly.band,
        meshes=tuple(meshes.values()),
        diagnostics=counts,
        origin=assembly.origin,
        wall_speed=compiled.document.wall_speed,
    )
