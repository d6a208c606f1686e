"""Projection equals OpenCV's; its inverse undoes it."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusion.camera import PinholeCamera, inside_box, project_points
from fusion.geometry import Transform, rotation_exp

PLAIN = PinholeCamera(fx_px=432.1, fy_px=430.7, cx_px=480.5, cy_px=299.25, width_px=960, height_px=600)
DISTORTED = replace(PLAIN, distortion=(-0.21, 0.06, 0.002, -0.003, -0.002))


@pytest.mark.parametrize("camera", [PLAIN, DISTORTED], ids=["plain", "distorted"])
@given(seed=st.integers(0, 2**32 - 1))
def test_projection_equals_opencvs(camera: PinholeCamera, seed: int) -> None:
    rng = np.random.Generator(np.random.PCG64(seed))
    T = Transform(rotation=rotation_exp(rng.normal(0.0, 0.1, 3)), translation_m=rng.normal(0.0, 0.3, 3))
    xyz = rng.uniform([-8.0, -5.0, 3.0], [8.0, 5.0, 40.0], (50, 3))
    rotvec, _ = cv2.Rodrigues(T.rotation)
    oracle, _ = cv2.projectPoints(xyz, rotvec, T.translation_m, camera.matrix, np.array(camera.distortion))
    np.testing.assert_allclose(project_points(xyz, T, camera), oracle[:, 0], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("camera", [PLAIN, DISTORTED], ids=["plain", "distorted"])
def test_unprojection_undoes_projection_over_the_whole_image(camera: PinholeCamera) -> None:
    u, v = np.meshgrid(np.linspace(0, 960, 25), np.linspace(0, 600, 17))
    uv = np.stack([u.ravel(), v.ravel()], axis=1)
    rays = camera.unproject(uv)
    back = camera.project(np.column_stack([rays, np.ones(len(rays))]))
    np.testing.assert_allclose(back, uv, atol=2e-6)


def test_unprojection_says_nan_where_no_bearing_gives_the_pixel() -> None:
    strong = replace(PLAIN, distortion=(-0.5, 0.0, 0.0, 0.0, 0.0))  # r (1 - r^2 / 2) never exceeds 0.545
    assert np.isnan(strong.unproject(np.array([[480.5 + 0.9 * 432.1, 299.25]]))).all()


def test_a_point_on_the_optical_axis_lands_on_the_principal_point() -> None:
    np.testing.assert_allclose(PLAIN.project(np.array([[0.0, 0.0, 7.0]])), [[480.5, 299.25]])


def test_a_metre_right_and_down_at_ten_metres_is_a_tenth_of_the_focal_length() -> None:
    np.testing.assert_allclose(PLAIN.project(np.array([[1.0, 1.0, 10.0]])), [[523.71, 342.32]], atol=1e-9)


def test_points_behind_or_at_the_image_plane_have_no_pixel() -> None:
    xyz = np.array([[1.0, 1.0, -10.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.05], [np.nan, 0.0, 1.0]])
    assert np.isnan(PLAIN.project(xyz)).any(axis=1).all()


def test_a_box_holds_its_border_and_never_a_missing_pixel() -> None:
    uv = np.array([[1.0, 2.0], [3.0, 4.0], [2.0, 3.0], [3.01, 3.0], [2.0, 1.99], [np.nan, np.nan]])
    assert inside_box(uv, (1.0, 2.0, 3.0, 4.0)).tolist() == [True, True, True, False, False, False]
