"""The paper's calibration: exact on exact data, better with more, refused where data do not determine it."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.calibrate import (
    Extrinsics,
    Pairs,
    calibrate_pair,
    find_extrinsics,
    find_intrinsics,
    measure_pairs,
    outer_corners_px,
)
from fusion.calibrate_board import Board, CalibrationError, find_corners
from fusion.camera import PinholeCamera
from fusion.geometry import Transform, rotation_exp, rotation_rpy

BOARD = Board()
CAMERA = PinholeCamera(fx_px=600.0, fy_px=605.0, cx_px=470.0, cy_px=310.0, width_px=960, height_px=600)
# LiDAR x forward, y left, z up; camera x right, y down, z forward.
R_CAMERA_LIDAR = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


def mount(turn_deg: tuple[float, float, float] = (1.0, -2.0, 3.0)) -> Transform:
    """A T_camera_lidar."""
    turn = rotation_exp(np.deg2rad(turn_deg))
    return Transform(rotation=turn @ R_CAMERA_LIDAR, translation_m=np.array([0.1, -0.3, -0.4]))


def poses(
    count: int, rng: np.random.Generator, near_m: float = 3.0, far_m: float = 6.0, radius: float = 0.4
) -> list[Transform]:
    """T_camera_board of boards held before the camera; radius: of their centres' image, in units of fx."""
    found = []
    for range_m in np.linspace(near_m, far_m, count):
        turn = np.deg2rad([25.0, 40.0, 15.0]) * rng.uniform(-1.0, 1.0, 3)
        x, y = rng.uniform(-radius, radius, 2) * range_m
        found.append(
            Transform(
                rotation=rotation_rpy(float(turn[0]), float(turn[1]), float(turn[2])),
                translation_m=np.array([x, 0.5 * y, range_m]),
            )
        )
    return found


def pairs_of(held: list[Transform], T_camera_lidar: Transform, camera: PinholeCamera = CAMERA) -> Pairs:
    """Exact pairs."""
    in_camera = np.array([pose.apply(BOARD.outer_m) for pose in held])
    return Pairs(
        lidar_m=T_camera_lidar.inverse().apply(in_camera),
        image_px=np.array([camera.project(corners) for corners in in_camera]),
    )


def spoiled(pairs: Pairs, rng: np.random.Generator, click_px: float, corner_m: float) -> Pairs:
    return Pairs(
        lidar_m=pairs.lidar_m + corner_m * rng.standard_normal(pairs.lidar_m.shape),
        image_px=pairs.image_px + click_px * rng.standard_normal(pairs.image_px.shape),
    )


def residual_px(
    found: Extrinsics, true: Transform, xyz_lidar_m: np.ndarray, camera: PinholeCamera = CAMERA
) -> float:
    """How far points are mapped from where they should be, mean."""
    shown = camera.project(found.T_camera_lidar.apply(xyz_lidar_m))
    should = CAMERA.project(true.apply(xyz_lidar_m))
    return float(np.linalg.norm(shown - should, axis=1).mean())


@settings(max_examples=30)
@given(
    seed=st.integers(0, 2**32),
    count=st.integers(3, 12),
    turn=st.tuples(*[st.floats(-20.0, 20.0)] * 3),
)
def test_exact_pairs_give_the_exact_extrinsics(
    seed: int, count: int, turn: tuple[float, float, float]
) -> None:
    true = mount(turn)
    found = find_extrinsics(pairs_of(poses(count, np.random.default_rng(seed)), true), CAMERA)
    np.testing.assert_allclose(found.T_camera_lidar.rotation, true.rotation, atol=1e-6)
    np.testing.assert_allclose(found.T_camera_lidar.translation_m, true.translation_m, atol=1e-5)
    assert found.rms_px < 1e-3


