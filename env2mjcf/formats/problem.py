"""The planner's problem XML: environment, robots and tasks together."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import FormatError
from ..model import Boundary, BoundaryShape, PlannerRules
from .xml import Node

_TRUE = {"true": True, "1": True, "false": False, "0": False}


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
        robots: (label, file name, node) of each robot.
        tasks: In file order.
        rules: What it says about collision pairs.
        boundary: The boundary that older files hold instead of the environment.
    """

    environment: Node
    filename: str | None
    robots: tuple[tuple[str, str, Node], ...]
    tasks: tuple[ProblemTask, ...]
    rules: PlannerRules
    boundary: Boundary | None


def read_problem(root: Node) -> Problem:
    """Read a `<MotionPlanning>` file.

    Raises:
        FormatError: It names no environment, or a task names no robot of it.
    """
    problems = list(root.descendants("Problem", "MPProblem"))
    where = problems[0] if problems else root
    environments = list(where.children("Environment"))
    if not environments:
        where.fail("ENV148", f"<{where.tag}> names no <Environment>")
    environment = environments[0]
    robots = tuple(
        (r.get("label") or "", r.require("filename"), r)
        for r in where.children("Robot")
        if (r.get("virtual") or "false").lower() != "true"
    )
    tasks = tuple(_read_task(t) for t in where.descendants("Task"))
    labels = [label for label, _, _ in robots]
    for task in tasks:
        if task.robot not in labels:
            task.node.fail("ENV149", f"task {task.label!r} is for the unknown robot {task.robot!r}", at="robot")
    return Problem(
        environment,
        environment.get("filename") or environment.get("input_env"),
        robots,
        tasks,
        _read_rules(root),
        _read_older_boundary(environment),
    )


def _read_task(node: Node) -> ProblemTask:
    rows: list[tuple[float, ...]] = []
    for block in (*node.children("StartConstraints"), *node.children("GoalConstraints")):
        for constraint in block.children("CSpaceConstraint"):
            if constraint.get("point") is None:
                node.log.info(
                    "ENV307", "<CSpaceConstraint>", "a constraint without a point is not used", span=constraint.span
                )
                continue
            scan = constraint.scan("point")
            row: list[float] = []
            while not scan.at_end():
                row.append(scan.number("point"))
            rows.append(tuple(row))
        block.ignore_other_children("CSpaceConstraint")
    return ProblemTask(node.get("label") or "", node.get("robot") or "", tuple(rows), node)


def _read_rules(root: Node) -> PlannerRules:
    """Read what the collision checkers say about pairs; where several differ, an explicit `true` wins."""
    checkers = list(root.descendants("CollisionDetection"))
    self_flags = [v for c in checkers if (v := _flag(c, "ignoreSelfCollision")) is not None]
    adjacent: list[int] = []
    for checker in checkers:
        flag = _flag(checker, "ignoreAdjacentLinks")
        if flag is not None:
            adjacent.append(int(flag))
        if checker.get("ignoreIAdjacentLinks") is not None:
            adjacent.append(checker.integer("ignoreIAdjacentLinks"))
    rules = PlannerRules(any(self_flags) if self_flags else None, max(adjacent) if adjacent else None)
    if rules != PlannerRules():
        first = checkers[0]
        first.log.info(
            "ENV309", "<CollisionDetection>",
            "pairs follow the problem file: "
            f"self-collision {'ignored' if rules.ignore_self_collision else 'tested'}, "
            f"links within {1 if rules.adjacent_links is None else rules.adjacent_links} connections ignored",
            span=first.span,
        )  # fmt: skip
    return rules


def _flag(node: Node, name: str) -> bool | None:
    text = node.get(name)
    if text is None:
        return None
    if text.lower() not in _TRUE:
        node.log.warn(FormatError, "ENV213", name, f"{name}={text!r}; expected true or false", span=node.span_of(name))
        return None
    return _TRUE[text.lower()]


def _read_older_boundary(environment: Node) -> Boundary | None:
    """Read `<boundary type="bbox">` with a `<parameter>` an axis, which dialects A and B rely on."""
    for boundary in environment.descendants("boundary"):
        axes: dict[str, tuple[float, float]] = {}
        for parameter in boundary.children("parameter"):
            label = (parameter.get("Label") or parameter.get("label") or "").lower()
            if label in ("x", "y", "z"):
                axes[label] = (parameter.number("min"), parameter.number("max"))
        if "x" in axes and "y" in axes:
            ranges = [axes[k] for k in "xyz" if k in axes]
            shape = BoundaryShape.BOX if len(ranges) == 3 else BoundaryShape.BOX2D
            return Boundary(shape, tuple(r[0] for r in ranges), tuple(r[1] for r in ranges), span=boundary.span)
    return None

