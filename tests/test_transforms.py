"""Rotations, quaternions and DH rows, against numbers made without this package and against algebra."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from env2mjcf.model.environment import DHForm, Pose
from env2mjcf.transforms import (
    angles_from_quaternion,
    dh_matrix,
    inverse,
    pose_gaps,
    pose_matrix,
    quaternion_from_angles,
    quaternion_from_matrix,
    rotation_matrix,
    transform,
    wrap,
)

ANGLES = st.tuples(*[st.floats(-4, 4)] * 3)


def rotate(quaternion: np.ndarray, vector: np.ndarray) -> np.ndarray:
    w, v = quaternion[0], quaternion[1:]
    return vector + 2 * np.cross(v, np.cross(v, vector) + w * vector)


def test_six_numbers_turn_about_fixed_axes_x_then_y_then_z() -> None:
    # Rz(0.3) Ry(0.2) Rx(0.1), made without this package.
    expected = [[0.936293, -0.275096, 0.218351], [0.289629, 0.956425, -0.036957], [-0.198669, 0.097843, 0.975170]]
    np.testing.assert_allclose(rotation_matrix(0.1, 0.2, 0.3), expected, atol=5e-7)


def test_a_craig_row_is_the_printed_matrix() -> None:
    # Craig, Introduction to Robotics, equation 3.6, with numbers put in.
    expected = [
        [0.764842, -0.644218, 0, 2],
        [0.615445, 0.730682, -0.295520, -1.477601],
        [0.190379, 0.226026, 0.955336, 4.776682],
        [0, 0, 0, 1],
    ]
    np.testing.assert_allclose(dh_matrix(DHForm.CRAIG, 0.3, 2, 5, 0.7), expected, atol=5e-7)


def test_a_standard_row_is_the_printed_product() -> None:
    alpha, a, d, theta = 0.3, 2.0, 5.0, 0.7
    ca, sa, ct, st_ = math.cos(alpha), math.sin(alpha), math.cos(theta), math.sin(theta)
    expected = [[ct, -st_ * ca, st_ * sa, a * ct], [st_, ct * ca, -ct * sa, a * st_], [0, sa, ca, d], [0, 0, 0, 1]]
    np.testing.assert_allclose(dh_matrix(DHForm.STANDARD, alpha, a, d, theta), expected, atol=1e-15)


@pytest.mark.parametrize("angle", [1e-9, 1e-4, 2.0])
def test_the_gap_of_two_poses_keeps_its_digits_for_tiny_turns(angle: float) -> None:
    # A point at distance r from the axis of a turn by w moves by 2 r sin(w / 2).
    moved = transform(rotation_matrix(0, 0, angle), (3e-10, 0, 0))
    assert pose_gaps(moved, np.eye(4), 5.0) == pytest.approx(3e-10 + 10 * math.sin(angle / 2), rel=1e-6)


def test_the_two_forms_agree_without_twist_and_offset() -> None:
    theta = np.linspace(-3, 3, 7)
    np.testing.assert_allclose(
        dh_matrix(DHForm.CRAIG, 0, 0, 1.5, theta), dh_matrix(DHForm.STANDARD, 0, 0, 1.5, theta), atol=1e-15
    )


@given(ANGLES)
def test_a_quaternion_turns_vectors_as_its_matrix_does(angles: tuple[float, float, float]) -> None:
    matrix, quaternion = rotation_matrix(*angles), quaternion_from_angles(*angles)
    for axis in np.eye(3):
        np.testing.assert_allclose(rotate(quaternion, axis), matrix @ axis, atol=1e-14)


@given(ANGLES)
def test_a_matrix_gives_its_quaternion_back(angles: tuple[float, float, float]) -> None:
    matrix = rotation_matrix(*angles)
    quaternion = quaternion_from_matrix(matrix)
    assert quaternion[0] >= 0
    for axis in np.eye(3):
        np.testing.assert_allclose(rotate(quaternion, axis), matrix @ axis, atol=1e-14)


@given(ANGLES)
def test_angles_come_back_as_an_equal_rotation(angles: tuple[float, float, float]) -> None:
    found = angles_from_quaternion(quaternion_from_angles(*angles))
    # Near ry = +-90 degrees arcsin loses half the digits.
    np.testing.assert_allclose(rotation_matrix(*found), rotation_matrix(*angles), atol=3e-7)


@pytest.mark.parametrize("pitch", [math.pi / 2, -math.pi / 2])
def test_a_locked_gimbal_still_gives_an_equal_rotation(pitch: float) -> None:
    angles = (0.4, pitch, -0.9)
    found = angles_from_quaternion(quaternion_from_angles(*angles))
    np.testing.assert_allclose(rotation_matrix(*found), rotation_matrix(*angles), atol=3e-7)


@given(ANGLES, st.tuples(*[st.floats(-10, 10)] * 3))
def test_an_inverse_undoes(angles: tuple[float, float, float], position: tuple[float, float, float]) -> None:
    t = pose_matrix(Pose(position, angles))
    np.testing.assert_allclose(inverse(t) @ t, np.eye(4), atol=1e-13)


@given(st.floats(-1e3, 1e3))
def test_wrapping_changes_an_angle_by_whole_turns(angle: float) -> None:
    wrapped = float(wrap(angle))
    assert -math.pi <= wrapped < math.pi
    turns = (angle - wrapped) / (2 * math.pi)
    assert abs(turns - round(turns)) < 1e-9


def test_an_angle_that_needs_no_wrapping_keeps_every_digit() -> None:
    assert float(wrap(0.1)) == 0.1
    assert float(wrap(-math.pi)) == -math.pi


def test_half_a_turn_has_one_name() -> None:
    assert [float(a) for a in wrap([math.pi, -math.pi, 3 * math.pi])] == [-math.pi] * 3
