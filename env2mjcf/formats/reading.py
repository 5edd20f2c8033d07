"""Opens a scene, whatever its files are, and puts its parts together."""

from __future__ import annotations

import dataclasses
import os
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Unpack

from ..diagnostics import DiagnosticLog
from ..errors import Span
from ..kinematics.tree import build_tree, degrees_of_freedom
from ..limits import Limits
from ..model.environment import Dialect, Environment, MultiBody, Task
from ..options import OptionKeywords, Options, PathArgument
from . import xml_scene
from .detect import detect, is_xml
from .env import read_env, read_robot
from .lexer import Scanner
from .problem import PROBLEM_TAGS, Problem, ProblemPart, ProblemTask, read_problem
from .rows import read_query, split_row
from .source import Source, read_source
from .xml import Node, parse_xml

_Numbers = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class _Named:
    """A robot file, the robot's label, and where a problem names it."""

    path: PathArgument
    label: str = ""
    span: Span | None = None


def read(path: PathArgument, **options: Unpack[OptionKeywords]) -> Environment:
    """Read a scene: an env file of any dialect, an XML environment, or the planner's problem XML.

    Meshes are not opened, and MuJoCo is not needed.

    Args:
        path: The file.
        **options: Fields of `Options`; those that do not concern reading are ignored.

    Returns:
        The scene in file units and radians, with everything that the readers found in `.diagnostics`.

    Raises:
        FormatError: A file is missing, is not text, or breaks its grammar.
        KinematicsError: The bodies of a robot do not hang together.
        TypeError, ValueError: An option cannot be used.
    """
    chosen = Options.from_keywords(options)
    log = DiagnosticLog(chosen.strict)
    return read_scene(path, chosen, log)


def read_scene(path: PathArgument, options: Options, log: DiagnosticLog) -> Environment:
    """Read a scene with options already checked; see `read`."""
    source = read_source(path, log, options.limits)
    problem: Problem | None = None
    if is_xml(source):
        root = parse_xml(source, log)
        if root.tag.lower() in PROBLEM_TAGS:
            problem = read_problem(root, options)
            environment = _problem_environment(problem, source, options, log)
        else:
            environment = _xml_environment(root, options)
    else:
        environment = _text_environment(source, options, log)
    first_robot = sum(m.moves for m in environment.multibodies)
    environment = _with_robots(environment, _robots_named(problem, source, options, log), options, log)
    if not environment.robots:
        hint = "give a robot file with robots=[...] (--robots)"
        log.info("ENV310", environment.name, "the scene has no robot", hint=hint)
    tasks = _tasks(environment, problem, first_robot, options, log)
    sources = _sources(source, environment, options)
    return dataclasses.replace(environment, tasks=tasks, path=source.path, sources=sources, diagnostics=tuple(log))


def _sources(source: Source, environment: Environment, options: Options) -> tuple[str, ...]:
    # A problem file names another file, the environment's.
    names = (source.path, environment.path, *(m.robot_file for m in environment.multibodies), options.query)
    return tuple(dict.fromkeys(os.fsdecode(name) for name in names if name))


def robot_dofs(environment: Environment, log: DiagnosticLog) -> list[int]:
    """Return the number of degrees of freedom of each robot."""
    return [len(degrees_of_freedom(r, build_tree(r, log))) for r in environment.robots]


def _text_environment(source: Source, options: Options, log: DiagnosticLog) -> Environment:
    dialect = Dialect(options.dialect) if options.dialect else detect(source, log)
    _check_semantics(source, dialect, options)
    return read_env(Scanner(source, log), dialect, options.semantics)


def _check_semantics(source: Source, dialect: Dialect, options: Options) -> None:
    if options.semantics == "page" and dialect is not Dialect.A:
        raise ValueError(f"semantics='page' concerns dialect A only; {source.path} is dialect {dialect}")


def _xml_environment(root: Node, options: Options) -> Environment:
    _check_semantics(root.source, Dialect.E, options)
    if options.dialect not in (None, "E"):
        message = f"{root.source.path} is XML, which is dialect E; it cannot be read as dialect {options.dialect}"
        raise ValueError(message)
    if root.tag.lower() == "robot":
        hint = "read the environment, and give this file as robots=[...] (--robots)"
        root.fail("ENV131", f"{root.source.path} is a robot file, not an environment", hint=hint)
    if root.tag.lower() != "environment":
        hint = "name an environment or a problem file"
        root.fail("ENV130", f"unknown root <{root.tag}>; expected <Environment> or <MotionPlanning>", hint=hint)
    return xml_scene.read_environment(root)


def _problem_environment(problem: Problem, source: Source, options: Options, log: DiagnosticLog) -> Environment:
    node = problem.environment
    if problem.filename is None:
        environment = xml_scene.read_environment(node)
    else:
        path, named_at = _beside(source, problem.filename, node, options, log)
        inner = read_source(path, log, options.limits, named_at, regular=True)
        if is_xml(inner):
            environment = _xml_environment(parse_xml(inner, log), options)
        else:
            environment = _text_environment(inner, options, log)
        environment = xml_scene.with_environment_attributes(environment, node)
    if environment.boundary is not None and problem.boundary is not None:
        message = "the boundary of the problem is not used: the environment has its own"
        log.info("ENV307", "<boundary>", message, span=problem.boundary.span)
    return dataclasses.replace(
        environment,
        name=Path(source.path).stem,
        boundary=environment.boundary or problem.boundary,
        planner_rules=problem.rules,
    )


