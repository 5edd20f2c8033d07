"""Dialects B to E as text: DH angles in radians, `to_dh` before `to_body`."""

from __future__ import annotations

from math import inf, pi

import pytest
from texts import NON_HOLONOMIC, B, C, D, E, Reader, codes, fault, place, warnings

from env2mjcf.kinematics.forward import RobotKinematics
from env2mjcf.kinematics.tree import DofKind
from env2mjcf.limits import Limits
from env2mjcf.model.environment import BaseKind, BoundaryShape, DHForm, Dialect, JointType, MultiBodyKind, Recentring
from env2mjcf.model.scaling import scaled


@pytest.mark.parametrize(("text", "dialect"), [(B, "B"), (C, "C"), (D, "D"), (NON_HOLONOMIC, "D"), (E, "E")])
def test_the_samples_read_without_warnings(read: Reader, text: str, dialect: str) -> None:
    scene = read(text)
    assert scene.dialect is Dialect(dialect)
    assert scene.declared_multibodies == len(scene.multibodies)
    assert not codes(scene)


# Connections.


@pytest.mark.parametrize("text", [B, C, D])
def test_the_first_six_numbers_lead_to_the_dh_frame_and_the_last_six_to_the_body(read: Reader, text: str) -> None:
    first = read(text).robots[0].connections[0]
    assert (first.to_dh.position, first.to_body.position) == ((1, 2, 3), (4, 5, 6))
    assert first.to_dh.rotation == pytest.approx((pi / 2, 0, 0))
    assert first.to_body.rotation == pytest.approx((0, pi / 2, 0))


@pytest.mark.parametrize("text", [B, C, D])
def test_dh_rows_are_alpha_a_d_theta_in_radians(read: Reader, text: str) -> None:
    robot = read(text).robots[0]
    dh = robot.connections[0].dh
    assert (dh.alpha, dh.a, dh.d, dh.theta) == (0.1, 0.2, 0.3, 0.4)
    assert robot.dh_form is DHForm.CRAIG


def test_limits_are_fractions_of_pi(read: Reader) -> None:
    hinge, ball = read(C).robots[0].connections
    assert [(x.lower, x.upper) for x in hinge.limits] == [(-pi / 2, pi / 4)]
    assert [(x.lower, x.upper) for x in ball.limits] == [(-pi, pi), (-0.1 * pi, 0.2 * pi)]


def test_a_spherical_joint_owns_theta_then_alpha(read: Reader) -> None:
    dofs = RobotKinematics.of(read(C).robots[0]).dofs
    assert [d.kind for d in dofs] == [DofKind.X, DofKind.Y, DofKind.RZ, DofKind.THETA, DofKind.THETA, DofKind.ALPHA]
    assert [(d.lower, d.upper) for d in dofs[3:]] == [(-pi / 2, pi / 4), (-pi, pi), (-0.1 * pi, 0.2 * pi)]


def test_dialect_b_has_no_limits(read: Reader) -> None:
    robot = read(B).robots[0]
    assert [c.limits for c in robot.connections] == [(), ()]
    hinges = [d for d in RobotKinematics.of(robot).dofs if d.connection is not None]
    assert {(d.lower, d.upper, d.periodic) for d in hinges} == {(-pi, pi, False)}


@pytest.mark.parametrize("text", [C, D])
def test_missing_limits_are_a_whole_turn_with_a_warning(read: Reader, text: str) -> None:
    scene = read(text.replace("Revolute -0.5:0.25", "Revolute"))
    (warning,) = warnings(scene)
    assert (warning.code, warning.hint) == ("ENV204", "write -1:1")
    dof = next(d for d in RobotKinematics.of(scene.robots[0]).dofs if d.kind is DofKind.THETA)
    assert (dof.lower, dof.upper) == (-pi, pi)


