"""Which numbers of a configuration there are, in which order, and what they may be (docs/format/kinematics.md)."""

from __future__ import annotations

import time
from math import inf, pi

import pytest

from env2mjcf.diagnostics import DiagnosticLog
from env2mjcf.errors import KinematicsError
from env2mjcf.kinematics.tree import DofKind, build_tree, degrees_of_freedom
from env2mjcf.model.environment import (
    BaseKind,
    Body,
    Connection,
    DHParameters,
    Dialect,
    JointLimits,
    JointType,
    MultiBody,
    MultiBodyKind,
    Pose,
)

FREE, FIXED, JOINT = BaseKind.VOLUMETRIC_ROTATIONAL, BaseKind.FIXED, BaseKind.JOINT


def connection(
    previous: int, following: int, joint: JointType = JointType.REVOLUTE, *limits: tuple[float, float]
) -> Connection:
    return Connection(
        previous, following, joint, Pose(), DHParameters(), Pose(), tuple(JointLimits(*x) for x in limits)
    )


def robot(bases: list[BaseKind], connections: list[Connection], dialect: Dialect = Dialect.D) -> MultiBody:
    bodies = tuple(Body(f"body{i}.g", base) for i, base in enumerate(bases))
    return MultiBody(MultiBodyKind.ACTIVE, bodies, tuple(connections), dialect=dialect)


def order(multibody: MultiBody) -> list[tuple[str, int | None]]:
    dofs = degrees_of_freedom(multibody, build_tree(multibody, DiagnosticLog()))
    return [(str(d.kind), d.connection) for d in dofs]


@pytest.mark.parametrize(
    ("base", "kinds"),
    [
        (BaseKind.PLANAR_TRANSLATIONAL, "x y"),
        (BaseKind.PLANAR_ROTATIONAL, "x y rz"),
        (BaseKind.VOLUMETRIC_TRANSLATIONAL, "x y z"),
        (BaseKind.VOLUMETRIC_ROTATIONAL, "x y z rx ry rz"),
        (BaseKind.FIXED, ""),
    ],
)
def test_a_base_owns_its_numbers(base: BaseKind, kinds: str) -> None:
    assert [kind for kind, _ in order(robot([base], []))] == kinds.split()


def test_lengths_of_a_base_are_unbounded_and_its_angles_are_periodic() -> None:
    free = robot([FREE], [])
    dofs = degrees_of_freedom(free, build_tree(free, DiagnosticLog()))
    assert [(d.lower, d.upper, d.periodic) for d in dofs] == [(-inf, inf, False)] * 3 + [(-pi, pi, True)] * 3


@pytest.mark.parametrize(
    ("joint", "kinds"),
    [
        (JointType.REVOLUTE, ["theta"]),
        (JointType.PRISMATIC, ["d"]),
        (JointType.SPHERICAL, ["theta", "alpha"]),
        (JointType.NON_ACTUATED, []),
        (JointType.SMA, ["theta"]),
    ],
)
def test_a_joint_owns_its_numbers(joint: JointType, kinds: list[str]) -> None:
    assert [kind for kind, _ in order(robot([FIXED, JOINT], [connection(0, 1, joint)]))] == kinds


@pytest.mark.parametrize(
    ("dialect", "expected"),
    [(Dialect.A, [1, 0, 2]), (Dialect.C, [0, 1, 2]), (Dialect.D, [0, 1, 2]), (Dialect.E, [1, 2, 0])],
)
def test_joint_values_follow_bodies_in_a_the_file_in_b_to_d_and_indices_in_e(
    dialect: Dialect, expected: list[int]
) -> None:
    tree = robot([FIXED, JOINT, JOINT, JOINT], [connection(1, 2), connection(0, 1), connection(0, 3)], dialect)
    assert [k for _, k in order(tree)] == expected


def test_joint_values_of_a_closed_chain_follow_the_file_even_in_a() -> None:
    chain = robot([FIXED, JOINT, JOINT], [connection(1, 2), connection(0, 1), connection(0, 2)], Dialect.A)
    assert [k for _, k in order(chain)] == [0, 1, 2]


