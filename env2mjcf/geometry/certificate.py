"""How far the convex pieces of a mesh are from the mesh itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..diagnostics import DiagnosticLog
from .distance import distances, spread
from .extremes import PointTree
from .orientation import encloses
from .pieces import hull_faces, hull_volume
from .shapes import CollisionShape
from .store import GeometryCache
from .topology import Bools, Floats, Ints, area_vectors

APPROXIMATE = ("hull", "coacd")
"""Strategies whose verdicts may be wrong by more than the tolerance of contact."""

_SURFACE_POINTS = 3000
_LATTICE_POINTS = 4096
_WORK = 1_000_000  # pairs of lattice points and triangles
# Fewer points are taken of meshes of very many triangles only: about twenty seconds at most for each of these.
_LEAST_LATTICE, _MOST_WORK = 1000, 20_000_000
_LEAST_POINTS, _MOST_DISTANCES = 1000, 200_000_000
_FEWEST = 100
# Each lattice point lies elsewhere in its cell, so that counts are not all wrong by the same part of a cell: Roberts,
# "The unreasonable effectiveness of quasirandom sequences", 2018.
_STEPS = 1.2207440846057596 ** -np.arange(1.0, 4.0)
_BATCH = 64
_BLOCK = 2_000_000  # heights held in memory at once


@dataclass(frozen=True, slots=True)
class Certificate:
    """The difference between a mesh and what collides for it.

    Attributes:
        exact: Pieces and mesh differ by no more than `band`, by construction; else the numbers below are sampled.
        volume_added: Volume that collides and is not in the mesh, cubic metres; None where that has no meaning.
        volume_lost: Volume of the mesh that does not collide; None for a surface, which has none.
        reach_added: Greatest distance, metres, from the mesh of a point that collides: what is farther than this from
            the mesh is never called a collision on its account.
        reach_lost: Greatest distance from the pieces of a point of the mesh: what reaches deeper than this into it is
            always called a collision.
        band: Verdicts are certain where other bodies stay farther than this from the surface, on either side, metres.
        samples: Number of points on vertices, edges and faces and inside that were measured; 0: none was needed.
        gap: Greatest distance, metres, of any point from a sample: what is smaller may have been passed over.
        fraction_added, fraction_lost: The volumes in units of the mesh's volume; None for a surface.
    """

    exact: bool
    volume_added: float | None
    volume_lost: float | None
    reach_added: float
    reach_lost: float
    band: float
    samples: int = 0
    gap: float = 0.0
    fraction_added: float | None = None
    fraction_lost: float | None = None

    def __str__(self) -> str:
        if self.exact:
            inside = "what lies wholly inside is called free; " if self.volume_lost else ""
            return f"{inside}verdicts are certain beyond {self.band:.2g} m of its surface"
        claims = (
            f"claims {_much(self.fraction_added, self.volume_added)}, up to {self.reach_added:.3g} m off the mesh: "
            "free configurations there are called collisions"
            if self.reach_added > 0
            else "claims nothing that is not the mesh"
        )
        misses = (
            f"misses {_much(self.fraction_lost, self.volume_lost)}, up to {self.reach_lost:.3g} m deep: "
            "collisions there are called free"
            if self.reach_lost > 0
            else "misses no collision"
        )
        how = f"sampled at {self.samples} points on vertices, edges, faces and inside, {self.gap:.2g} m apart at most"
        return f"{claims}; {misses}; verdicts are certain beyond {self.band:.3g} m of its surface ({how})"


def _much(fraction: float | None, volume: float | None) -> str:
    if fraction is not None and fraction < 1e-3:
        return "less than 0.1 % of its volume"
    if fraction is not None:
        return f"{100 * fraction:.3g} % of its volume"
    return "some space" if volume is None else f"{volume:.3g} m3"


def certificate(
    shape: CollisionShape, thickness: float, cache: GeometryCache | None, log: DiagnosticLog
) -> Certificate:
    """Return `certify(shape, thickness)`, from the cache if it is there."""
    build = partial(certify, shape, thickness)
    if cache is None or shape.strategy not in APPROXIMATE or shape.analysis.convex:
        return build()
    what = ("certificate", shape.mesh.digest, shape.strategy, len(shape.pieces), thickness)
    return cache.remember(what, build, kinds=(Certificate,), known={}, log=log, subject=shape.mesh.name)


def certify(shape: CollisionShape, thickness: float) -> Certificate:
    """Compare the pieces of a shape with its mesh.

    Faithful strategies are exact by construction: no piece leaves the surface by more than the thickness, and what
    they lose of a solid's inside is tested separately. The others are measured: points on all vertices, edges and
    faces, and a lattice of points inside, the same on every run.

    Args:
        shape: The shape.
        thickness: That it was made with.
    """
    analysis = shape.analysis
    # As `auto` makes them: each piece is convex and has a hull of its own.
    parts = shape.strategy == "hull" and len(shape.pieces) == analysis.components > 1
    if shape.strategy not in APPROXIMATE or analysis.convex or parts:
        surface = shape.strategy == "surface" and not shape.needs_containment
        lost = analysis.volume if surface else 0.0
        # A hull reaches beyond the mesh by what that is concave.
        band = max(thickness, analysis.concavity) if analysis.convex else thickness
        return Certificate(True, 0.0, lost, band, band, band, 0, 0.0, 0.0, 1.0 if lost else 0.0)
    return _measured(shape, thickness)


@dataclass(frozen=True, slots=True, eq=False)
class _Pieces:
    """The convex pieces: corners and triangles of all, and the planes of each."""

    vertices: Floats
    faces: Ints
    planes: tuple[tuple[Floats, Floats], ...]

    def inside(self, points: Floats) -> Bools:
        """Tell which points lie in any piece, (k,)."""
        out = np.zeros(len(points), dtype=np.bool_)
        for normals, offsets in self.planes:
            step = max(1, _BLOCK // len(normals))
            for i in range(0, len(points), step):
                out[i : i + step] |= (points[i : i + step] @ normals.T <= offsets).all(axis=1)
        return out


def _pieces(shape: CollisionShape) -> _Pieces:
    clouds = [piece.vertices + piece.center for piece in shape.pieces]
    faces = hull_faces([piece.vertices for piece in shape.pieces])
    planes: list[tuple[Floats, Floats]] = []
    for cloud, own in zip(clouds, faces, strict=True):
        normals = area_vectors(cloud[own])
        length = np.linalg.norm(normals, axis=1)
        normals = normals[length > 0] / length[length > 0, None]
        # The farthest corner, so that float32 in the hull lets no point of the cloud out.
        known = np.einsum("fki,fi->fk", cloud[own[length > 0]], normals).max(axis=1)
        planes.append((normals, PointTree(cloud).highest(normals, known)))
    starts = np.cumsum([0, *(len(c) for c in clouds)])
    joined = np.concatenate([own + start for own, start in zip(faces, starts, strict=False)])
    return _Pieces(np.concatenate(clouds), joined, tuple(planes))


def _measured(shape: CollisionShape, thickness: float) -> Certificate:
    analysis, pieces = shape.analysis, _pieces(shape)
    vertices, faces = analysis.vertices, analysis.faces
    lattice, cell, gap = _lattice(pieces.vertices, vertices, len(faces))
    claimed = pieces.inside(lattice)
    owned = np.zeros(len(lattice), dtype=np.bool_)
    # The hull holds all of the mesh.
    tested = claimed if shape.strategy == "hull" else np.ones_like(claimed)
    owned[tested] = _in_solid(lattice[tested], shape)
    on_pieces, gap_pieces = _on_surface(pieces.vertices, pieces.faces, len(faces))
    beyond = np.concatenate([on_pieces, lattice[claimed & ~owned]])
    reach_added = _reach(beyond, distances(beyond, vertices, faces), lambda p: _in_solid(p, shape))
    samples, gap = len(on_pieces) + len(lattice), max(gap, gap_pieces)
    added, lost, reach_lost = float((claimed & ~owned).sum() * cell), float((owned & ~claimed).sum() * cell), 0.0
    if shape.strategy == "hull":
        if analysis.solid and analysis.components == 1:
            added = max(0.0, hull_volume(vertices) - analysis.volume)
    else:
        on_mesh, gap_mesh = _on_surface(vertices, faces, len(pieces.faces))
        under = np.concatenate([on_mesh, lattice[owned & ~claimed]])
        reach_lost = _reach(under, distances(under, pieces.vertices, pieces.faces), pieces.inside)
        samples, gap = samples + len(on_mesh), max(gap, gap_mesh)
    volume = analysis.volume if analysis.components == 1 else float(owned.sum() * cell)
    solid = analysis.volume > 0 and volume > 0
    # MuJoCo keeps corners as float32, which cannot tell less than this from nothing.
    reach_added, reach_lost = (r if r > 1e-6 * analysis.diagonal else 0.0 for r in (reach_added, reach_lost))
    return Certificate(
        exact=False,
        volume_added=added,
        volume_lost=lost if solid else None,
        reach_added=reach_added,
        reach_lost=reach_lost,
        band=max(reach_added, reach_lost, thickness),
        samples=samples,
        gap=gap,
        fraction_added=added / volume if solid else None,
        fraction_lost=lost / volume if solid else None,
    )


def _on_surface(vertices: Floats, faces: Ints, others: int) -> tuple[Floats, float]:
    """Return points on a surface whose distances from `others` triangles are to be found, and their greatest gap."""
    points, gap = spread(vertices, faces, _SURFACE_POINTS)
    points = np.unique(points, axis=0)
    most = max(_LEAST_POINTS, _MOST_DISTANCES // others)
    if len(points) <= most:
        return points, gap
    low, size = points.min(axis=0), np.ptp(points, axis=0)
    width, kept = float(size.max()) / most, points
    while len(kept) > most:
        width *= 1.25
        cells = np.floor((points - low) / width).astype(np.int64)
        kept = points[np.unique(cells, axis=0, return_index=True)[1]]
    return kept, gap + width * float(np.sqrt(3.0))


def _lattice(first: Floats, second: Floats, triangles: int) -> tuple[Floats, float, float]:
    """Return points that fill the box around both point sets, the volume of each one's cell, and their greatest gap."""
    points = np.concatenate([first, second])
    low, size = points.min(axis=0), np.ptp(points, axis=0)
    least = max(_FEWEST, min(_LEAST_LATTICE, _MOST_WORK // max(1, triangles)))
    count = max(least, min(_LATTICE_POINTS, _WORK // max(1, triangles)))
    width = float(np.prod(np.maximum(size, 1e-3 * size.max())) / count) ** (1 / 3)
    cuts = np.maximum(1, np.ceil(size / width)).astype(np.int64)
    cells = np.stack(np.meshgrid(*(np.arange(n) for n in cuts), indexing="ij"), axis=-1).reshape(-1, 3)
    places = (cells + ((np.arange(len(cells))[:, None] + 0.5) * _STEPS) % 1.0) / cuts
    return low + size * places, float(np.prod(size / cuts)), float(np.linalg.norm(size / cuts))


def _in_solid(points: Floats, shape: CollisionShape) -> Bools:
    analysis = shape.analysis
    return encloses(analysis.vertices, analysis.faces[analysis.solids[analysis.component]], points)


def _reach(points: Floats, apart: Floats, inside: Callable[[Floats], Bools]) -> float:
    """Return the greatest of the distances of points that are not inside; the farthest are tested first."""
    order = np.argsort(-apart, kind="stable")
    for i in range(0, len(order), _BATCH):
        some = order[i : i + _BATCH]
        out = ~inside(points[some])
        if out.any():
            return float(apart[some[np.argmax(out)]])
    return 0.0