def test_a_slide_of_a_later_dialect_has_limits_in_lengths(read: Reader) -> None:
    scene = read(C.replace("Revolute -0.5:0.25", "Prismatic -7:9"))
    (limits,) = scene.robots[0].connections[0].limits
    assert (limits.lower, limits.upper) == (-7, 9)
    assert "ENV304" in [d.code for d in scene.diagnostics]
    assert not codes(scene)


def test_a_slide_without_limits_is_unbounded(read: Reader) -> None:
    scene = read(C.replace("Revolute -0.5:0.25", "Prismatic"))
    assert codes(scene) == ["ENV204"]
    (slide,) = (d for d in RobotKinematics.of(scene.robots[0]).dofs if d.kind is DofKind.D)
    assert (slide.lower, slide.upper) == (-inf, inf)


def test_limits_of_more_than_a_turn_look_like_degrees(read: Reader) -> None:
    assert codes(read(C.replace("-0.5:0.25", "-90:90"))) == ["ENV305"]
    assert not codes(read(C.replace("-0.5:0.25", "-2:2")))


def test_dh_angles_of_more_than_two_turns_look_like_degrees(read: Reader) -> None:
    text = B.replace("0.1 0.2 0.3 0.4", "0.1 0.2 0.3 30")
    (warning,) = warnings(read(text))
    assert warning.code == "ENV303"
    assert (warning.span and warning.span.line, warning.span and warning.span.column) == place(text, "0.1 0.2 0.3 30")


def test_an_sma_joint_has_two_more_numbers(read: Reader) -> None:
    text = C.replace("Revolute -0.5:0.25", "SMAJoint 0:1").replace("0.1 0.2 0.3 0.4", "0.1 0.2 0.3 0.4 1.5 2.5")
    connection = read(text).robots[0].connections[0]
    assert connection.joint is JointType.SMA
    assert connection.sma is not None
    assert (connection.sma.length, connection.sma.width) == (1.5, 2.5)
    assert connection.to_body.position == (4, 5, 6)


@pytest.mark.parametrize(("text", "expected"), [(B, []), (C, []), (D, ["ENV205", "ENV205"])])
def test_the_singular_connection_is_a_fault_for_dialect_d_only(read: Reader, text: str, expected: list[str]) -> None:
    scene = read(text.replace("Connections", "Connection"))
    assert codes(scene) == expected
    assert scene == read(text)


@pytest.mark.parametrize("text", [B, C])
def test_early_readers_take_any_word_for_connections(read: Reader, text: str) -> None:
    scene = read(text.replace("Connections", "Joints"))
    assert codes(scene) == ["ENV202"]
    assert scene == read(text)


def test_dialect_d_takes_only_connections(read: Reader) -> None:
    text = D.replace("Connections", "Links", 1)
    found = fault(read, text)
    assert (found.code, found.span and found.span.line) == ("ENV120", place(text, "Links")[0])
    assert "unknown tag 'Links'; expected 'Connections' or 'Connection'" in found.message


def test_a_missing_connections_block_is_named(read: Reader) -> None:
    text = D.replace("Volumetric Translational\nConnections\n0\n", "Volumetric Translational\n")
    found = fault(read, text)
    assert "unknown tag 'Internal'; expected 'Connections'" in found.message


@pytest.mark.parametrize("tag", ["ACTIVE", "active", "aCtIvE"])
def test_keywords_have_no_case(read: Reader, tag: str) -> None:
    text = D.replace("Active", tag).replace("Joint", "JOINT").replace("Revolute", "revolute")
    scene = read(text.replace("Boundary", "BOUNDARY").replace("PositionRes", "positionres"))
    assert not codes(scene)
    assert scene == read(D)


def test_file_names_keep_their_case(read: Reader) -> None:
    assert read(D.replace("base.g", "Base.G")).robots[0].bodies[0].filename == "Base.G"


# Bodies.


