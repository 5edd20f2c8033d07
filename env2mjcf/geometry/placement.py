"""Where bodies stand at home, how far that reaches, and the local origin of scenes that are far from the file's."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..diagnostics import DiagnosticLog
from ..kinematics.forward import RobotKinematics
from ..limits import LARGEST
from ..model.environment import Body, Environment
from ..transforms import Array
from .mesh import FAR, Mesh, round_point

# Numbers may be off by a tenth of the band of 1e-5 of the extent in which verdicts may differ from the triangles.
_ROUNDING_PER_EXTENT = 1e-6

# Of meshes, whose numbers are what verdicts are about: the band itself.
_MESH_ROUNDING_PER_EXTENT = 1e-5

# Formats that trimesh reads, in which coordinates are single precision.
_SINGLE = (".stl", ".ply", ".glb")

# Extents in metres beyond which the unit of a file is doubtful.
_PLAUSIBLE_EXTENT = (1e-3, 1e4)

Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A body whose place is known and whose collision shape is not; see `assembly.Part`."""

    name: str
    body: Body
    pose: Array
    mesh: Mesh


@dataclass(frozen=True, slots=True, eq=False)
class AtHome:
    """A multibody at home."""

    kinematics: RobotKinematics
    home: Array
    bodies: tuple[Placed, ...]

    def about(self, origin: Point) -> AtHome:
        """Return the same with poses about a point of the file's frame."""
        kinematics = replace(self.kinematics, origin=origin)
        # `bounding_box` finds what overflows.
        with np.errstate(over="ignore", invalid="ignore"):
            poses = kinematics.forward(self.home)
        return AtHome(kinematics, self.home, tuple(replace(b, pose=p) for b, p in zip(self.bodies, poses, strict=True)))


def bounding_box(multibodies: Sequence[AtHome], log: DiagnosticLog) -> tuple[Array, Array, tuple[AtHome, ...]]:
    """Return the corners of the box around all bodies, and the robots that do not count in it by their place.

    A robot whose bases travel, and that is at home a thousand times farther from all that cannot than either is large,
    counts as if it stood in the middle of that: the files of dialects B to E say where obstacles are, and nothing of
    where such a robot belongs. The unit cube for no bodies.
    """
    if not any(m.bodies for m in multibodies):
        return np.full(3, -0.5), np.full(3, 0.5), ()
    boxes = [_box(m, log) for m in multibodies]
    standing = [box for m, box in zip(multibodies, boxes, strict=True) if m.bodies and not m.kinematics.travels]
    if not standing:
        return *_around([box for m, box in zip(multibodies, boxes, strict=True) if m.bodies]), ()
    lower, upper = _around(standing)
    counted, away = [np.stack([lower, upper])], list[AtHome]()
    for multibody, box in zip(multibodies, boxes, strict=True):
        if not multibody.kinematics.travels:
            continue
        size = np.maximum(_diagonal(box), _diagonal(counted[0]))
        if np.linalg.norm(np.maximum(0, np.maximum(box[0] - upper, lower - box[1]))) > FAR * size:
            away.append(multibody)
            counted.append((lower + upper) / 2 + np.array([[-0.5], [0.5]]) * (box[1] - box[0]))
        else:
            counted.append(box)
    return *_around(counted), tuple(away)


def _around(boxes: Sequence[Array]) -> tuple[Array, Array]:
    stacked = np.concatenate(boxes)
    return stacked.min(axis=0), stacked.max(axis=0)


def _diagonal(box: Array) -> float:
    return float(np.linalg.norm(box[1] - box[0]))


def _box(multibody: AtHome, log: DiagnosticLog) -> Array:
    """Return the corners, (2, 3), of the box around the vertices that the faces of a multibody use."""
    corners: list[Array] = []
    for b in multibody.bodies:
        with np.errstate(over="ignore", invalid="ignore"):
            place = b.pose[:3, :3] @ b.mesh.center + b.pose[:3, 3]
            world = b.mesh.used_vertices @ b.pose[:3, :3].T + place
        farthest = float(np.abs(world).max())
        # Not a number compares as false.
        if not farthest <= LARGEST:
            message = (
                f"{b.name} reaches {farthest:.3g} m from the origin at home; at most {LARGEST:g} can be computed with"
            )
            hint = "correct its pose, or the connections that lead to it"
            log.fail("GEO252", b.name, message, hint=hint, span=b.body.span)
        corners += [world.min(axis=0), world.max(axis=0)]
    return np.stack([np.min(corners, axis=0), np.max(corners, axis=0)]) if corners else np.zeros((2, 3))