def _robots_named(problem: Problem | None, source: Source, options: Options, log: DiagnosticLog) -> Iterator[_Named]:
    for robot in () if problem is None else problem.robots:
        path, span = _beside(source, robot.filename, robot.node, options, log)
        yield _Named(path, robot.label, span)
    for path in options.robots:
        yield _Named(path)


def _with_robots(
    environment: Environment, named: Iterable[_Named], options: Options, log: DiagnosticLog
) -> Environment:
    """Add robots, each file read once however often it is named, until the scene is larger than the limits."""
    read: dict[str, MultiBody] = {}
    multibodies = list(environment.multibodies)
    size: Counter[str] = Counter()
    for multibody in multibodies:
        _count(size, multibody, environment.path, options.limits, log)
    for robot in named:
        path = os.fspath(robot.path)
        place = path if "\0" in path else os.path.realpath(path)
        if place not in read:
            # What the user names may be a pipe.
            named_by_file = robot.span is not None
            found = read_source(path, log, options.limits, robot.span, regular=named_by_file)
            read[place] = _robot_file(found, log)
        # One of its own each time, because robots are told apart by identity.
        multibodies.append(dataclasses.replace(read[place], label=robot.label or read[place].label))
        _count(size, multibodies[-1], environment.path, options.limits, log)
    return dataclasses.replace(environment, multibodies=tuple(multibodies))


def _count(size: Counter[str], multibody: MultiBody, path: str, limits: Limits, log: DiagnosticLog) -> None:
    """Count the bodies and connections of one more multibody; refuse more than the limits allow of a scene."""
    for what in ("bodies", "connections"):
        size[what] += len(getattr(multibody, what))
        if size[what] > getattr(limits, what):
            message = f"the scene has {size[what]} {what} or more; at most {getattr(limits, what)} are read"
            log.fail("ENV110", path, message, hint=Limits.hint(what))


def _robot_file(source: Source, log: DiagnosticLog) -> MultiBody:
    if not is_xml(source):
        return read_robot(Scanner(source, log))
    root = parse_xml(source, log)
    if root.tag.lower() != "robot":
        root.fail("ENV130", f"unknown root <{root.tag}>; expected <Robot>", hint="name a robot file")
    return xml_scene.read_robot(root)


def _beside(source: Source, name: str, node: Node, options: Options, log: DiagnosticLog) -> tuple[Path, Span]:
    """Return a file that a problem names, and where; it lies in the problem's folder unless `allow_outside`."""
    named_at = node.span_of("filename" if node.get("filename") else "input_env")
    folder = Path(source.path).parent
    path = folder / name
    if not options.allow_outside and "\0" not in name and not _inside(path, folder):
        message = f"{name} lies outside the folder of {source.path}; expected a file in it"
        log.fail("ENV150", name, message, hint="allow it with allow_outside=True (--allow-outside)", span=named_at)
    return path, named_at


def _inside(path: Path, folder: Path) -> bool:
    return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder))


def _tasks(
    environment: Environment, problem: Problem | None, first_robot: int, options: Options, log: DiagnosticLog
) -> tuple[Task, ...]:
    dofs = robot_dofs(environment, log)
    tasks: list[Task] = []
    if problem is not None:
        robots = {r.label: first_robot + i for i, r in enumerate(problem.robots)}
        ended: dict[int, _Numbers] = {}
        tasks += [_problem_task(t, robots, dofs, ended) for t in problem.tasks]
    if options.query is not None:
        tasks += read_query(read_source(options.query, log, options.limits), dofs, log)
    return tuple(tasks)


def _problem_task(task: ProblemTask, robots: dict[str, int], dofs: list[int], ended: dict[int, _Numbers]) -> Task:
    """Return a task; in `ended` are the goals of the robots' tasks before it, and then its own."""
    columns: list[list[_Numbers]] = []
    for part in task.parts:
        robot = robots[part.robot]
        rows = [_point(part, row, robot, dofs) for row in part.rows]
        if not part.begins:
            if robot in ended:
                rows.insert(0, ended[robot])
            _report_no_start(part, robot in ended)
        ended[robot] = rows[-1]
        columns.append(rows)
    longest = max(map(len, columns))
    # Who is done waits at its goal.
    columns = [rows + rows[-1:] * (longest - len(rows)) for rows in columns]
    configurations = tuple(tuple(chain.from_iterable(row)) for row in zip(*columns, strict=True))
    return Task(tuple(robots[p.robot] for p in task.parts), configurations, task.label, task.node.span)


def _point(part: ProblemPart, row: _Numbers, robot: int, dofs: list[int]) -> _Numbers:
    taken = split_row(row, dofs[robot : robot + 1])
    if taken is None:
        found = f"a point of {len(row)} numbers in task {part.node.get('label') or ''!r}"
        message = f"{found}; expected {dofs[robot]}, the degrees of freedom of robot {part.robot!r}"
        part.node.fail("CFG504", message, hint="is the task meant for another robot?")
    return taken[1]


def _report_no_start(part: ProblemPart, follows: bool) -> None:
    label, node = part.node.get("label") or "", part.node
    if follows:
        message = f"task {label!r} has no start; it begins where robot {part.robot!r} was at the end of the one before"
        node.log.info("CFG519", f"<{node.tag}>", message, span=node.span)
    else:
        message = f"task {label!r} has no start; robot {part.robot!r} begins at the first of its goals"
        node.log.warn("CFG519", f"<{node.tag}>", message, hint="add <StartConstraints>", span=node.span)