@pytest.mark.parametrize(
    ("words", "base"),
    [
        ("Planar Rotational", BaseKind.PLANAR_ROTATIONAL),
        ("PLANAR translational", BaseKind.PLANAR_TRANSLATIONAL),
        ("Volumetric\nRotational", BaseKind.VOLUMETRIC_ROTATIONAL),
        ("volumetric Translational", BaseKind.VOLUMETRIC_TRANSLATIONAL),
    ],
)
def test_a_base_has_a_kind_and_a_movement(read: Reader, words: str, base: BaseKind) -> None:
    assert read(B.replace("Volumetric Rotational", words)).robots[0].bodies[0].base is base


def test_a_fixed_base_has_a_pose_and_the_others_have_none(read: Reader) -> None:
    fixed, joint, _ = read(D).robots[0].bodies
    assert fixed.pose is not None
    assert fixed.pose.position == (1, 2, 3)
    assert fixed.pose.rotation == pytest.approx((0, 0, pi / 2))
    assert (joint.base, joint.pose) == (BaseKind.JOINT, None)


def test_options_may_touch_each_other_and_the_next_number(read: Reader) -> None:
    scene = read(D)
    textured = scene.robots[0].bodies[2]
    assert (textured.texture, textured.color) == ("wood.png", (0, 0, 1, 1))
    (surface,) = scene.surfaces
    assert surface.label == "floor"
    floor = surface.bodies[0]
    assert (floor.filename, floor.color) == ("floor.g", (0, 0, 0, 1))
    assert floor.pose is not None
    assert floor.pose.position == (-1.02, -3.54, 0)


def test_a_minus_sign_behind_the_file_may_be_a_coordinate(read: Reader) -> None:
    pose = read(E.replace("wall.g -c(0 0 1 1) 0", "wall.g -.5")).obstacles[0].bodies[0].pose
    assert pose is not None
    assert pose.position == (-0.5, 2, 0)


@pytest.mark.parametrize(
    ("option", "expected"),
    [
        ("", Recentring.COM),
        ("-a(None)", Recentring.NONE),
        ("-A(NONE)", Recentring.NONE),
        ("-a( surface )", Recentring.SURFACE),
        ("-a(com)", Recentring.COM),
        ("-a(None) -a(COM)", Recentring.COM),
    ],
)
def test_the_adjustment_says_what_is_subtracted_from_the_vertices(
    read: Reader, option: str, expected: Recentring
) -> None:
    assert read(E.replace("-c(0 0 1 1)", option)).obstacles[0].bodies[0].recentring is expected


def test_a_texture_keeps_blanks_and_case(read: Reader) -> None:
    assert read(E.replace("-c(0 0 1 1)", "-t( My Wood.PNG )")).obstacles[0].bodies[0].texture == "My Wood.PNG"


def test_a_mass_stands_in_front_of_the_base(read: Reader) -> None:
    assert [b.mass for b in read(D).robots[0].bodies] == [None, 2.5, None]


def test_a_surface_may_lack_its_label(read: Reader) -> None:
    for start in ("floor.g -c(0 0 0 1)-1.02", "floor.g -1.02", "floor.g 1.02"):
        (surface,) = read(D.replace("floor\nfloor.g -c(0 0 0 1)-1.02", start)).surfaces
        assert (surface.label, surface.bodies[0].filename) == (None, "floor.g")


def test_a_visualiser_colour_yields_to_the_files_own(read: Reader) -> None:
    text = "#VIZMO_COLOR 1 0.5 0.25\n"
    scene = read(E.replace("wall.g", f"{text}wall.g").replace("pillar.g", f"{text}pillar.g"))
    assert [m.bodies[0].color for m in scene.obstacles] == [(0, 0, 1, 1), (1, 0.5, 0.25, 1)]


def test_colours_outside_zero_to_one_are_a_warning(read: Reader) -> None:
    scene = read(E.replace("-c(0 0 1 1)", "-c(0 0 255 1)"))
    assert codes(scene) == ["ENV215"]
    assert scene.obstacles[0].bodies[0].color == (0, 0, 255, 1)


