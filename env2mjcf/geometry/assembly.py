"""Puts bodies, meshes, collision shapes and inertias together: all that the MJCF stage needs to know."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..diagnostics import DiagnosticLog
from ..kinematics.forward import RobotKinematics
from ..limits import Limits, Work, bounded
from ..model.environment import Body, Boundary, Environment, JointType, Recentring
from ..model.names import body_names
from ..model.scaling import moved_boundary
from ..options import Options
from ..transforms import Array, shifted
from .analysis import Analysis
from .certificate import Certificate, certificate
from .inertia import Inertial, inertial
from .mesh import Mesh, load_mesh
from .pieces import LEAST_AREA
from .placement import AtHome, Placed, Point, bounding_box, local_origin, report_frame
from .repair import repair_diagnostics, repaired
from .resolve import resolve_all
from .shapes import CONCAVE_PER_THICKNESS, CollisionShape, collision_shape
from .store import GeometryCache, default_folder
from .union import Union, union, union_diagnostics

# Half of the band of 1e-5 of the extent in which verdicts may differ from the triangles.
_THICKNESS_PER_EXTENT = 5e-6


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """One body with its geometry.

    Attributes:
        name: Unique name.
        body: Its description.
        pose: (4, 4) pose of the body at home, about the scene's origin.
        mesh: Recentred and scaled, in the body's frame but for its `center`.
        analysis: What the mesh is like.
        shape: Convex pieces for contact; None for a Surface body.
        inertial: Mass, centre and moments; None for a static body.
        certificate: How far `shape` is from the mesh; None without one.
    """

    name: str
    body: Body
    pose: Array
    mesh: Mesh
    analysis: Analysis
    shape: CollisionShape | None
    inertial: Inertial | None
    certificate: Certificate | None = None

    @property
    def radius(self) -> float:
        """Greatest distance of a vertex from the body's origin."""
        return float(np.linalg.norm(self.mesh.vertices + self.mesh.center, axis=1).max())

    @property
    def used_vertices(self) -> Array:
        """The vertices that faces use, (k, 3), in the body's frame."""
        return self.mesh.used_vertices + self.mesh.center

    @property
    def mesh_pose(self) -> Array:
        """The pose of the mesh's own frame, (4, 4): that of the body, but for the mesh's `center`."""
        return shifted(self.pose, self.mesh.center)


