"""Mesh in, convex collision pieces out: the seam between geometry and MuJoCo."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..diagnostics import DiagnosticLog
from ..errors import Span, counted
from ..limits import Work
from ..options import Collision
from .analysis import Analysis, refuse_without_area
from .convexity import Box, exact_box, is_convex
from .coplanar import Polygon, convex_polygons
from .decompose import DecompositionError, approximate_parts
from .mesh import Mesh
from .pieces import LEAST_AREA, ConvexPiece, flatness, hull_piece, hull_volume, prisms
from .shells import Shells, shells
from .store import GeometryCache
from .topology import RELATIVE_TOLERANCE, Bools, Ints, by_component, face_areas

CONCAVE_PER_THICKNESS = 0.2
"""How far a point of a convex surface may lie inside its hull, in units of the thickness: a tenth of the band in which
verdicts may differ from the triangles, which is two thicknesses wide."""

# Triangles above which reading a file is quicker than computing its content, which for cells it always is.
_WORTH_KEEPING = 200


@dataclass(frozen=True, slots=True, eq=False)
class CollisionShape:
    """What stands for a mesh in collision.

    Attributes:
        mesh: The mesh.
        strategy: What was applied: "hull"; "coacd"; "surface" if all of it is collided as a surface; "solid" if any
            part is lined with shell cells, or solids and surfaces stand side by side.
        pieces: Convex pieces whose union collides.
        needs_containment: The pieces do not fill some closed part, whose inside counts as collision: the caller must
            test that separately.
        analysis: The mesh's analysis.
        note: One sentence for the report.
        omitted_area: Area of polygons that are too small for MuJoCo.
        omitted_length: Greatest length of one of them.
        box: The box that the one piece is, to within a tenth of the band of contact.
    """

    mesh: Mesh
    strategy: str
    pieces: tuple[ConvexPiece, ...]
    needs_containment: bool
    analysis: Analysis
    note: str
    omitted_area: float = 0.0
    omitted_length: float = 0.0
    box: Box | None = None


def collision_shape(
    mesh: Mesh,
    analysis: Analysis,
    strategy: Collision,
    thickness: float,
    log: DiagnosticLog,
    subject: str = "",
    span: Span | None = None,
    cache: GeometryCache | None = None,
    work: Work | None = None,
) -> CollisionShape:
    """Choose the convex pieces that stand for a mesh in collision.

    Args:
        mesh: The mesh.
        analysis: `analyse(mesh)`.
        strategy: One of the `collision` option's values.
        thickness: Height of the prisms that stand for surfaces; no piece leaves the surface or solid by more.
        log: Takes a finding where the pieces are not faithful.
        subject: What the findings are about; the mesh's name if empty.
        span: Where the mesh is named in the source.
        cache: Where results are kept between runs, if they are.
        work: What may be done; None sets no bound.

    Raises:
        TooMuchWorkError: It takes more.
        GeometryError: The mesh is a point or a line (GEO231), too small for MuJoCo (GEO241), or CoACD fails (GEO262).
        ValueError: The thickness is not positive, the strategy is unknown, or its package is not installed.
    """
    if not 0 < thickness < np.inf:
        raise ValueError(f"thickness must be a positive length, got {thickness!r}")
    if strategy not in _STRATEGIES:
        raise ValueError(f"collision={strategy!r} is not one of {', '.join(map(repr, _STRATEGIES))}")
    if analysis.dimension < 2:
        refuse_without_area(analysis, log, subject or mesh.name, span)
    subject = subject or mesh.name
    build = partial(_STRATEGIES[strategy], mesh, analysis, thickness, work or Work())
    try:
        slow = not analysis.convex and not analysis.flat and strategy in ("auto", "solid", "coacd")
        if cache is not None and (len(mesh.faces) > _WORTH_KEEPING or slow):
            what, known = ("shape", mesh.digest, strategy, thickness), {"mesh": mesh, "analysis": analysis}
            kinds = CollisionShape, ConvexPiece, Polygon, Box
            shape = cache.remember(what, build, kinds=kinds, known=known, log=log, subject=subject)
        else:
            shape = build()
    except DecompositionError as error:
        hint = "collision='auto' collides the true shape, without CoACD"
        log.fail("GEO262", subject, f"{mesh.name}: {error}", hint=hint, span=span)
    if strategy == "hull" and not analysis.convex:
        hint = "collision='auto' collides the true shape"
        log.info("GEO240", subject, shape.note, hint=hint, span=span)
    if strategy == "solid" and not analysis.solid:
        hint = "close the mesh, or give it a wall thickness, if its inside matters"
        log.info("GEO243", subject, shape.note, hint=hint, span=span)
    if shape.omitted_area:
        message = (
            f"polygons of area {shape.omitted_area:.3g} m^2 in all, up to {shape.omitted_length:.3g} m long, are too "
            f"small for MuJoCo, whose least area of a mesh is {LEAST_AREA:g} m^2, and do not collide"
        )
        hint = "enlarge the scene with scale= (--scale)"
        # A hole that is no longer than verdicts may be off changes none of those that are certain.
        report = log.warn if shape.pieces and shape.omitted_length <= 2 * thickness else log.fail
        report("GEO241", subject, message, hint=hint, span=span)
    return shape


def _hull(mesh: Mesh, analysis: Analysis, thickness: float, work: Work) -> CollisionShape:
    piece = hull_piece(analysis.vertices, thickness)
    note = _hull_note(analysis, piece)
    most = _concave_at_most(thickness, analysis.diagonal)
    box = exact_box(analysis.vertices, analysis.faces, most) if analysis.convex else None
    return CollisionShape(mesh, "hull", (piece,), False, analysis, note, box=box)


def _concave_at_most(thickness: float, diagonal: float) -> float:
    return max(CONCAVE_PER_THICKNESS * thickness, RELATIVE_TOLERANCE * diagonal)


def _hull_note(analysis: Analysis, piece: ConvexPiece) -> str:
    if analysis.convex:
        return f"convex{f' to {analysis.concavity:.2g} m' * (analysis.concavity > analysis.tolerance)}: one hull"
    if analysis.flat:
        return "flat: one thin plate, the convex hull of its outline"
    claimed = hull_volume(piece.vertices)
    if analysis.volume <= 0:
        return f"one hull of volume {claimed:.6g} about a surface that encloses nothing for certain"
    # Overlapping components count twice in the mesh's volume, so the hull may seem to claim less.
    extra = max(0.0, claimed / analysis.volume - 1)
    return f"one hull of a non-convex mesh: claims {extra:.3g} times its volume more than it has"


def _surface(mesh: Mesh, analysis: Analysis, thickness: float, work: Work) -> CollisionShape:
    pieces, omitted = _prisms(analysis, np.ones(analysis.components, dtype=np.bool_), thickness)
    note = f"{counted(len(analysis.faces), 'triangle')} in {counted(len(pieces), 'prism')}"
    return CollisionShape(mesh, "surface", pieces, False, analysis, note, *_together(omitted))


def _prisms(
    analysis: Analysis, chosen: Bools, thickness: float
) -> tuple[tuple[ConvexPiece, ...], list[tuple[float, float]]]:
    """Return prisms on the polygons of some components, (c,), those of solids inside of them; and what is left out."""
    pieces: tuple[ConvexPiece, ...] = ()
    omitted: list[tuple[float, float]] = []
    for inward in (True, False):
        rows = np.flatnonzero((chosen & (analysis.solids == inward))[analysis.component])
        flat = max(analysis.tolerance, flatness(analysis.diagonal, thickness))
        polygons = convex_polygons(analysis.vertices, analysis.faces[rows], flat)
        made = prisms(analysis.vertices, polygons, thickness, inward=inward)
        kept = {id(piece.polygon) for piece in made}
        omitted.append(_omitted(analysis, rows, [p for p in polygons if id(p) not in kept]))
        pieces += made
    return pieces, omitted


def _together(omitted: Sequence[tuple[float, float]]) -> tuple[float, float]:
    return sum(area for area, _ in omitted), max((length for _, length in omitted), default=0.0)


def _omitted(analysis: Analysis, faces: Ints, polygons: Sequence[Polygon]) -> tuple[float, float]:
    """Return the area of polygons whose faces are rows of `faces`, and the greatest length of one."""
    lost = [face for polygon in polygons for face in polygon.faces]
    if not lost:
        return 0.0, 0.0
    lengths = [np.linalg.norm(np.ptp(analysis.vertices[list(p.loop)], axis=0)) for p in polygons]
    return float(face_areas(analysis.vertices, analysis.faces[faces[lost]]).sum()), float(max(lengths))


def _hulled(hulls: tuple[ConvexPiece, ...]) -> str:
    return f"{counted(len(hulls), 'convex part')} as {'a hull' if len(hulls) == 1 else 'hulls'}"


def _solid(mesh: Mesh, analysis: Analysis, thickness: float, work: Work) -> CollisionShape:
    if analysis.convex:
        return _hull(mesh, analysis, thickness, work)
    solids, closed = analysis.solids, analysis.closed_components
    if not solids.any():
        shape = _surface(mesh, analysis, thickness, work)
        why = "no winding tells its sides apart" if closed.any() else "the mesh is open and has no inside"
        return replace(shape, needs_containment=bool(closed.any()), note=f"{why}: {shape.note}")
    whole = _convex_solids(analysis, thickness, work)
    pieces = tuple(
        hull_piece(analysis.vertices[np.unique(analysis.faces[analysis.component == c])], thickness)
        for c in np.flatnonzero(whole)
    )
    notes = [_hulled(pieces)] if pieces else []
    omitted: list[tuple[float, float]] = []
    rest = np.flatnonzero((solids & ~whole)[analysis.component])
    if len(rest):
        lining = shells(analysis, rest, thickness, work)
        notes.append(_shell_note(lining, analysis.component_volumes[solids & ~whole].sum()))
        omitted.append(_omitted(analysis, rest, lining.missing))
        pieces += lining.pieces
    if not solids.all():
        sheets, left_out = _prisms(analysis, ~solids, thickness)
        notes.append(_sheet_note(analysis, len(sheets)))
        omitted += left_out
        pieces += sheets
    strategy = "hull" if whole.all() else "solid"
    hollow = len(rest) > 0 or bool((closed & ~solids).any())
    return CollisionShape(mesh, strategy, pieces, hollow, analysis, ", ".join(notes), *_together(omitted))


def _sheet_note(analysis: Analysis, count: int) -> str:
    sheets = int((~analysis.solids).sum())
    triangles = int((~analysis.solids)[analysis.component].sum())
    what = f"{counted(sheets, 'piece')} as {'a surface' if sheets == 1 else 'surfaces'}"
    return f"{what}: {counted(triangles, 'triangle')} in {counted(count, 'prism')}"


def _shell_note(lining: Shells, volume: float) -> str:
    pinned = f"{counted(lining.pinned, 'thin prism')} where there is no room" if lining.pinned else "none a thin prism"
    split = f"{counted(lining.split, 'polygon')} split at thin spots, " if lining.split else ""
    # A mesh that crosses itself may hold as much volume inside out as it holds otherwise.
    times = f", {lining.volume / volume:.3g} times the solid's volume" if volume > 0 else ""
    return (
        f"{counted(len(lining.pieces), 'shell cell')}, {pinned}, {lining.tilted} tilted, {split}"
        f"thinnest {lining.thinnest:.3g}{times}"
    )


def _coacd(mesh: Mesh, analysis: Analysis, thickness: float, work: Work) -> CollisionShape:
    if analysis.convex:
        return _hull(mesh, analysis, thickness, work)
    if analysis.flat:
        return _surface(mesh, analysis, thickness, work)
    parts = approximate_parts(analysis.vertices, analysis.faces)
    pieces = tuple(hull_piece(part, thickness) for part in parts)
    note = f"{counted(len(pieces), 'convex part')} by CoACD, approximately"
    return CollisionShape(mesh, "coacd", pieces, False, analysis, note)


def _convex_solids(analysis: Analysis, thickness: float, work: Work) -> Bools:
    """Tell which components are convex solids without a cavity in them, (c,).

    The mesh's solid is the union of its outward components, so those may touch and overlap; only a cavity takes away.
    """
    out = np.zeros(analysis.components, dtype=np.bool_)
    parts = [np.unique(g, return_inverse=True) for g in by_component(analysis.faces, analysis.component)]
    points = [analysis.vertices[used] for used, _ in parts]
    low, high = (np.array([f(p, axis=0) for p in points]) for f in (np.min, np.max))
    size = np.linalg.norm(high - low, axis=1)
    volumes = analysis.component_volumes
    empty = volumes <= RELATIVE_TOLERANCE * size**3
    cavities, solid = analysis.solids & empty, analysis.solids & ~empty
    work.spend(int(cavities.sum()) * int(solid.sum()))
    for c in np.flatnonzero(solid):
        if ((low[cavities] > high[c]) | (high[cavities] < low[c])).any(axis=1).all():
            faces = parts[c][1].reshape(-1, 3).astype(np.int64)
            out[c] = is_convex(points[c], faces, _concave_at_most(thickness, float(size[c])), work=work)
    return out


_STRATEGIES: dict[str, Callable[[Mesh, Analysis, float, Work], CollisionShape]] = {
    "auto": _solid,
    "hull": _hull,
    "solid": _solid,
    "surface": _surface,
    "coacd": _coacd,
}
