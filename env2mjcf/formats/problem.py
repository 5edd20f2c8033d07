"""The planner's problem XML: environment, robots and tasks together (docs/format/xml.md)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import NoReturn

from ..errors import did_you_mean, enumeration
from ..model.environment import Boundary, BoundaryShape, PlannerRules
from ..options import Options
from .blocks import read_coordinate
from .lexer import Scanner
from .rows import check_rows
from .xml import Node

PROBLEM_TAGS = ("motionplanning", "motion_planning", "mpproblem", "problem")
"""Roots of problem files, in lower case."""

_TRUE = {"true": True, "1": True, "false": False, "0": False}
# Where collision checkers stand, of all ages; nothing else in them is read.
_CHECKERS = ("Library", "ValidityCheckers", "validity_test", "CollisionDetection")
# What several ages of the planner call the same number.
_ADJACENT_LINKS = ("ignoreIAdjacentLinks", "ignore_i_adjacent_links")


@dataclass(frozen=True, slots=True)
class ProblemRobot:
    """A `<Robot>`: its label and the file that describes it."""

    label: str
    filename: str
    node: Node


@dataclass(frozen=True, slots=True)
class ProblemPart:
    """What one robot does in a task.

    Attributes:
        robot: Its label.
        rows: Its configurations in the file's own numbers, one at least.
        begins: Whether the first is a start.
        node: The `<Task>`.
    """

    robot: str
    rows: tuple[tuple[float, ...], ...]
    begins: bool
    node: Node


@dataclass(frozen=True, slots=True)
class ProblemTask:
    """A `<Task>`, or a `<GroupTask>`: what one robot does, or several do together."""

    label: str
    parts: tuple[ProblemPart, ...]
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
        FormatError: It names no environment; or a task or group names no robot of it, or a task no group.
    """
    root.ignore_other_attributes()
    where = _only_first(root, [root] if _is_problem(root) else list(root.descendants("Problem", "MPProblem")))
    environment = _only_first(where, list(where.children("Environment")))
    if where is not root:
        root.ignore_other_children(where.tag, *_CHECKERS)
        where.ignore_other_attributes()
    where.ignore_other_children("Environment", "Robot", "RobotGroup", "Task", "GroupTask", *_CHECKERS)
    labels = _read_labels(where)
    return Problem(
        environment,
        environment.get("filename") or environment.get("input_env"),
        tuple(labels.robots.values()),
        _read_tasks(where, labels),
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


@dataclass(frozen=True, slots=True)
class _Labels:
    """What tasks may name: robots, those of them that have no body, and groups of robots."""

    robots: dict[str, ProblemRobot]
    virtual: set[str]
    groups: dict[str, tuple[str, ...]]


def _read_labels(problem: Node) -> _Labels:
    labels = _Labels({}, set(), {})
    for node in problem.children("Robot"):
        label = node.get("label") or ""
        node.ignore_other_attributes("label", "filename", "virtual")
        if _flag(node, "virtual"):
            node.ignore(f"the virtual robot {label!r} is not used")
            labels.virtual.add(label)
            continue
        node.ignore_other_children()
        if label in labels.robots:
            message = f"two robots are called {label!r}; expected a label of its own for each"
            node.fail("ENV151", message, hint="tasks name robots by their labels", at="label")
        labels.robots[label] = ProblemRobot(label, node.require("filename"), node)
    for node in problem.children("RobotGroup"):
        label = node.get("label") or ""
        node.ignore_other_attributes("label", "robotLabels")
        node.ignore_other_children()
        if label in labels.groups:
            message = f"two groups are called {label!r}; expected a label of its own for each"
            node.fail("ENV151", message, hint="group tasks name groups by their labels", at="label")
        members = (node.get("robotLabels") or "").split()
        for unknown in (m for m in members if m not in labels.robots and m not in labels.virtual):
            hint = "write blanks between labels, and no commas" * ("," in unknown)
            _fail_unknown(node, f"group {label!r} has", "robot", unknown, labels.robots, "ENV184", "robotLabels", hint)
        labels.groups[label] = tuple(dict.fromkeys(m for m in members if m in labels.robots))
    return labels


def _fail_unknown(
    node: Node, who: str, what: str, label: str, known: Collection[str], code: str, at: str, hint: str = ""
) -> NoReturn:
    message = f"{who} the unknown {what} {label!r}; expected one of: {_quoted(known) or 'none'}"
    node.fail(code, message, hint=hint or did_you_mean(label, known) or f"name a {what} of this file", at=at)


def _read_tasks(problem: Node, labels: _Labels) -> tuple[ProblemTask, ...]:
    tasks: list[ProblemTask] = []
    within: set[object] = set()
    for node in problem.descendants("Task", "GroupTask"):
        if node.tag.lower() == "grouptask":
            parts = _read_group_task(node, labels)
            within.update(child.element for child in node.children("Task"))
        elif node.element in within:
            continue
        else:
            parts = tuple(part for part in [_read_part(node, labels)] if part is not None)
        if parts:
            tasks.append(ProblemTask(node.get("label") or "", parts, node))
    return tuple(tasks)


def _read_group_task(node: Node, labels: _Labels) -> tuple[ProblemPart, ...]:
    """Return what each robot of a group does; one that has several tasks in it does them in turn."""
    node.ignore_other_attributes("label", "group")
    node.ignore_other_children("Task")
    label, group = node.get("label") or "", node.get("group") or ""
    if group not in labels.groups:
        _fail_unknown(node, f"group task {label!r} is for", "group", group, labels.groups, "ENV184", "group")
    members, parts = frozenset(labels.groups[group]), dict[str, ProblemPart]()
    for child in node.children("Task"):
        part = _read_part(child, labels)
        if part is None:
            continue
        if part.robot not in members:
            message = f"robot {part.robot!r} is not in group {group!r}; it moves with it all the same"
            hint = "add it to the robotLabels of the group"
            node.log.warn("ENV186", f"<{node.tag}>", message, hint=hint, span=child.span_of("robot"))
        before = parts.get(part.robot)
        parts[part.robot] = part if before is None else replace(before, rows=before.rows + part.rows)
    if not parts:
        node.ignore(f"the group task {label!r} moves no robot, and is not used")
        return ()
    idle = [r for r in labels.groups[group] if r not in parts]
    if idle:
        message = f"robots of group {group!r} without a task in the group task {label!r}: {_quoted(idle)}; they stay"
        node.log.info("ENV186", f"<{node.tag}>", message, span=node.span)
    if len(counts := {len(p.rows) for p in parts.values()}) > 1:
        message = (
            f"the robots of the group task {label!r} visit {min(counts)} to {max(counts)} configurations; "
            "who is done waits at its goal"
        )
        node.log.info("ENV187", f"<{node.tag}>", message, span=node.span)
    check_rows(node.source, len(parts) * max(counts), node.log, node.span)
    return tuple(parts.values())


def _read_part(node: Node, labels: _Labels) -> ProblemPart | None:
    """Return what a robot does; None for a virtual one, or where there is no configuration."""
    node.ignore_other_attributes("label", "robot")
    node.ignore_other_children("StartConstraints", "GoalConstraints")
    label, robot = node.get("label") or "", node.get("robot") or ""
    if robot in labels.virtual:
        node.ignore(f"the task of the virtual robot {robot!r} is not used")
        return None
    if robot not in labels.robots:
        hint = f"a group has a <GroupTask group='{robot}'> with a <Task> for each robot" * (robot in labels.groups)
        _fail_unknown(node, f"task {label!r} is for", "robot", robot, labels.robots, "ENV149", "robot", hint)
    starts, goals = (_read_points(node, tag) for tag in ("StartConstraints", "GoalConstraints"))
    if not starts and not goals:
        node.ignore(f"task {label!r} has no configuration, and is not used")
        return None
    return ProblemPart(robot, (*starts, *goals), bool(starts), node)


def _read_points(task: Node, tag: str) -> list[tuple[float, ...]]:
    rows: list[tuple[float, ...]] = []
    for block in task.children(tag):
        for constraint in block.children("CSpaceConstraint"):
            constraint.ignore_other_attributes("point")
            constraint.ignore_other_children()
            if constraint.get("point") is None:
                constraint.ignore("a constraint without a point is not used")
            else:
                rows.append(constraint.read("point", _numbers))
        block.ignore_other_attributes()
        block.ignore_other_children("CSpaceConstraint")
    return rows


def _quoted(labels: Collection[str]) -> str:
    return enumeration([repr(label) for label in labels])


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
    for checker in checkers:
        checker.ignore_other_attributes(
            "label", "Label", "method", "ignoreSelfCollision", "ignoreAdjacentLinks", *_ADJACENT_LINKS
        )
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
    if not (environment.get("filename") or environment.get("input_env")):
        return None  # the environment stands inside, with its boundary
    environment.ignore_other_children("boundary")
    for boundary in environment.children("boundary"):
        boundary.ignore_other_attributes("type")
        boundary.ignore_other_children("parameter")
        axes: dict[str, tuple[float, float]] = {}
        for parameter in boundary.children("parameter"):
            parameter.ignore_other_attributes("Label", "label", "min", "max")
            label = (parameter.get("Label") or parameter.get("label") or "").lower()
            if label in ("x", "y", "z"):
                axes[label] = _axis(parameter)
            else:
                parameter.ignore(f"the range {label!r} of the boundary is not used; expected x, y or z")
        if "x" in axes and "y" in axes:
            ranges = [axes[k] for k in "xyz" if k in axes]
            shape = BoundaryShape.BOX if len(ranges) == 3 else BoundaryShape.BOX2D
            return Boundary(shape, tuple(r[0] for r in ranges), tuple(r[1] for r in ranges), span=boundary.span)
        boundary.ignore("a boundary without ranges of x and y is not used")
    return None


def _axis(parameter: Node) -> tuple[float, float]:
    lower = parameter.read("min", lambda scan: read_coordinate(scan, "min of the boundary"))
    upper = parameter.read("max", lambda scan: read_coordinate(scan, "max of the boundary"))
    if lower > upper:
        message = f"the boundary {lower:g}:{upper:g} is empty; expected min below max"
        parameter.fail("ENV114", message, hint=f"write min='{upper:g}' max='{lower:g}'", at="min")
    return lower, upper