@settings(max_examples=20)
@given(seed=st.integers(0, 2**32), focal=st.floats(400.0, 1500.0), across=st.floats(-20.0, 20.0))
def test_exact_corners_give_the_exact_camera_and_board_poses(seed: int, focal: float, across: float) -> None:
    camera = PinholeCamera(
        fx_px=focal, fy_px=1.01 * focal, cx_px=480.0 + across, cy_px=300.0, width_px=960, height_px=600
    )
    held = poses(8, np.random.default_rng(seed), radius=0.1)
    corners = [camera.project(pose.apply(BOARD.inner_m)) for pose in held]
    found = find_intrinsics(corners, BOARD, (960, 600))
    for name in ("fx_px", "fy_px", "cx_px", "cy_px"):
        assert getattr(found.camera, name) == pytest.approx(getattr(camera, name), rel=1e-3, abs=0.05)
    assert found.camera.distortion == (0.0,) * 5
    assert found.rms_px < 1e-3
    clicks = outer_corners_px(found, BOARD)
    np.testing.assert_allclose(clicks, pairs_of(held, mount(), camera).image_px, atol=0.01)


def test_the_same_corners_give_the_same_camera_to_the_last_digit() -> None:
    rng = np.random.default_rng(5)
    corners = [CAMERA.project(pose.apply(BOARD.inner_m)) for pose in poses(12, rng, radius=0.1)]
    clicked = [c + 0.1 * rng.standard_normal(c.shape) for c in corners]
    cameras = {find_intrinsics(clicked, BOARD, (960, 600)).camera for _ in range(30)}
    assert len(cameras) == 1


def test_distortion_is_found_only_where_it_is_asked_for() -> None:
    bent = PinholeCamera(
        fx_px=600.0, fy_px=600.0, cx_px=480.0, cy_px=300.0, width_px=960, height_px=600,
        distortion=(-0.1, 0.01, 0.0, 0.0, 0.0),
    )  # fmt: skip
    held = poses(20, np.random.default_rng(0), radius=0.5)
    corners = [bent.project(pose.apply(BOARD.inner_m)) for pose in held]
    fitted = find_intrinsics(corners, BOARD, (960, 600), fit_distortion=True)
    assert fitted.rms_px < 1e-3
    assert fitted.camera.distortion[0] == pytest.approx(-0.1, abs=2e-3)
    straight = find_intrinsics(corners, BOARD, (960, 600))  # a small residual hides a large error
    assert straight.rms_px > 0.1
    assert abs(straight.camera.fx_px / bent.fx_px - 1.0) > 0.05


def test_four_times_the_poses_halve_the_error() -> None:
    true, shown = mount(), np.array([[4.0, 0.0, 0.0], [5.0, 1.0, 0.5], [5.0, -1.0, -0.5]])

    def rms(count: int) -> float:
        errors = []
        for seed in range(60):
            rng = np.random.default_rng([seed, count])
            pairs = spoiled(pairs_of(poses(count, rng), true), rng, click_px=1.0, corner_m=0.01)
            errors.append(residual_px(find_extrinsics(pairs, CAMERA), true, shown))
        return float(np.sqrt(np.mean(np.square(errors))))

    assert rms(6) / rms(24) == pytest.approx(2.0, abs=0.4)


def test_outside_the_volume_where_the_board_was_held_the_mapping_is_worse() -> None:
    true = mount()
    inside: list[float] = []
    far: list[float] = []
    aside: list[float] = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        pairs = spoiled(pairs_of(poses(15, rng, radius=0.25), true), rng, click_px=1.0, corner_m=0.01)
        found = find_extrinsics(pairs, CAMERA)
        for shown, errors in (
            ([[4.0, 0.3, 0.0]], inside),
            ([[20.0, 1.5, 0.0]], far),
            ([[4.0, 3.0, 0.0]], aside),
        ):
            errors.append(residual_px(found, true, np.array(shown)))
    assert np.mean(far) > 1.3 * np.mean(inside)
    assert np.mean(aside) > 1.5 * np.mean(inside)


