"""Opens a scene, whatever its files are, and puts its parts together."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Any

from ..dofs import build_tree, degrees_of_freedom
from ..errors import DiagnosticLog, FormatError, Span
from ..model import Dialect, Environment, MultiBody, Task
from ..options import Options, PathArgument
from . import xml_scene
from .detect import detect, is_xml
from .env import read_env
from .lexer import Scanner
from .problem import Problem, ProblemTask, read_problem
from .query import read_query
from .robot import read_robot
from .source import Source, read_source
from .xml import Node, parse_xml

_PROBLEM_TAGS = ("motionplanning", "motion_planning", "mpproblem", "problem")


def read(path: PathArgument, **options: Any) -> Environment:
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
        TypeError: An unknown option.
    """
    chosen = Options.from_keywords(options)
    log = DiagnosticLog(chosen.strict)
    return read_scene(path, chosen, log)


def read_scene(path: PathArgument, options: Options, log: DiagnosticLog) -> Environment:
    """Read a scene with options already checked; see `read`."""
    source = read_source(path, log, options.limits)
    problem: Problem | None = None
    if is_xml(source):
        root = parse_xml(source, log, options.limits)
        if root.tag.lower() in _PROBLEM_TAGS:
            problem = read_problem(root)
            environment = _problem_environment(problem, source, options, log)
        else:
            environment = _xml_environment(root)
    else:
        environment = _text_environment(source, options, log)
    named = () if problem is None else problem.robots
    robots = [_labelled(_problem_robot(n, f, source, options, log), label) for label, f, n in named]
    robots += [_robot_file(os.fspath(name), options, log) for name in options.robots]
    own = len(environment.robots)
    environment = dataclasses.replace(environment, multibodies=(*environment.multibodies, *robots))
    if not environment.robots:
        log.info(
            "ENV310", environment.name, "the scene has no robot",
            hint="give a robot file with robots=[...] (--robots)",
        )  # fmt: skip
    tasks = _tasks(environment, problem, own, options, log)
    # A problem lends the scene its own name: several problems may share one environment.
    return dataclasses.replace(
        environment, name=Path(source.path).stem, tasks=tasks, path=source.path, diagnostics=tuple(log)
    )


def robot_dofs(environment: Environment, log: DiagnosticLog) -> list[int]:
    """Return the number of degrees of freedom of each robot."""
    return [len(degrees_of_freedom(r, build_tree(r, log))) for r in environment.robots]


def _text_environment(source: Source, options: Options, log: DiagnosticLog) -> Environment:
    dialect = Dialect(options.dialect) if options.dialect else detect(source, log)
    if options.semantics == "page" and dialect is not Dialect.A:
        raise ValueError(f"semantics='page' concerns dialect A only; {source.path} is dialect {dialect}")
    return read_env(Scanner(source, log, options.limits), dialect, options.semantics)


def _xml_environment(root: Node) -> Environment:
    if root.tag.lower() == "robot":
        root.fail(
            "ENV131", f"{root.source.path} is a robot file, not an environment",
            hint="read the environment, and give this file as robots=[...] (--robots)",
        )  # fmt: skip
    if root.tag.lower() != "environment":
        root.fail("ENV130", f"unknown root <{root.tag}>; expected <Environment>, <Robot> or <MotionPlanning>")
    return xml_scene.read_environment(root)


def _problem_environment(problem: Problem, source: Source, options: Options, log: DiagnosticLog) -> Environment:
    node = problem.environment
    if problem.filename is None:
        environment = xml_scene.read_environment(node)
    else:
        path = _beside(source, problem.filename, node.span, options, log)
        inner = read_source(path, log, options.limits)
        if is_xml(inner):
            environment = _xml_environment(parse_xml(inner, log, options.limits))
        else:
            environment = _text_environment(inner, options, log)
        environment = xml_scene.with_environment_attributes(environment, node)
    return dataclasses.replace(
        environment, boundary=environment.boundary or problem.boundary, planner_rules=problem.rules
    )


def _problem_robot(node: Node, filename: str, source: Source, options: Options, log: DiagnosticLog) -> MultiBody:
    return _robot_file(_beside(source, filename, node.span_of("filename"), options, log), options, log)


def _robot_file(path: str, options: Options, log: DiagnosticLog) -> MultiBody:
    source = read_source(path, log, options.limits)
    if not is_xml(source):
        return read_robot(Scanner(source, log, options.limits))
    root = parse_xml(source, log, options.limits)
    if root.tag.lower() != "robot":
        root.fail("ENV130", f"unknown root <{root.tag}>; expected <Robot>")
    return xml_scene.read_robot(root)


def _labelled(robot: MultiBody, label: str) -> MultiBody:
    return dataclasses.replace(robot, label=label or robot.label)


def _beside(source: Source, name: str, span: Span, options: Options, log: DiagnosticLog) -> str:
    """Return the path of a file that a problem names, which lies in its folder unless `allow_outside`."""
    folder = Path(source.path).parent
    path = folder / name
    if not options.allow_outside and not path.resolve().is_relative_to(folder.resolve()):
        log.fail(
            FormatError, "ENV150", name, f"{name} lies outside the folder of {source.path}",
            hint="allow it with allow_outside=True (--allow-outside)", span=span,
        )  # fmt: skip
    return os.fspath(path)


def _tasks(
    environment: Environment, problem: Problem | None, own: int, options: Options, log: DiagnosticLog
) -> tuple[Task, ...]:
    dofs = robot_dofs(environment, log)
    tasks: list[Task] = []
    if problem is not None:
        labels = [label for label, _, _ in problem.robots]
        tasks += [_problem_task(t, own + labels.index(t.robot), dofs) for t in problem.tasks]
    if options.query is not None:
        tasks += read_query(read_source(options.query, log, options.limits), dofs, log)
    return tuple(tasks)


def _problem_task(task: ProblemTask, robot: int, dofs: list[int]) -> Task:
    for row in task.rows:
        if len(row) != dofs[robot]:
            task.node.fail(
                "CFG504",
                f"a point of {len(row)} numbers in task {task.label!r}; "
                f"robot {task.robot!r} has {dofs[robot]} degrees of freedom",
            )
    return Task(robot, task.rows, task.label, task.node.span)