def test_adjacencies_are_pairs_of_bodies(read: Reader) -> None:
    assert read(D).robots[0].adjacencies == ((0, 2),)
    more = read(D.replace("Adjacencies\n1\n0 2", "Adjacencies\n1\n0 2\n1 2"))
    assert (more.robots[0].adjacencies, codes(more)) == (((0, 2), (1, 2)), ["ENV203"])


def test_a_robot_without_connections_is_composite(read: Reader) -> None:
    text = "1\nActive\n2\na.g Planar Translational\nb.g Volumetric Translational\nConnections\n0\n"
    dofs = RobotKinematics.of(read(text).robots[0]).dofs
    assert [(d.body, d.kind) for d in dofs] == [(0, "x"), (0, "y"), (1, "x"), (1, "y"), (1, "z")]


def test_every_active_multibody_is_a_robot(read: Reader) -> None:
    assert [len(r.bodies) for r in read(D).robots] == [3, 1]


def test_control_vectors_are_physical_lines(read: Reader) -> None:
    robot = read(NON_HOLONOMIC).robots[0]
    assert robot.kind is MultiBodyKind.NON_HOLONOMIC
    assert robot.velocity_bounds is not None
    assert (robot.velocity_bounds.linear, robot.velocity_bounds.angular) == (2, 0.5)
    assert robot.controls == ((1, 0, 0), (0, 0.5, 0.25), (-1, 0, 0))


def test_blank_lines_and_comments_count_as_controls(read: Reader) -> None:
    scene = read(NON_HOLONOMIC.replace("1 0 0\n0 0.5 0.25", "\n# stop"))
    assert scene.robots[0].controls == ((), (), (-1, 0, 0))
    assert codes(scene) == ["ENV217"]


def test_controls_end_at_their_line(read: Reader) -> None:
    text = NON_HOLONOMIC.replace("0 0.5 0.25\n-1 0 0\n", "0 0.5 nan\n-1 0 0\n")
    found = fault(read, text)
    assert (found.code, found.span and found.span.line) == ("ENV113", place(text, "nan")[0])
    assert fault(read, NON_HOLONOMIC.replace("Controls 3\n", "Controls 3 4\n")).code == "ENV112"
    assert "control 4 of 4" in fault(read, NON_HOLONOMIC.replace("Controls 3", "Controls 4")).message


def test_a_control_line_that_may_be_cut_off_is_a_warning(read: Reader) -> None:
    assert "ENV210" in codes(read(NON_HOLONOMIC.rstrip() + " "))


# Boundary and header.


@pytest.mark.parametrize(
    ("text", "shape", "lower", "upper"),
    [
        ("Box -1:2 -3:4 -5:6", "Box", (-1, -3, -5), (2, 4, 6)),
        ("Box -1:2 -3:4", "Box", (-1, -3), (2, 4)),
        ("box\t-1e0:+2  -3.:4", "Box", (-1, -3), (2, 4)),
        ("Box [-1:2 ; -3:4 ; -5:6]", "Box", (-1, -3, -5), (2, 4, 6)),
        ("Box [ -1 : 2;-3 :4; -5: 6 ]", "Box", (-1, -3, -5), (2, 4, 6)),
        ("Box[-1:2;-3:4;-5:6]", "Box", (-1, -3, -5), (2, 4, 6)),
        ("Box [-1:2 ; -3:4]", "Box", (-1, -3), (2, 4)),
        ("Box2D [-1:2 ; -3:4]", "Box2D", (-1, -3), (2, 4)),
        ("Box [-1:2 ; -3:4 ; # comment\n -5:6]", "Box", (-1, -3, -5), (2, 4, 6)),
    ],
)
def test_a_box_has_two_or_three_ranges(
    read: Reader, text: str, shape: str, lower: tuple[float, ...], upper: tuple[float, ...]
) -> None:
    boundary = read(f"Boundary {text}\nMultibodies\n1\nPassive\nw.g 0 0 0 0 0 0\n").boundary
    assert boundary is not None
    assert (boundary.shape, boundary.lower, boundary.upper) == (BoundaryShape(shape), lower, upper)