def test_one_wrong_click_does_not_turn_the_rest() -> None:
    true, rng = mount(), np.random.default_rng(4)
    pairs = spoiled(pairs_of(poses(10, rng), true), rng, click_px=0.5, corner_m=0.0)
    image = pairs.image_px.copy()
    image[3, 1] += 60.0
    found = find_extrinsics(Pairs(lidar_m=pairs.lidar_m, image_px=image), CAMERA)
    middle = np.array([[4.5, 0.0, 0.0]])
    before = Extrinsics(T_camera_lidar=found.first, first=found.first, residual_px=found.residual_px)
    assert residual_px(before, true, middle) > 1.0  # plain least squares is pulled along
    assert residual_px(found, true, middle) < 0.35


# -- pictures ----------------------------------------------------------------------------------------------


def picture(T_camera_board: Transform, dark: int = 30) -> np.ndarray:
    """The board as a straight lens shows it, by warping a fine drawing of it."""
    scale = 400.0  # pixels per metre of the drawing
    drawn = np.full((round(BOARD.height_m * scale), round(BOARD.width_m * scale)), 220, dtype=np.uint8)
    for row, column in np.argwhere(BOARD.black):
        y0 = (row - 0.5 * BOARD.rows) * BOARD.square_m + 0.5 * BOARD.height_m
        x0 = (column - 0.5 * BOARD.columns) * BOARD.square_m + 0.5 * BOARD.width_m
        first, last = (
            np.rint(np.array([y0, x0]) * scale),
            np.rint((np.array([y0, x0]) + BOARD.square_m) * scale),
        )
        drawn[int(first[0]) : int(last[0]), int(first[1]) : int(last[1])] = dark
    fine = 4
    corners = (CAMERA.project(T_camera_board.apply(BOARD.outer_m)) * fine).astype(np.float32)
    size = np.array([BOARD.width_m, BOARD.height_m]) * scale
    source = np.array([[0, 0], [size[0], 0], [size[0], size[1]], [0, size[1]]], dtype=np.float32)
    warp = cv2.getPerspectiveTransform(source - 0.5, corners - 0.5)
    shape = (CAMERA.width_px * fine, CAMERA.height_px * fine)
    large = cv2.warpPerspective(drawn, warp, shape, flags=cv2.INTER_LINEAR, borderValue=(120.0,))
    small = cv2.resize(large, (CAMERA.width_px, CAMERA.height_px), interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.uint8)


@pytest.mark.parametrize("roll_deg", [0.0, 170.0, -20.0])
def test_corners_are_found_to_a_fifth_of_a_pixel_and_named_by_the_colours(roll_deg: float) -> None:
    held = Transform(
        rotation=rotation_rpy(0.2, -0.4, float(np.deg2rad(roll_deg))),
        translation_m=np.array([0.4, -0.2, 4.0]),
    )
    found = find_corners(picture(held), BOARD)
    assert found is not None
    true = CAMERA.project(held.apply(BOARD.inner_m))
    assert np.linalg.norm(found - true, axis=1).mean() < 0.2


def test_no_board_no_corners() -> None:
    assert find_corners(np.full((600, 960), 120, dtype=np.uint8), BOARD) is None


def points_on(T_lidar_board: Transform) -> np.ndarray:
    """A grid of points on the board."""
    x, y = np.meshgrid(np.arange(-0.585, 0.6, 0.03), np.arange(-0.435, 0.45, 0.03))
    return T_lidar_board.apply(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]))


def test_the_whole_way_from_pictures_and_points() -> None:
    true, rng = mount(), np.random.default_rng(7)
    held = poses(6, rng, far_m=4.5, radius=0.25)
    pictures = [picture(pose) for pose in held] + [np.full((600, 960), 120, dtype=np.uint8)]
    scans = [points_on(true.inverse() @ pose) for pose in held] + [np.zeros((0, 3))]
    found = calibrate_pair(pictures, scans, BOARD, np.random.default_rng(0))
    assert found.measured.used == tuple(range(6))
    assert "not found" in found.measured.left_out[6]
    assert found.measured.intrinsics.rms_px < 0.2
    camera = found.measured.intrinsics.camera
    assert residual_px(found.extrinsics, true, np.array([[4.0, 0.2, 0.0]]), camera) < 1.0
    assert np.linalg.norm(found.extrinsics.T_camera_lidar.translation_m - true.translation_m) < 0.05


