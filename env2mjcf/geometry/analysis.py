"""What kind of surface a mesh is: closed, convex, flat, a box, in one piece, wound which way."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..diagnostics import DiagnosticLog
from ..errors import Span
from ..limits import Work
from .convexity import Box, concavity, exact_box
from .mesh import Mesh
from .orientation import disagreeing, inside_out, wound_alike
from .topology import RELATIVE_TOLERANCE, Floats, Ints, cleaned, face_areas, face_components, face_volumes


@dataclass(frozen=True, slots=True, eq=False)
class Analysis:
    """The facts about a mesh, and the clean triangles that the later stages work on.

    Attributes:
        vertices: (n, 3) read-only; the file's vertices after welding, only those that `faces` use.
        faces: (m, 3) read-only; without degenerate and duplicate ones, and of a `solid` mesh all counter-clockwise
            from outside.
        source: (m,) row of each face in the mesh's own face list.
        component: (m,) component of each face.
        component_volumes: (c,) signed volumes of the components, wound as in `faces`; negative: a cavity.
        diagonal: Of the bounding box of the vertices that the file's faces use.
        dimension: Of the point set within the tolerance: 0 a point, 1 a line, 2 flat, 3.
        normal: (3,) unit normal of the plane that the points are nearest to.
        closed: Each edge borders an even number of triangles, and the surface is not flat.
        consistent: In the file each edge is walked equally often both ways, as far as it has two faces.
        oriented: The same for `faces`, which are turned round to agree, where that is possible.
        inverted: Closed and consistent, and wound inside out in the file, at least in part.
        convex: Closed, one component, and the boundary of its own hull, to within `concavity`.
        concavity: Length that no point lies farther inside the hull than; infinite unless `convex`.
        box: The box that it is, if it is convex and exactly that, to within `tolerance`.
        area: Of `faces`.
        signed_volume: As wound in the file, if that is consistent; without meaning unless the mesh is closed.
        degenerate_faces: Faces of no height that were dropped.
        duplicate_faces: Copies of other faces that were dropped.
        unused_vertices: Vertices of the file that no face uses.
        open_edges: Edges with an odd number of faces.
        crowded_edges: Edges with more than two faces.
    """

    vertices: Floats
    faces: Ints
    source: Ints
    component: Ints
    component_volumes: Floats
    diagonal: float
    dimension: int
    normal: Floats
    closed: bool
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
        """Number of face components over welded edges."""
        return len(self.component_volumes)

    @property
    def flat(self) -> bool:
        """All points lie in a plane, but not on a line."""
        return self.dimension == 2

    @property
    def solid(self) -> bool:
        """Closed, and wound so that `faces` tells inside from outside."""
        return self.closed and self.oriented

    @property
    def volume(self) -> float:
        """Enclosed volume; 0 unless `solid`. Components that overlap count once each."""
        return float(self.component_volumes.sum()) if self.solid else 0.0

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
    clean = cleaned(points, np.searchsorted(used, mesh.faces), tolerance, dimension)
    faces, turned = clean.faces, np.zeros(len(clean.faces), dtype=np.bool_)
    consistent = oriented = wound_alike(clean.deciding)
    if not consistent:
        wrong = disagreeing(clean.edges)
        oriented = wrong is not None
        if wrong is not None:
            turned, faces = wrong, np.where(wrong[:, None], faces[:, ::-1], faces)

    component = face_components(clean.edges)
    volumes = np.bincount(component, face_volumes(points, faces) / 6.0).astype(np.float64)
    signed_volume = float(volumes.sum())
    if clean.closed and oriented:
        flipped = inside_out(points, faces, component, volumes, work or Work())
    else:
        flipped = np.zeros(len(volumes), dtype=np.bool_)
    turned = turned ^ flipped[component]
    faces = np.where(flipped[component, None], faces[:, ::-1], faces)
    volumes = np.where(flipped, -volumes, volumes)
    left, faces = np.unique(faces, return_inverse=True)
    vertices, faces = points[left], faces.reshape(-1, 3).astype(np.int64)
    single = clean.closed and len(volumes) == 1
    most = max(concave, tolerance)
    inside = concavity(vertices, faces, most, clean.edges.turned(turned), work) if single else math.inf
    convex = inside <= most
    for array in (vertices, faces, clean.source, component, volumes, normal):
        array.setflags(write=False)
    return Analysis(
        vertices=vertices,
        faces=faces,
        source=clean.source,
        component=component,
        component_volumes=volumes,
        diagonal=diagonal,
        dimension=dimension if len(faces) else min(dimension, 1),
        normal=normal,
        closed=clean.closed,
        consistent=consistent,
        oriented=oriented,
        inverted=consistent and bool(flipped.any()),
        convex=convex,
        concavity=inside,
        box=exact_box(vertices, faces, tolerance) if convex else None,
        area=float(face_areas(vertices, faces).sum()),
        signed_volume=signed_volume,
        degenerate_faces=clean.degenerate,
        duplicate_faces=clean.duplicates,
        unused_vertices=len(mesh.vertices) - len(used),
        open_edges=int((clean.deciding.faces % 2 == 1).sum()),
        crowded_edges=int((clean.deciding.faces > 2).sum()),
    )


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
        message = f"the surface is open: {analysis.open_edges} edges border an odd number of triangles"
        warn("GEO232", message, "it collides as a sheet: a body wholly inside it does not count as touching")
    # A sheet has no outside, so that its winding says nothing.
    if not analysis.consistent and not analysis.flat:
        done = "faces were turned round to agree" if analysis.oriented else "no side is known to be outside"
        warn("GEO234", f"neighbouring faces are wound opposite ways; {done}")
    elif analysis.inverted:
        warn("GEO233", f"wound inside out (volume {analysis.signed_volume:.6g}); the faces were turned round")
    if analysis.crowded_edges:
        note("GEO239", f"{analysis.crowded_edges} edges have more than two faces")
    if analysis.components > 1:
        note("GEO237", f"the mesh is in {analysis.components} pieces")
    if analysis.unused_vertices:
        note("GEO238", f"{analysis.unused_vertices} vertices are used by no face")


def refuse_without_area(analysis: Analysis, log: DiagnosticLog, subject: str, span: Span | None = None) -> None:
    """Raise GEO231: a point or a line cannot collide.

    Raises:
        GeometryError: Always.
    """
    what = ("a point", "a line")[min(analysis.dimension, 1)]
    message = "the mesh has no area" + (f": its faces collapse to {what}" if analysis.diagonal else "")
    hint = "a body needs a surface to collide; give it triangles, or leave the body out"
    log.fail("GEO231", subject, message, hint=hint, span=span)