@pytest.mark.parametrize(
    ("text", "shape", "center"),
    [
        ("Sphere 1 -2 3 4.5", "Sphere", (1, -2, 3)),
        ("Sphere [ 1 -2 3 ; 4.5 ]", "Sphere", (1, -2, 3)),
        ("Sphere [1 -2 3;4.5]", "Sphere", (1, -2, 3)),
        ("Sphere [1 -2;4.5]", "Sphere", (1, -2)),
        ("Sphere2D [ 1 -2 ; 4.5 ]", "Sphere2D", (1, -2)),
    ],
)
def test_a_ball_has_a_centre_and_a_radius(read: Reader, text: str, shape: str, center: tuple[float, ...]) -> None:
    boundary = read(f"Boundary {text}\nMultibodies\n1\nPassive\nw.g 0 0 0 0 0 0\n").boundary
    assert boundary is not None
    assert (boundary.shape, boundary.center, boundary.radius) == (BoundaryShape(shape), center, 4.5)


def test_a_boundary_without_a_shape_is_a_box_with_a_warning(read: Reader) -> None:
    text = "Boundary [-1:1 ; -2:2 ; -3:3]\nObstacles\n1\nPassive\nw.g 0 0 0 0 0 0\n"
    scene = read(text)
    assert scene.boundary is not None
    assert (scene.boundary.shape, scene.boundary.upper) == (BoundaryShape.BOX, (1, 2, 3))
    assert codes(scene) == ["ENV206"]


def test_a_flat_box_with_three_ranges_uses_all_of_them(read: Reader) -> None:
    scene = read(D.replace("Box [", "Box2D ["))
    assert codes(scene) == ["ENV207"]
    assert scene.boundary is not None
    assert len(scene.boundary.upper) == 3


@pytest.mark.parametrize(
    ("boundary", "code", "message"),
    [
        ("Box [1:-1 ; -1:1 ; -1:1]", "ENV114", "the x range of the boundary 1:-1 is empty"),
        ("Box [-1:1]", "ENV119", "a box with one range; expected two or three"),
        ("Box [-1:1 ; -1:1 ; -1:1", "ENV112", "expected ']' after the boundary, found 'MultiBodies'"),
        ("Box [-1,1 ; -1:1 ; -1:1]", "ENV112", "lower end of the x range of the boundary"),
        ("Box [-1 1 ; -1:1 ; -1:1]", "ENV112", "expected ':' between the two ends of the x range"),
        ("Box [-1:inf ; -1:1 ; -1:1]", "ENV113", "expected a number (upper end of the x range"),
        ("Sphere [0 0 0 ; 0]", "ENV119", "radius 0; expected a positive number"),
        ("Sphere [0 0 0 ; -2]", "ENV119", "radius -2; expected a positive number"),
        ("Sphere [0 0 0 2]", "ENV112", "expected ';' before the radius, found '2]'"),
        ("Cylinder [0 0 0 ; 2]", "ENV125", "unknown boundary shape 'Cylinder'; expected 'Box', 'Box2D'"),
        ("CSpace Box [0 0 0 ; 2]", "ENV125", "unknown boundary shape 'CSpace'"),
    ],
)
def test_a_bad_boundary_is_refused_on_its_line(read: Reader, boundary: str, code: str, message: str) -> None:
    text = f"# here\nBoundary {boundary}\nMultiBodies\n1\nActive\n1\nw.g Planar Rotational\nConnections\n0\n"
    found = fault(read, text)
    assert found.code == code
    assert message in found.message
    assert found.span is not None
    assert found.span.line == (3 if "MultiBodies" in message else 2)


@pytest.mark.parametrize("word", ["BoundaryBox", "BoundingBox", "BoundarySphere"])
def test_one_word_for_boundary_and_shape_is_not_accepted(read: Reader, word: str) -> None:
    found = fault(read, D.replace("Boundary Box", word))
    assert found.code in ("ENV112", "ENV120", "ENV125", "ENV130")


