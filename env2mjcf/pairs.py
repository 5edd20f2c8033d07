"""Which pairs of bodies are tested against each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

from .errors import did_you_mean, enumeration
from .kinematics.forward import RobotKinematics
from .model.dialects import RULES
from .model.environment import BaseKind, JointType, MultiBody, PlannerRules
from .options import Options

ContactKind = Literal["obstacle", "self", "robot"]


@dataclass(frozen=True, slots=True)
class Pair:
    """Two bodies that are tested.

    Attributes:
        link: Name of a robot's body.
        other: Name of an obstacle's body, or of another link.
        kind: `obstacle`, `self` or `robot`.
        constant: Whether neither can move against the other, so that the verdict is decided once.
    """

    link: str
    other: str
    kind: ContactKind
    constant: bool = False


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot and the names of its bodies."""

    kinematics: RobotKinematics
    links: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class PairTable:
    """All tested pairs, and the pairs that MuJoCo would test but the rules do not.

    Attributes:
        tested: In a stable order: robot by robot, obstacles, then the robot itself, then other robots.
        excluded: Moving pairs that are not tested.
    """

    tested: tuple[Pair, ...]
    excluded: tuple[Pair, ...]


def pair_table(robots: Sequence[Robot], obstacles: Sequence[str], options: Options, rules: PlannerRules) -> PairTable:
    """Apply the rules for pairs.

    Args:
        robots: All robots.
        obstacles: Names of the obstacles' bodies.
        options: `self_collision`, `adjacent_links`, `inter_robot`, `exclude_pairs` are used.
        rules: What a problem XML says; it gives way to options that are given.

    Raises:
        ValueError: `exclude_pairs` names an unknown body.
    """
    names = dict.fromkeys([*(n for r in robots for n in r.links), *obstacles])
    given = {frozenset(_known(p, names)) for p in options.exclude_pairs}
    self_collision = options.tests_self(rules.ignore_self_collision)
    tested: list[Pair] = []
    excluded: list[Pair] = []

    def judge(pair: Pair, wanted: bool) -> None:
        if wanted and frozenset((pair.link, pair.other)) not in given:
            tested.append(pair)
        elif not pair.constant:
            excluded.append(pair)

    for number, robot in enumerate(robots):
        groups = rigid_groups(robot.kinematics)
        for i, link in enumerate(robot.links):
            for obstacle in obstacles:
                static = groups[i] == _WORLD
                judge(Pair(link, obstacle, "obstacle", static), not static or _tests_static(robot.kinematics, i))
        near = _within(robot.kinematics.multibody, options.untested_steps(rules.adjacent_links))
        for i, j in combinations(range(len(robot.links)), 2):
            pair = Pair(robot.links[i], robot.links[j], "self", groups[i] == groups[j])
            judge(pair, self_collision and (i, j) not in near)
        for other in robots[number + 1 :]:
            other_groups = rigid_groups(other.kinematics)
            for i, link in enumerate(robot.links):
                for j, link2 in enumerate(other.links):
                    constant = groups[i] == _WORLD == other_groups[j]
                    judge(Pair(link, link2, "robot", constant), options.inter_robot)
    return PairTable(tuple(tested), tuple(excluded))


_WORLD = -1


def rigid_groups(robot: RobotKinematics) -> list[int]:
    """Return for each body the first body of the group that moves as one with it; -1 for the world."""
    groups = [0] * len(robot.multibody.bodies)
    for body in robot.tree.order:
        k = robot.tree.parent[body]
        if k is None:
            groups[body] = _WORLD if robot.tree.bases[body] is BaseKind.FIXED else body
        elif robot.multibody.connections[k].joint is JointType.NON_ACTUATED:
            groups[body] = groups[robot.multibody.connections[k].previous]
        else:
            groups[body] = body
    return groups


def _tests_static(robot: RobotKinematics, body: int) -> bool:
    """Dialect A never tests a robot's FixedBody against obstacles; later dialects test a fixed base."""
    return RULES[robot.multibody.dialect].tests_fixed_base or robot.multibody.bodies[body].base is not BaseKind.FIXED


def _within(multibody: MultiBody, steps: int) -> set[tuple[int, int]]:
    """Return the pairs of bodies at most so many connections apart; `Adjacencies` count as connections."""
    neighbours: dict[int, set[int]] = {}
    edges = [(c.previous, c.next) for c in multibody.connections] + list(multibody.adjacencies)
    for i, j in edges:
        neighbours.setdefault(i, set()).add(j)
        neighbours.setdefault(j, set()).add(i)
    near: set[tuple[int, int]] = set()
    for start in neighbours:
        seen, front = {start}, {start}
        for _ in range(steps):
            front = {n for b in front for n in neighbours[b]} - seen
            if not front:
                break
            seen |= front
        near |= {(start, b) for b in seen if b > start}
    return near


def _known(pair: tuple[str, str], names: Mapping[str, None]) -> tuple[str, str]:
    for name in pair:
        if name not in names:
            guess = did_you_mean(name, names)
            raise ValueError(
                f"exclude_pairs names the unknown body {name!r}{f'; {guess}' if guess else ''} "
                f"(bodies: {enumeration(list(names))})"
            )
    return pair