# -- what is refused ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("turn_rad", [(0.0, 0.0, 0.0), (0.3, 0.4, 0.1)])
def test_boards_that_all_face_the_same_way_are_refused(turn_rad: tuple[float, float, float]) -> None:
    held = [
        Transform(rotation=rotation_rpy(*turn_rad), translation_m=np.array([x, 0.0, z]))
        for x, z in ((0.0, 3.0), (0.5, 4.0), (-0.5, 5.0))
    ]
    corners = [CAMERA.project(pose.apply(BOARD.inner_m)) for pose in held]
    with pytest.raises(CalibrationError, match="face the same way"):
        find_intrinsics(corners, BOARD, (960, 600))


def test_two_views_are_too_few() -> None:
    held = poses(2, np.random.default_rng(0))
    with pytest.raises(CalibrationError, match="2 pictures; at least 3"):
        find_intrinsics([CAMERA.project(p.apply(BOARD.inner_m)) for p in held], BOARD, (960, 600))
    with pytest.raises(CalibrationError, match="2 poses of the board; at least 3"):
        find_extrinsics(pairs_of(held, mount()), CAMERA)


def test_boards_in_one_plane_are_refused() -> None:
    held = [Transform(rotation=np.eye(3), translation_m=np.array([x, 0.0, 4.0])) for x in (-1.5, 0.0, 1.5)]
    with pytest.raises(CalibrationError, match="nearly in one plane"):
        find_extrinsics(pairs_of(held, mount()), CAMERA)


def test_a_corner_that_is_not_finite_is_refused() -> None:
    pairs = pairs_of(poses(4, np.random.default_rng(0)), mount())
    image = pairs.image_px.copy()
    image[1, 2, 0] = np.nan
    with pytest.raises(CalibrationError, match="not finite"):
        find_extrinsics(Pairs(lidar_m=pairs.lidar_m, image_px=image), CAMERA)


def test_pictures_without_a_board_are_refused() -> None:
    blank = [np.full((600, 960), 120, dtype=np.uint8)] * 3
    with pytest.raises(CalibrationError, match="found in none of 3 pictures"):
        measure_pairs(blank, [np.zeros((0, 3))] * 3, BOARD, np.random.default_rng(0))
    with pytest.raises(CalibrationError, match="3 pictures and 1 LiDAR scans"):
        measure_pairs(blank, [np.zeros((0, 3))], BOARD, np.random.default_rng(0))
    with pytest.raises(CalibrationError, match="differ in size"):
        sizes = [*blank[:2], np.zeros((300, 480), dtype=np.uint8)]
        measure_pairs(sizes, [np.zeros((0, 3))] * 3, BOARD, np.random.default_rng(0))


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ({"columns": 8, "rows": 6, "square_m": 0.1}, "half turn"),
        ({"columns": 2}, "half turn or has too few"),
        ({"square_m": 0.2}, "white border"),
        ({"width_m": 1.1, "height_m": 1.1}, "wider than high"),
    ],
)
def test_a_board_whose_corners_have_no_names_is_refused(wrong: dict[str, float], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        Board(**wrong)  # type: ignore[arg-type]


def test_the_board_by_hand() -> None:
    """8 x 5 squares of 0.13 m: 7 x 4 corners, the first at -3 squares across and -1.5 down."""
    np.testing.assert_allclose(BOARD.inner_m[0], [-0.39, -0.195, 0.0])
    np.testing.assert_allclose(BOARD.inner_m[6], [0.39, -0.195, 0.0], atol=1e-12)
    np.testing.assert_allclose(BOARD.inner_m[-1], [0.39, 0.195, 0.0], atol=1e-12)
    np.testing.assert_allclose(BOARD.outer_m[[0, 2], :2], [[-0.6, -0.45], [0.6, 0.45]])
    assert BOARD.black[0, 0] and not BOARD.black[0, 1] and BOARD.black.sum() == 20
