"""The way from a file to a compiled scene: read, scale, assemble, choose pairs, compile. No MuJoCo."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .diagnostics import DiagnosticLog
from .errors import Diagnostic
from .formats.reading import read_scene
from .geometry.assembly import Assembly, assemble
from .kinematics.space import ConfigurationSpace
from .kinematics.tree import dof_names
from .limits import Limits
from .mjcf.compiler import Document, compile_mjcf
from .mjcf.links import refuse_long_chains
from .model.environment import Environment
from .model.scaling import scaled
from .options import Options, PathArgument
from .pairs import PairTable, Robot, pair_table
from .transforms import Array


@dataclass(frozen=True, slots=True)
class Compiled:
    """A scene at the end of the pipeline.

    Attributes:
        environment: The scene in the words, and units, of its files.
        assembly: The scene in metres, with geometry.
        space: Its configuration space.
        pairs: Which bodies are tested against each other.
        document: Its MJCF.
        options: The options that it was compiled with.
        diagnostics: What all stages found.
    """

    environment: Environment
    assembly: Assembly
    space: ConfigurationSpace
    pairs: PairTable
    document: Document
    options: Options
    diagnostics: tuple[Diagnostic, ...]


def compile_scene(source: PathArgument | Environment, options: Options, log: DiagnosticLog) -> Compiled:
    """Take a file, or what was read from it with the same log, through the whole pipeline."""
    environment = source if isinstance(source, Environment) else read_scene(source, options, log)
    # What counting is enough for is refused before the work on the geometry.
    _check_pairs(environment, options, log)
    refuse_long_chains(environment, log)
    assembly = assemble(scaled(environment, options.scale), options, log)
    return compile_assembly(environment, assembly, options, log)


def compile_assembly(environment: Environment, assembly: Assembly, options: Options, log: DiagnosticLog) -> Compiled:
    """Take an assembled scene through the rest of the pipeline.

    Raises:
        ValueError: `exclude_pairs` names an unknown body.
    """
    space = configuration_space(assembly, options)
    robots = [Robot(r.kinematics, r.names) for r in assembly.robots]
    obstacles = [p.name for p in assembly.obstacles]
    pairs = pair_table(robots, obstacles, options, environment.planner_rules)
    document = compile_mjcf(assembly, space, pairs, options, log)
    return Compiled(environment, assembly, space, pairs, document, options, tuple(log))


def _check_pairs(environment: Environment, options: Options, log: DiagnosticLog) -> None:
    links, obstacles = (sum(len(m.bodies) for m in group) for group in (environment.robots, environment.obstacles))
    count, at_most = links * obstacles + links * (links - 1) // 2, options.limits.pairs
    if count > at_most:
        message = (
            f"{links} links and {obstacles} obstacles make {count} pairs of bodies; {at_most} at most are compared"
        )
        log.fail("GEO275", environment.name, message, hint=Limits.hint("pairs"))


def recompile(compiled: Compiled, exclude: Sequence[tuple[str, str]], log: DiagnosticLog) -> Compiled:
    """Compile a scene again with more pairs excluded."""
    options = dataclasses.replace(compiled.options, exclude_pairs=(*compiled.options.exclude_pairs, *exclude))
    return compile_assembly(compiled.environment, compiled.assembly, options, log)


def configuration_space(assembly: Assembly, options: Options) -> ConfigurationSpace:
    """Build the configuration space of an assembled scene."""
    return ConfigurationSpace(
        [r.kinematics for r in assembly.robots],
        [n for r in assembly.robots for n in dof_names(r.names, r.kinematics.dofs)],
        [r.home for r in assembly.robots],
        assembly.environment.boundary,
        options.scale,
        _sample_box(assembly),
        assembly.origin,
    )


def _sample_box(assembly: Assembly) -> tuple[Array, Array]:
    """Return the obstacles' box, in the file's frame, grown by the greatest robot radius.

    Twice that radius without obstacles.
    """
    radius = max((r.radius for r in assembly.robots), default=0.0)
    if not assembly.obstacles:
        return np.full(3, -2 * radius), np.full(3, 2 * radius)
    poses = [(p.mesh.vertices, p.mesh_pose) for p in assembly.obstacles]
    corners = np.concatenate([v @ pose[:3, :3].T + pose[:3, 3] for v, pose in poses])
    return corners.min(axis=0) - radius + assembly.origin, corners.max(axis=0) + radius + assembly.origin
