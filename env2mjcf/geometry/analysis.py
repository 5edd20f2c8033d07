"""What kind of surface a mesh is: closed, convex, flat, a box, in one piece, wound which way."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..diagnostics import DiagnosticLog
from ..errors import Span
from ..limits import Work
from .components import cleaned
from .convexity import Box, concavity, exact_box
from .mesh import Mesh
from .orientation import disagreeing, inside_out, wound_alike
from .topology import RELATIVE_TOLERANCE, Bools, Floats, Ints, apart, edges, face_areas, face_volumes


@dataclass(frozen=True, slots=True, eq=False)
class Analysis:
    """The facts about a mesh, and the clean triangles that the later stages work on.

    Attributes:
        vertices: (n, 3) read-only; the file's vertices after welding, only those that `faces` use.
        faces: (m, 3) read-only; without degenerate and duplicate ones, and of `solids` all counter-clockwise from
            outside.
        source: (m,) row of each face in the mesh's own face list.
        component: (m,) piece of each face: what hangs together, see `components.cleaned`.
        component_volumes: (c,) signed volumes of the pieces, wound as in `faces`; negative: a cavity. Without meaning
            for those that are not `solids`.
        closed_components: (c,) which pieces are closed: each edge borders an even number of the piece's triangles.
        solids: (c,) which of these are wound so that `faces` tells inside from outside.
        diagonal: Of the bounding box of the vertices that the file's faces use.
        dimension: Of the point set within the tolerance: 0 a point, 1 a line, 2 flat, 3.
        normal: (3,) unit normal of the plane that the points are nearest to.
        consistent: In the file each edge of a piece is walked equally often both ways, as far as it has two faces.
        oriented: The same for `faces`, which are turned round to agree, where that is possible.
        inverted: Closed and consistent, and wound inside out in the file, at least in part.
        convex: Closed, one component, and the boundary of its own hull, to within `concavity`.
        concavity: Length that no point lies farther inside the hull than; infinite unless `convex`.
        box: The box that it is, if it is convex and exactly that, to within `tolerance`.
        area: Of `faces`.
        signed_volume: Of the closed pieces as wound in the file, if that is consistent.
        degenerate_faces: Faces of no height that were dropped.
        duplicate_faces: Copies of other faces that were dropped.
        unused_vertices: Vertices of the file that no face uses.
        open_edges: Edges with an odd number of a piece's faces.
        crowded_edges: Edges with more than two faces.
    """

    vertices: Floats
    faces: Ints
    source: Ints
    component: Ints
    component_volumes: Floats
    closed_components: Bools
    solids: Bools
    diagonal: float
    dimension: int
    normal: Floats
    consistent: bool
    oriented: bool
    inverted: bool
    convex: bool
    concavity: float
    box: Box | None
    area: float
    signed_volume: float
    degenerate_faces: int
    duplicate_faces: int
    unused_vertices: int
    open_edges: int
    crowded_edges: int

    @property
    def components(self) -> int:
        """Number of pieces."""
        return len(self.component_volumes)

    @property
    def flat(self) -> bool:
        """All points lie in a plane, but not on a line."""
        return self.dimension == 2

    @property
    def closed(self) -> bool:
        """Every piece is closed."""
        return self.components > 0 and bool(self.closed_components.all())

    @property
    def solid(self) -> bool:
        """Every piece is closed, and wound so that `faces` tells inside from outside."""
        return self.components > 0 and bool(self.solids.all())

    @property
    def enclosing(self) -> Ints:
        """The faces of closed pieces, (k, 3): what tells inside from outside."""
        return self.faces if self.closed else self.faces[self.closed_components[self.component]]

    @property
    def volume(self) -> float:
        """Volume that `solids` enclose; those that overlap count once each."""
        return float(self.component_volumes[self.solids].sum())

    @property
    def tolerance(self) -> float:
        """The length that counts as nothing in this mesh."""
        return RELATIVE_TOLERANCE * self.diagonal


def analyse(mesh: Mesh, work: Work | None = None, concave: float = 0.0) -> Analysis:
    """Find out what kind of surface `mesh` is. About 0.1 s for 10,000 triangles.

    Args:
        mesh: The mesh.
        work: What may be done; None sets no bound.
        concave: Length that points of a convex surface may lie inside its hull; the tolerance of the mesh at least.

    Raises:
        TooMuchWorkError: It takes more than `work` has left.
    """
    used = np.unique(mesh.faces)
    points = mesh.vertices[used]
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0
    tolerance = RELATIVE_TOLERANCE * diagonal
    dimension, normal = _dimension(points, tolerance)
    clean = cleaned(points, np.searchsorted(used, mesh.faces), tolerance, dimension, work)
    faces, component, count = clean.faces, clean.component, len(clean.closed)
    alike = wound_alike(clean.deciding, clean.deciding_component, count)
    turned, oriented = np.zeros(len(faces), dtype=np.bool_), alike
    if not alike.all():
        turned, agree = disagreeing(clean.edges, component, count)
        oriented = alike | agree
        turned &= (agree & ~alike)[component]
        faces = np.where(turned[:, None], faces[:, ::-1], faces)

    volumes = np.bincount(component, face_volumes(points, faces) / 6.0, minlength=count).astype(np.float64)
    signed_volume = float(volumes[clean.closed].sum())
    solids = clean.closed & oriented
    flipped = _inside_out(points, faces, component, volumes, solids, work or Work())
    turned = turned ^ flipped[component]
    faces = np.where(flipped[component, None], faces[:, ::-1], faces)
    volumes = np.where(flipped, -volumes, volumes)
    left, faces = np.unique(faces, return_inverse=True)
    vertices, faces = points[left], faces.reshape(-1, 3).astype(np.int64)
    single = count == 1 and bool(clean.closed[0])
    most = max(concave, tolerance)
    inside = concavity(vertices, faces, most, clean.edges.turned(turned), work) if single else math.inf
    convex = inside <= most
    for array in (vertices, faces, clean.source, component, volumes, clean.closed, solids, normal):
        array.setflags(write=False)
    return Analysis(
        vertices=vertices,
        faces=faces,
        source=clean.source,
        component=component,
        component_volumes=volumes,
        closed_components=clean.closed,
        solids=solids,
        diagonal=diagonal,
        dimension=dimension if len(faces) else min(dimension, 1),
        normal=normal,
        consistent=bool(alike.all()),
        oriented=bool(oriented.all()),
        inverted=bool((flipped & alike).any()),
        convex=convex,
        concavity=inside,
        box=exact_box(vertices, faces, tolerance) if convex else None,
        area=float(face_areas(vertices, faces).sum()),
        signed_volume=signed_volume,
        degenerate_faces=clean.degenerate,
        duplicate_faces=clean.duplicates,
        unused_vertices=len(mesh.vertices) - len(used),
        open_edges=int((clean.deciding.faces % 2 == 1).sum()),
        crowded_edges=clean.crowded,
    )


def _inside_out(points: Floats, faces: Ints, component: Ints, volumes: Floats, solids: Bools, work: Work) -> Bools:
    """Tell which components are inside out, (c,): an open one neither is a cavity nor holds one."""
    if solids.all():
        return inside_out(points, faces, component, volumes, work)
    out, chosen = np.zeros(len(solids), dtype=np.bool_), solids[component]
    if chosen.any():
        number = (np.cumsum(solids) - 1)[component[chosen]]
        out[solids] = inside_out(points, faces[chosen], number, volumes[solids], work)
    return out


def _dimension(points: Floats, tolerance: float) -> tuple[int, Floats]:
    """Return in how many directions the points spread, and the one in which they spread least."""
    if len(points) == 0 or tolerance == 0:
        return 0, np.array([0.0, 0.0, 1.0])
    centred = points - points.mean(axis=0)
    axes = np.linalg.svd(np.vstack([centred, np.zeros((3, 3))]), full_matrices=False)[2]
    spread = np.abs(centred @ axes.T).max(axis=0) > tolerance
    normal = axes[2] * (-1.0 if axes[2][np.argmax(np.abs(axes[2]))] < 0 else 1.0)
    return int(spread.sum()), np.asarray(normal + 0.0, dtype=np.float64)


def mesh_diagnostics(
    mesh: Mesh, analysis: Analysis, log: DiagnosticLog, subject: str = "", span: Span | None = None
) -> None:
    """Record what is unusual about a mesh.

    Raises:
        GeometryError: The mesh has no area (GEO231), or a warning in strict mode.
    """
    subject = subject or mesh.name

    def warn(code: str, message: str, hint: str = "") -> None:
        log.warn(code, subject, message, hint=hint, span=span)

    def note(code: str, message: str) -> None:
        log.info(code, subject, message, span=span)

    if analysis.dimension < 2:
        refuse_without_area(analysis, log, subject, span)
    if analysis.degenerate_faces:
        warn("GEO236", f"{analysis.degenerate_faces} of {len(mesh.faces)} faces have no height and were dropped")
    if analysis.duplicate_faces:
        warn("GEO235", f"{analysis.duplicate_faces} of {len(mesh.faces)} faces are copies of others and were dropped")
    if analysis.flat:
        warn("GEO230", "all points lie in one plane: the mesh is a sheet without inside", "it collides as a thin plate")
    elif not analysis.closed:
        what, others = "it collides as a sheet", ""
        if analysis.closed_components.any():
            what, others = "what is open collides as a sheet", "; the closed pieces are solid"
        warn("GEO232", _open_message(analysis), f"{what}: a body wholly inside it does not count as touching{others}")
    # A sheet has no outside, so that its winding says nothing.
    if not analysis.consistent and not analysis.flat:
        done = "faces were turned round to agree" if analysis.oriented else "no side is known to be outside"
        # Without a winding, the engines tell what is inside by different rules.
        unsure = (analysis.closed_components & ~analysis.solids).any()
        hint = "mend its winding: verdicts on what is wholly inside this mesh are not certain" if unsure else ""
        warn("GEO234", f"neighbouring faces are wound opposite ways; {done}", hint)
    elif analysis.inverted:
        warn("GEO233", f"wound inside out (volume {analysis.signed_volume:.6g}); the faces were turned round")
    if analysis.crowded_edges:
        note("GEO239", f"{analysis.crowded_edges} edges have more than two faces")
    if analysis.components > 1:
        closed = int(analysis.closed_components.sum())
        kinds = ", all closed" if analysis.closed else f", {closed} closed and {analysis.components - closed} open"
        note("GEO237", f"the mesh is in {analysis.components} pieces{kinds if closed else ''}")
    if analysis.unused_vertices:
        note("GEO238", f"{analysis.unused_vertices} vertices are used by no face")


def _open_message(analysis: Analysis) -> str:
    """Say how much of a surface is open, and where."""
    count = int((~analysis.closed_components).sum())
    whole = "the surface is open"
    if analysis.closed_components.any():
        whole = f"{count} of {analysis.components} pieces {'is' if count == 1 else 'are'} open"
    loose = ~analysis.closed_components[analysis.component]
    table = edges(apart(analysis.faces[loose], analysis.component[loose]))
    corner = np.flatnonzero((table.faces % 2 == 1)[table.of_corner].ravel())
    where = ""
    if len(corner):
        face, k = divmod(int(corner[0]), 3)
        middle = analysis.vertices[analysis.faces[loose][face, [k, (k + 1) % 3]]].mean(axis=0)
        where = ", one of them at ({:.6g}, {:.6g}, {:.6g}) of the body's frame".format(*middle)
    return f"{whole}: {analysis.open_edges} edges border an odd number of triangles{where}"


def refuse_without_area(analysis: Analysis, log: DiagnosticLog, subject: str, span: Span | None = None) -> None:
    """Raise GEO231: a point or a line cannot collide.

    Raises:
        GeometryError: Always.
    """
    what = ("a point", "a line")[min(analysis.dimension, 1)]
    message = "the mesh has no area" + (f": its faces collapse to {what}" if analysis.diagonal else "")
    hint = "a body needs a surface to collide; give it triangles, or leave the body out"
    log.fail("GEO231", subject, message, hint=hint, span=span)
