"""A whole environment in another dialect."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePath

from ..diagnostics import DiagnosticLog
from ..errors import Diagnostic, robots_named
from ..formats.rows import tasks_alone
from ..model.environment import Boundary, Dialect, Environment, MultiBody, PlannerRules, Task
from .robots import DofMap, translate_obstacles, translate_robot
from .scene_parts import Losses, translated_boundary, translated_resolution


@dataclass(frozen=True, slots=True)
class Translation:
    """An environment in another dialect.

    Attributes:
        environment: What `env_text` and, in dialect E, `robot_text` write; tasks in the dialect's own numbers.
        notes: What the dialect cannot express, and what was done about it.
        robots: How configurations of each robot turn into those of its translation.
    """

    environment: Environment
    notes: tuple[Diagnostic, ...] = field(repr=False)
    robots: tuple[DofMap, ...]


def translate(
    environment: Environment, dialect: Dialect | str, *, strict: bool = False, boundary: Boundary | None = None
) -> Translation:
    """Say in another dialect what an environment means.

    The poses of all links are the same for every configuration, and so are limits, tested pairs and boundary; what the
    dialect lacks is left out with a note. What would move links if it were left out is refused.

    Args:
        environment: A scene as it was read.
        dialect: The dialect to turn it into; its own one only drops what that cannot express.
        strict: Whether anything that is lost is an error.
        boundary: A boundary for a scene that has none, in file units; dialects C to E must have one.

    Raises:
        ConversionError: The dialect cannot express how the robots move.
        KinematicsError: A body of a robot is neither a base nor reached from one.
        ValueError: There is no such dialect.
    """
    log = DiagnosticLog(strict)
    losses = Losses(Dialect(dialect), log)
    robots = _robots(environment, losses)
    maps = tuple(DofMap.of(a, b) for a, b in zip(environment.robots, robots, strict=True))
    found = _multibodies(environment, robots, losses)
    _report_xml(environment, losses)
    if environment.boundary is None and boundary is not None:
        environment = replace(environment, boundary=boundary)
    written = sum(m.robot_file is None for m in found)
    result = replace(
        environment,
        dialect=losses.dialect,
        multibodies=found,
        boundary=translated_boundary(environment, losses),
        resolution=translated_resolution(environment, losses),
        tasks=tuple(maps[t.robot].task(t) for t in _of_one_robot_each(environment, maps, losses)),
        semantics="planner",
        declared_multibodies=written,
        attributes=(),
        planner_rules=PlannerRules(),
        diagnostics=tuple(log),
    )
    return Translation(result, tuple(log), maps)


def _robots(environment: Environment, losses: Losses) -> tuple[MultiBody, ...]:
    """Return the translation of each robot."""
    sources, meets = environment.robots, bool(environment.obstacles)
    files = _files(environment.name, sources) if losses.rules.robot_files else [None] * len(sources)
    robots = [translate_robot(r, meets, losses) for r in sources]
    _report_number(environment, losses)
    return tuple(replace(r, robot_file=f) for r, f in zip(robots, files, strict=True))


def _files(name: str, robots: Sequence[MultiBody]) -> list[str]:
    """Name a file for each robot; one that has a text file keeps its name."""
    if len(robots) == 1:
        return [_kept(robots[0]) or f"{name}.robot"]
    return [_kept(r) or f"{name}-{i}.robot" for i, r in enumerate(robots)]


def _kept(robot: MultiBody) -> str | None:
    file = robot.robot_file
    return file if file is not None and PurePath(file).suffix.lower() != ".xml" else None


def _multibodies(environment: Environment, robots: Sequence[MultiBody], losses: Losses) -> tuple[MultiBody, ...]:
    found: list[MultiBody] = []
    translated = {id(s): r for s, r in zip(environment.robots, robots, strict=True)}
    for source in environment.multibodies:
        robot = translated.get(id(source))
        if robot is not None:
            found.append(robot)
        elif source.kind in losses.rules.kinds:
            found += translate_obstacles(source, losses)
        else:
            found += _surface(source, losses)
    if losses.rules.robot_files:
        found.sort(key=lambda m: m.robot_file is not None)
    elif losses.rules.legacy_layout and environment.dialect is not losses.dialect:
        # Its planner moves multibody 0, whatever the tag says.
        found.sort(key=lambda m: not m.moves)
    return tuple(found)


def _surface(source: MultiBody, losses: Losses) -> list[MultiBody]:
    name, dialect = source.label or source.bodies[0].filename, losses.dialect
    if not losses.rules.legacy_layout:
        message = f"dialect {dialect} has no surfaces; {name}, which is only drawn, is lost"
        losses.lost("ENV174", name, message, span=source.span)
        return []
    message = f"dialect {dialect} has no surfaces: {name} is written as one, and its planner takes it for an obstacle"
    losses.lost("ENV174", name, message, span=source.span)
    return list(translate_obstacles(source, losses))


def _report_number(environment: Environment, losses: Losses) -> None:
    if not losses.rules.legacy_layout or environment.dialect is losses.dialect:
        return
    robots = environment.robots
    if not robots and environment.multibodies:
        hint = "add a robot, with robots=[...] (--robots) if it has a file of its own"
        what = "a scene without a robot: dialect A takes its first multibody for one"
        losses.refuse("ENV176", environment.name, what, hint=hint)
    if len(robots) > 1:
        message = f"{len(robots)} robots; the planner of dialect A moves the first, and takes the others for obstacles"
        losses.lost("ENV176", environment.name, message, span=robots[1].span)


def _of_one_robot_each(environment: Environment, maps: Sequence[DofMap], losses: Losses) -> Iterator[Task]:
    """Yield the tasks; what several robots are to do together as the tasks of each."""
    dofs = [len(m.source.dofs) for m in maps]
    for task in environment.tasks:
        if len(task.robots) > 1:
            message = f"query files do not say that {robots_named(task.robots)} move together; each gets its own rows"
            losses.lost("ENV177", task.label or environment.name, message, span=task.span)
        yield from tasks_alone(task, dofs)


def _report_xml(environment: Environment, losses: Losses) -> None:
    if environment.attributes:
        listed = ", ".join(name for name, _ in environment.attributes)
        losses.lost("ENV177", "<Environment>", f"text files have no attributes of the planner; lost: {listed}")
    rules = environment.planner_rules
    # One link apart is the default.
    if rules.ignore_self_collision or rules.adjacent_links not in (None, 1):
        message = "text files do not say which pairs of links are tested; what the problem file says about that is lost"
        losses.lost("ENV177", environment.name, message, hint="choose with adjacent_links and self_collision")
