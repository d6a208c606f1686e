"""The board's corners from LiDAR points: within the beams' spacing, however it is held."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.calibrate_board import Board, CalibrationError
from fusion.calibrate_lidar import board_in_lidar
from fusion.geometry import Transform, rotation_rpy
from fusion.synthetic import beams

BOARD = Board()
# A board that faces a LiDAR ahead of it: x right is the LiDAR's -y, y down its -z, z away its x.
FACING = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
BEAMS = beams(64, 1024, float(np.deg2rad(16.6)))


def held(range_m: float = 4.0, turn_deg: tuple[float, float, float] = (10.0, 20.0, 8.0)) -> Transform:
    """T_lidar_board: turned about its own x, y, z."""
    x, y, z = np.deg2rad(turn_deg)
    turn = rotation_rpy(float(x), float(y), float(z))
    return Transform(rotation=FACING @ turn, translation_m=np.array([range_m, 0.3, -0.1]))


def scan(T_lidar_board: Transform, rng: np.random.Generator, noise_m: float = 0.0) -> np.ndarray:
    """Where a 64-beam LiDAR's beams meet the board, ranges with noise."""
    normal, centre = T_lidar_board.rotation[:, 2], T_lidar_board.translation_m
    with np.errstate(divide="ignore"):
        range_m = (normal @ centre) / (BEAMS @ normal)
    met = T_lidar_board.inverse().apply(BEAMS * range_m[:, None])
    on = (range_m > 0.0) & (np.abs(met[:, 0]) <= 0.6) & (np.abs(met[:, 1]) <= 0.45)
    return np.asarray(BEAMS[on] * (range_m[on] + noise_m * rng.standard_normal(on.sum()))[:, None])


def corner_error_m(found: np.ndarray, T_lidar_board: Transform) -> float:
    return float(np.linalg.norm(found - T_lidar_board.apply(BOARD.outer_m), axis=1).max())


@settings(max_examples=40)
@given(
    seed=st.integers(0, 2**32),
    range_m=st.floats(3.0, 6.0),
    turn=st.tuples(st.floats(-25.0, 25.0), st.floats(-40.0, 40.0), st.floats(-30.0, 30.0)),
)
def test_corners_are_found_to_within_half_the_rows_spacing(
    seed: int, range_m: float, turn: tuple[float, float, float]
) -> None:
    rng = np.random.default_rng(seed)
    board = held(range_m, turn)
    found = board_in_lidar(scan(board, rng, noise_m=0.015), BOARD, rng)
    spacing_m = 1.5 * range_m * np.deg2rad(0.53)  # of rows, on a board that is tilted
    assert corner_error_m(found.corners_m, board) < 0.5 * spacing_m + 0.025
    # Along the beam the noise is 15 mm; off the plane it is less by the tilt.
    assert 0.008 < found.plane_rms_m < 0.018


def test_over_many_boards_the_corners_are_not_off_to_one_side() -> None:
    rng = np.random.default_rng(1)
    off = []
    for _ in range(40):
        board = held(float(rng.uniform(3.5, 5.5)), tuple(rng.uniform(-1.0, 1.0, 3) * (20.0, 30.0, 12.0)))
        found = board_in_lidar(scan(board, rng, noise_m=0.015), BOARD, rng)
        off.append((board.inverse().apply(found.corners_m) - BOARD.outer_m).mean(axis=0))
    spread = np.std(off, axis=0)
    assert (spread[:2] < 0.010).all()
    assert (np.abs(np.mean(off, axis=0)) < 3.0 * spread / np.sqrt(40.0) + 1e-3).all()


def test_ground_and_stray_points_around_the_board_do_not_move_it() -> None:
    rng = np.random.default_rng(2)
    board = held()
    clean = scan(board, rng, noise_m=0.01)
    ground = np.column_stack([rng.uniform(3.3, 4.7, 120), rng.uniform(-0.5, 1.1, 120), np.full(120, -0.75)])
    stray = board.translation_m + rng.uniform(-0.9, 0.9, (25, 3))
    lost = np.full((3, 3), np.nan)
    found = board_in_lidar(np.vstack([clean, ground, stray, lost]), BOARD, rng)
    alone = board_in_lidar(clean, BOARD, rng)
    assert corner_error_m(alone.corners_m, board) < 0.02
    assert corner_error_m(found.corners_m, board) < 0.03


