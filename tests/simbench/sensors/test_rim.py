"""Sampled outlines: against their closed form, and where each point is when the row under it is exposed."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.camera import PinholeCamera
from simbench.sensors import rays
from simbench.sensors.outline import NEAR_M, outline_px
from simbench.sensors.rim import extent_px, rim_points

CAMERA = PinholeCamera(fx_px=500.0, fy_px=480.0, cx_px=320.0, cy_px=240.0, width_px=640, height_px=480)
BENT = replace(CAMERA, distortion=(-0.25, 0.06, 0.001, -0.001, 0.0))
ROUND = (rays.SPHERE, rays.CAPSULE, rays.ELLIPSOID, rays.CYLINDER, rays.BOX)
ROWS = np.array([0, 100, 200, 300])


def seen_at(*uv_px: tuple[float, float]) -> np.ndarray:
    """Points [k 1 3] that the straight camera has at these pixels, one an instant."""
    slope = CAMERA.unproject(np.array(uv_px))
    return np.column_stack([slope, np.ones(len(slope))])[:, None] * 4.0


@settings(max_examples=60)
@given(kinds=st.lists(st.sampled_from(ROUND), min_size=1, max_size=3), seed=st.integers(0, 2**31))
def test_the_rims_span_the_analytic_outline(kinds: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    size = rng.uniform(0.05, 1.0, (len(kinds), 3))
    rotation = np.empty((len(kinds), 3, 3))
    for i, q in enumerate(rng.standard_normal((len(kinds), 4))):
        matrix = np.empty(9)
        mujoco.mju_quat2Mat(matrix, q / np.linalg.norm(q))
        rotation[i] = matrix.reshape(3, 3)
    centre = np.column_stack([rng.uniform(-3, 3, (len(kinds), 2)), rng.uniform(4.0, 20.0, len(kinds))])
    exact = outline_px(np.array(kinds), size, rotation, centre, CAMERA)
    points = rim_points(np.array(kinds), size, rotation[None], centre[None], 2)
    assert exact is not None and points is not None
    uv = CAMERA.project(points[0])
    found = np.concatenate([uv.min(axis=0), uv.max(axis=0)])
    size_px = max(exact[2] - exact[0], exact[3] - exact[1])
    np.testing.assert_allclose(found, exact, rtol=0, atol=2e-3 * size_px)
    assert np.all(found[:2] >= np.array(exact[:2]) - 1e-9)
    assert np.all(found[2:] <= np.array(exact[2:]) + 1e-9)


def test_inside_a_ball_there_is_no_rim() -> None:
    assert (
        rim_points(np.array([rays.SPHERE]), np.ones((1, 3)), np.eye(3)[None, None], np.zeros((1, 1, 3)), 2)
        is None
    )


@pytest.mark.parametrize("axis", range(3))
def test_a_rim_is_whole_whichever_axis_of_a_primitive_the_camera_looks_along(axis: int) -> None:
    rotation = np.roll(np.eye(3), axis, axis=0)[None]
    kind, size, centre = np.array([rays.ELLIPSOID]), np.array([[0.3, 0.5, 0.8]]), np.array([[0.0, 0.0, 6.0]])
    exact = outline_px(kind, size, rotation, centre, CAMERA)
    points = rim_points(kind, size, rotation[None], centre[None], 2)
    assert exact is not None and points is not None
    np.testing.assert_allclose(extent_px(points, ROWS[:1], CAMERA, np.inf), exact, rtol=0, atol=0.1)


@pytest.mark.parametrize(
    ("v_px", "u_px"),
    [
        pytest.param(150.0, 114.95, id="between the second and the third instant"),
        pytest.param(250.0, 124.95, id="between the last two"),
        pytest.param(-30.0, 100.0, id="above the first row: at the first instant"),
        pytest.param(400.0, 130.0, id="below the last row: at the last instant"),
    ],
)
def test_a_point_that_moves_ten_pixels_a_hundred_rows_is_where_its_row_finds_it(
    v_px: float, u_px: float
) -> None:
    points = seen_at(*((100.0 + 10.0 * k, v_px) for k in range(4)))
    assert extent_px(points, ROWS, CAMERA, np.inf) == pytest.approx((u_px, v_px, u_px, v_px), abs=1e-9)


def test_a_point_that_falls_is_met_later_by_the_rows_that_follow_it() -> None:
    """From v = 100 by 50 px in 100 rows: row r is exposed at v = r + 0.5 where 100 + r / 2 = r + 0.5."""
    points = seen_at(*((200.0, 100.0 + 50.0 * k) for k in range(4)))
    found = extent_px(points, ROWS, CAMERA, np.inf)
    assert found == pytest.approx((200.0, 199.5, 200.0, 199.5), abs=1e-9)


def test_where_one_point_is_too_near_there_is_no_extent() -> None:
    points = np.concatenate([seen_at((100.0, 50.0)), seen_at((200.0, 90.0))], axis=1)
    assert extent_px(points, ROWS[:1], CAMERA, np.inf) is not None
    points[0, 1] *= 0.99 * NEAR_M / points[0, 1, 2]
    assert extent_px(points, ROWS[:1], CAMERA, np.inf) is None


@given(x=st.floats(-3.0, 3.0), y=st.floats(-3.0, 3.0), most=st.floats(0.3, 1.0))
def test_beyond_the_corners_a_lens_that_bends_is_taken_to_do_as_at_their_distance(
    x: float, y: float, most: float
) -> None:
    point, length = np.array([[[x, y, 1.0]]]), float(np.hypot(x, y))
    for camera, drawn in ((CAMERA, 1.0), (BENT, min(1.0, most / max(length, 1e-12)))):
        u, v = camera.project(np.array([[x * drawn, y * drawn, 1.0]]))[0]
        assert extent_px(point, ROWS[:1], camera, most) == pytest.approx((u, v, u, v), abs=1e-9)
