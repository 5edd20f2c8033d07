"""The planner's problem XML: environment, robots and tasks together (docs/format/xml.md)."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import did_you_mean, enumeration
from ..model.environment import Boundary, BoundaryShape, PlannerRules
from ..options import Options
from .blocks import read_coordinate
from .lexer import Scanner
from .xml import Node

PROBLEM_TAGS = ("motionplanning", "motion_planning", "mpproblem", "problem")
"""Roots of problem files, in lower case."""

_TRUE = {"true": True, "1": True, "false": False, "0": False}
# What several ages of the planner call the same number.
_ADJACENT_LINKS = ("ignoreIAdjacentLinks", "ignore_i_adjacent_links")


@dataclass(frozen=True, slots=True)
class ProblemRobot:
    """A `<Robot>`: its label and the file that describes it."""

    label: str
    filename: str
    node: Node


@dataclass(frozen=True, slots=True)
class ProblemTask:
    """A `<Task>`: the label of its robot and its configurations in the file's own numbers."""

    label: str
    robot: str
    rows: tuple[tuple[float, ...], ...]
    node: Node


@dataclass(frozen=True, slots=True)
class Problem:
    """What a problem file names.

    Attributes:
        environment: The node that names, or is, the environment.
        filename: The environment file it names; None where the environment stands inside.
        robots: In file order, without virtual ones.
        tasks: In file order, without those of virtual robots.
        rules: What it says about collision pairs.
        boundary: The boundary that older files hold instead of the environment.
    """

    environment: Node
    filename: str | None
    robots: tuple[ProblemRobot, ...]
    tasks: tuple[ProblemTask, ...]
    rules: PlannerRules
    boundary: Boundary | None


def read_problem(root: Node, options: Options) -> Problem:
    """Read a `<MotionPlanning>` file.

    Raises:
        FormatError: It names no environment, or a task names no robot of it.
    """
    where = _only_first(root, [root] if _is_problem(root) else list(root.descendants("Problem", "MPProblem")))
    environment = _only_first(where, list(where.children("Environment")))
    robots, virtual = _read_robots(where)
    return Problem(
        environment,
        environment.get("filename") or environment.get("input_env"),
        robots,
        _read_tasks(where, robots, virtual),
        _read_rules(root, options),
        _read_older_boundary(environment),
    )


def _is_problem(node: Node) -> bool:
    return node.tag.lower() in ("problem", "mpproblem")


def _only_first(parent: Node, found: list[Node]) -> Node:
    """Return the first of some nodes; say so where there are more."""
    if not found:
        wanted = "Environment" if _is_problem(parent) else "Problem"
        parent.fail("ENV148", f"<{parent.tag}> has no <{wanted}>, which is expected", hint=f"add a <{wanted}>")
    for other in found[1:]:
        other.ignore(f"another <{other.tag}> is not used")
    return found[0]


def _read_robots(problem: Node) -> tuple[tuple[ProblemRobot, ...], set[str]]:
    """Return the robots, and the labels of the virtual ones, which have no body."""
    robots: dict[str, ProblemRobot] = {}
    virtual: set[str] = set()
    for node in problem.children("Robot"):
        label = node.get("label") or ""
        if _flag(node, "virtual"):
            node.ignore(f"the virtual robot {label!r} is not used")
            virtual.add(label)
            continue
        if label in robots:
            message = f"two robots are called {label!r}; expected a label of its own for each"
            node.fail("ENV151", message, hint="tasks name robots by their labels", at="label")
        robots[label] = ProblemRobot(label, node.require("filename"), node)
    return tuple(robots.values()), virtual


def _read_tasks(problem: Node, robots: tuple[ProblemRobot, ...], virtual: set[str]) -> tuple[ProblemTask, ...]:
    labels = {r.label: None for r in robots}
    tasks: list[ProblemTask] = []
    for node in problem.descendants("Task"):
        robot = node.get("robot") or ""
        if robot in virtual:
            node.ignore(f"the task of the virtual robot {robot!r} is not used")
        elif robot in labels:
            tasks.append(_read_task(node, robot))
        else:
            known = enumeration([repr(label) for label in labels]) or "none"
            message = f"task {node.get('label') or ''!r} is for the unknown robot {robot!r}; expected one of: {known}"
            node.fail("ENV149", message, hint=did_you_mean(robot, labels) or "name a robot of this file", at="robot")
    return tuple(tasks)


