"""Compiles an assembled scene into one MJCF document and its assets, and says what has no meaning there."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from itertools import islice

from lxml import etree

from ..diagnostics import DiagnosticLog
from ..geometry.assembly import Assembly
from ..kinematics.space import ConfigurationSpace
from ..model.environment import Environment, Task
from ..model.names import file_stem
from ..options import Options
from ..pairs import PairTable
from ..system.imports import installed_version
from ..transforms import Array
from .actuators import Drive, add_actuators, add_sensors, drives
from .dense_contacts import report_contacts
from .geoms import add_contacts, excluded_obstacles
from .links import Compilation, add_obstacles, add_robot
from .loops import CLOSED, add_loops
from .markup import Element, add, comment_text, number, numbers, plain, to_text
from .scenery import (
    add_ground_material,
    add_scenery,
    add_settings,
    add_sky,
    gravity_of_file,
    integrator,
    time_step,
    wall_speed,
)


@dataclass(frozen=True, slots=True)
class Document:
    """A compiled scene.

    Attributes:
        name: Name of the model, fit for a file.
        xml: The MJCF text.
        assets: Contents of the files it refers to, by path relative to it.
        owners: Name of the body that each collision geom belongs to.
        wall_speed: Speed, m/s, up to which walls hold what moves in simulation; None where nothing can touch.
    """

    name: str
    xml: str
    assets: dict[str, bytes]
    owners: dict[str, str]
    wall_speed: float | None


def compile_mjcf(
    assembly: Assembly, space: ConfigurationSpace, pairs: PairTable, options: Options, log: DiagnosticLog
) -> Document:
    """Compile a scene; equal input gives equal bytes."""
    environment = assembly.environment
    keys = _keys(space, environment.tasks)
    step = time_step(assembly, options.acceleration(gravity_of_file(environment)))
    speed = wall_speed(assembly, pairs, step)
    driven: dict[str, Drive] = {}
    if options.actuators is not None:
        driven = drives(assembly.robots, space, list(keys.values()), CLOSED * assembly.extent, step, log)
    damped = {} if options.actuators == "motor" else {name: d.damping for name, d in driven.items()}
    compilation = Compilation(assembly, space, options, excluded_obstacles(pairs), damped)
    compilation.assets.plan([p.mesh for p in assembly.parts()])
    root = etree.Element("mujoco", model=plain(environment.name))
    chosen = integrator(assembly, damped=bool(damped))
    add_settings(root, assembly, pairs, options, step, speed, chosen)
    asset = add(root, "asset")
    add_sky(asset)
    world = add(root, "worldbody")
    add_scenery(world, assembly, options, _lowest(assembly, space, keys.values()) if options.ground else 0.0)
    add_obstacles(world, compilation)
    for robot in range(len(assembly.robots)):
        add_robot(world, robot, compilation)
    if options.ground:
        add_ground_material(asset)
    compilation.assets.write(asset)
    add_contacts(root, pairs, compilation.owners)
    add_loops(root, compilation, log)
    if options.actuators is not None:
        add_actuators(root, driven, options.actuators)
    if options.sensors:
        add_sensors(root, space)
    _report_unused(assembly, options, log)
    report_contacts(assembly, pairs, step, 4 if chosen == "RK4" else 1, log)
    _add_keyframes(root, space, keys, driven if options.actuators == "position" else {})
    text = to_text(root)
    return Document(
        file_stem(environment.name),
        f"{_header(assembly, options)}\n{text}",
        compilation.assets.files,
        compilation.owners,
        speed,
    )


def _header(assembly: Assembly, options: Options) -> str:
    environment = assembly.environment
    lines = [
        f"Converted by env2mjcf {installed_version() or 'unknown'} from {environment.name}: "
        f"dialect {environment.dialect}, {environment.semantics} semantics, collision {options.collision}.",
        f"Units: metres (file unit x {options.scale:g}), kilograms, radians. Extent {assembly.extent:.6g} m.",
        f"Verdicts are certain beyond {assembly.band:.2g} m of contact, {assembly.band / assembly.extent:.2g} of it.",
    ]
    if any(assembly.origin):
        place = ", ".join(map(number, assembly.origin))
        lines.append(f"The origin lies at ({place}) m in the frame of {environment.name}.")
    seen: set[str] = set()
    for part in assembly.parts():
        if part.shape is not None and part.mesh.digest not in seen:
            seen.add(part.mesh.digest)
            lines.append(f"{part.body.filename}: {part.shape.note}")
            if part.certificate is not None:
                lines.append(f"  {part.certificate}")
    return f"<!--{comment_text(lines)}-->"


def _keys(space: ConfigurationSpace, tasks: tuple[Task, ...]) -> dict[str, Array]:
    """Return the configurations, (dim,), of `home`, and of `start` and `goal` where there is a task."""
    keys = {"home": space.home}
    for q in islice(space.of_tasks(tasks), 1):
        keys |= {"start": q[0], "goal": q[-1]}
    return keys


def _add_keyframes(root: Element, space: ConfigurationSpace, keys: Mapping[str, Array], held: Collection[str]) -> None:
    """Append the keys; actuators of position hold the joints `held` where they are."""
    if not space.nq:
        return
    keyframe = add(root, "keyframe")
    joints = [s for slots in space.slots for s in slots if not s.free]
    for name, q in keys.items():
        qpos = space.qpos(q)
        ctrl = [qpos[s.address] for joint in held for s in joints if space.names[s.columns[0]] == joint]
        add(keyframe, "key", name=name, qpos=numbers(qpos), ctrl=numbers(ctrl) if ctrl else None)


def _lowest(assembly: Assembly, space: ConfigurationSpace, keys: Iterable[Array]) -> float:
    """Return the lowest height of any vertex at any key."""
    heights = [float(assembly.lower[2])]
    for q in keys:
        for robot, columns in zip(assembly.robots, space.robot_slices, strict=True):
            for part, pose in zip(robot.links, robot.kinematics.forward(q[columns]), strict=True):
                heights.append(float((part.used_vertices @ pose[2, :3]).min() + pose[2, 3]))
    return min(heights)


def _report_unused(assembly: Assembly, options: Options, log: DiagnosticLog) -> None:
    """Report textures, controls and physical attributes, which are kept and not written, and options without effect."""
    environment = assembly.environment
    if options.boundary is not None and environment.boundary is None:
        log.info("MJC415", environment.name, f"boundary={options.boundary!r} has no effect: the scene has no boundary")
    x, y, z = options.acceleration(gravity_of_file(environment))
    if options.ground and (z > 0 or max(abs(x), abs(y)) > abs(z)):
        message = f"gravity ({x:g}, {y:g}, {z:g}) does not pull to the ground, which lies below in z"
        log.warn(
            "MJC418", environment.name, message, hint="turn gravity, or build walls: boundary='solid' (--boundary)"
        )
    if options.primitives and not any(p.shape is not None and p.shape.box is not None for p in assembly.parts()):
        why, hint = "no body that collides is an exact box", ""
        if options.collision == "surface":
            why = "with collision='surface' surfaces collide, and a box geom is solid"
            hint = "collision='auto' collides solids"
        log.info("MJC416", environment.name, f"primitives=True has no effect: {why}", hint=hint)
    _report_gravity(environment, options, log)
    friction = dict(environment.attributes).get("frictionCoefficient")
    if friction is not None:
        message = f"frictionCoefficient={friction!r} of the file is the planner's, and is not written"
        log.info("MJC412", "frictionCoefficient", message)
    for multibody in environment.multibodies:
        if multibody.controls or multibody.velocity_bounds:
            message = f"{len(multibody.controls)} controls and the velocity bounds of the robot are kept, not written"
            log.info("MJC413", "NonHolonomic", message, span=multibody.span)
        for body in multibody.bodies:
            if body.texture is not None:
                log.info("MJC414", body.filename, f"texture {body.texture!r} is kept, not drawn", span=body.span)


def _report_gravity(environment: Environment, options: Options, log: DiagnosticLog) -> None:
    """Say why the file's gravity is not used, where it is not."""
    text, vector = dict(environment.attributes).get("gravity"), gravity_of_file(environment)
    if text is None:
        return
    what, used = f"gravity={text!r} of the file", " ".join(f"{g:g}" for g in options.acceleration(vector))
    hint = "give gravity=(x, y, z) (--gravity)"
    if vector is None:
        message = f"{what} is not three finite numbers, and not used; the MJCF has {used}"
        log.warn("MJC412", "gravity", message, hint=hint)
    elif options.gravity is not None:
        log.info("MJC412", "gravity", f"{what} is overruled by the option; the MJCF has {used}")
    elif not any(vector):
        message = f"{what}, the planner's default, is not taken for weightlessness; the MJCF has {used}"
        log.info("MJC412", "gravity", message, hint="give gravity=(0, 0, 0) (--gravity 0 0 0) if it is meant")