@dataclass(frozen=True, slots=True, eq=False)
class RobotParts:
    """A robot with its geometry.

    Attributes:
        kinematics: What moves it.
        home: (dim,) its configuration at home.
        links: Its bodies in file order.
    """

    kinematics: RobotKinematics
    home: Array
    links: tuple[Part, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its bodies in file order."""
        return tuple(p.name for p in self.links)

    @property
    def radius(self) -> float:
        """The planner's bounding radius r_0 + 2 sum r_i, where body i has its vertices within r_i of its origin."""
        radii = [p.radius for p in self.links]
        return radii[0] + 2 * sum(radii[1:])


@dataclass(frozen=True, slots=True, eq=False)
class Assembly:
    """A scene in metres and radians, with geometry.

    Attributes:
        environment: The scene, scaled to metres.
        robots: In the order of `environment.robots`.
        obstacles: Bodies that links are tested against, in file order.
        surfaces: Bodies that are only drawn.
        lower, upper: (3,) corners of the bounding box of all bodies at home, about `origin`. The boundary is not
            counted, nor the place of a robot that travels and is at home far from all else: see `bounding_box`.
        origin: Where the origin of poses lies in the file's frame, in metres. Configurations are in the file's frame.
    """

    environment: Environment
    robots: tuple[RobotParts, ...]
    obstacles: tuple[Part, ...]
    surfaces: tuple[Part, ...]
    lower: Array
    upper: Array
    origin: Point = (0.0, 0.0, 0.0)

    @property
    def boundary(self) -> Boundary | None:
        """The boundary about `origin`."""
        boundary = self.environment.boundary
        return None if boundary is None else moved_boundary(boundary, self.origin)

    @property
    def extent(self) -> float:
        """Diagonal of the bounding box: the unit of every tolerance."""
        return float(np.linalg.norm(self.upper - self.lower))

    @property
    def band(self) -> float:
        """Clearance or depth, in metres, beyond which verdicts are certain: both bodies of a pair may be off."""
        return 2 * max((p.certificate.band for p in self.parts() if p.certificate is not None), default=0.0)

    @property
    def links(self) -> tuple[Part, ...]:
        """The bodies of all robots, in file order."""
        return tuple(p for r in self.robots for p in r.links)

    def parts(self) -> tuple[Part, ...]:
        """Return all bodies: robots, obstacles, surfaces."""
        return (*self.links, *self.obstacles, *self.surfaces)


def assemble(environment: Environment, options: Options, log: DiagnosticLog) -> Assembly:
    """Load every mesh of a scene and give each body its geometry.

    Args:
        environment: The scene, scaled to metres.
        options: `collision`, `density`, `scale` and the folders are used.
        log: Where findings go.

    Raises:
        GeometryError: Meshes are missing or unusable; one error names all the missing ones.
        KinematicsError: The bodies of a robot do not hang together.
        ConversionError: A joint cannot be expressed in MuJoCo.
    """
    _refuse_sma(environment, log)
    meshes = _Meshes(environment, options, log)
    names = body_names(environment)
    active, drawn = ({id(m) for m in group} for group in (environment.robots, environment.surfaces))
    origin: Point = options.origin or (0.0, 0.0, 0.0)
    placed: list[AtHome] = []
    for i, multibody in enumerate(environment.multibodies):
        # How robots hang together was judged when they were read.
        kinematics = RobotKinematics.of(multibody, None if id(multibody) in active else log)
        bodies = [Placed(n, b, np.eye(4), meshes.mesh(b)) for n, b in zip(names[i], multibody.bodies, strict=True)]
        placed.append(AtHome(kinematics, kinematics.home(log), tuple(bodies)).about(origin))
    lower, upper, away = bounding_box(placed, log)
    if options.origin is None and any(origin := local_origin(lower, upper)):
        placed = [m.about(origin) for m in placed]
        lower, upper, away = bounding_box(placed, log)
    report_frame(environment, placed, away, (lower, upper), origin, options.origin is not None, log)
    thickness = _THICKNESS_PER_EXTENT * float(np.linalg.norm(upper - lower))
    robots: dict[int, RobotParts] = {}
    obstacles: list[Part] = []
    surfaces: list[Part] = []
    for multibody in placed:
        key, bodies = id(multibody.kinematics.multibody), multibody.bodies
        if key in active:
            links = tuple(meshes.part(b, thickness, moves=True) for b in bodies)
            robots[key] = RobotParts(multibody.kinematics, multibody.home, links)
        elif key in drawn:
            surfaces += [meshes.part(b, thickness, moves=False, collides=False) for b in bodies]
        else:
            obstacles += [meshes.part(b, thickness, moves=False) for b in bodies]
    ordered = tuple(robots[id(m)] for m in environment.robots)
    return Assembly(environment, ordered, tuple(obstacles), tuple(surfaces), lower, upper, origin)


class _Meshes:
    """Loads each mesh file once, and shapes each mesh once."""

    def __init__(self, environment: Environment, options: Options, log: DiagnosticLog) -> None:
        self._options = options
        self._log = log
        self._cache = GeometryCache(default_folder()) if options.cache else None
        self._paths = resolve_all(environment, options, log)
        self._raw: dict[Path, Mesh] = {}
        self._meshes: dict[tuple[Path, Recentring], Mesh] = {}
        self._analyses: dict[Mesh, tuple[Analysis, Work]] = {}
        self._unions: dict[Mesh, Union] = {}
        self._shapes: dict[Mesh, tuple[CollisionShape, Certificate]] = {}
        self._elements = 0
        self._cells = 0

    def mesh(self, body: Body) -> Mesh:
        """Return a body's mesh, recentred and scaled."""
        path = self._paths[body.filename]
        key = (path, body.recentring)
        if key not in self._meshes:
            if path not in self._raw:
                self._raw[path] = load_mesh(path, self._log, self._options.limits)
            self._meshes[key] = self._raw[path].recentred(body.recentring).scaled(self._options.scale).centred()
        self._elements += len(self._meshes[key].faces)
        self._at_most("scene_elements", self._elements, "GEO271", "triangles", body)
        return self._meshes[key]

    def part(self, placed: Placed, thickness: float, *, moves: bool, collides: bool = True) -> Part:
        """Give a placed body its shape (where it collides) and its inertia (where it moves)."""
        mesh, body, options = placed.mesh, placed.body, self._options
        if mesh not in self._analyses:
            work = Work(options.limits.mesh_work)
            with bounded(options.limits, self._log, body.filename, body.span):
                result = repaired(mesh, work, CONCAVE_PER_THICKNESS * thickness)
            self._analyses[mesh] = result.analysis, work
            repair_diagnostics(mesh, result, self._log, body.filename, body.span)
        analysis, work = self._analyses[mesh]
        if 0 < analysis.area < LEAST_AREA:
            message = f"its area of {analysis.area:.3g} m^2 is below {LEAST_AREA:g}, the least of a mesh in MuJoCo"
            hint = "enlarge the scene with scale= (--scale)"
            self._log.fail("GEO241", body.filename, message, hint=hint, span=body.span)
        shape = proof = None
        if collides:
            if mesh not in self._shapes:
                self._shapes[mesh] = self._shaped(mesh, analysis, thickness, body, work)
            shape, proof = self._shapes[mesh]
            self._cells += len(shape.pieces)
            self._at_most("scene_cells", self._cells, "GEO272", "convex pieces", body)
        inertia = inertial(mesh, analysis, options.density, body.mass, self._union(mesh, body)) if moves else None
        if inertia is not None and any(mesh.center):
            inertia = replace(inertia, com=inertia.com + mesh.center)
        if inertia is not None and inertia.note:
            self._log.info("GEO250", placed.name, f"inertia of {placed.name}: {inertia.note}", span=body.span)
        return Part(placed.name, body, placed.pose, mesh, analysis, shape, inertia, proof)

    def _union(self, mesh: Mesh, body: Body) -> Union:
        """Return what a moving body's mesh fills."""
        if mesh not in self._unions:
            with bounded(self._options.limits, self._log, body.filename, body.span):
                self._unions[mesh] = union(*self._analyses[mesh])
            union_diagnostics(self._unions[mesh], self._log, body.filename, body.span)
        return self._unions[mesh]

    def _at_most(self, limit: str, count: int, code: str, what: str, body: Body) -> None:
        most = getattr(self._options.limits, limit)
        if count > most:
            message = f"the bodies up to this one have more than {most} {what} in all, which is the limit"
            self._log.fail(code, body.filename, message, hint=Limits.hint(limit), span=body.span)

    def _shaped(
        self, mesh: Mesh, analysis: Analysis, thickness: float, body: Body, work: Work
    ) -> tuple[CollisionShape, Certificate]:
        strategy, log, cache = self._options.collision, self._log, self._cache
        with bounded(self._options.limits, log, body.filename, body.span):
            shape = collision_shape(mesh, analysis, strategy, thickness, log, body.filename, body.span, cache, work)
        proof = certificate(shape, thickness, cache, log)
        if shape.strategy == "coacd":
            hint = "collision='auto' collides the true shape"
            log.info("GEO263", body.filename, f"{shape.note}: {proof}", hint=hint, span=body.span)
        return shape, proof


def _refuse_sma(environment: Environment, log: DiagnosticLog) -> None:
    for multibody in environment.multibodies:
        for connection in multibody.connections:
            if connection.joint is JointType.SMA:
                message = (
                    "an SMAJoint bends along its length, which no MuJoCo joint does: "
                    "the scene reads, but does not convert"
                )
                log.fail("KIN320", "SMAJoint", message, hint="replace it by Revolute joints", span=connection.span)
