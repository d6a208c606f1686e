"""Step 1: the ground goes, what stands on it stays, and nothing outside the region is kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.geometry import Transform, rotation_rpy
from fusion.ground import GroundConfig, ransac_trials, remove_ground

LEVEL = Transform(rotation=np.eye(3), translation_m=np.array([0.0, 0.0, 1.8]))


def scene(
    seed: int, T_ego_lidar: Transform, ground: int = 3000, standing: int = 1500
) -> tuple[np.ndarray, np.ndarray]:
    """Points [n 3] in the LiDAR frame, and which [n] are ground: a plane, and points 0.3 to 2.5 m above."""
    rng = np.random.Generator(np.random.PCG64(seed))
    flat = np.column_stack([rng.uniform(-34, 34, ground), rng.uniform(-14, 14, ground), np.zeros(ground)])
    above = np.column_stack(
        [rng.uniform(-34, 34, standing), rng.uniform(-14, 14, standing), rng.uniform(0.3, 2.5, standing)]
    )
    flat[:, 2] += np.clip(rng.normal(0.0, 0.02, ground), -0.06, 0.06)
    xyz_ego = np.concatenate([flat, above])
    is_ground = np.arange(ground + standing) < ground
    order = rng.permutation(len(xyz_ego))
    return T_ego_lidar.inverse().apply(xyz_ego[order]).astype(np.float32), is_ground[order]


def test_the_papers_numbers_give_sixteen_trials() -> None:
    assert np.ceil(ransac_trials(0.99, 0.2, 6)) == 16
    assert ransac_trials(0.99, 0.2, 6) == pytest.approx(np.log(0.01) / np.log(1 - 0.8**6))


def test_without_outliers_one_trial_is_enough_and_without_inliers_none_is() -> None:
    assert ransac_trials(0.99, 0.0, 6) == 1.0
    assert ransac_trials(0.99, 1.0, 6) == np.inf


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    roll=st.floats(-0.1, 0.1),
    pitch=st.floats(-0.1, 0.1),
    yaw=st.floats(-3.1, 3.1),
)
def test_ground_is_removed_and_what_stands_on_it_kept_however_the_lidar_is_mounted(
    seed: int, roll: float, pitch: float, yaw: float
) -> None:
    T = Transform(rotation=rotation_rpy(roll, pitch, yaw), translation_m=np.array([0.3, -0.2, 1.5]))
    xyz, is_ground = scene(seed, T)
    removal = remove_ground(xyz, T, GroundConfig())
    assert np.mean(removal.keep[~is_ground]) > 0.98
    assert np.mean(removal.keep[is_ground]) < 0.02


def test_the_plane_is_reported_in_the_lidar_frame() -> None:
    T = Transform(rotation=rotation_rpy(0.05, -0.08, 0.7), translation_m=np.array([0.3, -0.2, 1.5]))
    xyz, is_ground = scene(3, T)
    plane = remove_ground(xyz, T, GroundConfig()).plane
    assert plane is not None
    distance = xyz[is_ground] @ plane.normal_lidar + plane.offset_m
    assert np.abs(distance).mean() < 0.03
    np.testing.assert_allclose(plane.normal_lidar, T.rotation.T @ [0, 0, 1], atol=0.01)
    assert plane.offset_m == pytest.approx(1.5, abs=0.05)
    assert plane.inlier_share == pytest.approx(3000 / 4500, abs=0.05)


@pytest.mark.parametrize(
    ("point", "kept"),
    [
        ((34.9, 0.0, 1.0), True),
        ((35.1, 0.0, 1.0), False),
        ((-35.1, 0.0, 1.0), False),
        ((0.0, 14.9, 1.0), True),
        ((0.0, -15.1, 1.0), False),
        ((5.0, 5.0, 0.21), True),
        ((5.0, 5.0, 0.19), False),
        ((5.0, 5.0, -0.19), False),
        ((5.0, 5.0, -0.21), True),
        ((np.nan, 5.0, 1.0), False),
        ((5.0, 5.0, np.inf), False),
    ],
)
def test_a_point_is_kept_inside_the_region_and_off_the_plane_on_either_side(
    point: tuple[float, float, float], kept: bool
) -> None:
    rng = np.random.Generator(np.random.PCG64(0))
    flat = np.column_stack([rng.uniform(-30, 30, 500), rng.uniform(-12, 12, 500), np.zeros(500)])
    xyz = np.concatenate([flat, [point]]) - [0.0, 0.0, 1.8]
    assert remove_ground(xyz.astype(np.float32), LEVEL, GroundConfig()).keep[-1] == kept


def test_eighty_per_cent_of_inliers_end_the_search_at_sixteen_trials() -> None:
    xyz, _ = scene(0, LEVEL, ground=4500, standing=300)
    assert remove_ground(xyz, LEVEL, GroundConfig()).trials == 16
    crowded, _ = scene(0, LEVEL, ground=2000, standing=2000)
    assert remove_ground(crowded, LEVEL, GroundConfig()).trials > 16


def test_the_papers_acceptance_rule_removes_nothing_from_a_scene_with_a_third_of_outliers() -> None:
    xyz, _ = scene(0, LEVEL)
    removal = remove_ground(xyz, LEVEL, GroundConfig.paper())
    assert removal.plane is None and removal.trials == 16 and removal.keep.all()
    easy, is_ground = scene(0, LEVEL, ground=4500, standing=300)
    removal = remove_ground(easy, LEVEL, GroundConfig.paper())
    assert removal.plane is not None and not removal.keep[is_ground].all()


def test_a_wall_is_not_taken_for_ground() -> None:
    rng = np.random.Generator(np.random.PCG64(1))
    wall = np.column_stack([np.full(2000, 8.0), rng.uniform(-14, 14, 2000), rng.uniform(-1.8, 3.0, 2000)])
    removal = remove_ground(wall.astype(np.float32), LEVEL, GroundConfig())
    assert removal.plane is None or abs(removal.plane.normal_lidar[2]) > np.cos(np.deg2rad(15.1))
    assert np.mean(removal.keep) > 0.85


def test_a_bank_steeper_than_fifteen_degrees_is_not_taken_for_ground_even_if_it_has_more_points() -> None:
    rng = np.random.Generator(np.random.PCG64(4))
    x, y = rng.uniform(-30, 30, 4000), rng.uniform(-12, 12, 4000)
    height = np.where(np.arange(4000) < 2600, np.tan(np.deg2rad(25.0)) * (x + 30.0), 0.0)
    xyz = np.column_stack([x, y, height]) - [0.0, 0.0, 1.8]
    keep = remove_ground(xyz.astype(np.float32), LEVEL, GroundConfig()).keep
    assert not keep[2600:].any() and keep[:2600].mean() > 0.95


@pytest.mark.parametrize("count", [0, 1, 5])
def test_too_few_points_have_no_plane_and_are_kept(count: int) -> None:
    removal = remove_ground(np.ones((count, 3), np.float32), LEVEL, GroundConfig())
    assert removal.plane is None and removal.keep.sum() == count


def test_points_that_span_no_plane_have_none() -> None:
    line = np.outer(np.linspace(-10, 10, 200), [1.0, 0.5, 0.0]).astype(np.float32)
    for points in (line, np.ones((200, 3), np.float32)):
        removal = remove_ground(points, LEVEL, GroundConfig())
        assert removal.plane is None and removal.keep.all()


def test_the_same_scan_gives_the_same_points_and_another_seed_may_not() -> None:
    xyz, _ = scene(5, LEVEL)
    first = remove_ground(xyz, LEVEL, GroundConfig())
    again = remove_ground(xyz, LEVEL, GroundConfig())
    other = remove_ground(xyz, LEVEL, replace(GroundConfig(), seed=1))
    assert first.plane is not None and again.plane is not None and other.plane is not None
    assert first.keep.tobytes() == again.keep.tobytes()
    assert first.plane.offset_m == again.plane.offset_m != other.plane.offset_m