def _read_task(node: Node, robot: str) -> ProblemTask:
    rows: list[tuple[float, ...]] = []
    for block in (*node.children("StartConstraints"), *node.children("GoalConstraints")):
        for constraint in block.children("CSpaceConstraint"):
            if constraint.get("point") is None:
                constraint.ignore("a constraint without a point is not used")
            else:
                rows.append(constraint.read("point", _numbers))
        block.ignore_other_children("CSpaceConstraint")
    return ProblemTask(node.get("label") or "", robot, tuple(rows), node)


def _numbers(scan: Scanner) -> tuple[float, ...]:
    numbers: list[float] = []
    while not scan.at_end():
        numbers.append(scan.number("point"))
    return tuple(numbers)


def _read_rules(root: Node, options: Options) -> PlannerRules:
    """Read what the collision checkers say about pairs; where several differ, an explicit `true` wins.

    What is reported is what holds: options that are given overrule the file.
    """
    checkers = list(root.descendants("CollisionDetection"))
    self_flags = [v for c in checkers if (v := _flag(c, "ignoreSelfCollision")) is not None]
    adjacent = [int(v) for c in checkers if (v := _flag(c, "ignoreAdjacentLinks")) is not None]
    adjacent += [_read_links(c, name) for c in checkers for name in _ADJACENT_LINKS if c.get(name) is not None]
    rules = PlannerRules(any(self_flags) if self_flags else None, max(adjacent) if adjacent else None)
    if rules != PlannerRules():
        overruled = options.self_collision is not None or options.adjacent_links is not None
        message = (
            f"pairs follow {'options and ' if overruled else ''}the problem file: "
            f"self-collision {'tested' if options.tests_self(rules.ignore_self_collision) else 'ignored'}, "
            f"links within {options.untested_steps(rules.adjacent_links)} connections ignored"
        )
        root.log.info("ENV309", "<CollisionDetection>", message, span=checkers[0].span)
    return rules


def _read_links(node: Node, name: str) -> int:
    number = node.integer(name)
    if number < 0:
        hint = "links that are fewer connections apart are not tested"
        node.fail("ENV110", f"{name} is {number}; expected 0 or more", hint=hint, at=name)
    return number


def _flag(node: Node, name: str) -> bool | None:
    text = node.get(name)
    if text is None:
        return None
    if text.strip().lower() not in _TRUE:
        message = f"{name}={text!r} is not used; expected true or false"
        node.log.warn("ENV213", name, message, hint="write true or false", span=node.span_of(name))
        return None
    return _TRUE[text.strip().lower()]


def _read_older_boundary(environment: Node) -> Boundary | None:
    """Read `<boundary type="bbox">` with a `<parameter>` an axis, which dialects A and B rely on."""
    for boundary in environment.children("boundary"):
        axes: dict[str, tuple[float, float]] = {}
        for parameter in boundary.children("parameter"):
            label = (parameter.get("Label") or parameter.get("label") or "").lower()
            if label in ("x", "y", "z"):
                axes[label] = _axis(parameter)
        if "x" in axes and "y" in axes:
            ranges = [axes[k] for k in "xyz" if k in axes]
            shape = BoundaryShape.BOX if len(ranges) == 3 else BoundaryShape.BOX2D
            return Boundary(shape, tuple(r[0] for r in ranges), tuple(r[1] for r in ranges), span=boundary.span)
    return None


def _axis(parameter: Node) -> tuple[float, float]:
    lower = parameter.read("min", lambda scan: read_coordinate(scan, "min of the boundary"))
    upper = parameter.read("max", lambda scan: read_coordinate(scan, "max of the boundary"))
    if lower > upper:
        message = f"the boundary {lower:g}:{upper:g} is empty; expected min below max"
        parameter.fail("ENV114", message, hint=f"write min='{upper:g}' max='{lower:g}'", at="min")
    return lower, upper