def test_resolutions_are_read_and_the_orientation_is_in_pi(read: Reader) -> None:
    resolution = read(D).resolution
    assert (resolution.position, resolution.position_factor) == (0.05, None)
    assert resolution.orientation == pytest.approx(0.1 * pi)
    text = D.replace("PositionRes 0.05", "PositionResFactor 0.2\nTimeRes 0.3 # comment\nRDRes 0.4\nPositionRes 5")
    resolution = read(text).resolution
    assert (resolution.position, resolution.position_factor, resolution.time, resolution.rd) == (5, 0.2, 0.3, 0.4)


@pytest.mark.parametrize("value", ["-1", "0"])
def test_a_resolution_that_is_no_step_is_left_to_the_planner(read: Reader, value: str) -> None:
    scene = read(D.replace("PositionRes 0.05", f"PositionRes {value}"))
    assert scene.resolution.position is None
    assert "ENV306" in [d.code for d in scene.diagnostics]


def test_an_unknown_word_in_the_header_is_refused(read: Reader) -> None:
    text = D.replace("Orientation 0.1", "Colour 0.1")
    found = fault(read, text)
    assert found.code == "ENV120"
    assert "unknown tag 'Colour'; expected 'PositionRes'" in found.message
    assert (found.span and found.span.line, found.span and found.span.column) == place(text, "Colour")


# Obstacles and dialect E.


def test_an_obstacle_of_dialect_e_may_say_that_it_is_fixed(read: Reader) -> None:
    internal = read(E).obstacles[1]
    assert internal.kind is MultiBodyKind.INTERNAL
    assert internal.bodies[0].pose is not None
    assert internal.bodies[0].pose.position == (1, 2, 3)


def test_an_obstacle_cannot_move(read: Reader) -> None:
    text = E.replace("Fixed 1 2 3 0 0 0", "Planar Rotational")
    found = fault(read, text)
    assert (found.code, found.span and found.span.line) == ("ENV123", place(text, "Planar")[0])
    assert "an obstacle with a Planar Rotational base; expected Fixed" in found.message


def test_a_robot_in_dialect_e_is_read_with_a_warning(read: Reader) -> None:
    scene = read(D, dialect="E")
    assert codes(scene) == ["ENV216", "ENV216", "ENV216"]
    assert scene.robots[0].dh_form is DHForm.STANDARD


def test_a_misspelt_robot_keeps_the_kinematics_of_its_dialect(read: Reader) -> None:
    scene = read(D.replace("Active", "Actve"))
    assert scene.dialect is Dialect.D
    assert scene.robots[0].dh_form is DHForm.CRAIG
    assert set(codes(scene)) == {"ENV202"}


def test_a_scene_without_robots_is_no_fault(read: Reader) -> None:
    scene = read(E)
    assert (scene.robots, len(scene.obstacles), codes(scene)) == ((), 2, [])
    assert "ENV310" in [d.code for d in scene.diagnostics]


@pytest.mark.parametrize("text", [B, C, D, E])
def test_the_last_token_needs_a_newline(read: Reader, text: str) -> None:
    scene = read(text.rstrip())
    assert codes(scene) == ["ENV210"]
    assert scene == read(text)
    assert not codes(read(text.rstrip() + " "))


