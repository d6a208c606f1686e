"""Conventions: viewing directions, intrinsics and MuJoCo's camera. Pictures: sensors/test_render.py."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusion.geometry import Transform, rotation_rpy
from scenarios.load import load_sensor
from scenarios.scenario import CameraSensor, Pose
from simbench.axes import (
    R_BODY_OPTICAL,
    R_OPTICAL_MUJOCO,
    T_parent_body,
    T_parent_optical,
    mujoco_camera,
    pinhole,
    vertical_fov_deg,
)


def ahead(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Transform:
    return T_parent_optical(Pose(xyz_m=(1.0, 2.0, 3.0), rpy_deg=(roll, pitch, yaw)))


def test_a_camera_that_looks_ahead_has_x_to_the_right_y_down_z_forward() -> None:
    T = ahead()
    np.testing.assert_allclose(T.rotation @ [1, 0, 0], [0, -1, 0], atol=1e-15)  # right is -y of the ego
    np.testing.assert_allclose(T.rotation @ [0, 1, 0], [0, 0, -1], atol=1e-15)
    np.testing.assert_allclose(T.rotation @ [0, 0, 1], [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(T.translation_m, [1, 2, 3])


def test_yaw_turns_to_the_left_pitch_looks_down_roll_leans_right() -> None:
    np.testing.assert_allclose(ahead(yaw=90.0).rotation @ [0, 0, 1], [0, 1, 0], atol=1e-15)
    down = ahead(pitch=30.0).rotation @ [0, 0, 1]
    np.testing.assert_allclose(down, [np.cos(np.pi / 6), 0, -0.5], atol=1e-15)
    right_side = ahead(roll=10.0).rotation @ [1, 0, 0]
    assert right_side[2] < 0.0  # the picture's right side goes down


def test_mujocos_camera_looks_along_minus_z_with_y_up() -> None:
    position, matrix = mujoco_camera(ahead())
    axes = matrix.reshape(3, 3)
    np.testing.assert_allclose(position, [1, 2, 3])
    np.testing.assert_allclose(-axes[:, 2], [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(axes[:, 1], [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(axes[:, 0], [0, -1, 0], atol=1e-15)


@given(rpy=st.tuples(*[st.floats(-180, 180)] * 3))
def test_all_axes_are_rotations_and_the_body_is_before_the_optical_frame(
    rpy: tuple[float, float, float],
) -> None:
    for R in (R_BODY_OPTICAL, R_OPTICAL_MUJOCO):
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)
        assert np.linalg.det(R) == pytest.approx(1.0)
    pose = Pose(xyz_m=(0.1, 0.2, 0.3), rpy_deg=rpy)
    np.testing.assert_allclose(T_parent_body(pose).rotation, rotation_rpy(*np.deg2rad(rpy)), atol=1e-15)
    np.testing.assert_allclose(T_parent_optical(pose).rotation, T_parent_body(pose).rotation @ R_BODY_OPTICAL)


def camera(**changes: object) -> CameraSensor:
    sensor = load_sensor("camera-96deg")
    assert isinstance(sensor, CameraSensor)
    return sensor.model_copy(update=changes)


@given(fov=st.floats(5.0, 160.0), width=st.integers(16, 4000), height=st.integers(16, 4000))
def test_the_image_spans_exactly_the_horizontal_field_of_view(fov: float, width: int, height: int) -> None:
    made = pinhole(camera(fov_deg=fov, width_px=width, height_px=height))
    half = np.deg2rad(fov / 2.0)
    edges = made.project(np.array([[-np.tan(half), 0.0, 1.0], [np.tan(half), 0.0, 1.0]]))
    np.testing.assert_allclose(edges, [[0.0, height / 2], [width, height / 2]], atol=1e-6 * width)
    top = np.tan(np.deg2rad(vertical_fov_deg(made) / 2.0))
    assert made.project(np.array([[0.0, -top, 1.0]]))[0, 1] == pytest.approx(0.0, abs=1e-6 * height)


def test_pixels_are_square_and_the_focal_length_is_the_textbooks() -> None:
    made = pinhole(camera(fov_deg=90.0, width_px=960, height_px=600))
    assert made.fx_px == made.fy_px == pytest.approx(480.0)
    assert (made.cx_px, made.cy_px) == (480.0, 300.0)
    assert vertical_fov_deg(made) == pytest.approx(2.0 * np.rad2deg(np.arctan(300.0 / 480.0)))
