"""All that surrounds the bodies: options, defaults, light, camera, ground, and the boundary as wires or walls."""

from __future__ import annotations

import itertools
import math

import numpy as np

from ..geometry.assembly import Assembly, Part
from ..limits import LARGEST
from ..model.environment import Boundary, Environment
from ..options import Options
from ..pairs import PairTable
from ..transforms import Array
from .dense_contacts import memory
from .joints import STANDARD_GRAVITY
from .markup import ASSET_FOLDER, Element, add, comment, number, numbers

OVERVIEW = (0.55, -1.0, 0.75)
"""Where the camera `overview` stands, seen from the scene: in front, to the right and above."""


def gravity_of_file(environment: Environment) -> tuple[float, float, float] | None:
    """Return the gravity that an XML file gives, in its own units of length; None unless it is three numbers.

    What is too large to be computed with counts as none.
    """
    try:
        x, y, z = (float(word) for word in dict(environment.attributes).get("gravity", "").split())
    except ValueError:
        return None
    return (x, y, z) if max(abs(x), abs(y), abs(z)) <= LARGEST and math.isfinite(x + y + z) else None


def time_step(assembly: Assembly, gravity: tuple[float, float, float]) -> float:
    """Return a time step in seconds that fits the thinnest link, rounded down to one digit.

    A seventieth of the time in which that link falls by its own thickness, between 0.1 and 2 ms: chains of thin links
    spin fast, and gained energy at twice that step.
    """
    thickness = min((_thickness(p) for p in assembly.links), default=1.0)
    g = math.hypot(*gravity) or STANDARD_GRAVITY
    step = math.sqrt(2 * thickness / g) / 70
    unit = 10.0 ** math.floor(math.log10(step))
    return min(max(float(f"{math.floor(step / unit) * unit:.0e}"), 1e-4), 2e-3)


def integrator(assembly: Assembly, *, damped: bool) -> str:
    """Return MuJoCo's name of the integrator: RK4 for joints without damping, which gain energy with any other."""
    jointed = any(not d.loop and d.connection is not None for r in assembly.robots for d in r.kinematics.dofs)
    return "RK4" if jointed and not damped else "implicitfast"


def wall_speed(assembly: Assembly, pairs: PairTable, step: float) -> float | None:
    """Return the speed, m/s, up to which walls hold what moves, however thin they are; None where nothing can touch.

    MuJoCo pushes a body out of a thin wall the short way: back, unless more than half of the body is beyond it. So no
    link may travel half its width in a step; a fifth less, because it takes more than one step to stop it.

    Args:
        assembly: The scene.
        pairs: Which bodies are tested.
        step: Time step, seconds.
    """
    names = {n for p in pairs.tested if not p.constant for n in (p.link, p.other)}
    widths = [_width(p) for p in assembly.links if p.name in names]
    return float(f"{0.8 * min(widths) / (2 * step):.2g}") if widths else None


def _width(part: Part) -> float:
    """Return the least extent of a mesh along its principal axes and along those of its frame."""
    used = part.mesh.used_vertices
    turned = used @ np.linalg.eigh(np.cov(used.T))[1]
    return float(np.minimum(np.ptp(used, axis=0), np.ptp(turned, axis=0)).min())


def _thickness(part: Part) -> float:
    """Return the least side of a mesh's box; sheets count as a twentieth of their diagonal."""
    used = part.mesh.used_vertices
    return max(float(np.min(np.ptp(used, axis=0))), part.mesh.diagonal / 20)


