"""Pixel directions against projection, OpenCV and the fans made of them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.camera import PinholeCamera
from scenarios.errors import BadInput
from simbench.sensors.lens import pixel_directions, row_fans
from simbench.sensors.ray_kernel import LANES

Distortion = tuple[float, float, float, float, float]


def camera(distortion: Distortion = (0.0, 0.0, 0.0, 0.0, 0.0), focal_px: float = 90.0) -> PinholeCamera:
    return PinholeCamera(
        fx_px=focal_px, fy_px=focal_px * 0.97, cx_px=46.5, cy_px=31.0, width_px=96, height_px=60,
        distortion=distortion,
    )  # fmt: skip


def centres() -> np.ndarray:
    """The pixels' centres, row by row."""
    u, v = np.meshgrid(np.arange(96) + 0.5, np.arange(60) + 0.5)
    return np.stack([u.ravel(), v.ravel()], axis=1)


LENSES = st.tuples(
    st.floats(-0.2, 0.3), st.floats(-0.05, 0.05), st.floats(-0.005, 0.005), st.floats(-0.005, 0.005),
    st.floats(-0.01, 0.01),
)  # fmt: skip


@settings(max_examples=40)
@given(distortion=LENSES)
def test_a_whole_picture_s_directions_are_the_bits_that_its_pixels_have_one_by_one(
    distortion: Distortion,
) -> None:
    lens = camera(distortion)
    direction = np.concatenate([lens.unproject(centres()), np.ones((len(centres()), 1))], axis=1)
    direction /= np.sqrt(np.einsum("ni,ni->n", direction, direction))[:, None]
    assert np.array_equal(pixel_directions(lens).reshape(-1, 3), direction)


@settings(max_examples=40)
@given(distortion=LENSES)
def test_a_point_along_a_pixels_direction_falls_on_its_centre(distortion: Distortion) -> None:
    lens = camera(distortion)
    direction = pixel_directions(lens).reshape(-1, 3)
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1.0, atol=1e-14)
    np.testing.assert_allclose(lens.project(7.0 * direction), centres(), atol=2e-6)


@settings(max_examples=10)
@given(distortion=LENSES)
def test_opencv_projects_the_directions_onto_the_centres(distortion: Distortion) -> None:
    lens = camera(distortion)
    direction = pixel_directions(lens).reshape(-1, 3)
    found, _ = cv2.projectPoints(direction, np.zeros(3), np.zeros(3), lens.matrix, np.array(distortion))
    np.testing.assert_allclose(np.asarray(found).reshape(-1, 2), centres(), atol=2e-6)


def test_opencv_undistorts_the_centres_to_the_directions() -> None:
    distortion = (-0.12, 0.02, 0.001, -0.002, 0.0)
    lens = camera(distortion)
    found = cv2.undistortPoints(centres()[:, None], lens.matrix, np.array(distortion))
    direction = pixel_directions(lens).reshape(-1, 3)
    np.testing.assert_allclose(direction[:, :2] / direction[:, 2:], found[:, 0], atol=2e-5)  # it stops early


def test_the_first_pixel_looks_half_a_pixel_inside_the_corner() -> None:
    direction = pixel_directions(camera())[0, 0]
    expected = np.array([(0.5 - 46.5) / 90.0, (0.5 - 31.0) / 87.3, 1.0])
    np.testing.assert_allclose(direction, expected / np.linalg.norm(expected), atol=1e-15)


def test_a_barrel_lens_sees_wider_at_the_corner_and_the_same_in_the_middle() -> None:
    plain, barrel = pixel_directions(camera()), pixel_directions(camera((-0.2, 0.0, 0.0, 0.0, 0.0)))
    assert barrel[0, 0, 2] < plain[0, 0, 2] - 0.005
    np.testing.assert_allclose(barrel[31, 46], plain[31, 46], atol=1e-4)


def test_directions_are_made_once_and_cannot_be_written_to() -> None:
    assert pixel_directions(camera()) is pixel_directions(camera())
    with pytest.raises(ValueError, match="read-only"):
        pixel_directions(camera())[0, 0, 0] = 1.0


@pytest.mark.parametrize("k1", [-1.5, -0.6])
def test_a_lens_that_folds_the_picture_is_refused_with_the_pixel(k1: float) -> None:
    with pytest.raises(BadInput, match="no direction"):
        pixel_directions(camera((k1, 0.0, 0.0, 0.0, 0.0)))


@settings(max_examples=20)
@given(distortion=LENSES)
def test_the_fans_of_the_rows_look_along_the_same_directions(distortion: Distortion) -> None:
    lens = camera(distortion)
    direction, fans = pixel_directions(lens), row_fans(lens)
    for row in range(60):
        pack = 0 if len(fans.slope) == 1 else row // LANES
        slope = fans.scale[row] * fans.slope[pack, :, row % LANES]
        skew = fans.skew[pack, :, row % LANES]
        ahead, across, aside = fans.frame[row].T
        found = ahead + slope[:, None] * across + skew[:, None] * aside
        found /= np.linalg.norm(found, axis=1)[:, None]
        np.testing.assert_allclose(found, direction[row], atol=1e-12)
        assert fans.out_at[row] == row * 96