# Wrong counts.


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("MultiBodies\n4", "MultiBodies\n3", "the file declares 3 multibodies and has 4; read 4"),
        ("MultiBodies\n4", "MultiBodies\n5", "the file declares 5 multibodies and has 4; read 4"),
        ("Active\n3", "Active\n1", "the file declares 1 body and has 3; read 3"),
        ("Active\n3", "Active\n4", "the file declares 4 bodies and has 3; read 3"),
        ("Connections\n2", "Connections\n1", "the file declares 1 connection and has 2; read 2"),
        ("Connections\n2", "Connections\n3", "the file declares 3 connections and has 2; read 2"),
        ("Adjacencies\n1", "Adjacencies\n2", "the file declares 2 adjacencies and has 1; read 1"),
    ],
)
def test_a_wrong_count_is_a_warning_and_the_file_is_believed(read: Reader, old: str, new: str, what: str) -> None:
    text = D.replace(old, new, 1)
    scene = read(text)
    (warning,) = warnings(scene)
    assert (warning.code, warning.message) == ("ENV203", what)
    assert (warning.span and warning.span.line, warning.span and warning.span.column) == (place(text, new)[0] + 1, 1)
    assert scene.multibodies == read(D).multibodies


@pytest.mark.parametrize(
    ("old", "new", "code", "message"),
    [
        ("MultiBodies\n4", "MultiBodies\n1000000000", "ENV110", "the number of multibodies is 1000000000"),
        ("Active\n3", "Active\n1000000000", "ENV110", "the number of bodies is 1000000000"),
        ("Connections\n2", "Connections\n1000000000", "ENV110", "the number of connections is 1000000000"),
        ("Adjacencies\n1", "Adjacencies\n1000000000", "ENV110", "the number of adjacencies is 1000000000"),
        ("Active\n3", "Active\n-1", "ENV110", "the number of bodies is -1; expected 0"),
        ("MultiBodies\n4", "MultiBodies\n-4", "ENV110", "the number of multibodies is -4; expected 0"),
        ("\n0 2\n", "\n0 3\n", "ENV115", "body index 3 is out of range"),
        ("0 1 Revolute", "0 9 Revolute", "ENV115", "body index 9 is out of range; this multibody has 3 bodies, 0 to 2"),
        ("0 1 Revolute", "0 0 Revolute", "ENV116", "a connection from body 0 to itself"),
        ("0 1 Revolute", "0 1 Helical", "ENV121", "unknown joint type 'Helical'"),
        ("-0.5:0.25", "0.25:-0.5", "ENV114", "a joint's limits 0.25:-0.5 is empty; expected lower:upper"),
        ("-0.5:0.25", "-0.5:nan", "ENV113", "expected a number (upper end of a joint's limits), found 'nan'"),
        ("-0.5:0.25", "-0.5:1e999", "ENV113", "1e999 is too large for a number"),
        ("2.5 Joint", "0 Joint", "ENV118", "mass 0; expected a positive number"),
        ("2.5 Joint", "-2.5 Joint", "ENV118", "mass -2.5; expected a positive number"),
        ("2.5 Joint", "2.5 Hinge", "ENV123", "unknown base 'Hinge'; expected 'Planar', 'Volumetric', 'Fixed' or"),
        ("Volumetric Translational", "Volumetric Free", "ENV123", "unknown movement 'Free'; expected 'Rotational'"),
        ("-a(None)", "-a(Centre)", "ENV124", "unknown adjustment 'Centre'; expected COM, Surface or None"),
        ("-a(None)", "-x(None)", "ENV124", "unknown body option -x; expected -a(...), -c(...) or -t(...)"),
        ("-a(None)", "-a(None", "ENV112", "expected ')' at the end of -a(...)"),
        ("-c(0 1 0 1)", "-c(0 1 0)", "ENV112", "expected a number (alpha), found ')'"),
        ("-c(0 1 0 1)", "-c 0 1 0 1", "ENV112", "expected '(' after -c"),
        ("Fixed 1 2 3 0 0 90", "Fixed 1 2 3 0 0", "ENV112", "expected a number (rz), found 'link1.g'"),
        ("pillar.g -1 2 0", "pillar.g -nan 2 0", "ENV113", "expected a number (x), found '-nan'"),
        ("pillar.g -1 2 0", "pillar.g nan 2 0", "ENV113", "expected a number (x), found 'nan'"),
        ("pillar.g -1 2 0", "pillar.g inf 2 0", "ENV113", "expected a number (x), found 'inf'"),
        ("pillar.g -1 2 0", "pillar.g -1 0x2 0", "ENV112", "expected a number (y), found '0x2'"),
        ("Internal\npillar", "Obstacle\npillar", "ENV209", ""),
    ],
)
def test_bad_input_says_what_was_found_and_expected_and_where(
    read: Reader, old: str, new: str, code: str, message: str
) -> None:
    text = D.replace(old, new, 1)
    if code == "ENV209":
        text = D.replace("MultiBodies\n4", "MultiBodies\n9").replace(old, new)
        found = fault(read, text)
        assert (found.code, found.message[:38]) == ("ENV120", "unknown multibody tag 'Obstacle'; expe")
        return
    found = fault(read, text)
    assert found.code == code
    assert message in found.message
    assert found.span is not None
    changed = next(i for i, (a, b) in enumerate(zip(D, text, strict=False)) if a != b)
    lines = {text[: changed + 1].count("\n") + 1, text[: changed + 1].count("\n") + 2}
    assert found.span.line in lines