def test_the_first_connection_to_a_body_places_it_and_the_others_close_loops() -> None:
    chain = robot([FIXED, JOINT, JOINT], [connection(0, 1), connection(1, 2), connection(0, 2)])
    tree = build_tree(chain, DiagnosticLog())
    assert (tree.parent, tree.loops, tree.order) == ((None, 0, 1), (2,), (0, 1, 2))
    assert [d.loop for d in degrees_of_freedom(chain, tree)] == [False, False, True]


def test_a_connection_back_to_the_base_does_not_move_it() -> None:
    chain = robot([FREE, JOINT], [connection(0, 1), connection(1, 0)])
    tree = build_tree(chain, DiagnosticLog())
    assert (tree.parent, tree.loops) == ((None, 0), (1,))


def test_hinges_turn_freely_in_a_and_are_intervals_later() -> None:
    for dialect, periodic in ((Dialect.A, True), (Dialect.B, False), (Dialect.E, False)):
        arm = robot([FIXED, JOINT, JOINT], [connection(0, 1), connection(1, 2, JointType.PRISMATIC)], dialect)
        hinge, slide = degrees_of_freedom(arm, build_tree(arm, DiagnosticLog()))
        assert (hinge.periodic, hinge.lower, hinge.upper) == (periodic, -pi, pi)
        assert (slide.periodic, slide.lower, slide.upper) == (False, -inf, inf)


def test_limits_belong_to_theta_then_alpha() -> None:
    arm = robot([FIXED, JOINT], [connection(0, 1, JointType.SPHERICAL, (-1, 2))])
    theta, alpha = degrees_of_freedom(arm, build_tree(arm, DiagnosticLog()))
    assert (theta.kind, theta.lower, theta.upper) == (DofKind.THETA, -1, 2)
    assert (alpha.kind, alpha.lower, alpha.upper) == (DofKind.ALPHA, -pi, pi)


def test_children_come_after_parents_whatever_the_file_says() -> None:
    arm = robot([JOINT, JOINT, FIXED], [connection(1, 0), connection(2, 1)])
    assert build_tree(arm, DiagnosticLog()).order == (2, 1, 0)


@pytest.mark.parametrize(
    ("bases", "connections", "code"),
    [
        ([JOINT], [], "KIN301"),
        ([FIXED, JOINT], [], "KIN301"),
        ([JOINT, JOINT], [connection(0, 1), connection(1, 0)], "KIN303"),
        ([FIXED, JOINT, JOINT], [connection(1, 2), connection(2, 1)], "KIN303"),
        ([FIXED, JOINT], [connection(1, 1)], "KIN303"),
    ],
)
def test_bodies_that_hang_on_nothing_are_refused(
    bases: list[BaseKind], connections: list[Connection], code: str
) -> None:
    with pytest.raises(KinematicsError) as caught:
        build_tree(robot(bases, connections), DiagnosticLog())
    assert caught.value.code == code
    assert caught.value.diagnostic.hint


def test_a_stray_body_of_dialect_a_gets_a_base_of_its_own() -> None:
    log = DiagnosticLog()
    pair = robot([FREE, JOINT], [], Dialect.A)
    tree = build_tree(pair, log)
    assert tree.bases == {0: FREE, 1: FREE}
    assert [d.code for d in log] == ["KIN302"]
    assert len(degrees_of_freedom(pair, tree)) == 12


def test_a_long_chain_with_many_loops_takes_no_time() -> None:
    n = 20_000
    links = [connection(i, i + 1) for i in range(n)]
    chain = robot([FIXED] + [JOINT] * n, [*links, *links])
    start = time.perf_counter()
    dofs = degrees_of_freedom(chain, build_tree(chain, DiagnosticLog()))
    assert time.perf_counter() - start < 5
    assert sum(d.loop for d in dofs) == n