def add_settings(
    root: Element, assembly: Assembly, pairs: PairTable, options: Options, step: float, speed: float | None, chosen: str
) -> None:
    """Append compiler settings, options, statistics, visual settings and defaults.

    Args:
        root: What to append to.
        assembly: The scene.
        pairs: Which bodies are tested.
        options: Those of the conversion.
        step: Time step, seconds.
        speed: What `wall_speed` returns.
        chosen: The integrator.
    """
    add(root, "compiler", angle="radian", autolimits="true", meshdir=ASSET_FOLDER)
    gravity = options.acceleration(gravity_of_file(assembly.environment))
    why = (
        "RK4: undamped joints keep their energy to a thousandth in a minute; with the implicit ones they gain percents."
        if chosen == "RK4"
        else "implicitfast: it takes damping implicitly."
    )
    contact = float(f"{2.5 * step:.3g}")
    walls = [] if speed is None else [f"At that step walls hold what is no faster than {number(speed)} m/s."]
    comment(
        root,
        [
            "timestep: a seventieth of the time in which the thinnest link falls by its own thickness, at most 2 ms.",
            *walls,
            f"integrator: {why}",
            f"solref: contacts settle within {number(contact)} s, 2.5 steps: with MuJoCo's default of 0.02 s",
            "a fast body sinks deeper than thin walls are thick.",
            "filterparent is off: the excludes below are the whole filter.",
        ],
    )
    option = add(root, "option", timestep=number(step), gravity=numbers(gravity), integrator=chosen)
    if assembly.extent < 1:
        # MuJoCo's is absolute: a millionth of a metre, which is here one of the extent.
        option.set("ccd_tolerance", number(float(f"{1e-6 * assembly.extent:.0e}")))
    add(option, "flag", filterparent="disable")
    asked = memory(assembly, pairs)
    if asked:
        add(root, "size", memory=f"{asked >> 20}M")
    center = (assembly.lower + assembly.upper) / 2
    add(root, "statistic", center=numbers(center), extent=number(assembly.extent))
    visual = add(root, "visual")
    add(visual, "global", offwidth="1280", offheight="960")
    add(visual, "headlight", ambient="0.35 0.35 0.35", diffuse="0.4 0.4 0.4", specular="0 0 0")
    # The whole scene within the shadow's range, at a resolution that shows no stripes.
    add(visual, "quality", shadowsize="8192")
    add(visual, "map", znear="0.001", zfar="20", shadowclip="2")
    default = add(root, "default")
    # Thin cells have no volume to speak of; all masses are explicit.
    add(default, "mesh", inertia="shell")
    add(default, "geom", solref=f"{number(contact)} 1")
    # Loops give way with forces, as contacts do: stiff, so that it is less than 1e-4 of the extent where they swing.
    add(default, "equality", solref=f"{number(contact)} 1", solimp="0.99 0.9999 0.001")
    drawn = add(default, "default", class_="visual")
    add(drawn, "geom", type="mesh", group="2", contype="0", conaffinity="0", mass="0")
    collision = add(default, "default", class_="collision")
    add(collision, "geom", type="mesh", group="3", contype="1", conaffinity="3", mass="0", rgba="0.9 0.5 0.2 0.4")


def add_sky(asset: Element) -> None:
    """Append the sky behind the scene."""
    size = {"width": "256", "height": "1536"}
    colors = {"rgb1": "0.93 0.95 0.97", "rgb2": "0.72 0.80 0.88"}
    add(asset, "texture", name="sky", type="skybox", builtin="gradient", **colors, **size)


def add_ground_material(asset: Element) -> None:
    """Append the checkered material of the ground."""
    size = {"width": "256", "height": "256"}
    colors = {"rgb1": "0.86 0.87 0.88", "rgb2": "0.78 0.80 0.82"}
    add(asset, "texture", name="ground", type="2d", builtin="checker", **colors, **size)
    add(asset, "material", name="ground", texture="ground", texrepeat="8 8", reflectance="0.05")


def add_scenery(world: Element, assembly: Assembly, options: Options, lowest: float) -> None:
    """Append light, camera, and on request ground, below the height `lowest`, and boundary."""
    center, extent = (assembly.lower + assembly.upper) / 2, assembly.extent
    above = center + np.array([0, 0, extent])
    light = {"dir": "-0.3 0.4 -1", "diffuse": "0.5 0.5 0.5", "specular": "0.1 0.1 0.1"}
    add(world, "light", name="sun", type="directional", pos=numbers(above), **light)
    add(world, "camera", name="overview", **_camera(center, extent))
    if options.ground:
        # Slightly below the lowest point, so that nothing starts in contact with it.
        pos = numbers((center[0], center[1], lowest - 1e-3 * extent))
        size = numbers((extent, extent, extent / 20))
        add(world, "geom", name="ground", type="plane", material="ground", pos=pos, size=size)
    boundary = assembly.boundary
    if boundary is not None and options.boundary == "visual":
        add_wires(world, boundary, assembly)
    elif boundary is not None and options.boundary == "solid":
        add_walls(world, boundary, assembly)


def _camera(center: Array, extent: float) -> dict[str, str]:
    """Look at the whole scene from the front right and above."""
    back = np.array(OVERVIEW)
    back /= np.linalg.norm(back)
    right = np.cross((0, 0, 1), back)
    right /= np.linalg.norm(right)
    half_angle = math.radians(45 / 2)
    distance = 0.5 * extent / math.sin(half_angle) * 1.05
    axes = np.concatenate([right, np.cross(back, right)])
    return {"pos": numbers(center + distance * back), "xyaxes": numbers(axes), "fovy": "45"}


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
        line = {"fromto": numbers((a, b)), "size": number(radius), "rgba": _WIRE_COLOR}
        add(world, "geom", name=f"boundary:{i}", class_="visual", type="capsule", **line)


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
    size = numbers((assembly.extent, assembly.extent, assembly.extent / 20))
    for i, (point, normal) in enumerate(planes):
        plane = {"pos": numbers(point), "zaxis": numbers(normal), "size": size, "rgba": "0.5 0.5 0.5 0.1"}
        add(world, "geom", name=f"boundary:{i}", type="plane", group="4", **plane)


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