def test_a_body_that_no_connection_reaches_has_no_place(read: Reader) -> None:
    text = B.replace("0 1 Revolute", "0 2 Revolute").replace("1 2 Spherical", "0 2 Spherical")
    found = fault(read, text)
    assert (found.code, "no connection leads to it" in found.message) == ("KIN301", True)
    assert (found.span and found.span.line, found.span and found.span.column) == place(text, "link1.g")


def test_a_robot_without_a_base_is_refused(read: Reader) -> None:
    found = fault(read, B.replace("base.g Volumetric Rotational", "base.g Joint"))
    assert found.code == "KIN301"
    assert "base.g" in found.message


def test_a_cycle_that_no_base_belongs_to_is_refused(read: Reader) -> None:
    text = B.replace("0 1 Revolute", "2 1 Revolute")
    found = fault(read, text)
    assert found.code == "KIN303"
    assert "hangs in a cycle of connections that no base belongs to" in found.message
    assert (found.span and found.span.line, found.span and found.span.column) == place(text, "link1.g")


def test_a_robot_without_bodies_is_refused(read: Reader) -> None:
    text = "1\nActive\n0\nConnections\n0\n"
    found = fault(read, text)
    assert (found.code, found.span and found.span.line) == ("ENV117", 3)


def test_limits_bound_the_whole_scene(read: Reader) -> None:
    for options in ({"bodies": 5}, {"connections": 1}, {"name_length": 7}):
        assert fault(read, D, limits=Limits(**options)).code in ("ENV109", "ENV110")
    assert read(D, limits=Limits(bodies=6, connections=2)).robots


def test_page_semantics_concern_dialect_a_only(read: Reader) -> None:
    with pytest.raises(ValueError, match="concerns dialect A only"):
        read(B, semantics="page")


def test_every_length_is_scaled_and_no_angle(read: Reader) -> None:
    text = C.replace("Revolute -0.5:0.25", "SMAJoint 0:1").replace("0.1 0.2 0.3 0.4", "0.1 0.2 0.3 0.4 1.5 2.5")
    scene = scaled(read(text.replace("Spherical -1:1 -0.1:0.2", "Prismatic -1:2")), 10)
    first, second = scene.robots[0].connections
    assert (first.to_dh.position, first.dh.a, first.dh.d, first.dh.alpha) == ((10, 20, 30), 2, 3, 0.1)
    assert first.sma is not None
    assert (first.sma.length, first.sma.width) == (15, 25)
    assert (second.limits[0].lower, second.limits[0].upper) == (-10, 20)
    assert first.limits[0].upper == pytest.approx(pi)
    assert scene.boundary is not None
    assert scene.boundary.upper == (100, 200, 300)
    car = scaled(read(NON_HOLONOMIC), 10).robots[0]
    assert car.velocity_bounds is not None
    assert (car.velocity_bounds.linear, car.velocity_bounds.angular) == (20, 0.5)