def local_origin(lower: Array, upper: Array) -> Point:
    """Return a round point amid a box that is more than a thousand of its diagonals from the origin; else the origin.

    Nearer than that, rounding of doubles is below 1e-13 of the extent, which counts as no distance anywhere, and that
    of the floats that MuJoCo draws with is below a tenth of a pixel.
    """
    return round_point((lower + upper) / 2, _diagonal(np.stack([lower, upper])), lower, upper)


def report_frame(
    environment: Environment,
    multibodies: Sequence[AtHome],
    away: Sequence[AtHome],
    box: tuple[Array, Array],
    origin: Point,
    given: bool,
    log: DiagnosticLog,
) -> None:
    """Report a scene of odd size or place; `multibodies` and `box` are about `origin`.

    Raises:
        GeometryError: The scene is so far away that doubles do not tell apart what verdicts must.
    """
    extent = _diagonal(np.stack(box))
    low, high = _PLAUSIBLE_EXTENT
    if not low <= extent <= high:
        message = f"the scene measures {extent:.3g} m across: is its unit a metre?"
        log.info("GEO251", environment.name, message, hint="give the metres per file unit with scale= (--scale)")
    if any(origin) and not given:
        there = ", ".join(f"{x:g}" if abs(x) < 1e6 else f"{x:.15g}" for x in origin)
        message = (
            f"the scene is {math.hypot(*origin):.4g} m from the file's origin and measures {extent:.3g} m: that of the "
            f"MJCF lies at ({there})"
        )
        hint = "q and all poses stay in the file's frame; origin=(0, 0, 0) (--origin 0 0 0) keeps it in the MJCF, too"
        log.info("GEO253", environment.name, message, hint=hint)
    for robot in away:
        first = robot.bodies[0]
        message = f"{first.name} is at home {_gap(robot, box):.4g} m from all else: its size counts, not its place"
        log.info("KIN314", first.name, message, span=first.body.span)
    farthest = max(float(np.abs(corner + shift).max()) for corner in box for shift in (0.0, np.array(origin)))
    _check_rounding(environment.name, "the scene", farthest, extent, log)
    for placed in (b for m in multibodies for b in m.bodies):
        name, far = placed.body.filename, float(np.abs(placed.mesh.center).max())
        _check_rounding(name, "its vertices", far, extent, log)
        _report_single(placed, extent, log)


def _gap(robot: AtHome, box: tuple[Array, Array]) -> float:
    place = robot.bodies[0].pose[:3, 3]
    return float(np.linalg.norm(place - np.clip(place, *box)))


def _check_rounding(subject: str, what: str, farthest: float, extent: float, log: DiagnosticLog) -> None:
    rounding, most = float(np.spacing(farthest)), _ROUNDING_PER_EXTENT * extent
    if rounding > most:
        message = (
            f"{what} reaches {farthest:.4g} m from the origin, where numbers are {rounding:.2g} m apart; verdicts on "
            f"{extent:.3g} m need {most:.2g} m"
        )
        log.fail("GEO254", subject, message, hint="move it nearer to the origin of its file")


def _report_single(placed: Placed, extent: float, log: DiagnosticLog) -> None:
    """Report a mesh whose file has rounded its numbers more than verdicts may be off."""
    mesh, body = placed.mesh, placed.body
    if mesh.path.suffix.lower() not in _SINGLE or mesh.rounding <= _MESH_ROUNDING_PER_EXTENT * extent:
        return
    message = (
        f"its coordinates are single precision, {mesh.rounding:.2g} m apart, in a scene of {extent:.3g} m: verdicts "
        "are about what the file says, which may be far from what was meant"
    )
    log.warn("GEO255", body.filename, message, hint="save it about an origin nearby", span=body.span)