def test_corners_are_named_from_the_upper_left_as_the_lidar_sees_it() -> None:
    board = held(turn_deg=(0.0, 0.0, 0.0))
    found = board_in_lidar(scan(board, np.random.default_rng(0)), BOARD, np.random.default_rng(0)).corners_m
    assert found[0, 1] > found[1, 1]  # left is y
    assert found[0, 2] > found[3, 2]  # up is z


@pytest.mark.parametrize(
    ("points", "why"),
    [
        (np.zeros((5, 3)), "5 LiDAR points"),
        (np.column_stack([np.full(40, 4.0), np.linspace(-0.6, 0.6, 40), np.zeros(40)]), "plane|line"),
        (np.random.default_rng(0).uniform(-9.0, 9.0, (60, 3)), "plane"),
    ],
)
def test_points_that_are_no_board_are_refused(points: np.ndarray, why: str) -> None:
    with pytest.raises(CalibrationError, match=why):
        board_in_lidar(points, BOARD, np.random.default_rng(0))


def test_a_board_that_lies_flat_is_refused() -> None:
    x, y = np.meshgrid(np.linspace(3.4, 4.6, 30), np.linspace(-0.45, 0.45, 30))
    flat = np.column_stack([x.ravel(), y.ravel(), np.full(900, -1.0)])
    with pytest.raises(CalibrationError, match="flat"):
        board_in_lidar(flat, BOARD, np.random.default_rng(0))


def test_less_than_half_a_board_is_refused() -> None:
    board = held(turn_deg=(0.0, 0.0, 0.0))
    whole = scan(board, np.random.default_rng(0))
    left = whole[board.inverse().apply(whole)[:, 0] < -0.1]
    with pytest.raises(CalibrationError, match="less than half"):
        board_in_lidar(left, BOARD, np.random.default_rng(0))


def test_a_board_that_is_held_on_end_is_refused() -> None:
    """Its long side upright: the corners would get each other's names."""
    board = held(turn_deg=(0.0, 0.0, 70.0))
    with pytest.raises(CalibrationError, match="upright"):
        board_in_lidar(scan(board, np.random.default_rng(0)), BOARD, np.random.default_rng(0))


def test_things_in_the_boards_plane_beside_it_do_not_pull_it() -> None:
    """A post 15 cm beside the right edge, as far as the board."""
    rng = np.random.default_rng(3)
    board = held(turn_deg=(0.0, 10.0, 5.0))
    x, y = np.meshgrid(np.linspace(0.75, 0.85, 5), np.linspace(-0.45, 0.45, 30))
    post = board.apply(np.column_stack([x.ravel(), y.ravel(), np.zeros(150)]))
    clean = scan(board, rng, noise_m=0.01)
    alone = board_in_lidar(clean, BOARD, rng).corners_m
    found = board_in_lidar(np.vstack([clean, post]), BOARD, rng).corners_m
    assert np.linalg.norm(found - alone, axis=1).max() < 0.003


def test_noise_of_the_range_does_not_move_points_within_the_plane() -> None:
    """On a board seen at 55 degrees 40 mm along the beam are 33 mm across the board; the beams are still."""
    board = held(3.5, (0.0, 55.0, 6.0))
    exact = board_in_lidar(scan(board, np.random.default_rng(0)), BOARD, np.random.default_rng(0)).corners_m
    for seed in range(5):
        rng = np.random.default_rng(seed)
        noisy = board_in_lidar(scan(board, rng, noise_m=0.02), BOARD, rng).corners_m
        across = board.inverse().apply(noisy)[:, :2] - board.inverse().apply(exact)[:, :2]
        assert np.abs(across).max() < 0.006
